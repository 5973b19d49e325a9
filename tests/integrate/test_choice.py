"""`engine="auto"` takes the engine that suits the problem and says why."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from shaftwork.integrate import choice
from shaftwork.integrate.engines import ENGINE_NAMES, ENGINES, GENERAL, available
from shaftwork.integrate.stiffness import norm


def test_a_linear_problem_is_solved_exactly(oscillator):
    trajectory, engine, why = choice.solve(oscillator.problem)
    assert engine == "exact"
    assert "linear" in why
    assert np.allclose(trajectory.x, oscillator.solution(trajectory.t), rtol=0, atol=1e-10)


@pytest.mark.heyoka
def test_a_compiled_problem_that_is_not_stiff_goes_to_heyoka(oscillator):
    engine, why = choice.choose(replace(oscillator.problem, linear=None))
    assert engine == "heyoka"
    assert "not stiff" in why


def test_without_a_program_a_problem_that_is_not_stiff_goes_to_scipy(oscillator):
    engine, why = choice.choose(replace(oscillator.problem, linear=None, symbolic=None))
    assert engine == "scipy"
    assert ("heyoka cannot compile" if available("heyoka") else "heyoka is not installed") in why


@pytest.mark.parametrize("installed", [True, False])
def test_a_stiff_problem_goes_to_an_implicit_engine(oscillator, monkeypatch, installed):
    if not installed:
        monkeypatch.setattr("importlib.util.find_spec", lambda _name: None)
    matrix = sparse.csc_array(np.array([[-1e8, 1.0], [0.0, -1.0]]))
    stiff = replace(oscillator.problem, linear=None, rhs=lambda _t, x: matrix @ x, jacobian=lambda _t, _x: matrix)
    engine, why = choice.choose(stiff)
    assert engine == ("sundials" if installed else "scipy-radau")
    assert "fastest decay (1e+08 1/s)" in why


def test_a_fast_oscillation_is_not_taken_for_stiffness(oscillator):
    matrix = sparse.csc_array(np.array([[0.0, 1e5], [-1e5, -1.0]]))
    fast = replace(
        oscillator.problem, linear=None, symbolic=None, rhs=lambda _t, x: matrix @ x, jacobian=lambda _t, _x: matrix
    )
    assert choice.choose(fast)[0] == "scipy"


def test_stiffness_that_shows_only_where_the_motion_goes_is_seen(oscillator):
    # At rest nothing decays fast; at the speed that a large torque leads to, something does.
    problem = replace(
        oscillator.problem,
        linear=None,
        symbolic=None,
        rhs=lambda _t, x: np.array([100.0 - x[0] ** 9, -x[1]]),
        jacobian=lambda _t, x: sparse.csc_array(np.array([[-9 * x[0] ** 8, 0.0], [0.0, -1.0]])),
        x0=np.zeros(2),
    )
    assert choice.choose(problem)[0] == "sundials"


def test_a_large_stiff_system_is_recognised_by_its_norms(oscillator):
    n = 300
    # A chain of heavy dampers: its symmetric part is its whole Jacobian.
    matrix = -1e7 * sparse.diags_array([-np.ones(n - 1), 2 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1]).tocsc()
    large = replace(
        oscillator.problem,
        linear=None,
        symbolic=None,
        rhs=lambda _t, x: matrix @ x,
        jacobian=lambda _t, _x: matrix,
        x0=np.ones(n),
    )
    assert choice.choose(large)[0] == "sundials"


def test_a_remembered_reason_is_passed_on(oscillator):
    assert choice.solve(oscillator.problem, "exact", why="as before")[1:] == ("exact", "as before")


def test_the_protocol_loads_no_numerical_library():
    code = (
        "import shaftwork.integrate.problem, sys; print([m for m in ('scipy', 'heyoka', 'sympy') if m in sys.modules])"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_every_engine_of_the_table_whose_library_is_there_can_be_loaded():
    for name in (name for name, entry in ENGINES.items() if entry.module and entry.installed):
        assert callable(choice.load(name))


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["auto", "exact", "scipy"])
def test_a_run_that_another_engine_makes_does_not_load_heyoka(engine: str) -> None:
    code = (
        "import sys, shaftwork as sw; net = sw.Network('drive'); net.add(sw.TorqueSource('m', tau=1.0), 'a'); "
        f"net.add(sw.Inertia('J', J=1.0), 'a'); net.simulate(1.0, engine={engine!r}); print('heyoka' in sys.modules)"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "False"


def test_what_is_stiff_is_told_by_the_time_that_passes_not_by_the_clock(oscillator):
    matrix = sparse.csc_array(np.diag([-100.0, -1.0]))
    slow = replace(
        oscillator.problem, linear=None, symbolic=None, rhs=lambda _t, x: matrix @ x, jacobian=lambda _t, _x: matrix,
        breakpoints=(), jump=None,
    )  # fmt: skip
    late = replace(slow, t0=1e6, t_end=1e6 + slow.t_end, t_eval=None)
    assert choice.choose(late)[0] == choice.choose(slow)[0] == "scipy"


def test_the_bound_of_the_eigenvalues_of_a_slow_system_is_as_slow() -> None:
    matrix = sparse.csc_array(np.array([[0.0, 2e-6], [-1e-6, 3e-6]]))
    assert norm(matrix) == pytest.approx(5e-6, rel=1e-12)
    assert norm(sparse.csc_array((3, 3))) == 0.0


def test_every_engine_can_be_asked_for() -> None:
    assert ("auto", *(name for name, entry in ENGINES.items() if not entry.part_of)) == ENGINE_NAMES
    assert set(GENERAL) == {*ENGINE_NAMES} - {"auto", "wave"}


def test_every_engine_that_names_another_one_names_one_of_the_table() -> None:
    assert {entry.unless_stiff for entry in ENGINES.values()} - {""} <= ENGINES.keys()
    assert {entry.part_of for entry in ENGINES.values()} - {""} <= set(GENERAL)
