"""Expressions in machine code: what parameters alone tell is worked out once, and so is what stands twice."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping, Sequence
from functools import partial, reduce
from itertools import chain
from typing import Any

import numpy as np
import sympy
from numba.core.errors import NumbaError
from sympy import Basic, Expr, Symbol
from sympy.logic.boolalg import ITE, And, BooleanFalse, BooleanTrue, Not, Or

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.looped_source import Stencil, read_by, stencils_of
from shaftwork.codegen.taylor.heyoka_parameters import Fixed
from shaftwork.components.discontinuities import bells, between_steps, switches_of
from shaftwork.components.laws import t as TIME
from shaftwork.components.noise import HeldNoise
from shaftwork.components.tables import Interpolation, InterpolationSlope
from shaftwork.core.errors import CompileError
from shaftwork.formulation.explicit_rows import Rows
from shaftwork.numerics.machine_code import Body, held_noise, interpolate, interpolation_slope, machine_function

UNROLLED = 64
"""So many rows are not searched for equal ones: that takes as long as to compile them."""
LARGEST_POWER = 32
"""The largest that is made of products."""
CALLED: dict[Any, Callable[..., Any]] = {
    getattr(sympy, name): getattr(math, name)
    for name in (
        *("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh"),
        *("exp", "log", "erf", "erfc", "gamma"),
    )
} | {
    sympy.Mod: operator.mod,
    HeldNoise: held_noise,
}
"""Functions of numbers that are called."""
TABLES: dict[Any, Callable[..., Any]] = {Interpolation: interpolate, InterpolationSlope: interpolation_slope}
RECIPROCALS: dict[Any, Callable[..., Any]] = {
    sympy.sec: math.cos,
    sympy.csc: math.sin,
    sympy.cot: math.tan,
    sympy.sech: math.cosh,
    sympy.csch: math.sinh,
    sympy.coth: math.tanh,
}
INTRINSIC: dict[Any, str] = {sympy.Abs: "fabs", sympy.floor: "floor", sympy.ceiling: "ceil"}
COMPARED: dict[Any, str] = {
    sympy.StrictGreaterThan: ">",
    sympy.GreaterThan: ">=",
    sympy.StrictLessThan: "<",
    sympy.LessThan: "<=",
    sympy.Equality: "==",
}


class MachineProgram:
    """The right-hand side of explicit rows, and what is watched in its motion, compiled by numba.

    Args:
        rows: the explicit state equations.
        title: of the network, for messages.
        guards: expressions in states, parameters and time.

    Raises:
        CompileError: a law has no machine code.
    """

    def __init__(self, rows: Rows, title: str, guards: Sequence[Expr] = ()) -> None:
        places = dict(zip(rows.states, (("x", k) for k in range(len(rows.states))), strict=True))
        places |= {symbol: ("p", k) for k, symbol in enumerate(rows.parameters)}
        large = len(rows.states) > UNROLLED
        loops = [stencil for stencil in stencils_of(rows) if stencil.count > 1] if large else []
        in_loops = {row for loop in loops for row in range(loop.first, loop.first + loop.count)}
        single = {row: rate for row, rate in enumerate(rows.rates) if row not in in_loops}
        reads = {symbol for loop in loops for symbol, _ in read_by(loop.rate)}
        jumps = jumping(rows.states, rows.rates)
        watched = dict(enumerate((*guards, *jumps)))
        expressions = (*single.values(), *(loop.rate for loop in loops), *watched.values())
        self._fixed = fixed = Fixed(rows.parameters, (*rows.states, *reads, TIME), expressions)
        places |= {part: ("p", len(rows.parameters) + k) for part, k in fixed.places.items()}

        def write(body: Body, values: Mapping[int, Expr], loops: Sequence[Stencil] = ()) -> None:
            terms = Terms(body, fixed, places)
            for place, value in values.items():
                body.write(place, terms.value(value))
            for loop in loops:
                terms.write_loop(loop)

        try:
            rates = machine_function(partial(write, values=single, loops=loops))
            self._code = rates, machine_function(partial(write, values=watched)), len(guards), len(jumps)
        except NumbaError as error:
            raise CompileError(f"'{title}' has a law that numba cannot compile: {error}") from error

    def bind(self, p: Array) -> tuple[Any, Any, int, int, Callable[[Array], Array], Array]:
        """The code with its parameters, from those of the model, as `integrate.problem.MachineRates` has them."""
        return *self._code, self._values, self._values(p)

    def _values(self, p: Array) -> Array:
        return np.concatenate([p, self._fixed.values(p)])


def jumping(states: Sequence[Symbol], rates: Sequence[Expr]) -> tuple[Expr, ...]:
    """What makes a rate jump, bend or rise steeply where its sign changes with the motion."""
    moving, levels = frozenset(states), dict[tuple[Expr, float], None]()
    for rate in rates:
        nodes = sympy.preorder_traversal(rate)
        places = [
            *chain.from_iterable(map(switches_of, nodes)),
            *bells(rate, sorted(moving & rate.free_symbols, key=str)),
        ]
        for argument, values in places:
            # one that changes by the steps of its floors alone passes its levels there
            if moving & argument.free_symbols and (moving | {TIME}) & between_steps(argument):
                levels |= dict.fromkeys((argument, value) for value in values)
    return tuple(argument - level if level else argument for argument, level in levels)


class Terms:
    """Writes expressions as machine code, equal ones once.

    Args:
        body: where it writes.
        fixed: what parameters alone tell.
        places: arrays in which states, parameters and what is fixed stand, and where.
    """

    def __init__(self, body: Body, fixed: Fixed, places: Mapping[Any, tuple[str, int]]) -> None:
        self._body, self._build, self._fixed, self._places = body, body.builder, fixed, places
        self._known: dict[Basic, Any] = {TIME: body.t}

    def write_loop(self, loop: Stencil) -> None:
        """Write equal rows."""
        for node in sympy.preorder_traversal(loop.rate):
            if node in self._places:
                self.value(node)  # before the loop
        outside, reads = dict(self._known), read_by(loop.rate)
        with self._body.loop(loop.first, loop.first + loop.count) as row:
            self._known |= {symbol: self._body.read("x", distance, row) for symbol, distance in reads}
            self._body.write(0, self.value(loop.rate), row)
        self._known = outside

    def define(self, symbol: Symbol, value: Expr) -> None:
        """Let a symbol stand for an expression."""
        self._known[symbol] = self.value(value)

    def value(self, node: Basic) -> Any:
        """A number.

        Raises:
            CompileError: it has no machine code.
        """
        if node not in self._known:
            place = self._places.get(node)
            self._known[node] = self._number(node) if place is None else self._body.read(*place)
        return self._known[node]

    def _number(self, node: Any) -> Any:
        kind, body = node.func, self._body
        if isinstance(node, Symbol):
            raise CompileError(f"'{node}' stands in a law and has no value: it is no argument and no parameter.")
        if isinstance(node, sympy.Number | sympy.NumberSymbol):
            return body.number(float(node))
        if kind in SHAPES:
            return SHAPES[kind](self, node)
        if kind in CALLED:
            return body.call(CALLED[kind], *map(self.value, node.args))
        if kind in RECIPROCALS:
            return self._build.fdiv(body.number(1.0), body.call(RECIPROCALS[kind], self.value(node.args[0])))
        if kind in INTRINSIC:
            return body.intrinsic(INTRINSIC[kind], self.value(node.args[0]))
        if kind in TABLES:
            return body.call(TABLES[kind], self.value(node.argument), *map(body.array, (node.xs, node.ys)))
        raise CompileError(f"There is no machine code of {kind.__name__} in {node}.")

    def sum(self, node: Expr) -> Any:
        """A sum."""
        return reduce(self._build.fadd, map(self.value, self._fixed.arguments(node)))

    def product(self, node: Expr) -> Any:
        """A product, with one quotient in place of negative powers."""
        factors, below = self._fixed.arguments(node), list[Expr]()
        for factor in factors:
            if factor.is_Pow and factor.exp.is_number and factor.exp.is_negative and factor not in self._places:
                below.append(factor)
        above = [self.value(factor) for factor in factors if factor not in below]
        top = reduce(self._build.fmul, above) if above else self._body.number(1.0)
        if not below:
            return top
        return self._build.fdiv(top, reduce(self._build.fmul, [self.value(1 / factor) for factor in below]))

    def power(self, node: Expr) -> Any:
        """A power; one of a whole number as products."""
        (base, exponent), body, build = node.args, self._body, self._build
        if exponent.is_negative and exponent.is_number:
            return build.fdiv(body.number(1.0), self.value(1 / node))
        value = self.value(base)
        if exponent == sympy.S.Half:
            return body.intrinsic("sqrt", value)
        if not exponent.is_Integer or exponent > LARGEST_POWER:
            return body.call(math.pow, value, self.value(exponent))
        result = value
        for bit in bin(int(exponent))[3:]:  # below the first one
            result = build.fmul(result, result)
            result = build.fmul(result, value) if bit == "1" else result
        return result

    def extreme(self, node: Expr) -> Any:
        """The largest or smallest of numbers; no number where one is none."""
        build, comparison = self._build, ">" if node.func is sympy.Max else "<"

        def one_of(one: Any, other: Any) -> Any:
            chosen = build.select(build.fcmp_ordered(comparison, one, other), one, other)
            return build.select(build.fcmp_unordered("uno", one, other), build.fadd(one, other), chosen)

        return reduce(one_of, map(self.value, node.args))

    def step(self, node: Expr) -> Any:
        """A sign or a step: one value above zero, one below, one there."""
        body, build, argument = self._body, self._build, self.value(node.args[0])
        sign, zero = node.func is sympy.sign, body.number(0.0)
        below, at = (body.number(-1.0), zero) if sign else (zero, self.value(node.args[1]))
        rest = build.select(build.fcmp_ordered("<", argument, zero), below, at)
        return build.select(build.fcmp_ordered(">", argument, zero), body.number(1.0), rest)

    def pieces(self, node: Expr) -> Any:
        """The first of some values whose condition holds; no number where none does."""
        rest = self._body.number(math.nan)
        for value, condition in reversed(node.args):
            rest = self._build.select(self._condition(condition), self.value(value), rest)
        return rest

    def _condition(self, node: Any) -> Any:
        """A condition, as one bit."""
        build = self._build
        if isinstance(node, BooleanTrue | BooleanFalse):
            return self._body.bit(value=bool(node))
        if isinstance(node, And | Or):
            return reduce(build.and_ if isinstance(node, And) else build.or_, map(self._condition, node.args))
        if isinstance(node, Not):
            return build.not_(self._condition(node.args[0]))
        if isinstance(node, ITE):
            return build.select(*map(self._condition, node.args))
        if node.func is sympy.Unequality:
            return build.fcmp_unordered("!=", *map(self.value, node.args))
        if node.func in COMPARED:
            return build.fcmp_ordered(COMPARED[node.func], *map(self.value, node.args))
        raise CompileError(f"There is no machine code of the condition {node}.")


SHAPES: dict[Any, Callable[[Terms, Any], Any]] = {
    sympy.Add: Terms.sum,
    sympy.Mul: Terms.product,
    sympy.Pow: Terms.power,
    sympy.Max: Terms.extreme,
    sympy.Min: Terms.extreme,
    sympy.sign: Terms.step,
    sympy.Heaviside: Terms.step,
    sympy.Piecewise: Terms.pieces,
}
"""What is written of several instructions."""
