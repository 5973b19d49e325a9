"""Impacts of rigid flanks, stops and freewheels, alone and several at once, beside momentum and energy by hand."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shaftwork as sw

ENGINES = ("heyoka", "numba", "scipy", "sundials")
# Between impacts every motion is a polynomial of time, and events are located far below the tolerance of the run.
EXACT = 1e-9


def wheel(*parts: sw.Component, J: float = 1.0) -> sw.Network:
    """Parts on the node of one inertia."""
    net = sw.Network("wheel")
    net.add(sw.Inertia("J", J=J), "wheel")
    for part in parts:
        net.add(part, "wheel")
    return net


def row(*between: sw.Component, J: tuple[float, ...] = (1.0, 1.0), impacts: str = "in turn") -> sw.Network:
    """Inertias J1, J2 and so on, with a part between each and the next."""
    net = sw.Network("row", impacts=impacts)
    for k, size in enumerate(J):
        net.add(sw.Inertia(f"J{k + 1}", J=size), "abcd"[k])
    for k, part in enumerate(between):
        net.add(part, "abcd"[k], "abcd"[k + 1])
    return net


def words(sol: sw.Solution) -> list[tuple[str, str, str]]:
    """The events without their times."""
    return [event[1:] for event in sol.events]


def times(sol: sw.Solution) -> list[float]:
    """The times of the events."""
    return [event[0] for event in sol.events]


@cache
def held(restitution: float) -> sw.Model:
    """A gap before what dry friction holds."""
    net = row(sw.Backlash("gap", gap=0.2, restitution=restitution))
    net.add(sw.DryFriction("shoe", tau_c=1.0), "b")
    return net.compile()


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_what_dry_friction_holds_is_moved_by_an_impact_and_no_momentum_is_lost(restitution: float, engine: str) -> None:
    sol = held(restitution).simulate(0.12, initial={"J1.omega": 1.0}, engine=engine)
    after = "rebound" if restitution else "in contact"
    assert words(sol) == [("gap", "open", after), ("shoe", "stuck", "slipping forward")]
    assert times(sol) == pytest.approx([0.1, 0.1], abs=EXACT)
    # 0.02 s of friction after it
    assert sol["J1.omega"][-1] + sol["J2.omega"][-1] == pytest.approx(1.0 - 0.02, abs=EXACT)
    assert sol.energy.lost_in["gap"] == pytest.approx((1.0 - restitution**2) / 4.0, abs=EXACT)


def test_an_impact_turns_the_side_of_a_friction_that_slips() -> None:
    # they come nearer at 1.5 - t, and exchange their speeds
    sol = held(1.0).simulate(0.1, initial={"J1.omega": 1.0, "J2.omega": -0.5})
    assert words(sol) == [("gap", "open", "rebound"), ("shoe", "slipping backward", "slipping forward")]
    hit = (1.5 - math.sqrt(1.5**2 - 0.2)) / 1.0
    assert times(sol) == pytest.approx([hit, hit], abs=EXACT)
    assert sol.at([hit + 1e-7])["J2.omega"] == pytest.approx([1.0], abs=1e-6)


def test_a_rebound_that_lets_frictions_before_it_slip_starts_at_the_limit() -> None:
    """Its equations are not those of the flight before, and the little beyond the limit would add up."""
    net = row(sw.DryFriction("first", tau_c=0.5), sw.Backlash("gap", gap=0.2, restitution=0.3), J=(2.0, 2.0, 2.0))
    net.add(sw.DryFriction("shoe", tau_c=1.0), "a")
    net.add(sw.TorqueSource("pull", tau=-2.0), "c")
    sol = net.simulate(1.0)
    assert ("first", "stuck") in {(part, before) for part, before, _ in words(sol)}
    hits = [time for time, *_, after in sol.events if after == "rebound"]
    assert len(hits) > 5
    assert hits[0] == pytest.approx(math.sqrt(0.2), abs=EXACT)
    # it is found late by rounding, and has flown on meanwhile
    np.testing.assert_allclose(sol.at(hits)["gap.phi"], 0.1, rtol=0, atol=1e-12)
    assert sol.energy_residual < 1e-9


def test_the_last_of_a_row_takes_the_speed_of_the_first() -> None:
    """Newton's cradle: the second and the third touch before the impact, which goes through both in one instant."""
    net = row(*(sw.Backlash(name, gap=0.2, restitution=1.0) for name in ("first", "second")), J=(1.0, 1.0, 1.0))
    sol = net.simulate(0.2, initial={"J1.omega": 1.0, "second.phi": 0.1})
    assert words(sol) == [("first", "open", "rebound"), ("second", "open", "rebound")]
    speeds = [sol[f"J{k}.omega"][-1] for k in (1, 2, 3)]
    assert speeds == pytest.approx([0.0, 0.0, 1.0], abs=EXACT)


