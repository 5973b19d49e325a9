"""The brushless motor on its shaft beside what Popenda 2019 says of figures 4 to 13, and its shafts beside another."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import shaftwork as sw
from shaftwork.components.shaft_models import ShaftModel
from shaftwork.scenes.long_shafts import RATED_TORQUE

T_END = sw.scenes.SCENES["bldc-shaft"].t_end
INERTIAS = (0.11, 0.025)
DISTRIBUTED = sw.Spectral(8)


@cache
def compiled(shaft: ShaftModel) -> sw.Model:
    return sw.scenes.bldc_shaft(model=shaft).compile()


@cache
def motion(J_m: float, shaft: ShaftModel = DISTRIBUTED) -> sw.Solution:
    return compiled(shaft).simulate(T_END, parameters={"Jm.J": J_m})


def apart(one: sw.Solution, other: sw.Solution, name: str) -> float:
    return float(np.abs(one[name] - other[name]).max() / np.abs(other[name]).max())


@pytest.mark.slow
@pytest.mark.parametrize("J_m", INERTIAS)
def test_lumped_and_distributed_shafts_move_alike(J_m: float) -> None:
    """Twenty elements err by 1e-3 at 1567 Hz, which hardly moves here; one spring lacks this frequency altogether."""
    truth = motion(J_m)
    for name in ("line.tau_a", "line.tau_b", "motor.tau", "motor.i_a", "Jm.omega"):
        assert apart(motion(J_m, sw.Lumped(20)), truth, name) < 5e-5, name
        assert apart(motion(J_m, sw.OneSpring()), truth, name) < 5e-2, name


@pytest.mark.slow
@pytest.mark.parametrize("shaft", [DISTRIBUTED, sw.Lumped(20), sw.OneSpring()], ids=str)
@pytest.mark.parametrize("J_m", INERTIAS)
def test_energy_is_kept_and_the_currents_sum_to_zero(J_m: float, shaft: ShaftModel) -> None:
    sol = motion(J_m, shaft)
    assert sol.energy_residual < 1e-9
    currents = np.array([sol[f"motor.i_{phase}"] for phase in "abc"])
    assert np.abs(currents.sum(axis=0)).max() <= 8 * np.finfo(float).eps * np.abs(currents).max()


def settled_ripple(sol: sw.Solution, name: str) -> tuple[float, float]:
    """Frequency of the largest Fourier amplitude of the last 0.1 s about its trend, Hz, and six times a phase's."""
    last = sol.t > T_END - 0.1
    t, values = sol.t[last], sol[name][last]
    left = (values - np.polyval(np.polyfit(t, values, 2), t)) * np.hanning(t.size)
    spectrum = np.abs(np.fft.rfft(left))
    frequencies = np.fft.rfftfreq(t.size, t[1] - t[0])
    return float(frequencies[spectrum.argmax()]), float(6 * 2 * sol["Je.omega"][last].mean() / (2 * np.pi))


@pytest.mark.slow
@pytest.mark.parametrize("J_m", INERTIAS)
def test_torque_and_currents_ripple_at_six_times_the_electrical_frequency(J_m: float) -> None:
    """As the source says of figures 4, 6, 9 and 11: typical of a motor that is controlled by its voltage alone."""
    found, wanted = settled_ripple(motion(J_m), "motor.tau")
    assert found == pytest.approx(wanted, abs=15.0)  # bins 10 Hz apart


@pytest.mark.slow
@pytest.mark.parametrize(("J_m", "times"), [(0.11, 34.6), (0.025, 20.4)])
def test_the_shaft_carries_several_times_the_rated_torque(J_m: float, times: float) -> None:
    """As the source says of figures 7, 8, 12 and 13, without a number; here the start on full voltage does it."""
    sol = motion(J_m)
    peak = np.abs(sol["line.tau_a"])
    assert peak.max() == pytest.approx(times * RATED_TORQUE, rel=5e-3)
    assert sol.t[peak.argmax()] < 0.02
    assert np.abs(sol["motor.i_a"]).max() > 200


@pytest.mark.slow
def test_the_small_mass_is_at_its_steady_speed_within_the_run_and_the_large_one_not_yet() -> None:
    """The averaged motor says where they go: a little above 3000 1/min, at which the back EMF would be 424 V."""
    mean = sw.Network("mean")
    motor = sw.scenes.bldc_shaft().parts[0]
    mean.add(sw.AveragedBLDC("m", U=motor.U, R=motor.R, L=motor.L, k=motor.k, pole_pairs=motor.pole_pairs), "rotor")
    mean.add(sw.Inertia("J", J=0.05), "rotor")
    mean.add(sw.CoulombLoad("load", tau=RATED_TORQUE), "rotor")
    steady = mean.compile().steady_state(initial={"J.omega": 300.0})["J.omega"]
    assert 100 * np.pi < steady < 120 * np.pi
    assert 0.95 * steady < motion(0.025)["Jm.omega"][-1] < steady
    assert motion(0.11)["Jm.omega"][-1] < 0.85 * steady


@pytest.mark.slow
def test_a_finer_output_grid_changes_no_commutation() -> None:
    """Its times cut steps to lengths at which the fast engine sees no event, right beside those of the motor."""
    found = (compiled(sw.OneSpring()).simulate(T_END, t_eval=5001), motion(0.11, sw.OneSpring()))
    fine, plain = (sorted(sol.events, key=lambda event: (event[1], event[0])) for sol in found)  # two change at once
    assert [event[1:] for event in fine] == [event[1:] for event in plain]
    np.testing.assert_allclose([e[0] for e in fine], [e[0] for e in plain], rtol=0, atol=1e-9)
