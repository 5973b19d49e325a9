"""Every engine gives the closed solution, through steps of the input and jumps of the state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from shaftwork.integrate import scipy_ivp, sundials
from shaftwork.integrate.linear import propagation
from shaftwork.integrate.problem import Problem, Trajectory
from shaftwork.integrate.taylor import heyoka_taylor

Solve = Callable[[Problem], Trajectory]
ENGINES: dict[str, Solve] = {
    "exact": propagation.solve,
    "heyoka": heyoka_taylor.solve,
    "DOP853": partial(scipy_ivp.solve, method="DOP853"),
    "Radau": partial(scipy_ivp.solve, method="Radau"),
    "CVODE-BDF": partial(sundials.solve, method="BDF"),
    "CVODE-Adams": partial(sundials.solve, method="Adams"),
}
# rtol bounds the error of one step. Multistep methods take thousands of steps over these problems and their errors
# add up; the others stay near rtol. Without a step error there are only rounding errors.
GROWTH = {"CVODE-BDF": 1000.0, "CVODE-Adams": 1000.0, "DOP853": 30.0, "Radau": 30.0}


def bound(engine: str, rtol: float) -> float:
    return rtol * GROWTH[engine] if engine in GROWTH else 1e-10


def relative_error(found: np.ndarray, expected: np.ndarray) -> float:
    return float((np.abs(found - expected).max(axis=0) / np.abs(expected).max(axis=0)).max())


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("rtol", [1e-6, 1e-9])
@pytest.mark.parametrize("name", ["oscillator", "relaxation"])
def test_every_engine_meets_the_closed_solution(request, name, engine, rtol):
    case = request.getfixturevalue(name)
    trajectory = ENGINES[engine](replace(case.problem, rtol=rtol))
    assert np.array_equal(trajectory.t, case.problem.t_eval)
    assert relative_error(trajectory.x, case.solution(trajectory.t)) < bound(engine, rtol)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_dense_output_is_as_good_as_the_steps(oscillator, engine):
    trajectory = ENGINES[engine](replace(oscillator.problem, rtol=1e-8))
    times = np.random.default_rng(1).uniform(0.0, 3.0, 200)
    # An interpolant is of lower order than its method: a factor 10 on the bound of the steps.
    assert relative_error(trajectory.dense(times), oscillator.solution(times)) < 10 * bound(engine, 1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_an_output_at_a_breakpoint_is_the_state_after_the_jump(oscillator, engine):
    trajectory = ENGINES[engine](replace(oscillator.problem, t_eval=np.array([0.5, 1.0, 2.0]), rtol=1e-8))
    expected = oscillator.solution(np.array([1.0]))[0]
    assert np.abs(trajectory.x[1] - expected).max() < 1e-3  # the jump is 1.5
    assert np.abs(trajectory.dense(np.array([1.0]))[0] - expected).max() < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_without_output_times_both_sides_of_a_jump_are_listed(oscillator, engine):
    trajectory = ENGINES[engine](replace(oscillator.problem, t_eval=None, rtol=1e-8))
    before, after = np.flatnonzero(trajectory.t == 1.0)
    assert np.allclose(trajectory.x[after] - trajectory.x[before], [0.0, 1.5], rtol=0, atol=1e-12)
    assert trajectory.t[0] == 0.0
    assert trajectory.t[-1] == 3.0
    assert (np.diff(trajectory.steps) > 0).all()
    assert 1.0 in trajectory.steps
    assert trajectory.statistics["steps"] == trajectory.steps.size - 1


@pytest.mark.slow
@pytest.mark.parametrize("engine", [name for name in ENGINES if name != "heyoka"])
def test_the_right_hand_side_is_never_evaluated_at_or_past_the_end_of_a_piece(oscillator, engine):
    # The right-hand side does not know the piece, so the switching time itself must never be asked for, and times
    # must not go back behind it once it is passed.
    oscillator.asked.clear()
    ENGINES[engine](oscillator.problem)
    asked = np.array(oscillator.asked)
    assert asked.size > 0
    assert 1.0 not in asked
    assert asked.max() < 3.0
    assert asked.min() > 0.0
    # At the very starts of the pieces an explicit engine looks, after its run, for how fast they decay.
    in_order = asked[(asked > 1e-12) & (np.abs(asked - 1.0) > 1e-12)]
    first_late = int(np.argmax(in_order > 1.0))
    assert (in_order[:first_late] < 1.0).all()
    assert (in_order[first_late:] > 1.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["heyoka", "DOP853", "CVODE-BDF"])
def test_a_run_can_be_repeated_to_the_last_bit(oscillator, engine):
    first, second = (ENGINES[engine](oscillator.problem) for _ in range(2))
    assert np.array_equal(first.x, second.x)
    assert np.array_equal(first.dense(first.t), second.dense(second.t))


@pytest.mark.slow
def test_a_lazy_dense_output_repeats_the_run_that_filled_the_grid(oscillator):
    for engine in ("heyoka", "CVODE-BDF"):
        trajectory = ENGINES[engine](oscillator.problem)
        # The same polynomials, evaluated by another formula: rounding only (states are up to about 10).
        assert np.abs(trajectory.dense(trajectory.t) - trajectory.x).max() < 1e-11
