"""The entries of loop and node equations: whole numbers, or gear ratios known both as a value and as an expression."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sympy import Expr, Integer, cancel

CANCELLATION = 1e-10
"""A difference below this fraction of its terms is zero: ratios are typed to some ten digits (1.2 * 1.5 is 1.8)."""


@dataclass(frozen=True, slots=True, eq=False)
class Gain:
    """A product or sum of gear ratios: its value decides whether it is zero, its expression goes into the equations."""

    value: float
    exact: Expr

    def __mul__(self, other: Number) -> Gain:
        if isinstance(other, Gain):
            return Gain(self.value * other.value, self.exact * other.exact)
        return Gain(self.value * other, self.exact * other)

    __rmul__ = __mul__

    def __neg__(self) -> Gain:
        return Gain(-self.value, -self.exact)


Number = int | Gain


def value_of(number: Number) -> float:
    """The number as a float."""
    return number.value if isinstance(number, Gain) else float(number)


def exact_of(number: Number) -> Expr:
    """The number as a sympy expression in the parameters of the network."""
    return number.exact if isinstance(number, Gain) else Integer(number)


def add(first: Number, second: Number, frozen: list[Expr]) -> Number:
    """The sum; where it vanishes for these ratios but not for all, the expression is put down in `frozen`."""
    if isinstance(first, int) and isinstance(second, int):
        return first + second
    value = value_of(first) + value_of(second)
    if abs(value) > CANCELLATION * max(abs(value_of(first)), abs(value_of(second))):
        return Gain(value, exact_of(first) + exact_of(second))
    if (rest := cancel(exact_of(first) + exact_of(second))) != 0:
        frozen.append(rest)
    return 0


def divide(first: Number, second: Number) -> Number:
    """The quotient; whole numbers stay whole where the divisor is 1 or -1."""
    if isinstance(second, int) and abs(second) == 1:
        return first * second
    return Gain(value_of(first) / value_of(second), exact_of(first) / exact_of(second))


def simplified(number: Number) -> Any:
    """The expression in its shortest rational form, for equations that people read."""
    return cancel(exact_of(number)) if isinstance(number, Gain) else Integer(number)
