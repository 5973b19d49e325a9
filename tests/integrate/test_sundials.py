"""What only SUNDIALS does: implicit equations and sparse factorisations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from shaftwork.core.errors import SimulationError
from shaftwork.integrate import sundials
from shaftwork.integrate.linear import propagation
from shaftwork.integrate.problem import DaeProblem, LinearInputs, Problem


def loop(**options) -> DaeProblem:
    """X' = -y with the nonlinear loop y + y^3 = x, which a step of 0.5 joins at 1 s."""

    def residual(t, x, derivative):
        return np.array([derivative[0] + x[1], x[1] + x[1] ** 3 - x[0] - (0.0 if t < 1.0 else 0.5)])

    settings = {"breakpoints": (1.0,), "t_eval": np.linspace(0.0, 3.0, 13), "rtol": 1e-9} | options
    return DaeProblem(
        residual=residual,
        x0=np.array([2.0, 0.5]),
        derivative0=np.zeros(2),
        algebraic=(1,),
        t0=0.0,
        t_end=3.0,
        names=("J1.omega", "clutch.tau"),
        atol=np.full(2, 1e-11),
        **settings,
    )


def elapsed(y):
    """Dt = -(1 + 3 y^2) dy / y: the time up to a value y, but for a constant, where the loop's input is constant."""
    return -(np.log(y) + 1.5 * y**2)


def test_a_nonlinear_loop_is_solved_from_a_rough_guess_and_through_a_step():
    run = sundials.solve_dae(loop())
    x, y = run.x.T
    # The loop holds at every output to the tolerance of the run, a thousand steps and a slope of 4 allowed for.
    assert np.abs(y + y**3 - x - np.where(run.t < 1.0, 0.0, 0.5)).max() < 1e-7
    assert y[0] == pytest.approx(1.0, abs=1e-9)
    assert np.allclose(elapsed(y[:4]) - elapsed(y[0]), run.t[:4], rtol=0, atol=1e-6)
    after = run.t >= 1.0
    assert np.allclose(elapsed(y[after]) - elapsed(y[4]), run.t[after] - 1.0, rtol=0, atol=1e-6)
    assert np.abs(run.dense(run.t) - run.x).max() < 1e-9


def test_a_loop_without_a_solution_is_named():
    def impossible(_t, x, derivative):
        return np.array([derivative[0] + x[0], x[1] ** 2 + 1.0 + x[0] ** 2])

    with pytest.raises(SimulationError, match="no consistent initial values"):
        sundials.solve_dae(replace(loop(), residual=impossible))


def test_a_large_stiff_chain_uses_the_sparse_jacobian():
    n = 150
    matrix = 1e4 * sparse.diags_array([np.ones(n - 1), -2 * np.ones(n), np.ones(n - 1)], offsets=[-1, 0, 1]).tocsc()
    force = np.eye(1, n)[0]
    asked = []

    def jacobian(t, _x):
        asked.append(t)
        return matrix

    problem = Problem(
        rhs=lambda _t, x: matrix @ x + force,
        jacobian=jacobian,
        x0=np.zeros(n),
        t0=0.0,
        t_end=0.05,
        names=tuple(f"x{i}" for i in range(n)),
        atol=np.full(n, 1e-14),
        t_eval=np.linspace(0.0, 0.05, 11),
        linear=LinearInputs(matrix.tocsr(), lambda _t: force),
    )
    run, reference = sundials.solve(problem), propagation.solve(problem)
    assert asked
    assert np.abs(run.x - reference.x).max() < 1e-6 * np.abs(reference.x).max()


def test_steps_are_counted_alike_with_and_without_output_times():
    free = sundials.solve_dae(loop(t_eval=None))
    asked = sundials.solve_dae(loop())
    assert asked.statistics["steps"] == asked.steps.size - 1
    assert asked.statistics["steps"] == pytest.approx(free.statistics["steps"], rel=0.2)


def test_step_ends_that_were_kept_are_those_of_the_dense_output_also_where_the_state_jumps():
    run = sundials.solve(
        Problem(
            rhs=lambda _t, x: -x,
            jacobian=None,
            x0=np.array([1.0, 2.0]),
            t0=0.0,
            t_end=1.0,
            names=("a", "b"),
            atol=np.full(2, 1e-9),
            breakpoints=(0.5,),
            jump=lambda _t, x: x + 1.0,
            t_eval=np.array([0.0, 1.0]),
        )
    )
    steps = run.dense.steps
    kept = run.dense(steps)
    run.dense(steps[:-1] + np.diff(steps) / 3)  # makes the dense output
    np.testing.assert_array_equal(kept, run.dense._dense(steps))
    assert kept[steps == 0.5][0] == pytest.approx([1.0 + np.exp(-0.5), 1.0 + 2 * np.exp(-0.5)], rel=1e-6)
