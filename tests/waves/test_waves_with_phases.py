"""Parts that change their mode beside travelling waves: friction that sticks, freewheels, gaps, brakes, lossy gears.

A wave with a damper of its impedance at the far end brings back nothing, so it is a damper to whatever is at its near
end, and a torque on the far end comes a delay later. So the same train with dampers in place of the waves, and the
torque put off, is the exact reference. Where waves come back, the spectral model of growing degree is one.
"""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from scipy.optimize import brentq

import shaftwork as sw
from tests.reference.drill_string import String, motion

STEEL = {"diameter": 0.02, "density": 7900.0, "shear_modulus": 77.5e9}
Z = np.pi * 0.02**4 / 32 * np.sqrt(7900.0 * 77.5e9)
DELAY = 2.0 * np.sqrt(7900.0 / 77.5e9)


def pulse(high: float, low: float, until: float, delay: float = 0.0) -> sympy.Expr:
    return sympy.Piecewise((0, sw.t < delay), (high, sw.t < until + delay), (low, True))


def matched(tau: sympy.Expr, *parts: tuple[sw.Component, ...]) -> sw.Network:
    """Two inertias behind waves with ends that take everything; the parts are at them or between them."""
    net = sw.Network("matched")
    net.add(sw.TorqueSource("motor", tau=tau), "m")
    net.add(sw.Damper("before", d=Z), "m")
    net.add(sw.Shaft("first", length=2.0, **STEEL, model=sw.Wave()), "m", "a")
    net.add(sw.Inertia("J1", J=0.02), "a")
    net.add(sw.Inertia("J2", J=0.05), "b")
    net.add(sw.Shaft("second", length=1.37, **STEEL, model=sw.Wave()), "b", "e")
    net.add(sw.Damper("behind", d=Z), "e")
    for part, *nodes in parts:
        net.add(part, *nodes)
    return net


def damped(tau: sympy.Expr, *parts: tuple[sw.Component, ...]) -> sw.Network:
    """The same with dampers in place of the waves."""
    net = sw.Network("damped")
    net.add(sw.TorqueSource("motor", tau=tau), "a")
    net.add(sw.Damper("first", d=Z), "a")
    net.add(sw.Inertia("J1", J=0.02), "a")
    net.add(sw.Inertia("J2", J=0.05), "b")
    net.add(sw.Damper("second", d=Z), "b")
    for part, *nodes in parts:
        net.add(part, *nodes)
    return net


def test_friction_at_the_end_of_a_wave_sticks_slips_and_sticks_as_the_closed_form_says() -> None:
    """J omega' = T - Z omega - tau_c from when the front comes, then -Z omega - tau_c, up to the stop."""
    tau, rubs, J, until = 40.0, 12.0, 0.02, 2e-3
    net = sw.Network("bit")
    net.add(sw.TorqueSource("motor", tau=pulse(tau, 0.0, until)), "m")
    net.add(sw.Damper("before", d=Z), "m")
    net.add(sw.Shaft("line", length=2.0, **STEEL, model=sw.Wave()), "m", "a")
    net.add(sw.Inertia("J1", J=J), "a")
    net.add(sw.DryFriction("rock", tau_c=rubs), "a")
    sol = net.simulate(0.01, t_eval=301)
    fastest = (tau - rubs) / Z * (1 - np.exp(-Z * until / J))
    stops = DELAY + until + J / Z * np.log(1 + fastest * Z / rubs)
    assert sol.engine == "wave"
    assert [event[1:] for event in sol.events] == [
        ("rock", "stuck", "slipping forward"),
        ("rock", "slipping forward", "stuck"),
    ]
    np.testing.assert_allclose([event[0] for event in sol.events], [DELAY, stops], rtol=1e-9)
    driven, late = np.clip(sol.t - DELAY, 0, until), np.clip(sol.t - DELAY - until, 0, stops - DELAY - until)
    expected = (tau - rubs) / Z * (1 - np.exp(-Z * driven / J))
    expected = (expected + rubs / Z) * np.exp(-Z * late / J) - rubs / Z
    np.testing.assert_allclose(sol["J1.omega"], expected, atol=1e-8 * fastest)
    assert (sol["J1.omega"][sol.t > stops] == 0).all()
    assert sol.energy_residual < 1e-12
    times = np.array([row.end for row in sol.phases])
    np.testing.assert_allclose(times, [DELAY, stops, 0.01], rtol=1e-9)


