"""Many variants side by side: one heyoka program whose lanes are variants, each with its own time, states, parameters.

A lane in which a guard is met stands still from there on: its rates are multiplied by a parameter that is 1 while it
runs and 0 afterwards. So the others go on, and its states at the guard are its states at the end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import heyoka
import numpy as np
from numpy.typing import NDArray
from sympy import Expr, Symbol

from shaftwork.codegen.fixed import Fixed
from shaftwork.codegen.heyoka import COOLDOWN, HeyokaProgram
from shaftwork.codegen.heyoka_expressions import Translator
from shaftwork.components.laws import t as TIME
from shaftwork.core.errors import CompileError
from shaftwork.reduction.rows import Rows

Array = NDArray[np.float64]

WIDTH = 8
"""Lanes of one run: of more the program takes longer to compile and the lanes wait for each other, of fewer there are
more calls."""
BLOCK = 4096
"""Points at which a function is evaluated at once."""


@dataclass(frozen=True)
class LaneFunction:
    """Expressions as a function of many times, states and parameters at once.

    Args:
        expressions: heyoka's, in its parameters.
        variables: heyoka's state variables.
        often: whether it is asked so often that optimising it is worth while.
    """

    expressions: tuple[Any, ...]
    variables: tuple[Any, ...]
    often: bool = True

    @cached_property
    def _compiled(self) -> tuple[Any, list[int]]:
        """The function and the parameters that it reads; it knows no others, so that only these are repeated."""
        read = heyoka.get_params(list(self.expressions))
        used = sorted(int(str(parameter)[1:]) for parameter in read)
        renamed = {heyoka.par[number]: heyoka.par[k] for k, number in enumerate(used)}
        made = heyoka.subs(list(self.expressions), renamed) if used else list(self.expressions)
        return heyoka.cfunc(made, vars=list(self.variables), opt_level=3 if self.often else 0), used

    def __call__(self, t: Array, x: Array, p: Array) -> Array:
        """Values (expressions, [m,] k) at times ([m,] k) in s, states (n, [m,] k), parameters (parameters, k)."""
        made = np.empty((len(self.expressions), *t.shape))
        if not self.expressions or not t.size:
            return made
        function, used = self._compiled
        if t.ndim == 1:
            made[:] = self._at(function, t, x, p[used])
            return made
        rows = max(1, BLOCK // t.shape[-1])  # fresh memory costs more than the arithmetic
        given = np.tile(p[used], rows)
        for first in range(0, len(t), rows):
            block = slice(first, first + rows)
            shape, size = t[block].shape, t[block].size
            found = self._at(function, t[block].ravel(), x[:, block].reshape(len(x), size), given[:, :size])
            made[:, block] = found.reshape(len(made), *shape)
        return made

    def _at(self, function: Any, t: Array, x: Array, p: Array) -> Array:
        """(expressions, k) at times (k,), states (n, k), parameters (used, k)."""
        given: dict[str, Any] = {"pars": np.ascontiguousarray(p)} if len(p) else {}
        given["batch_parallel"] = False  # to hand out blocks so small costs more than it brings
        if function.is_time_dependent:
            given["time"] = np.ascontiguousarray(t)
        return np.asarray(function(np.ascontiguousarray(x), **given))


@dataclass(frozen=True)
class LaneProgram:
    """A system whose variants run side by side.

    Args:
        variables: heyoka's state variables.
        rates: heyoka expressions of the derivatives.
        guards: heyoka expressions that end a lane where they rise through zero on their side.
        integrands: heyoka expressions whose integrals are further states, behind the others.
        parameter_count: number of the model's parameters; what is fixed by them follows, then whether a lane runs, and
            the sides and offsets of the guards.
        fixed: what is made of the model's parameters alone.
    """

    variables: tuple[Any, ...]
    rates: tuple[Any, ...]
    guards: tuple[Any, ...]
    integrands: tuple[Any, ...]
    parameter_count: int
    fixed: Fixed
    _compiled: dict[float, Any] = field(default_factory=dict, repr=False, compare=False)
    _met: dict[int, tuple[int, float]] = field(default_factory=dict, repr=False, compare=False)

    @property
    def _first(self) -> int:
        """Place of the parameter that says whether a lane runs."""
        return self.parameter_count + len(self.fixed.found)

    def parameters(self, p: Array) -> Array:
        """(parameters, k) those of the model and what is fixed by them, from those of the model alone."""
        return np.concatenate([p, self.fixed.values(p)])

    def derivatives(self, expression: Any, count: int) -> tuple[Any, ...]:
        """A heyoka expression and its first derivatives by time along the motion."""
        made, time = [expression], heyoka.expression("time")  # by its own time heyoka does not differentiate
        for _ in range(count):
            (free,) = heyoka.subs([made[-1]], {heyoka.time: time})
            terms = [heyoka.diff(free, state) * rate for state, rate in zip(self.variables, self.rates, strict=True)]
            made += heyoka.subs([heyoka.sum([heyoka.diff(free, time), *terms])], {time: heyoka.time})
        return tuple(made)

    @property
    def met(self) -> dict[int, tuple[int, float]]:
        """By lane of the last run, the guard that it has met and when, s."""
        return self._met

    def integrator(self, tolerance: float) -> Any:
        """The `heyoka.taylor_adaptive_batch` for a relative tolerance; one compilation for each tolerance."""
        if tolerance not in self._compiled:
            heyoka.set_logger_level_error()  # a lane that fails says so itself
            running = heyoka.par[self._first]
            integrals = [heyoka.expression(f"integral{k}") for k in range(len(self.integrands))]
            pairs = zip((*self.variables, *integrals), (*self.rates, *self.integrands), strict=True)
            system = [(variable, running * rate) for variable, rate in pairs]
            events = [self._event(number, guard) for number, guard in enumerate(self.guards)]
            options = {"t_events": events} if events else {}
            count = self._first + 1 + 2 * len(self.guards)
            self._compiled[tolerance] = heyoka.taylor_adaptive_batch(
                system,
                np.zeros((len(system), WIDTH)),
                pars=np.zeros((count, WIDTH)),
                tol=tolerance,
                fast_math=True,  # an eighth faster; lanes that are not finite are found by their states
                **options,
            )
        return self._compiled[tolerance]

    def _event(self, number: int, guard: Any) -> Any:
        first = self._first + 1
        side, offset = heyoka.par[first + number], heyoka.par[first + len(self.guards) + number]
        met, running = self._met, slice(self._first, first + len(self.guards))

        def stop(integrator: Any, _direction: int, lane: int) -> bool:
            if lane not in met:
                met[lane] = number, float(integrator.time[lane])
                integrator.pars[running, lane] = 0.0
            return True

        return heyoka.t_event_batch(
            heyoka.select(side, side * guard - offset, heyoka.expression(-1.0)),
            direction=heyoka.event_direction.positive,
            callback=stop,
            cooldown=COOLDOWN,
        )


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
