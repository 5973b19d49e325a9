"""Frequencies, speeds and times with units mean what they say."""

from __future__ import annotations

from typing import Any

import numpy as np
import pint
import pytest

import shaftwork as sw

UNIT = pint.UnitRegistry()


def train() -> sw.Network:
    """A motor, a shaft and a load."""
    net = sw.Network("train")
    net.add(sw.TorqueSource("motor", tau=10.0), "rotor")
    net.add(sw.Inertia("J1", J=2.0), "rotor")
    net.add(sw.Spring("shaft", c=1e4, d=1.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=3.0), "wheel")
    return net


@pytest.mark.parametrize("f", [[600.0] * UNIT.rpm, [10.0] * UNIT.Hz, [20 * np.pi] * UNIT.rad / UNIT.s], ids=str)
def test_a_frequency_counts_revolutions_whatever_it_is_given_in(f: object) -> None:
    response = train().frequency_response("motor.tau", "shaft.tau", f)
    assert response.f == pytest.approx([10.0], rel=1e-14)  # rounding of the conversion


def test_speeds_in_rpm_are_converted_and_those_in_hertz_refused() -> None:
    diagram = train().campbell([0.0, 600.0] * UNIT.rpm)
    assert diagram.speeds == pytest.approx([0.0, 20 * np.pi], rel=1e-14)
    with pytest.raises(sw.ParameterError, match="rpm or rad/s"):
        train().campbell([0.0, 10.0] * UNIT.Hz)


def test_times_with_units_are_converted_or_refused() -> None:
    sol = train().simulate(0.1, t_eval=[0.0, 50.0, 100.0] * UNIT.ms)
    assert sol.t == pytest.approx([0.0, 0.05, 0.1], rel=1e-14)
    assert sol.at([20.0] * UNIT.ms).t == pytest.approx([0.02], rel=1e-14)
    with pytest.raises(sw.ParameterError, match="needs s"):
        sol.at([1.0] * UNIT.m)


def test_numbers_in_the_unit_of_a_quantity_that_is_named_elsewhere_refuse_units_of_their_own() -> None:
    """A line of cycles and the limit of a measure do not know what is counted, so 2 kN m could be taken for 2 N m."""
    torque, net = 2.0 * UNIT.kN * UNIT.m, train()
    limits = {"max shaft.tau": (None, torque)}
    with pytest.raises(sw.ParameterError, match=r"require\['max shaft.tau'\] = 2.0 .* has a unit"):
        sw.studies.sweep(net, {"shaft.c": [1e4]}, t_end=0.1, measures=["max shaft.tau"], require=limits)
    line = {"amplitude": 2e3, "cycles": 1e6, "slope": 5.0}
    for name in ("amplitude", "limit", "ultimate"):
        with pytest.raises(sw.ParameterError, match=rf"{name} = 2.0 .* has a unit"):
            sw.SNLine(**{**line, name: torque})
    with pytest.raises(sw.ParameterError, match=r"amplitude = 2.0 .* has a unit"):
        sw.SNLine(**line).borne(torque)


def test_states_and_parameters_of_a_right_hand_side_are_plain_numbers_one_for_each() -> None:
    model = train().compile()
    x = np.array([1.0, 2.0, 3e-4])
    assert model.rhs(0.0 * UNIT.ms, x) == pytest.approx(model.rhs(0.0, x))
    for call in (model.rhs, model.jacobian):
        with pytest.raises(sw.ParameterError, match=r"x = .* has a unit"):
            call(0.0, x * UNIT.rpm)
        with pytest.raises(sw.ParameterError, match=r"x has the shape \(4,\): give 3 numbers, one for each state"):
            call(0.0, np.zeros(4))
        with pytest.raises(sw.ParameterError, match=r"p has the shape \(1,\): give 5 numbers, one for each parameter"):
            call(0.0, x, np.ones(1))


@pytest.mark.parametrize("steps", [1.5, 0, "many", 1000.0 * UNIT.ms], ids=str)
def test_a_limit_of_steps_is_a_whole_number(steps: object) -> None:
    with pytest.raises(sw.ParameterError, match=r"max_steps = .* must be a whole number of steps"):
        train().simulate(0.1, max_steps=steps)


def test_the_pull_out_torque_of_the_crane_may_have_a_unit() -> None:
    kilo = sw.scenes.crane_start(pull_out_torque=0.013 * UNIT.kN * UNIT.m).simulate(1.0)
    assert kilo.max("motor.tau") == pytest.approx(sw.scenes.crane_start(13.0).simulate(1.0).max("motor.tau"), rel=1e-12)
    with pytest.raises(sw.ParameterError, match=r"pull_out_torque = 3.0 N m must be more than the rated 3.8"):
        sw.scenes.crane_start(pull_out_torque=0.003 * UNIT.kN * UNIT.m)


@pytest.mark.parametrize(
    ("speed", "words"), [(80 * UNIT.rpm, "80 1/min"), (8 * UNIT("rad/s"), "8 rad/s"), (0.5 * UNIT.krpm, "0.5 krpm")]
)
def test_titles_have_the_units_of_their_point_as_diagrams_do(speed: Any, words: str) -> None:
    net = sw.Network("fan")
    net.add(sw.Inertia("J", J=2.0), "a")
    net.add(sw.FanLoad("load", tau_n=20.0, n_n=100.0), "a")
    assert net.modes(at={"J.omega": speed}).title == f"fan at J.omega = {words}"
