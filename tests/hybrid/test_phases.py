"""Phases as a user reads them: names, tables, equations, output times, steady states, files, and what is refused."""

from __future__ import annotations

import gc
import math
import traceback
import weakref
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.hybrid.event_iteration import EventIteration
from shaftwork.hybrid.hybrid_run import HybridRun
from shaftwork.hybrid.hybrid_state import HybridState
from shaftwork.hybrid.in_place_events import InPlaceEvents
from shaftwork.integrate.problem import SeriesError
from shaftwork.integrate.taylor import heyoka_taylor

ENGINES = ("heyoka", "scipy", "sundials")


def wheel(*parts: sw.Component) -> sw.Network:
    """Parts on the node of one inertia of 2 kg m^2."""
    net = sw.Network("wheel")
    net.add(sw.Inertia("J", J=2.0), "wheel")
    for part in parts:
        net.add(part, "wheel")
    return net


def crane(tau_brake: float = 20.0, gap: float = 0.02) -> sw.Network:
    """A motor, a gap, a load and a brake."""
    net = sw.Network("crane")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Inertia("J2", J=2.0), "b")
    net.add(sw.Backlash("gap", gap=gap, c=1000.0, d=1.0), "a", "b")
    net.add(sw.TorqueSource("motor", tau=sw.Step(-10.0, 1.0, before=10.0)), "a")
    net.add(sw.CoulombLoad("load", tau=2.0), "b")
    net.add(sw.Brake("brake", tau=tau_brake, t_on=1.0), "a")
    return net


@cache
def model() -> sw.Model:
    """The crane, compiled once."""
    return crane().compile()


@cache
def motion() -> sw.Solution:
    """Its motion from rest to rest."""
    return model().simulate(3.0)


def test_a_motion_that_starts_held_has_a_phase_and_no_event() -> None:
    sol = wheel(sw.TorqueSource("pull", tau=1.0), sw.Brake("brake", tau=2.0)).simulate(1.0)
    assert sol.events == ()
    assert [(phase.start, phase.end, phase.name) for phase in sol.phases] == [(0.0, 1.0, "brake locked")]


@pytest.mark.slow
def test_every_phase_is_what_the_equations_can_be_printed_for() -> None:
    net = crane()
    equations = net.equations()
    printed = {phase.name: equations.latex(form="state", phase=phase.name) for phase in motion().phases}
    assert len(set(printed.values())) == len(printed) > 4
    at_rest = equations.latex(form="state", phase="gap open, load stuck, brake locked")
    assert r"\frac{d \omega" not in at_rest
    last = motion().phases[-1].name
    assert net.equations(phase=last).latex(form="state") == printed[last]


@pytest.mark.slow
def test_values_change_without_other_equations() -> None:
    sol = model().simulate(3.0, parameters={"brake.tau": 15.0, "gap.gap": 0.03})
    assert sol.events == crane(15.0, 0.03).simulate(3.0).events


def test_a_gap_of_zero_is_a_spring() -> None:
    net = sw.Network("pair")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Inertia("J2", J=2.0), "b")
    net.add(sw.Backlash("gap", gap=0.1, c=100.0), "a", "b")
    start = {"J1.omega": 1.0}
    found = net.compile().simulate(2.0, initial=start, parameters={"gap.gap": 0.0}, rtol=1e-10)
    np.testing.assert_allclose(found["J1.omega"], (1.0 + 2.0 * np.cos(math.sqrt(150.0) * found.t)) / 3.0, atol=1e-8)


def test_a_steady_state_is_that_of_the_modes_in_which_it_ends() -> None:
    slow = wheel(sw.TorqueSource("pull", tau=4.0), sw.DryFriction("shoe", tau_c=1.0), sw.Damper("oil", d=0.5))
    assert slow.compile().steady_state() == {"J.omega": pytest.approx(6.0, rel=1e-9)}
    held = wheel(sw.TorqueSource("pull", tau=4.0), sw.Brake("brake", tau=10.0))
    assert held.compile().steady_state() == {"J.omega": 0.0}


