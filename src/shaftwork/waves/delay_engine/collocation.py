"""Collocation on one panel: the nodes, the polynomials through them, and whether these resolve waves and states."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre

from shaftwork.integrate.problem import Array
from shaftwork.numerics.polynomials import radau_nodes, to_integrals, to_legendre, to_powers

STAGES = 8
# The part of the tolerance that what a panel leaves out may take.
RESOLVED = 0.1

# Gauss points of [-1, 1], where the values of all waves and states are kept, and their weights.
POINTS, WEIGHTS = legendre.leggauss(STAGES)
# Values at the points (k, s) times this are the coefficients (k, s) of the Legendre polynomials.
LEGENDRE = to_legendre(POINTS).T
# Values at the points to powers of xi. The powers of a polynomial of Legendre coefficients that decay are harmless.
POWERS = to_powers(POINTS).T
# Value at the panel's start and at the points to powers of xi: the collocation polynomial of a state.
STATE_POWERS = to_powers(np.append(-1.0, POINTS)).T
# Value, slope and curvature in xi at both ends of a panel, from the values at the points.
_DERIVATIVES = np.array([[1.0, 0.0, 0.0], *([1.0, k, k * (k - 1.0)] for k in range(1, STAGES))])
RIGHT = POWERS @ _DERIVATIVES
LEFT = POWERS @ (_DERIVATIVES * (-1.0) ** np.subtract.outer(np.arange(STAGES), np.arange(3)))


@dataclass(frozen=True)
class Scheme:
    """A collocation scheme on [0, 1] that speaks to others in values at the Gauss points.

    Args:
        nodes: (s,) nodes in (0, 1].
        matrix: (s, s) integrals of the node polynomials from 0 to each node.
        close: (s,) weights of the nodes' increments in the increment over the whole panel.
        bring: (s, s) values (k, s) at the Gauss points times this are values at the nodes.
        give: (s, s) the way back.
    """

    nodes: Array
    matrix: Array
    close: Array
    bring: Array
    give: Array


def _scheme(points: Array) -> Scheme:
    matrix = to_integrals(points) / 2
    over_panel = to_legendre(points)[0]  # half the integral of a Legendre series is its first coefficient
    bring = (legendre.legvander(points, STAGES - 1) @ LEGENDRE.T).T
    return Scheme((1 + points) / 2, matrix, over_panel @ np.linalg.inv(matrix), bring, np.asarray(np.linalg.inv(bring)))


# Gauss keeps quadratic energies; Radau IIA forgets what is infinitely fast within one panel.
GAUSS = _scheme(POINTS)
RADAU = _scheme(radau_nodes(STAGES))


def values_at(powers: Array, places: Array) -> Array:
    """Values (..., k) at places (k,) of [-1, 1] of polynomials, by their coefficients (..., s) of the powers."""
    rows = np.ones((len(places), powers.shape[-1]))  # numpy's own Vandermonde matrix takes three times as long
    rows[:, 1:] = places[:, None]
    return np.asarray(powers @ np.multiply.accumulate(rows, axis=1).T)


def squared(powers: Array, to: Array) -> Array:
    """Integrals (k, q) from -1 to some places (k,) of squares of polynomials, of coefficients (k, q, s)."""
    half = (to + 1) / 2
    places = (POINTS + 1) * half[:, None] - 1
    values = powers @ (places[:, None, :] ** np.arange(powers.shape[2])[:, None])
    return np.asarray(half[:, None] * (values**2 @ WEIGHTS))


class Scales:
    """The tolerances of waves (q,), then states (n,), from the largest that was seen of each line and each state.

    Args:
        impedances: (q / 2,) of the lines in N m s.
        atol_waves: absolute tolerance of the waves in N m.
        atol: (n,) absolute tolerances of the states.
        rtol: relative tolerance.
    """

    def __init__(self, impedances: Array, atol_waves: float, atol: Array, rtol: float) -> None:
        self._root, self._rtol = np.sqrt(impedances), rtol
        self._ends = 2 * impedances.size
        self._absolute = np.concatenate([np.full(self._ends, atol_waves), atol])
        self._largest = np.zeros(self._absolute.size)
        self.tolerance = self._absolute

    @property
    def states(self) -> Array:
        """Largest sizes (n,) of the states."""
        return self._largest[self._ends :]

    @property
    def waves(self) -> Array:
        """Largest sizes (q,) of the waves."""
        return self._largest[: self._ends]

    def see(self, waves: Array, states: Array) -> None:
        """Take values of waves (q, k) and states (n, k) into account."""
        self._largest, self.tolerance = self._with(np.concatenate([waves, states]))

    def resolved(self, rows: Array, starts: Array) -> bool:
        """Whether a panel's values (q + n, s) at the Gauss points and start state (n,) leave out less than they may."""
        return bool((left_out(rows, starts) <= RESOLVED * self._with(rows)[1]).all())

    def tolerances(self, largest: Array) -> Array:
        """Tolerances (..., q + n) from the largest sizes (..., q + n)."""
        largest = largest.copy()
        ends = largest[..., : self._ends]
        lines = ends.reshape(*ends.shape[:-1], -1, 2).max(axis=-1)
        strongest = (lines / self._root).max(axis=-1, initial=0.0)[..., None]
        # A line whose waves are a thousand times weaker than the strongest, in the root of their power, is resolved no
        # better.
        ends[...] = np.repeat(np.maximum(lines, 1e-3 * self._root * strongest), 2, axis=-1)
        return np.asarray(self._absolute + self._rtol * largest)

    def _with(self, rows: Array) -> tuple[Array, Array]:
        sizes = np.abs(rows).max(axis=1)
        if (sizes <= 1.2 * self._largest).all():  # what has grown by less does not change the scale
            return self._largest, self.tolerance
        largest = np.maximum(sizes, self._largest)
        return largest, self.tolerances(largest)


def left_out(rows: Array, starts: Array) -> Array:
    """What polynomials through values (..., q + n, s) at the Gauss points leave out, about.

    The next two Legendre coefficients are taken to follow from the last four as a geometric sequence. That next one is
    known of the states, from their values (..., n) at the panel's start: it is the layer that Gauss points do not see.
    """
    sizes = np.abs(rows @ LEGENDRE)
    last, before = sizes[..., -2:].max(axis=-1), sizes[..., -4:-2].max(axis=-1)
    rest = last * np.minimum(last, before) / np.maximum(before, np.finfo(float).tiny)
    ends = rows.shape[-2] - starts.shape[-1]
    rest[..., ends:] = np.maximum(rest[..., ends:], np.abs(rows[..., ends:, :] @ LEFT[:, 0] - starts))
    return np.asarray(rest)
