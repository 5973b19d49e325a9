"""Shafts as travelling waves inside networks."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import sympy

import shaftwork as sw
from tests.reference.exact_shafts.exact_motion import JunctionTorque, motion
from tests.reference.exact_shafts.line import Section, SectionLine

STEEL = {"density": 7900.0, "shear_modulus": 77.5e9}
SECTION = Section.of_geometry(1.0, 0.02, **STEEL)


def train(model: object, load: float = 0.11, drive: object = 12.7, **shaft: float) -> sw.Network:
    """A motor with a step of torque, a shaft and a load."""
    net = sw.Network("train")
    net.add(sw.TorqueSource("motor", tau=drive), "m")
    net.add(sw.Inertia("Je", J=0.025), "m")
    net.add(sw.Shaft("line", length=1.0, diameter=0.02, **STEEL, **shaft, model=model), "m", "l")
    net.add(sw.Inertia("Jm", J=load), "l")
    return net


def pulse(at_the_end: sw.Component | None) -> sw.Solution:
    """A short torque on a light disc sends a wave of length 0.1 ms along the shaft; it is back after 0.64 ms."""
    net = sw.Network("pulse")
    net.add(sw.TorqueSource("motor", tau=sw.Step(1.0, start=0.0) - sw.Step(1.0, start=1e-4)), "m")
    net.add(sw.Shaft("line", length=1.0, diameter=0.02, **STEEL, model=sw.Wave()), "m", "l")
    if at_the_end is not None:
        net.add(at_the_end, "l")
    return net.simulate(9e-4, t_eval=np.linspace(0, 9e-4, 181))


@pytest.mark.parametrize("load", [0.11, 0.025])
def test_waves_are_the_exact_solution(load: float) -> None:
    """Against characteristics with Radau collocation, which shares no code with the engine."""
    sol = train(sw.Wave(), load).simulate(0.2, t_eval=401)
    truth = motion(SectionLine((SECTION,), (0.025, load)), [JunctionTorque(0, 12.7)], 0.2)
    assert sol.engine == "wave"
    for side, name in (("left", "line.tau_a"), ("right", "line.tau_b")):
        expected = truth.torque_in(0, sol.t, side)
        # the engine is asked for 1e-8
        assert np.abs(sol[name] - expected).max() < 1e-8 * np.abs(expected).max()
    for place, column in enumerate(sol.places["line.tau"]):
        expected = truth.torque(column, sol.t, "left")
        assert np.abs(sol["line.tau"][:, place] - expected).max() < 1e-8 * 21
        np.testing.assert_allclose(sol["line.omega"][:, place], truth.speed(column, sol.t), atol=1e-7)


def test_a_matched_end_takes_every_wave() -> None:
    """A damper of the shaft's impedance: nothing comes back to the motor's end."""
    sol = pulse(sw.Damper("end", d=SECTION.impedance))
    arrived = np.abs(sol["line.tau_b"]).max()
    assert arrived == pytest.approx(1.0, rel=1e-12)
    back = sol.t > 5e-4
    assert np.abs(sol["line.omega_a"][back]).max() * SECTION.impedance < 1e-12


def test_a_free_end_reflects_the_torque_with_the_opposite_sign_and_a_clamped_one_with_the_same() -> None:
    """A free end doubles the speed and has no torque; a clamped one doubles the torque and has no speed."""
    clamped, light = pulse(sw.Ground("wall")), pulse(sw.Damper("air", d=1e-9))
    there = np.argmin(np.abs(clamped.t - 3.7e-4))
    assert clamped["line.tau_b"][there] == pytest.approx(2.0, rel=1e-9)
    assert light["line.omega_b"][there] == pytest.approx(2.0 / SECTION.impedance, rel=1e-6)
    back = np.argmin(np.abs(clamped.t - 6.9e-4))
    # at the free motor end the speed is doubled again, with the sign of the reflection
    assert light["line.omega_a"][back] == pytest.approx(2.0 / SECTION.impedance, rel=1e-6)
    assert clamped["line.omega_a"][back] == pytest.approx(-2.0 / SECTION.impedance, rel=1e-6)


@pytest.mark.slow
def test_a_nonlinear_motor_drives_waves() -> None:
    """A Kloss motor with the law of the exact solution, which solves it by its own Newton iteration."""
    net = sw.Network("kloss")
    net.add(sw.KlossMotor("motor", tau_k=30.0, s_k=0.2, n_sync=1500), "m")
    net.add(sw.Inertia("Je", J=0.025), "m")
    net.add(sw.Shaft("line", length=1.0, diameter=0.02, **STEEL, model=sw.Wave()), "m", "l")
    net.add(sw.Inertia("Jm", J=0.11), "l")
    sol = net.simulate(0.1, t_eval=101)
    omega_0 = 1500 * np.pi / 30

    def kloss(_t: np.ndarray, omega: np.ndarray) -> np.ndarray:
        slip = 1 - omega / omega_0
        return 2 * 30.0 * slip * 0.2 / (slip**2 + 0.2**2)

    truth = motion(SectionLine((SECTION,), (0.025, 0.11)), [JunctionTorque(0, kloss, of_speed=True)], 0.1)
    expected = truth.torque_in(0, sol.t, "right")
    assert np.abs(sol["line.tau_b"] - expected).max() < 1e-7 * np.abs(expected).max()


@pytest.mark.slow
def test_two_shafts_of_incommensurate_length_meet_at_a_gear() -> None:
    """Against the spectral model, whose end speeds are good to 1e-7 at degree 16, as those of degree 24 and 32 say."""

    def geared(model: object) -> sw.Solution:
        net = sw.Network("geared")
        net.add(sw.KlossMotor("motor", tau_k=30.0, s_k=0.2, n_sync=1500), "m")
        net.add(sw.Inertia("Je", J=0.025), "m")
        net.add(sw.Shaft("first", length=1.0, diameter=0.02, **STEEL, model=model), "m", "x")
        net.add(sw.Gear("gear", ratio=2.0), "x", "y")
        net.add(sw.Shaft("second", length=np.sqrt(2) / 2, diameter=0.03, **STEEL, model=model), "y", "l")
        net.add(sw.Inertia("Jm", J=0.3), "l")
        return net.simulate(0.05, t_eval=51)

    waves, reference = geared(sw.Wave()), geared(sw.Spectral(16))
    for name in ("Je.omega", "Jm.omega"):
        assert np.abs(waves[name] - reference[name]).max() < 1e-6 * np.abs(reference[name]).max()


@pytest.mark.slow
def test_bearing_friction_is_lumped() -> None:
    """Right for motions slower than the delay: the decay of the lowest mode, not of the wave fronts."""
    waves, reference = (train(model, friction=0.03).simulate(0.2) for model in (sw.Wave(), sw.Spectral(24)))
    assert np.abs(waves["Jm.omega"] - reference["Jm.omega"]).max() < 1e-3 * reference["Jm.omega"].max()


@pytest.mark.slow
@pytest.mark.parametrize(("share", "bound"), [(0.09, 0.006), (0.77, 0.03)])
def test_heavy_bearing_friction_warns_from_where_the_torque_is_half_a_per_cent_off(share: float, bound: float) -> None:
    """Also where it is heavy by a parameter of the run; not in the frequency domain, which has it spread out."""
    friction = {"line.friction": share * SECTION.impedance}
    model = train(sw.Wave(), friction=1e-3).compile()
    with warnings.catch_warnings(record=True) as raised:
        warnings.simplefilter("always")
        waves = model.simulate(0.05, parameters=friction)
    found = [str(each.message) for each in raised if each.category is sw.AccuracyWarning]
    assert len(found) == (share > 0.1)
    assert all("Shaft 'line'" in text and "0.77 of its wave impedance" in text and "Spectral" in text for text in found)
    reference = train(sw.Spectral(24), friction=1e-3).simulate(0.05, parameters=friction)
    assert np.abs(waves["line.tau_b"] - reference["line.tau_b"]).max() < bound * np.abs(reference["line.tau_b"]).max()
    train(sw.Wave(), friction=share * SECTION.impedance).modes(count=3)


def test_a_short_wave_beside_a_nonlinear_load_says_how_many_panels_it_takes() -> None:
    """1 mm of steel is crossed in 0.32 us; the run is ended after a few of the panels."""
    net = sw.Network("short")
    net.add(sw.TorqueSource("motor", tau=10.0), "m")
    net.add(sw.Inertia("Je", J=0.1), "m")
    net.add(sw.Shaft("long", length=1.0, diameter=0.02, **STEEL, model=sw.Wave()), "m", "x")
    net.add(sw.Shaft("short", length=1e-3, diameter=0.02, **STEEL, model=sw.Wave()), "x", "l")
    net.add(sw.Inertia("Jm", J=0.1), "l")
    net.add(sw.CoulombLoad("load", tau=2.0, omega_s=0.01), "l")
    text = r"shaft 'short' in 3\.2e-07 s.*at least 3\.1e\+05 panels.*OneSpring\(\) or Spectral"
    with pytest.warns(sw.NetworkWarning, match=text), pytest.raises(sw.SimulationError, match="5 steps"):
        net.simulate(0.1, max_steps=5)


def test_a_wave_is_no_matrix_whatever_the_point() -> None:
    """Its steady state names twists of the springs in its place."""
    net = train(sw.Wave())
    net.add(sw.ViscousLoad("load", d=0.5), "l")
    model = net.compile()
    for point in (None, model.steady_state()):
        with pytest.raises(sw.SimulationError, match=r"Shaft 'line' is a travelling wave.*net\.modes\(\).*Spectral"):
            model.linearize(point)


def test_another_diameter_needs_no_new_model() -> None:
    model = train(sw.Wave()).compile()
    thick = model.simulate(0.02, parameters={"line.diameter": 0.03}, t_eval=21)
    section = Section.of_geometry(1.0, 0.03, **STEEL)
    truth = motion(SectionLine((section,), (0.025, 0.11)), [JunctionTorque(0, 12.7)], 0.02)
    expected = truth.torque_in(0, thick.t, "left")
    assert np.abs(thick["line.tau_a"] - expected).max() < 1e-8 * np.abs(expected).max()


def test_a_motion_that_goes_on_without_its_waves_says_so() -> None:
    """It had 7504 for 6179 N m, the torque on its way through the shaft left out."""
    net = sw.Network("roll")
    net.add(sw.TorqueSource("motor", tau=3000.0), "a")
    net.add(sw.Inertia("J1", J=4.0), "a")
    net.add(sw.Shaft("s", length=8.0, diameter=0.16, model=sw.Wave()), "a", "b")
    net.add(sw.Inertia("J2", J=60.0), "b")
    first = net.simulate(0.03)
    with pytest.warns(sw.AccuracyWarning, match="without the waves that were on their way"):
        net.simulate(0.04, t_start=0.03, initial={name: first[name][-1] for name in first.states})
    net.simulate(0.04, t_start=0.03)  # from rest there is nothing to be lost


def test_a_turning_shaft_goes_on_turning() -> None:
    sol = train(sw.Wave(), drive=0.0).simulate(0.05, initial={"Je.omega": 20.0, "Jm.omega": 20.0})
    np.testing.assert_allclose(sol["Je.omega"], 20.0, rtol=1e-12)
    np.testing.assert_allclose(sol["line.tau_a"], 0.0, atol=1e-9)
    np.testing.assert_allclose(sol["line.omega"], 20.0, rtol=1e-12)  # also before the first wave has crossed
    np.testing.assert_allclose(sol["line.tau"], 0.0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("given", [{"Je.omega": 1.0}, {"Je.omega": 3.0, "Jm.omega": -1.0}])
def test_a_start_with_unequal_ends_is_that_of_a_fine_mesh(given: dict[str, float]) -> None:
    """Both run straight from end to end, without a front, so polynomials converge: in torques to 2e-7 at degree 32."""
    wave, mesh = (train(m, drive=0.0).simulate(0.05, initial=given) for m in (sw.Wave(), sw.Spectral(32)))
    for name, accuracy in (("Je.omega", 1e-9), ("Jm.omega", 1e-9), ("line.tau_a", 2e-7), ("line.energy", 1e-8)):
        assert np.abs(wave[name] - mesh[name]).max() < accuracy * np.abs(mesh[name]).max(), name


@pytest.mark.filterwarnings("ignore:Shaft 'line'. its bearing friction")
@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_a_steady_state_of_waves_stays(friction: float) -> None:
    net = train(sw.Wave(), drive=10.0, friction=friction)
    net.add(sw.ViscousLoad("load", d=0.5), "l")
    model = net.compile()
    sol = model.simulate(0.05, initial=model.steady_state())
    np.testing.assert_allclose(sol["Jm.omega"], 10.0 / (0.5 + friction), rtol=1e-11)
    np.testing.assert_allclose(sol["line.tau_a"], 10.0, rtol=1e-11)
    np.testing.assert_allclose(sol["line.tau_b"], 10.0 * 0.5 / (0.5 + friction), rtol=1e-11)


@pytest.mark.parametrize("engine", ["scipy", "heyoka", "sundials", "exact", "scipy-radau"])
def test_engines_that_know_no_waves_are_refused(engine: str) -> None:
    with pytest.raises(sw.ParameterError, match=r"knows no travelling waves.*Spectral"):
        train(sw.Wave()).simulate(0.05, engine=engine)


def test_internal_damping_and_waves_exclude_each_other() -> None:
    with pytest.raises(sw.ParameterError, match=r"Shaft 'line': damping = 0\.1 with model=Wave\(\).*Spectral"):
        train(sw.Wave(), damping=0.1)


def test_the_engine_for_waves_is_for_waves_and_names_are_checked_without_states_too() -> None:
    with pytest.raises(sw.ParameterError, match=r"no engine 'wave' here.*is for networks with a shaft of model=Wave"):
        train(sw.Lumped(3)).simulate(0.05, engine="wave")
    net = sw.Network("prescribed")
    net.add(sw.SpeedSource("drive", omega=3.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    with pytest.raises(sw.ParameterError, match="no engine 'nonsense'"):
        net.simulate(1.0, engine="nonsense")


def test_the_laws_at_the_ends_print_impedance_and_what_arrives() -> None:
    latex = train(sw.Wave()).equations().latex(form="kirchhoff")
    line = r"\mathrm{line}"
    assert rf"\tau_{{a,{line}}} &= Z_{{{line}}} \, \omega_{{\mathrm{{e}}}} + h_{{a,{line}}}" in latex
    arrived = rf"h_{{a,{line}}} &= - \left[ 2 \, Z_{{{line}}} \, \omega_{{\mathrm{{m}}}} + h_{{b,{line}}} \right]"
    assert rf"{arrived}_{{t - T_{{{line}}}}}" in latex
    assert rf"T_{{{line}}} &= L_{{{line}}} \, \sqrt{{" in latex


@pytest.mark.filterwarnings("ignore:Shaft 'line'. its bearing friction")
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_the_energy_on_its_way_is_part_of_the_balance(friction: float) -> None:
    """At output times that meet no panel's end, while the shaft winds up; 1e-12 is a thousand panels' rounding."""
    sol = train(sw.Wave(), friction=friction).simulate(0.05, rtol=1e-10, t_eval=777)
    assert sol.energy_residual < 1e-12
    stored = sol["Je.energy"] + sol["line.energy"] + sol["Jm.energy"]
    gap = stored - sol.energy.stored[0]
    power = sol.energy.supplied - sol.energy.lost
    assert (
        np.abs(gap - np.interp(sol.t, sol.energy.t, power)).max() < 1e-4 * stored.max()
    )  # interpolated between panels


@pytest.mark.slow
def test_the_energy_of_waves_equals_that_of_a_fine_mesh() -> None:
    wave, mesh = (train(model).simulate(0.05, rtol=1e-10, t_eval=101) for model in (sw.Wave(), sw.Spectral(24)))
    assert np.abs(wave["line.energy"] - mesh["line.energy"]).max() < 1e-5 * mesh["line.energy"].max()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::shaftwork.AccuracyWarning")
def test_energy_is_kept_over_a_hundred_thousand_periods() -> None:
    """Of the first mode, 8e6 delays; bar 3 asks 1e-9."""
    periods = 1e5 / 38.88573365
    times = np.append(np.linspace(0.1, 0.2, 5), np.linspace(0.3, 1, 5) * periods)
    net = train(sw.Wave(), drive=sympy.Piecewise((12.7, sw.t < 0.1), (0, True)))
    sol = net.simulate(1.01 * periods, t_eval=times, rtol=1e-6)
    stored = sol["Je.energy"] + sol["line.energy"] + sol["Jm.energy"]
    np.testing.assert_allclose(stored, stored[0], rtol=1e-9)


@pytest.mark.slow
def test_waves_that_are_not_resolved_any_more_say_so() -> None:
    net = train(sw.Wave(), drive=sympy.Piecewise((12.7, sw.t < 0.1), (0, True)))
    with pytest.warns(sw.AccuracyWarning, match=r"delays the modes have run out of step.*of the largest wave is not"):
        net.simulate(300.0, t_eval=41, rtol=1e-10)


def beside(part: sw.Component, *nodes: str, model: object = None) -> sw.Network:
    net = train(sw.Wave() if model is None else model)
    net.add(sw.Inertia("J3", J=0.05), "x")
    net.add(sw.Spring("s", c=100.0, d=0.1), "l", "x")
    net.add(part, *nodes)
    return net


@pytest.mark.slow
def test_modes_beside_a_wave_are_those_of_the_phase_that_goes_on_at_the_point() -> None:
    """Stuck at rest, as at a wall; slipping, with a constant torque, as if nothing were there."""
    net = beside(sw.CoulombLoad("load", tau=2.0), "l")
    stuck, slips = net.modes(count=3), net.modes(at={"Jm.omega": 1.0, "Je.omega": 1.0, "J3.omega": 1.0}, count=3)
    clamped, free = beside(sw.Ground("wall"), "l").modes(count=3), beside(sw.Damper("none", d=0.0), "l").modes(count=3)
    assert stuck.rates == pytest.approx(clamped.rates, rel=1e-9)
    assert slips.rates == pytest.approx(free.rates, rel=1e-9, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    "part",
    [
        sw.Freewheel("part"),
        sw.Backlash("part", gap=0.01),
        sw.Brake("part", tau=5.0, t_on=0.1),
        sw.Brake("part", tau=1.0, on=sw.omega - 3),
        sw.BLDCMotor("part", U=50.0, R=1.0, L=1e-3, k=0.1),
    ],
    ids=["freewheel", "rigid gap", "timed brake", "brake by speed", "inverter"],
)
def test_parts_that_change_their_mode_beside_a_wave_are_as_beside_its_mesh(part: sw.Component) -> None:
    nodes, times = ("l", "x") if len(part.ports) > 1 else ("l",), np.linspace(0, 0.15, 76)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        wave = beside(part, *nodes).simulate(0.15, t_eval=times)
    mesh = beside(part, *nodes, model=sw.Spectral(16)).simulate(0.15, t_eval=times)
    for name in ("Jm.omega", "J3.omega"):
        assert np.abs(wave[name] - mesh[name]).max() < 2e-5 * np.abs(mesh[name]).max()
    assert wave.energy_residual < 1e-9


def test_phases_beside_a_wave_have_equations_of_their_own() -> None:
    net = beside(sw.CoulombLoad("load", tau=2.0), "l")
    assert net.start_phase() == "load stuck"
    assert net.equations(phase="load stuck").phase == "load stuck"
    assert net.compile().phase("load stuck").states == ("Je.omega", "J3.omega", "s.tau_c")


def test_a_shaft_without_bearing_friction_warns_of_none_however_thin_it_is() -> None:
    net = sw.Network("wire")
    net.add(sw.TorqueSource("m", tau=1e-6), "a")
    net.add(sw.Inertia("J1", J=1e-9), "a")
    net.add(sw.Shaft("wire", length=1.0, diameter=1e-3, model=sw.Wave()), "a", "b")
    net.add(sw.Inertia("J2", J=1e-9), "b")
    assert net.simulate(1e-3).energy_residual < 1e-9


def test_modes_of_a_line_of_a_circuit_are_refused_with_what_to_take() -> None:
    net = sw.Network("line")
    net.add(sw.VoltageSource("source", u=1.0), "in", "g")
    net.add(sw.Resistor("R", R=50.0), "in", "a")
    net.add(sw.TransmissionLine("line", Z_0=50.0, delay=1e-3), "a", "b")
    net.add(sw.Capacitor("end", C=1e-6), "b", "g")
    net.add(sw.Ground("frame"), "g")
    with pytest.raises(sw.SimulationError, match=r"TransmissionLine 'line' has a delay .* Take n inductors"):
        net.modes()