def test_small_motions_are_those_of_the_phase_at_their_point() -> None:
    net = crane()
    assert max(net.modes(at={"J2.omega": 1.0, "J1.omega": 1.0}, t=0.5).frequencies) == 0.0
    point = {"gap.phi": 0.05, "J2.omega": 1.0, "J1.omega": 1.0}
    closed = max(net.modes(at=point, t=0.5).frequencies)
    assert closed == pytest.approx(math.sqrt(1000.0 * 1.5) / (2.0 * math.pi), rel=1e-3)  # damped by 1 N m s/rad


@pytest.mark.slow
def test_a_file_keeps_everything_that_changes_modes(tmp_path: Path) -> None:
    net = crane()
    net.add(sw.Freewheel("backstop"), "ground", "a")
    net.add(sw.HardStop("stop", upper=50.0, restitution=0.5), "b")
    net.add(sw.DryFriction("shoe", tau_c=0.1, tau_s=0.2, omega_s=0.5, d=0.01), "a", "b")
    net.save(tmp_path / "crane.toml")
    assert sw.Network.load(tmp_path / "crane.toml").simulate(0.5).events == net.simulate(0.5).events


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_the_engines_own_steps_contain_every_event(engine: str) -> None:
    sol = model().simulate(3.0, engine=engine, t_eval="steps")
    times = {event[0] for event in sol.events}
    assert times <= set(sol.t.tolist())
    assert (np.diff(sol.t) >= 0.0).all()
    assert times <= set(sol.steps.tolist())


@pytest.mark.parametrize("engine", ENGINES)
def test_an_output_at_an_event_is_there_once(engine: str) -> None:
    net = wheel(sw.TorqueSource("pull", tau=4.0), sw.Brake("brake", tau=10.0, t_on=1.0)).compile()
    asked: list[float] = []
    for _ in range(2):  # the second time at the events of the first, which are the same to the last bit or nearly
        sol = net.simulate(2.0, engine=engine, t_eval=[0.0, *asked, 2.0])
        assert sol.t.tolist() == [0.0, *asked, 2.0]
        asked = [event[0] for event in sol.events]
    assert sol["J.omega"] == pytest.approx([0.0, 2.0, 0.0, 0.0], abs=1e-8)


@pytest.mark.parametrize("engine", ENGINES)
def test_an_output_where_an_input_jumps_after_an_event_is_there(engine: str) -> None:
    """From the event on, 0.3 s is not reached to the last bit."""
    net = sw.Network("gap")
    net.add(sw.TorqueSource("pull", tau=-50.0 + 90.0 * sw.Step(1.0, 0.3)), "a")
    net.add(sw.Inertia("J1", J=25.0), "a")
    net.add(sw.Backlash("gap", gap=0.004), "a", "b")
    net.add(sw.Inertia("J2", J=28.0), "b")
    sol = net.simulate(1.0, t_eval=np.linspace(0.0, 1.0, 101), rtol=1e-9, engine=engine)
    assert sol.t.tolist() == np.linspace(0.0, 1.0, 101).tolist()
    assert 0.3 in {event[0] for event in sol.events}


def test_a_motion_goes_on_from_the_end_of_another_as_if_there_had_been_no_end() -> None:
    """At an event, in contact, and at rest."""
    whole = model().simulate(3.0, rtol=1e-10)
    for end in (whole.events[2][0], 0.5, 2.5):
        first = model().simulate(end, rtol=1e-10)
        held = {name: float(first[name][-1]) for name in first.states}
        rest = model().simulate(3.0, t_start=end, initial=held, rtol=1e-10)
        assert rest["gap.phi"][-1] == pytest.approx(whole["gap.phi"][-1], abs=1e-8)
        assert rest.phases[-1].modes == whole.phases[-1].modes


