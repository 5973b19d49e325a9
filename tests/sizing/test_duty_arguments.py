"""Arguments of a duty that do not go together, and a motor that only holds."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import shaftwork as sw


def holding() -> sw.Solution:
    """5 N m against a friction that holds up to 50 N m."""
    net = sw.Network("holding")
    net.add(sw.TorqueSource("motor", tau=5.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.CoulombLoad("load", tau=50.0), "a")
    return net.simulate(1.0)


def test_a_motor_that_only_holds_is_cooled_as_at_standstill() -> None:
    """With or without a speed of full cooling the thermal torque is 5 / sqrt(0.4), as that of every candidate."""
    sol, expected = holding(), 5.0 / math.sqrt(0.4)
    made = sw.sizing.duty(sol, "motor", cooling=0.4)
    assert made.thermal("S1") == pytest.approx(expected, rel=1e-14)
    assert sw.sizing.duty(sol, "motor", cooling=0.4, n_cooling=1450).thermal("S1") == pytest.approx(expected, rel=1e-14)
    assert sw.sizing.choose(made).candidates[0].tau_thermal == pytest.approx(expected, rel=1e-14)
    assert "cooling 0.4 at standstill, where it is all the time" in made.notes
    assert sw.sizing.duty(sol, "motor").thermal("S1") == pytest.approx(5.0, rel=1e-14)


def geared() -> sw.Solution:
    net = sw.Network("geared")
    net.add(sw.SpeedSource("drive", omega=sw.Table([0, 1, 3, 4], [0, 10, 10, 0])), "b")
    net.add(sw.Inertia("J", J=2.0), "b")
    net.add(sw.LossyGear("gear", ratio=5.0, efficiency=0.9), "a", "b")
    net.add(sw.Inertia("rotor", J=0.01), "a")
    net.add(sw.Spring("shaft", c=1e4, d=10.0), "b", "c")
    net.add(sw.Inertia("fan", J=0.1), "c")
    return net.simulate(4.0)


@pytest.mark.parametrize(
    ("torque", "speed", "says"),
    [
        (
            "drive.tau",
            "rotor.omega",
            "'drive.tau' acts at node 'b', and 'rotor.omega' is the speed of node 'a'. "
            "Name a speed there: 'b.omega', 'drive.omega_rel', 'drive.omega', 'J.omega'",
        ),
        ("gear.tau_a", "b.omega", "'gear.tau_a' acts at node 'a', and 'b.omega' is the speed of node 'b'"),
        ("drive.tau", "shaft.omega_rel", "is the speed of nodes 'b', 'c'"),
        ("shaft.tau", "rotor.omega", "'shaft.tau' acts at nodes 'b', 'c'"),
    ],
)
def test_a_torque_and_the_speed_of_another_shaft_are_refused(torque: str, speed: str, says: str) -> None:
    with pytest.raises(sw.ParameterError, match=says):
        sw.sizing.duty(geared(), torque=torque, speed=speed)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("torque", "speed"),
    [
        ("gear.tau_a", "rotor.omega"),
        ("gear.tau_b", "J.omega"),
        ("drive.tau", "b.omega"),
        ("shaft.tau", "b.omega"),
        ("shaft.tau", "fan.omega"),
        ("shaft.tau", "shaft.omega_rel"),
    ],
)
def test_a_torque_and_a_speed_of_its_own_shaft_make_a_duty(torque: str, speed: str) -> None:
    """The gain and the loss of energy are those of the product at many times; the trapezoidal rule is good to 1e-4."""
    sol = geared()
    made = sw.sizing.duty(sol, torque=torque, speed=speed)
    times = np.linspace(0.0, 4.0, 40_001)
    power = sol.at(times)[torque] * sol.at(times)[speed]
    assert made.power_mean * 4.0 == pytest.approx(np.trapezoid(power, times), abs=1e-4 * np.abs(power).max())


@pytest.mark.parametrize(
    ("limit", "says"),
    [
        (lambda _: [1.0, 2.0], r"limit gives 2 torques for \d+ speeds. Let it take an array of speeds in 1/min"),
        (lambda _: "20 N*m", "limit fails for an array of speeds: could not convert"),
        (lambda n: 20.0 if n < 1500 else 10.0, r"limit fails for an array .*Let it take .*np.where\(n < 1500"),
    ],
)
def test_a_function_that_is_no_limit_of_every_speed_is_refused(limit: Callable[[Any], Any], says: str) -> None:
    with pytest.raises(sw.ParameterError, match=says):
        sw.sizing.duty(holding(), "motor").reserve(limit)


def test_a_cycle_as_long_as_a_motion_that_starts_late() -> None:
    """0.4 s - 0.3 s is more than 0.1 s in the last bit."""
    net = sw.Network("n")
    net.add(sw.TorqueSource("T", tau=1.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    sol = net.simulate(0.4, t_start=0.3)
    assert sw.sizing.duty(sol, "T", cycle=0.1).power_mean == sw.sizing.duty(sol, "T").power_mean


def test_the_speed_of_a_member_that_is_held_is_refused() -> None:
    net = sw.Network("held")
    net.add(sw.TorqueSource("T", tau=1.0), "sun")
    net.add(sw.PlanetaryGear("pg", ratio=3.0), "sun", "arm", "ground")
    net.add(sw.Inertia("J", J=1.0), "arm")
    with pytest.raises(sw.ParameterError, match="is the speed of no node"):
        sw.sizing.duty(net.simulate(1.0), torque="T.tau", speed="pg.omega_ring")
