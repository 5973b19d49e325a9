"""A network with lossless lines as arrays: its states, and the histories at the ends of its lines."""

from __future__ import annotations

from typing import Any

import numpy as np

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array


class WaveSystem:
    """Rates and speeds of the ends for states x (n, k) and histories h (q, k); the ends a and b of each line in a row.

    Args:
        bound: the array program for one parameter vector.
    """

    def __init__(self, bound: BoundArrays) -> None:
        self._bound, self._form = bound, bound.program.form
        place = {branch: k for k, branch in enumerate(self._form.outputs)}
        self._ends = np.array([place[branch] for branch in self._form.waves], dtype=np.intp)
        self._full = bound.full()

    def rhs(self, t: Array, x: Array, h: Array) -> Array:
        """d x / dt (n, k) at times (k,)."""
        if self._full is None:
            return self._bound.rhs(t, np.concatenate([x, h]))
        by_state, by_input, outputs = self._full
        inputs = self._bound.program.inputs
        u = inputs.values(t, outputs @ x, np.concatenate([x, h]), self._bound.p)
        return np.asarray(by_state @ x + by_input @ u)

    def speeds(self, t: Array, x: Array, h: Array) -> Array:
        """The speeds (q, k) of the ends at times (k,)."""
        return np.asarray(self._bound.outputs(t, np.concatenate([x, h]))[self._ends])

    def jacobian(self, t: float, x: Array, h: Array) -> Any:
        """d rhs / d x, sparse, at one time with x (n,) and h (q,)."""
        return self._bound.jacobian(t, np.concatenate([x, h]))

    @property
    def lines(self) -> tuple[Array, Array]:
        """Impedances in N m s and delays in s (q / 2,)."""
        return self._bound.lines