@pytest.mark.slow
@pytest.mark.parametrize("end", [0.03, 2.0, 6.8, 8.5])
def test_the_crane_goes_on_from_the_middle_of_its_motion(end: float) -> None:
    """In the open gap, at full speed, while the brake slips, and held by it; to the digits of the two motions."""
    crane_with_gap = sw.scenes.crane(gap=0.02).compile()
    whole, first = (crane_with_gap.simulate(t, rtol=1e-10) for t in (10.0, end))
    rest = crane_with_gap.simulate(
        10.0, t_start=end, initial={name: first[name][-1] for name in first.states}, rtol=1e-10
    )
    times = np.linspace(end, 10.0, 201)[1:]
    for name in ("J1.omega", "J2.omega", "shaft.tau", "shaft.phi"):
        assert np.abs(rest.at(times)[name] - whole.at(times)[name]).max() < 1e-8 * np.abs(whole[name]).max(), name
    assert [row.name for row in rest.phases[1:]] == [row.name for row in whole.phases if row.start > end]


def overspeed(part: sw.Component) -> sw.Network:
    """A wheel that is driven to 12 rad/s and then held back, with a part that may stop it."""
    net = sw.Network("overspeed")
    net.add(sw.TorqueSource("motor", tau=sw.Step(-20.0, start=0.6, before=20.0)), "shaft")
    net.add(sw.Inertia("J", J=1.0), "shaft")
    net.add(part, "shaft")
    return net


def went_on(net: sw.Network, t: float, end: float) -> sw.Solution:
    """The motion from a time on, with all that is stored there."""
    first = net.simulate(t)
    return net.simulate(end, t_start=t, initial={name: first[name][-1] for name in first.states})


def test_a_brake_that_may_have_come_on_before_is_said_to_be_released_when_a_motion_goes_on() -> None:
    net = overspeed(sw.Brake("brake", tau=5.0, on=sw.omega - 10))
    with pytest.warns(sw.AccuracyWarning, match="'brake' begins the motion that goes on at t_start = 1.1 s as 'rele"):
        went_on(net, 1.1, 1.2)  # at 1.7 rad/s or less
    went_on(net, 0.55, 0.58)  # at 11 rad/s it is on for certain


@pytest.mark.slow
def test_a_part_that_comes_on_at_a_known_time_goes_on_without_a_word() -> None:
    net = overspeed(sw.Brake("brake", tau=5.0, t_on=0.3))
    for t in (0.1, 0.5):
        assert went_on(net, t, 0.7)["J.omega"][-1] == pytest.approx(net.simulate(0.7)["J.omega"][-1], rel=1e-9)


@pytest.mark.slow
def test_a_motion_that_goes_on_without_all_that_is_stored_is_refused_with_what_is_missing() -> None:
    """The states of one phase lack the twist of the gap: with it in the middle all else would be 6 % off."""
    crane_with_gap = sw.scenes.crane(gap=0.02).compile()
    first = crane_with_gap.simulate(2.0)
    some = {name: float(first[name][-1]) for name in ("J1.omega", "J2.omega")}
    with pytest.raises(sw.ParameterError, match=r"t_start = 2 s needs .*lacks shaft\.phi\..*initial=sol"):
        crane_with_gap.simulate(10.0, t_start=2.0, initial=some)
    assert crane_with_gap.simulate(3.0, t_start=2.0, initial=some | {"shaft.phi": 0.0})["shaft.phi"][0] == 0.0
    assert crane_with_gap.simulate(3.0, t_start=2.0)["J1.omega"][0] == 0.0  # from rest


def test_an_instant_between_two_phases_is_read_in_the_later_one() -> None:
    sol = wheel(sw.Brake("brake", tau=4.0)).simulate(3.0, initial={"J.omega": 4.0})
    ((stop, *_),) = sol.events
    at = sol.at([stop - 1e-6, stop, stop + 1e-6])
    np.testing.assert_allclose(at["brake.tau"], [4.0, 0.0, 0.0], atol=1e-12)
    assert at["J.omega"][1:].tolist() == [0.0, 0.0]


