"""Claims about rigid impacts through gears that rub, checked by the impulse followed by hand."""

from __future__ import annotations

import math
from functools import cache
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import shaftwork as sw
from tests.properties.examples import share_of_examples

J_H, J_B, J_C = 1.0, 0.5, 2.0


@cache
def train(hit: str, **contact: Any) -> sw.Model:
    """A hammer before a gear with an inertia on either side; it hits the one at node b or at node c."""
    net = sw.Network("impact")
    net.add(sw.Inertia("H", J=J_H), "a")
    net.add(sw.Backlash("gap", gap=0.2, **contact), "a", hit)
    net.add(sw.Inertia("B", J=J_B), "b")
    net.add(sw.LossyGear("gear", ratio=2.0, efficiency=0.8, efficiency_back=0.6), "b", "c")
    net.add(sw.Inertia("C", J=J_C), "c")
    net.add(sw.TorqueSource("push", tau=0.0), "c")
    return net.compile()


def followed(v: float, w: float, e: float, onward: float, braking: float) -> tuple[float, float]:
    """Speeds of the hammer and of what it hits after an impact, followed along its impulse p up and down again.

    Args:
        v: speed of the hammer before it.
        w: of what is hit.
        e: restitution, of which the square is the share of the work that comes back.
        onward: inertia that an impulse feels that turns the gear on; infinite where the gear holds.
        braking: inertia that it feels while it brakes the gear; one below zero jams.
    """
    way = math.copysign(1.0, v - w)
    if way * w < 0 and braking <= 0:
        w = 0.0
    taken = 0.0
    for back in (False, True):
        goal = 0.0 if not back else None
        while True:
            closing = way * (v - w)
            felt = braking if way * w < 0 else onward
            mass = 1 / (1 / J_H + 1 / felt)
            if back:
                goal = -math.sqrt(closing**2 + 2 * e**2 * taken / mass)
            assert goal is not None
            p = (closing - goal) * mass
            rests = way * w < 0 and way * w + p / felt > 0
            if rests:
                p = -way * w * felt
            then = closing - p / mass
            taken += (
                (closing**2 - then**2) * mass / 2 if not back else (closing**2 - then**2) * mass / 2 / e**2 if e else 0
            )
            v, w = v - way * p / J_H, 0.0 if rests else w + way * p / felt
            if not rests:
                break
    return v, w


def felt(hit: str, ratio: float, efficiency: float, back: float) -> tuple[float, float]:
    """The inertia that an impulse feels, turning the gear on and braking it."""
    if hit == "b":
        return J_B + J_C / (ratio**2 * efficiency), J_B + back * J_C / ratio**2
    return J_C + ratio**2 * J_B / back if back > 0 else math.inf, J_C + efficiency * ratio**2 * J_B


@pytest.mark.slow
@share_of_examples(0.2)
@given(
    hit=st.sampled_from("bc"),
    ratio=st.sampled_from([2.0, -2.0, 0.5, -7.0]),
    efficiency=st.floats(0.3, 1.0),
    back=st.sampled_from([-0.9, -0.2, 0.3, 0.8]),
    e=st.sampled_from([0.0, 0.5, 1.0]),
    v=st.floats(3.0, 20.0),
    w=st.floats(-10.0, 2.0).map(lambda w: round(w, 3)),
    way=st.sampled_from([1, -1]),
)
def test_an_impact_through_a_gear_follows_its_impulse(
    hit: str, ratio: float, efficiency: float, back: float, e: float, v: float, w: float, way: int
) -> None:
    """The gear may be braked, come to rest within the impact, be held there or turned on, or jam."""
    assume(hit == "b" or back > 0 or w <= 0)  # driven on from its locked side it has no motion
    v, w = way * v, way * w
    after = followed(v, w, e, *felt(hit, ratio, efficiency, back))
    start = {"H.omega": v, "B.omega": w * (1 if hit == "b" else ratio), "C.omega": w / (ratio if hit == "b" else 1)}
    met = 0.1 / abs(v - w)
    values = {"gear.ratio": ratio, "gear.efficiency": efficiency, "gear.efficiency_back": back, "gap.restitution": e}
    sol = train(hit, restitution=0.5).simulate(1.01 * met, initial=start, parameters=values)
    now = sol.at([sol.events[-1][0]])
    assert [now["H.omega"][0], now[f"{hit.upper()}.omega"][0]] == pytest.approx(after, abs=1e-9 * abs(v - w))
    assert sol.energy_residual < 1e-12


