"""Many variants side by side: one compiled step whose lanes are variants, each with its own time, state, parameters.

The step is one function of heyoka's, straight through all stages of the method, with the control of the step size in
it: a lane that is not accurate enough stays where it is and gets a smaller step. So no lane waits for another, and what
comes out for one does not depend on those beside it.

Dormand and Prince's method of order 8(5,3) compares its result with two of lower order: Hairer, Norsett, Wanner,
Solving Ordinary Differential Equations I, II.10. What a step misses counts for the states, and for what is measured as
well: a stiff damper's torque may be wrong where the speeds are right, and what a source gives may swing without them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache, reduce
from operator import mul
from typing import Any

import heyoka
import numpy as np
from scipy.integrate import DOP853
from sympy import Expr

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.taylor.heyoka import HeyokaProgram
from shaftwork.codegen.taylor.heyoka_expressions import Translator
from shaftwork.codegen.taylor.heyoka_parameters import Fixed
from shaftwork.components.laws import t as TIME
from shaftwork.core.errors import CompileError
from shaftwork.formulation.explicit_rows import Rows
from shaftwork.numerics.hermite import BEYOND, JET, apart, inner
from shaftwork.results.measures import EXTREMES, POWERS
from shaftwork.sweep.lane_steps import WITHOUT_LIMIT

FREE_TIME = heyoka.expression("time")
"""By its own time heyoka does not differentiate."""


OF_A_QUANTITY, CANCELLED = 10.0, 1e-4
"""What is measured may be wrong by so many times as much as a state, and by the error of so small a part of what it is
the difference of: of a stiff damper's torque more would be lost in rounding."""
TINY = 1e-30
"""Beside an error."""


@dataclass(frozen=True)
class LaneFunction:
    """Expressions as a function of many states, parameters and times at once.

    Args:
        expressions: heyoka's, in its parameters.
        variables: heyoka's variables.
    """

    expressions: tuple[Any, ...]
    variables: tuple[Any, ...]

    @cached_property
    def _compiled(self) -> tuple[Any, list[int]]:
        """The function and the parameters that it reads; it knows no others, so that only these are repeated."""
        read = heyoka.get_params(list(self.expressions))
        used = sorted(int(str(parameter)[1:]) for parameter in read)
        renamed = {heyoka.par[number]: heyoka.par[k] for k, number in enumerate(used)}
        expressions = heyoka.subs(list(self.expressions), renamed) if used else list(self.expressions)
        # fast_math: a quarter faster; what is not finite is found by whoever asks
        return heyoka.cfunc(expressions, vars=list(self.variables), opt_level=1, fast_math=True), used

    def __call__(self, t: Array, x: Array, p: Array) -> Array:
        """Values (expressions, k) at times (k,) in s, states (n, k), parameters (parameters, k)."""
        values = np.empty((len(self.expressions), t.size))
        if self.expressions and t.size:
            function, _ = self._compiled
            time: dict[str, Any] = {"time": np.ascontiguousarray(t)} if function.is_time_dependent else {}
            self.into(values, np.ascontiguousarray(x), self.taken(p), **time)
        return values

    def taken(self, p: Array) -> Array:
        """Of the parameters (parameters, k) those that are read."""
        return np.ascontiguousarray(p[self._compiled[1]])

    def into(self, values: Array, x: Array, taken: Array, **options: Any) -> None:
        """Write values (expressions, k) for variables (n, k) and what is `taken` of the parameters, all contiguous."""
        function, used = self._compiled
        if used:
            options["pars"] = taken
        function(x, outputs=values, batch_parallel=False, **options)  # to hand out so few costs more than it brings


