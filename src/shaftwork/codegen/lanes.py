"""Many variants side by side: one compiled step whose lanes are variants, each with its own time, state, parameters.

The step is one function of heyoka's, straight through all stages of the method, with the control of the step size in
it: a lane that is not accurate enough stays where it is and gets a smaller step. So no lane waits for another, and what
comes out for one does not depend on those beside it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Any

import heyoka
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853
from sympy import Expr, Symbol

from shaftwork.codegen.fixed import Fixed
from shaftwork.codegen.heyoka import HeyokaProgram
from shaftwork.codegen.heyoka_expressions import Translator
from shaftwork.codegen.quintics import BEYOND, JET, apart, inner
from shaftwork.components.laws import t as TIME
from shaftwork.core.errors import CompileError
from shaftwork.reduction.rows import Rows

Array = NDArray[np.float64]

SAFETY, LEAST_FACTOR, MOST_FACTOR = 0.85, 0.2, 5.0
"""Of the next step by the error of this one."""
TINY = 1e-30
"""Beside an error."""
NOWHERE = -1e300
"""So far comes what has not been seen yet."""
BOTH = (1.0, -1.0)
"""The signs of what may matter on both sides."""


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
        made = heyoka.subs(list(self.expressions), renamed) if used else list(self.expressions)
        # fast_math: a quarter faster; what is not finite is found by whoever asks
        return heyoka.cfunc(made, vars=list(self.variables), opt_level=1, fast_math=True), used

    def __call__(self, t: Array, x: Array, p: Array) -> Array:
        """Values (expressions, k) at times (k,) in s, states (n, k), parameters (parameters, k)."""
        made = np.empty((len(self.expressions), t.size))
        if self.expressions and t.size:
            function, _ = self._compiled
            given: dict[str, Any] = {"time": np.ascontiguousarray(t)} if function.is_time_dependent else {}
            self.into(made, np.ascontiguousarray(x), self.taken(p), **given)
        return made

    def taken(self, p: Array) -> Array:
        """Of the parameters (parameters, k) those that are read."""
        return np.ascontiguousarray(p[self._compiled[1]])

    def into(self, made: Array, x: Array, taken: Array, **given: Any) -> None:
        """Write values (expressions, k) for variables (n, k) and what is `taken` of the parameters, all contiguous."""
        function, used = self._compiled
        if used:
            given["pars"] = taken
        function(x, outputs=made, batch_parallel=False, **given)  # to hand out so few costs more than it brings


@dataclass(frozen=True)
class LaneProgram:
    """A system whose variants run side by side.

    Args:
        variables: heyoka's state variables.
        rates: heyoka expressions of the derivatives.
        guards: heyoka expressions that end a lane where they rise through zero on their side.
        integrands: heyoka expressions whose integrals are further states, behind the others.
        parameter_count: number of the model's parameters; what is fixed by them follows.
        fixed: what is made of the model's parameters alone.
    """

    variables: tuple[Any, ...]
    rates: tuple[Any, ...]
    guards: tuple[Any, ...]
    integrands: tuple[Any, ...]
    parameter_count: int
    fixed: Fixed

    def parameters(self, p: Array) -> Array:
        """(parameters, k) those of the model and what is fixed by them, from those of the model alone."""
        return np.concatenate([p, self.fixed.values(p)])

    def jet(self, expression: Any) -> tuple[Any, ...]:
        """A heyoka expression and its first two derivatives by time along the motion."""
        made, time = [expression], heyoka.expression("time")  # by its own time heyoka does not differentiate
        for _ in range(JET - 1):
            (free,) = heyoka.subs([made[-1]], {heyoka.time: time})
            terms = [heyoka.diff(free, state) * rate for state, rate in zip(self.variables, self.rates, strict=True)]
            made += heyoka.subs([heyoka.sum([heyoka.diff(free, time), *terms])], {time: heyoka.time})
        return tuple(made)


class LaneStep:
    """One step of a lane, with its error and the size of the next one; Dormand and Prince's method of order 8(5,3).

    Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.10. The tolerance is a part of the size of a
    state: of its value, of its change in the step and of its nominal size together.

    A lane is a column: first its *rows*, which are states, integrals, time, and the size of the next step; then what
    has been seen, which is the time at the start of the step that led here, jets at that time, and how far each
    quantity, times a sign, can have come. Behind its parameters come its *limits*: the tolerance, the end and the
    longest step, and nominal sizes of the states.

    Args:
        program: the system.
        shown: heyoka expressions of which jets are wanted, each with the signs that matter; the guards follow them.
    """

    def __init__(self, program: LaneProgram, shown: Sequence[tuple[Any, Sequence[float]]]) -> None:
        self.states, self.rows = len(program.variables), len(program.variables) + len(program.integrands) + 2
        self.first_limit = program.parameter_count + len(program.fixed.found)
        quantities = [*shown, *((guard, BOTH) for guard in program.guards)]
        self.jets = slice(self.rows + 1, self.rows + 1 + JET * len(quantities))
        """Rows of what is seen of the quantities."""
        pairs = [(number, sign) for number, (_, signs) in enumerate(quantities) for sign in signs]
        self._reaches = {pair: self.jets.stop + k for k, pair in enumerate(pairs)}
        self.height = self.jets.stop + len(pairs)
        """Number of values in a column."""
        self._room = np.empty(0)
        self._function = self._written(program, [program.jet(quantity) for quantity, _ in quantities])

    def jet(self, number: int) -> slice:
        """Where, among the jets, is that of a quantity."""
        return slice(JET * number, JET * (number + 1))

    def reach(self, number: int, sign: float) -> int:
        """The row of how far a quantity can have come, times a sign."""
        return self._reaches[number, sign]

    def forget(self, columns: Array) -> None:
        """Let nothing be seen in columns (height, k) yet but the jets at the start."""
        columns[self.rows], columns[self.jets.stop :] = columns[self.rows - 2], NOWHERE

    def room(self, size: int) -> Array:
        """(size,) for steps, the same each time: fresh memory costs as much as the arithmetic."""
        if self._room.size < size:
            self._room = np.empty(size)
        return self._room[:size]

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

    def _written(self, program: LaneProgram, jets: Sequence[tuple[Any, ...]]) -> LaneFunction:
        time, step, before = heyoka.make_vars("time", "step", "before")
        integrals = [heyoka.expression(f"integral{k}") for k in range(len(program.integrands))]
        limit = [heyoka.par[self.first_limit + k] for k in range(3 + self.states)]
        (tolerance, end, longest), sizes = limit[:3], limit[3:]
        left = end - time
        wanted = _lower(step, longest)
        size = _lower(wanted, left)
        old = [*program.variables, *integrals]
        stages = _stages(program, time, size)
        new = [_moved(x, size, DOP853.B, slopes) for x, slopes in zip(old, stages, strict=True)]
        error = _error(size, tolerance, sizes, old, stages[: self.states])
        factor = SAFETY / heyoka.sqrt(heyoka.sqrt(heyoka.sqrt(error + TINY)))  # the error is of order 8
        factor = _higher(_lower(factor, heyoka.expression(MOST_FACTOR)), heyoka.expression(LEAST_FACTOR))
        good = heyoka.lte(error, 1.0)
        arrived = heyoka.select(heyoka.lt(wanted, left), time + size, end)
        after = [heyoka.select(good, moved, x) for x, moved in zip([*old, time], [*new, arrived], strict=True)]
        here = heyoka.subs([one for jet in jets for one in jet], {heyoka.time: time}) if jets else []
        last = [heyoka.expression(f"seen{k}") for k in range(len(here))]
        come = {pair: heyoka.expression(f"reach{k}") for k, pair in enumerate(self._reaches)}
        reaches = self._come(time - before, last, here, come)
        return LaneFunction(
            (*after, size * factor, time, *here, *reaches), (*old, time, step, before, *last, *come.values())
        )

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


def _lower(a: Any, b: Any) -> Any:
    """The lower of two expressions."""
    return heyoka.select(heyoka.lt(a, b), a, b)


def _higher(a: Any, b: Any) -> Any:
    """The higher of two expressions."""
    return heyoka.select(heyoka.gt(a, b), a, b)


def _stages(program: LaneProgram, time: Any, size: Any) -> list[list[Any]]:
    """Slopes at the stages of a step, by state and integral."""
    slopes: list[list[Any]] = [[] for _ in (*program.rates, *program.integrands)]
    expressions = [*program.rates, *program.integrands]
    for weights, part in zip(DOP853.A, DOP853.C, strict=True):
        there = {x: _moved(x, size, weights, before) for x, before in zip(program.variables, slopes, strict=False)}
        for before, slope in zip(
            slopes, heyoka.subs(expressions, {**there, heyoka.time: time + part * size}), strict=True
        ):
            before.append(slope)
    return slopes


def _moved(x: Any, size: Any, weights: Array, slopes: Sequence[Any]) -> Any:
    """A state moved along slopes."""
    return x + size * _weighted(weights, slopes)


def _weighted(weights: Array, slopes: Sequence[Any]) -> Any:
    """The sum of slopes with weights."""
    terms = [weight * slope for weight, slope in zip(weights.tolist(), slopes, strict=False) if weight]
    return heyoka.sum(terms) if terms else heyoka.expression(0.0)


def _error(size: Any, tolerance: Any, nominal: Sequence[Any], old: Sequence[Any], stages: Sequence[list[Any]]) -> Any:
    """The error of a step as a part of what is allowed: of order 5 and of order 3 as in the method's own program."""
    squares = []
    for weights in (DOP853.E5, DOP853.E3):
        parts = []
        for x, slopes, least in zip(old, stages, nominal, strict=False):
            allowed = least * least + x * x + (size * slopes[0]) * (size * slopes[0])
            missed = _weighted(weights, slopes)
            parts.append(missed * missed / allowed)
        squares.append(heyoka.sum(parts))
    fifth, third = squares
    return size * fifth / (tolerance * heyoka.sqrt(fifth + 0.01 * third + TINY * TINY))


