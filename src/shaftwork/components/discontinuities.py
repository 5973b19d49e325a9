"""Where a law jumps, bends or peaks, and how it goes between its breakpoints: along straight pieces, or not.

A formula of coupled equations has the same parts in many places: a thousand of them may be a million when written out.
What goes through formulas looks at each part once.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations

import sympy
from sympy.core.relational import Relational

from shaftwork.components.branches import ACROSS, INTEGRAL, readings_in
from shaftwork.components.law_slopes import MOST_DEGREE, complement, is_root, square_root
from shaftwork.components.laws import SYMBOLS, t
from shaftwork.components.noise import SmoothNoise
from shaftwork.components.tables import TABLE_FUNCTIONS, Interpolation, InterpolationSlope

EDGES = (sympy.exp, sympy.sinh, sympy.cosh, sympy.tanh, sympy.atan, sympy.Pow)
"""Functions that rise or fall in a small part of their argument's range; powers, where it or a fraction is in them."""


def breakpoints(expression: sympy.Basic, values: Mapping[sympy.Symbol, float] | None = None) -> tuple[float, ...]:
    """Times in s at which an expression jumps or kinks because of the time alone, increasing.

    Found are comparisons, Heaviside, sign, Abs, Max, Min and tables of arguments that are linear in `t`. A switch that
    depends on a state has no time that is known beforehand and is left out, as is one that depends on a nonlinear
    function of time, or that is one of endlessly many: those are found in the span of a run
    (`codegen.time_switches`). A listed time need not be a kink (equal slopes on both sides).

    Args:
        expression: a law or any expression that contains laws.
        values: a number for each parameter in the expression.
    """
    numbers = {symbol: sympy.Float(value) for symbol, value in (values or {}).items()}
    times: set[float] = set()
    for argument, levels in switches(expression):
        straight = line(argument.xreplace(numbers))
        if straight is None or straight[0].is_zero or straight[0].free_symbols | straight[1].free_symbols:
            continue
        slope, offset = map(float, straight)
        times.update((level - offset) / slope + 0.0 for level in levels)
    return tuple(sorted(time for time in times if math.isfinite(time)))


def switches(expression: sympy.Basic) -> Iterator[tuple[sympy.Expr, Sequence[float]]]:
    """Every argument in an expression with the levels at which it makes the expression jump or bend.

    One that is constant but for steps of `floor` passes its levels there alone, and is left out.
    """
    for node in sympy.preorder_traversal(expression):
        yield from ((argument, levels) for argument, levels in switches_of(node) if not _only_steps(argument))


def switches_of(node: sympy.Basic) -> Iterable[tuple[sympy.Expr, Sequence[float]]]:
    """Arguments of a node and the levels at which the node is not smooth in them."""
    if isinstance(node, TABLE_FUNCTIONS):
        return [(node.argument, node.xs)]
    match node:
        case Relational():
            return [(node.lhs - node.rhs, (0.0,))]
        case sympy.Heaviside() | sympy.sign() | sympy.Abs():
            return [(node.args[0], (0.0,))]
        case sympy.Max() | sympy.Min():
            return [(first - second, (0.0,)) for first, second in combinations(node.args, 2)]
        case sympy.atan2():
            return [(node.args[0], (0.0,))]
        case sympy.tan():
            return [(sympy.cos(node.args[0]), (0.0,))]
        case sympy.asin() | sympy.acos() if (corner := complement(node)) is not None:
            return [(corner, (0.0,))]  # of asin(sin(x)), a triangular wave, cos(x)
        case sympy.Pow() if is_root(node) and (root := square_root(node.base)) is not None:
            return [(root, (0.0,))]
        case sympy.floor() | SmoothNoise():
            # a sine changes sign at every whole number, and no list of levels would have an end
            return [(sympy.sin(sympy.pi * node.args[0]), (0.0,))]
    return []


