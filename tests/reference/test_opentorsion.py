"""A stepped shaft with discs against openTorsion, whose finite elements are of second order."""

from __future__ import annotations

import numpy as np
import opentorsion
import pytest

import shaftwork as sw

SECTIONS = ((0.8, 0.04), (1.5, 0.03), (1.0, 0.05))
DISCS = (0.9, 0.05, 0.08, 0.4)
DENSITY, SHEAR_MODULUS, DAMPING = 7850.0, 79.3e9, 3.0


def train(damping: float = DAMPING) -> sw.Network:
    net = sw.Network("stepped")
    net.add(sw.TorqueSource("motor", tau=0.0), "n0")
    for k, inertia in enumerate(DISCS):
        net.add(sw.Inertia(f"J{k}", J=inertia), f"n{k}")
    for k, (length, diameter) in enumerate(SECTIONS):
        material = {"density": DENSITY, "shear_modulus": SHEAR_MODULUS}
        shaft = sw.Shaft(f"s{k}", length=length, diameter=diameter, **material, model=sw.Spectral(10))
        net.add(shaft, f"n{k}", f"n{k + 1}")
    net.add(sw.Damper("water", d=damping), "n3")
    return net


def elements(count: int) -> opentorsion.Assembly:
    """Every section as a number of elements; lengths in mm."""
    shafts, discs, node = [], [opentorsion.Disk(0, DISCS[0])], 0
    for (length, diameter), inertia in zip(SECTIONS, DISCS[1:], strict=True):
        for _ in range(count):
            shafts.append(
                opentorsion.Shaft(
                    node, node + 1, L=1e3 * length / count, odl=1e3 * diameter, G=SHEAR_MODULUS, rho=DENSITY
                )
            )
            node += 1
        discs.append(opentorsion.Disk(node, inertia, c=DAMPING if inertia == DISCS[-1] else 0.0))
    return opentorsion.Assembly(shafts, disk_elements=discs)


def test_modes_agree_to_the_discretisation_of_the_elements() -> None:
    ours = np.sort(train(damping=0.0).modes().frequencies)
    ours = ours[ours > 1.0][:6]
    errors = []
    for count in (20, 40):
        squares, _ = elements(count).undamped_modal_analysis()
        found = np.sort(np.sqrt(np.abs(squares.real))) / (2 * np.pi)
        errors.append(np.abs(found[1:7] / ours - 1).max())
    # consistent elements: error (pi k / (m sections))^2 / 24 of the sixth mode, a quarter of it at twice the number
    assert errors[1] < 2e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def test_the_forced_response_agrees_to_the_discretisation_of_the_elements() -> None:
    frequencies = np.array([2.0, 15.0, 40.0, 120.0, 300.0])
    ours = train().frequency_response("motor.tau", "J3.omega", frequencies).values
    differences = []
    for count in (20, 40):
        assembly = elements(count)
        torques = np.zeros((assembly.M.shape[0], frequencies.size), dtype=complex)
        torques[0] = 1.0
        _, speeds = assembly.ss_response(torques, 2 * np.pi * frequencies)
        differences.append(np.abs(speeds[-1] / ours - 1).max())
    assert differences[1] < 1e-2  # near a resonance the error of the frequency is enlarged
    assert differences[0] / differences[1] == pytest.approx(4.0, rel=0.2)
