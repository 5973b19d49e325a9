"""The references of hybrid motions hold among themselves: two methods, or a closed form and its equations."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from math import isclose

import pytest
from scipy.integrate import quad

from tests.reference import friction
from tests.reference.hybrid_crane import LOADS, Crane, Load, Method, Motion, motion, runge_kutta, stored, taylor


def distance(one: Motion, other: Motion) -> float:
    """Largest difference of times and end states of two motions with the same events."""
    assert [event[1:] for event in one.events] == [event[1:] for event in other.events]
    times = (abs(a[0] - b[0]) for a, b in zip(one.events, other.events, strict=True))
    return max(*times, *(abs(a - b) for a, b in zip(one.end, other.end, strict=True)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("load", "method", "step"),
    [
        *((load, taylor, 2e-3) for load in LOADS),
        ("coulomb", taylor, 1e-3),
        *((load, runge_kutta, 4e-3) for load in LOADS),
    ],
)
def test_every_method_finds_the_stored_motion_of_the_crane(load: Load, method: Method, step: float) -> None:
    """Measured: 7e-13, the rounding of 5000 steps."""
    assert distance(motion(Crane(load), step=step, method=method), stored(load)) < 1e-11


@pytest.mark.slow
def test_a_brake_that_is_too_weak_breaks_away_again() -> None:
    crane = Crane("constant", tau_w=100.0, tau_brake=150.0)
    found = motion(crane, t_end=10.5)
    assert [event[3] for event in found.of("brake")] == [
        "slips forward",
        *("locked", "slips forward"),
        *3 * ("locked", "slips backward"),
        "locked",
    ]
    assert distance(found, motion(crane, t_end=10.5, method=runge_kutta)) < 1e-11


def test_a_block_on_a_belt_moves_smoothly_from_stick_to_slip_and_obeys_its_equation() -> None:
    block = friction.StickSlip(J=0.3, c=40.0, tau_c=2.0, tau_s=3.5, belt=0.4)
    away, caught, again = block.events(3)
    assert isclose(again - away, block.period, rel_tol=1e-14)
    assert isclose(block.angle(away), 3.5 / 40.0, rel_tol=1e-14)
    assert isclose(block.angle(again), block.angle(away), rel_tol=1e-12)
    h = 1e-4
    for t, speed in ((away, 0.4), (caught, 0.4)):  # as fast as the belt at both ends of a slip
        assert isclose((block.angle(t + h) - block.angle(t - h)) / (2 * h), speed, rel_tol=1e-2)
    for t in (away + 0.1 * block.slip, away + 0.7 * block.slip):
        acceleration = (block.angle(t + h) - 2 * block.angle(t) + block.angle(t - h)) / h**2
        assert isclose(0.3 * acceleration, 2.0 - 40.0 * block.angle(t), rel_tol=1e-5)


def test_flights_between_bounces_are_as_long_as_the_speed_says() -> None:
    ball = friction.Bounces(J=2.0, tau=5.0, height=0.7, restitution=0.6)
    for n in range(1, 6):
        assert isclose(ball.impact(n + 1) - ball.impact(n), 2.0 * ball.speed_after(n) * 2.0 / 5.0, rel_tol=1e-12)
    assert isclose(ball.impact(200), ball.rest, rel_tol=1e-14)


def test_friction_takes_from_an_oscillator_the_energy_that_its_way_costs() -> None:
    swing = friction.CoulombOscillator(J=1.0, c=10.0, tau_c=0.3, tau_s=0.4, start=0.5)
    points = swing.turning_points
    way = sum(abs(b - a) for a, b in pairwise(points))
    assert isclose(5.0 * (points[0] ** 2 - points[-1] ** 2), 0.3 * way, rel_tol=1e-12)
    assert isclose(abs(points[0]) - abs(points[2]), 4 * 0.3 / 10.0, rel_tol=1e-12)
    assert abs(points[-1]) <= 0.04 < abs(points[-2])


def test_a_ramp_accelerates_after_the_breakaway_by_what_friction_leaves() -> None:
    held = friction.RampedBreakaway(J=2.0, tau_c=4.0, tau_s=5.0, rate=10.0)
    assert held.time == 0.5
    assert held.reaction(0.3) == 3.0
    given = quad(lambda t: (10.0 * t - held.reaction(t)) / 2.0, 0.5, 1.3)[0]
    assert isclose(held.omega(1.3), given, rel_tol=1e-12)


def test_a_clutch_conserves_momentum_and_turns_the_lost_energy_into_heat() -> None:
    free = friction.Engagement(J1=2.0, J2=3.0, omega_1=100.0, omega_2=20.0, tau=50.0)
    assert isclose(5.0 * free.omega, 2.0 * 100.0 + 3.0 * 20.0, rel_tol=1e-14)
    before, after = 2.0 * 100.0**2 + 3.0 * 20.0**2, 5.0 * free.omega**2
    assert isclose(free.loss, 0.5 * (before - after), rel_tol=1e-12)
    driven = replace(free, tau_1=30.0, tau_2=-10.0)
    assert isclose(driven.omega, 20.0 + (50.0 - 10.0) / 3.0 * driven.time, rel_tol=1e-12)
    # after lock-up both inertias accelerate alike
    assert isclose((30.0 - driven.carried) / 2.0, (driven.carried - 10.0) / 3.0, rel_tol=1e-12)


def test_a_brake_stops_an_inertia_on_half_the_way_of_its_first_speed() -> None:
    time, angle = friction.stop(J=2.0, omega=30.0, tau=5.0)
    assert (time, angle) == (12.0, 0.5 * 30.0 * 12.0)
    assert friction.capacity_parallel(3.0, 4.0) == 7.0
    assert friction.capacity_series(3.0, 4.0) == 3.0