PARTS = {
    "friction": (
        (sw.DryFriction("part", tau_c=8.0, tau_s=12.0, omega_s=0.4), "b"),
        (sw.Spring("s", c=5000.0, d=0.1), "a", "b"),
    ),
    "freewheel": ((sw.Freewheel("part"), "a", "b"),),
    "rigid gap": ((sw.Backlash("part", gap=2e-3, restitution=0.6), "a", "b"),),
    "plastic gap": ((sw.Backlash("part", gap=2e-3), "a", "b"),),
    "elastic gap": ((sw.Backlash("part", gap=2e-3, c=5e4, d=3.0), "a", "b"),),
    "clutch": ((sw.Clutch("part", tau=15.0, t_on=2.5e-3, t_off=9e-3), "a", "b"),),
    "brake": ((sw.Brake("part", tau=9.0, on=sw.omega - 1.0), "a"), (sw.Spring("s", c=500.0, d=0.1), "a", "b")),
    "stop": ((sw.HardStop("part", upper=1e-3, restitution=0.5), "b"), (sw.Spring("s", c=5000.0, d=0.1), "a", "b")),
    "lossy gear": ((sw.LossyGear("part", ratio=1.5, efficiency=0.8, efficiency_back=0.6), "a", "b"),),
}


@pytest.mark.parametrize("name", PARTS)
def test_a_part_that_changes_its_mode_between_waves_is_as_between_dampers(name: str) -> None:
    parts = PARTS[name]
    times = np.linspace(0, 0.02, 201)
    wave = matched(pulse(30.0, -20.0, 6e-3), *parts).simulate(0.02, t_eval=times)
    truth = damped(pulse(30.0, -20.0, 6e-3, DELAY), *parts).simulate(0.02, t_eval=times, rtol=1e-11)
    assert wave.engine == "wave"
    assert [event[1:] for event in wave.events] == [event[1:] for event in truth.events]
    np.testing.assert_allclose(
        [event[0] for event in wave.events], [event[0] for event in truth.events], rtol=1e-7, atol=1e-10
    )
    for quantity in ("J1.omega", "J2.omega"):
        np.testing.assert_allclose(wave[quantity], truth[quantity], atol=1e-7 * np.abs(truth[quantity]).max())
    assert wave.energy_residual < 1e-9


def stick_slip(model: object, prefix: str = "", *, turned: bool = False) -> sw.Network:
    """A drive that swings, a shaft whose waves come back, and friction that sticks twice in a period."""
    net = sw.Network("stick-slip")
    parts: list[tuple[sw.Component, ...]] = [
        (sw.TorqueSource(prefix + "motor", tau=30.0 * sympy.sin(60.0 * sw.t)), "m"),
        (sw.Inertia(prefix + "Je", J=0.025), "m"),
        (sw.Shaft(prefix + "line", length=1.0, **STEEL, model=model), "m", "l"),
        (sw.Inertia(prefix + "Jm", J=0.11), "l"),
        (sw.DryFriction(prefix + "f", tau_c=12.0, tau_s=20.0, omega_s=1.0), "l"),
    ]
    for part, *nodes in reversed(parts) if turned else parts:
        net.add(part, *nodes)
    return net


@pytest.mark.slow
def test_stick_slip_on_a_wave_is_what_the_spectral_model_converges_to() -> None:
    times = np.linspace(0, 0.2, 301)
    wave = stick_slip(sw.Wave()).simulate(0.2, t_eval=times)
    errors = []
    for degree in (8, 16, 24):
        mesh = stick_slip(sw.Spectral(degree)).simulate(0.2, t_eval=times)
        assert [event[1:] for event in mesh.events] == [event[1:] for event in wave.events]
        errors.append(np.abs(mesh["Jm.omega"] - wave["Jm.omega"]).max() / np.abs(wave["Jm.omega"]).max())
    assert errors[2] < errors[1] < errors[0]
    assert errors[2] < 3e-8
    assert wave.energy_residual < 1e-10


