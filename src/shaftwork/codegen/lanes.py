"""Many variants side by side: one compiled step whose lanes are variants, each with its own time, state, parameters.

The step is one function of heyoka's, straight through all stages of the method, with the control of the step size in
it: a lane that is not accurate enough stays where it is and gets a smaller step. So no lane waits for another, and what
comes out for one does not depend on those beside it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, reduce
from operator import mul
from typing import Any

import heyoka
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853

from shaftwork.codegen.lane_errors import TINY, LaneStart, step_error, weighted
from shaftwork.codegen.lane_program import FREE_TIME, KEPT, LaneFunction, LaneProgram, at
from shaftwork.numerics.hermite import BEYOND, JET, apart, inner

Array = NDArray[np.float64]

SAFETY, LEAST_FACTOR, MOST_FACTOR = 0.85, 0.2, 5.0
"""Of the next step by the error of this one."""
NOWHERE = -1e300
"""So far comes what has not been seen yet."""
BOTH = (1.0, -1.0)
"""The signs of what may matter on both sides."""


@dataclass(frozen=True)
class Use:
    """What is wanted of a quantity.

    Args:
        signs: 1 for its maximum, -1 for its minimum.
        power: of the quantity, of which the integral over the motion is wanted; 0 for none.
    """

    signs: tuple[float, ...] = ()
    power: int = 0


@dataclass(frozen=True)
class LaneStep:
    """One step of a lane, with its error and the size of the next one; Dormand and Prince's method of order 8(5,3).

    Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.10. The tolerance is a part of the size of a
    state: of its value, of its change in the step and of its nominal size together. What is measured counts as well: a
    stiff damper's torque may be wrong where the speeds are right, and a source may swing without them.

    A lane is a column: first its *rows*, which are states, integrals, time, and the size of the next step; then what
    has been seen, which is the time at the start of the step that led here, jets at that time, and how far each
    quantity, times a sign, can have come. Behind its parameters come its *limits*: the tolerance, the end and the
    longest step, and nominal sizes of the states.

    Args:
        program: the system.
        uses: what is wanted of each of its quantities. There are jets of those with signs, and of the guards.
    """

    program: LaneProgram
    uses: tuple[Use, ...]

    @cached_property
    def _integrals(self) -> list[tuple[Any, int]]:
        """Quantities and the powers that are integrated."""
        pairs = zip(self.program.quantities, self.uses, strict=True)
        return [(quantity, use.power) for quantity, use in pairs if use.power]

    @cached_property
    def _seen(self) -> list[tuple[Any, tuple[float, ...]]]:
        """Quantities of which there are jets, and the signs that matter."""
        pairs = zip(self.program.quantities, self.uses, strict=True)
        extremes = [(quantity, use.signs) for quantity, use in pairs if use.signs]
        return [*extremes, *((guard, BOTH) for guard in self.program.guards)]

    @property
    def states(self) -> int:
        """Number of states."""
        return len(self.program.variables)

    @cached_property
    def rows(self) -> int:
        """Number of rows: states, integrals, time, and the size of the next step."""
        return self.states + len(self._integrals) + 2

    @cached_property
    def jets(self) -> slice:
        """Rows of what is seen of the quantities."""
        return slice(self.rows + 1, self.rows + 1 + JET * len(self._seen))

    @cached_property
    def _reaches(self) -> dict[tuple[int, float], int]:
        """Rows of how far quantities can have come, by quantity and sign."""
        pairs = [(number, sign) for number, (_, signs) in enumerate(self._seen) for sign in signs]
        return {pair: self.jets.stop + k for k, pair in enumerate(pairs)}

    @property
    def height(self) -> int:
        """Number of values in a column."""
        return self.rows + 1 + JET * len(self._seen) + len(self._reaches)

    @cached_property
    def _function(self) -> LaneFunction:
        return _function(self)

    def jet(self, number: int) -> slice:
        """Where, among the jets, is that of a quantity."""
        return slice(JET * number, JET * (number + 1))

    def reach(self, number: int, sign: float) -> int:
        """The row of how far a quantity can have come, times a sign."""
        return self._reaches[number, sign]

    def forget(self, columns: Array) -> None:
        """Let nothing be seen in columns (height, k) yet but the jets at the start."""
        columns[self.rows], columns[self.jets.stop :] = columns[self.rows - 2], NOWHERE

    def taken(self, p: Array, sizes: Array) -> Array:
        """What is read of parameters (parameters, k) and limits, with nominal sizes (n,) and no limits yet."""
        limits = np.ones((3, p.shape[1]))
        return self._function.taken(np.concatenate([p, limits, np.repeat(sizes[:, None], p.shape[1], axis=1)]))

    def limit(self, taken: Array, tolerance: float, end: Array | float, longest: float) -> None:
        """Set the limits in what is `taken`: the tolerance, the end and the longest step, s."""
        first = -(3 + self.states)
        taken[first], taken[first + 1], taken[first + 2] = tolerance, end, longest

    def __call__(self, columns: Array, taken: Array, made: Array) -> None:
        """Write what a step makes of columns (height, k), both contiguous."""
        self._function.into(made, columns, taken)

    def written(self) -> LaneFunction:
        """The step as a function."""
        program, quantities = self.program, [quantity for quantity, _ in self._seen]
        time, step, before = heyoka.make_vars("time", "step", "before")
        integrals = [heyoka.expression(f"integral{k}") for k in range(len(self._integrals))]
        limit = [heyoka.par[program.parameter_count + k] for k in range(3 + self.states)]
        (tolerance, end, longest), sizes = limit[:3], limit[3:]
        left = end - time
        wanted = _lower(step, longest)
        size = _lower(wanted, left)
        old = [*program.variables, *integrals]
        blind = [quantity for quantity in dict.fromkeys(quantities) if at(quantity, FREE_TIME) != quantity]
        integrands = [reduce(mul, [quantity] * power) for quantity, power in self._integrals]
        stages = _stages(program.variables, [*program.rates, *integrands, *blind], time, size)
        new = [_moved(x, size, DOP853.B, slopes) for x, slopes in zip(old, stages, strict=False)]
        begun = [(x, *of) for x, of in zip(integrals, self._integrals, strict=True)]
        error = step_error(LaneStart(program, time, size, sizes), begun, blind, stages) / tolerance
        factor = SAFETY / heyoka.sqrt(heyoka.sqrt(heyoka.sqrt(error + TINY)))  # the error is of order 8
        factor = _higher(_lower(factor, heyoka.expression(MOST_FACTOR)), heyoka.expression(LEAST_FACTOR))
        good = heyoka.lte(error, 1.0)
        arrived = heyoka.select(heyoka.lt(wanted, left), time + size, end)
        after = [heyoka.select(good, moved, x) for x, moved in zip([*old, time], [*new, arrived], strict=True)]
        here = [at(one, time) for quantity in quantities for one in program.jet(quantity)]
        last = [heyoka.expression(f"seen{k}") for k in range(len(here))]
        come = {pair: heyoka.expression(f"reach{k}") for k, pair in enumerate(self._reaches)}
        made = (*after, size * factor, time, *here, *self._come(time - before, last, here, come))
        return LaneFunction(made, (*old, time, step, before, *last, *come.values()))

    def _come(
        self, length: Any, last: Sequence[Any], here: Sequence[Any], come: Mapping[tuple[int, float], Any]
    ) -> list[Any]:
        """How far quantities can have come by now, from where they have come before the last interval."""
        made = []
        for (number, sign), before in come.items():
            jets = last[self.jet(number)], here[self.jet(number)]
            missed = apart(length, *jets)
            between = reduce(_higher, [sign * value for value in inner(length, *jets)])
            beyond = BEYOND * _higher(missed, -missed)
            made.append(reduce(_higher, [before, sign * jets[1][0], between + beyond]))
        return made


@lru_cache(maxsize=KEPT)
def _function(step: LaneStep) -> LaneFunction:
    """The function of a step; those of sweeps that differ in their numbers alone share it."""
    return step.written()


def _lower(a: Any, b: Any) -> Any:
    """The lower of two expressions."""
    return heyoka.select(heyoka.lt(a, b), a, b)


def _higher(a: Any, b: Any) -> Any:
    """The higher of two expressions."""
    return heyoka.select(heyoka.gt(a, b), a, b)


def _stages(states: Sequence[Any], slopes: Sequence[Any], time: Any, size: Any) -> list[list[Any]]:
    """Values of slopes, first those of the states, at the stages of a step."""
    found: list[list[Any]] = [[] for _ in slopes]
    for weights, part in zip(DOP853.A, DOP853.C, strict=True):
        there = {x: _moved(x, size, weights, before) for x, before in zip(states, found, strict=False)}
        made = heyoka.subs(list(slopes), {**there, heyoka.time: time + part * size})
        for before, slope in zip(found, made, strict=True):
            before.append(slope)
    return found


def _moved(x: Any, size: Any, weights: Array, slopes: Sequence[Any]) -> Any:
    """A state moved along slopes."""
    return x + size * weighted(weights, slopes)
