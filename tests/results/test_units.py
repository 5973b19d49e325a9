"""Frequencies, speeds and times with units mean what they say."""

from __future__ import annotations

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
