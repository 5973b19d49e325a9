"""Nonlinear laws at massless nodes, solved together with the motion."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

import shaftwork as sw


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
