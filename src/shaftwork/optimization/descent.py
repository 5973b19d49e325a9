"""One descent: from a start to a design that is best nearby, or to where it gets no better."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from scipy.optimize import minimize

from shaftwork.codegen.array_form.elements import Array
from shaftwork.numerics.tolerances import EQUAL, TYPED
from shaftwork.optimization.measured_motion import MeasuredMotion
from shaftwork.optimization.optimum import missed
from shaftwork.sweep.sweep_result import Limits

FRUITLESS = 30
"""A descent ends after so many designs of which none was better: a line search of SLSQP tries ten at most."""
MOST_DESIGNS = 100
"""A descent tries so many designs for each variable, and as many once more."""


class _Ended(Exception):  # noqa: N818 - no error
    """A descent is given up; says why."""


class Descent:
    """Sequential quadratic programming in shares of the ranges; goals by their sizes at the start.

    Where limits cannot be met, SLSQP alone goes on for thousands of motions: it takes a step towards the limits, one
    back to a better goal, and so on. So a descent ends where no design gets better. Until one meets the limits, better
    is what misses them by less; from then on what misses them by less than each before or has a better goal than it.

    Args:
        motion: gives the goals.
        ranges: (low, high) by variable.
        limits: by goal.
        name: of the goal that is made least or largest.
        sign: 1 to make it least, -1 to make it largest.
    """

    def __init__(
        self,
        motion: MeasuredMotion,
        ranges: Mapping[str, tuple[float, float]],
        limits: Mapping[str, Limits],
        name: str,
        sign: float,
    ) -> None:
        self._motion, self._limits, self._name, self._sign = motion, limits, name, sign
        self._low, self._high = np.array(list(ranges.values())).T
        self._sizes = dict[str, float]()
        self._last, self._tried, self._since = b"", 0, 0
        self._better = list[tuple[float, float, Array]]()
        """By how much each that was better misses the limits, its goal, and its variables."""

    def run(self, start: Array) -> tuple[Array, str]:
        """The variables at the end, and why it ended.

        Args:
            start: variables, at which every goal has a finite value.
        """
        for of, (first, _) in self._motion.at(start).items():
            ends = (end or 0.0 for end in self._limits.get(of, ()))
            self._sizes[of] = max(map(abs, (first, *ends))) or 1.0
        value, slope = self._side(self._name, self._sign)
        try:
            result = minimize(
                value,
                (start - self._low) / (self._high - self._low),
                jac=slope,
                bounds=[(0.0, 1.0)] * start.size,
                constraints=self._constraints(),
                method="SLSQP",
                options={"ftol": TYPED, "maxiter": MOST_DESIGNS * (1 + start.size)},
            )
        except _Ended as end:
            return min(self._better, key=lambda one: one[:2])[2], str(end)
        return self._variables(result.x), str(result.message)

    def _variables(self, shares: Array) -> Array:
        """Those of shares of the ranges, not beyond them by rounding."""
        return np.asarray(np.clip(self._low + shares * (self._high - self._low), self._low, self._high))

    def _constraints(self) -> list[dict[str, Any]]:
        sides = [
            self._side(of, factor, level)
            for end, factor in enumerate((1.0, -1.0))
            for of, limits in self._limits.items()
            if (level := limits[end]) is not None
        ]
        return [{"type": "ineq", "fun": value, "jac": slope} for value, slope in sides]

    def _side(
        self, of: str, factor: float, level: float = 0.0
    ) -> tuple[Callable[[Array], float], Callable[[Array], Array]]:
        """How far a goal is above a level, times a factor and in its size, and the slopes of this."""

        def value(shares: Array) -> float:
            value = self._goals(shares)[of][0]
            if not np.isfinite(value):  # no motion, or no number: as bad as can be, and finite for the line search
                return 1e6 if of == self._name else -1e6
            return factor * (value - level) / self._sizes[of]

        def slope(shares: Array) -> Array:
            return np.asarray(factor * self._goals(shares)[of][1] * (self._high - self._low) / self._sizes[of])

        return value, slope

    def _goals(self, shares: Array) -> dict[str, tuple[float, Array]]:
        """Goals and their slopes.

        Raises:
            _Ended: too many designs were tried, or too many without getting better.
        """
        variables = self._variables(shares)
        goals = self._motion.at(variables)
        if (key := variables.tobytes()) != self._last:
            self._last = key
            self._judge(variables, {of: value for of, (value, _) in goals.items()})
        return goals

    def _judge(self, variables: Array, goals: Mapping[str, float]) -> None:
        self._tried += 1
        self._since += 1
        if all(map(np.isfinite, goals.values())):
            miss = max(missed(self._limits, goals).values(), default=0.0)
            goal = self._sign * goals[self._name] / self._sizes[self._name]
            met = any(not other for other, _, _ in self._better)
            if all(miss < other - EQUAL or (met and goal < best - TYPED) for other, best, _ in self._better):
                self._better.append((miss, goal, variables))
                self._since = 0
        if self._since > FRUITLESS:
            raise _Ended(f"given up after {self._tried} designs, the last {FRUITLESS} of them no better")
        if self._tried >= MOST_DESIGNS * (1 + variables.size):
            raise _Ended(f"given up after {self._tried} designs")
