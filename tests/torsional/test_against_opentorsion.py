"""Forced response by orders against openTorsion on the same lumped train."""

from __future__ import annotations

import numpy as np
import opentorsion
import pytest

import shaftwork as sw
from tests.torsional.trains import (
    AMPLITUDES,
    BRAKE,
    DAMPINGS,
    INERTIAS,
    ORDERS,
    PHASES,
    STIFFNESSES,
    engine,
    speeds,
)


def assembly() -> opentorsion.Assembly:
    shafts = [
        opentorsion.Shaft(k, k + 1, None, None, k=c, I=0.0, c=d)
        for k, (c, d) in enumerate(zip(STIFFNESSES, DAMPINGS, strict=True))
    ]
    discs = [opentorsion.Disk(k, inertia, c=BRAKE if k == 5 else 0.0) for k, inertia in enumerate(INERTIAS)]
    return opentorsion.Assembly(shafts, disk_elements=discs)


def excitation(speed: float, failing: int | None = None) -> opentorsion.PeriodicExcitation:
    omegas = speed * np.array(ORDERS)
    torques = opentorsion.PeriodicExcitation(len(INERTIAS), omegas)
    for cylinder, angle in enumerate(sw.HarmonicTorque.firing_angles((1, 3, 4, 2))):
        if cylinder + 1 != failing:
            torques.add_sines(cylinder, omegas, AMPLITUDES, np.array(PHASES) - np.array(ORDERS) * angle)
    return torques


@pytest.mark.parametrize("failing", [None, 2])
def test_vibratory_torques_of_all_shafts_and_orders_agree(failing: int | None) -> None:
    misfire = None if failing is None else f"cylinder {failing}"
    calculation = sw.torsional_calculation(engine(), speeds(), misfire=misfire)
    theirs = assembly()
    springs = [calculation.orders_of(f"s{k}.tau_c") for k in range(len(STIFFNESSES))]
    for number, speed in enumerate(calculation.speeds):
        torques, sums = theirs.vibratory_torque(excitation(float(speed), failing))
        for k in range(len(STIFFNESSES)):
            ours = springs[k][number]
            # their sign of a shaft's torque is that of its far end; rounding of two eliminations
            assert np.abs(np.abs(ours) - np.abs(torques[k])).max() <= 1e-9 * np.abs(torques[k]).max()
            assert np.abs(ours).sum() == pytest.approx(sums[k], rel=1e-9)


def test_speeds_of_all_masses_agree_in_amplitude_and_phase() -> None:
    calculation = sw.torsional_calculation(engine(), speeds())
    theirs = assembly()
    masses = [calculation.orders_of(f"J{k}.omega") for k in range(len(INERTIAS))]
    for number, speed in enumerate(calculation.speeds):
        torques = excitation(float(speed))
        _, velocities = theirs.ss_response(torques.U, torques.omegas)
        for k in range(len(INERTIAS)):
            ours = masses[k][number]
            assert ours == pytest.approx(velocities[k], rel=1e-8, abs=1e-9 * float(np.abs(velocities[k]).max()))
