"""How far a step of a lane is off, as a part of what is allowed.

Dormand and Prince's method of order 8(5,3) compares its result with two of lower order: Hairer, Norsett, Wanner,
Solving Ordinary Differential Equations I, II.10. What a step misses counts for the states, and for what is measured as
well: a stiff damper's torque may be wrong where the speeds are right, and what a source gives may swing without them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import heyoka
from scipy.integrate import DOP853

from shaftwork.codegen.lane_program import Array, LaneProgram, at

OF_A_QUANTITY, CANCELLED = 10.0, 1e-4
"""What is measured may be wrong by so many times as much as a state, and by the error of so small a part of what it is
the difference of: of a stiff damper's torque more would be lost in rounding."""
TINY = 1e-30
"""Beside an error."""


@dataclass(frozen=True, eq=False)
class LaneStart:
    """Where a step starts, as heyoka's expressions.

    Args:
        program: of the lanes.
        time: s.
        size: of the step, s.
        nominal: sizes of the states.
    """

    program: LaneProgram
    time: Any
    size: Any
    nominal: Sequence[Any]

    def gradient(self, quantity: Any) -> list[Any]:
        """Derivatives of a quantity by the states."""
        return [at(slope, self.time) for slope in self.program.gradient(quantity)]

    def least(self, quantity: Any) -> Any:
        """The square of what matters of a quantity whatever its value."""
        made = zip(self.gradient(quantity), self.nominal, self.program.variables, strict=True)
        return TINY + _squares([slope * part for slope, least, x in made for part in (least, CANCELLED * x)])


def step_error(
    start: LaneStart, integrals: Sequence[tuple[Any, Any, int]], blind: Sequence[Any], stages: Sequence[Sequence[Any]]
) -> Any:
    """The error of a step in units of the tolerance.

    Args:
        start: of the step.
        integrals: the value at the start, the quantity, and its power that is integrated.
        blind: quantities that may change without the states.
        stages: slopes at the stages of the step: of states, of integrals, and what is blind.
    """
    program, size = start.program, start.size
    states, first = program.variables, [slopes[0] for slopes in stages]
    allowed = [
        _squares([x, least, size * slope]) for x, least, slope in zip(states, start.nominal, first, strict=False)
    ]
    means = [_squares(slopes) * (1 / len(slopes)) for slopes in stages[len(states) :]]
    for (value, quantity, power), mean in zip(integrals, means, strict=False):
        allowed.append(_squares([value]) + size * size * (mean + start.least(quantity) ** float(power)))
    for quantity, mean in zip(blind, means[len(integrals) :], strict=True):
        allowed.append(OF_A_QUANTITY**2 * size * size * (mean + start.least(quantity)))
    gradients = {quantity: start.gradient(quantity) for quantity in program.quantities}
    for quantity, slopes in gradients.items():
        value, change = at(quantity, start.time), size * _inner(slopes, first)
        allowed.append(OF_A_QUANTITY**2 * (_squares([value, change]) + start.least(quantity)))
    squares = []
    for weights in (DOP853.E5, DOP853.E3):
        missed = [weighted(weights, slopes) for slopes in stages]
        missed += [_inner(slopes, missed) for slopes in gradients.values()]
        squares.append(heyoka.sum([one * one / most for one, most in zip(missed, allowed, strict=True)]))
    fifth, third = squares
    return size * fifth / heyoka.sqrt(fifth + 0.01 * third + TINY * TINY)


def _squares(parts: Sequence[Any]) -> Any:
    """The sum of their squares."""
    return heyoka.sum([part * part for part in parts])


def _inner(slopes: Sequence[Any], changes: Sequence[Any]) -> Any:
    """The sum of their products, of as many as there are slopes."""
    return heyoka.sum([slope * change for slope, change in zip(slopes, changes, strict=False)])


def weighted(weights: Array, slopes: Sequence[Any]) -> Any:
    """The sum of slopes with weights."""
    terms = [weight * slope for weight, slope in zip(weights.tolist(), slopes, strict=False) if weight]
    return heyoka.sum(terms) if terms else heyoka.expression(0.0)
