"""Nonlinear ends on both sides of two incommensurate waves: against characteristics that share nothing with it."""

from __future__ import annotations

import numpy as np
import pytest

import shaftwork as sw
from tests.reference.characteristics import Drive, motion

DENSITY, MODULUS, DIAMETER = 7900.0, 77.5e9, 0.05
TAU_K, SLIP_K, SYNCHRONOUS = 900.0, 0.2, 2 * np.pi * 1500 / 60


def drive(lengths: tuple[float, float], gap: float, c: float, d: float) -> Drive:
    polar = np.pi * DIAMETER**4 / 32

    def motor(speed):
        slip = 1 - speed / SYNCHRONOUS
        return 2 * TAU_K * slip * SLIP_K / (slip**2 + SLIP_K**2)

    velocity = np.sqrt(MODULUS / DENSITY)
    impedance = polar * np.sqrt(MODULUS * DENSITY)
    return Drive(
        motor,
        (1.0, 0.2, 0.3, 5.0),
        2.0,
        (impedance, impedance),
        (lengths[0] / velocity, lengths[1] / velocity),
        gap,
        c,
        d,
        1.5,
    )


def network(drive: Drive, lengths: tuple[float, float]) -> sw.Network:
    net = sw.Network("two waves and a gap")
    net.add(sw.KlossMotor("motor", tau_k=TAU_K, s_k=SLIP_K, n_sync=1500), "rotor")
    net.add(sw.Inertia("J1", J=drive.inertias[0]), "rotor")
    steel = {"diameter": DIAMETER, "density": DENSITY, "shear_modulus": MODULUS, "model": sw.Wave()}
    net.add(sw.Shaft("fast", length=lengths[0], **steel), "rotor", "pinion")
    net.add(sw.Inertia("disc", J=drive.inertias[1]), "pinion")
    net.add(sw.Gear("gear", ratio=drive.ratio), "pinion", "wheel")
    net.add(sw.Shaft("slow", length=lengths[1], **steel), "wheel", "claw")
    net.add(sw.Inertia("J2", J=drive.inertias[2]), "claw")
    net.add(sw.Backlash("gap", gap=drive.gap, c=drive.c, d=drive.d), "claw", "machine")
    net.add(sw.Inertia("J3", J=drive.inertias[3]), "machine")
    net.add(sw.ViscousLoad("load", d=drive.load), "machine")
    return net


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lengths", "gap", "c", "d"),
    [((10.0, 10.0 * np.sqrt(2)), 0.02, 2e5, 20.0), ((8.0, 8.0), 1e-4, 5e4, 0.0), ((7.0, 9.1), 0.05, 1e6, 0.0)],
    ids=["incommensurate", "equal, hardly any play", "hard contact"],
)
def test_a_motor_and_a_gap_at_the_ends_of_two_waves(lengths: tuple[float, float], gap: float, c: float, d: float):
    """The reference is right to 1e-11 (it does not change with its points); the bar is 1e-6 in the speeds."""
    made = drive(lengths, gap, c, d)
    times = np.linspace(0, 0.06, 241)
    truth = motion(made, 0.06, times)
    errors, steps = [], []
    for rtol in (1e-4, 1e-6, 1e-8):
        sol = network(made, lengths).simulate(0.06, t_eval=times, rtol=rtol)
        assert sol.engine == "wave"
        speeds = np.array([sol[f"{name}.omega"] for name in ("J1", "disc", "J2", "J3")])
        errors.append(float((np.abs(speeds - truth[:4]).max(axis=1) / np.abs(truth[:4]).max(axis=1)).max()))
        steps.append(sol.statistics["steps"])
    assert np.abs(truth[4]).max() > gap / 2  # there is contact
    assert errors[-1] < 1e-7
    order = np.log(errors[0] / errors[-1]) / np.log(steps[-1] / steps[0])
    assert order > 2


@pytest.mark.slow
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_beside_a_wave_a_gap_passes_nothing_until_half_of_it_is_passed(way: float) -> None:
    """From its middle each flank is reached after sqrt(2 (gap / 2) J / tau) = 14.1 ms."""
    net = sw.Network("gap")
    net.add(sw.TorqueSource("motor", tau=10.0 * way), "a")
    net.add(sw.Inertia("J1", J=0.1), "a")
    net.add(sw.Backlash("gap", gap=0.02, c=1000.0, d=5.0), "a", "b")
    net.add(sw.Inertia("J2", J=0.1), "b")
    net.add(sw.Shaft("line", length=1.0, diameter=0.02, model=sw.Wave()), "b", "c")
    net.add(sw.Inertia("J3", J=0.1), "c")
    sol = net.simulate(0.015, t_eval=[0.0, 0.0141, 0.0142, 0.015])
    assert (sol["gap.tau"][:2] == 0.0).all()
    assert (way * sol["gap.tau"][2:] > 0.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("torque", [10.0, -10.0])
@pytest.mark.parametrize("twist", [0.0, 0.011, -0.02])
@pytest.mark.parametrize("damping", [0.0, 5.0, 300.0])
def test_beside_a_wave_a_drive_runs_through_its_gap_to_steady_operation(torque: float, twist: float, damping: float):
    """Against the modes of the gap beside a spring: from its middle and from both flanks, on which dampers jump."""
    found = []
    for model in (sw.Wave(), sw.OneSpring()):
        net = sw.Network("gap")
        net.add(sw.TorqueSource("motor", tau=torque), "a")
        net.add(sw.Inertia("J1", J=0.1), "a")
        net.add(sw.Backlash("gap", gap=0.02, c=1000.0, d=damping), "a", "b")
        net.add(sw.Inertia("J2", J=0.1), "b")
        net.add(sw.Shaft("line", length=1.0, diameter=0.02, model=model), "b", "c")
        net.add(sw.Inertia("J3", J=0.1), "c")
        net.add(sw.ViscousLoad("load", d=0.5), "c")
        compiled = net.compile()
        found.append(compiled.steady_state(initial={"gap.phi": twist}))
        stays = compiled.simulate(1e-3, initial=found[-1])
        assert np.abs(stays["J3.omega"] - torque / 0.5).max() < 1e-9
    for name in ("J1.omega", "gap.phi"):
        assert found[0][name] == pytest.approx(found[1][name], rel=1e-9)