def test_the_rest_of_a_row_takes_an_impact_as_one_where_impacts_are_together(tmp_path: Path) -> None:
    """Moreau: the first flies back by all of its speed, and the impulse of the second is what keeps it closed."""
    gaps = [sw.Backlash(name, gap=0.2, restitution=1.0) for name in ("first", "second")]
    net = row(*gaps, J=(1.0, 1.0, 1.0))
    net.impacts = "together"
    net.save(tmp_path / "row.toml")
    sol = sw.Network.load(tmp_path / "row.toml").simulate(0.2, initial={"J1.omega": 1.0, "second.phi": 0.1})
    assert words(sol) == [("first", "open", "rebound"), ("second", "open", "in contact")]
    speeds = [sol[f"J{k}.omega"][-1] for k in (1, 2, 3)]
    assert speeds == pytest.approx([-1 / 3, 2 / 3, 2 / 3], abs=EXACT)
    assert sol.energy_residual < 1e-12


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("impacts", ["in turn", "together"])
def test_two_that_hit_a_third_from_both_sides_leave_it_where_it_is(restitution: float, impacts: Any) -> None:
    gaps = [sw.Backlash(name, gap=0.2, restitution=restitution) for name in ("first", "second")]
    net = row(*gaps, J=(1.0, 3.0, 1.0))
    net.impacts = impacts
    sol = net.simulate(0.2, initial={"J1.omega": 1.0, "J3.omega": -1.0})
    speeds = [sol[f"J{k}.omega"][-1] for k in (1, 2, 3)]
    assert speeds == pytest.approx([-restitution, 0.0, restitution], abs=EXACT)
    assert [sol.energy.lost_in[name] for name in ("first", "second")] == pytest.approx(
        [(1 - restitution**2) / 2] * 2, abs=EXACT
    )


def test_a_freewheel_locks_in_the_impact_of_another_part() -> None:
    """What is hit takes what it would overrun along in the same instant: v2 = v3, and v2 - v1 = e at the hammer."""
    net = row(sw.Backlash("gap", gap=0.2, restitution=0.5), sw.Freewheel("clutch"), J=(1.0, 1.0, 1.0))
    sol = net.simulate(0.2, initial={"J1.omega": 1.0})
    assert sol["J2.omega"][-1] == sol["J3.omega"][-1] == pytest.approx(0.5, abs=EXACT)
    assert sol["J1.omega"][-1] == pytest.approx(0.0, abs=EXACT)
    assert sol.energy.lost_in["gap"] == pytest.approx(0.25, abs=EXACT)


@pytest.mark.parametrize("restitutions", [(0.9, 0.1), (0.1, 0.9)])
@pytest.mark.parametrize("geared", [False, True])
def test_contacts_side_by_side_share_their_impulse_in_whatever_order(
    restitutions: tuple[float, float],
    geared: bool,  # noqa: FBT001
) -> None:
    """Each gives back its share of half of it: together e = 0.5."""
    net = row(sw.Backlash("first", gap=0.2, restitution=restitutions[0]))
    net.add(sw.Backlash("second", gap=0.2, restitution=restitutions[1]), "a", "c" if geared else "b")
    if geared:
        net.add(sw.Gear("gear", ratio=1.0), "b", "c")
    sol = net.simulate(0.15, initial={"J1.omega": 1.0})
    assert [sol[f"J{k}.omega"][-1] for k in (1, 2)] == pytest.approx([0.25, 0.75], abs=EXACT)


