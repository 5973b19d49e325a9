"""Motions through many phases beside closed forms and a reference that share nothing with the library."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

import shaftwork as sw
from tests.reference import friction
from tests.reference.hybrid_crane import Crane, Load, Motion, motion, stored

ENGINES = ("heyoka", "scipy", "sundials", "scipy-radau")
TIGHT = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12)
ASKED = [
    *(("heyoka", rtol) for rtol in TIGHT),
    *((engine, rtol) for engine in ("scipy", "sundials") for rtol in TIGHT[::3]),
    ("scipy-radau", 1e-3),
    ("scipy-radau", 1e-7),
]
WORDS = {
    ("gap", "forward"): "in contact",
    ("gap", "backward"): "in contact backward",
    ("load", "locked"): "stuck",
    **{(part, f"slips {way}"): f"slipping {way}" for part in ("brake", "load") for way in ("forward", "backward")},
}
"""What the library calls the modes of the reference, where it says it otherwise."""


@cache
def crane(load: Load, tau_w: float = 22.4, tau_brake: float = 323.8) -> sw.Model:
    """The crane as a user wires it."""
    net = sw.Network("crane")
    motor = sw.KlossMotor("motor", tau_k=9.6, s_k=0.25, n_sync=3000.0, ratio=35.5, efficiency=0.95, t_off=6.5)
    net.add(motor, "rotor")
    net.add(sw.Inertia("J1", J=27.35), "rotor")
    net.add(sw.Brake("brake", tau=tau_brake, t_on=6.5), "rotor")
    net.add(sw.Backlash("gap", gap=0.02, c=24206.0, d=14.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=62.5), "wheel")
    if load == "coulomb":
        net.add(sw.CoulombLoad("load", tau=tau_w), "wheel")
    elif load == "constant":
        net.add(sw.TorqueSource("load", tau=-tau_w), "wheel")
    return net.compile()


@cache
def weakly_braked() -> Motion:
    """The reference for a brake that cannot hold the load's swings."""
    return motion(Crane("constant", tau_w=100.0, tau_brake=150.0), t_end=10.5)


def compared(sol: sw.Solution, wanted: Motion) -> tuple[float, float]:
    """Largest error of the times and of the end state, of a motion with the same events."""
    events = [(part, *(WORDS.get((part, mode), mode) for mode in modes)) for _, part, *modes in wanted.events]
    assert [event[1:] for event in sol.events] == events
    end = [sol[name][-1] for name in ("J1.omega", "J2.omega", "gap.phi")]
    times = max(abs(event[0] - other[0]) for event, other in zip(sol.events, wanted.events, strict=True))
    return times, float(np.abs(np.array(end) - wanted.end).max())


@pytest.mark.slow
@pytest.mark.parametrize(("engine", "rtol"), ASKED)
def test_every_engine_finds_every_event_of_the_crane_at_every_tolerance(engine: str, rtol: float) -> None:
    """62 events: 58 of the gap, breakaway and rest of the load, and the brake, which acts from 6.5 s on and locks."""
    sol = crane("coulomb").simulate(t_end=10.0, engine=engine, rtol=rtol, t_eval=2)
    times, end = compared(sol, stored("coulomb"))
    assert len(sol.events) == 62
    # the bar: 1e-7 at 1e-9, a hundred times the tolerance elsewhere
    assert end <= 100.0 * rtol
    assert times <= 100.0 * rtol


@pytest.mark.slow
@pytest.mark.parametrize(
    ("load", "engine"),
    # CVODE's first steps after an event are rough: without a load it sees one contact of no length too many
    [*(("none", engine) for engine in ENGINES if engine != "sundials"), *(("constant", e) for e in ENGINES[:-1])],
)
def test_the_crane_that_never_rests_is_followed_as_well(load: Load, engine: str) -> None:
    sol = crane(load).simulate(t_end=10.0, engine=engine, rtol=1e-7, t_eval=2)
    assert max(compared(sol, stored(load))) < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["heyoka", "scipy", "sundials"])
def test_a_brake_that_is_too_weak_slips_as_often_as_it_must(engine: str) -> None:
    """100 N m of load and a brake of 150 N m: it locks five times and gives way four times, both ways round."""
    sol = crane("constant", 100.0, 150.0).simulate(t_end=10.5, engine=engine, rtol=1e-9, t_eval=2)
    assert max(compared(sol, weakly_braked())) < 1e-7
    assert sum(event[3] == "locked" for event in sol.events) == 5


