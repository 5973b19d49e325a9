"""Steady operation of laws that change: which of their levels is read, and that it is said."""

from __future__ import annotations

import warnings
from typing import Any

import pytest
import sympy

import shaftwork as sw
from shaftwork.pipeline.settled import steady_start

WHEEL = sw.Table([0.0, 2.0, 20.0, 30.0, 40.0], [0.0, 0.8e6, 0.8e6, 0.7e6, 0.7e6])


def drive(load: Any) -> sw.Network:
    """A motor that holds its speed, a shaft and a load of N m over time."""
    net = sw.Network("bucket wheel drive")
    net.add(sw.TorqueSource("motor", tau=1e7 * (10.0 - sw.omega)), "a")
    net.add(sw.Inertia("J1", J=1e4), "a")
    net.add(sw.Spring("shaft", c=1e9, d=1e6), "a", "b")
    net.add(sw.Inertia("J2", J=1e4), "b")
    net.add(sw.TorqueSource("load", tau=-load(sw.t) if isinstance(load, sw.Table) else -load), "b")
    return net


def torque(model: sw.Model, **options: float) -> float:
    return model.steady_state(**options)["shaft.tau_c"]


def test_a_table_with_another_level_before_its_end_warns_with_both_times() -> None:
    """0.8 MN m last for 18 s and 0.7 MN m at the end; the shaft carries what the load takes."""
    model = drive(WHEEL).compile()
    said = (
        r"'load' gives -700000 N m and gave -800000 N m at t = 11 s. "
        r"Name the time that is meant, steady_state\(t=41\) or steady_state\(t=11\)"
    )
    with pytest.warns(sw.NetworkWarning, match=said):
        assert torque(model) == pytest.approx(0.7e6, rel=1e-9)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert torque(model, t=41.0) == pytest.approx(0.7e6, rel=1e-9)
        assert torque(model, t=11.0) == pytest.approx(0.8e6, rel=1e-9)


def test_levels_of_a_small_torque_warn_with_the_same_times() -> None:
    small = sw.Table([0.0, 2.0, 20.0, 30.0, 40.0], [0.0, 0.8e-3, 0.8e-3, 0.7e-3, 0.7e-3])
    with pytest.warns(sw.NetworkWarning, match=r"gives -0.0007 N m and gave -0.0008 N m at t = 11 s"):
        torque(drive(small).compile())


@pytest.mark.parametrize(
    ("law", "words"),
    [
        (10 * (1 - sympy.exp(-sw.t)), r"tau = 10 - 10\*exp\(-t\) of TorqueSource 'pull'"),
        (5 * sympy.sin(62.5 * sw.t), r"tau = 5\*sin\(62.5\*t\) of TorqueSource 'pull'"),
        (sympy.floor(sw.t) - 2 * sympy.floor(sw.t / 2), r"tau = .*floor\(t\).* of TorqueSource 'pull'"),
    ],
)
def test_a_law_that_changes_with_time_is_named_with_the_next_step(law: Any, words: str) -> None:
    """None of them is noise, and the first levels off: at a late time it has a steady operation."""
    net = sw.Network("pulled")
    net.add(sw.TorqueSource("pull", tau=law), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Damper("d", d=2.0), "a")
    model = net.compile()
    with pytest.raises(sw.SimulationError, match=rf"{words} changes with time.*steady_state\(t=\.\.\.\)") as refused:
        model.steady_state()
    assert "noise" not in str(refused.value)
    for t in (0.5, 50.0):
        assert model.steady_state(t=t)["J.omega"] == pytest.approx(float(law.subs(sw.t, t)) / 2.0, rel=1e-9, abs=1e-9)


