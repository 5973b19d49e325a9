"""How large waves and states are, and whether panels resolve them."""

from __future__ import annotations

import numpy as np

from shaftwork.integrate.problem import Array
from shaftwork.waves.delay_engine.collocation import LEFT, LEGENDRE

# The part of the tolerance that what a panel leaves out may take.
RESOLVED = 0.1
# A line whose waves are weaker than this part of the strongest, in the root of their power, is resolved no better.
IDLE = 1e-3
# The scale follows what has grown by more than this factor.
GROWTH = 1.2


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
        ends[...] = np.repeat(np.maximum(lines, IDLE * self._root * strongest), 2, axis=-1)
        return np.asarray(self._absolute + self._rtol * largest)

    def _with(self, rows: Array) -> tuple[Array, Array]:
        sizes = np.abs(rows).max(axis=1)
        if (sizes <= GROWTH * self._largest).all():
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
