"""A session answers what the library computes for the same values, and what it says where these cannot be."""

from __future__ import annotations

import base64
import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import shaftwork as sw
from shaftwork.cli import main
from shaftwork.codegen.start_values import initial_state
from shaftwork.core.errors import ShaftworkError
from shaftwork.live.page import served_page
from shaftwork.live.session import POINTS, Session
from shaftwork.results.observer import Array
from shaftwork.scenes import SCENES
from tests.properties.examples import share_of_examples

WANTED = ["curves", "extremes", "modes", "drawing"]


@pytest.fixture(scope="module")
def crane() -> Session:
    return Session(SCENES["crane"])


def numbers(packed: dict[str, str]) -> Array:
    assert packed["dtype"] == "f8"
    return np.frombuffer(base64.b64decode(packed["bdata"]))


def test_masses_whose_spring_has_lost_its_stiffness_are_shown() -> None:
    answer = Session(SCENES["crane-start"]).answer({"set": {"shaft.c": 0.0}})
    assert "error" not in answer
    speeds = [numbers(answer["curves"][name])[-1] for name in ("J1.omega", "J2.omega")]
    assert speeds[0] != speeds[1]  # each mass turns for itself


def test_curves_are_those_of_simulate_with_the_same_values_to_the_last_bit(crane: Session) -> None:
    values = {"shaft.c": 12_000.0, "J2.J": 80.0}
    answer = crane.answer({"set": values})
    motion = SCENES["crane"]().simulate(10.0, parameters=values, t_eval=POINTS)
    assert (numbers(answer["t"]) == motion.t).all()
    for name in SCENES["crane"].signals:
        assert (numbers(answer["curves"][name]) == motion[name]).all(), name
    assert answer["phases"] == [{"start": row.start, "end": row.end, "modes": dict(row.modes)} for row in motion.phases]


def test_extremes_and_frequencies_are_those_of_the_library(crane: Session) -> None:
    values = {"brake.tau": 200.0, "J1.J": 40.0}
    answer = crane.answer({"set": values, "want": ["extremes", "modes"], "at": 5.0})
    motion = crane.model.simulate(10.0, parameters=values, t_eval=POINTS)
    for row in answer["extremes"]:
        ends = motion.min(row["name"]), motion.max(row["name"])
        assert (row["min"], row["t_min"], row["max"], row["t_max"]) == (ends[0], ends[0].t, ends[1], ends[1].t)
    modes = crane.model.linearize(motion.at([5.0]), parameters=values).modes()
    assert [mode["frequency"] for mode in answer["modes"]] == modes.frequencies.tolist()
    assert [mode["damping"] for mode in answer["modes"]] == modes.damping.tolist()
    shapes = np.array([[complex(*one) for one in mode["shape"]] for mode in answer["modes"]])
    assert ([modes.shapes["rotor.omega"], modes.shapes["wheel.omega"]] == shapes.T).all()


@pytest.mark.slow
def test_modes_about_rest_need_no_motion_and_say_where_they_are_none() -> None:
    """Of a train through a wave no matrix is made; its modes are found with the exact shaft."""
    session = Session(SCENES["ship-line"])
    assert "error" not in session.answer({"want": ["modes"]})
    net = sw.Network("wave")
    net.add(sw.TorqueSource("motor", tau=10.0), "rotor")
    net.add(sw.Inertia("J", J=2.0), "rotor")
    net.add(sw.Shaft("line", length=10.0, diameter=0.1, model=sw.Wave()), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=2.0), "wheel")
    thinner = {"line.diameter": 0.05}
    answer = Session(net, t_end=0.1).answer({"set": thinner, "want": ["modes"]})
    net.replace(sw.Shaft("line", length=10.0, diameter=0.05, model=sw.Wave()))
    assert [mode["frequency"] for mode in answer["modes"]] == net.modes().frequencies.tolist()


def test_the_drawing_has_the_values(crane: Session) -> None:
    drawing = crane.answer({"set": {"J2.J": 77.5}, "want": ["drawing"]})["drawing"]
    assert drawing.startswith("<svg")
    assert "77.5" in drawing
    assert "62.5" not in drawing