OTHER_LEVELS = {
    "a peak": sw.Table([0.0, 1.0, 2.0], [0.0, 5.0, 3.0]),
    "a level below": sw.Table([0.0, 1.0, 2.0, 3.0], [2.0, 2.0, 5.0, 5.0]),
    "steps": sw.Step(5.0, 1.0) + sw.Step(-2.0, 3.0),
    "the other way": sw.Step(5.0, 1.0, before=-1.0),
    "a load that goes": sw.Step(-5.0, 1.0, before=5.0),
}


@pytest.mark.parametrize("name", OTHER_LEVELS)
def test_every_law_with_another_level_warns(name: str) -> None:
    model = drive(OTHER_LEVELS[name]).compile()
    with pytest.warns(sw.NetworkWarning, match=r"'load' gives .* and gave .* steady_state\(t="):
        torque(model)


@pytest.mark.parametrize(
    "law",
    [5.0, sw.Step(5.0, 1.0), sw.Ramp(5.0, 2.0, 1.0), sw.Table([0.0, 1.0, 3.0], [0.0, 2.0, 5.0])],
    ids=["number", "step", "ramp", "run-up"],
)
def test_a_rise_from_nothing_to_the_last_level_warns_of_nothing(law: Any) -> None:
    assert torque(drive(law).compile()) == pytest.approx(5.0, rel=1e-9)


def test_a_motor_that_is_switched_off_and_a_brake_that_comes_on_warn() -> None:
    net = sw.Network("travel")
    net.add(sw.KlossMotor("motor", tau_k=9.6, s_k=0.25, n_sync=3000, ratio=35.5, t_off=6.5), "a")
    net.add(sw.Inertia("J1", J=27.0), "a")
    net.add(sw.Brake("brake", tau=300.0, t_on=7.0), "a")
    net.add(sw.ViscousLoad("load", d=2.0), "a")
    model = net.compile()
    said = r"'motor' gives 0 N m and gave .* at t = 3.25 s; 'brake' changes its mode at t = 7 s.*steady_state\(t=3.25\)"
    with pytest.warns(sw.NetworkWarning, match=said):
        assert model.steady_state()["J1.omega"] == 0.0
    assert model.steady_state(t=3.25)["J1.omega"] > 5.0


def test_a_warning_of_a_brake_that_comes_on_names_a_time_before_it() -> None:
    net = sw.Network("travel")
    net.add(sw.TorqueSource("motor", tau=4.0), "a")
    net.add(sw.Inertia("J1", J=27.0), "a")
    net.add(sw.Brake("brake", tau=300.0, t_on=7.0), "a")
    net.add(sw.ViscousLoad("load", d=2.0), "a")
    model = net.compile()
    with pytest.warns(sw.NetworkWarning, match=r"'brake' changes its mode at t = 7 s.*steady_state\(t=3.5\)"):
        assert model.steady_state()["J1.omega"] == 0.0
    assert model.steady_state(t=3.5)["J1.omega"] == pytest.approx(2.0, rel=1e-9)


def test_a_friction_brings_an_inertia_to_rest() -> None:
    net = sw.Network("braked")
    net.add(sw.Inertia("J", J=2.0), "a")
    net.add(sw.CoulombLoad("load", tau=3.0), "a")
    assert net.compile().steady_state(initial={"J.omega": 1.0}) == {"J.omega": 0.0}


@pytest.mark.slow
@pytest.mark.parametrize(("start", "c"), [(0.02, 1e3), (-0.03, 1e3), (0.0051, 1e6), (1.0, 1e6)])
def test_without_torque_an_undamped_gap_comes_to_rest_at_a_flank(start: float, c: float) -> None:
    """From a twist beyond a flank. A speed counts as none where, for 1 s, it moves the gap by a millionth of itself."""
    net = sw.Network("coasting")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Backlash("gap", c=c, gap=0.01), "a", "b")
    net.add(sw.Inertia("J2", J=2.0), "b")
    net.add(sw.CoulombLoad("load", tau=3.0), "b")
    found = net.compile().steady_state(initial={"gap.phi": start})
    assert abs(found["gap.phi"]) == pytest.approx(0.005, rel=1e-6)
    assert abs(found["J1.omega"]) < 1e-6 * 0.01
    assert found["J2.omega"] == 0.0


