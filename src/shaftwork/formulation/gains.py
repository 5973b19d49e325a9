"""The entries of loop and node equations: whole numbers, or gear ratios combined by products, sums and quotients.

A combination is kept as what it was made of, with two values: one for the network's own ratios, which decides whether
it is zero, and one for other ratios, which tells whether it is always zero. Expressions are made of it only when
somebody reads them, so long gear trains cost no algebra.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from zlib import crc32

from sympy import Expr, Float, Integer, Mul, Rational, Symbol, cancel

from shaftwork.numerics.tolerances import TYPED

_OPERATIONS: Mapping[str, Callable[[Any, Any], Any]] = {
    "*": operator.mul,
    "+": operator.add,
    "/": operator.truediv,
}
LARGEST_DENOMINATOR = 1000
"""The largest denominator of a fraction that is printed as one."""


@dataclass(frozen=True, slots=True, eq=False)
class Gain:
    """A ratio, or a combination of ratios.

    Args:
        value: for the network's parameters.
        probe: for other parameters.
        operation: "*", "+" or "/" of two numbers; "" for a coefficient of a component.
        of: the two numbers, or the coefficient as an expression in the network's parameters.
    """

    value: float
    probe: float
    operation: str
    of: tuple[Any, ...]

    def __mul__(self, other: Number) -> Gain:
        return _combined("*", self, other)

    __rmul__ = __mul__

    def __neg__(self) -> Gain:
        return _combined("*", self, -1)


Number = int | Gain


def coefficient(expression: Expr, values: Mapping[Symbol, float]) -> Number:
    """A coefficient of a component: an expression in the network's parameters, whose values are given."""
    if expression.is_Integer:
        return int(expression)
    here = {symbol: Float(value) for symbol, value in values.items()}
    elsewhere = {symbol: Float(value * (1.1 + crc32(symbol.name.encode()) / 2**32)) for symbol, value in values.items()}
    return Gain(float(expression.xreplace(here)), float(expression.xreplace(elsewhere)), "", (expression,))


def value_of(number: Number) -> float:
    """The number for the network's parameters."""
    return number.value if isinstance(number, Gain) else float(number)


def _probe(number: Number) -> float:
    return number.probe if isinstance(number, Gain) else float(number)


def _combined(operation: str, first: Number, second: Number) -> Gain:
    combine = _OPERATIONS[operation]
    return Gain(
        combine(value_of(first), value_of(second)), combine(_probe(first), _probe(second)), operation, (first, second)
    )


def add(first: Number, second: Number, coincidences: list[Gain]) -> Number:
    """The sum; where it vanishes for these ratios but not for all, it is put down in `coincidences`."""
    if isinstance(first, int) and isinstance(second, int):
        return first + second
    total = _combined("+", first, second)
    if abs(total.value) > TYPED * max(abs(value_of(first)), abs(value_of(second))):
        return total
    if abs(total.probe) > TYPED * max(abs(_probe(first)), abs(_probe(second))):
        coincidences.append(total)
    return 0


def divide(first: Number, second: Number) -> Number:
    """The quotient; whole numbers stay whole where the divisor is 1 or -1."""
    if isinstance(second, int) and abs(second) == 1:
        return first * second
    return _combined("/", first, second)


def fold(numbers: Iterable[Number], leaf: Callable[[Expr], Any]) -> list[Any]:
    """The numbers with the coefficients of gains replaced by what `leaf` makes of them; whole numbers stay.

    What gains share is computed once.

    Args:
        numbers: what to compute.
        leaf: from a coefficient to a number or an expression.
    """
    wanted = tuple(numbers)
    done: dict[int, Any] = {}

    def value(number: Number) -> Any:
        return done[id(number)] if isinstance(number, Gain) else number

    for gain in _parts_first([number for number in wanted if isinstance(number, Gain)]):
        if gain.operation:
            first, second = gain.of
            done[id(gain)] = _OPERATIONS[gain.operation](value(first), value(second))
        else:
            done[id(gain)] = leaf(gain.of[0])
    return [value(number) for number in wanted]


def _parts_first(gains: Sequence[Gain]) -> list[Gain]:
    """All gains and what they are made of, parts before wholes; without recursion, for gear trains may be long."""
    order: list[Gain] = []
    seen: dict[int, None] = {}
    stack: list[tuple[Gain, bool]] = [(gain, False) for gain in reversed(gains)]
    while stack:
        gain, complete = stack.pop()
        if complete:
            order.append(gain)
        elif id(gain) not in seen:
            seen[id(gain)] = None
            stack.append((gain, True))
            if gain.operation:
                stack.extend((part, False) for part in reversed(gain.of) if isinstance(part, Gain))
    return order


def any_sum_vanishes(gains: Iterable[Gain], values: Mapping[Expr, float]) -> bool:
    """Whether, for other values of the coefficients, a sum is zero that is not zero for the network's own."""
    order = _parts_first(tuple(gains))
    sums = [gain for gain in order if gain.operation == "+"]
    terms = [gain.of for gain in sums]
    try:
        totals = fold(sums, values.__getitem__)
        sizes = [max(map(abs, fold(pair, values.__getitem__))) for pair in terms]
    except ZeroDivisionError:
        return True
    return any(abs(total) <= TYPED * size for total, size in zip(totals, sizes, strict=True))


def coefficients_in(gains: Iterable[Gain]) -> tuple[Expr, ...]:
    """The coefficients of components that gains are made of, each once."""
    return tuple(dict.fromkeys(gain.of[0] for gain in _parts_first(tuple(gains)) if not gain.operation))


def exact_of(numbers: Iterable[Number]) -> list[Expr]:
    """The numbers as sympy expressions in the parameters of the network."""
    return [
        Integer(exact) if isinstance(exact, int) else exact for exact in fold(numbers, lambda coefficient: coefficient)
    ]


def simplified(numbers: Iterable[Number]) -> list[Expr]:
    """The numbers in their shortest rational form, for equations that people read; decimals are rounded only once.

    Those of long gear trains are made of each other: what they share is multiplied out once for all of them.
    """
    exact = fold(numbers, exactly)
    return [Integer(number) if isinstance(number, int) else in_decimals(_shortest(number)) for number in exact]


def _shortest(expression: Expr) -> Expr:
    """Without common factors above and below; a product of powers of symbols has none."""
    factors = (factor.as_base_exp() for factor in Mul.make_args(expression))
    if all(exponent.is_Integer and (base.is_Symbol or base.is_Rational) for base, exponent in factors):
        return expression
    return cancel(expression)


def exactly(expression: Expr) -> Expr:
    """The expression with the fraction that every decimal number is, so that algebra with it rounds nothing."""
    return expression.xreplace({number: Rational(number) for number in expression.atoms(Float)})


def in_decimals(expression: Expr) -> Expr:
    """The expression with decimal numbers for fractions that are too long to be read."""
    long = (number for number in expression.atoms(Rational) if number.q > LARGEST_DENOMINATOR)
    return expression.xreplace({number: Float(number) for number in long})
