"""What goes through formulas looks at each part once, and leaves as it is what need not be expanded."""

from __future__ import annotations

import pytest
import sympy

from shaftwork.components.discontinuities import line, parts, pieces_degree
from shaftwork.components.laws import t

K, L = sympy.symbols("K L", real=True)


def nested(inner: sympy.Expr, depth: int) -> sympy.Expr:
    """f(f(x, x), f(x, x)) and so on: as many different parts as its depth, written out two to that power."""
    function = sympy.Function("f")
    for _ in range(depth):
        inner = function(inner, inner)
    return inner


def test_a_part_that_stands_in_many_places_is_met_once() -> None:
    assert len(list(parts((nested(K, 60), K)))) == 61


def test_the_degree_of_a_formula_does_not_depend_on_how_often_its_parts_stand_in_it() -> None:
    assert pieces_degree(t * nested(K, 60)) == 1
    assert pieces_degree(t + nested(t, 60)) is None


@pytest.mark.parametrize("law", [t**2, t * (t + K), t * sympy.Max(0, t - 1)], ids=str)
def test_what_bends_has_no_degree(law: sympy.Expr) -> None:
    """The engine for straight inputs would take it for a straight line."""
    assert pieces_degree(law) is None


def test_what_does_not_move_is_not_expanded_to_find_a_line_in_time() -> None:
    product = (K + L) ** 40
    assert line(2 * t + product) == (2, product)
    assert line((t + 1) ** 2 - t**2 + product) == (2, product + 1)