def stopped(*parts: tuple[sw.Component, str]) -> sw.Model:
    """A spring between two inertias, and what is given at their nodes."""
    net = sw.Network("stopped")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Spring("shaft", c=1e5, d=10.0), "a", "b")
    net.add(sw.Inertia("J2", J=50.0), "b")
    for part, node in parts:
        net.add(part, node)
    return net.compile()


def test_torques_between_what_sticks_are_said_to_be_one_of_many() -> None:
    """A brake at the one end, a conveyor that rubs on its slope at the other: each holds what the spring has."""
    conveyor = sw.Conveyor("belt", m=1000.0, radius=0.5, friction=0.3, incline=0.35), "b"
    model = stopped((sw.Brake("brake", tau=1e4), "a"), conveyor)
    with pytest.warns(sw.NetworkWarning, match=r"'brake', 'belt' can hold within a range.*simulate\(\.\.\.\)"):
        steady = model.steady_state()
    at_rest = model.simulate(10.0)["shaft.tau_c"][-1]
    assert abs(at_rest - steady["shaft.tau_c"]) > 100.0  # N m: the brake holds 10 kN m
    again = model.simulate(1.0, initial=steady)["shaft.tau_c"]
    assert again[-1] == pytest.approx(steady["shaft.tau_c"], rel=1e-9)  # it does last


def test_a_stiff_floor_beside_a_held_torque_does_not_hide_that_it_is_one_of_many() -> None:
    """The floor is disturbed by forces some 1e4 times as large; the brake can hold what the rope has."""
    net = sw.Network("ladle on the floor")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Brake("brake", tau=2e4), "a")
    net.add(sw.Drum("drum", radius=0.5), "a", "rim")
    net.add(sw.TranslationalSpring("rope", c=1e5, d=1e3), "rim", "hook")
    net.add(sw.Mass("ladle", m=5e3), "hook")
    net.add(sw.ForceSource("weight", f=-5e4), "hook")
    net.add(sw.Rope("floor", c=5e9, d=1e6), "ground", "hook")
    model = net.compile()
    with pytest.warns(sw.NetworkWarning, match=r"'brake' can hold within a range"):
        steady = model.steady_state(t=0.0)
    with pytest.warns(sw.NetworkWarning, match=r"'brake' can hold within a range"):
        other = model.steady_state(t=0.0, initial={"rope.f_c": 1e4})
    assert abs(other["rope.f_c"] - steady["rope.f_c"]) > 5e3  # N, of which the rope kept nearly all


def test_a_spring_between_two_self_locking_gears_holds_one_torque_of_many() -> None:
    """Neither gear turns from the side of the spring, whatever it has."""
    net = sw.Network("clamped")
    for end, node in (("left", "a"), ("right", "b")):
        net.add(sw.Inertia(f"J {end}", J=1.0), f"hand {node}")
        net.add(sw.LossyGear(end, ratio=10.0, efficiency=0.6, efficiency_back=-0.2), f"hand {node}", node)
    net.add(sw.Spring("shaft", c=1e4, d=10.0), "a", "b")
    with pytest.warns(sw.NetworkWarning, match=r"'left', 'right' can hold within a range"):
        steady = net.compile().steady_state(initial={"shaft.tau_c": 50.0})
    assert steady["shaft.tau_c"] == pytest.approx(50.0, rel=1e-6)


def test_a_self_locking_gear_that_alone_holds_a_weight_has_one_torque() -> None:
    net = sw.Network("jack")
    net.add(sw.Inertia("J1", J=1.0), "hand")
    net.add(sw.LossyGear("worm", ratio=10.0, efficiency=0.6, efficiency_back=-0.2), "hand", "a")
    net.add(sw.Spring("shaft", c=1e4, d=10.0), "a", "b")
    net.add(sw.Inertia("J2", J=5.0), "b")
    net.add(sw.TorqueSource("weight", tau=-50.0), "b")
    assert net.compile().steady_state()["shaft.tau_c"] == pytest.approx(50.0, rel=1e-6)  # a warning is an error here