@pytest.mark.parametrize("push", [0.0, 1e-9, -1e-9])
def test_a_gear_at_rest_that_is_hit_is_no_wall_whichever_side_drove_before(push: float) -> None:
    sol = train("b").simulate(0.0101, initial={"H.omega": 10.0}, parameters={"push.tau": push})
    inertia = J_B + J_C / (2.0**2 * 0.8)
    assert sol["B.omega"][-1] == pytest.approx(10.0 * J_H / (J_H + inertia), rel=1e-9)


@pytest.mark.parametrize("e", [0.0, 0.5])
def test_what_a_gear_loses_in_an_impact_is_its_own(e: float) -> None:
    sol = train("b", restitution=e).simulate(0.0101, initial={"H.omega": 10.0})
    impulse = (1 + e) * 10.0 / (1 / J_H + 1 / (J_B + J_C / (2.0**2 * 0.8)))
    c = sol["C.omega"][-1]
    mesh = J_C * c / (2.0 * 0.8)  # what B gives to the gear: its torque times the ratio and the efficiency drives C
    assert sol.energy.lost_in["gear"] == pytest.approx(0.2 * mesh * 2.0 * c / 2, rel=1e-12)
    assert sol.energy.lost_in["gap"] == pytest.approx(impulse * (1 - e) * 10.0 / 2, rel=1e-12)


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_a_gear_that_locks_itself_holds_what_a_stop_would_throw_back(e: float) -> None:
    """J1 drives the gear into the stop: of 5 J the stop takes its impulse times the mean speed, the mesh the rest."""
    net = sw.Network("jams")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Inertia("J2", J=1.0), "b")
    net.add(sw.LossyGear("gear", ratio=3.0, efficiency=0.7, efficiency_back=0.0), "a", "b")
    net.add(sw.HardStop("stop", upper=0.1, restitution=e), "b")
    sol = net.simulate(0.11, initial={"J1.omega": 3.0, "J2.omega": 1.0})
    assert sol["J2.omega"][-1] == 0.0
    impulse = 3.0 * 0.7 * 3.0 + 1.0  # of the stop, at a mean speed of 0.5 rad/s
    assert sol.energy.lost_in["stop"] == pytest.approx(impulse / 2.0, rel=1e-12)
    assert sol.energy.lost_in["gear"] == pytest.approx(5.0 - impulse / 2.0, rel=1e-12)


@cache
def hammers(order: str, second: str) -> sw.Model:
    """A hammer at one side of a gear at rest, and a second gap between its other side and another inertia."""
    net = sw.Network("both sides")
    for name, J in {"H": J_H, "B": J_B, "C": J_C, "D": 0.5}.items():
        net.add(sw.Inertia(name, J=J), name)
    parts = {
        "1": (sw.Backlash("first", gap=0.2, restitution=0.5), "H", "B"),
        "g": (sw.LossyGear("gear", ratio=2.0, efficiency=0.8), "B", "C"),
        "2": (sw.Backlash("second", gap=0.2, restitution=0.5), *second),
    }
    for letter in order:
        net.add(*parts[letter])
    return net.compile()


