"""Nonlinear laws at massless nodes, solved together with the motion."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

import shaftwork as sw


@pytest.mark.slow
def test_a_step_ends_where_a_law_in_a_loop_bends() -> None:
    """The fan takes 3 omega, and 8 omega - 5 beyond 1 rad/s; the equations solved for its speed by hand."""
    pytest.importorskip("sksundae")
    net = sw.Network("fan that opens")
    net.add(sw.Inertia("J", J=2.0), "disc")
    net.add(sw.Spring("shaft", c=500.0), "disc", "fan")
    net.add(sw.TorqueSource("fan", tau=-3 * sw.omega - 5 * sympy.Max(sw.omega - 1, 0)), "fan")
    sol = net.simulate(1.0, initial={"J.omega": 4.0}, algebraic_loops="solve", t_eval="steps", rtol=1e-9)
    assert sol.engine == "sundials"
    assert np.abs(sol["fan.omega"] - 1.0).min() < 1e-9

    def rates(_: float, x: np.ndarray) -> list[float]:
        speed = x[1] / 3 if x[1] < 3 else (x[1] + 5) / 8
        return [-x[1] / 2, 500 * (x[0] - speed)]

    truth = solve_ivp(rates, (0, 1), [4.0, 0.0], "DOP853", sol.t, rtol=1e-12, atol=1e-12, max_step=1e-3).y
    # the engine is asked for 1e-9 a step
    assert np.abs(sol["J.omega"] - truth[0]).max() < 1e-7 * 4
    assert np.abs(sol["shaft.tau"] - truth[1]).max() < 1e-7 * np.abs(truth[1]).max()


def folded() -> sw.Model:
    """A fan whose speed has three values for torques between -2 and 2 N m: tau = omega^3 - 3 omega."""
    net = sw.Network("folded")
    net.add(sw.Inertia("J", J=2.0), "disc")
    net.add(sw.Spring("shaft", c=500.0), "disc", "fan")
    net.add(sw.TorqueSource("fan", tau=3 * sw.omega - sw.omega**3), "fan")
    return net.compile(algebraic_loops="solve")


@pytest.mark.slow
def test_the_instants_of_a_motion_stay_on_the_branch_on_which_each_one_after_the_other_does() -> None:
    """The torque swings beyond both folds, where the speed goes from one branch to another: a hysteresis."""
    model = folded()
    loops = model.bind(model.defaults).loops
    assert loops is not None
    t = np.linspace(0.0, 4 * np.pi, 401)
    x = np.array([np.zeros(t.size), 5 * np.sin(t)])
    at_once = loops.solve(t, x)[0]
    loops.start_from(np.zeros(1))
    each = np.array([loops.solve(time, state)[0] for time, state in zip(t, x.T, strict=True)])
    assert at_once == pytest.approx(each, rel=1e-12, nan_ok=True)
    solved = np.isfinite(at_once)  # just beyond a fold the method is caught by it
    assert solved.mean() > 0.9
    assert (at_once**3 - 3 * at_once)[solved] == pytest.approx(x[1][solved], abs=1e-12)
    # the same torque of 0 at three instants, with three speeds
    assert at_once[[0, 100, 200]] == pytest.approx([0.0, np.sqrt(3), -np.sqrt(3)], abs=1e-12)


def test_instants_without_a_solution_are_nan_and_the_next_goes_on_from_the_last_that_had_one() -> None:
    net = sw.Network("no speed carries more than 1 N m")
    net.add(sw.Inertia("J", J=2.0), "disc")
    net.add(sw.Spring("shaft", c=500.0), "disc", "fan")
    net.add(sw.TorqueSource("fan", tau=-2 * sw.omega / (1 + sw.omega**2)), "fan")
    model = net.compile(algebraic_loops="solve")
    loops = model.bind(model.defaults).loops
    assert loops is not None
    torque = np.array([0.1, 0.5, 3.0, 2.0, 0.5, 0.1])
    speed = loops.solve(np.arange(6.0), np.array([np.zeros(6), torque]))[0]
    assert np.isnan(speed).tolist() == [False, False, True, True, False, False]
    known = torque[[0, 1, 4, 5]]
    # the smaller root of torque (1 + omega^2) = 2 omega
    assert speed[[0, 1, 4, 5]] == pytest.approx((1 - np.sqrt(1 - known**2)) / known, rel=1e-12)


def test_what_bends_a_law_in_a_loop_is_read_at_the_solved_speed() -> None:
    net = sw.Network("fan that opens")
    net.add(sw.Inertia("J", J=2.0), "disc")
    net.add(sw.Spring("shaft", c=500.0), "disc", "fan")
    net.add(sw.TorqueSource("fan", tau=-3 * sw.omega - 5 * sympy.Max(sw.omega - 1, 0)), "fan")
    model = net.compile(algebraic_loops="solve")
    torques = np.array([1.5, 3.0, 11.0])
    found = model.bind(model.defaults).switches(np.zeros(3), np.column_stack([np.zeros(3), torques]))
    speeds = np.array([0.5, 1.0, 2.0])  # 3 omega = 1.5 and 3, 8 omega - 5 = 11
    assert found.shape == (3, 1)
    np.testing.assert_allclose(np.abs(found[:, 0]), np.abs(speeds - 1.0), atol=1e-9)