def lane_program(program: HeyokaProgram, rows: Rows, integrands: Sequence[Expr]) -> LaneProgram:
    """The program for many variants of what there is a program for one.

    Args:
        program: for one variant, with its guards.
        rows: the same as expressions.
        integrands: expressions whose integrals over the run are wanted.

    Raises:
        CompileError: a law switches by a condition, which ends a step in each lane at a time of its own.
    """
    expressions = (*rows.rates, *integrands)
    fixed = Fixed(rows.parameters, (*rows.states, TIME), expressions, before=program.fixed.found)
    translator = Translator(rows.states, TIME, rows.parameters, fixed=fixed)
    made = tuple(translator.expression(expression) for expression in expressions)
    if program.switches or program.fading or program.held is not None or translator.switches or translator.fading:
        raise CompileError("A law of the network switches by a condition, which variants side by side do not follow.")
    rates, integrals = made[: len(rows.rates)], made[len(rows.rates) :]
    return LaneProgram(program.variables, rates, program.guards, integrals, len(rows.parameters), fixed)


def lane_expressions(rows: Rows, expressions: Sequence[Expr]) -> tuple[Any, ...]:
    """Expressions of a network in heyoka's terms.

    Raises:
        CompileError: one has no counterpart in heyoka.
    """
    translator = Translator(rows.states, TIME, tuple(Symbol(p.name, real=True) for p in rows.parameters))
    made = tuple(translator.expression(expression) for expression in expressions)
    if translator.switches or translator.held:
        raise CompileError("A quantity switches by a condition, which variants side by side do not follow.")
    return made
