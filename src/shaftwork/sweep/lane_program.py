"""What variants side by side are made of: heyoka's expressions, and functions of them for many lanes at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import heyoka
import numpy as np
from sympy import Expr, Symbol

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.taylor.heyoka import HeyokaProgram
from shaftwork.codegen.taylor.heyoka_expressions import Translator
from shaftwork.codegen.taylor.heyoka_parameters import Fixed
from shaftwork.components.laws import t as TIME
from shaftwork.core.errors import CompileError
from shaftwork.formulation.explicit_rows import Rows
from shaftwork.numerics.hermite import JET

FREE_TIME = heyoka.expression("time")
"""By its own time heyoka does not differentiate."""
KEPT = 32
"""Functions that are kept in a process: what heyoka keeps has to be written out before it is found."""


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


@lru_cache(maxsize=KEPT)
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


def lane_expressions(rows: Rows, expressions: Sequence[Expr]) -> tuple[Any, ...]:
    """Expressions of a network in heyoka's terms.

    Raises:
        CompileError: one has no counterpart in heyoka.
    """
    translator = Translator(rows.states, TIME, tuple(Symbol(p.name, real=True) for p in rows.parameters))
    translated = tuple(translator.expression(expression) for expression in expressions)
    if translator.switches or translator.held:
        raise CompileError("A store switches by a condition, which variants side by side do not follow.")
    return translated