@pytest.mark.parametrize("e", [0.0, 0.5])
@pytest.mark.parametrize("order", ["1g2", "g21"])
def test_equal_impacts_on_both_sides_of_a_gear_come_together_in_whatever_order(order: str, e: float) -> None:
    """The hammer at b drives, as it gives more than the gear's own side takes: p1 = 3 - w, p2 = (3 - w / 2) / 2."""
    values = {"first.restitution": e, "second.restitution": e}
    sol = hammers(order, "DC").simulate(0.05, initial={"H.omega": 3.0, "D.omega": 3.0}, parameters=values)
    w = (1.5 + 2.0 * 0.8 * 3.0) / ((J_C + 0.5) / 2.0 + 2.0 * 0.8 * (J_H + J_B))
    speeds = {"H": 3.0 - (1 + e) * (3.0 - w), "B": (1 + e) * w, "D": 3.0 - (1 + e) * (3.0 - w / 2.0)}
    assert [sol[f"{name}.omega"][-1] for name in speeds] == pytest.approx([*speeds.values()], rel=1e-12)
    after = "rebound" if e else "in contact"
    assert {event[1:] for event in sol.events if event[1] != "gear"} == {
        (k, "open", after) for k in ("first", "second")
    }


@pytest.mark.parametrize("order", ["1g2", "g21"])
def test_what_touches_behind_a_gear_is_taken_along_in_the_same_instant(order: str) -> None:
    start = {"H.omega": 3.0, "second.phi": 0.1}
    sol = hammers(order, "CD").simulate(0.05, initial=start, parameters={"second.restitution": 0.0})
    w = 3.0 * J_H / (J_H + J_B + (J_C + 0.5) / (2.0**2 * 0.8))
    assert sol["B.omega"][-1] == pytest.approx(1.5 * w, rel=1e-12)
    assert sol["D.omega"][-1] == sol["C.omega"][-1] == pytest.approx(0.75 * w, rel=1e-12)


@pytest.mark.slow
def test_an_impact_through_a_gear_is_the_limit_of_a_stiff_contact() -> None:
    """Braked, at rest and turned round within it: the contact is damped 60 times as much as it takes not to swing."""
    start = {"H.omega": 10.0, "B.omega": -4.0, "C.omega": -2.0}
    rigid, stiff = (train("b", **contact).simulate(0.012, initial=start) for contact in ({}, {"c": 1e7, "d": 1e6}))
    for name in ("H.omega", "B.omega", "C.omega"):
        assert stiff[name][-1] == pytest.approx(rigid[name][-1], abs=1e-3)
        assert abs(rigid[name][-1] - start[name]) > 1.0