@pytest.mark.slow
def test_a_table_holds_what_each_phase_gives() -> None:
    table = motion().to_pandas("J1.omega", "gap.tau", "brake.tau")
    assert list(table.columns) == ["J1.omega", "gap.tau", "brake.tau"]
    assert table.index.tolist() == motion().t.tolist()
    assert not table.isna().to_numpy().any()
    np.testing.assert_array_equal(table["brake.tau"][:0.99], 0.0)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: sw.Brake("b", tau=1.0, on=sw.omega - 1, t_rise=1.0), "`on` comes true is not known before"),
        (lambda: sw.Brake("b", tau=1.0, t_rise=1.0, t_lag=1.0), "give t_rise or t_lag, not both"),
        (lambda: sw.Backlash("g", gap=0.1, d=1.0), "a damping d needs a stiffness c"),
        (lambda: sw.Backlash("g", gap=0.1, c=1.0, restitution=0.5), "restitution is for rigid flanks"),
        (lambda: sw.HardStop("s"), "give upper, lower or both"),
        (lambda: sw.HardStop("s", upper=0.1, lower=0.1), "must be below upper"),
    ],
)
def test_a_part_whose_values_contradict_each_other_says_so(make: Callable[[], sw.Component], says: str) -> None:
    with pytest.raises(sw.ParameterError, match=says):
        make()


def test_a_phase_that_does_not_exist_is_refused_with_those_that_do() -> None:
    known = r"gap open \| in contact \| in contact backward; load slipping forward"
    with pytest.raises(sw.ParameterError, match=rf"no phase 'gap shut'.*{known}"):
        crane().equations(phase="gap shut")
    with pytest.raises(sw.ParameterError, match="No part of this network changes its mode"):
        wheel(sw.Damper("oil", d=1.0)).equations(phase="oil open")


@pytest.mark.parametrize("engine", ["exact", "banded"])
def test_an_engine_that_follows_no_modes_is_refused_with_those_that_do(engine: str) -> None:
    with pytest.raises(
        sw.ParameterError, match=rf"'{engine}' follows no parts that change their mode.*heyoka, numba, scipy"
    ):
        model().simulate(1.0, engine=engine)


@pytest.mark.slow
def test_auto_goes_on_with_scipy_where_a_law_in_the_midst_of_contacts_has_no_taylor_series() -> None:
    """A torque of sqrt(|omega|) passes zero again and again, between the contacts that one run of heyoka passes."""
    net = sw.Network("rattle")
    net.add(sw.TorqueSource("drive", tau=8 * sympy.sin(3 * sw.t)), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Backlash("gap", gap=0.02, c=2000.0, d=2.0), "a", "b")
    net.add(sw.Inertia("J2", J=2.0), "b")
    net.add(sw.TorqueSource("load", tau=-3 * sympy.Abs(sw.omega) ** 0.5), "b")
    model = net.compile()
    sol, other = model.simulate(6.0, t_eval=61), model.simulate(6.0, engine="scipy", rtol=1e-11, t_eval=61)
    assert [event[1:] for event in sol.events] == [event[1:] for event in other.events]
    assert len(sol.events) > 40
    # the slope of the root is infinite at its zero, where every method loses digits
    np.testing.assert_allclose(sol["J2.omega"], other["J2.omega"], atol=1e-5)


def test_an_end_of_a_mode_that_the_series_have_hidden_is_told() -> None:
    event_iteration = EventIteration(model().equation_sets, {}, (0.0, 10.0))
    regime = event_iteration.transfer.regime(("open", "forward", "released"))
    size, bands = len(regime.equations.model.states), [1e-12] * len(regime.sides)
    events = InPlaceEvents(event_iteration, HybridState(regime, np.zeros(size), bands), 0.0, lambda _t, _made: None)
    twist = regime.equations.model.states.index("gap.phi")
    within = np.ones(size)
    within[twist] = 0.0
    beyond = np.ones(size)
    events.refuse_missed(None, 1.0, within)
    with pytest.raises(SeriesError, match="has not seen that 'gap' ceased to be open before t = 1 s"):
        events.refuse_missed(None, 1.0, beyond)
    events.refuse_missed(next(made.guard for made in regime.watched if made.leave.to == "forward"), 1.0, beyond)