@dataclass(frozen=True)
class LaneProgram:
    """A system whose variants run side by side.

    Args:
        variables: heyoka's state variables.
        rates: heyoka expressions of the derivatives.
        guards: heyoka expressions that end a lane where they rise through zero on their side.
        quantities: heyoka expressions that are measured.
        parameter_count: number of the model's parameters and of what is fixed by them, which follows.
        fixed: what is made of the model's parameters alone; programs with the same expressions are the same.
    """

    variables: tuple[Any, ...]
    rates: tuple[Any, ...]
    guards: tuple[Any, ...]
    quantities: tuple[Any, ...]
    parameter_count: int
    fixed: Fixed = field(compare=False)

    def parameters(self, p: Array) -> Array:
        """(parameters, k) those of the model and what is fixed by them, from those of the model alone."""
        return np.concatenate([p, self.fixed.values(p)])

    def jet(self, quantity: Any) -> tuple[Any, ...]:
        """A heyoka expression and its first two derivatives by time along the motion."""
        jet = [quantity]
        for _ in range(JET - 1):
            free = at(jet[-1], FREE_TIME)
            moved = [slope * rate for slope, rate in zip(self.gradient(jet[-1]), self.rates, strict=True)]
            jet += heyoka.subs([heyoka.sum([heyoka.diff(free, FREE_TIME), *moved])], {FREE_TIME: heyoka.time})
        return tuple(jet)

    def gradient(self, quantity: Any) -> list[Any]:
        """The derivatives of a heyoka expression by the states."""
        free = at(quantity, FREE_TIME)
        return list(heyoka.subs([heyoka.diff(free, x) for x in self.variables], {FREE_TIME: heyoka.time}))


@lru_cache  # what heyoka keeps has to be written out before it is found
def lane_function(expressions: tuple[Any, ...], variables: tuple[Any, ...]) -> LaneFunction:
    """The function of expressions that are small enough to be compared."""
    return LaneFunction(expressions, variables)


def at(expression: Any, time: Any) -> Any:
    """A heyoka expression at a time."""
    return heyoka.subs([expression], {heyoka.time: time})[0]


def lane_program(program: HeyokaProgram, rows: Rows, quantities: Sequence[Expr]) -> LaneProgram:
    """The program for many variants of what there is a program for one.

    Args:
        program: for one variant, with its guards.
        rows: the same as expressions.
        quantities: expressions of what is measured.

    Raises:
        CompileError: a law or a quantity switches by a condition, which ends a step in each lane at a time of its own.
    """
    expressions = (*rows.rates, *quantities)
    fixed = Fixed(rows.parameters, (*rows.states, TIME), expressions, before=program.fixed.places)
    translator = Translator(rows.states, TIME, rows.parameters, fixed=fixed)
    translated = tuple(translator.expression(expression) for expression in expressions)
    if program.switches or program.fading or program.held is not None or translator.switches or translator.fading:
        raise CompileError("A law or a quantity switches by a condition, which variants side by side do not follow.")
    rates, measured = translated[: len(rows.rates)], translated[len(rows.rates) :]
    count = len(rows.parameters) + len(fixed.places)
    return LaneProgram(program.variables, rates, program.guards, measured, count, fixed)