def test_a_motion_that_goes_on_in_any_phase_is_the_motion_in_one_run() -> None:
    model, times = stick_slip(sw.Wave()).compile(), np.linspace(0, 0.16, 161)
    whole = model.simulate(0.16, t_eval=times)
    for place in (30, 70, 110):  # slipping, stuck, slipping backward
        before = model.simulate(times[place], t_eval=times[: place + 1])
        after = model.simulate(0.16, initial=before, t_eval=times[place:])
        for quantity in ("Jm.omega", "line.tau_b", "line.tau"):
            np.testing.assert_allclose(after[quantity], whole[quantity][place:], rtol=0, atol=1e-8)
        assert len(before.events) + len(after.events) == len(whole.events)


def test_names_and_the_order_of_parts_change_nothing() -> None:
    plain, other = (
        net.simulate(0.12, t_eval=61) for net in (stick_slip(sw.Wave()), stick_slip(sw.Wave(), "z ", turned=True))
    )
    np.testing.assert_allclose(other["z Jm.omega"], plain["Jm.omega"], atol=1e-9)
    np.testing.assert_allclose(other["z line.tau"], plain["line.tau"], atol=1e-7)


def test_the_energy_on_its_way_and_the_profile_go_through_events() -> None:
    sol = stick_slip(sw.Wave()).simulate(0.1, t_eval=401)
    stored = sol["Je.energy"] + sol["line.energy"] + sol["Jm.energy"]
    given = np.concatenate(
        [[0], np.cumsum(np.diff(sol.t) / 2 * ((p := -sol["motor.power"] - sol["f.power"])[1:] + p[:-1]))]
    )
    assert np.abs(stored - given).max() < 2e-3 * stored.max()  # the trapezoidal rule
    np.testing.assert_allclose(sol["line.tau"][:, 0], sol["line.tau_a"], atol=1e-6)
    np.testing.assert_allclose(sol["line.omega"][:, -1], sol["Jm.omega"], atol=1e-6)


def test_a_steady_operation_beside_a_wave_knows_the_phases() -> None:
    net = sw.Network("steady")
    net.add(sw.TorqueSource("motor", tau=30.0), "m")
    net.add(sw.Inertia("Je", J=0.025), "m")
    net.add(sw.Shaft("line", length=1.0, **STEEL, model=sw.Wave()), "m", "l")
    net.add(sw.Inertia("Jm", J=0.11), "l")
    net.add(sw.DryFriction("f", tau_c=12.0, d=0.5), "l")
    model = net.compile()
    steady = model.steady_state()
    assert steady["Jm.omega"] == pytest.approx(18.0 / 0.5)
    stays = model.simulate(5e-3, initial=steady)
    np.testing.assert_allclose(stays["Jm.omega"], 36.0, rtol=1e-10)
    np.testing.assert_allclose(stays["line.tau"], 30.0, rtol=1e-9)
    assert stays.phases[0].modes == {"f": "slipping forward"}


def drill_string(model: object) -> sw.Network:
    """3 km of drill pipe between a top drive with a speed controller and a bit with Stribeck friction."""
    net = sw.Network("drill string")
    speed = 5.0 * sympy.Min(1, sw.t / 10)
    net.add(sw.SpeedController("top drive", omega_ref=speed, k_p=1000.0, t_i=5.0), "top")
    net.add(sw.Inertia("J_top", J=2000.0), "top")
    net.add(sw.Shaft("pipe", length=3000.0, diameter=0.127, inner_diameter=0.108, model=model), "top", "bit")
    net.add(sw.Inertia("J_bit", J=300.0), "bit")
    net.add(sw.DryFriction("rock", tau_c=5000.0, tau_s=8000.0, omega_s=1.0), "bit")
    return net