@pytest.mark.slow
def test_the_phases_of_the_crane_lie_between_its_events_and_say_their_modes() -> None:
    sol = crane("coulomb").simulate(t_end=10.0, rtol=1e-9)
    instants = list(dict.fromkeys(event[0] for event in sol.events))
    assert [phase.start for phase in sol.phases] == [0.0, *instants]
    assert [phase.end for phase in sol.phases] == [*instants, 10.0]
    assert sol.phases[-1].modes == {"brake": "locked", "gap": "open", "load": "stuck"}
    assert sol.energy_residual < 1e-9


@pytest.mark.parametrize("engine", ENGINES)
def test_what_is_stuck_stands_still_to_the_last_bit_and_its_reaction_balances(engine: str) -> None:
    """1e4 s under a torque that grows to 99 % of what holds."""
    net = sw.Network("stuck")
    net.add(sw.TorqueSource("pull", tau=9.9 * sw.t / 1e4), "wheel")
    net.add(sw.Inertia("J", J=2.0), "wheel")
    net.add(sw.DryFriction("shoe", tau_c=8.0, tau_s=10.0), "wheel")
    sol = net.simulate(t_end=1e4, engine=engine, rtol=1e-6)
    assert not sol["J.omega"].any()
    assert sol.events == ()
    np.testing.assert_allclose(sol["shoe.tau"], sol["pull.tau"], rtol=1e-15, atol=1e-15)


@pytest.mark.parametrize("engine", ENGINES)
def test_dry_friction_gives_way_when_a_ramp_reaches_it(engine: str) -> None:
    held = friction.RampedBreakaway(J=2.0, tau_c=5.0, tau_s=5.0, rate=1.7)
    net = sw.Network("ramp")
    net.add(sw.TorqueSource("pull", tau=held.rate * sw.t), "wheel")
    net.add(sw.Inertia("J", J=held.J), "wheel")
    net.add(sw.DryFriction("shoe", tau_c=held.tau_c), "wheel")
    sol = net.simulate(t_end=5.0, engine=engine, rtol=1e-10)
    ((time, *_),) = sol.events
    assert time == pytest.approx(held.time, abs=1e-9)
    np.testing.assert_allclose(sol["J.omega"], [held.omega(t) for t in sol.t.tolist()], atol=1e-8)
    np.testing.assert_allclose(sol["shoe.tau"], [held.reaction(t) for t in sol.t.tolist()], atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["heyoka", "scipy", "sundials"])
def test_a_block_on_a_belt_sticks_and_slips_with_the_period_of_its_limit_cycle(engine: str) -> None:
    block = friction.StickSlip(J=0.3, c=40.0, tau_c=2.0, tau_s=3.5, belt=0.4)
    net = sw.Network("belt")
    net.add(sw.SpeedSource("drive", omega=block.belt), "belt")
    net.add(sw.DryFriction("shoe", tau_c=block.tau_c, tau_s=block.tau_s, omega_s=0.0), "belt", "block")
    net.add(sw.Inertia("J", J=block.J), "block")
    net.add(sw.Spring("spring", c=block.c), "block", "ground")
    sol = net.simulate(t_end=8.0, engine=engine, rtol=1e-10, initial={"J.omega": block.belt})
    wanted = [time for time in block.events(100) if time < 8.0]
    assert len(wanted) > 10
    np.testing.assert_allclose([event[0] for event in sol.events], wanted, atol=1e-8)
    np.testing.assert_allclose(np.diff([event[0] for event in sol.events][::2]), block.period, atol=1e-8)
    np.testing.assert_allclose(sol["spring.phi_rel"], [block.angle(t) for t in sol.t.tolist()], atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["heyoka", "scipy", "sundials"])
