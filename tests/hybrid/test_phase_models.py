"""The equations of one phase, to be integrated by whatever a user likes; and nothing that is silently of one phase."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Iterator
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from scipy.integrate import solve_ivp

import shaftwork as sw
from shaftwork.components.modes import ModeChoice
from shaftwork.network.graph import resolve
from shaftwork.network.netlist import Placed
from shaftwork.network.templates import make_template
from tests.beds import bed_of, registered
from tests.properties.examples import share_of_examples
from tests.trains import Train, trains

BLDC = {"U": 100.0, "R": 0.5, "L": 1e-3, "k": 0.2, "pole_pairs": 2.0}


def geared() -> sw.Network:
    """A friction behind a spring, and an inertia whose speed is no state, as a gear gives it."""
    net = sw.Network("geared")
    net.add(sw.TorqueSource("motor", tau=5.0), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Gear("gear", ratio=2.0), "a", "b")
    net.add(sw.Inertia("J2", J=0.5), "b")
    net.add(sw.Spring("shaft", c=1e3, d=1.0), "b", "c")
    net.add(sw.Inertia("J3", J=1.0), "c")
    net.add(sw.CoulombLoad("brake", tau=1.0), "c")
    return net


def crane() -> sw.Network:
    """A motor that turns round, a gap, a load and a brake."""
    net = sw.Network("crane")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Inertia("J2", J=2.0), "b")
    net.add(sw.Backlash("gap", gap=0.02, c=1000.0, d=1.0), "a", "b")
    net.add(sw.TorqueSource("motor", tau=sw.Step(-10.0, 1.0, before=10.0)), "a")
    net.add(sw.CoulombLoad("load", tau=2.0), "b")
    net.add(sw.Brake("brake", tau=20.0, t_on=1.0), "a")
    return net


def six_step() -> sw.Network:
    """A motor whose inverter commutates some forty times."""
    net = sw.Network("six steps")
    net.add(sw.BLDCMotor("M", **BLDC), "rotor")
    net.add(sw.Inertia("J", J=2e-3), "rotor")
    net.add(sw.ViscousLoad("load", d=1e-3), "rotor")
    return net


def clutches() -> sw.Network:
    """States come and go: a clutch engages, a gear that rubs, a freewheel that overtakes."""
    net = sw.Network("clutches")
    net.add(sw.TorqueSource("motor", tau=5.0 - 0.1 * sw.omega), "a")
    net.add(sw.Inertia("J1", J=0.5), "a")
    net.add(sw.Clutch("clutch", tau=20.0, t_on=0.5), "a", "b")
    net.add(sw.Inertia("J2", J=1.0), "b")
    net.add(sw.LossyGear("gear", ratio=2.0, efficiency=0.9), "b", "c")
    net.add(sw.Inertia("J3", J=0.3), "c")
    net.add(sw.Freewheel("freewheel"), "c", "d")
    net.add(sw.Inertia("J4", J=0.2), "d")
    net.add(sw.FanLoad("fan", tau_n=5.0, n_n=200.0), "d")
    return net


NETWORKS: dict[str, tuple[Callable[[], sw.Network], float]] = {
    "crane": (crane, 3.0),
    "clutches": (clutches, 2.0),
    "six steps": (six_step, 0.02),
    "crane scene": (sw.scenes.crane, 10.0),
}


@cache
def motion(name: str) -> tuple[sw.Model, sw.Solution]:
    build, t_end = NETWORKS[name]
    model = build().compile()
    return model, model.simulate(t_end, rtol=1e-11)


def stored(sol: sw.Solution, t: float, names: tuple[str, ...]) -> np.ndarray[Any, Any]:
    """The states of a phase in what the motion stores."""
    return sol.at([t]).x[0][[sol.states.index(name) for name in names]]


def by_hand(model: sw.Model, sol: sw.Solution) -> Iterator[float]:
    """How far scipy, from event to event, ends from the motion, in parts of the largest value of each state."""
    largest = np.abs(sol.x).max(axis=0) + 1e-3
    events = {event[0] for event in sol.events}  # an impact may lead back to the same phase
    for row in sol.phases:
        phase = model.phase(row)
        assert phase.name == row.name
        columns = [sol.states.index(name) for name in phase.states]
        instants = sorted({row.start, *(t for t in events if row.start < t < row.end), row.end})
        for start, after in pairwise(instants if phase.states else ()):
            span = (start, math.nextafter(after, 0.0))
            found = solve_ivp(phase.rhs, span, sol.at([start]).x[0][columns], method="DOP853", rtol=1e-11, atol=1e-12)
            end = sol.at([span[1]]).x[0][columns]
            yield float(np.abs((found.y[:, -1] - end) / largest[columns]).max())


@pytest.mark.slow
@pytest.mark.parametrize("name", NETWORKS)
def test_scipy_through_all_phases_by_hand_reproduces_the_motion(name: str) -> None:
    """Tolerance 1e-7 of the largest value: both integrate to 1e-11, and a phase begins some 1e-14 s late."""
    model, sol = motion(name)
    errors = list(by_hand(model, sol))
    assert len(errors) >= 3
    assert max(errors) < 1e-7


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::shaftwork.core.errors.NetworkWarning")
@share_of_examples(0.02)
@given(train=trains(most=4))
def test_scipy_through_all_phases_of_random_trains_reproduces_the_motion(train: Train) -> None:
    """Tolerance 1e-6: what rounds the start of a stiff contact by 1e-14 s is some 1e-9 of its torque."""
    model = train.compiled()
    initial = {name: value for name, value in train.initial.items() if name in model.states}
    sol = model.simulate(train.t_end, initial=initial, rtol=1e-11)
    assert max(by_hand(model, sol), default=0.0) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("name", NETWORKS)
def test_the_jacobian_and_the_code_of_a_phase_are_those_of_its_right_hand_side(name: str) -> None:
    """Tolerance 1e-5 of the largest slope: central differences of a step of 1e-6 keep some seven digits."""
    model, sol = motion(name)
    row = sol.phases[len(sol.phases) // 2]
    phase, t = model.phase(row), (row.start + row.end) / 2
    x = stored(sol, t, phase.states)
    slopes = np.array([(phase.rhs(t, x + h) - phase.rhs(t, x - h)) / 2e-6 for h in 1e-6 * np.eye(x.size)]).T
    np.testing.assert_allclose(phase.jacobian(t, x).toarray(), slopes, rtol=0, atol=1e-5 * np.abs(slopes).max())
    functions = [node.name for node in ast.parse(phase.code).body if isinstance(node, ast.FunctionDef)]
    assert functions == ["function"]
    assert phase.cost().form == "scalar"


@pytest.mark.parametrize("what", ["rhs", "jacobian", "cost()", "code"])
def test_what_is_of_one_phase_alone_is_refused_with_the_next_step(what: str) -> None:
    model = crane().compile()
    calls: dict[str, Callable[[], object]] = {
        "rhs": lambda: model.rhs(0.0, np.zeros(3)),
        "jacobian": lambda: model.jacobian(0.0, np.zeros(3)),
        "cost()": model.cost,
        "code": lambda: model.code,
    }
    with pytest.raises(sw.CompileError, match=r"each phase has equations of its own") as refused:
        calls[what]()
    message = str(refused.value)
    assert f"model.phase('gap open, load slipping forward, brake slipping forward').{what}" in message
    assert "load slipping forward | slipping backward | stuck" in message


def test_wrong_words_list_what_exists() -> None:
    model = crane().compile()
    with pytest.raises(sw.ParameterError, match=r"no phase 'load sticking'. There are: gap open \| in contact"):
        model.phase("load sticking")
    with pytest.raises(sw.ParameterError, match="must be a text such as 'gap open'"):
        model.phase(3)  # type: ignore[arg-type]
    with pytest.raises(sw.ParameterError, match=r"the same at all times. Take .* model.rhs"):
        sw.scenes.shaft_step().compile().phase("gap open")


def test_a_phase_is_found_by_some_of_its_words_in_any_order() -> None:
    model = crane().compile()
    assert model.phase("load stuck, gap open").name == "gap open, load stuck, brake slipping forward"
    assert model.phase("brake locked, load stuck").states == ("gap.phi",)
    assert model.phase("gap open").states == ("J1.omega", "J2.omega", "gap.phi")
    assert model.phase("gap open") is model.phase("gap open, load slipping forward")


@pytest.mark.slow
@pytest.mark.parametrize("name", NETWORKS)
def test_the_states_of_the_model_are_those_of_its_motions_and_start_another_one(name: str) -> None:
    """Tolerance 1e-6 of the largest value: both motions are right to 1e-8, and events shift by that."""
    model, sol = motion(name)
    assert model.states == sol.states
    middle, end = sol.t[-1] / 2, sol.t[-1]
    held = sol.at([middle])
    initial = dict(zip(model.states, held.x[0].tolist(), strict=True))
    again = model.simulate(end, t_start=middle, initial=initial, rtol=1e-10)
    assert np.abs((again.x[-1] - sol.x[-1]) / np.abs(sol.x).max(axis=0)).max() < 1e-6


def waving() -> sw.Network:
    """A travelling wave between two inertias."""
    net = sw.Network("waving")
    net.add(sw.TorqueSource("motor", tau=5.0), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Shaft("line", diameter=0.1, length=2.0, model=sw.Wave()), "a", "b")
    net.add(sw.Inertia("J2", J=1.0), "b")
    return net


@pytest.mark.slow
@pytest.mark.parametrize("build", [crane, waving])
def test_a_point_that_is_no_moment_of_this_network_is_refused(build: Callable[[], sw.Network]) -> None:
    """As that of a network without modes is."""
    net, other = build(), sw.Network("other")
    other.add(sw.Inertia("J9", J=1.0), "a")
    sol, moment = net.simulate(0.1), other.simulate(0.1).at([0.1])
    with pytest.raises(sw.ParameterError, match=r"a motion of 1001 times; take one of them, such as at=sol.at\(\[0.1"):
        net.modes(sol, count=2)
    with pytest.raises(sw.ParameterError, match=r"a motion of 'other' with other states. The states here are: J1.om"):
        net.modes(moment, count=2)
    assert len(net.modes(sol.at([0.1]), count=2)) == 2


def test_the_time_of_the_laws_at_a_moment_of_a_motion_must_be_a_number() -> None:
    model = crane().compile()
    moment = model.simulate(0.2).at([0.2])
    with pytest.raises(sw.ParameterError, match="t = 'soon' must be a number"):
        model.linearize(moment, t="soon")  # type: ignore[arg-type]


def test_sensitivities_at_a_moment_are_those_of_the_modes_there_where_a_speed_is_no_state() -> None:
    """Rigid bodies swing against each other at sqrt(c / J1' + c / J3) with J1' = J2 + 4 J1: half a per cent by c."""
    net = geared()
    moment = net.simulate(1.0).at([0.5])
    made = sw.studies.frequency_sensitivities(net, moment)
    np.testing.assert_allclose(made.frequencies, net.modes(moment).frequencies[-1:], rtol=1e-12)
    assert made.relative["shaft.c"][0] == pytest.approx(0.5, abs=1e-3)  # the damping moves it by its square, 3e-4


def test_a_network_is_assembled_for_its_first_phase_and_has_no_number_of_a_mode_among_its_parameters() -> None:
    model = crane().compile()
    sets = model.equation_sets  # type: ignore[attr-defined]
    first = sets.of(sets.first).model
    assert first.form is model.form
    assert {*first.parameters} - {*model.parameters} == {"gap.mode", "load.mode", "brake.mode"}
    assert [sets.first, *(value for name, value in first.parameters.items() if name.endswith("mode"))] == [
        ("open", "forward", "forward"),
        *(0.0, 1.0, 1.0),
    ]


def behind_a_gap(beside: sw.Component) -> sw.Network:
    """A node without inertia between a gap that gives way and something else."""
    net = sw.Network("behind a gap")
    net.add(sw.TorqueSource("motor", tau=1.0), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Backlash("gap", gap=0.1, c=1e4, d=10.0), "a", "b")
    net.add(beside, "b", "c")
    net.add(sw.Inertia("J2", J=1.0), "c")
    return net


@pytest.mark.parametrize(
    ("beside", "kind"),
    [
        (sw.Spring("shaft", c=1e3, d=1.0), "algebraic loop"),  # in contact; while the gap is open the damping holds
        (sw.Backlash("other", gap=0.1, c=1e4, d=10.0), "undetermined speed"),  # while both are open
    ],
    ids=["spring", "gap"],
)
def test_what_lacks_in_a_later_phase_is_said_when_the_network_is_checked_and_compiled(
    beside: sw.Component, kind: str
) -> None:
    net = behind_a_gap(beside)
    assert [problem.kind for problem in net.check()] == [kind]
    with pytest.raises(sw.NetworkError, match=f"{kind}: node 'b'"):
        net.compile()


@pytest.mark.slow
@pytest.mark.parametrize("name", registered())
def test_modes_that_say_the_same_have_the_same_equations(name: str) -> None:
    """Else the words of a phase would not tell which equations hold in it."""
    part = next(made for made in bed_of(name).graph().parts if made.name == "subject")
    placed = Placed(part.component, ("node",) * len(part.component.ports))
    groups: dict[tuple[str, str], set[object]] = {}
    for label, mode in ((element.label, mode) for element in part.modes for mode in element.options):
        made = make_template(
            part.component, resolve(placed.part)[0], (ModeChoice(mode.form, mode.value),) * len(part.modes)
        )
        laws = tuple((b.kind, b.law, b.ends, b.terms, b.through) for b in made.branches)
        groups.setdefault((label, mode.words), set()).add(laws)
    assert [words for words, laws in groups.items() if len(laws) > 1] == []


@pytest.mark.slow
@pytest.mark.parametrize("part", ["motor", "J1", "J2", "J3", "J4"])
def test_an_angle_that_is_recorded_leaves_the_motion_as_it_is(part: str) -> None:
    """A rate of the angle once stood for the acceleration in the torque that ends a mode: the clutch never slipped."""
    net = clutches()
    net.add(sw.Brake("brake", tau=50.0, t_on=1.0), "a")
    plain, recorded = net.simulate(2.0), net.simulate(2.0, angles=part)
    assert [event[1:] for event in recorded.events] == [event[1:] for event in plain.events]