def test_the_rates_of_many_instants_are_those_of_each() -> None:
    event_iteration = EventIteration(model().equation_sets, {}, (0.0, 10.0))
    regime = event_iteration.transfer.regime(("forward", "forward", "released"))
    x = np.random.default_rng(0).normal(size=(5, len(regime.equations.model.states)))
    state = HybridState(regime, x[0], [0.0] * len(regime.sides))
    problem = state.problem((0.0, 10.0), regime.equations.model.switching.timeline(regime.p, 0.0, 10.0))
    times = np.linspace(0.1, 0.9, 5)
    assert problem.rates is not None
    each = [problem.rhs(t, row) for t, row in zip(times.tolist(), x, strict=True)]
    np.testing.assert_allclose(problem.rates(times, x), each, rtol=1e-12, atol=1e-12)


def test_a_wheel_slips_in_the_way_it_is_pulled_where_the_rounding_of_a_moment_is_not_known() -> None:
    net = wheel(sw.TorqueSource("pull", tau=3.0), sw.CoulombLoad("load", tau=2.0))
    event_iteration = EventIteration(net.compile().equation_sets, {}, (0.0, 10.0))
    regime = event_iteration.transfer.regime(("stuck",))
    met = next(made.guard for made in regime.watched if made.leave.to == "forward")
    state = HybridState(regime, np.zeros(len(regime.equations.model.states)))
    state, transitions = event_iteration.run(0.0, 0.0, state, met)
    assert [(transition.before, transition.after) for transition in transitions] == [("stuck", "forward")]
    assert state.regime.modes == ("forward",)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["auto", "sundials", "scipy-radau"])
def test_a_light_wheel_is_pushed_along_without_a_step_for_each_of_its_transients(engine: str) -> None:
    """Free it is no trouble; in contact it follows within 1e-9 s, and an explicit method would take 2e8 steps.

    The momentum of both is tau t, and they have one speed when the springing of the contact has died down.
    """
    net = sw.Network("light")
    net.add(sw.TorqueSource("motor", tau=1.0), "heavy")
    net.add(sw.Inertia("J1", J=1.0), "heavy")
    net.add(sw.Backlash("gap", gap=0.02, c=1e3, d=1.0), "heavy", "light")
    net.add(sw.Inertia("J2", J=1e-9), "light")
    sol = net.simulate(t_end=1.0, engine=engine, rtol=1e-9, max_steps=5000)
    ((time, *event),) = sol.events
    assert event == ["gap", "open", "in contact"]
    assert time == pytest.approx(math.sqrt(0.02), abs=1e-9)
    for wheel in ("J1.omega", "J2.omega"):
        assert sol[wheel][-1] == pytest.approx(1.0 / (1.0 + 1e-9), abs=1e-8)


@pytest.mark.slow
def test_auto_stays_with_heyoka_where_a_stiff_contact_is_over_before_it_costs_much() -> None:
    """A wheel of 1e-6 kg m2 is thrown off in 0.03 ms, which takes an implicit method some hundred steps."""
    net = sw.Network("thrown")
    net.add(sw.Inertia("J1", J=1.0), "heavy")
    net.add(sw.Backlash("gap", gap=0.02, c=1e3, d=0.3), "heavy", "light")
    net.add(sw.Inertia("J2", J=1e-6), "light")
    auto, implicit = (
        net.simulate(t_end=1.0, engine=name, rtol=1e-10, initial={"J1.omega": 1.0}) for name in ("auto", "scipy-radau")
    )
    assert 2 * auto.statistics["steps"] < 100 < implicit.statistics["steps"]
    assert [event[1:] for event in auto.events] == [event[1:] for event in implicit.events]
    assert auto["J2.omega"][-1] == pytest.approx(implicit["J2.omega"][-1], rel=1e-9)


