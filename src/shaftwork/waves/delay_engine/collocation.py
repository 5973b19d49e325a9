"""Collocation on one panel: the nodes, and the polynomials through them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre

from shaftwork.integrate.problem import Array
from shaftwork.numerics.polynomials import radau_nodes, to_integrals, to_legendre, to_powers

STAGES = 8

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