def test_a_jump_of_a_prescribed_speed_turns_a_gear_round_with_the_torques_of_both_ways() -> None:
    """The source takes all that it needs: speeds follow the ratio, whatever is lost."""
    net = sw.Network("jump")
    net.add(sw.SpeedSource("drive", omega=sw.Step(-6.0, 0.1, before=2.0)), "a")
    net.add(sw.LossyGear("gear", ratio=2.0, efficiency=0.8), "a", "b")
    net.add(sw.Inertia("J", J=3.0), "b")
    with pytest.warns(sw.NetworkWarning, match="jumps at t = 0.1 s"):
        sol = net.simulate(0.2)
    assert sol["J.omega"][-1] == pytest.approx(-2.0, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("efficiency", [0.7, 0.99, 1.0])
@pytest.mark.parametrize("side", ["a", "b"])
def test_a_stop_on_the_frame_throws_a_geared_train_back(side: str, efficiency: float) -> None:
    """The gear comes to rest with the contact, both held: it is turned by what the contact gives back."""
    ratio, restitution, speed = 2.0, 0.5, 4.0
    net = sw.Network("bounce")
    net.add(sw.Inertia("A", J=1.0), "a")
    net.add(sw.LossyGear("gear", ratio=ratio, efficiency=efficiency), "a", "b")
    net.add(sw.Inertia("B", J=3.0), "b")
    net.add(sw.HardStop("stop", upper=0.5, restitution=restitution), side)
    own, other = (1.0, 3.0 / ratio**2) if side == "a" else (3.0, 1.0 * ratio**2)
    hits = speed if side == "a" else speed / ratio
    braked, thrown = own + efficiency * other, own + other / efficiency
    sol = net.simulate(0.3, initial={"A.omega": speed})
    after = -restitution * hits * math.sqrt(braked / thrown)
    assert sol[f"{side.upper()}.omega"][-1] == pytest.approx(after, rel=1e-12)
    assert sol.energy.lost_in["stop"] == pytest.approx((1 - restitution**2) * braked * hits**2 / 2, rel=1e-12)


def test_a_prescribed_flank_that_hits_a_gear_without_losses_is_that_of_an_ideal_one() -> None:
    ends = []
    for gear in (sw.Gear("gear", ratio=2.0), sw.LossyGear("gear", ratio=2.0, efficiency=1.0)):
        net = sw.Network("flank")
        net.add(sw.SpeedSource("drive", omega=0.3), "f")
        net.add(sw.Backlash("gap", gap=0.1, restitution=0.5), "f", "b")
        net.add(sw.Inertia("B", J=1.0), "b")
        net.add(gear, "b", "c")
        net.add(sw.Inertia("C", J=2.0), "c")
        sol = net.simulate(0.3)
        ends.append((sol["B.omega"][-1], sol.energy.supplied_by["drive"], sol.energy.lost_in["gap"]))
    assert ends[0] == pytest.approx((0.45, 0.3 * 1.5 * 0.45, 0.3 * 1.5 * 0.45 - 1.5 * 0.45**2 / 2), rel=1e-12)
    assert ends[1] == pytest.approx(ends[0], rel=1e-12)


@pytest.mark.parametrize(
    ("part", "to", "supplied", "lost"),
    # 3 rad/s at 2 kg m2 at once: 9 J; the clutch rubs 0.6 s at 1 N m, from 3 rad/s on by 1 rad/s2 less
    [
        (sw.Clutch("part", tau=1.0), 1.0, 9.0 + 1.8, 1.8 - 0.18),
        (sw.LossyGear("part", ratio=2.0, efficiency=0.5), 2.0, 13.5, 2.25),
    ],
    ids=["clutch", "gear"],
)
def test_a_jump_of_a_prescribed_speed_is_supplied_and_what_a_gear_loses_in_it_is_its_own(
    part: sw.Component, to: float, supplied: float, lost: float
) -> None:
    net = sw.Network("jump")
    net.add(sw.SpeedSource("drive", omega=sw.Step(3.0, 0.4)), "a")
    net.add(sw.Inertia("A", J=2.0), "a")
    net.add(part, "a", "b")
    net.add(sw.Inertia("B", J=to), "b")
    with pytest.warns(sw.NetworkWarning, match="jumps at t = 0.4 s"):
        sol = net.simulate(1.0)
    assert sol.energy.supplied[-1] == pytest.approx(supplied, rel=1e-12)
    assert sol.energy.supplied_by["drive"] == pytest.approx(supplied, rel=1e-12)
    assert sol.energy.lost_in["part"] == pytest.approx(lost, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("gears", [1, 3])
def test_small_impacts_leave_gears_alone_that_they_do_not_reach(gears: int) -> None:
    """Ever slower impacts on the one side of a spring, heavy gears on the other: they have rounding, and no impulse."""
    net = sw.Network("elsewhere")
    net.add(sw.Inertia("ball", J=0.1), "a")
    net.add(sw.HardStop("stop", lower=0.0, restitution=0.6), "a")
    net.add(sw.TorqueSource("weight", tau=-1.0), "a")
    net.add(sw.Spring("spring", c=0.01), "a", "n0")
    for k in range(gears):
        net.add(sw.Inertia(f"J{k}", J=3.7 + k), f"n{k}")
        net.add(sw.LossyGear(f"gear{k}", ratio=1.3, efficiency=0.8, efficiency_back=0.6), f"n{k}", f"n{k + 1}")
    net.add(sw.Inertia("last", J=2.9), f"n{gears}")
    sol = net.simulate(2.0, initial={"stop.phi": 0.1, "J0.omega": 3.3})
    assert sum(event[1] == "stop" for event in sol.events) > 15
    assert {event[1] for event in sol.events if event[0] > 0} == {"stop"}


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["heyoka", "scipy", "sundials"])
@pytest.mark.parametrize("seed", [5, 7, 11, 23])
def test_a_jump_that_a_spring_takes_up_is_no_impact_for_a_gear(engine: str, seed: int) -> None:
    """No impulse passes: a gear that turns goes on turning, though rounding might say that it is stopped."""
    random = Random(seed)  # noqa: S311 (no secret)
    net = sw.Network("jump")
    net.add(sw.SpeedSource("drive", omega=sw.Step(random.uniform(1, 3), 0.3)), "d")
    net.add(sw.Spring("first", c=random.uniform(50, 6000)), "d", "a")
    net.add(sw.Inertia("J0", J=random.uniform(0.05, 2)), "a")
    net.add(sw.Spring("second", c=random.uniform(10, 300)), "a", "b")
    net.add(sw.Inertia("J1", J=random.uniform(0.05, 2)), "b")
    net.add(sw.LossyGear("gear", ratio=random.uniform(0.5, 2), efficiency=0.67, efficiency_back=0.4), "b", "c")
    net.add(sw.Inertia("J2", J=random.uniform(0.05, 2)), "c")
    start = {"J0.omega": random.uniform(-3, 3), "J1.omega": random.uniform(-3, 3)}
    sol = net.simulate(0.4, engine=engine, rtol=1e-9, initial=start)
    before, after = (sol.at([t]) for t in (0.3 - 1e-9, 0.3 + 1e-9))
    for name in ("J0.omega", "J1.omega", "J2.omega"):
        assert after[name][0] == pytest.approx(before[name][0], abs=1e-4)  # 2e-9 s at 1e4 rad/s2


def test_impacts_of_one_instant_lose_in_their_own_parts() -> None:
    net = sw.Network("two pairs")
    for k, J in enumerate((1.0, 2.0)):
        net.add(sw.Inertia(f"A{k}", J=J), f"a{k}")
        net.add(sw.Backlash(f"gap{k}", gap=0.1), f"a{k}", f"b{k}")
        net.add(sw.Inertia(f"B{k}", J=2.0), f"b{k}")
    sol = net.simulate(0.1, initial={"A0.omega": 2.0, "A1.omega": 2.0})
    assert [sol.energy.lost_in[f"gap{k}"] for k in (0, 1)] == pytest.approx([4.0 / 3.0, 2.0], rel=1e-12)


def test_what_an_impact_at_the_very_start_loses_in_a_gear_is_in_no_balance() -> None:
    net = sw.Network("start")
    net.add(sw.Inertia("A", J=1.0), "a")
    net.add(sw.LossyGear("gear", ratio=2.0, efficiency=0.7), "a", "b")
    net.add(sw.Inertia("B", J=3.0), "b")
    net.add(sw.Freewheel("stop"), "b", "ground")
    sol = net.simulate(0.1, initial={"A.omega": 4.0})
    assert sol["A.omega"][-1] == 0.0
    assert set(sol.energy.lost_in.values()) == {0.0}


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["heyoka", "scipy", "sundials"])
def test_a_flank_that_cannot_open_where_a_gear_jams_does_not_become_the_other_one(engine: str) -> None:
    """The lower flank would have to pull at what jams: the gear stops by itself, and what has hit it goes on."""
    net = sw.Network("flank before a gear that jams")
    net.add(sw.TorqueSource("pull", tau=-100.0), "a")
    net.add(sw.Inertia("J1", J=2.3), "a")
    net.add(sw.Backlash("gap", gap=0.02, omega_rest=1e-3), "a", "b")
    net.add(sw.Inertia("J2", J=2.3), "b")
    net.add(sw.LossyGear("gear", ratio=-0.61, efficiency=0.97, efficiency_back=-0.2), "b", "c")
    net.add(sw.Inertia("J3", J=7.0), "c")
    sol = net.simulate(0.3, engine=engine, initial={"J1.omega": 0.7, "J2.omega": 1.9})
    after = sol.at([0.008])
    assert (after["J2.omega"][0], after["J3.omega"][0]) == (0.0, 0.0)
    assert after["J1.omega"][0] == pytest.approx(0.7 - 100.0 / 2.3 * 0.008, rel=1e-9)
    assert sol.energy_residual < 1e-12