@pytest.mark.parametrize(
    ("request_", "said"),
    [
        ({"set": {"J1.J": -1.0}}, "Inertia 'J1': J = -1.0 must be at least 0."),
        ({"set": {"J1.J": "abc"}}, "Inertia 'J1': J = 'abc' must be a number or a law, not str 'abc'."),
        ({"set": {"J1.J": math.inf}}, "Inertia 'J1': J = inf must be a finite number."),
        ({"set": {"J1.K": 1.0}}, "There is no parameter 'J1.K'. There are: J1.J."),
        ({"t_end": -1.0}, "t_end = -1.0 must be a finite time after t_start = 0.0."),
        ({"t_end": "soon"}, "t_end = 'soon' must be a number, not str 'soon'."),
        ({"set": []}, "set = [] of a request is of the wrong kind."),
        ({"values": {}}, "A request has no 'values'. It has: set, initial, want, t_end, at."),
        ({"initial": {"J1.omega": "fast"}}, "the start value of 'J1.omega' = 'fast' must be a number, not str 'fast'."),
        ({"want": ["curve"]}, "A request wants no 'curve'. It may want: curves, layout, extremes, modes, drawing."),
        ([], "A request must be an object, such as {'set': {'J1.J': 2.0}, 'want': ['curves']}."),
    ],
)
def test_what_cannot_be_is_answered_in_the_words_of_the_library(crane: Session, request_: Any, said: str) -> None:
    assert crane.answer(request_)["error"] == said
    assert "error" not in crane.answer({})  # and nothing is broken by it


def test_a_closed_session_ends_what_is_being_computed() -> None:
    session = Session(SCENES["shaft-chain"])
    session.closing.set()
    assert "nobody waits for it any more." in session.answer({"t_end": 1e4})["error"]


def test_warnings_of_the_library_are_answers_too() -> None:
    session = Session(SCENES["excavator"])
    answer = session.answer({"set": {"motor.tau_a": 5400.0}})
    assert any("turns once more" in text for text in answer["warnings"])


def test_a_slider_spans_a_factor_to_both_sides_within_the_bounds_of_its_parameter(crane: Session) -> None:
    stiffness, efficiency = crane.sliders["shaft.c"], crane.sliders["motor.efficiency"]
    assert (stiffness.low, stiffness.high) == (24206.0 / 4, 24206.0 * 4)
    assert (efficiency.unit, efficiency.value, efficiency.high) == ("1", 0.95, 1.0)
    parts = {part.name: part for part in crane.network.parts}
    declared = {name: parts[name.partition(".")[0]].declared[name.partition(".")[2]] for name in crane.sliders}
    for slider in crane.sliders.values():
        for count in (2, 5, 21):
            values = slider.values(count)
            assert slider.value in values
            assert values == sorted(values)
            assert len(values) <= count + 1  # a third value beside two ends
            assert [declared[slider.name].objection(value) for value in values] == [None] * len(values)


def test_a_network_without_a_scene_shows_its_first_states() -> None:
    net = sw.Network("two masses")
    net.add(sw.TorqueSource("motor", tau=10.0), "rotor")
    net.add(sw.Inertia("J1", J=2.0), "rotor")
    net.add(sw.Spring("shaft", c=100.0, d=1.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=3.0), "wheel")
    session = Session(net, t_end=1.0)
    assert session.signals == session.model.states
    assert session.changed({"J1.J": 4.0}).simulate(1.0)["J1.omega"][-1] == pytest.approx(10.0 / 7, rel=0.2)
    with pytest.raises(sw.ParameterError, match="must be at least 0"):
        session.changed({"J1.J": -4.0})
    with pytest.raises(sw.SignalError, match="'shaft' has"):
        Session(net, t_end=1.0, signals=["shaft.tua"])


def test_the_stage_has_turning_and_sliding_nodes_in_the_order_of_the_train() -> None:
    answer = Session(SCENES["crane-train"]).answer({"t_end": 0.5, "want": ["curves", "layout"]})
    stage = answer["layout"]["stage"]
    columns = [(node["name"], node["turns"], node["column"]) for node in stage["nodes"]]
    assert columns[0] == ("rotor", True, 0)
    assert columns[-1] == ("crane", False, len(columns) - 1)
    assert [node["inertias"] for node in stage["nodes"] if node["name"] == "wheel"] == [["wheel.J"]]
    joined = {link["part"]: (link["a"], link["b"]) for link in stage["links"]}
    assert joined["stage 1"] == (2, 3)
    assert {end["part"] for end in stage["ends"]} >= {"motor", "brake", "load"}
    assert [len(numbers(angle)) for angle in answer["train"]["angles"]] == [POINTS] * len(columns)


