"""What a motion asks of its motor, against hand calculation."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import sympy
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial

import shaftwork as sw
from tests.properties.examples import share_of_examples

TOLERANCE = 1e-10
"""The bar of the issue, relative to the largest value of its kind."""
T = Polynomial([0.0, 1.0])


@dataclass(frozen=True)
class Hand:
    """Torque and speed in phases, as polynomials of the time in each."""

    phases: tuple[tuple[float, Polynomial, Polynomial], ...]

    @classmethod
    def of(cls, times: Sequence[float], speeds: Sequence[float], J: float, d: float, load: float) -> Hand:
        """A rigid inertia J with a damper d and a constant resisting torque, driven along straight lines."""
        made = []
        for (t0, t1), (w0, w1) in zip(pairwise(times), pairwise(speeds), strict=True):
            slope = (w1 - w0) / (t1 - t0)
            omega = w0 + slope * T
            made.append((t1 - t0, J * slope + d * omega + load, omega))
        return cls(tuple(made))

    def integral(self, power: int, what: str, sign: int = 0) -> float:
        """Of a power of torque, speed or power over the time, split at every root; of one sign alone if asked for."""
        total = 0.0
        for length, tau, omega in self.phases:
            value = {"tau": tau, "omega": omega, "power": tau * omega}[what]
            inner = [0.0, *sorted(r.real for r in (tau * omega).roots() if 0 < r.real < length), length]
            whole = (value**power).integ()
            for a, b in pairwise(inner):
                there = value((a + b) / 2)
                if sign == 0 or there * sign > 0:
                    total += abs(whole(b) - whole(a)) if power == 1 and sign else whole(b) - whole(a)
        return total

    def time(self, sign: int) -> float:
        """With power of a sign."""
        total = 0.0
        for length, tau, omega in self.phases:
            inner = [0.0, *sorted(r.real for r in (tau * omega).roots() if 0 < r.real < length), length]
            total += sum(b - a for a, b in pairwise(inner) if (tau * omega)((a + b) / 2) * sign > 0)
        return total

    def ends(self, what: str) -> list[float]:
        """Values at both ends of every phase, and where the slope is zero."""
        found = []
        for length, tau, omega in self.phases:
            value = {"tau": tau, "power": tau * omega}[what]
            roots = [r.real for r in value.deriv().roots() if 0 < r.real < length]
            found += [value(t) for t in (0.0, length, *roots)]
        return found


def test_no_figure_is_minus_zero() -> None:
    """What comes from a product with a sign may be -0.0, which is printed as what it is: nothing."""
    duty = sw.sizing.duty(rigid((0.0, 1.0), (0.0, 10.0), 2.0, 0.0, 0.0), "drive")
    lines = str(dataclasses.replace(duty, tau_min=-0.0)).splitlines()
    assert [line.split()[-2:] for line in lines if line.startswith("torque, smallest")] == [["0", "N*m"]]


def rigid(times: Sequence[float], speeds: Sequence[float], J: float, d: float, load: float) -> sw.Solution:
    net = sw.Network("rigid")
    net.add(sw.SpeedSource("drive", omega=sw.Table(list(times), list(speeds))), "shaft")
    net.add(sw.Inertia("J", J=J), "shaft")
    net.add(sw.ViscousLoad("d", d=d), "shaft")
    net.add(sw.TorqueSource("load", tau=-load), "shaft")
    return net.simulate(times[-1], t_eval=[times[-1]])


def close(value: float, expected: float, size: float) -> bool:
    return abs(value - expected) <= TOLERANCE * size


def assert_as_by_hand(made: sw.sizing.Duty, hand: Hand, end: float) -> None:
    rms = math.sqrt(hand.integral(2, "tau") / end)
    assert close(made.tau_rms, rms, rms)
    assert close(made.tau_mean, hand.integral(1, "tau") / end, rms)
    assert close(made.tau_max, max(hand.ends("tau")), made.tau_peak)
    assert close(made.tau_min, min(hand.ends("tau")), made.tau_peak)
    power = math.sqrt(hand.integral(2, "power") / end)
    assert close(made.power_rms, power, power)
    assert close(made.power_mean, hand.integral(1, "power") / end, power)
    for flow, sign in ((made.motoring, 1), (made.braking, -1)):
        energy, duration = hand.integral(1, "power", sign), hand.time(sign)
        assert close(flow.energy, energy, power * end)
        assert close(flow.duration, duration, end)
        assert close(flow.peak, max(0.0, *(sign * value for value in hand.ends("power"))), made.power_peak)
        assert close(flow.rms**2 * flow.duration, hand.integral(2, "power", sign), power**2 * end)


POSITIVE = st.floats(0.2, 20.0)


@pytest.mark.slow
@settings(share_of_examples(0.1), phases=(Phase.explicit, Phase.reuse, Phase.generate))
@example(lengths=(1.00001, 3.1327969124830384, 17.0, 1.0), top=2.0, J=1.0, d=1.0, load=0.0)  # a peak before a jump
@given(
    lengths=st.tuples(POSITIVE, POSITIVE, POSITIVE, POSITIVE),
    top=st.floats(-150.0, 150.0).filter(lambda w: abs(w) > 1.0),
    J=st.floats(0.05, 50.0),
    d=st.floats(0.01, 5.0),
    load=st.sampled_from([0.0, -1.0, 1.0, 0.01, 80.0]).flatmap(
        lambda size: st.floats(0.5, 1.0).map(lambda x: x * size)
    ),
)
def test_all_figures_of_a_trapezoid_are_those_of_hand_calculation(
    lengths: tuple[float, float, float, float], top: float, J: float, d: float, load: float
) -> None:
    times = [0.0, *np.cumsum(lengths).tolist()]
    speeds = [0.0, top, top, 0.0, 0.0]
    end = times[-1]
    made = sw.sizing.duty(rigid(times, speeds, J, d, load), "drive")
    assert_as_by_hand(made, Hand.of(times, speeds, J, d, load), end)
    assert close(made.n_top, abs(top) * 30 / math.pi, made.n_top)
    assert close(made.n_mean, abs(top) * ((lengths[0] + lengths[2]) / 2 + lengths[1]) / end * 30 / math.pi, made.n_top)
    assert close(made.loaded, end if load else end - lengths[3], end)
    assert close(made.acceleration_time(), lengths[0], lengths[0])
    assert close(made.acceleration_time(0.4), 0.4 * lengths[0], lengths[0])


def test_a_cycle_of_many_phases_with_reversal_and_rest_is_that_of_hand_calculation() -> None:
    times = [0.0, 0.5, 1.2, 2.0, 3.1, 3.7, 5.0, 5.4, 9.0]
    speeds = [0.0, 0.0, 60.0, 60.0, -25.0, -25.0, 10.0, 0.0, 0.0]
    made = sw.sizing.duty(rigid(times, speeds, 1.7, 0.3, 0.0), "drive")
    assert_as_by_hand(made, Hand.of(times, speeds, 1.7, 0.3, 0.0), 9.0)
    assert close(made.loaded, 4.9, 9.0)
    assert close(made.rest, 4.1, 9.0)
    assert made.held < 1e-9
    assert close(made.acceleration_time(), 0.7, 1.0)
    assert made.figures["cyclic duration factor"] == (pytest.approx(100 * 4.9 / 9.0), "%")
    assert "array(" not in repr(made)  # the figures, and not the course of the motion


def test_s3_takes_the_time_under_load_and_another_factor_the_same_heat_over_the_cycle() -> None:
    """3 s at 20 N m, 9 s at 5 N m, 4 s at -10 N m, 64 s of rest: the factor is 16 / 80."""
    times, speeds = [0.0, 3.0, 12.0, 16.0], [0.0, 15.0, 15.0, 0.0]
    J = 15.0 / (15.0 / 3.0)  # 15 N m to accelerate
    net = sw.Network("S3")
    net.add(sw.SpeedSource("drive", omega=sw.Table(times, speeds)), "shaft")
    net.add(sw.Inertia("J", J=J), "shaft")
    net.add(
        sw.TorqueSource("load", tau=sw.Step(-5.0) + sw.Step(5.0 - 10.0 + J * 15.0 / 4.0 - 11.25 + 10.0, 12.0)), "shaft"
    )
    made = sw.sizing.duty(net.simulate(16.0), "drive", cycle=80.0)
    braking = -J * 15.0 / 4.0
    heat = 3 * 20.0**2 + 9 * 5.0**2 + 4 * braking**2
    assert made.cyclic_duration_factor == pytest.approx(0.2, rel=TOLERANCE)
    assert made.thermal("S3") == pytest.approx(math.sqrt(heat / 16.0), rel=TOLERANCE)
    assert made.thermal("S3", 0.4) == pytest.approx(math.sqrt(heat / (0.4 * 80.0)), rel=TOLERANCE)
    assert made.thermal("S3", 0.4) == pytest.approx(made.thermal("S3") * math.sqrt(0.2 / 0.4), rel=TOLERANCE)
    assert made.thermal() == made.thermal("S1") == pytest.approx(math.sqrt(heat / 80.0), rel=TOLERANCE)
    assert made.thermal("S3", 1.0) == pytest.approx(made.thermal("S1"), rel=TOLERANCE)


@pytest.mark.parametrize("rated", [1.0, 0.6])
def test_a_motor_that_cools_itself_has_the_equivalent_time_of_textbooks(rated: float) -> None:
    """Ramps count (1 + k) / 2 and rest k; where the rated speed is below the highest, ramps count more above it."""
    times, speeds, k = [0.0, 2.0, 5.0, 6.0, 10.0], [0.0, 100.0, 100.0, 0.0, 0.0], 0.3
    sol = rigid(times, speeds, 0.4, 0.02, 3.0)
    made = sw.sizing.duty(
        sol, "drive", cooling=k, n_cooling=rated * 100.0 * 30 / math.pi, at_rest="released", cycle=12.0
    )
    ramps = 3.0 * (rated * (1 + k) / 2 + (1 - rated))
    assert made.cooled == pytest.approx(3.0 + ramps + 6.0 * k, rel=TOLERANCE)
    heat = Hand.of(times[:4], speeds[:4], 0.4, 0.02, 3.0).integral(2, "tau")
    assert made.thermal() == pytest.approx(math.sqrt(heat / made.cooled), rel=TOLERANCE)


def test_torque_at_standstill_counts_unless_a_brake_holds() -> None:
    times, speeds = [0.0, 1.0, 2.0, 6.0], [0.0, 50.0, 0.0, 0.0]
    sol = rigid(times, speeds, 0.4, 0.02, 3.0)
    holds, released = (sw.sizing.duty(sol, "drive", at_rest=way) for way in ("holds", "released"))
    assert holds.held == pytest.approx(4.0, rel=TOLERANCE)
    assert holds.cyclic_duration_factor == pytest.approx(1.0, rel=TOLERANCE)
    assert released.cyclic_duration_factor == pytest.approx(2.0 / 6.0, rel=TOLERANCE)
    assert 6 * (holds.tau_rms**2 - released.tau_rms**2) == pytest.approx(4 * 9.0, rel=TOLERANCE)
    assert "at_rest='released'" in str(holds)
    assert "at_rest" not in str(released)


@pytest.mark.parametrize("at_rest", ["holds", "released"])
def test_the_torque_at_the_moment_of_stopping_is_in_the_figures(at_rest: str) -> None:
    times, speeds = [0.0, 1.0, 2.0, 4.0, 5.0], [0.0, 20.0, 20.0, 0.0, 0.0]
    made = sw.sizing.duty(rigid(times, speeds, 3.0, 0.4, 0.0), "drive", at_rest=at_rest)
    assert close(made.tau_min, -30.0, 68.0)
    assert close(made.tau_max, 68.0, 68.0)
    assert close(made.loaded, 4.0, 4.0)


U = (sw.t - 1.0) / 2.0
SOFT = {
    "cosine": 5.0 * (1 - sympy.cos(sympy.pi * U)),
    "ninth degree": 10.0 * (70 * U**9 - 315 * U**8 + 540 * U**7 - 420 * U**6 + 126 * U**5),
}


@pytest.mark.parametrize("shape", SOFT)
@pytest.mark.parametrize("elastic", [False, True])
def test_a_soft_start_counts_from_its_begin_to_the_begin_of_the_plateau(shape: str, *, elastic: bool) -> None:
    """However flat the speed begins and ends: it is under way, and it is half way after half of the time."""
    net = sw.Network("soft")
    law = sympy.Piecewise((0, sw.t < 1), (SOFT[shape], sw.t < 3), (10, True))
    net.add(sw.SpeedSource("drive", omega=law), "shaft")
    net.add(sw.Inertia("J", J=3.0), "shaft")
    if elastic:  # many steps
        net.add(sw.Spring("c", c=1e4, d=10.0), "shaft", "end")
        net.add(sw.Inertia("J1", J=1.0), "end")
        net.add(sw.ViscousLoad("load", d=0.1), "end")
    made = sw.sizing.duty(net.simulate(4.0), "drive")
    assert close(made.acceleration_time(), 2.0, 2.0)
    assert close(made.acceleration_time(0.5), 1.0, 1.0)
    assert close(made.loaded, 3.0, 3.0)


@pytest.mark.slow
def test_a_motion_from_rest_to_rest_of_ninth_degree_is_under_load_all_the_time() -> None:
    net = sw.Network("rest to rest")
    way = SOFT["ninth degree"].subs(sw.t, sw.t + 1.0)
    net.add(sw.SpeedSource("drive", omega=sympy.diff(way, sw.t)), "shaft")
    net.add(sw.Inertia("J", J=3.0), "shaft")
    made = sw.sizing.duty(net.simulate(2.0), "drive")
    assert close(made.loaded, 2.0, 2.0)
    assert close(made.acceleration_time(), 1.0, 1.0)
    assert close(made.thermal("S3"), made.tau_rms, made.tau_rms)


def test_a_reversal_and_a_touch_of_standstill_begin_an_acceleration() -> None:
    turned = sw.sizing.duty(rigid([0.0, 1.0, 2.0, 3.0], [-5.0, -5.0, 5.0, 10.0], 1.0, 0.1, 0.0), "drive")
    assert close(turned.acceleration_time(), 1.5, 1.5)
    touched = sw.sizing.duty(rigid([0.0, 1.0, 2.0, 5.0], [0.0, 4.0, 0.0, 6.0], 1.0, 0.1, 0.0), "drive")
    assert close(touched.acceleration_time(), 3.0, 3.0)
    at_once = sw.sizing.duty(rigid([0.0, 1.0], [10.0, 5.0], 1.0, 0.1, 0.0), "drive")
    assert at_once.acceleration_time() == at_once.acceleration_time(0.6) == 0.0


def test_friction_at_standstill_is_released_and_a_jump_of_the_speed_is_said() -> None:
    net = sw.Network("friction")
    net.add(sw.SpeedSource("drive", omega=sw.Table([0.0, 1.0, 4.0, 5.0, 7.0], [0.0, 8.0, 8.0, 0.0, 0.0])), "shaft")
    net.add(sw.Inertia("J", J=2.0), "shaft")
    net.add(sw.CoulombLoad("load", tau=3.0), "shaft")
    made = sw.sizing.duty(net.simulate(7.0), "drive", at_rest="released")
    assert made.tau_rms == pytest.approx(math.sqrt((19.0**2 + 3 * 3.0**2 + 13.0**2) / 7), rel=TOLERANCE)
    assert made.loaded == pytest.approx(5.0, rel=TOLERANCE)
    assert "jumps" not in str(made)
    hard = sw.Network("hard")
    hard.add(sw.SpeedSource("drive", omega=sw.Step(10.0, 1.0)), "shaft")
    hard.add(sw.Inertia("J", J=2.0), "shaft")
    with pytest.warns(sw.NetworkWarning, match="the torque is an impulse"):
        sol = hard.simulate(2.0)
    assert "the speed jumps at 1 s" in str(sw.sizing.duty(sol, "drive"))


def test_a_gear_that_is_given_multiplies_by_the_direction_of_power() -> None:
    times, speeds, ratio, efficiency = [0.0, 1.0, 2.0, 2.5], [0.0, 8.0, 8.0, 0.0], 20.0, 0.9
    sol = rigid(times, speeds, 3.0, 1e-9, 10.0)
    made = sw.sizing.duty(sol, "drive", ratio=ratio, efficiency=efficiency)
    motoring, braking = (24.0 + 10.0) / ratio / efficiency, (-48.0 + 10.0) / ratio * efficiency
    assert made.tau_max == pytest.approx(motoring, rel=1e-8)  # the damper is not quite nothing
    assert made.tau_min == pytest.approx(braking, rel=1e-8)
    heat = motoring**2 + (10.0 / ratio / efficiency) ** 2 + 0.5 * braking**2
    assert made.tau_rms == pytest.approx(math.sqrt(heat / 2.5), rel=1e-8)
    assert made.n_top == pytest.approx(8.0 * ratio * 30 / math.pi, rel=TOLERANCE)
    named = sw.sizing.duty(sol, torque="drive.tau", speed="J.omega", ratio=ratio, efficiency=efficiency)
    assert named.figures == made.figures


@pytest.fixture(scope="module")
def start() -> sw.Solution:
    return sw.scenes.crane_start().simulate(6.5)


@pytest.mark.slow
def test_the_cranes_motor_is_seen_at_its_own_shaft(start: sw.Solution) -> None:
    made = sw.sizing.duty(start, "motor")
    node = sw.sizing.duty(start, torque="motor.tau", speed="rotor.omega")
    assert made.tau_rms == pytest.approx(node.tau_rms / 35.5 / 0.95, rel=TOLERANCE)
    assert made.n_top == pytest.approx(node.n_top * 35.5, rel=TOLERANCE)
    assert made.tau_peak == pytest.approx(8.0, rel=1e-9)  # it goes through its pull-out torque
    assert made.motoring.energy == pytest.approx(start.energy.supplied_by["motor"] / 0.95, rel=TOLERANCE)
    assert node.motoring.energy == pytest.approx(start.energy.supplied_by["motor"], rel=TOLERANCE)
    assert "ratio 35.5, efficiency 0.95" in str(made)


@pytest.mark.slow
def test_a_start_on_the_mains_has_no_reserve_and_steady_travel_that_of_pull_out_over_load(start: sw.Solution) -> None:
    at = sw.sizing.duty(start, "motor").reserve()
    assert at.ratio == pytest.approx(1.0, rel=1e-9)
    assert at.tau == pytest.approx(at.limit, rel=1e-9)
    net = sw.scenes.crane_start()
    steady = net.compile().steady_state()
    made = sw.sizing.duty(net.simulate(2.0, initial=steady), "motor")
    assert made.reserve().ratio == pytest.approx(8.0 / (22.4 / 35.5 / 0.95), rel=1e-7)  # steady to the tolerance


def test_parameters_of_the_run_are_those_of_the_curve() -> None:
    sol = sw.scenes.crane_start().simulate(6.5, parameters={"motor.tau_k": 9.0, "motor.efficiency": 0.9})
    made = sw.sizing.duty(sol, "motor")
    assert made.tau_peak == pytest.approx(9.0, rel=1e-9)
    assert made.reserve().limit == pytest.approx(9.0, rel=1e-9)


@pytest.mark.slow
def test_a_frequency_drive_has_its_pull_out_torque_in_reserve_and_less_of_it_in_a_weak_field() -> None:
    def drive(f: Any) -> sw.sizing.Duty:
        net = sw.Network("drive")
        net.add(sw.FrequencyDrive("motor", tau_k=40.0, s_k=0.15, n_sync=1500, f=f), "shaft")
        net.add(sw.Inertia("J", J=0.05), "shaft")
        net.add(sw.ViscousLoad("fan", d=0.04), "shaft")
        return sw.sizing.duty(net.simulate(8.0, initial={"J.omega": 0.0}), "motor")

    slow, fast = drive(sw.Table([0.0, 4.0], [2.0, 50.0])), drive(sw.Table([0.0, 4.0], [2.0, 75.0]))
    assert slow.reserve().limit == pytest.approx(40.0, rel=1e-9)
    assert fast.reserve(40.0).ratio > fast.reserve().ratio
    assert fast.reserve().limit == pytest.approx(40.0 / 1.5**2, rel=1e-6)


def test_a_limit_is_a_number_a_table_or_a_function_of_the_speed() -> None:
    times, speeds = [0.0, 1.0, 2.0], [0.0, 100.0, 100.0]
    made = sw.sizing.duty(rigid(times, speeds, 0.1, 0.01, 2.0), "drive")
    top = 100.0 * 30 / math.pi
    assert made.reserve(26.0).ratio == pytest.approx(2.0, rel=TOLERANCE)  # 10 + 1 + 2 at the end of the ramp
    falling = sw.Table([0.0, top], [26.0, 13.0])
    at = made.reserve(falling)
    assert (at.ratio, at.n, at.tau) == pytest.approx((1.0, top, 13.0), rel=1e-9)
    assert made.reserve(lambda n: 26.0 - 13.0 * n / top).ratio == pytest.approx(at.ratio, rel=1e-9)
    assert made.reserve(lambda n: np.where(n > 0.5 * top, 0.0, 99.0)).ratio == 0.0


def test_a_torque_source_takes_the_time_of_its_impulse_to_accelerate() -> None:
    net = sw.Network("run up")
    net.add(sw.TorqueSource("motor", tau=sw.Step(6.0, 0.5) + sw.Step(-6.0, 2.5)), "shaft")
    net.add(sw.Inertia("J", J=0.2), "shaft")
    made = sw.sizing.duty(net.simulate(4.0), "motor")
    assert made.acceleration_time() == pytest.approx(2.0, rel=1e-9)
    assert made.motoring.duration == pytest.approx(2.0, rel=1e-9)
    assert made.tau_rms == pytest.approx(math.sqrt(36.0 * 2.0 / 4.0), rel=TOLERANCE)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({}, "Name a motor.*In 'rigid' these drive: 'drive', 'load'"),
        ({"motor": "J"}, "'J' is no motor.*these drive: 'drive', 'load'"),
        ({"motor": "nothing"}, "'nothing' is no motor"),
        ({"motor": "drive", "torque": "drive.tau"}, "Name a motor"),
        ({"torque": "drive.tau"}, "Name a motor"),
        ({"torque": "drive.omega", "speed": "drive.tau"}, "'drive.omega' is in rad/s"),
        ({"torque": "drive.tua", "speed": "J.omega"}, "No quantity 'drive.tua'"),
        ({"motor": "drive", "ratio": 0.0}, "ratio = 0.0 must be not zero"),
        ({"motor": "drive", "efficiency": 1.2}, "efficiency = 1.2 must be above 0 and at most 1"),
        ({"motor": "drive", "cycle": 1.0}, "cycle = 1 s is shorter than the motion of 2 s"),
        ({"motor": "drive", "at_rest": "brake"}, "at_rest = 'brake' is neither 'holds'"),
        ({"motor": "drive", "cooling": 0.0}, "cooling = 0.0 must be above 0"),
    ],
)
def test_what_is_no_duty_is_refused(arguments: dict[str, Any], says: str) -> None:
    sol = rigid([0.0, 1.0, 2.0], [0.0, 1.0, 1.0], 1.0, 0.1, 1.0)
    with pytest.raises(sw.ShaftworkError, match=says):
        sw.sizing.duty(sol, **arguments)


def test_questions_that_make_no_sense_are_refused(start: sw.Solution) -> None:
    made = sw.sizing.duty(start, "motor")
    for ask, says in {
        "no motion": (lambda: sw.sizing.duty(sw.Network("n"), "motor"), "is no motion"),
        "two gears": (lambda: sw.sizing.duty(start, "motor", ratio=2.0), "has a gear of its own, ratio 35.5"),
        "type": (lambda: made.thermal("S9"), "no duty type 'S9' here. There are: S1, S3"),
        "factor of S1": (lambda: made.thermal("S1", 0.4), "S1 is continuous"),
        "factor": (lambda: made.thermal("S3", 40), "factor = 40 must be above 0 and at most 1"),
        "share": (lambda: made.acceleration_time(0.0), "share = 0.0 must be above 0"),
        "limit": (lambda: made.reserve(-3.0), "limit = -3.0 must be above 0"),
        "table": (lambda: made.reserve(sw.Table([-1, 1], [1, 1])), "below zero"),
        "function": (lambda: made.reserve(lambda n: -n), "below zero"),
    }.values():
        with pytest.raises(sw.ShaftworkError, match=says):
            ask()
    rest = sw.sizing.duty(rigid([0.0, 1.0], [0.0, 0.0], 1.0, 0.1, 1.0), "drive")
    assert rest.tau_rms == pytest.approx(1.0)
    with pytest.raises(sw.ParameterError, match="does not move"):
        rest.acceleration_time()
    with pytest.raises(sw.ParameterError, match=r"'drive' \(SpeedSource\) has no curve of torque over speed"):
        rest.reserve()


@pytest.mark.slow
def test_figures_are_a_table_and_the_plane_of_speed_and_torque_a_picture(start: sw.Solution) -> None:
    made = sw.sizing.duty(start, "motor", cycle=700.0, cooling=0.5)
    frame = made.to_pandas()
    assert frame.loc["torque, effective", "value"] == made.tau_rms
    assert frame.loc["motoring, peak", "unit"] == "W"
    assert {"ratio 35.5", "longer than 10 min", "cooling 0.5"} <= {
        text for text in ("ratio 35.5", "longer than 10 min", "cooling 0.5") if text in str(made)
    }
    (axes, _) = made.plot(9.0).axes
    assert axes.get_xlabel() == "speed in 1/min"
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == ["curve of motor", "limit", "thermal torque, S1"]