def jamming(joint: sw.Component, ratio: float, inertias: tuple[float, float, float], torques: tuple[Any, float]) -> Any:
    """A self-locking gear that its load begins to drive, and an inertia that a joint leads to one of its ends."""
    net = sw.Network("jams")
    net.add(sw.Inertia("hung", J=inertias[0]), "c")
    net.add(joint, "c", "b" if isinstance(joint, sw.Freewheel) else "a")
    net.add(sw.Inertia("J1", J=inertias[1]), "a")
    net.add(sw.LossyGear("gear", ratio=ratio, efficiency=0.97, efficiency_back=-0.2), "a", "b")
    net.add(sw.Inertia("J2", J=inertias[2]), "b")
    net.add(sw.TorqueSource("motor", tau=torques[0]), "a")
    net.add(sw.TorqueSource("load", tau=torques[1]), "c")
    return net.compile()


@pytest.mark.parametrize("engine", ["heyoka", "scipy", "sundials"])
@pytest.mark.parametrize(
    ("model", "ratio", "speed", "jams_at", "hung", "driven"),
    [
        # the motor begins to brake; the friction then brakes what is hung, and drives the gear on from rest
        (
            jamming(sw.DryFriction("joint", tau_c=5.0), 0.37, (2.3, 0.1, 9.0), (3.0 - 20.0 * sw.t, 0.0)),
            0.37,
            1.0,
            0.15,
            lambda s: 1.0 + (3.0 * 0.15 - 10.0 * 0.15**2) / (2.4 + 9.0 / (0.37**2 * 0.97)) - 5.0 / 2.3 * s,
            lambda s: (5.0 * s - 10.0 * s**2) / (0.1 + 9.0 / (0.37**2 * 0.97)),
        ),
        # the motor drives the gear less than its load, which goes on by the freewheel when the gear has stopped
        (
            jamming(sw.Freewheel("joint"), 2.0, (3.0, 0.04, 1.0), (-0.5 + 4.0 * sw.t, 8.8)),
            2.0,
            -2.0,
            0.169,
            lambda s: -1.0 + (2.0 * 0.169**2 + (8.8 / 1.94 - 0.5) * 0.169) / (0.08 + 2.0 / 0.97) + 8.8 / 3.0 * s,
            lambda s: (0.176 * s + 2.0 * s**2) / (0.04 + 1.0 / (2.0**2 * 0.97)),
        ),
    ],
    ids=["friction", "freewheel"],
)
def test_what_slips_behind_a_gear_that_jams_keeps_slipping(
    engine: str, model: sw.Model, ratio: float, speed: float, jams_at: float, hung: Any, driven: Any
) -> None:
    """The gear stops at once; through 5 N m of friction, or a freewheel that would pull, nothing else does."""
    speeds = {"J1.omega": speed, "J2.omega": speed / ratio, "hung.omega": 1.0 if ratio < 1 else -1.0}
    initial = {name: speeds[name] for name in model.states if name in speeds}
    sol = model.simulate(jams_at + 0.1, engine=engine, initial=initial)
    assert sol.events[-1][0] == pytest.approx(jams_at, abs=1e-12)
    assert sol.at([sol.events[-1][0]])["J1.omega"][0] == pytest.approx(0.0, abs=1e-9)
    assert sol["hung.omega"][-1] == pytest.approx(hung(0.1), rel=1e-9)
    assert sol["J1.omega"][-1] == pytest.approx(driven(0.1), rel=1e-9)
    assert sol.energy_residual < 1e-9


