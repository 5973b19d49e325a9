"""Quantities at the corners of laws, where the derivative of a prescribed speed is 0/0 or infinite."""

from __future__ import annotations

import warnings
from itertools import product

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp
from sympy import acos, asin, cos, exp, pi, sin, sqrt

import shaftwork as sw
from shaftwork import studies

t = sw.t
J = 2.0


def driven(law: sympy.Expr, t_end: float = 2.0) -> sw.Solution:
    """An inertia whose speed is prescribed: its torque is J times the derivative."""
    net = sw.Network("corners")
    net.add(sw.SpeedSource("s", omega=law), "a")
    net.add(sw.Inertia("J", J=J), "a")
    return net.simulate(t_end)


CORNERS = {
    asin(sin(4 * t)): (-8.0, 8.0),
    asin(sin(4 * t + 0.3)): (-8.0, 8.0),
    acos(cos(4 * t)): (-8.0, 8.0),
    asin(cos(4 * t)): (-8.0, 8.0),
    acos(sin(4 * t)): (-8.0, 8.0),
    acos(1 - 2 * sin(2 * t) ** 2): (-8.0, 8.0),
    sqrt(2 - 2 * cos(4 * t)): (-8.0, 8.0),
    sqrt(t**2 - 2 * t + 1): (-2.0, 2.0),
    # |t|' where sin(3 t^2) turns: the last corner down is at 3 t^2 = 7 pi / 2
    asin(sin(3 * t**2)): (-12 * float(sqrt(7 * pi / 6)), 24.0),
    exp(-1 / t): (0.0, 8 * float(exp(-2))),
}


@pytest.mark.slow
@pytest.mark.parametrize("law", CORNERS, ids=str)
def test_extremes_means_and_samples_at_corners_are_the_limits_on_their_sides(law: sympy.Expr) -> None:
    least, most = CORNERS[law]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sol = driven(law)
        row, samples = sol.extremes.row("J.tau"), sol["J.tau"]
        swing = sol.max("J.omega") - sol.min("J.omega")
    assert (float(row.least), float(row.most)) == pytest.approx((least, most), rel=1e-9, abs=1e-12)
    start, end = (float(sympy.limit(law, t, place, "+" if place == 0 else "-")) for place in (0, 2))
    assert row.mean == pytest.approx(J * (end - start) / 2, abs=1e-8)
    assert np.isfinite(samples).all()
    assert samples.min() >= row.least - 1e-9
    assert samples.max() <= row.most + 1e-9
    assert swing > 0
    assert sol.energy_residual < 1e-8


def test_a_triangular_speed_has_full_cycles_of_torque_and_the_power_of_its_corners() -> None:
    sol = driven(asin(sin(4 * t)))
    assert sol.min("J.tau") == pytest.approx(sol["J.tau"].min())
    assert sol.max("J.power") == pytest.approx(8 * float(pi) / 2)
    cycles = sol.rainflow("J.tau")
    assert cycles.range == pytest.approx(16.0)
    assert float(cycles.count.sum()) == 1.5
    line = sw.SNLine(amplitude=5.0, cycles=1e6, slope=5.0)
    assert sol.damage("J.tau", sn=line).damage == pytest.approx(1.5 * (8 / 5) ** 5 / 1e6)


def test_a_sweep_measures_corners_as_one_motion_does() -> None:
    net = sw.Network("corners")
    net.add(sw.SpeedSource("s", omega=sqrt(2 - 2 * cos(4 * t))), "a")
    net.add(sw.Inertia("J", J=J), "a")
    table = studies.sweep(net, {"J.J": [1.0, 2.0]}, t_end=2.0, measures=["min J.tau", "max J.tau"])
    assert table.columns["min J.tau"] == pytest.approx([-4.0, -8.0])
    assert table.columns["max J.tau"] == pytest.approx([4.0, 8.0])


@pytest.mark.slow
def test_a_torque_beyond_all_bounds_is_named_with_its_time() -> None:
    sol = driven(sqrt(t))
    with pytest.warns(sw.AccuracyWarning, match=r"'J\.tau' .* no finite value at t = 0 s"):
        samples = sol["J.tau"]
    assert np.isinf(samples[0])
    with pytest.warns(sw.AccuracyWarning, match=r"'J\.tau' .* no finite value at t = 0 s"):
        row = sol.extremes.row("J.tau")
    assert (float(row.most), row.most.t) == (np.inf, 0.0)
    assert row.least == pytest.approx(1 / np.sqrt(2))
    assert row.mean == pytest.approx(np.sqrt(2), rel=1e-5)
    power = sol.extremes.row("J.power")  # omega d omega / dt is 1/2 at all times, at the start 0 times infinity
    assert (float(power.least), float(power.most), sol["J.power"][0]) == pytest.approx((1.0, 1.0, 1.0))


WAVES = [asin(sin(15 * t)), acos(cos(15 * t)), sqrt(2 - 2 * cos(15 * t))]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "engine"),
    [*product(WAVES, ["auto", "scipy", "sundials", "banded"]), (WAVES[0], "exact"), (WAVES[1], "exact")],
    ids=str,
)
def test_a_torque_with_corners_at_a_massless_node_is_followed(law: sympy.Expr, engine: str) -> None:
    net = sw.Network("between springs")
    net.add(sw.TorqueSource("m", tau=law), "x")
    net.add(sw.Inertia("A", J=1.0), "a")
    net.add(sw.Inertia("B", J=3.0), "b")
    net.add(sw.Spring("p", c=100.0), "a", "x")
    net.add(sw.Spring("q", c=300.0), "x", "b")
    sol = net.simulate(1.0, t_eval=11, engine=engine)
    torque = sympy.lambdify(t, law, "math")

    def rates(time: float, y: np.ndarray) -> list[float]:
        middle = (100 * y[0] + 300 * y[1] + torque(time)) / 400
        return [y[2], y[3], 100 * (middle - y[0]), 300 * (middle - y[1]) / 3]

    right = solve_ivp(rates, (0, 1), np.zeros(4), rtol=1e-9, atol=1e-11, max_step=2e-3, t_eval=sol.t).y
    assert np.abs(sol["A.omega"] - right[2]).max() < 1e-6
    assert np.abs(sol["B.omega"] - right[3]).max() < 1e-6
    assert abs(sol.energy_residual) < 1e-6