@pytest.mark.parametrize(("rtol", "bound"), [(1e-6, 1e-7), (1e-8, 1e-9), (1e-10, 1e-10)])
def test_a_drill_string_sticks_and_slips_as_the_method_of_steps_says(rtol: float, bound: float) -> None:
    """Over two cycles, against scipy with Chebyshev interpolants of what has left the ends."""
    polar = np.pi * (0.127**4 - 0.108**4) / 32
    reference = String(
        Z=polar * np.sqrt(7850.0 * 79.3e9),
        T=3000.0 * np.sqrt(7850.0 / 79.3e9),
        J_top=2000.0,
        J_bit=300.0,
        k_p=1000.0,
        t_i=5.0,
        omega_ref=5.0,
        t_ramp=10.0,
        tau_c=5000.0,
        tau_s=8000.0,
        omega_s=1.0,
    )
    stops, times, speeds = motion(reference, 28.0)
    t, first = np.unique(times, return_index=True)
    sol = drill_string(sw.Wave()).simulate(28.0, t_eval=t, rtol=rtol)
    assert [event[3] == "stuck" for event in sol.events] == [stop.sticks for stop in stops]
    assert len(stops) == 4
    np.testing.assert_allclose([event[0] for event in sol.events], [stop.time for stop in stops], rtol=bound)
    assert np.abs(sol["J_bit.omega"] - speeds[first]).max() < bound * speeds.max()
    assert sol.energy_residual < 1e-10


def at_a_bare_end(part: sw.Component, tau: sympy.Expr) -> sw.Network:
    """A wave with a part and nothing else at its far end."""
    net = sw.Network("bare end")
    net.add(sw.TorqueSource("motor", tau=tau), "m")
    net.add(sw.Damper("before", d=Z), "m")
    net.add(sw.Shaft("line", length=2.0, **STEEL, model=sw.Wave()), "m", "e")
    net.add(part, "e")
    return net


def test_friction_at_a_node_without_inertia_is_a_load_on_the_impedance_alone() -> None:
    """Z omega = T(t - delay) - tau_c sign(omega) where the torque exceeds tau_c, and nothing moves elsewhere."""
    tau, rubs, frequency = 20.0, 12.0, 300.0
    drive, times = tau * sympy.sin(frequency * sw.t), np.linspace(0, 0.03, 301)
    sol = at_a_bare_end(sw.DryFriction("rock", tau_c=rubs), drive).simulate(0.03, t_eval=times)
    came = np.where(times > DELAY, tau * np.sin(frequency * (times - DELAY)), 0.0)
    expected = np.sign(came) * np.maximum(np.abs(came) - rubs, 0) / Z
    np.testing.assert_allclose(sol["e.omega"], expected, atol=1e-7 * tau / Z)
    slips = [event[0] for event in sol.events if event[3].startswith("slipping")]
    np.testing.assert_allclose(
        np.sin(frequency * (np.array(slips) - DELAY)), rubs / tau * np.array([1, -1, 1]), rtol=1e-7
    )
    assert sol.energy_residual < 1e-9


def test_a_motor_at_a_node_without_inertia_is_solved_with_the_wave() -> None:
    """Z omega = T(t - delay) + tau(omega), at each instant by itself."""
    tau, frequency, times = 0.4, 300.0, np.linspace(0, 0.02, 101)
    motor = sw.KlossMotor("motor b", tau_k=0.3, s_k=0.4, n_sync=60)
    net = at_a_bare_end(motor, tau * sympy.sin(frequency * sw.t))
    with pytest.raises(sw.NetworkError, match="algebraic loop"):
        net.compile()
    sol = net.simulate(0.02, t_eval=times, algebraic_loops="solve")

    def left(omega: float, came: float) -> float:
        slip = 1 - omega / (2 * np.pi)
        return Z * omega - came - 2 * 0.3 * slip * 0.4 / (slip**2 + 0.4**2)

    came = np.where(times > DELAY, tau * np.sin(frequency * (times - DELAY)), 0.0)
    expected = [brentq(left, -50, 50, args=(each,), xtol=1e-12) for each in came.tolist()]
    np.testing.assert_allclose(sol["e.omega"], expected, atol=1e-7)
    assert sol.energy_residual < 1e-9


def test_a_brake_that_time_switches_within_one_delay_is_not_missed() -> None:
    """Nothing moves but the time, ten times faster than a wave runs along 300 m."""
    net = sw.Network("pulsed")
    net.add(sw.TorqueSource("motor", tau=1e-3), "m")
    net.add(sw.Shaft("line", length=300.0, **STEEL, model=sw.Wave()), "m", "a")
    net.add(sw.Inertia("J1", J=0.02), "a")
    net.add(sw.Brake("brake", tau=5.0, on=sympy.sin(600.0 * sw.t) - 0.999), "a")
    sol = net.simulate(0.05)
    assert sol.events[0][0] == pytest.approx(np.arcsin(0.999) / 600, rel=1e-9)