def test_an_oscillator_with_dry_friction_loses_4_tau_over_c_a_cycle_and_rests_off_the_middle(engine: str) -> None:
    swing = friction.CoulombOscillator(J=1.3, c=50.0, tau_c=0.7, tau_s=0.7, start=0.52)
    net = sw.Network("oscillator")
    net.add(sw.Inertia("J", J=swing.J), "wheel")
    net.add(sw.Spring("spring", c=swing.c), "wheel", "ground")
    net.add(sw.DryFriction("shoe", tau_c=swing.tau_c), "wheel")
    sol = net.simulate(t_end=20.0, engine=engine, rtol=1e-11, initial={"spring.phi_rel": swing.start})
    points = np.array(swing.turning_points)
    assert len(points) > 15
    turns = list(dict.fromkeys(event[0] for event in sol.events if event[0] > 0.0))  # it is stuck for no time
    np.testing.assert_allclose(turns, swing.half_period * np.arange(1, len(points)), atol=1e-8)
    np.testing.assert_allclose(sol.at(turns)["spring.phi_rel"], points[1:], atol=1e-8)
    rest = sol.t > swing.rest[0] + 1e-6
    assert not sol["J.omega"][rest].any()
    np.testing.assert_allclose(sol["spring.phi_rel"][rest], swing.rest[1], atol=1e-8)
    np.testing.assert_allclose(sol["shoe.tau"][rest], -swing.c * swing.rest[1], atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["heyoka", "scipy", "sundials"])
def test_an_inertia_bounces_on_a_stop_at_the_times_of_a_geometric_series(engine: str) -> None:
    ball = friction.Bounces(J=2.0, tau=5.0, height=0.7, restitution=0.6)
    net = sw.Network("bounces")
    net.add(sw.TorqueSource("weight", tau=ball.tau), "wheel")
    net.add(sw.Inertia("J", J=ball.J), "wheel")
    net.add(sw.HardStop("stop", upper=ball.height, restitution=ball.restitution, omega_rest=1e-3), "wheel")
    sol = net.simulate(t_end=5.0, engine=engine, rtol=1e-11)
    hits = [event for event in sol.events if event[1] == "stop"]
    wanted = [ball.impact(n) for n in range(1, len(hits) + 1)]
    assert ball.speed_after(len(hits) - 1) >= 1e-3 > ball.speed_after(len(hits))
    np.testing.assert_allclose([hit[0] for hit in hits], wanted, atol=1e-8)
    assert hits[-1][3] == "in contact"
    assert not sol["J.omega"][sol.t > ball.rest].any()
    flights = sol.at([0.5 * (a + b) for a, b in pairwise(wanted)][:5])
    np.testing.assert_allclose(flights["J.omega"], 0.0, atol=1e-8)  # half-way through a flight it turns


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["heyoka", "scipy", "sundials", "scipy-radau"])
@pytest.mark.parametrize("rtol", [1e-3, 1e-5, 1e-7, 1e-9, 1e-12])
@pytest.mark.parametrize(("restitution", "omega_rest"), [(0.9, 2e-3), (0.85, 1e-4), (0.6, 1e-5)])
def test_no_engine_ends_a_series_of_bounces_early(
    engine: str, rtol: float, restitution: float, omega_rest: float
) -> None:
    """The last flights are some 1e-9 rad high, far below the loose tolerances."""
    ball = friction.Bounces(J=2.0, tau=5.0, height=0.7, restitution=restitution)
    count = next(n for n in range(1, 100) if ball.speed_after(n) <= omega_rest)
    net = sw.Network("bounces")
    net.add(sw.TorqueSource("weight", tau=ball.tau), "wheel")
    net.add(sw.Inertia("J", J=ball.J), "wheel")
    net.add(sw.HardStop("stop", upper=ball.height, restitution=restitution, omega_rest=omega_rest), "wheel")
    sol = net.simulate(t_end=1.1 * ball.rest, engine=engine, rtol=rtol, t_eval=2)
    hits = [event for event in sol.events if event[1] == "stop"]
    assert [hit[3] for hit in hits] == ["rebound"] * (count - 1) + ["in contact"]
    # by a part of 1e-5 of its own flight each may come early, and all later ones with it
    wanted = [ball.impact(n) for n in range(1, count + 1)]
    np.testing.assert_allclose([hit[0] for hit in hits], wanted, atol=1e-4)


def test_slow_bounces_are_those_of_a_fast_motion_in_another_time() -> None:
    """With a torque smaller by 1e-8 all speeds are smaller by 1e-4, the fastest 2e-4 rad/s, all times longer by 1e4.

    A speed across of up to 1e-8 rad/s is no impact, so the slow ones end after some thirty.
    """
    hits = []
    for slower in (1.0, 1e4):
        net = sw.Network("bounces")
        net.add(sw.TorqueSource("weight", tau=5.0 / slower**2), "wheel")
        net.add(sw.Inertia("J", J=2.0), "wheel")
        net.add(sw.HardStop("stop", upper=0.7, restitution=0.7), "wheel")
        sol = net.simulate(t_end=6.0 * slower, t_eval=2)
        assert sol.events[-1][3] == "in contact"
        hits.append([time / slower for time, *_ in sol.events])
    fast, slow = hits
    assert len(slow) >= 25
    np.testing.assert_allclose(slow[:25], fast[:25], rtol=1e-6)


