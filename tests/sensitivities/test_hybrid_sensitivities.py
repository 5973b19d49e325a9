"""Sensitivities through changes of mode, impacts and switches: closed forms, and central differences of other runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.results.measures import Measure
from shaftwork.sensitivities.sensitivity_tables import MotionSensitivities
from shaftwork.studies import motion_sensitivities

STEP = 2e-5
"""Of a parameter, relative, so small that no other event comes; extrapolated differences err by 1e-9 and less."""
CLOSE = 1e-6
"""Percent of a measure for a percent of a parameter: what the issue asks for."""
CRANE = ("max shaft.tau", "min shaft.tau", "mean shaft.tau", "rms shaft.tau", "peak load.tau")


def assert_differences(
    net: sw.Network,
    measures: Sequence[str],
    t_end: float,
    parameters: Sequence[str],
    *,
    step: float = STEP,
    order: int = 2,
    close: float = CLOSE,
    **options: object,
) -> MotionSensitivities:
    """Compare with central differences of independent runs, extrapolated for errors of the given order."""
    made = motion_sensitivities(net, measures, t_end=t_end, parameters=parameters, **options)  # type: ignore[arg-type]
    model, readers = net.compile(), [Measure.read(text) for text in measures]
    sizes = np.array([abs(value) or 1.0 for value in made.measures.values()])

    def of(name: str, value: float) -> np.ndarray:
        run = model.simulate(t_end, parameters={name: value}, rtol=1e-13, t_eval=2, **options)  # type: ignore[arg-type]
        return np.array([reader.of(run) for reader in readers])

    for name, value in made.parameters.items():
        near, far = ((of(name, value * (1 + h)) - of(name, value * (1 - h))) / (2 * h) for h in (step / 2, step))
        expected = near + (near - far) / (2**order - 1)
        found = value * np.array([made[text][name] for text in measures])
        np.testing.assert_allclose(found / sizes, expected / sizes, rtol=close, atol=close, err_msg=name)
    return made


@pytest.mark.slow
def test_the_start_of_the_crane_equals_central_differences() -> None:
    """The load breaks loose; the first peak is 1.0 percent higher for a pull-out torque that is 1 percent higher."""
    names = ("motor.tau_k", "motor.s_k", "J2.J", "shaft.c", "load.tau")
    assert_differences(sw.scenes.crane_start(), (*CRANE, "end J2.omega"), 2.0, names)


@pytest.mark.slow
def test_all_phases_of_the_crane_equal_central_differences() -> None:
    """Gap, contact, breaking loose, braking, ringing down: ten seconds with all parts that change their mode."""
    assert_differences(sw.scenes.six_phases(), CRANE, 10.0, ("shaft.gap",), step=5e-6)


@pytest.mark.slow
def test_switches_that_come_together_count_one_by_one() -> None:
    """The motor goes off as the brake comes on: a parameter that parts them is smooth to the first order alone."""
    assert_differences(sw.scenes.crane(), CRANE[1:], 10.0, ("motor.t_off",), step=1e-6, order=1)


def oscillator(**friction: float) -> sw.Network:
    net = sw.Network("oscillator")
    net.add(sw.Inertia("J", J=2.0), "a")
    net.add(sw.Spring("s", c=200.0), "a", "ground")
    net.add(sw.DryFriction("f", tau_c=5.0, **friction), "a")
    return net


def test_an_oscillator_with_dry_friction_is_the_closed_form() -> None:
    """By energy, c A = -tau + sqrt(tau^2 + c J v^2), and each half swing takes 2 tau; then it sticks."""
    v, held = 4.0, 5.0
    made = motion_sensitivities(
        oscillator(), ["max s.tau", "min s.tau", "end s.tau"], t_end=3.0, initial={"J.omega": v}
    )
    tau, c, J = sympy.symbols("tau c J", positive=True)
    at = {tau: held, c: 200.0, J: 2.0}
    first = -tau + sympy.sqrt(tau**2 + c * J * v**2)
    rest = first
    while abs(rest.subs(at)) > held:
        rest = -rest + sympy.sign(rest.subs(at)) * 2 * tau
    turns = {"max s.tau": first, "min s.tau": -(first - 2 * tau), "end s.tau": rest}
    for measure, closed in turns.items():
        assert made.measures[measure] == pytest.approx(float(closed.subs(at)), rel=1e-9)
        for name, symbol in (("f.tau_c", tau), ("s.c", c), ("J.J", J)):
            expected = float(closed.diff(symbol).subs(at))
            assert made[measure][name] == pytest.approx(expected, rel=1e-8, abs=1e-8), (measure, name)


@pytest.mark.slow
def test_stribeck_friction_equals_central_differences() -> None:
    net = oscillator(tau_s=6.0, omega_s=0.5)
    names = ("f.tau_c", "f.tau_s", "f.omega_s", "s.c")
    assert_differences(net, ["end s.tau", "mean s.tau"], 1.2, names, initial={"J.omega": 10.0})


def test_a_rebound_is_the_closed_form() -> None:
    """Driven against a stop by a constant torque: flights of 2 e^k v J / tau between hits at e^k v."""
    net = sw.Network("bounce")
    net.add(sw.TorqueSource("T", tau=10.0), "a")
    net.add(sw.Inertia("J", J=2.0), "a")
    net.add(sw.HardStop("stop", upper=0.4, restitution=0.6, omega_rest=1e-3), "a")
    h, e, J, tau = sympy.symbols("h e J tau", positive=True)
    at = {h: 0.4, e: 0.6, J: 2.0, tau: 10.0}
    first, v, hits, end = sympy.sqrt(2 * h * J / tau), sympy.sqrt(2 * h * tau / J), 4, 1.4
    last = first + 2 * v * J / tau * sum(e**k for k in range(1, hits))
    speed = -(e**hits) * v + tau / J * (end - last)
    twist = h - e**hits * v * (end - last) + tau / J * (end - last) ** 2 / 2
    assert float(last.subs(at)) < end < float((last + 2 * e**hits * v * J / tau).subs(at))
    made = motion_sensitivities(net, ["end J.omega", "end stop.phi"], t_end=end)
    for measure, closed in {"end J.omega": speed, "end stop.phi": twist}.items():
        assert made.measures[measure] == pytest.approx(float(closed.subs(at)), rel=1e-8)
        for name, symbol in (("stop.upper", h), ("stop.restitution", e), ("J.J", J), ("T.tau", tau)):
            assert made[measure][name] == pytest.approx(float(closed.diff(symbol).subs(at)), rel=1e-7), (measure, name)


def flanks(J: float, restitution: float, **rest: float) -> sw.Network:
    """An inertia that a torque drives against another one until both are at rest to each other."""
    net = sw.Network("flanks")
    net.add(sw.TorqueSource("T", tau=3.0), "a")
    net.add(sw.Inertia("J1", J=J), "a")
    net.add(sw.Backlash("g", gap=0.1, restitution=restitution, **rest), "a", "b")
    net.add(sw.Inertia("J2", J=1.4), "b")
    return net


def assert_momentum_is_kept(omega_rest: float, t: float) -> None:
    """Impacts keep it, whenever they are: omega = T t / (J1 + J2), to the roundings of two dozen of them."""
    T, J1, J2 = 3.0, 0.6, 1.4
    made = motion_sensitivities(flanks(J1, 0.5, omega_rest=omega_rest), ["end J2.omega"], t_end=t)["end J2.omega"]
    assert made["J1.J"] == pytest.approx(-T * t / (J1 + J2) ** 2, rel=1e-9)
    assert made["J2.J"] == pytest.approx(-T * t / (J1 + J2) ** 2, rel=1e-9)
    assert made["T.tau"] == pytest.approx(t / (J1 + J2), rel=1e-9)
    assert made["g.restitution"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("omega_rest", [1e-4, 1e-6, 1e-7])
def test_flanks_that_come_to_rest_pass_on_the_derivative_of_their_momentum(omega_rest: float) -> None:
    assert_momentum_is_kept(omega_rest, 1.5)


def test_impacts_of_flanks_that_hardly_move_pass_on_the_derivative_of_their_momentum() -> None:
    """The last ones are found so late that a run so short does not go back to the limit for them."""
    with pytest.warns(sw.AccuracyWarning, match="hardly moving any more"):
        assert_momentum_is_kept(1e-7, 0.45)


@pytest.mark.slow
def test_a_spring_behind_flanks_that_come_to_rest_equals_central_differences() -> None:
    net = flanks(0.1, 0.65)
    net.add(sw.Spring("S", c=90.0, d=1.2), "b", "c")
    net.add(sw.Inertia("J3", J=4.0), "c")
    assert_differences(net, ["max S.tau", "rms S.tau"], 1.5, ("J1.J", "J2.J", "g.gap"), close=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_impacts_of_geared_inertias_equal_central_differences(restitution: float) -> None:
    """Behind the gear is an inertia that is no state, and a load that breaks loose."""
    net = sw.Network("bump")
    net.add(sw.TorqueSource("T", tau=10.0), "a")
    net.add(sw.Inertia("A", J=1.0), "a")
    net.add(sw.Backlash("gap", gap=0.2, restitution=restitution, omega_rest=1e-3), "a", "b")
    net.add(sw.Gear("first", ratio=0.5), "b", "e")
    net.add(sw.Inertia("B", J=0.5), "e")
    net.add(sw.Spring("s", c=50.0, d=0.5), "e", "c")
    net.add(sw.Gear("g", ratio=2.0), "c", "d")
    net.add(sw.Inertia("C", J=3.0), "d")
    net.add(sw.CoulombLoad("load", tau=2.0), "d")
    names = ("gap.gap", "B.J", "g.ratio", "first.ratio", "load.tau", *(["gap.restitution"] if restitution else []))
    assert_differences(net, ["max s.tau", "end B.omega", "end C.omega", "rms s.tau"], 0.45, names)


@pytest.mark.slow
def test_impacts_through_a_gear_that_rubs_equal_central_differences() -> None:
    """Torques pass it otherwise than speeds do, so an impact is no longer the least change."""
    net = sw.Network("lossy")
    net.add(sw.TorqueSource("T", tau=10.0), "a")
    net.add(sw.Inertia("A", J=1.0), "a")
    net.add(sw.Backlash("gap", gap=0.2, restitution=0.3, omega_rest=1e-2), "a", "b")
    net.add(sw.Inertia("B", J=0.4), "b")
    net.add(sw.LossyGear("g", ratio=3.0, efficiency=0.8), "b", "c")
    net.add(sw.Inertia("C", J=2.0), "c")
    net.add(sw.DryFriction("f", tau_c=3.0), "c")
    assert_differences(net, ["end C.omega", "rms C.omega"], 0.6, ("gap.restitution", "g.ratio", "g.efficiency"))


def test_a_motor_that_is_switched_off_later_gives_its_torque_for_so_much_longer() -> None:
    """Without load: the speed at the end is that at t_off, and grows by tau / J."""
    net = sw.Network("coasting")
    net.add(sw.KlossMotor("motor", tau_k=10.0, s_k=0.2, n_sync=1500, t_off=0.5), "a")
    net.add(sw.Inertia("J", J=0.5), "a")
    made = motion_sensitivities(net, ["end J.omega"], t_end=1.0, parameters=("motor.t_off",))
    torque = net.simulate(1.0, t_eval=[np.nextafter(0.5, 0.0), 1.0])["motor.tau"]
    assert torque[0] > 1.0
    assert torque[1] == 0.0
    assert made["end J.omega"]["motor.t_off"] == pytest.approx(torque[0] / 0.5, rel=1e-7)


@pytest.mark.slow
def test_derivatives_of_a_tiny_motion_are_those_of_a_large_one() -> None:
    """The motion goes with the torque, and so do its derivatives by all that is no torque."""

    def by_inertia(tau: float) -> float:
        net = sw.Network("swing")
        net.add(sw.TorqueSource("pull", tau=tau), "a")
        net.add(sw.Inertia("J", J=2.0), "a")
        net.add(sw.Spring("s", c=200.0, d=1.0), "a", "ground")
        net.add(sw.FanLoad("fan", tau_n=1e-3 / tau, n_n=100.0), "a")
        made = motion_sensitivities(net, ["end J.omega"], t_end=3.0, parameters=("J.J",))
        return made["end J.omega"]["J.J"] / tau

    assert by_inertia(1e-9) == pytest.approx(by_inertia(1e3), rel=1e-6)


@pytest.mark.slow
def test_derivatives_through_tiny_impacts_are_those_through_large_ones() -> None:
    """Which way a motion went through several changes at once is told by parts of its size, whatever that is."""

    def found(size: float) -> list[float]:
        net = sw.Network("flanks")
        net.add(sw.TorqueSource("T", tau=3.0 * size), "a")
        net.add(sw.Inertia("J1", J=0.6), "a")
        net.add(sw.Backlash("g", gap=0.1 * size, restitution=0.5, omega_rest=1e-2 * size), "a", "b")
        net.add(sw.Inertia("J2", J=1.4), "b")
        net.add(sw.LossyGear("gear", ratio=2.0, efficiency=0.8), "b", "c")
        net.add(sw.Inertia("J3", J=0.5), "c")
        made = motion_sensitivities(net, ["end J2.omega"], t_end=0.8, parameters=("J1.J", "gear.efficiency"))
        return [value / size for value in made["end J2.omega"].values()]

    assert found(1e-5) == pytest.approx(found(1.0), rel=1e-8)


def test_a_brake_that_comes_on_by_the_speed_and_the_time_is_the_closed_form() -> None:
    """On from omega + t / 1 s = 6 on: after t* = 6 / (1 + tau / J) the motion goes on with the torque that is left."""
    tau, brake, inertia, t_end = 10.0, 4.0, 2.0, 3.0
    net = sw.Network("ramped")
    net.add(sw.TorqueSource("motor", tau=tau), "a")
    net.add(sw.Inertia("J", J=inertia), "a")
    net.add(sw.Brake("brake", tau=brake, on=sw.omega + sw.t - 6), "a")
    made = motion_sensitivities(net, ["end J.omega"], t_end=t_end, parameters=("motor.tau", "brake.tau"))
    t_on = 6 / (1 + tau / inertia)
    assert made.measures["end J.omega"] == pytest.approx((tau * t_end - brake * (t_end - t_on)) / inertia, rel=1e-9)
    earlier = -t_on / (1 + tau / inertia) / inertia
    assert made["end J.omega"]["motor.tau"] == pytest.approx((t_end + brake * earlier) / inertia, rel=1e-7)
    assert made["end J.omega"]["brake.tau"] == pytest.approx(-(t_end - t_on) / inertia, rel=1e-7)


@pytest.mark.slow
def test_laws_that_switch_with_the_motion_equal_central_differences() -> None:
    """A torque that falls at a speed, once through a jump and once through a kink."""
    for law in (
        sympy.Piecewise((20.0, sw.omega < 1.0), (15.0, True)),
        sympy.Max(5.0, 20.0 - 3 * sw.omega),
    ):
        net = sw.Network("switch")
        net.add(sw.TorqueSource("T", tau=law), "a")
        net.add(sw.Inertia("A", J=2.0), "a")
        net.add(sw.Spring("s", c=300.0, d=2.0), "a", "b")
        net.add(sw.Inertia("B", J=1.0), "b")
        net.add(sw.Damper("d", d=0.7), "b")
        assert_differences(net, ["max s.tau", "end B.omega", "rms T.tau"], 1.5, ("A.J", "s.c", "d.d"))


@pytest.mark.slow
def test_a_commutated_motor_equals_central_differences() -> None:
    """A phase opens, and what its current was goes over."""
    net = sw.Network("bldc")
    net.add(sw.BLDCMotor("motor", U=24.0, R=0.5, L=1e-3, k=0.05, pole_pairs=2), "a")
    net.add(sw.Inertia("J", J=1e-4), "a")
    made = assert_differences(net, ["max motor.tau", "rms motor.i_a"], 0.015, ["motor.L"], step=1e-5)
    with pytest.raises(sw.ParameterError, match=r"'motor\.pole_pairs' is a whole number"):
        motion_sensitivities(net, list(made.measures), t_end=0.015, parameters=["motor.pole_pairs"])


@pytest.mark.slow
def test_held_noise_moves_with_its_interval_and_not_with_its_seed() -> None:
    net = sw.scenes.crane(load="random")
    assert_differences(net, ["end J2.omega", "mean shaft.tau"], 0.51, ("load.mean", "load.interval"))
    with pytest.raises(sw.ParameterError, match="is the seed of a noise"):
        motion_sensitivities(net, ["end J2.omega"], t_end=0.5, parameters=["load.seed"])


@pytest.mark.slow
def test_two_extremes_of_one_height_have_no_derivative() -> None:
    """Two motors alike give two pulls alike, one after the other: which of them is larger is up to either."""
    net = sw.Network("twice")
    for number, start in ((1, 0.1), (2, 6.1)):
        times = {"t_on": start, "t_off": start + 0.1}
        net.add(sw.KlossMotor(f"m{number}", tau_k=5.0, s_k=0.3, n_sync=1500.0, **times), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Damper("d", d=20.0), "a")
    assert motion_sensitivities(net, ["max J.omega"], t_end=7.0, parameters=["J.J"])["max J.omega"]["J.J"] < 0
    with pytest.raises(sw.SimulationError, match=r"reached at t = 0\.2 and 6\.2 s alike"):
        motion_sensitivities(net, ["max J.omega"], t_end=7.0)


@pytest.mark.slow
def test_what_is_only_touched_or_comes_first_by_chance_is_refused() -> None:
    net = sw.Network("release")
    net.add(sw.KlossMotor("motor", tau_k=5.0, s_k=0.3, n_sync=1500.0, t_on=0.2), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Brake("brake", tau=50.0, t_off=0.2), "a")
    with pytest.raises(sw.SimulationError, match=r"At t = 0\.2 s .* come together"):
        motion_sensitivities(net, ["end J.omega"], t_end=0.5)
    smooth = motion_sensitivities(net, ["end J.omega"], t_end=0.5, parameters=["J.J"])
    assert smooth["end J.omega"]["J.J"] < 0
    with pytest.raises(sw.ParameterError, match="exactly at the start or at the end"):
        motion_sensitivities(net, ["end J.omega"], t_end=0.2, parameters=["brake.t_off"])


def test_sources_that_jump_where_inertias_are_joined_to_them_are_refused() -> None:
    net = sw.Network("steered")
    net.add(sw.SpeedSource("v", omega=3.0), "x")
    net.add(sw.PlanetaryGear("g", ratio=2.0), "x", "a", "y")
    net.add(sw.Inertia("A", J=1.0), "a")
    net.add(sw.Inertia("Y", J=1.0), "y")
    with pytest.raises(sw.SimulationError, match="a source jumps that is joined rigidly"):
        motion_sensitivities(net, ["end A.omega"], t_end=0.5)


def test_a_stop_that_is_barely_reached_says_how_exact_it_is() -> None:
    """A mass at 2 rad/s that is braked to rest within 1 rad, and a stop a hair before that."""
    net = sw.Network("barely")
    net.add(sw.TorqueSource("T", tau=-2.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.HardStop("stop", upper=1.0 - 2e-13, restitution=0.9, omega_rest=1e-9), "a")
    with pytest.warns(sw.AccuracyWarning, match="hardly moving any more"):
        motion_sensitivities(net, ["end J.omega"], t_end=1.5, initial={"J.omega": 2.0})
