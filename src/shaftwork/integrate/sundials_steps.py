"""A solver of SUNDIALS at work, and the states inside its last step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from shaftwork.integrate.chebyshev import Polynomial, points
from shaftwork.integrate.pieces import GuardedFunctions
from shaftwork.integrate.problem import Array

# SUNDIALS interpolates inside a step by a polynomial of at most this degree.
DEGREES = {"BDF": 5, "Adams": 12}


@dataclass(frozen=True)
class Opened:
    """A SUNDIALS solver at the start of a piece.

    Args:
        solver: CVODE or IDA, with its first step still to take.
        start: (n,) consistent start state.
        guard: what CVODE calls.
        outgrown: whether the solver must be opened anew, because its pattern misses entries of the Jacobian.
        degree: of its polynomials inside a step, at most.
    """

    solver: Any
    start: Array
    guard: GuardedFunctions | None = None
    outgrown: Callable[[], bool] = lambda: False
    degree: int = DEGREES["BDF"]

    def inside(self, times: Array) -> Array:
        """States (k, n) at times (k,) inside the last step."""
        return np.array([self.solver.step(time).y.copy() for time in times]).reshape(times.size, self.start.size)


class Inside:
    """The states inside the last step: for many times from a polynomial, as each costs a call of SUNDIALS.

    Args:
        opened: the solver.
        start: of the step, s.
        x: (n,) state there.
        end: of the step, s.
        y: (n,) state there.
        degree: of the polynomial.
    """

    def __init__(self, opened: Opened, start: float, x: Array, end: float, y: Array, degree: int) -> None:
        self._opened, self._ends, self._states, self._degree = opened, (start, end), (x, y), degree
        self._made: Polynomial | None = None
        self.used = False
        """Whether SUNDIALS has been asked for a time inside the step."""

    def __call__(self, times: Array) -> Array:
        self.used = True
        if self._made is None:
            if times.size < self._degree - 1:
                return self._opened.inside(times)
            (start, end), (x, y) = self._ends, self._states
            inner = self._opened.inside(start + (end - start) * points(self._degree)[1:-1])
            self._made = Polynomial(start, end, np.vstack([x, inner, y]))
        return self._made(times)
