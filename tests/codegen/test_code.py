"""Expressions as functions: what they compute, and that they compute it once."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy
from sympy import Heaviside, Max, Min, Piecewise, Symbol, sin, sqrt, tanh

from shaftwork.codegen.code import around, bindable, branchwise, scalar, vectorised, vectorised_list
from shaftwork.core.errors import CompileError

x, y, z, c = (Symbol(name, real=True) for name in ("x", "gap.phi", "z", "class"))  # names that are no names in Python
LAWS = [
    c * sin(x) ** 2 / (1 + sin(x) ** 2) - sympy.Float(0.1) ** 3,
    Max(-c, Min(c, x + y)) + abs(x - y) / sqrt(c),
    Piecewise((x, (x > 0) & (y > 0)), (y**3, sympy.ITE(x > y, x > -1, y > -1)), (-c, True)),
    sympy.sign(x) * tanh(y / c) + Heaviside(x - y, 0.5),
    sympy.Integer(3),
]


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS, ids=str)
def test_a_law_has_the_value_that_sympy_finds(law: sympy.Expr) -> None:
    points = np.random.default_rng(1).uniform(-2.0, 2.0, (40, 2))
    wanted = [float(law.subs({x: a, y: b, c: 1.5})) for a, b in points.tolist()]
    one = scalar({"t": x, "p": (y, c)}, [law])
    np.testing.assert_allclose([one(a, [b, 1.5])[0] for a, b in points.tolist()], wanted, rtol=1e-13, atol=1e-14)
    many = vectorised((x, y, c), law)
    np.testing.assert_allclose(np.broadcast_to(many(*points.T, 1.5), 40), wanted, rtol=1e-13, atol=1e-14)


def test_what_stands_twice_is_evaluated_once() -> None:
    function = scalar((x, y), [sin(x * y) + 1 / sin(x * y), sin(x * y) ** 2])
    assert str(function.__doc__).count("sin(") == 1
    assert function(0.5, 2.0) == [math.sin(1.0) + 1 / math.sin(1.0), math.sin(1.0) ** 2]


def test_two_lists_with_bound_parameters_are_those_of_one_function_and_the_second_asks_for_its_own_parts_only() -> None:
    first, second = [LAWS[0] / c, sqrt(x) * y], [LAWS[1], y**3 + sqrt(x)]
    whole = scalar({"t": x, "x": (y,), "p": (c,)}, [*first, *second])
    both, one, _ = bindable({"t": x, "x": (y,)}, {"p": (c,)}, first, second)([1.5])
    assert both(0.3, [-0.7]) == (whole(0.3, [-0.7], [1.5])[:2], one(0.3, [-0.7]))
    assert one(0.3, [-0.7]) == whole(0.3, [-0.7], [1.5])[2:]
    reads_none_of_it = bindable({"t": x, "x": (y,)}, {"p": (c,)}, [sqrt(x), sqrt(x) + y], [2 * y])([1.5])
    assert reads_none_of_it[1](-1.0, [2.0]) == [4.0]


@pytest.mark.parametrize("value", [-0.7, 0.0, 1.3])
def test_the_surroundings_of_an_instant_are_the_same_by_code_of_their_own_and_by_a_loop(value: float) -> None:
    """Where a value is none, and a law raises, too."""
    both, one, near = bindable({"t": x, "x": (y, z)}, {"p": (c,)}, [LAWS[1], sqrt(y)], [y**3, sqrt(y + z), x])([1.5])
    moves = [(1e-3, 1e-4, 1.0, 0.2), (-1e-3, -1e-4, -1.0, 0.1)]
    found = near(0.3, [value, 0.2], 1e-5, moves, 0.5)
    np.testing.assert_array_equal(found, around(both, one, 0.3, [value, 0.2], 1e-5, moves, 0.5))
    assert found[0] != found[1] != found[2]


def test_a_value_that_is_none_is_nan_beside_others_that_are_some() -> None:
    both, one, _ = bindable({"t": x, "x": (y,)}, {"p": (c,)}, [x], [y, sqrt(y), 1 / x])([1.5])
    np.testing.assert_array_equal(one(0.0, [-1.0]), [-1.0, np.nan, np.nan])
    np.testing.assert_array_equal(np.hstack(both(0.0, [-1.0])), [0.0, -1.0, np.nan, np.nan])
    assert both(0.5, [4.0]) == ([0.5], [4.0, 2.0, 2.0])


def test_what_stands_twice_in_a_branch_is_not_asked_for_where_the_branch_does_not_hold() -> None:
    law = Piecewise((sqrt(y) + sin(sqrt(y)), y > 0), (y, True))
    both, one, _ = bindable({"t": x, "x": (y,)}, {"p": (c,)}, [law], [law + c])([1.5])
    assert both(0.0, [-1.0]) == ([-1.0], [0.5])
    assert one(0.0, [-1.0]) == [0.5]
    assert branchwise({"y": y}, [law])(-1.0) == [-1.0]


def test_a_symbol_without_a_value_is_refused_by_name() -> None:
    with pytest.raises(CompileError, match=r"'gap\.phi' stands in a law and has no value"):
        vectorised_list((x,), [x, x * y])
