"""The heyoka program computes what the sympy expressions say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import sympy
from sympy import Abs, Eq, Heaviside, Max, Min, Ne, Piecewise, Rational, sign

from shaftwork.codegen.taylor.heyoka import build
from shaftwork.components.tables import Table
from shaftwork.core.errors import CompileError, MissingExtraError
from shaftwork.integrate import scipy_ivp
from shaftwork.integrate.problem import Problem
from shaftwork.integrate.taylor import heyoka_taylor

heyoka = pytest.importorskip("heyoka")

x, v, t, a, b = sympy.symbols("x v t a b", real=True)


XS, YS = (-1.5, -0.5, 0.25, 1.0, 1.25), (2.0, -1.0, 0.5, 0.75, -3.0)
CURVE = Table(XS, YS)


def evaluate(expression, state, time, parameters):
    """The translated expression at one point, its switches set as an engine sets them."""
    program = build((x, v), t, (a, b), (sympy.sympify(expression), sympy.Integer(0)))
    bound = program.bind(np.array(parameters)).parameters
    values = np.concatenate([bound, program.switch_signs(time, np.array(state), bound)])
    compiled = heyoka.cfunc(list(program.rows), vars=list(program.variables))
    return float(compiled(np.array(state), pars=values[: compiled.nparams], time=time)[0])


u = sympy.Rational(1, 3) + x**2  # positive, for logarithms and powers
SMOOTH = [
    x + 2 * v - 3, x * v / (a * b), x**3, u**-2, u**Rational(3, 2), u**Rational(-1, 2), sympy.sqrt(u), u**a, 2**x,
    sympy.pi * x, sympy.E * v, sympy.exp(x), sympy.log(u), sympy.tanh(x / a), sympy.sinh(x), sympy.cosh(v),
    sympy.asinh(x), sympy.acosh(1 + u), sympy.atanh(x / 10), sympy.sin(a * t), sympy.cos(x), sympy.tan(x / 3),
    sympy.asin(x / 10), sympy.acos(v / 10), sympy.atan(x), sympy.erf(x), sympy.erfc(x),
    sympy.sec(x / 3), sympy.csc(u), sympy.cot(u), sympy.sech(x), sympy.csch(u), sympy.coth(u), 1 / (u * (1 + v**2)),
    1 / a, Rational(7, 3) * b, sympy.Float("0.1") * x,
]  # fmt: skip
PIECEWISE = [
    sign(x), sign(-x) + sign(x), Abs(x - v), Abs(a - 1) * x, Max(x, v), Min(x, v, 0), Max(x, v, t - 1, a), Min(x**2, 1),
    Heaviside(x), Heaviside(v, 0), Heaviside(t - 1) * x,
    Piecewise((x, x < 0), (v, x < Rational(1, 2)), (t, True)),
    Piecewise((1, x <= v), (2, x > a), (3, True)),
    Piecewise((1, (x > 0) & (v > 0)), (2, (x > 0) | (t >= 1)), (3, True)),
    Piecewise((1, sympy.Not(sympy.And(x > 0, v >= 0))), (2, True)),
    Piecewise((1, sympy.Xor(x > 0, v > 0)), (2, True)),
    Piecewise((1, sympy.ITE(x > 0, v > 0, v < -1)), (2, True)),
    Piecewise((1, Ne(x, 0)), (2, True)), Piecewise((1, Eq(x, v)), (x, True)), Piecewise((1, a > b), (2, True)),
    Max(0, x - a) * 3 - Min(0, x + a), sympy.exp(-Abs(x)) * sympy.tanh(Max(v, 0)),
]  # fmt: skip


def points(count=12):
    generator = np.random.default_rng(7)
    for _ in range(count):
        yield generator.uniform(-2, 2, 2), generator.uniform(0, 2), generator.uniform(0.5, 2, 2)


@pytest.mark.slow
@pytest.mark.parametrize("expression", SMOOTH + PIECEWISE, ids=str)
def test_a_translated_expression_has_sympys_value(expression):
    for state, time, parameters in points(4):
        numbers = dict(zip((x, v, t, a, b), (*state, time, *parameters), strict=True))
        expected = float(sympy.sympify(expression).subs(numbers).evalf(20))
        assert evaluate(expression, state, time, parameters) == pytest.approx(expected, rel=1e-13, abs=1e-14)


@pytest.mark.slow
def test_a_table_is_interpolated_and_constant_beyond_its_ends():
    for state, time, parameters in points():
        found = evaluate(CURVE(x + v) * 2, state, time, parameters)
        assert found == pytest.approx(2 * np.interp(state.sum(), XS, YS), rel=1e-13)
    for knot, value in zip(XS, YS, strict=True):
        assert evaluate(CURVE(x), [knot, 0.0], 0.0, [1.0, 1.0]) == pytest.approx(value, rel=1e-13)


def test_the_slope_of_a_table_is_that_of_its_segment():
    slope = CURVE(x).diff(x)
    for position, expected in ((-2.0, 0.0), (-1.0, -3.0), (0.0, 2.0), (1.1, -15.0), (2.0, 0.0)):
        assert evaluate(slope, [position, 0.0], 0.0, [1.0, 1.0]) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize(
    "row", [Abs(x), Heaviside(x, 2), Heaviside(x), sign(x), Max(x, 0), Piecewise((1, x <= 0), (2, True))]
)
def test_a_switch_at_exactly_zero_has_sympys_value_there(row):
    assert evaluate(row, [0.0, 1.0], 0.0, [1.0, 1.0]) == float(row.subs(x, 0))


def test_equal_conditions_share_one_switch():
    program = build((x, v), t, (), (Abs(v) * x + sign(v), Max(v, 0) + Piecewise((1, v < 0), (2, True)) + sign(-v)))
    assert len(program.switches) == 1
    assert program.conditions == ("v > 0",)


def test_a_condition_on_parameters_alone_needs_no_switch():
    assert build((x, v), t, (a, b), (Max(a, b) * x, v)).switches == ()


@pytest.mark.parametrize("expression", [sympy.ceiling(x), sympy.Mod(x, 2), sympy.gamma(u), sympy.Function("f")(x)])
def test_what_cannot_be_translated_is_named_with_another_engine(expression):
    with pytest.raises(CompileError, match=rf"no counterpart of {expression.func.__name__}.*engine='scipy'"):
        build((x,), t, (), (expression,))


def test_an_unknown_symbol_and_an_infinite_number_are_refused():
    with pytest.raises(CompileError, match="symbol a is neither a state nor a parameter"):
        build((x,), t, (), (a * x,))
    with pytest.raises(CompileError, match="Infinity"):
        build((x,), t, (), (sympy.oo,))


def test_without_heyoka_the_extra_is_named(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda _name: None)
    with pytest.raises(MissingExtraError, match=r"shaftwork\[fast\]"):
        build((x,), t, (), (x,))


def problem(rows, start, end, parameters=(), values=(), **options) -> Problem:
    states = (x, v)[: len(rows)]
    rows = tuple(map(sympy.sympify, rows))
    function = sympy.lambdify((t, states, parameters), list(rows))
    return Problem(
        rhs=lambda time, state: np.array(function(time, state, values), dtype=float),
        jacobian=None,
        x0=np.array(start, dtype=float),
        t0=0.0,
        t_end=end,
        names=tuple(map(str, states)),
        atol=np.full(len(rows), 1e-14),
        rtol=1e-12,
        t_eval=np.linspace(0.0, end, 101),
        symbolic=build(states, t, parameters, rows).bind(np.array(values)),
        **options,
    )


KINKED = {
    "a stop and a friction that is square": ((v, -100 * Max(x - 0.1, 0) - v * Abs(v) + 1 - x), (0.0, 0.0), ()),
    "a twist that leaves zero slowly": ((v, -x * Abs(x) - Max(x - 0.01, 0) + t**2), (0.0, 0.0), ()),
    "an input in pieces": (
        (v, -x + Piecewise((1, t <= 1), (sympy.cos(3 * t), t < 2), (-0.5, True))),
        (0, 0),
        (1.0, 2.0),
    ),
    "a table of the state": ((v, CURVE(x) - x), (-2.0, 1.0), ()),
    "a nested maximum": ((v, Max(0.05 - v, -0.2, x) - 2 * x), (0.3, 0.0), ()),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", KINKED)
def test_a_step_never_crosses_a_kink(name):
    # A Taylor step across a kink would be wrong by about 1e-3; ended there, only DOP853's own error at the kinks
    # (its step control finds them to about its tolerance) remains.
    rows, start, breakpoints = KINKED[name]
    asked = problem(rows, start, 5.0, breakpoints=breakpoints)
    fast, slow = heyoka_taylor.solve(asked), scipy_ivp.solve(asked)
    assert np.abs(fast.x - slow.x).max() < 1e-9 * np.abs(slow.x).max()
    assert np.abs(fast.dense(fast.t) - fast.x).max() < 1e-12 * np.abs(slow.x).max()


def test_a_body_that_slides_to_and_fro_changes_its_friction_at_every_turn():
    # x'' = -x - 0.1 sign(x'): half cycles about -0.1 and 0.1, each amplitude 0.2 less than the one before.
    run = heyoka_taylor.solve(
        replace(problem((v, -x - sign(v) / 10), (1.05, 0.0), 4 * np.pi), t_eval=np.arange(5) * np.pi)
    )
    assert np.allclose(run.x[:, 0], [1.05, -0.85, 0.65, -0.45, 0.25], rtol=0, atol=1e-12)


def test_a_body_at_rest_under_dry_friction_stays_at_rest():
    run = heyoka_taylor.solve(problem((v, -x - sign(v)), (0.0, 0.0), 2.0))
    assert (run.x == 0.0).all()


def test_the_sign_of_steps_of_time_is_one_in_size():
    """It is no switch of the motion: between the steps it stands."""
    law = 5 * sign(Rational(3, 2) - sympy.floor(4 * t))  # 5 until 0.5, then -5
    run = heyoka_taylor.solve(replace(problem((law,), (0.0,), 0.8), breakpoints=(0.25, 0.5, 0.75)))
    assert run.x[-1, 0] == pytest.approx(5 * 0.5 - 5 * 0.3, rel=1e-12)


def test_new_parameters_and_start_states_compile_nothing(monkeypatch):
    program = build((x, v), t, (a, b), (v, -a * x - b * Abs(v) * v))
    made = []
    original = heyoka.taylor_adaptive
    monkeypatch.setattr(
        heyoka, "taylor_adaptive", lambda *args, **options: made.append(1) or original(*args, **options)
    )
    ends = []
    for stiffness in (1.0, 4.0, 1.0):
        values = np.array([stiffness, 0.3])
        asked = problem((v, -a * x - b * Abs(v) * v), (1.0, 0.0), 2.0, (a, b), values)
        ends.append(heyoka_taylor.solve(replace(asked, symbolic=program.bind(values))).x[-1])
        assert np.abs(ends[-1] - scipy_ivp.solve(asked).x[-1]).max() < 1e-9
    assert len(made) == 1
    assert np.array_equal(ends[0], ends[2])


@pytest.mark.slow
def test_a_large_system_is_compiled_compactly():
    states = sympy.symbols("y:102")
    rows = tuple(states[i - 1] - 2 * states[i] for i in range(len(states)))
    for program, compact in (
        (build(states, t, (), rows), True),
        (build(states[:2], t, (), (states[1], -states[0])), False),
    ):
        with program.lent(1e-10) as lent:
            assert lent.integrator.compact_mode == compact