def test_torques_that_only_one_equilibrium_has_warn_of_nothing() -> None:
    """A source turns against what sticks, or what slips: warnings are errors here."""
    load = sw.CoulombLoad("load", tau=3.0), "b"
    assert stopped((sw.TorqueSource("motor", tau=2.0), "a"), load).steady_state()["shaft.tau_c"] == pytest.approx(2.0)
    slips = stopped((sw.TorqueSource("motor", tau=5.0 - sw.omega), "a"), load).steady_state()
    assert slips["J2.omega"] == pytest.approx(2.0)


def test_a_motion_that_starts_in_the_steady_state_of_a_brake_can_be_read_all_along() -> None:
    """The first step of heyoka is a trial there, whose end met a stop on the way: the second run ended with it."""
    net = sw.Network("hoist")
    net.add(sw.Inertia("rotor", J=400.0), "shaft")
    net.add(sw.Brake("brake", tau=2e5, t_on=0.0), "shaft")
    net.add(sw.Drum("drum", radius=0.4), "shaft", "top")
    net.add(sw.TranslationalSpring("rope", c=5e6, d=2e4), "top", "hook")
    net.add(sw.Mass("load", m=20e3), "hook")
    net.add(sw.ForceSource("weight", f=-196200.0), "hook")
    model = net.compile()
    for t_end in (0.3, 1.0, 10.0):
        solution = model.simulate(t_end, initial=model.steady_state(t=0.0))
        assert solution.max("rope.f") == pytest.approx(196200.0, rel=1e-9)
        assert solution.min("rope.f") == pytest.approx(196200.0, rel=1e-9)


@pytest.mark.slow
def test_a_hoist_that_runs_away_from_rest_names_the_start_that_finds_its_steady_state() -> None:
    """From rest the load of 20 t overhauls the motor at full frequency; near its speed the motor holds it."""
    net = sw.Network("hoist")
    net.add(sw.FrequencyDrive("drive", tau_k=1200, s_k=0.1, n_sync=1500), "m")
    net.add(sw.Brake("brake", tau=900.0, t_on=8.0), "m")
    net.add(sw.Inertia("JM", J=1.0), "m")
    net.add(sw.Spring("coupling", c=1e5, d=10.0), "m", "g")
    net.add(sw.Inertia("JG", J=0.1), "g")
    net.add(sw.Backlash("lash", c=1e6, gap=0.01, d=50.0), "g", "h")
    net.add(sw.Inertia("JH", J=0.05), "h")
    net.add(sw.LossyGear("gear", ratio=124, efficiency=0.94), "h", "d")
    net.add(sw.Drum("drum", radius=0.4), "d", "r")
    net.add(sw.TranslationalSpring("rope", c=4e6), "r", "l")
    net.add(sw.Mass("load", m=2e4), "l")
    net.add(sw.ForceSource("weight", f=-196.2e3), "l")
    model = net.compile()
    with pytest.raises(sw.SimulationError, match=r"steady_state\(initial=\{'JM.omega': \.\.\.\}\)"):
        model.steady_state(t=6.0)
    steady = model.steady_state(t=6.0, initial={"JM.omega": 155.0})
    assert steady["load.v"] == pytest.approx(steady["JM.omega"] * 0.4 / 124, rel=1e-9)
    assert 150.0 < steady["JM.omega"] < 157.0