def test_an_unknown_law_for_impacts_at_once_is_refused() -> None:
    with pytest.raises(sw.ParameterError, match=r"impacts = 'all' must be one of: 'in turn', 'together'"):
        sw.Network("row", impacts="all")  # type: ignore[arg-type]


def test_inelastic_impacts_join_a_row_with_the_mean_of_its_momentum() -> None:
    net = row(*(sw.Backlash(name, gap=0.2) for name in ("first", "second")), J=(1.0, 1.0, 1.0))
    sol = net.simulate(1.0, initial={"J1.omega": 3.0, "J2.omega": 0.5})
    assert [event[2] for event in words(sol)] == ["in contact", "in contact"]
    assert sol["J1.omega"][-1] == pytest.approx(3.5 / 3.0, abs=EXACT)
    assert sol["J1.omega"][-1] == sol["J2.omega"][-1] == sol["J3.omega"][-1]


def test_a_freewheel_that_starts_overrun_the_wrong_way_locks_at_once_with_an_impact() -> None:
    """A motion begins with what is stored after it."""
    sol = row(sw.Freewheel("clutch"), J=(1.0, 3.0)).simulate(1.0, initial={"J1.omega": 8.0, "J2.omega": 4.0})
    assert sol.events == ((0.0, "clutch", "free", "locked"),)
    assert sol["J1.omega"][0] == sol["J1.omega"][-1] == sol["J2.omega"][-1] == pytest.approx(5.0, abs=EXACT)
    assert sol.energy.stored[0] == pytest.approx(50.0)
    assert sol.energy_residual < 1e-12


def test_what_hits_a_wheel_that_a_backstop_holds_stops_with_it() -> None:
    net = row(sw.Backlash("gap", gap=0.2))
    net.add(sw.Freewheel("backstop"), "ground", "a")
    sol = net.simulate(1.0, initial={"J2.omega": 1.0})
    moving = net.simulate(1.0, initial={"J2.omega": -1.0})
    assert sol["J1.omega"][-1] == sol["J2.omega"][-1] == pytest.approx(0.5, abs=EXACT)
    assert times(moving)[-1] == pytest.approx(0.1, abs=EXACT)
    assert moving.phases[-1].modes == {"gap": "in contact", "backstop": "locked"}
    assert moving["J1.omega"][-1] == moving["J2.omega"][-1] == 0.0


def test_what_opens_again_in_the_instant_of_its_impact_has_lost_its_speed() -> None:
    """Closed for no time at all: a torque pulls it back off the stop that has taken its speed."""
    sol = wheel(sw.TorqueSource("pull", tau=-1.0), sw.HardStop("stop", upper=1.0)).simulate(
        1.5, initial={"J.omega": 2.0}
    )
    hit = 2.0 - math.sqrt(2.0)
    assert times(sol) == pytest.approx([hit, hit], abs=EXACT)
    assert words(sol) == [("stop", "open", "in contact"), ("stop", "in contact", "open")]
    assert sol["J.omega"][-1] == pytest.approx(-(1.5 - hit), abs=EXACT)


@cache
def dropped() -> sw.Model:
    """A wheel that a torque drives onto a stop."""
    stop = sw.HardStop("stop", upper=0.1, restitution=0.5)
    return wheel(sw.TorqueSource("weight", tau=20.0), stop).compile()


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("weight", [20.0, 2000.0])
def test_rebounds_against_a_push_come_to_rest_however_short_the_flights(weight: float, engine: str) -> None:
    """The last ones are shorter than rounding lets them be found, and would then lose no energy any more."""
    sol = dropped().simulate(2.0, engine=engine, parameters={"weight.tau": weight})
    hits = times(sol)
    first, speed = math.sqrt(0.2 / weight), math.sqrt(0.2 * weight)
    starts = first + np.cumsum([0.0, *(2.0 * speed * 0.5**n / weight for n in range(1, len(hits)))])
    # a stop is found some 1e-13 rad late, which at the last speeds, 1e-6 rad/s, is a good part of a flight of 1e-6 s
    np.testing.assert_allclose(hits, starts, rtol=0, atol=3e-6)
    np.testing.assert_allclose(hits[:6], starts[:6], rtol=0, atol=EXACT)
    assert sol.phases[-1].modes == {"stop": "in contact"}
    assert not sol["J.omega"][-1]
    assert len(hits) < 30


