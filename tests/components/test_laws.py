"""Tables, steps and ramps as laws: their values, slopes, breakpoints and pieces."""

from __future__ import annotations

import copy
import math
import pickle
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest
import sympy
from hypothesis import assume, given
from hypothesis import strategies as st

from shaftwork.components import laws
from shaftwork.components.branches import ACROSS, HISTORY, INTEGRAL, THROUGH
from shaftwork.components.discontinuities import breakpoints, pieces_degree
from shaftwork.components.laws import SYMBOLS, Ramp, Step, Table, as_expression, omega, phi, t
from shaftwork.core.errors import ParameterError

TABLE = Table([0, 1, 3], [0.0, 5.0, -1.0])
FLOATS = st.floats(-1e6, 1e6)


def test_a_table_is_linear_between_its_points_and_constant_beyond() -> None:
    value = sympy.lambdify(t, TABLE(t))
    times = [-1.0, 0.0, 0.5, 1.0, 2.0, 3.0, 9.0]
    expected = [0.0, 0.0, 2.5, 5.0, 2.0, -1.0, -1.0]
    assert [value(time) for time in times] == expected
    np.testing.assert_array_equal(value(np.array(times)), expected)
    assert math.isnan(value(math.nan))


@pytest.mark.slow
@given(st.lists(FLOATS, min_size=2, max_size=8, unique=True).map(sorted), st.data())
def test_one_number_and_an_array_give_the_same_value(x: list[float], data: st.DataObject) -> None:
    # numpy's compiled formula may fuse a multiplication and an addition: a few roundings of the largest value
    y = data.draw(st.lists(FLOATS, min_size=len(x), max_size=len(x)))
    assume(
        all(
            abs(high - low) < 1e300 * (right - left)
            for (left, right), (low, high) in zip(pairwise(x), pairwise(y), strict=True)
        )
    )
    value = sympy.lambdify(t, Table(x, y)(t))
    places = np.array([*x, *(0.5 * (a + b) for a, b in pairwise(x)), x[0] - 1, x[-1] + 1])
    np.testing.assert_allclose(value(places), [value(float(p)) for p in places], rtol=1e-12, atol=1e-9)


def test_the_derivative_of_a_table_is_the_slope_of_its_piece() -> None:
    slope = sympy.lambdify(t, TABLE(2 * t).diff(t))
    times = [-1.0, 0.0, 0.25, 0.5, 1.0, 1.5, 2.0]
    expected = [0.0, 10.0, 10.0, -6.0, -6.0, 0.0, 0.0]
    assert [slope(time) for time in times] == expected
    np.testing.assert_array_equal(slope(np.array(times)), expected)
    assert TABLE(t).diff(t, 2) == 0
    assert TABLE(t).diff(omega) == 0


def test_equal_tables_are_one_table() -> None:
    again = Table(np.array([0.0, 1.0, 3.0]), (0, 5, -1))
    assert again == TABLE
    assert hash(again) == hash(TABLE)
    assert TABLE(t) - again(t) == 0
    assert Table([0, 1], [-0.0, 1]) == Table([0, 1], [0.0, 1])
    assert str(Table([0, 1], [-0.0, 1])) == "Table([0.0, 1.0], [0.0, 1.0])"
    assert Table([0, 1, 3], [0, 5, -2]) != TABLE


def test_a_table_survives_copies_and_other_processes() -> None:
    law = 2 * TABLE(omega) + t
    assert pickle.loads(pickle.dumps(law)) == law  # noqa: S301  (our own bytes)
    assert copy.deepcopy(law) == law
    assert law.args[1].atoms(Table).pop().xs == (0.0, 1.0, 3.0)


