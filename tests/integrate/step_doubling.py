"""An engine as a newcomer adds one: Runge's and Kutta's method, whose step follows from two of half the length."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import KroghInterpolator

from shaftwork.integrate.crossings import Dense
from shaftwork.integrate.problem import Array, Problem, Trajectory
from shaftwork.integrate.smooth_intervals import GuardedFunctions, SmoothInterval, failure
from shaftwork.integrate.stepping import Step, march, trajectory


def solve(problem: Problem) -> Trajectory:
    """Integrate with steps of order 4, extrapolated to order 5.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.4.
    """
    stepper = _Doubling(problem)
    return trajectory(problem, march(problem, stepper), stepper.parts)


class _Doubling:
    engine, cuts_off = "rk4", False

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self.parts: list[Dense] = []

    def open(self, piece: SmoothInterval, t: float, x: Array) -> Array:
        self._piece, self._functions = piece, GuardedFunctions(self._problem, piece)
        self._end, self._length = piece.end, (piece.end - t) / 1000
        return x

    def step(self, t: float, x: Array) -> Step | None:
        if t >= self._end:
            self._end = self._piece.end
        length, f = min(self._length, self._end - t), self._functions.rhs
        if length <= 8 * np.spacing(abs(t)):
            raise failure(self._problem, self.engine, t, x, "the step became too small", self._functions)
        end = self._end if length == self._end - t else t + length
        middle, half = t + length / 2, self._moved(t, x, length / 2)
        coarse, fine = self._moved(t, x, length), self._moved(middle, half, length / 2)
        scale = self._problem.atol + self._problem.rtol * np.abs(fine)
        error = float(np.max(np.abs(fine - coarse) / (15 * scale)))
        self._length = length * (min(max(0.9 * max(error, 1e-9) ** -0.2, 0.2), 5.0) if np.isfinite(error) else 0.2)
        if not error <= 1:
            return None
        y = fine + (fine - coarse) / 15
        quintic = KroghInterpolator([t, t, middle, middle, end, end], [x, f(t, x), half, f(middle, half), y, f(end, y)])
        self._dense: Dense = quintic
        return Step(end, y, quintic)

    def again(self, t: float, x: Array, end: float, longest: float) -> None:  # noqa: ARG002 (it starts from no other)
        self._end, self._length = end, min(end - t, longest)

    def take(self, t: float, end: float, state: Array) -> None:  # noqa: ARG002 (its dense output has all)
        self.parts.append(self._dense)

    def _moved(self, t: float, x: Array, h: float) -> Array:
        f = self._functions.rhs
        first = f(t, x)
        second = f(t + h / 2, x + h / 2 * first)
        third = f(t + h / 2, x + h / 2 * second)
        return np.asarray(x + h / 6 * (first + 2 * second + 2 * third + f(t + h, x + h * third)))
