"""Limits that are put together without being compared: the same values, and nothing lost where numbers meet."""

from __future__ import annotations

import sympy
from hypothesis import given
from hypothesis import strategies as st
from sympy import Max, Min

from shaftwork.components.laws import larger, replaced, smaller

X, Y, Z = sympy.symbols("x y z", real=True)


@st.composite
def laws(draw: st.DrawFn, depth: int = 3) -> sympy.Expr:
    """Sums, products and limits of three quantities and numbers."""
    if depth == 0:
        return draw(st.sampled_from([X, Y, Z, sympy.Integer(1), sympy.Float(-0.5)]))
    made = draw(st.sampled_from([larger, smaller, sympy.Add, sympy.Mul]))
    return made(draw(laws(depth=depth - 1)), draw(laws(depth=depth - 1)))


NUMBERS = st.integers(-4, 4).map(lambda n: sympy.Rational(n, 2))


@given(laws(), st.tuples(NUMBERS, NUMBERS, NUMBERS))
def test_a_replacement_has_the_value_that_sympys_has(law: sympy.Expr, values: tuple[sympy.Expr, ...]) -> None:
    numbers = dict(zip((X, Y, Z), values, strict=True))
    found = replaced(replaced(law, {X: Y * Z - X}), numbers)
    assert found.is_number
    assert found == law.xreplace({X: Y * Z - X}).xreplace(numbers)


def test_limits_of_numbers_are_numbers_and_those_of_one_quantity_are_this_one() -> None:
    assert larger(0, smaller(1, sympy.Float(0.3))) == 0.3
    assert replaced(Max(X, Y), {Y: X}) == X
    assert replaced(sympy.sin(X), {X: 0}) == 0


def test_long_limits_keep_their_arguments() -> None:
    kept = larger(0, smaller(X, X + 1))
    assert kept.atoms(Max, Min) == {kept, smaller(X, X + 1)}  # sympy would have seen that X is the smaller one