def test_axes_and_train_are_those_of_the_first_motion_that_there_is() -> None:
    """The network's own values need give none: a run that fails is an answer, and is mended on the page."""
    net = sw.Network("root")
    net.add(sw.TorqueSource("motor", tau=10.0), "rotor")
    net.add(sw.Inertia("J1", J=2.0), "rotor")
    net.add(sw.Brake("brake", tau=1.0, t_on=0.1), "rotor")
    session = Session(net, t_end=1e9)
    assert "error" in session.answer({"t_end": 1e9, "set": {"brake.tau": -1.0}, "want": ["curves", "layout"]})
    answer = session.answer({"t_end": 1.0, "want": ["curves", "layout"]})
    assert answer["layout"]["axes"] == [{"unit": "rad/s", "signals": ["J1.omega"]}]
    assert session._last is not None
    assert session._last[1].t[-1] == 1.0  # no other motion was simulated for the layout


def test_values_that_cannot_be_are_all_named_with_their_field(crane: Session) -> None:
    """What each field says is what the library says to its value alone."""
    wrong = {"shaft.c": -1.0, "J1.J": "heavy", "motor.efficiency": 1.5}
    answer = crane.answer({"set": {**wrong, "J2.J": 70.0}, "initial": {"J1.omega": math.inf}, "t_end": "soon"})
    assert answer["fields"].keys() == {"set", "initial", "t_end"}
    assert answer["fields"]["set"].keys() == wrong.keys()
    for name, value in wrong.items():
        with pytest.raises(sw.ParameterError) as error:
            crane.model.simulate(1.0, parameters={name: value})
        assert answer["fields"]["set"][name] == str(error.value)
    with pytest.raises(sw.ParameterError) as error:
        crane.model.simulate(1.0, initial={"J1.omega": math.inf})
    assert answer["fields"]["initial"] == {"J1.omega": str(error.value)}
    with pytest.raises(sw.ParameterError) as error:
        crane.model.simulate("soon")  # type: ignore[arg-type]
    assert answer["fields"]["t_end"] == {"t_end": str(error.value)}


def test_fields_have_symbols_units_and_bounds(crane: Session) -> None:
    shaft, motor = crane.sliders["shaft.c"], crane.sliders["motor.tau_a"]
    assert (shaft.symbol, shaft.unit, shaft.bounds) == (("c", ""), "N*m/rad", "at least 0")
    assert (motor.symbol, motor.unit, motor.bounds) == (("τ", "A"), "N*m", "above 0")
    assert crane.sliders["motor.efficiency"].bounds == "above 0 and at most 1"
    starts = [(field.name, field.symbol, field.unit) for field in crane.starts.values()]
    assert starts == [
        ("J1.omega", ("ω", ""), "rad/s"),
        ("shaft.phi_rel", ("φ", "rel"), "rad"),
        ("J2.omega", ("ω", ""), "rad/s"),
    ]


@pytest.mark.parametrize("scene", SCENES)
def test_every_start_value_that_a_page_offers_is_one_that_a_motion_can_have(scene: str) -> None:
    """Zero is what each of them is without a value, so that nothing contradicts it."""
    session = Session(SCENES[scene])
    for name, field in session.starts.items():
        assert field.unit, name
    motion = session.model.start_equations({})
    initial_state(motion, dict.fromkeys(session.starts, 0.0), 0.0)


def test_a_motion_starts_with_the_values_of_the_request_or_of_the_session() -> None:
    start = {"J1.omega": 4.0, "J2.omega": 4.0, "shaft.phi_rel": 0.01}
    session = Session(SCENES["crane"], initial=start)
    assert {name: field.value for name, field in session.starts.items()} == start
    for request, initial in (({}, start), ({"initial": {"J1.omega": 2.0}}, {"J1.omega": 2.0}), ({"initial": {}}, None)):
        motion = SCENES["crane"]().simulate(10.0, initial=initial, t_eval=POINTS)
        assert (numbers(session.answer(request)["curves"]["shaft.tau"]) == motion["shaft.tau"]).all()