@pytest.mark.parametrize("engine", ["heyoka", "scipy", "sundials"])
def test_a_clutch_engages_at_the_time_and_the_speed_of_the_momentum_balance(engine: str) -> None:
    made = friction.Engagement(J1=2.0, J2=3.0, omega_1=100.0, omega_2=20.0, tau=50.0, tau_1=30.0, tau_2=-10.0)
    net = sw.Network("clutch")
    net.add(sw.TorqueSource("engine", tau=made.tau_1), "fast")
    net.add(sw.Inertia("J1", J=made.J1), "fast")
    net.add(sw.Clutch("clutch", tau=made.tau), "fast", "slow")
    net.add(sw.Inertia("J2", J=made.J2), "slow")
    net.add(sw.TorqueSource("load", tau=made.tau_2), "slow")
    sol = net.simulate(t_end=10.0, engine=engine, initial={"J1.omega": made.omega_1, "J2.omega": made.omega_2})
    (engaged,) = (event for event in sol.events if event[3] == "engaged")
    assert engaged[0] == pytest.approx(made.time, abs=1e-9)
    after = sol.t > made.time
    assert (sol["J1.omega"][after] == sol["J2.omega"][after]).all()
    rate = (made.tau_1 + made.tau_2) / (made.J1 + made.J2)
    np.testing.assert_allclose(sol["J1.omega"][after], made.omega + rate * (sol.t[after] - made.time), rtol=1e-9)
    np.testing.assert_allclose(sol["clutch.tau"][after], made.carried, rtol=1e-12)
    assert sol.energy.lost[-1] == pytest.approx(made.loss, rel=1e-9)


def test_a_brake_stops_an_inertia_after_the_time_and_the_way_of_the_closed_form() -> None:
    net = sw.Network("stop")
    net.add(sw.Inertia("J", J=2.0), "wheel")
    net.add(sw.Brake("brake", tau=5.0), "wheel")
    time, angle = friction.stop(J=2.0, omega=30.0, tau=5.0)
    sol = net.simulate(t_end=20.0, initial={"J.omega": 30.0}, rtol=1e-11, angles=["J"])
    assert [event[0] for event in sol.events if event[3] == "locked"] == [pytest.approx(time, abs=1e-8)]
    assert sol["J.phi"][-1] == pytest.approx(angle, rel=1e-9)


@pytest.mark.parametrize(
    ("pull", "slips"),
    [(friction.capacity_parallel(3.0, 4.0) * 0.999, False), (friction.capacity_parallel(3.0, 4.0) * 1.001, True)],
)
def test_brakes_on_one_shaft_hold_together_what_each_holds(pull: float, slips: bool) -> None:  # noqa: FBT001
    net = sw.Network("parallel")
    net.add(sw.TorqueSource("pull", tau=pull), "wheel")
    net.add(sw.Inertia("J", J=1.0), "wheel")
    net.add(sw.Brake("one", tau=3.0), "wheel")
    net.add(sw.Brake("other", tau=4.0), "wheel")
    sol = net.simulate(t_end=1.0)
    assert sol["J.omega"][-1] == pytest.approx(0.007 if slips else 0.0, rel=1e-6)
    assert bool(sol["J.omega"].any()) is slips
    np.testing.assert_allclose(sol["one.tau"] + sol["other.tau"], min(pull, 7.0), rtol=1e-9)


def test_of_clutches_in_line_the_weakest_slips_and_the_others_hold() -> None:
    net = sw.Network("series")
    net.add(sw.TorqueSource("pull", tau=5.0), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Clutch("strong", tau=4.0), "a", "b")
    net.add(sw.Inertia("J2", J=1e-3), "b")
    net.add(sw.Brake("weak", tau=3.0), "b")
    sol = net.simulate(t_end=1.0)
    limit = friction.capacity_series(4.0, 3.0)
    assert sol["J1.omega"][-1] == pytest.approx((5.0 - limit) / 1.001, rel=1e-9)
    assert (sol["J1.omega"] == sol["J2.omega"]).all()