@pytest.mark.slow
def test_a_table_prints_the_same_in_every_process() -> None:
    program = (
        "import sympy; from shaftwork.components.laws import *; law = Table([0, 1], [2, 3])(omega)*t + Table([0, 2],"
        " [1, 4])(t); print(law, sympy.latex(law), sympy.printing.numpy.NumPyPrinter({'fully_qualified_modules': False,"
        "'allow_unknown_functions': True}).doprint(law))"
    )
    prints = [
        subprocess.run(
            [sys.executable, "-c", program],
            env={"PYTHONHASHSEED": seed, "PYTHONPATH": ":".join(sys.path)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    ]
    assert prints[0] == prints[1]
    assert "Table([0.0, 1.0], [2.0, 3.0])(omega)" in prints[0]


def test_the_nodes_of_a_table_show_their_points() -> None:
    node = TABLE(omega)
    assert (node.xs, node.ys, node.argument) == ((0.0, 1.0, 3.0), (0.0, 5.0, -1.0), omega)
    assert node.is_real
    assert node.free_symbols == {omega}


def test_a_table_of_a_number_is_a_number() -> None:
    assert TABLE(sympy.Rational(1, 2)) == sympy.Float(2.5)
    assert TABLE(t).subs(t, 2.0) == sympy.Float(2.0)


def test_a_table_stays_where_numbers_are_multiplied_out() -> None:
    assert TABLE(sympy.pi * omega).evalf() == TABLE(sympy.pi.evalf() * omega)


def test_latex_shows_the_points_of_short_tables_and_the_ends_of_long_ones() -> None:
    assert sympy.latex(Table([0, 1], [2, 3])(omega)) == (
        r"\operatorname{table}\left(\omega;\, 0.0 \mapsto 2.0,\, 1.0 \mapsto 3.0\right)"
    )
    long = sympy.latex(Table(range(50), range(50))(t) ** 2)
    assert r"\operatorname{table}^{2}" in long
    assert long.count(r"\mapsto") == 3
    assert r"\ldots,\, 49.0 \mapsto 49.0" in long
    assert r"\operatorname{slope}" in sympy.latex(TABLE(t).diff(t))


@pytest.mark.parametrize(
    ("x", "y", "says"),
    [
        ([0, 1], [0], "x has 2 values and y has 1"),
        ([0], [0], "2 or more"),
        ([0, 0], [0, 1], r"x\[1\] = 0.0 follows x\[0\] = 0.0"),
        ([1, 0], [0, 1], "must increase strictly"),
        ([0, math.inf], [0, 1], r"x\[1\] = inf is not finite"),
        ([0, 1], [0, math.nan], r"y\[1\] = nan is not finite"),
        ([0, "a"], [0, 1], "must be a list of numbers"),
        (3, [0, 1], "must be a list of numbers"),
        ([0, 10**400], [0, 1], "must be a list of numbers"),
    ],
)
def test_a_wrong_table_is_refused_with_its_value(x: object, y: object, says: str) -> None:
    with pytest.raises(ParameterError, match=says):
        Table(x, y)  # type: ignore[arg-type]


def test_a_step_has_its_new_value_at_its_time() -> None:
    law = sympy.lambdify(t, Step(5, start=1.0, before=2))
    assert [float(law(time)) for time in (0.0, math.nextafter(1.0, 0), 1.0, 2.0)] == [2, 2, 7, 7]


def test_a_ramp_is_continuous() -> None:
    law = sympy.lambdify(t, Ramp(-6, 2.0, start=1.0, before=1))
    assert [float(law(time)) for time in (0.0, 1.0, 2.0, 3.0, 4.0)] == [1, 1, -2, -5, -5]


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Step(math.nan), "height = nan"),
        (lambda: Step(1, start=math.inf), "start = inf"),
        (lambda: Ramp(1, 0), "duration = 0 must be greater"),
        (lambda: Ramp(1, -1.0), "duration = -1.0"),
    ],
)
def test_a_wrong_step_or_ramp_is_refused(make: object, says: str) -> None:
    with pytest.raises(ParameterError, match=says):
        make()  # type: ignore[operator]


def test_a_law_may_be_a_number_a_table_or_an_expression() -> None:
    assert as_expression(TABLE) == TABLE(t)
    assert as_expression(2.5) == sympy.Float(2.5)
    assert as_expression(omega**2) == omega**2


@pytest.mark.parametrize("law", ["t", True, None, t > 1, [1, 2], sympy.true])
def test_anything_else_is_no_law(law: object) -> None:
    with pytest.raises(ParameterError, match=r"is no law.*t, omega, phi"):
        as_expression(law)