def test_a_freewheel_between_bare_ends_of_waves_passes_on_what_pushes_forward() -> None:
    """Locked, both impedances carry T, so omega = T / 2 Z; free, the first one carries it alone."""
    tau, frequency, times = 20.0, 300.0, np.linspace(0, 0.03, 301)
    net = sw.Network("bare freewheel")
    net.add(sw.TorqueSource("motor", tau=tau * sympy.sin(frequency * sw.t)), "m")
    net.add(sw.Damper("before", d=Z), "m")
    net.add(sw.Shaft("first", length=2.0, **STEEL, model=sw.Wave()), "m", "a")
    net.add(sw.Freewheel("wheel"), "a", "b")
    net.add(sw.Shaft("second", length=1.37, **STEEL, model=sw.Wave()), "b", "e")
    net.add(sw.Damper("behind", d=Z), "e")
    sol = net.simulate(0.03, t_eval=times)
    came = np.where(times > DELAY, tau * np.sin(frequency * (times - DELAY)), 0.0)
    np.testing.assert_allclose(sol["b.omega"], np.maximum(came, 0) / (2 * Z), atol=1e-7 * tau / Z)
    np.testing.assert_allclose(sol["a.omega"], np.where(came > 0, came / 2, came) / Z, atol=1e-7 * tau / Z)
    assert sol.energy_residual < 1e-9


def test_what_takes_matrices_refuses_a_wave_with_phases_by_name() -> None:
    net = stick_slip(sw.Wave())
    for verb in (net.compile().linearize, lambda: sw.studies.frequency_sensitivities(net)):
        with pytest.raises(sw.SimulationError, match="'line' is a travelling wave"):
            verb()


@pytest.mark.parametrize("share", [1.0, 0.999])
def test_a_friction_that_holds_just_what_arrives_is_followed(share: float) -> None:
    """Its guard rests at the limit, but for rounding, until the next front comes: from rest, 2 Z 5 rad/s of torque."""
    steel = {"length": 1.0, "diameter": 0.02, "density": 7900.0, "shear_modulus": 77.5e9}
    impedance = 7900.0 * np.pi * 0.02**4 / 32 * (77.5e9 / 7900.0) ** 0.5
    net = sw.Network("limit")
    net.add(sw.SpeedSource("drive", omega=5.0), "a")
    net.add(sw.Shaft("line", **steel, model=sw.Wave()), "a", "b")
    net.add(sw.DryFriction("rubs", tau_c=share * 2.0 * impedance * 5.0), "b")
    delay = 1.0 / (77.5e9 / 7900.0) ** 0.5
    sol = net.simulate(2.5 * delay, t_eval=[1.5 * delay, 2.5 * delay])
    np.testing.assert_allclose(sol["b.omega"], (1.0 - share) * 10.0, rtol=0, atol=1e-9)


def test_friction_that_falls_faster_than_waves_resist_is_refused_at_a_node_without_inertia() -> None:
    """Several speeds go with what arrives then; Newton's method jumped to one at which the friction drove."""
    steel = {"diameter": 0.02, "density": 7900.0, "shear_modulus": 77.5e9, "model": sw.Wave()}
    net = sw.Network("falling")
    net.add(sw.TorqueSource("m", tau=5.0), "a")
    net.add(sw.Inertia("J", J=0.01), "a")
    net.add(sw.Shaft("first", length=1.0, **steel), "a", "b")
    net.add(sw.DryFriction("rubs", tau_c=3.0, tau_s=5.0, omega_s=1.0), "b")
    net.add(sw.Shaft("second", length=0.61, **steel), "b", "d")
    net.add(sw.Inertia("K", J=0.004), "d")
    net.add(sw.Damper("bearing", d=1.0), "d")
    with pytest.raises(sw.SimulationError, match=r"'rubs': the torque falls faster .* Give the node an inertia"):
        net.simulate(0.01, algebraic_loops="solve")
    gentle = net.compile(algebraic_loops="solve").simulate(0.01, parameters={"rubs.omega_s": 10.0})
    assert (gentle["rubs.omega"] * gentle["rubs.tau"]).min() >= 0.0
