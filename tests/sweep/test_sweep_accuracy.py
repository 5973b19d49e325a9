"""Measures of variants side by side are as right as the states, where the states do not tell."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from scipy.linalg import expm

import shaftwork as sw
from shaftwork.studies import sweep

pytest.importorskip("numba")

COUNT, T_END = 16, 10.0


def ripple(omega: float, mean: float, law: sympy.Expr) -> sw.Network:
    """A source whose ripple the speed hardly feels."""
    net = sw.Network("ripple")
    net.add(sw.TorqueSource("motor", tau=mean), "a")
    net.add(sw.TorqueSource("ripple", tau=10 * sympy.sin(omega * sw.t) * law), "a")
    net.add(sw.Inertia("J", J=50.0), "a")
    net.add(sw.Damper("d", d=1.0), "a")
    return net


@pytest.mark.slow
@pytest.mark.parametrize(("omega", "mean"), [(300.0, 1e3), (300.0, 1e6), (1000.0, 1e4)])
def test_integrals_of_what_the_states_do_not_feel(omega: float, mean: float) -> None:
    measures = {"rms": "rms ripple.tau", "mean": "mean ripple.tau"}
    samples = {"J.J": np.linspace(40.0, 60.0, COUNT)}
    made = sweep(ripple(omega, mean, sympy.Integer(1)), samples=samples, t_end=T_END, measures=measures)
    turned = omega * T_END
    assert made.why == ""
    assert made.measures["rms"] == pytest.approx(np.sqrt(50.0 * (1 - np.sin(2 * turned) / (2 * turned))), rel=1e-7)
    # of the range of 10 N m
    assert made.measures["mean"] == pytest.approx(10.0 * (1 - np.cos(turned)) / turned, abs=1e-7)


@pytest.mark.slow
def test_extremes_of_what_the_states_do_not_feel() -> None:
    """A ripple whose amplitude swings slowly, against many samples of it."""
    omega, slow = 1000.0, 0.7
    net = ripple(omega, 1e4, 1 + sympy.sin(slow * sw.t) / 2)
    measures = {"max": "max ripple.tau", "min": "min ripple.tau"}
    made = sweep(net, samples={"J.J": np.linspace(40.0, 60.0, COUNT)}, t_end=T_END, measures=measures)
    t = np.linspace(0.0, T_END, 5_000_001)  # 2 us: between two of these a top is higher by 10 N m 1e-6
    torque = 10.0 * np.sin(omega * t) * (1 + np.sin(slow * t) / 2)
    assert made.why == ""
    assert made.measures["max"] == pytest.approx(torque.max(), abs=1e-5)
    assert made.measures["min"] == pytest.approx(torque.min(), abs=1e-5)


def stiff(d: float) -> sw.Network:
    """Two inertias on a spring with much damping."""
    net = sw.Network("stiff")
    net.add(sw.TorqueSource("motor", tau=10.0), "a")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Spring("shaft", c=500.0, d=d), "a", "b")
    net.add(sw.Inertia("J2", J=3.0), "b")
    net.add(sw.Damper("load", d=1.0), "b")
    return net


@pytest.mark.parametrize(("d", "rtol", "error"), [(2e3, 1e-8, 1e-7), (2e4, 1e-8, 1e-7), (2e4, 1e-6, 1e-5)])
def test_the_torque_of_a_stiff_damper(d: float, rtol: float, error: float) -> None:
    """It is the difference of two speeds that are right, times much; by the matrix exponential, to ten times rtol."""
    samples = {"motor.tau": 10.0 * np.linspace(1.0, 2.0, COUNT)}
    made = sweep(stiff(d), samples=samples, t_end=5.0, measures={"tau": "end shaft.tau"}, rtol=rtol)
    rates = np.zeros((4, 4))
    rates[0] = -d / 2, d / 2, -1 / 2, 1 / 2
    rates[1, :3] = d / 3, -(d + 1) / 3, 1 / 3
    rates[2, :2] = 500.0, -500.0
    omega_1, omega_2, spring, _ = expm(5.0 * rates) @ np.array([0.0, 0.0, 0.0, 1.0])
    assert made.why == ""
    assert made.measures["tau"] / samples["motor.tau"] == pytest.approx(spring + d * (omega_1 - omega_2), rel=error)


@pytest.mark.slow
def test_a_stiff_variant_runs_alone() -> None:
    samples = {"shaft.d": np.append(np.linspace(1.0, 2.0, COUNT - 1), 2e7)}
    measures = {"tau": "max shaft.tau"}
    made = sweep(stiff(1.0), samples=samples, t_end=5.0, measures=measures)
    alone = sweep(stiff(1.0), samples={"shaft.d": [2e7]}, t_end=5.0, measures=measures)
    assert made.why.startswith(f"1 of {COUNT} variants")
    assert made.measures["tau"][-1] == alone.measures["tau"][0]


@pytest.mark.slow
def test_blows_that_no_formula_places_are_seen_by_variants_that_could_run_side_by_side() -> None:
    """100 cos(2 t)^40000 is zero but for blows of some ms; steps of a fiftieth of the motion passed half of them."""
    net = sw.Network("press")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.TorqueSource("T", tau=100 * sympy.cos(2 * sw.t) ** 40000), "a")
    net.add(sw.TorqueSource("air", tau=-0.01 * sw.omega * sympy.Abs(sw.omega)), "a")
    inertias = np.linspace(1.0, 2.0, 16)
    made = sweep(net, samples={"J.J": inertias}, t_end=4.0, measures=["end J.omega"], processes=1)
    alone = [
        net.simulate(4.0, parameters={"J.J": J}, engine="scipy-radau", t_eval=2)["J.omega"][-1] for J in (1.0, 2.0)
    ]
    # two runs of rtol = 1e-8 with different engines, each within 100 of it
    np.testing.assert_allclose(made.measures["end J.omega"][[0, -1]], alone, rtol=2e-6)


def test_a_peak_that_cannot_be_told_leaves_the_variant_to_a_run_of_its_own() -> None:
    """A ripple whose derivatives are larger than those of the hump: polynomials through them tell nothing."""
    net = sw.Network("hump")
    net.add(sw.TorqueSource("motor", tau=100 * sw.t * sympy.exp(-sw.t) + 1e-10 * sympy.sin(1e8 * sw.t)), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Damper("oil", d=0.1), "a")
    made = sw.studies.sweep(net, {"J.J": np.linspace(1.0, 2.0, 16)}, t_end=10.0, measures=["max motor.tau"])
    assert "ran one by one" in made.why
    # what looks every step at its ends alone is off by as much as the hump falls in half a step, 1e-4
    assert made.measures["max motor.tau"] == pytest.approx(np.full(16, 100 / np.e), rel=1e-4)