K = sympy.Symbol("k", real=True)


@pytest.mark.parametrize(
    ("law", "times"),
    [
        (Step(5, start=1.5), (1.5,)),
        (Ramp(1, 2.0, start=0.1), (0.1, 2.1)),
        (TABLE(t), (0.0, 1.0, 3.0)),
        (TABLE(1 - 2 * t), (-1.0, 0.0, 0.5)),
        (abs(K * t - 6), (2.0,)),
        (sympy.Heaviside(t - K) * omega, (3.0,)),
        (sympy.sign(4 - t), (4.0,)),
        (sympy.Max(t, 2, 4 - t), (2.0,)),
        (sympy.Min(t, 2 * t - 1), (1.0,)),
        (sympy.Piecewise((1, (t > 1) & (omega > 0)), (2, sympy.Or(t < -1, t >= 5)), (0, True)), (-1.0, 1.0, 5.0)),
        (TABLE(t).diff(t), (0.0, 1.0, 3.0)),
        (sympy.sin(t) + omega, ()),
        (TABLE(omega), ()),
        (sympy.Max(t, omega), ()),
        (sympy.Max(t**2, 4), ()),
        (Step(1, start=K) + Step(1, start=3), (3.0,)),
    ],
)
def test_breakpoints_are_the_times_of_switches_that_are_linear_in_time(
    law: sympy.Expr, times: tuple[float, ...]
) -> None:
    assert breakpoints(law, {K: 3.0}) == times


def test_a_switch_at_an_unknown_time_is_left_out() -> None:
    assert breakpoints(Step(1, start=K)) == ()


@pytest.mark.parametrize(
    ("law", "degree"),
    [
        (sympy.Integer(3), 0),
        (omega, 0),
        (Step(5), 0),
        (sympy.sign(t - 1), 0),
        (TABLE(t).diff(t), 0),
        (Step(5) * Step(2, start=1) ** 3, 0),
        (Ramp(1, 2.0), 1),
        (TABLE(3 * t), 1),
        (abs(t - 2) + K * t, 1),
        (sympy.Min(t, 3) * Step(1), 1),
        (TABLE(t) * t, None),
        (t**2, None),
        (1 / t, None),
        (sympy.sin(t), None),
        (TABLE(t**2), None),
        (abs(abs(t) - 1), None),
        (sympy.Piecewise((1, t**2 < 2), (0, True)), None),
        (sympy.Max(sympy.sin(t), 0), None),
    ],
)
def test_the_degree_between_breakpoints(law: sympy.Expr, degree: int | None) -> None:
    assert pieces_degree(law) == degree


@pytest.mark.parametrize("law", [Ramp(2, 1.5, start=0.5), TABLE(2 * t - 1), abs(t - 1) - sympy.Max(t, 2)])
def test_a_law_of_degree_one_is_a_line_on_each_piece(law: sympy.Expr) -> None:
    # second difference zero to rounding: 1e-12 of values of order 10
    value = sympy.lambdify(t, law)
    ends = (-3.0, *breakpoints(law), 9.0)
    for left, right in pairwise(ends):
        a, b, c = (float(value(left + share * (right - left))) for share in (0.25, 0.5, 0.75))
        assert a - 2 * b + c == pytest.approx(0, abs=1e-11)


def test_the_symbols_are_real_and_bear_their_names() -> None:
    assert [symbol.name for symbol in SYMBOLS] == ["t", "omega", "phi", "v", "s", "u", "psi", "i", "q"]
    assert all(symbol.is_real for symbol in SYMBOLS)
    assert phi == sympy.Symbol("phi", real=True)


@pytest.mark.parametrize("symbol", [*laws.SYMBOLS, ACROSS, INTEGRAL, THROUGH, HISTORY], ids=str)
def test_laws_are_written_over_the_real_numbers(symbol: sympy.Symbol) -> None:
    assert sympy.sqrt(symbol**2) == sympy.Abs(symbol)
    assert sympy.diff(sympy.Abs(symbol), symbol) == sympy.sign(symbol)