def test_a_gear_does_not_jam_where_a_freewheel_opens_and_lets_it_turn_on() -> None:
    """The load alone would jam it from 0.235 s on; without it J1 can brake J2, faster than the load follows."""
    model = jamming(sw.Freewheel("joint"), 2.0, (3.0, 0.1, 1.0), (-0.5 + 4.0 * sw.t, 8.8))
    speeds = {"J1.omega": -2.0, "J2.omega": -1.0, "hung.omega": -1.0}
    sol = model.simulate(0.3, initial={name: speeds[name] for name in model.states if name in speeds})
    before = -1.0 + (2.0 * 0.235**2 + (8.8 / 1.94 - 0.5) * 0.235) / (0.2 + 2.0 / 0.97)
    assert ("joint", "locked", "free") in {event[1:] for event in sol.events}
    assert sol["J2.omega"][-1] == pytest.approx(before + (0.44 * 0.065 + 2.0 * 0.065**2) / 0.1, rel=1e-9)
    assert sol["hung.omega"][-1] == pytest.approx(before + 8.8 / 3.0 * 0.065, rel=1e-9)


@pytest.mark.parametrize(
    ("joint", "efficiency_back"),
    [
        (sw.Clutch("joint", tau=400.0), 2 - 1 / 0.45),
        (sw.Clutch("joint", tau=4e5), 2 - 1 / 0.45),
        (sw.DryFriction("joint", tau_c=400.0), 2 - 1 / 0.45),
        (sw.DryFriction("joint", tau_c=4000.0), -0.9),
    ],
)
def test_a_gear_that_would_jam_by_itself_does_not_where_what_is_engaged_answers_with_it(
    joint: sw.Component, efficiency_back: float
) -> None:
    """Jw alone would be braked by more than it can answer; the joint holds, so that Jm answers with it."""
    net = sw.Network("worm")
    net.add(sw.Inertia("Jm", J=0.5), "m")
    net.add(joint, "m", "w")
    net.add(sw.Inertia("Jw", J=0.05), "w")
    net.add(sw.LossyGear("worm", ratio=10.0, efficiency=0.45, efficiency_back=-0.5), "w", "d")
    net.add(sw.Inertia("Jb", J=42.0), "d")
    net.add(sw.TorqueSource("load", tau=-1962.0), "d")
    sol = net.compile().simulate(
        0.5, initial={"Jw.omega": -20.0, "Jm.omega": -20.0}, parameters={"worm.efficiency_back": efficiency_back}
    )
    rate = -efficiency_back * 196.2 / (0.55 + efficiency_back * 0.42)
    (at,) = (event[0] for event in sol.events if event[1] == "worm" and event[3] == "stuck")
    assert at == pytest.approx(20.0 / rate, rel=1e-9)
    assert sol["Jb.omega"][-1] == pytest.approx(0.0, abs=1e-12)
    assert sol.energy_residual < 1e-9


