"""Superposition of orders against long simulations, in time and by the angle."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import shaftwork as sw
from tests.torsional.trains import BRAKE, INERTIAS, engine, harmonics

SPEED = 61.0
"""rad/s; order 1.5 is near the first mode there."""
CYCLE = 4 * np.pi / SPEED
INERTIA = sum(INERTIAS)


def in_time(net: sw.Network) -> sw.Network:
    """The cylinders as torques of time, at the angle of a shaft that turns steadily."""
    for k, angle in enumerate(sw.HarmonicTorque.firing_angles((1, 3, 4, 2)), 1):
        swing = harmonics().torque(SPEED * sw.t - angle, sympy.Integer(0))
        net.replace(sw.TorqueSource(f"cylinder {k}", tau=swing))
    return net


@pytest.mark.slow
def test_a_long_simulation_with_torques_of_time_comes_to_the_same_waveform() -> None:
    calculation = sw.torsional_calculation(engine(), [SPEED, 2 * SPEED])
    cycles = round(30 * INERTIA / BRAKE / CYCLE)  # the slowest motion has decayed to e^-30
    motion, number = None, int(np.abs(calculation.speeds - SPEED).argmin())
    for k in range(5):
        angles, torque = calculation.waveform(f"s{k}", SPEED)
        if motion is None:
            times = cycles * CYCLE + angles / SPEED
            motion = in_time(engine()).simulate(times[-1], t_eval=times, rtol=1e-11)
        size = np.abs(torque).max()
        assert np.abs(motion[f"s{k}.tau"] - torque).max() < 1e-6 * size
        # the half range between the 64 samples of a swing of the highest order: (pi / 64)^2 / 2 of it at most
        assert calculation[f"s{k}"].amplitude[number] == pytest.approx(np.ptp(torque) / 2, rel=1.3e-3)


@pytest.mark.slow
def test_by_the_angle_a_simulation_comes_to_it_as_the_swing_becomes_small() -> None:
    """The angle that a cylinder reads swings itself: its torque then differs by the product of both swings."""
    errors = []
    for scale in (1.0, 0.1):
        calculation = sw.torsional_calculation(engine(scale), [SPEED, 2 * SPEED])
        net = engine(scale)
        # the mean torque acts at the load, so that no shaft is twisted and all cylinders have their angles
        net.add(sw.TorqueSource("mean", tau=BRAKE * SPEED), "n5")
        cycles = round(12 * INERTIA / BRAKE / CYCLE)
        times = np.linspace(cycles * CYCLE, (cycles + 2) * CYCLE, 4001)
        start = {f"J{k}.omega": SPEED for k in range(6)}
        torque = net.simulate(times[-1], t_eval=times, rtol=1e-11, initial=start)["s4.tau"]
        number = int(np.abs(calculation.speeds - SPEED).argmin())
        errors.append(abs(np.ptp(torque) / 2 / calculation["s4"].amplitude[number] - 1))
    assert errors[0] < 0.02
    assert errors[1] < 0.2 * errors[0]