def test_a_rebound_that_loses_nothing_goes_on_however_strong_the_push() -> None:
    sol = dropped().simulate(1.0, parameters={"weight.tau": 2000.0, "stop.restitution": 1.0})
    first = math.sqrt(0.2 / 2000.0)
    np.testing.assert_allclose(times(sol), first * np.arange(1, 101, 2), atol=1e-8)
    assert sol.energy_residual < 1e-9


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_what_has_no_inertia_is_not_thrown_back(restitution: float) -> None:
    """The end of a damper that a torque pushes against a stop stays there, with its force."""
    net = sw.Network("damper")
    net.add(sw.TorqueSource("push", tau=2.0), "end")
    net.add(sw.Damper("oil", d=1.0), "end")
    net.add(sw.HardStop("stop", upper=0.1, restitution=restitution), "end", "wheel")
    net.add(sw.Inertia("J", J=4.0), "wheel")
    sol = net.simulate(0.5)
    assert words(sol) == [("stop", "open", "in contact")]
    assert times(sol) == pytest.approx([0.05], abs=EXACT)
    assert sol["J.omega"][-1] == pytest.approx(2.0 * (1.0 - math.exp(-0.45 / 4.0)), abs=1e-7)


def test_events_at_one_instant_all_happen() -> None:
    """A spring stop, a rebound, a rigid stop and a brake, each on a wheel of its own."""
    net = sw.Network("several")
    stops = ({"c": 10.0}, {"restitution": 1.0}, {})
    for k, given in enumerate(stops, start=1):
        net.add(sw.Inertia(f"J{k}", J=1.0), f"wheel {k}")
        net.add(sw.HardStop(f"stop{k}", upper=1.0, **given), f"wheel {k}")
    net.add(sw.Inertia("J4", J=1.0), "wheel 4")
    net.add(sw.Brake("brake", tau=1.0, t_on=1.0), "wheel 4")
    sol = net.simulate(1.5, initial={f"J{k}.omega": 1.0 for k in (1, 2, 3, 4)})
    assert times(sol) == pytest.approx([1.0] * 4, abs=1e-12)
    assert sorted(words(sol)) == [
        ("brake", "released", "slipping forward"),
        ("stop1", "open", "in contact"),
        ("stop2", "open", "rebound"),
        ("stop3", "open", "in contact"),
    ]
    ends = [sol[f"J{k}.omega"][-1] for k in (1, 2, 3, 4)]
    assert ends == pytest.approx([math.cos(0.5 * math.sqrt(10.0)), -1.0, 0.0, 0.5], abs=1e-7)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("beyond", "touches"), [(-1e-6, False), (1e-6, True), (1e-3, True)])
def test_a_grazing_contact_is_found_if_there_is_one(beyond: float, touches: bool, engine: str) -> None:  # noqa: FBT001
    """An oscillation whose peak lies a millionth before or beyond a stop, in steps far longer than the contact."""
    sol = grazing().simulate(4.0, initial={"J.omega": 1.0 + beyond}, engine=engine, rtol=1e-9)
    assert words(sol) == ([("stop", "open", "in contact"), ("stop", "in contact", "open")] if touches else [])
    if touches:
        assert times(sol)[0] == pytest.approx(math.asin(1.0 / (1.0 + beyond)), abs=1e-5)  # flat: an error has its root


@cache
def grazing() -> sw.Model:
    """An oscillator beside a stop."""
    net = wheel(sw.HardStop("stop", upper=1.0, c=2.0))
    net.add(sw.Spring("spring", c=1.0), "wheel", "ground")
    return net.compile()


@pytest.mark.parametrize(("to", "after"), [(-1.0, "open"), (2.0, "in contact")])
def test_a_contact_passes_on_a_jump_of_a_prescribed_speed_only_where_it_is_pressed(to: float, after: str) -> None:
    net = sw.Network("jump")
    net.add(sw.SpeedSource("drive", omega=sw.Step(to - 1.0, 1.0, before=1.0)), "a")
    net.add(sw.Backlash("gap", gap=0.1), "a", "b")
    net.add(sw.Inertia("J", J=1.0), "b")
    sol = net.simulate(1.02)  # before the gap is closed on its other side
    assert sol.phases[-1].modes == {"gap": after}
    assert sol["J.omega"][-1] == pytest.approx(max(to, 1.0), abs=EXACT)
    assert sol.energy_residual < 1e-12