def narrow_places(expression: sympy.Basic) -> Iterator[tuple[sympy.Expr, bool]]:
    """What is zero where an expression of time may have a narrow pulse or edge, or a train of them.

    Law: a function f(g(t)) of an edge, tanh((t - 5) / 1e-3), has it where g is zero; that of a pulse,
    exp(-((t - 5) / 1e-3)^2) or 1 / (1 + ((t - 5) / 1e-3)^2), where g has its turning point, and between the edges of a
    train, tanh(300 sin(20 t)), it has one too. What a fraction of a polynomial has goes on far away from there, which
    is told with it. What switches where a wave in time passes something that moves, as a pulse width does that follows
    a current, may do so twice between two turning points of the wave and no more often.
    """
    waves = dict.fromkeys(wave for argument, _ in switches(expression) for wave in _waves(argument))
    yield from ((wave.diff(t), False) for wave in waves)
    for node in sympy.preorder_traversal(expression):
        if isinstance(node, EDGES):
            argument, fraction = _inside(node)
            if argument.has(t) and _is_simple(argument):
                slope = argument.diff(t)
                yield slope if slope.has(t) else argument, fraction and argument.is_polynomial(t)


def unsolved_places(expression: sympy.Basic, symbols: Iterable[sympy.Symbol]) -> Iterator[sympy.Expr]:
    """What in an expression may have pulses and edges that `narrow_places` cannot solve for, as sin(t)^20000.

    Args:
        expression: a law.
        symbols: what it may hold beside the time.
    """
    nodes = sympy.preorder_traversal(expression)
    for node in nodes:
        if isinstance(node, EDGES) and node.has(t) and node.free_symbols <= {t, *symbols}:
            whole = isinstance(node, sympy.Pow) and node.exp.is_Integer and 0 < node.exp <= MOST_DEGREE
            argument, _ = _inside(node)
            if not whole and not (argument.has(t) and _is_simple(argument)):
                nodes.skip()
                yield node


def _waves(argument: sympy.Expr) -> Iterator[sympy.Expr]:
    """The sines of lines in time in an argument that moves besides."""
    if argument.has(t) and argument.has(*SYMBOLS[1:], ACROSS, INTEGRAL, *readings_in(argument)):
        waves = sorted(argument.atoms(sympy.sin, sympy.cos), key=sympy.default_sort_key)
        yield from (wave for wave in waves if wave.has(t) and line(wave.args[0]) is not None)


def _inside(node: sympy.Basic) -> tuple[sympy.Expr, bool]:
    """The argument of a function that may have an edge, and whether it is a fraction."""
    fraction = isinstance(node, sympy.Pow) and node.exp.is_negative
    return node.exp if isinstance(node, sympy.Pow) and not fraction else node.args[0], fraction  # 2^-x is exp(-x log 2)


def _is_simple(argument: sympy.Expr) -> bool:
    """Whether an expression is a polynomial, as pulses have it, of time and of sines of lines in time."""
    waves = (wave for wave in argument.atoms(sympy.sin, sympy.cos) if wave.has(t) and line(wave.args[0]) is not None)
    sines = {wave: sympy.Dummy() for wave in waves}
    plain, moving = argument.xreplace(sines), (t, *sines.values())
    powers = [power.exp for power in plain.atoms(sympy.Pow) if power.has(*moving)]
    return all(power.is_Integer and 0 < power <= MOST_DEGREE for power in powers) and plain.is_polynomial(*moving)


def bells(expression: sympy.Basic, symbols: Sequence[sympy.Symbol]) -> Iterator[tuple[sympy.Expr, tuple[float, ...]]]:
    """Where steps end at bells over what moves, exp(-((omega - 5) / 1e-2)^2): at their tops and on their flanks.

    A step that begins before a bell and ends behind it sees nothing of it, but for the slope of the exponent.
    """
    for node in sorted(expression.atoms(sympy.exp), key=sympy.default_sort_key):
        slopes = [node.args[0].diff(symbol) for symbol in symbols]
        tops = [slope for slope, symbol in zip(slopes, symbols, strict=True) if slope.has(symbol)]
        yield from ((top, (0.0,)) for top in tops)
        # Steps end at these exponents on its flank: e^-24 is below every tolerance, and the last is near the top.
        yield from [(node.args[0], (-24.0, -8.0, -2.0, -0.5))] if tops else ()