@pytest.mark.parametrize("omega_s", [0.0, 0.1])
@pytest.mark.parametrize("way", [1, -1])
def test_a_friction_behind_a_self_locking_gear_holds_up_to_its_torque_of_rest(omega_s: float, way: int) -> None:
    """2 N m times 3 times 0.7 reach it, more than it has in motion, and less than the 8 N m at rest."""
    parts = [
        (sw.Inertia("J0", J=2.0), "a"),
        (sw.Inertia("J1", J=2.0), "b"),
        (sw.LossyGear("worm", ratio=3.0, efficiency=0.7, efficiency_back=0.0), "a", "b"),
        (sw.DryFriction("friction", tau_c=4.0, tau_s=8.0, omega_s=omega_s), "b"),
        (sw.TorqueSource("motor", tau=sw.Step(-2.0, start=0.25)), "a"),
    ]
    net = sw.Network("worm")
    for part, *nodes in parts[::way]:
        net.add(part, *nodes)
    sol = net.simulate(1.0)
    assert not sol["J1.omega"].any()
    assert sol["friction.tau"][-1] == pytest.approx(-4.2, rel=1e-9)


def test_a_source_that_jumps_through_zero_gives_in_each_direction_of_power_its_impulse_times_its_mean_speed() -> None:
    """A lossy gear is driven by the inertia down to rest and drives it from there: two stages, one balance."""
    net = sw.Network("reversal")
    net.add(sw.SpeedSource("drive", omega=10 - sw.Step(16.0, 1.0)), "a")
    net.add(sw.LossyGear("gear", ratio=2.0, efficiency=0.8), "a", "b")
    net.add(sw.Inertia("J", J=3.0), "b")
    with pytest.warns(sw.NetworkWarning, match="'drive' jumps"):
        sol = net.simulate(2.0)
    assert sol["J.omega"][-1] == -3.0
    assert sol.energy_residual < 1e-12