@pytest.mark.parametrize(
    ("load", "speed"),
    [
        (0.2 * sw.omega * sympy.sqrt(sympy.Abs(sw.omega)), 25 ** (2 / 3)),
        (0.2 * sw.omega * sympy.Abs(sw.omega) ** 0.1, 25 ** (1 / 1.1)),
        (0.2 * sympy.sign(sw.omega) * sympy.sqrt(sympy.Abs(sw.omega)), 625.0),
        (1 + sympy.sign(sw.omega - 3) * sympy.Abs(sw.omega - 3) ** 0.3, 3 + 4 ** (1 / 0.3)),
    ],
    ids=str,
)
@pytest.mark.parametrize("way", [1, -1])
def test_a_load_with_a_broken_power_of_the_speed_has_a_steady_state_from_rest(
    load: Any, speed: float, way: int
) -> None:
    """Its slope at rest is 0 times infinity, or infinite."""
    net = sw.Network("fan")
    net.add(sw.TorqueSource("m", tau=way * (5 - load).subs(sw.omega, way * sw.omega)), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    assert net.compile().steady_state()["J.omega"] == pytest.approx(way * speed)


def test_a_brake_that_rises_is_not_read_before_it_comes_on() -> None:
    net = drive(sympy.Integer(5))
    net.add(sw.Brake("stop", tau=10.0, t_on=3.0, t_rise=0.2), "a")
    said = r"before: 'stop' changes its mode at t = 3 s. Name the time that is meant, \S+2\) or steady_state\(t=1.5\)"
    with pytest.warns(sw.NetworkWarning, match=said):
        net.compile().steady_state()


@pytest.mark.slow
def test_a_torque_that_pulsates_with_the_angle_has_no_steady_state_and_the_message_says_why() -> None:
    net = sw.Network("machine")
    net.add(sw.TorqueSource("e", tau=(100.0 - sw.omega) * (1 + 0.1 * sympy.sin(4 * sw.phi))), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    with pytest.raises(sw.SimulationError, match=r"'e.phi' still changes .* A law reads it.*mean over a turn"):
        net.compile().steady_state()


def test_an_angle_that_is_recorded_alone_may_turn_on_in_a_steady_state() -> None:
    net = drive(sympy.Integer(5))
    plain, recorded = net.compile().steady_state(), net.compile(angles=("J1",)).steady_state()
    assert recorded["J1.phi"] == 0.0
    assert recorded.items() >= plain.items()


@pytest.mark.parametrize(
    "others",
    [{"rope.f": 3.0}, {"tip.v": -0.1}, {"rotor.omega": 2.0}, {"drum.omega": 0.5, "rope.f_c": 0.0}, {"load.v": 0.0}],
    ids=str,
)
def test_a_start_in_the_steady_state_takes_other_values_by_any_name(others: dict[str, float]) -> None:
    """What is not named keeps its steady value, and what is named has its own."""
    net = sw.Network("hoist")
    net.add(sw.TorqueSource("motor", tau=50.0 - 5.0 * sw.omega), "rotor")
    net.add(sw.Inertia("rotor", J=1.0), "rotor")
    net.add(sw.Gear("gear", ratio=10.0), "rotor", "drum")
    net.add(sw.Inertia("drum", J=2.0), "drum")
    net.add(sw.Drum("winding", radius=0.2), "drum", "tip")
    net.add(sw.TranslationalSpring("rope", c=1e5, d=100.0), "tip", "load")
    net.add(sw.Mass("load", m=100.0), "load")
    net.add(sw.ForceSource("weight", f=-981.0), "load")
    model = net.compile()
    steady = model.simulate(0.01, initial=model.steady_state(t=0.0))
    sol = model.simulate(0.01, initial=steady_start(model, others))
    for name, value in others.items():
        assert sol[name][0] == pytest.approx(value, abs=1e-9)
    groups = ({"rotor.omega", "drum.omega", "tip.v"}, {"load.v"}, {"rope.f", "rope.f_c"})
    for group in groups:
        if group.isdisjoint(others):
            name = min(group - {"rope.f"})  # which depends on speeds, too
            assert sol[name][0] == pytest.approx(steady[name][0], rel=1e-9)
