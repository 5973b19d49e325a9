"""A run that fails says when, in which state and why."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import sympy
from scipy import sparse

from shaftwork.codegen.taylor.heyoka import build
from shaftwork.core.errors import MissingExtraError, ParameterError, SimulationError
from shaftwork.integrate import choice
from shaftwork.integrate.engines import available
from shaftwork.integrate.problem import Problem

NUMERIC = ["scipy", "scipy-radau", "sundials"]


def problem(rhs, x0=0.0, **options) -> Problem:
    names, span = ("motor.omega",), {"t0": 0.0, "t_end": 3.0}
    return Problem(rhs=rhs, jacobian=None, x0=np.array([x0]), names=names, atol=np.array([1e-9]), **span, **options)


def symbolic(row, start):
    x, t = sympy.symbols("x t")
    program = build((x,), t, (), (sympy.sympify(row, {"x": x, "t": t}),)).bind(np.array([]))
    return problem(sympy.lambdify((t, (x,)), [row]), start, symbolic=program, t_eval=np.linspace(0, 3, 7))


@pytest.mark.slow
@pytest.mark.parametrize("engine", NUMERIC)
def test_a_motion_that_runs_away_is_named_with_its_time_and_state(engine):
    with pytest.raises(SimulationError, match=r"failed at t = 1\.5707.* s.*step.*'motor.omega' = "):
        choice.solve(problem(lambda _t, x: x**2 + 1.0), engine)


@pytest.mark.parametrize("engine", NUMERIC)
def test_a_derivative_that_is_not_a_number_is_named(engine):
    with pytest.raises(SimulationError, match=r"derivative of 'motor.omega' was nan at t = 0.61"):
        choice.solve(problem(lambda _t, x: np.sqrt(1.0 - x) + 1.0), engine)


@pytest.mark.heyoka
def test_heyoka_names_time_and_state_of_a_motion_that_runs_away():
    x = sympy.Symbol("x")
    with pytest.raises(SimulationError, match=r"heyoka engine failed at t = 1\.5707.*not finite.*'motor.omega'"):
        choice.solve(symbolic(x**2 + 1, 0.0), "heyoka")


@pytest.mark.heyoka
def test_heyoka_says_that_a_motion_sticks_instead_of_going_on_wrongly():
    x = sympy.Symbol("x")
    with pytest.raises(SimulationError, match=r"from t = 0\.66666.*sticks where the condition x > 0 changes"):
        choice.solve(symbolic(-sympy.sign(x) - sympy.Rational(1, 2), 1.0), "heyoka")


@pytest.mark.parametrize("engine", ["scipy", "sundials", "heyoka"])
def test_a_run_ends_when_its_steps_are_used_up(oscillator, engine):
    with pytest.raises(SimulationError, match="3 steps were not enough"):
        choice.solve(replace(oscillator.problem, max_steps=3, rtol=1e-10), engine)


@pytest.mark.parametrize("engine", ["scipy", "sundials", "heyoka"])
def test_the_limit_of_steps_is_that_of_the_whole_run_not_of_each_piece(oscillator, engine):
    steps = choice.solve(oscillator.problem, engine)[0].statistics["steps"]
    choice.solve(replace(oscillator.problem, max_steps=steps), engine)
    with pytest.raises(SimulationError, match=f"{steps - 1} steps were not enough"):
        choice.solve(replace(oscillator.problem, max_steps=steps - 1), engine)


def test_what_explains_a_failure_is_asked_at_finite_states_alone():
    """The stages after one without a value have none either: what they say of a law would be made up."""
    asked = []
    failing = problem(lambda _t, x: np.sqrt(1.0 - x) + 1.0, explain=lambda _t, x: asked.append(x))
    with pytest.raises(SimulationError, match="failed"):
        choice.solve(failing, "scipy")
    assert asked
    assert np.isfinite(np.concatenate(asked)).all()


def test_an_unbounded_linear_motion_is_named():
    growing = replace(
        problem(lambda _t, x: 1e4 * x, 1.0),
        linear=choice_linear(np.array([[1e4]])),
    )
    with pytest.raises(SimulationError, match=r"exact engine failed at t = 3 s.*unbounded"):
        choice.solve(growing, "exact")


def choice_linear(matrix):
    from shaftwork.integrate.problem import LinearInputs

    return LinearInputs(sparse.csr_array(matrix), lambda _t: np.zeros(matrix.shape[0]))


def test_the_exact_engine_refuses_what_is_not_linear_or_not_straight(oscillator):
    with pytest.raises(ParameterError, match="needs a linear system"):
        choice.solve(replace(oscillator.problem, linear=None), "exact")
    bent = replace(oscillator.problem.linear, forcing=lambda t: np.array([0.0, np.sin(t)]))
    with pytest.raises(ParameterError, match=r"'J1.omega' bends between t = 0 s and 1 s"):
        choice.solve(replace(oscillator.problem, linear=bent), "exact")


@pytest.mark.heyoka
def test_heyoka_asks_for_a_program(oscillator):
    with pytest.raises(SimulationError, match="heyoka compiles small networks"):
        choice.solve(replace(oscillator.problem, symbolic=None), "heyoka")


def test_an_unknown_engine_is_answered_with_the_list(oscillator):
    with pytest.raises(ParameterError, match=r"no engine 'matlab'.*auto, exact, heyoka, numba, sundials, .*scipy"):
        choice.solve(oscillator.problem, "matlab")


@pytest.mark.parametrize(("engine", "extra"), [("heyoka", "fast"), ("sundials", "stiff")])
def test_a_missing_library_is_answered_with_its_extra(oscillator, monkeypatch, engine, extra):
    monkeypatch.setattr("importlib.util.find_spec", lambda _name: None)
    assert not available(engine)
    with pytest.raises(MissingExtraError, match=rf"shaftwork\[{extra}\]"):
        choice.solve(oscillator.problem, engine)