@pytest.mark.parametrize("inertia", [0.5, 2.0, 4.5])
def test_a_gear_that_jams_behind_a_damped_spring_starts_again(inertia: float) -> None:
    """As it stops at once the damper pushes it on, and it jams again, ever sooner and in ever smaller steps."""
    net = sw.Network("worm")
    net.add(sw.Inertia("J1", J=2.0), "n0")
    net.add(sw.Spring("spring", c=1000.0, d=0.5), "n0", "n1")
    net.add(sw.Inertia("J2", J=0.1), "n1")
    net.add(sw.LossyGear("worm", ratio=-0.5, efficiency=0.45, efficiency_back=-0.5), "n1", "n2")
    net.add(sw.Inertia("J3", J=inertia), "n2")
    sol = net.simulate(0.5, initial={"J1.omega": 5.0})
    assert sol.energy_residual < 1e-8
    # Euler's steps of 10 us are off by some 2e-3 here, and their error halves with them
    w, torque, gear, step = 5.0, 0.0, 0.0, 1e-5
    for _ in range(round(0.5 / step)):
        passes = torque + 0.5 * (w - gear)
        if gear * passes < 0:  # b cannot drive
            gear, passes = 0.0, torque + 0.5 * w
        torque += step * 1000.0 * (w - gear)
        w, gear = w - step * passes / 2.0, gear + step * passes / (0.1 + inertia / (0.25 * 0.45))
    assert sol["J1.omega"][-1] == pytest.approx(w, abs=4e-3)


@pytest.mark.parametrize("motor", [1.0, 4.0])
@pytest.mark.parametrize(("load", "ratio"), [(-3.0, -20.0), (3.0, 2.0), (-3.0, 2.0)])
@pytest.mark.parametrize("back", [0.3, 0.0, -0.2])
def test_rebounds_before_a_gear_that_rubs_come_to_rest(motor: float, load: float, ratio: float, back: float) -> None:
    """Flights that are each a share of the last end after some twenty; between them the gear changes which side drives.

    With the speeds of the impact's own mode in place of those of the flight they gained what an event comes late, for
    ever.
    """
    net = sw.Network("servo axis")
    net.add(sw.Inertia("J0", J=0.05), "a")
    net.add(sw.TorqueSource("motor", tau=motor), "a")
    net.add(sw.Backlash("gap", gap=0.05, restitution=0.5), "a", "b")
    net.add(sw.Inertia("J1", J=0.0152), "b")
    net.add(sw.LossyGear("gear", ratio=ratio, efficiency=0.4, efficiency_back=back), "b", "c")
    net.add(sw.Inertia("J2", J=0.4569), "c")
    net.add(sw.TorqueSource("load", tau=load), "c")
    sol = net.simulate(2.0)
    times = np.array([time for time, _, _, after in sol.events if after == "rebound"])
    assert 10 <= len(times) <= 24
    flights = np.diff(times)
    assert np.all(flights[3:] < 0.96 * flights[2:-1])
    assert sol.phases[-1].end - sol.phases[-1].start > 0.5
    assert sol.energy_residual < 1e-9
