"""One descent: from a start to a design that is best nearby, or to where it gets no better."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize

from shaftwork.codegen.array_form.elements import Array
from shaftwork.numerics.tolerances import EQUAL, TYPED
from shaftwork.optimization.measured_motion import MeasuredMotion
from shaftwork.optimization.optimum import missed, sizes_of
from shaftwork.sweep.sweep_result import Limits

FRUITLESS = 30
"""A descent ends after so many designs of which none was better: a line search of SLSQP tries ten at most."""
MOST_DESIGNS = 100
"""A descent tries so many designs for each variable, and as many once more."""
RESTARTS = 4
"""SLSQP ends nine digits below the size of the goal at its start. Where the goal has fallen to less than half of that,
it starts anew from its end, as it does from a better design that it has met on the way: so often at most, and a goal
may fall by 36 digits."""


class DescentEnd(NamedTuple):
    """Where a descent ended.

    Args:
        variables: (m,) there.
        message: why.
        success: whether the goal is least nearby.
    """

    variables: Array
    message: str
    success: bool


class _Ended(Exception):  # noqa: N818 - no error
    """A descent is given up; says why."""


class Descent:
    """Sequential quadratic programming in shares of the ranges; goal and limits by their sizes at the start.

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
        self.ranges, self.sizes = ranges, dict[str, float]()
        self._low, self._high = np.array(list(ranges.values())).T
        self._size, self._constraints = 1.0, list[dict[str, Any]]()
        self._tried, self._begun, self._since = set[bytes](), list[Array](), 0
        self._better = list[tuple[float, float, Array]]()
        """By how much each that was better misses the limits, its goal, and its variables."""

    def run(self, start: Array) -> DescentEnd:
        """From a start to the end.

        Args:
            start: variables, at which every goal has a finite value.
        """
        self.sizes = sizes_of(self._limits, first := self._values(start))
        self._constraints = list(self._sides(first))
        end = self._once(start)
        for _ in range(RESTARTS):
            if (place := self._anew(end)) is None:
                return end
            further = self._once(place)
            end = further if further.success or self._gained(end.variables, further.variables) else end
        if self._anew(end) is None:
            return end
        message = f"given up after {RESTARTS} new starts, each of which came to better designs"
        return DescentEnd(end.variables, message, success=False)

    def _anew(self, end: DescentEnd) -> Array | None:
        """Where to start anew: at what was better on the way, or at the end of a long fall; None for nowhere."""
        best, values = self._best(), self._values(end.variables)
        if self._gained(end.variables, best) and not any(np.array_equal(best, one) for one in self._begun):
            return best
        moved = np.abs(end.variables - self._begun[-1]) > EQUAL * (self._high - self._low)
        finer = self._size_at(end.variables) < 0.5 * self._size
        return end.variables if finer and moved.any() and not self._missed(values) else None

    def _gained(self, before: Array, after: Array) -> bool:
        """Whether a design is plainly better than another one, and meets the limits."""
        goals, goal = self._values(after), self._values(before)[self._name]
        return self._sign * (goal - goals[self._name]) > EQUAL * self._size and not self._missed(goals)

    def _missed(self, goals: Mapping[str, float]) -> dict[str, float]:
        return missed(self._limits, goals, self.sizes)

    def _size_at(self, variables: Array) -> float:
        """That of the goal; one that passes through zero there is as large as it becomes in a thousandth of a range."""
        value, slope = self._motion.at(variables)[self._name]
        return max(abs(value), 1e-3 * float(np.abs(slope * (self._high - self._low)).max())) or 1.0

    def _values(self, variables: Array) -> dict[str, float]:
        """Each goal."""
        return {of: value for of, (value, _) in self._motion.at(variables).items()}

    def _once(self, start: Array) -> DescentEnd:
        """From a start to where SLSQP ends; the best design so far where that is no minimum."""
        self._begun.append(start)
        self._size, self._since = self._size_at(start), 0
        value, slope = self._side(self._name, self._sign, self._size)
        try:
            result = minimize(
                value,
                (start - self._low) / (self._high - self._low),
                jac=slope,
                bounds=[(0.0, 1.0)] * start.size,
                constraints=self._constraints,
                method="SLSQP",
                options={"ftol": TYPED, "maxiter": MOST_DESIGNS * (1 + start.size)},
            )
        except _Ended as end:
            return DescentEnd(self._best(), str(end), success=False)
        return DescentEnd(
            self._variables(result.x) if result.success else self._best(), str(result.message), result.success
        )

    def _best(self) -> Array:
        """Variables of the design that misses limits least; of several, of the one whose goal is best."""
        return min(self._better, key=lambda one: one[:2])[2]

    def _variables(self, shares: Array) -> Array:
        """Those of shares of the ranges, not beyond them by rounding."""
        return np.asarray(np.clip(self._low + shares * (self._high - self._low), self._low, self._high))

    def _sides(self, first: Mapping[str, float]) -> Iterator[dict[str, Any]]:
        """The sides of all limits, each in the size of its measure: of the limits, and of the value at the start."""
        for end, factor in enumerate((1.0, -1.0)):
            for of, limits in self._limits.items():
                if (level := limits[end]) is not None:
                    size = max(abs(value) for value in (first[of], *limits) if value is not None) or 1.0
                    value, slope = self._side(of, factor, size, level)
                    yield {"type": "ineq", "fun": value, "jac": slope}

    def _side(
        self, of: str, factor: float, size: float, level: float = 0.0
    ) -> tuple[Callable[[Array], float], Callable[[Array], Array]]:
        """How far a goal is above a level, times a factor and by a size, and the slopes of this."""

        def value(shares: Array) -> float:
            value = self._goals(shares)[of][0]
            if not np.isfinite(value):  # no motion, or no number: as bad as can be, and finite for the line search
                return 1e6 if of == self._name else -1e6
            return factor * (value - level) / size

        def slope(shares: Array) -> Array:
            return np.asarray(factor * self._goals(shares)[of][1] * (self._high - self._low) / size)

        return value, slope

    def _goals(self, shares: Array) -> dict[str, tuple[float, Array]]:
        """Goals and their slopes.

        Raises:
            _Ended: too many designs were tried, or too many without getting better.
        """
        variables = self._variables(shares)
        if (key := variables.tobytes()) not in self._tried:
            self._tried.add(key)
            self._judge(variables, self._values(variables))
        return self._motion.at(variables)

    def _judge(self, variables: Array, goals: Mapping[str, float]) -> None:
        self._since += 1
        if all(map(np.isfinite, goals.values())):
            miss = max(self._missed(goals).values(), default=0.0)
            goal = self._sign * goals[self._name]
            met, gain = any(not other for other, _, _ in self._better), TYPED * self._size
            if all(miss < other - EQUAL or (met and goal < best - gain) for other, best, _ in self._better):
                self._better.append((miss, goal, variables))
                self._since = 0
        if self._since > FRUITLESS:
            raise _Ended(f"given up after {len(self._tried)} designs, the last {FRUITLESS} of them no better")
        if len(self._tried) >= MOST_DESIGNS * (1 + variables.size):
            raise _Ended(f"given up after {len(self._tried)} designs")