@dataclass(frozen=True)
class LaneStep:
    """One step of a lane, with its error and the size of the next one.

    The tolerance is a part of the size of a state: of its value, of its change in the step and of its nominal size
    together.

    A lane is a column: first its *rows*, which are states, integrals, time, and the size of the next step; then what
    has been seen, which is the time at the start of the step that led here, jets at that time, and how far each
    quantity, times a sign, can have come. Behind its parameters come its *limits*: the tolerance, the end and the
    longest step, and nominal sizes of the states.

    Args:
        program: the system.
        kinds: of each of its quantities the measure that is wanted. There are jets of extremes, and of the guards.
    """

    program: LaneProgram
    kinds: tuple[str, ...]

    @cached_property
    def _integrals(self) -> list[tuple[Any, int]]:
        """Quantities and the powers that are integrated."""
        pairs = zip(self.program.quantities, self.kinds, strict=True)
        return [(quantity, POWERS[kind]) for quantity, kind in pairs if kind in POWERS]

    @cached_property
    def _seen(self) -> list[tuple[Any, tuple[float, ...]]]:
        """Quantities of which there are jets, and the signs that matter."""
        pairs = zip(self.program.quantities, self.kinds, strict=True)
        extremes = [(quantity, EXTREMES[kind]) for quantity, kind in pairs if kind in EXTREMES]
        return [*extremes, *((guard, EXTREMES["peak"]) for guard in self.program.guards)]

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
        columns[self.rows], columns[self.jets.stop :] = columns[self.rows - 2], -WITHOUT_LIMIT

    def taken(self, p: Array, sizes: Array) -> Array:
        """What is read of parameters (parameters, k) and limits, with nominal sizes (n,) and no limits yet."""
        limits = np.ones((3, p.shape[1]))
        return self._function.taken(np.concatenate([p, limits, np.repeat(sizes[:, None], p.shape[1], axis=1)]))

    def limit(self, taken: Array, tolerance: float, end: Array | float, longest: float) -> None:
        """Set the limits in what is `taken`: the tolerance, the end and the longest step, s."""
        first = -(3 + self.states)
        taken[first], taken[first + 1], taken[first + 2] = tolerance, end, longest

    def __call__(self, columns: Array, taken: Array, after: Array) -> None:
        """Write what a step makes of columns (height, k), both contiguous."""
        self._function.into(after, columns, taken)

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
        error = _step_error(_LaneStart(program, time, size, sizes), begun, blind, stages) / tolerance
        factor = 0.85 / heyoka.sqrt(heyoka.sqrt(heyoka.sqrt(error + TINY)))  # the error is of order 8
        factor = _higher(_lower(factor, heyoka.expression(5.0)), heyoka.expression(0.2))  # no wilder from step to step
        good = heyoka.lte(error, 1.0)
        arrived = heyoka.select(heyoka.lt(wanted, left), time + size, end)
        after = [heyoka.select(good, moved, x) for x, moved in zip([*old, time], [*new, arrived], strict=True)]
        here = [at(one, time) for quantity in quantities for one in program.jet(quantity)]
        last = [heyoka.expression(f"seen{k}") for k in range(len(here))]
        come = {pair: heyoka.expression(f"reach{k}") for k, pair in enumerate(self._reaches)}
        column = (*after, size * factor, time, *here, *self._come(time - before, last, here, come))
        return LaneFunction(column, (*old, time, step, before, *last, *come.values()))

    def _come(
        self, length: Any, last: Sequence[Any], here: Sequence[Any], come: Mapping[tuple[int, float], Any]
    ) -> list[Any]:
        """How far quantities can have come by now, from where they have come before the last interval."""
        reaches = []
        for (number, sign), before in come.items():
            jets = last[self.jet(number)], here[self.jet(number)]
            missed = apart(length, *jets)
            between = reduce(_higher, [sign * value for value in inner(length, *jets)])
            beyond = BEYOND * _higher(missed, -missed)
            reaches.append(reduce(_higher, [before, sign * jets[1][0], between + beyond]))
        return reaches


@lru_cache  # what heyoka keeps has to be written out before it is found
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
    stages: list[list[Any]] = [[] for _ in slopes]
    for weights, part in zip(DOP853.A, DOP853.C, strict=True):
        there = {x: _moved(x, size, weights, before) for x, before in zip(states, stages, strict=False)}
        values = heyoka.subs(list(slopes), {**there, heyoka.time: time + part * size})
        for before, slope in zip(stages, values, strict=True):
            before.append(slope)
    return stages


def _moved(x: Any, size: Any, weights: Array, slopes: Sequence[Any]) -> Any:
    """A state moved along slopes."""
    return x + size * _weighted(weights, slopes)


@dataclass(frozen=True, eq=False)
class _LaneStart:
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
        states = zip(self.gradient(quantity), self.nominal, self.program.variables, strict=True)
        return TINY + _squares([slope * part for slope, least, x in states for part in (least, CANCELLED * x)])


def _step_error(
    start: _LaneStart, integrals: Sequence[tuple[Any, Any, int]], blind: Sequence[Any], stages: Sequence[Sequence[Any]]
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
        missed = [_weighted(weights, slopes) for slopes in stages]
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


def _weighted(weights: Array, slopes: Sequence[Any]) -> Any:
    """The sum of slopes with weights."""
    terms = [weight * slope for weight, slope in zip(weights.tolist(), slopes, strict=False) if weight]
    return heyoka.sum(terms) if terms else heyoka.expression(0.0)