@pytest.mark.parametrize(
    ("parts", "says"),
    [
        (
            (sw.Freewheel("clutch"), sw.SpeedSource("other", omega=0.5)),
            "'clutch' can neither stay free nor become lock",
        ),
        (
            (sw.Backlash("gap", gap=0.2), sw.HardStop("stop", upper=0.5)),
            "'stop' can neither .* become in contact .* blocked",
        ),
    ],
    ids=["two sources", "source against a stop"],
)
def test_what_cannot_go_on_says_which_parts_contradict_each_other(
    parts: tuple[sw.Component, sw.Component], says: str
) -> None:
    net = sw.Network("jammed")
    net.add(sw.SpeedSource("drive", omega=sw.t), "a")
    net.add(parts[0], "a", "b")
    net.add(parts[1], "b")
    net.add(sw.Inertia("J", J=1.0), "b")
    with pytest.raises(sw.SimulationError, match=says):
        net.simulate(2.0)


@pytest.mark.parametrize("law", ["in turn", "together"])
def test_flanks_without_a_gap_that_lose_nothing_hit_each_other_for_ever(law: str) -> None:
    model = row(sw.Backlash("gap", gap=0.2, restitution=1.0), impacts=law).compile()
    with pytest.raises(sw.SimulationError, match="'gap' have no gap between them and hit each other for ever"):
        model.simulate(1.0, initial={"J1.omega": 1.0}, parameters={"gap.gap": 0.0})
    sol = model.simulate(1.0, initial={"J1.omega": 1.0}, parameters={"gap.gap": 0.0, "gap.restitution": 0.5})
    assert sol["J1.omega"][-1] == sol["J2.omega"][-1] == pytest.approx(0.5, abs=EXACT)


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_what_a_source_gives_in_an_impact_is_supplied_and_half_of_it_lost_where_nothing_is_thrown_back(
    restitution: float,
) -> None:
    """A wheel at rest behind a gap is taken along by a prescribed speed, whose momentum has no bounds."""
    net = sw.Network("taken along")
    net.add(sw.SpeedSource("drive", omega=10.0), "a")
    net.add(sw.Backlash("gap", gap=1.0, restitution=restitution), "a", "b")
    net.add(sw.Inertia("J", J=1.0), "b")
    sol = net.simulate(0.06)
    end = (1.0 + restitution) * 10.0
    assert sol["J.omega"][-1] == pytest.approx(end, rel=EXACT)
    assert sol.energy.supplied_by["drive"] == pytest.approx(10.0 * end, rel=EXACT)
    assert sol.energy.lost_in["gap"] == pytest.approx(10.0 * end - end**2 / 2.0, abs=1e-6)
    assert sol.energy_residual < 1e-12


@pytest.mark.parametrize(
    ("part", "initial", "says"),
    [
        (sw.HardStop("stop", lower=0.3, upper=1.0), {}, "HardStop 'stop' .* 0 rad, below its lower limit of 0.3 rad"),
        (sw.HardStop("stop", upper=-1.0), {}, "HardStop 'stop' .* 0 rad, above its upper limit of -1 rad"),
        (sw.Backlash("gap", gap=0.05), {"gap.phi": 0.03}, r"'gap' .* 0.03 rad, .* 0.025 rad.*initial={'gap.phi'"),
    ],
)
def test_no_motion_starts_beyond_a_rigid_limit(part: sw.Component, initial: dict[str, float], says: str) -> None:
    net = sw.Network("limits")
    net.add(sw.Inertia("J", J=2.0), "a")
    net.add(sw.Inertia("K", J=1.0), "b")
    net.add(part, "a", "b")
    with pytest.raises(sw.ParameterError, match=says):
        net.simulate(2.0, initial={"J.omega": 0.2, **initial})