def test_angles_that_are_given_or_drawn_are_recorded() -> None:
    session = Session(SCENES["crane"], initial={"J1.phi": 1.0}, signals=["J2.phi"])
    motion = SCENES["crane"]().simulate(10.0, initial={"J1.phi": 1.0}, t_eval=POINTS, angles=["J1", "J2"])
    assert (numbers(session.answer({})["curves"]["J2.phi"]) == motion["J2.phi"]).all()


def test_the_work_on_an_answer_has_limits_that_it_names(monkeypatch: pytest.MonkeyPatch) -> None:
    session = Session(SCENES["crane-start"])
    assert session.answer({"t_end": 1e9}) == {
        "error": "The motion has not come to its end at t = 1e+09 s: 100000 steps and 120 s are the most that an "
        "answer of a page takes. Let the motion end earlier on the page, or compute it with simulate."
    }
    monkeypatch.setattr("shaftwork.live.work.LONGEST", 0.0)
    assert (
        "are the most that an answer of a page takes" in session.answer({"t_end": 3.0, "want": ["extremes"]})["error"]
    )
    monkeypatch.undo()
    assert "error" not in session.answer({"t_end": 3.0, "want": ["curves", "extremes"]})


def test_the_work_ends_when_nobody_waits() -> None:
    said = Session(SCENES["shaft-chain"]).answer({"t_end": 0.3}, lambda: False)["error"]
    assert said == "The work on the answer ended at t = 0.3 s of the motion: nobody waits for it any more."


@pytest.mark.slow
@share_of_examples(0.5)
@given(factors=st.lists(st.floats(0.26, 3.9), min_size=4, max_size=4))
def test_any_position_of_the_sliders_is_answered_as_json(factors: list[float]) -> None:
    """Whatever the sliders say, the page is given finite numbers or a sentence of the library."""
    session = _shared()
    names = list(session.sliders)[-4:]
    values = {name: session.sliders[name].value * factor for name, factor in zip(names, factors, strict=True)}
    text = json.dumps(session.answer({"set": values, "want": WANTED[:3]}), allow_nan=False)
    answer = json.loads(text)
    assert "error" in answer or np.isfinite(numbers(answer["curves"]["shaft.tau"])).all()


_SESSIONS: list[Session] = []


def _shared() -> Session:
    if not _SESSIONS:
        _SESSIONS.append(Session(SCENES["six-phases"]))
    return _SESSIONS[0]


def test_errors_of_the_library_alone_are_answers(crane: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    """A mistake in the code is no answer: the server says of which kind it is, and the tests see it."""

    def broken(*_: Any) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(crane, "_motion", broken)
    with pytest.raises(ZeroDivisionError):
        crane.answer({})
    assert not issubclass(ZeroDivisionError, ShaftworkError)


@pytest.mark.parametrize(
    ("sliders", "counts", "said"),
    [
        (["shaft.k"], (), "There is no slider 'shaft.k'. There are: motor.tau_a, "),
        (["shaft.c", "shaft.c"], (), "sliders = shaft.c, shaft.c has a name twice."),
        (["shaft.c", "J1.J", "J2.J"], (), "a page without a server has one or two, such as shaft.c."),
        ([], (), "a page without a server has one or two, such as shaft.c."),
        (["shaft.c"], (1,), r"counts = \(1,\) must be a whole number from 2 on for each slider"),
        (["shaft.c"], (11, 11), r"counts = \(11, 11\) must be a whole number from 2 on for each slider"),
        (["shaft.c", "J1.J"], (21, 21), r"counts = \(21, 21\) are 441 answers; a page has at most 400."),
    ],
)
def test_a_page_without_a_server_refuses_what_it_cannot_offer(
    crane: Session, sliders: list[str], counts: tuple[int, ...], said: str
) -> None:
    with pytest.raises(sw.ParameterError, match=said):
        crane.page(sliders, counts)


def test_the_command_refuses_a_live_page_beside_no_page(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", "crane-start", "--pdf", "--live", "shaft.c"]) == 2
    assert capsys.readouterr().err == "shaftwork: --live writes live.html beside report.html. Give --html, too.\n"


def test_no_text_of_a_network_ends_the_script_that_it_stands_in() -> None:
    net = sw.Network("</script><script>alert(1)</script>")
    net.add(sw.TorqueSource("motor", tau=10.0), "rotor")
    net.add(sw.Inertia("J1", J=2.0), "rotor")
    page = served_page(Session(net, t_end=1.0))
    assert "<script>alert" not in page
    assert "&lt;/script&gt;" in page
