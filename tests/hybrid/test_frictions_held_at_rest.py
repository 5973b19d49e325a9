"""Frictions whose torque falls at once as soon as they move, while others hold them at rest: each holds up to tau_s."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
import sympy

import shaftwork as sw

ENGINES = ("heyoka", "scipy", "sundials")
# Events are located far below the tolerance of the runs, and every motion but the swinging ones is a polynomial.
EXACT = 1e-9
FRICTIONS = {"weak": (5.0, 6.0), "strong": (3.0, 10.0), "sticky": (0.0, 4.0)}
"""tau_c and tau_s."""


def friction(name: str, tau_c: float, tau_s: float) -> sw.DryFriction:
    return sw.DryFriction(name, tau_c=tau_c, tau_s=tau_s, omega_s=0.0)


def pulled(tau: object, *parts: sw.Component) -> sw.Network:
    """Parts and a torque on the node of one inertia of 1 kg m^2."""
    net = sw.Network("pulled")
    net.add(sw.Inertia("J", J=1.0), "wheel")
    net.add(sw.TorqueSource("pull", tau=tau), "wheel")
    for part in parts:
        net.add(part, "wheel")
    return net


@pytest.mark.slow
@pytest.mark.parametrize("names", [*permutations(FRICTIONS)])
def test_frictions_on_a_shaft_give_way_in_their_order_at_the_sums_of_what_they_hold(names: tuple[str, ...]) -> None:
    sol = pulled(sw.t, *(friction(name, *FRICTIONS[name]) for name in names)).simulate(25.0)
    holds = np.cumsum([FRICTIONS[name][1] for name in names])
    assert [event[1] for event in sol.events] == list(names)
    assert [event[0] for event in sol.events] == pytest.approx(holds, abs=EXACT)
    for name, ends in zip(names, holds, strict=True):
        tau_c, tau_s = FRICTIONS[name]
        shown = sol.at([ends + 0.1, 19.9, 20.1])[f"{name}.tau"]
        assert shown == pytest.approx([tau_s if ends < 19.9 else tau_c, min(tau_s, 19.9 - ends + tau_s), tau_c])
    # 20 N m are held, and 8 rub
    assert not sol["J.omega"][sol.t < 20.0].any()
    assert sol["J.omega"][-1] == pytest.approx((25.0**2 - 20.0**2) / 2 - 8.0 * 5.0, abs=1e-8)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("first", ["shoe", "brake"])
def test_friction_and_a_brake_hold_together_what_each_of_them_can(first: str, engine: str) -> None:
    parts = {"shoe": friction("shoe", 3.0, 10.0), "brake": sw.Brake("brake", tau=7.0)}
    net = pulled(sw.t, *(parts[name] for name in sorted(parts, key=lambda name: name != first)))
    sol = net.simulate(20.0, engine=engine, rtol=1e-10)
    assert [event[0] for event in sol.events] == pytest.approx([{"shoe": 10.0, "brake": 7.0}[first], 17.0], abs=EXACT)
    assert sol["J.omega"][-1] == pytest.approx((20.0**2 - 17.0**2) / 2 - 10.0 * 3.0, abs=1e-8)


@pytest.mark.parametrize("speed", [0.5, -0.5])
@pytest.mark.parametrize("order", ["brake worm", "worm brake"])
def test_a_brake_and_a_worm_that_have_stopped_hold_as_from_rest(order: str, speed: float) -> None:
    parts = {
        "brake": (sw.Brake("brake", tau=25.0), "shaft"),
        "worm": (sw.LossyGear("worm", ratio=30.0, efficiency=0.45, efficiency_back=-0.2), "shaft", "drum"),
    }
    net = sw.Network("hoist")
    net.add(sw.Inertia("J", J=0.3), "shaft")
    net.add(sw.TorqueSource("motor", tau=sw.Step(-20.0, start=1.0, before=20.0)), "shaft")
    for name in order.split():
        net.add(*parts[name])
    net.add(sw.TorqueSource("load", tau=-98.0), "drum")
    stopped, rested = (net.simulate(2.0, initial={"J.omega": w}).at([0.5, 1.5]) for w in (speed, 0.0))
    for name in ("J.omega", "brake.tau", "worm.tau_a", "worm.tau_b"):
        assert stopped[name] == pytest.approx(rested[name], abs=EXACT)
    assert not stopped["J.omega"].any()
    assert stopped["brake.tau"][1] == pytest.approx(0.0, abs=EXACT)  # the worm alone holds the load


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("order", [("near", "far"), ("far", "near")])
def test_at_rest_the_load_alone_tells_who_carries_also_as_it_falls(order: tuple[str, str], engine: str) -> None:
    """The far brake sits behind a gear of 2 : 1 that turns it the other way round."""
    parts = {"near": (sw.Brake("near", tau=100.0), "wheel"), "far": (sw.Brake("far", tau=40.0), "behind")}
    least = {"near": 100.0, "far": 80.0}[order[0]]
    loads = [0.0, 150.0, 20.0, -150.0, -20.0, 150.0]
    net = pulled(sw.Table([0.0, 1.0, 2.0, 3.0, 4.0, 5.0], loads))
    net.add(sw.Gear("gear", ratio=-2.0), "behind", "wheel")
    for name in order:
        net.add(*parts[name])
    times = np.linspace(0.0, 5.0, 41) + 0.01
    shown = net.simulate(5.2, engine=engine).at(times)
    load = np.interp(times, range(6), loads)
    carried = {"near": shown["near.tau"], "far": -2.0 * shown["far.tau"]}
    np.testing.assert_allclose(carried[order[0]], np.clip(load, -least, least), rtol=0, atol=1e-9)
    np.testing.assert_allclose(carried["near"] + carried["far"], load, rtol=0, atol=1e-9)
    assert not shown["J.omega"].any()


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_friction_that_has_given_way_at_rest_holds_again_what_a_brake_lets_go(engine: str) -> None:
    """Up to 12 N m and down to 4: 10 hold them alone, and the 3 of a shoe that slides would not."""
    net = pulled(12.0 * sympy.sin(sw.t), friction("shoe", 3.0, 10.0), sw.Brake("brake", tau=20.0, t_off=2.8))
    sol = net.simulate(3.0, engine=engine)
    assert not sol["J.omega"].any()
    # the brake lets go before the shoe does
    assert sol.at([2.7, 2.9])["shoe.tau"] == pytest.approx(12.0 * np.sin([2.7, 2.9]), abs=EXACT)
    assert sol.at([1.5, 2.7, 2.9])["brake.tau"] == pytest.approx([12.0 * np.sin(1.5) - 10.0, 0.0, 0.0], abs=EXACT)
    assert {event[1:] for event in sol.events[1:]} == {
        ("shoe", "slipping forward", "stuck"),
        ("brake", "locked", "released"),
    }


@pytest.mark.slow
def test_a_bend_of_a_torque_lets_the_last_one_go_first() -> None:
    net = pulled(
        sw.Table([0.0, 12.0, 19.0], [0.0, 12.0, 5.0]), friction("shoe", 3.0, 10.0), sw.Brake("brake", tau=20.0)
    )
    sol = net.simulate(20.0)
    assert [event[1:] for event in sol.events] == [
        ("shoe", "stuck", "slipping forward"),
        ("shoe", "slipping forward", "stuck"),
    ]
    assert sol.at([11.0, 13.0, 18.0])["brake.tau"] == pytest.approx([1.0, 1.0, 0.0], abs=EXACT)


@pytest.mark.parametrize("engine", ENGINES)
def test_friction_beside_a_backstop_lets_go_of_it_where_it_holds_alone(engine: str) -> None:
    sol = pulled(12.0 * sympy.sin(sw.t), friction("shoe", 3.0, 10.0), sw.Freewheel("stop")).simulate(4.0, engine=engine)
    gives_way = np.arcsin(10.0 / 12.0)
    assert [event[0] for event in sol.events] == pytest.approx([gives_way, np.pi - gives_way], abs=EXACT)
    assert [event[1:] for event in sol.events] == [
        ("shoe", "stuck", "slipping forward"),
        ("shoe", "slipping forward", "stuck"),
    ]
    assert not sol["J.omega"].any()


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("falls", [(0.0, 1.0), (1.0, 0.0)])
def test_frictions_on_both_sides_of_a_gear_do_what_one_of_their_sums_does(
    falls: tuple[float, float], engine: str
) -> None:
    """One may fall at once by much and another not at all: on the way from rest their difference pulls either way."""

    def geared(*parts: tuple[sw.Component, str]) -> sw.Solution:
        net = pulled(14.0 * sympy.sin(sw.t) + sw.t / 2)
        net.add(sw.Gear("gear", ratio=2.0), "wheel", "slow")
        net.add(sw.Inertia("J2", J=2.0), "slow")
        for part, node in parts:
            net.add(part, node)
        start = {"J.omega": 2.0, "J2.omega": 1.0}
        return net.simulate(14.0, engine=engine, rtol=1e-10, t_eval=300, initial=start)

    fast, slow = falls
    both = geared(
        (friction("one", 6.0 - 5.0 * fast, 6.0), "wheel"), (friction("other", 10.0 - 8.0 * slow, 10.0), "slow")
    )
    single = geared((friction("one", 11.0 - 5.0 * fast - 4.0 * slow, 11.0), "wheel"))
    np.testing.assert_allclose(both["J.omega"], single["J.omega"], atol=1e-8)
    assert both.energy_residual < EXACT
    assert np.abs(both["one.tau"]).max() <= 6.0 + EXACT
    assert np.abs(both["other.tau"]).max() <= 10.0 + EXACT


def test_equations_of_a_phase_have_the_torque_of_rest_where_another_part_holds() -> None:
    net = pulled(sw.t, friction("one", 3.0, 10.0), friction("two", 5.0, 6.0))
    held, free = (
        net.equations(phase=f"one slipping forward, two {of}").latex() for of in ("stuck", "slipping forward")
    )
    assert r"\tau_{s,\mathrm{one}}" in held
    assert r"\tau_{c,\mathrm{one}}" not in held
    assert r"\tau_{c,\mathrm{one}}" in free


@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_what_rubs_within_a_planetary_gear_that_a_clutch_locks_does_not_tell_its_motion(order: tuple[int, ...]) -> None:
    """The carrier has no inertia. Both cannot hold together with the teeth, and the friction holds only 0.2 N m."""
    rigid = [
        (sw.DryFriction("friction", tau_c=0.2), "c", "r"),
        (sw.Clutch("clutch", tau=20.0), "s", "c"),
        (sw.PlanetaryGear("planets", ratio=3.0), "s", "c", "r"),
    ]
    net = sw.Network("gearbox")
    net.add(sw.Inertia("J1", J=1.0), "s")
    net.add(sw.Inertia("J3", J=0.5), "r")
    net.add(sw.TorqueSource("motor", tau=7.0), "c")
    for k in order:
        net.add(*rigid[k])
    assert net.simulate(0.3)["J1.omega"][-1] == pytest.approx(7.0 / 1.5 * 0.3, rel=1e-9)