def pressed() -> sw.Model:
    """Five masses: a stop that throws back, and a gap that does not, pressed against each other."""
    net = sw.Network("pressed")
    for number, J in enumerate((1.5892128336542986, 2.216969704464396, 0.3346968332061752, 0.2362585753905525)):
        net.add(sw.Inertia(f"J{number}", J=J), f"n{number}")
    net.add(sw.Inertia("J4", J=0.21132514115829443), "n4")
    steps = sw.Step(8.76574600623634), sw.Step(-54.742562493844, start=0.501944124301275)
    net.add(sw.TorqueSource("m", tau=steps[0] + steps[1]), "n0")
    net.add(sw.Spring("c0", c=1408.576063908498, d=0.4905751005959569), "n0", "n1")
    limits = {"upper": 0.3413892336975171, "lower": -0.12063797860319042}
    net.add(sw.HardStop("c1", **limits, restitution=0.4129001235032102), "n1", "n2")
    net.add(sw.Backlash("c2", gap=0.0022155318944598653), "n2", "n3")
    limits = {"upper": 0.49710803155026817, "lower": -0.3810826013364473}
    net.add(sw.HardStop("c3", **limits, restitution=0.3786360634846357), "n3", "n4")
    friction = {"tau_c": 2.479653261703887, "tau_s": 6.897765453296293, "d": 0.2607803354458401}
    net.add(sw.DryFriction("x0", **friction), "n3")
    net.add(sw.Brake("x1", tau=9.458010294942493, t_on=1.1296492548011792), "n1")
    net.add(sw.HardStop("x2", upper=1.7163860631233132, lower=-2.292273970161299, c=596.7380482041723, d=0.546), "n2")
    return net.compile()


@pytest.mark.slow
def test_contacts_that_part_each_other_come_to_rest() -> None:
    """Two that push the same inertia the same way: an impact of either parts the other, by ever less."""
    runs = {engine: pressed().simulate(3.0, engine=engine, t_eval=2) for engine in ("heyoka", "scipy")}
    for engine, sol in runs.items():
        assert len(sol.events) < 1000
        assert sol.energy_residual < 1e-8, engine
        for number in range(5):  # hundreds of rebounds down to 1e-6 rad/s leave 1e-7 of what they move open
            name = f"J{number}.omega"
            assert sol[name][-1] == pytest.approx(runs["scipy"][name][-1], rel=1e-6), engine


def test_a_freewheel_that_an_impact_closes_gives_no_energy() -> None:
    """Of the 1.625 J of what is stopped no part can lose more, and none less than nothing."""
    net = row(sw.Freewheel("freewheel"))
    net.add(sw.HardStop("stop", upper=0.15), "b")
    sol = net.simulate(0.3, initial={"J1.omega": 1.0, "J2.omega": 1.5})
    lost = sol.energy.lost_in
    assert sum(lost.values()) == pytest.approx(1.625, rel=EXACT)
    assert all(value >= 0 for value in lost.values())


@pytest.mark.parametrize("massless", [True, False])
def test_two_freewheels_in_a_row_let_what_is_before_them_stop_and_what_is_behind_them_go_on(
    massless: bool,  # noqa: FBT001
) -> None:
    net = sw.Network("row")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.TorqueSource("motor", tau=5.0), "a")
    net.add(sw.HardStop("stop", upper=0.5), "a")
    net.add(sw.Freewheel("first"), "a", "b")
    net.add(sw.Damper("between", d=0.001), "b")
    if not massless:
        net.add(sw.Inertia("J", J=1e-9), "b")
    net.add(sw.Freewheel("second"), "b", "c")
    net.add(sw.Inertia("J2", J=1.0), "c")
    net.add(sw.Damper("behind", d=0.1), "c")
    sol = net.simulate(0.1, initial={"J1.omega": 10.0, "J2.omega": 10.0})
    hit = next(event[0] for event in sol.events if event[1] == "stop")
    before = 5.0 / 0.101 + (10.0 - 5.0 / 0.101) * math.exp(-hit * 0.101 / 2.0)  # all turns as one
    assert sol["J1.omega"][-1] == pytest.approx(0.0, abs=1e-12)
    assert sol["J2.omega"][-1] == pytest.approx(before * math.exp(-0.1 * (0.1 - hit)), rel=1e-8)
    assert sol.energy.lost_in["stop"] == pytest.approx(before**2 / 2, rel=1e-7)
    assert sol.energy_residual < 1e-9