def test_speeds_along_a_shaft_are_read_in_every_phase() -> None:
    """Between its ends, which are the nodes, before and after a brake holds one of them."""
    net = sw.Network("braked shaft")
    net.add(sw.TorqueSource("motor", tau=10.0), "a")
    net.add(sw.Inertia("J1", J=0.1), "a")
    net.add(sw.Shaft("line", length=1.0, diameter=0.02, model=sw.Lumped(4)), "a", "b")
    net.add(sw.Inertia("J2", J=0.1), "b")
    net.add(sw.Brake("brake", tau=50.0, t_on=0.01), "b")
    sol = net.simulate(0.02, t_eval=21)
    assert len(sol.phases) > 1
    speeds = sol["line.omega"]
    assert speeds.shape == (21, len(sol.places["line.omega"]))
    np.testing.assert_allclose(speeds[:, 0], sol["J1.omega"], rtol=1e-12)
    np.testing.assert_allclose(speeds[:, -1], sol["J2.omega"], rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["heyoka", "scipy"])
def test_the_limit_of_steps_is_that_of_all_phases_together(engine: str) -> None:
    steps = model().simulate(3.0, engine=engine).statistics["steps"]
    assert model().simulate(3.0, engine=engine, max_steps=steps).statistics["steps"] == steps
    with pytest.raises(sw.SimulationError, match=rf"\b{steps - 1} steps were not enough"):
        model().simulate(3.0, engine=engine, max_steps=steps - 1)


def test_modes_that_contradict_each_other_keep_no_frames_of_those_who_asked() -> None:
    """They are looked at again and again in a long motion: each time would leave its frames behind."""
    net = sw.Network("belt")
    net.add(sw.SpeedSource("belt", omega=1.0), "wheel")
    net.add(sw.DryFriction("shoe", tau_c=1.0), "wheel")
    equation_sets = net.compile().equation_sets
    depths = []
    for _ in range(3):
        with pytest.raises(sw.NetworkError) as refused:
            equation_sets.of(("stuck",))
        depths.append(len(list(traceback.walk_tb(refused.value.__traceback__))))
    assert depths[1] == depths[2]


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_a_motion_is_freed_with_its_last_holder(engine: str) -> None:
    """Else each one waits for the garbage collector, which costs a short run a tenth of its time and more."""
    sol = model().simulate(3.0, engine=engine)
    assert sol.at([0.5, 2.5])["J1.omega"].shape == sol["gap.tau"][[0, -1]].shape  # also what is made when it is read
    held = [weakref.ref(one) for one in (sol.dense, sol.observer)]
    gc.collect()
    gc.disable()
    try:
        del sol
        assert [ref() for ref in held] == [None, None]
        gc.set_debug(gc.DEBUG_SAVEALL)
        gc.collect()
        assert [one for one in gc.garbage if isinstance(one, HybridRun | InPlaceEvents)] == []
    finally:
        gc.set_debug(0)
        gc.garbage.clear()
        gc.enable()


@pytest.mark.heyoka
@pytest.mark.parametrize("load", [sw.CoulombLoad("load", tau=1.0), sw.Damper("load", d=1.0)], ids=["phases", "none"])
def test_a_motion_is_not_run_again_for_what_nobody_asks(load: sw.Component, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: object) -> None:
        raise AssertionError("the motion is run again")

    monkeypatch.setattr(heyoka_taylor._TaylorReplay, "_segments", property(refuse))
    net = sw.Network("drive")
    net.add(sw.TorqueSource("motor", tau=2.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(load, "a")
    assert len(net.simulate(1.0, engine="heyoka", t_eval=[0.5, 1.0]).t) == 2