def between_steps(expression: sympy.Expr) -> set[sympy.Symbol]:
    """The symbols on which an expression depends while none of its floors steps."""
    floors: dict[sympy.Expr, sympy.Expr] = {step: sympy.Dummy() for step in expression.atoms(sympy.floor)}
    return set(expression.xreplace(floors).free_symbols.difference(floors.values()))


def _only_steps(argument: sympy.Expr) -> bool:
    """Whether an argument is constant but for the steps of its floors."""
    if not argument.has(sympy.floor):
        return False
    moving = (*SYMBOLS, ACROSS, INTEGRAL, *readings_in(argument))
    return between_steps(argument).isdisjoint(moving)


def line(expression: sympy.Expr) -> tuple[sympy.Expr, sympy.Expr] | None:
    """Slope and offset of an expression that is linear in t, else None."""
    still, moving = expression.as_independent(t, as_Add=True)  # no polynomial need expand what is still
    if (polynomial := moving.as_poly(t)) is None or polynomial.degree() > 1:
        return None
    return polynomial.coeff_monomial(t), still + polynomial.coeff_monomial(1)


def pieces_degree(expression: sympy.Expr) -> int | None:
    """Degree in `t` of an expression between its breakpoints: 0 constant, 1 linear, None anything else.

    Every symbol other than `t` counts as a constant.
    """
    degree = _Degrees(expression).of(expression)
    return int(degree) if degree <= 1 else None


class _Degrees:
    """Degrees in t between breakpoints of the parts of an expression; infinite where one is no polynomial there."""

    def __init__(self, expression: sympy.Expr) -> None:
        self._steps = any(isinstance(part, sympy.floor) for part in parts((expression,)))
        self._moving: dict[sympy.Basic, bool] = {t: True}
        self._results: dict[sympy.Basic, float] = {}

    def of(self, expression: sympy.Expr) -> float:
        """Degree of a part."""
        if expression not in self._results:
            self._results[expression] = self._degree(expression)
        return self._results[expression]

    def _moves(self, expression: sympy.Basic) -> bool:
        if expression not in self._moving:
            self._moving[expression] = any(self._moves(part) for part in expression.args)
        return self._moving[expression]

    def _located(self, argument: sympy.Expr) -> bool:
        return not self._moves(argument) or line(argument) is not None

    def _degree(self, expression: sympy.Expr) -> float:
        if not self._moves(expression):
            return 0
        if self._steps and t not in between_steps(expression):
            return 0 if all(self._located(step.args[0]) for step in expression.atoms(sympy.floor)) else math.inf
        if not all(self._located(argument) for argument, _ in switches_of(expression)):
            return math.inf
        match expression:
            case sympy.Symbol():
                return 1
            case sympy.Add() | sympy.Max() | sympy.Min():
                return max(self.of(argument) for argument in expression.args)
            case sympy.Mul():
                return sum(self.of(factor) for factor in expression.args)
            case sympy.Pow(exp=sympy.Integer(is_positive=True) as exponent):
                return self.of(expression.base) * int(exponent)
            case sympy.Piecewise():
                relations = [relation for _, condition in expression.args for relation in condition.atoms(Relational)]
                located = all(self._located(relation.lhs - relation.rhs) for relation in relations)
                return max(self.of(value) for value, _ in expression.args) if located else math.inf
            case sympy.Heaviside() | sympy.sign() | InterpolationSlope():
                return 0
            case sympy.Abs() | Interpolation():
                return 1
        return math.inf


def parts(expressions: Iterable[sympy.Basic]) -> Iterator[sympy.Basic]:
    """Every distinct part of expressions once, the expressions as well."""
    left = list(dict.fromkeys(expressions))
    seen = set(left)
    while left:
        node = left.pop()
        yield node
        new = [part for part in dict.fromkeys(node.args) if part not in seen]
        seen.update(new)
        left += new