@pytest.mark.parametrize("restitution", [0.0, 0.3])
def test_rigid_flanks_without_a_gap_go_on_together_where_the_torque_turns_round(restitution: float) -> None:
    net = sw.Network("gap of zero")
    net.add(sw.Inertia("Jc", J=0.45), "c")
    net.add(sw.Inertia("Jd", J=0.54), "d")
    net.add(sw.TorqueSource("motor", tau=sw.Step(-39.26, start=0.05, before=23.13)), "d")
    net.add(sw.Backlash("gap", gap=0.0, restitution=restitution), "c", "d")
    sol = net.simulate(0.3)
    for name in ("Jc.omega", "Jd.omega"):
        assert sol[name][-1] == pytest.approx((23.13 * 0.05 - 16.13 * 0.25) / 0.99, rel=1e-12)
    assert {event[0] for event in sol.events} == {0.0, 0.05}
    assert sol.phases[-1].name == "gap in contact"


@pytest.mark.parametrize("order", [range(8), range(7, -1, -1), (2, 6, 1, 4, 0, 5, 3, 7)])
def test_a_contact_without_a_gap_takes_an_impact_from_either_side_whatever_it_was_pressed_by(order: list[int]) -> None:
    """At 1 rad/s J1 hits J0, and J2 goes with it: 0.2 rad/s together, and 0.3 after half of 0.4 N m s has come back."""
    parts = [
        (sw.Inertia("J0", J=1.0), "n0"),
        (sw.Inertia("J1", J=0.5), "n1"),
        (sw.Inertia("J2", J=1.0), "n2"),
        (sw.HardStop("stop", upper=0.2, restitution=0.5), "n1", "n0"),
        (sw.Backlash("claw", gap=0.0), "n0", "n2"),
        (sw.Brake("brake", tau=4.0), "n2"),
        (sw.CoulombLoad("load", tau=4.0), "n0"),
        (sw.TorqueSource("motor", tau=3.0), "n2"),
    ]
    net = sw.Network("claw")
    for k in order:
        net.add(parts[k][0], *parts[k][1:])
    sol = net.simulate(0.25, initial={"J0.omega": -0.5, "J2.omega": -0.5, "J1.omega": 1.0})
    hits = next(time for time, part, *_ in sol.events if part == "stop")
    # then 4 N m of brake and 4 N m of load act against 3 N m
    assert sol["J0.omega"][-1] == pytest.approx(0.3 - 2.5 * (0.25 - hits), rel=1e-9)
    assert sol["J2.omega"][-1] == pytest.approx(sol["J0.omega"][-1], rel=1e-9)
    assert sol["J1.omega"][-1] == pytest.approx(-0.2, rel=1e-9)


@pytest.mark.parametrize("restitution", [0.0, 0.5])
@pytest.mark.parametrize("way", [1, -1])
def test_flanks_without_a_gap_change_sides_where_a_freewheel_catches_up(restitution: float, way: int) -> None:
    """From 5/26 s on J2 drives J0, and the claw presses J1 on its other flank."""
    parts = [
        (sw.Inertia("J0", J=3.0), "n0"),
        (sw.Inertia("J1", J=2.0), "n1"),
        (sw.Inertia("J2", J=2.0), "n2"),
        (sw.Backlash("claw", gap=0.0, restitution=restitution), "n0", "n1"),
        (sw.Freewheel("freewheel"), "n2", "n0"),
        (sw.TorqueSource("T0", tau=-6.0), "n0"),
        (sw.TorqueSource("T2", tau=8.0), "n2"),
    ]
    net = sw.Network("claw")
    for part, *nodes in parts[::way]:
        net.add(part, *nodes)
    sol = net.simulate(0.5, initial={"J2.omega": -1.0})
    wanted = -1.2 * 5 / 26 + 2 / 7 * (0.5 - 5 / 26)
    for name in ("J0.omega", "J1.omega", "J2.omega"):
        assert sol[name][-1] == pytest.approx(wanted, rel=1e-9)
