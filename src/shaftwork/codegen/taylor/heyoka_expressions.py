"""Sympy expressions in heyoka's terms, conditions as signs of switches."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import reduce
from itertools import pairwise
from typing import Any

import heyoka
import sympy
from sympy.functions.elementary.piecewise import ExprCondPair
from sympy.logic.boolalg import ITE, And, BooleanFalse, BooleanTrue, Not, Or, Xor

from shaftwork.codegen.taylor.heyoka_cache import keep_apart
from shaftwork.codegen.taylor.heyoka_parameters import Fixed, Held
from shaftwork.components import noise
from shaftwork.components.discontinuities import between_steps
from shaftwork.components.law_slopes import wraps
from shaftwork.components.noise import HeldNoise
from shaftwork.components.tables import Interpolation, InterpolationSlope
from shaftwork.core.errors import CompileError

keep_apart()  # before anything is compiled

SAME_NAME: dict[Any, Callable[..., Any]] = {
    getattr(sympy, name): getattr(heyoka, name)
    for name in (
        *("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh"),
        *("exp", "log", "erf", "erfc"),
    )
}
RECIPROCALS: dict[Any, Callable[[Any], Any]] = {
    sympy.sec: heyoka.cos,
    sympy.csc: heyoka.sin,
    sympy.cot: heyoka.tan,
    sympy.sech: heyoka.cosh,
    sympy.csch: heyoka.sinh,
    sympy.coth: heyoka.tanh,
}
COMPARISONS: dict[Any, Callable[[Any, Any], Any]] = {
    sympy.StrictGreaterThan: heyoka.gt,
    sympy.GreaterThan: heyoka.gte,
    sympy.StrictLessThan: heyoka.lt,
    sympy.LessThan: heyoka.lte,
    sympy.Equality: heyoka.eq,
    sympy.Unequality: heyoka.neq,
}


# Far from zero these are a constant to the last bit, so that a series does not show where they change.
FADING = (sympy.tanh, sympy.coth, sympy.sech, sympy.csch, sympy.exp)


class Translator:
    """Translates expressions of one system; equal subexpressions are translated once.

    Args:
        states: state symbols; they become the heyoka variables `variables`.
        time: symbol of time.
        parameters: parameter symbols; they become heyoka.par[0], heyoka.par[1], ...
        stepping: number of different floors and held noises in all that is to be translated, which follow what is
            fixed.
        fixed: what is made of parameters alone and follows them.
    """

    def __init__(
        self,
        states: Sequence[sympy.Symbol],
        time: sympy.Symbol,
        parameters: Sequence[sympy.Symbol],
        stepping: int = 0,
        fixed: Fixed | None = None,
    ) -> None:
        self.variables = tuple(heyoka.expression(f"x{index}") for index in range(len(states)))
        self.switches: list[Any] = []
        self.conditions: list[str] = []
        self.timed: list[bool] = []
        self.stepping: list[bool] = []
        self.held: list[Held] = []
        self._states = frozenset(states)
        self.fading: dict[sympy.Expr, Any] = {}
        self._fixed = Fixed(parameters, (), ()) if fixed is None else fixed
        self._first_held = len(parameters) + len(self._fixed.places)
        self._first_sign = self._first_held + stepping
        self._moving = frozenset((*states, time))
        self._done: dict[sympy.Basic, Any] = dict(zip(states, self.variables, strict=True))
        self._done.update((symbol, heyoka.par[index]) for index, symbol in enumerate(parameters))
        self._done.update((part, heyoka.par[len(parameters) + place]) for part, place in self._fixed.places.items())
        self._done[time] = heyoka.time
        self._signs: dict[sympy.Basic, Any] = {}

    def expression(self, node: sympy.Basic) -> Any:
        """The heyoka expression of a sympy expression or condition.

        Raises:
            CompileError: it has no heyoka counterpart.
        """
        if node not in self._done:
            self._done[node] = self._translate(node)
        return self._done[node]

    def _translate(self, node: sympy.Basic) -> Any:
        kind = node.func
        if wraps(node):
            raise CompileError(f"A Taylor series goes on smoothly where {node} begins a new turn. Use engine='scipy'.")
        if kind in FADING and not self._moving.isdisjoint(node.free_symbols):
            rate = 1.0 if kind is sympy.exp else 2.0  # tanh u is 1 - 2 e^(-2 u)
            self.fading[node.args[0]] = rate * self.expression(node.args[0])
        if kind in SAME_NAME:
            return SAME_NAME[kind](*self.arguments(node))
        if kind in RECIPROCALS:
            return 1.0 / RECIPROCALS[kind](*self.arguments(node))
        if kind in COMPARISONS:
            return COMPARISONS[kind](self.sign(node.args[0] - node.args[1]), heyoka.expression(0.0))
        if kind in SHAPES:
            return SHAPES[kind](self, node)
        if isinstance(node, sympy.Number | sympy.NumberSymbol) and math.isfinite(float(node)):
            return heyoka.expression(float(node))
        if isinstance(node, sympy.Symbol):
            raise CompileError(f"The symbol {node} is neither a state nor a parameter of this model.")
        raise CompileError(
            f"The heyoka engine has no counterpart of {kind.__name__} in {node}. "
            "Use engine='scipy' or engine='sundials'."
        )

    def arguments(self, node: sympy.Basic) -> list[Any]:
        """The arguments of a node, translated."""
        return [self.expression(argument) for argument in self._fixed.arguments(node)]

    def product(self, node: sympy.Mul) -> Any:
        """A product, with quotients as such and not as negative powers; its roots are smoothed where it has a slope."""
        above: list[Any] = []
        below: list[Any] = []
        factors = self._fixed.arguments(node)
        for factor in factors:
            power = isinstance(factor, sympy.Pow) and factor not in self._fixed.places and factor.exp.is_number
            if power and factor.exp.is_negative:
                below.append(self.expression(1 / factor))
            elif power and isinstance(factor.base, sympy.Abs) and _rise(factors, factor.base.args[0]) > 1:
                above.append(self._smooth_power(factor))
            else:
                above.append(self.expression(factor))
        upper = heyoka.prod(above) if above else heyoka.expression(1.0)
        return upper / heyoka.prod(below) if below else upper

    def power(self, node: sympy.Pow) -> Any:
        """A power, with square roots and quotients as such, whole powers as products, and those of a size smoothed.

        heyoka's own recurrence for a power divides by the base, which is zero at rest.
        """
        exponent = node.exp
        if exponent.is_number and exponent.is_negative:
            return 1.0 / self.expression(node.base**-exponent)
        if exponent.is_number and float(exponent).is_integer():
            return _whole_power(self.expression(node.base), int(exponent))
        if exponent.is_number and exponent > 1 and isinstance(node.base, sympy.Abs):
            return self._smooth_power(node)
        if node.base.is_number and node.base.is_positive:
            return self.expression(sympy.exp(exponent * sympy.log(node.base).evalf()))
        base = self.expression(node.base)
        return heyoka.sqrt(base) if exponent == sympy.S.Half else base ** self.expression(exponent)

    def _smooth_power(self, node: sympy.Pow) -> Any:
        """A power |u|^a = (u^2 + e^2)^(a/2), with a tiny e, which has a series at zero as well."""
        base = self.expression(node.base.args[0])
        # A power |u|^1.5 has no series at zero. Within 1e-18 of zero, in the unit of u, it is rounded, and changes by
        # less than this part of its value at u = 1.
        return (base * base + 1e-18**2) ** heyoka.expression(float(node.exp) / 2)

    def sign(self, switch: sympy.Expr) -> Any:
        """The sign of an expression: -1, 0 or 1; a parameter that an event changes where the sign may change."""
        if switch.could_extract_minus_sign():
            return -self.sign(-switch)
        if switch not in self._signs:
            value = self.expression(switch)
            zero, one = heyoka.expression(0.0), heyoka.expression(1.0)
            if self._moving.isdisjoint(between_steps(switch)):
                sign = heyoka.select(heyoka.gt(value, zero), one, heyoka.select(heyoka.lt(value, zero), -one, zero))
            else:
                sign = heyoka.par[self._first_sign + len(self.switches)]
                self._add_switch(value, f"{switch} > 0", switch)
            self._signs[switch] = sign
        return self._signs[switch]

    def _add_switch(self, value: Any, condition: str, switch: sympy.Expr) -> None:
        self.switches.append(value)
        self.conditions.append(condition)
        self.timed.append(self._states.isdisjoint(switch.free_symbols))
        self.stepping.append(switch.has(*HELD))

    def constant(self, node: sympy.Expr) -> Any:
        """A function that is constant between switches; a parameter that an event changes where it steps."""
        if any(argument.has(*SIDED) for argument in node.args) and not self._moving.isdisjoint(node.free_symbols):
            raise CompileError(f"A Taylor series cannot follow {node}, which has a kink inside. Use engine='scipy'.")
        arguments = tuple(self.arguments(node))
        place = heyoka.par[self._first_held + len(self.held)]
        timed = self._states.isdisjoint(node.free_symbols)
        switch = None
        if isinstance(node, sympy.floor) and not timed and not self._moving.isdisjoint(between_steps(node.args[0])):
            switch = len(self.switches)
            self._add_switch((arguments[0] - place) * (place + 1.0 - arguments[0]), f"{node} = n", node.args[0])
        self.held.append(Held(arguments, HELD[node.func], timed, switch))
        return place

    def heaviside(self, node: sympy.Heaviside) -> Any:
        """The unit step of an argument."""
        sign = self.sign(node.args[0])
        at_zero = self.expression(node.args[1])
        return heyoka.select(sign, 0.5 + 0.5 * sign, at_zero)

    def extreme(self, node: sympy.Max | sympy.Min) -> Any:
        """The largest or smallest of the arguments, two at a time."""
        zero = heyoka.expression(0.0)
        better = heyoka.gt if isinstance(node, sympy.Max) else heyoka.lt
        arguments = sorted(node.args, key=sympy.default_sort_key)
        result = self.expression(arguments[0])
        for number, other in enumerate(arguments[1:], 1):
            # The best so far is itself an extreme: the switch compares with it as a whole.
            best = arguments[0] if number == 1 else node.func(*arguments[:number])
            wins = better(self.sign(other - best), zero)
            result = heyoka.select(wins, self.expression(other), result)
        return result

    def piecewise(self, node: sympy.Piecewise) -> Any:
        """The first value whose condition holds."""
        pairs: list[ExprCondPair] = list(node.args)
        result = self.expression(pairs[-1].expr)
        if pairs[-1].cond != sympy.true:
            result = heyoka.select(self.expression(pairs[-1].cond), result, heyoka.expression(math.nan))
        for pair in reversed(pairs[:-1]):
            result = heyoka.select(self.expression(pair.cond), self.expression(pair.expr), result)
        return result

    def interpolation(self, node: Interpolation) -> Any:
        """Straight lines between the points of a table, constant beyond its ends."""
        position = self.expression(node.args[0])
        lines = [
            low + slope * (position - left) for left, low, slope in zip(node.xs, node.ys, _slopes(node), strict=False)
        ]
        return self._segment(node, [heyoka.expression(node.ys[0]), *lines, heyoka.expression(node.ys[-1])])

    def interpolation_slope(self, node: InterpolationSlope) -> Any:
        """The slope of each straight line of a table, zero beyond its ends."""
        return self._segment(node, [heyoka.expression(slope) for slope in (0.0, *_slopes(node), 0.0)])

    def _segment(self, node: Any, segments: list[Any]) -> Any:
        """The segment of a table in which its argument lies, by a balanced tree of decisions."""
        argument, xs, zero = node.args[0], node.xs, heyoka.expression(0.0)

        def choose(first: int, last: int) -> Any:
            if first == last:
                return segments[first]
            middle = (first + last) // 2
            beyond = heyoka.gte(self.sign(argument - xs[middle]), zero)
            return heyoka.select(beyond, choose(middle + 1, last), choose(first, middle))

        return choose(0, len(xs))


def _rise(factors: Sequence[sympy.Expr], base: sympy.Expr) -> float:
    """The power with which a product goes to zero with a base: 1.5 for u |u|^0.5."""
    powers = (factor.as_base_exp() for factor in factors)
    return sum(float(exponent) for other, exponent in powers if exponent.is_number and abs(other) == abs(base))


def _whole_power(base: Any, exponent: int) -> Any:
    """A positive whole power by repeated squaring."""
    if exponent == 1:
        return base
    half = _whole_power(base, exponent // 2)
    return half * half * base if exponent % 2 else half * half


def _slopes(node: Any) -> tuple[float, ...]:
    points = pairwise(zip(node.xs, node.ys, strict=True))
    return tuple((high - low) / (right - left) for (left, low), (right, high) in points)


SIDED = (sympy.sign, sympy.Abs, sympy.Heaviside, sympy.Max, sympy.Min, sympy.Piecewise, Interpolation)
"""Functions that have a switch for each side."""
HELD: dict[Any, Callable[..., float]] = {
    sympy.floor: lambda x: math.floor(x) if math.isfinite(x) else x,
    HeldNoise: noise.held,
}
"""Functions that are constant between switches."""

SHAPES: dict[Any, Callable[[Translator, Any], Any]] = {
    sympy.Add: lambda translator, node: heyoka.sum(translator.arguments(node)),
    sympy.Mul: Translator.product,
    sympy.Pow: Translator.power,
    sympy.sign: lambda translator, node: translator.sign(node.args[0]),
    sympy.Abs: lambda translator, node: translator.sign(node.args[0]) * translator.expression(node.args[0]),
    sympy.Heaviside: Translator.heaviside,
    sympy.Max: Translator.extreme,
    sympy.Min: Translator.extreme,
    sympy.Piecewise: Translator.piecewise,
    ITE: lambda translator, node: heyoka.select(*translator.arguments(node)),
    sympy.floor: Translator.constant,
    HeldNoise: Translator.constant,
    Interpolation: Translator.interpolation,
    InterpolationSlope: Translator.interpolation_slope,
    Not: lambda translator, node: heyoka.eq(*translator.arguments(node), heyoka.expression(0.0)),
    And: lambda translator, node: heyoka.logical_and(translator.arguments(node)),
    Or: lambda translator, node: heyoka.logical_or(translator.arguments(node)),
    Xor: lambda translator, node: reduce(heyoka.neq, translator.arguments(node)),
    BooleanTrue: lambda *_: heyoka.expression(1.0),
    BooleanFalse: lambda *_: heyoka.expression(0.0),
}
