"""Random drives whose every law is replayed from their solution in each engine; the replay itself can fail."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import pytest
import sympy
from hypothesis import given, reject

import shaftwork as sw
from shaftwork import NetworkWarning, SimulationError, Solution
from tests.drives import drives
from tests.properties.examples import processor_time_limit, share_of_examples
from tests.properties.jump_replay import jump_objections
from tests.properties.law_replay import Motion, objections
from tests.trains import Part, Train

RTOL = 1e-9
# A prescribed speed that is locked on its way, and gears that do, have no motion; networks with them are refused.
NO_MOTION = ("blocked speed source", "jammed coupling")


def moved(train: Train, engine: str = "heyoka") -> Solution:
    """The motion of a drive; a motion that has no end would be a failure."""
    with warnings.catch_warnings(), processor_time_limit(60.0):
        warnings.simplefilter("ignore", NetworkWarning)  # parts may be loose of each other on purpose
        model = train.compiled()
        initial = {name: value for name, value in train.initial.items() if name in model.states}
        return model.simulate(train.t_end, engine=engine, rtol=RTOL, initial=initial)


def all_objections(parts: tuple[Part, ...], motion: Motion) -> list[str]:
    """What is wrong in the phases of a motion and between them."""
    return objections(parts, motion) + jump_objections(parts, motion)


def replayed(train: Train, engine: str) -> list[str]:
    """What is wrong in the motion of a drive."""
    try:
        sol = moved(train, engine)
    except SimulationError as error:
        if any(words in str(error) for words in NO_MOTION):
            reject()
        raise
    return all_objections(train.parts, Motion(sol))


@pytest.mark.slow
@given(drives(most=4))
@share_of_examples(0.06)
def test_every_law_holds_in_the_motion_of_a_random_drive(train: Train) -> None:
    assert replayed(train, "heyoka") == []


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["scipy", "sundials"])
@given(drives(most=2))
@share_of_examples(0.03)
def test_every_law_holds_whichever_engine_integrates(engine: str, train: Train) -> None:
    assert replayed(train, engine) == []


PULSE = sw.Step(30.0, 0.05) - sw.Step(60.0, 0.45) + sw.Step(30.0, 0.7)
LINE = sw.Step(2.0, 0.2) - sw.Step(3.0, 0.6) + 0.5 * sympy.sin(8.0 * sw.t)
DRIVE = Train(
    (
        Part("Inertia", "J1", ("motor",), {"J": 0.5}),
        Part("TorqueSource", "push", ("motor",), {"tau": PULSE}),
        Part("DryFriction", "bearing", ("motor",), {"tau_c": 3.0, "tau_s": 4.0, "omega_s": 0.5, "d": 0.05}),
        Part("LossyGear", "gear", ("motor", "out"), {"ratio": -2.0, "efficiency": 0.8, "efficiency_back": 0.6}),
        Part("Inertia", "J2", ("out",), {"J": 1.5}),
        Part("Hoist", "load", ("out",), {"m": 10.0, "radius": 0.1, "ratio": 1.0, "efficiency": 0.7}),
        Part("Backlash", "gap", ("out", "far"), {"gap": 0.1, "restitution": 0.4, "omega_rest": 0.05}),
        Part("Inertia", "J3", ("far",), {"J": 0.8}),
        Part("HardStop", "stop", ("far",), {"upper": 0.2, "lower": -0.3, "c": 2000.0, "d": 2.0}),
        Part("Clutch", "clutch", ("driven", "far"), {"tau": 6.0, "t_on": 0.3}),
        Part("SpeedSource", "line", ("driven",), {"omega": LINE}),
        Part("Inertia", "J4", ("driven",), {"J": 0.3}),
        Part("Spring", "shaft", ("driven", "end"), {"c": 400.0, "d": 0.5}),
        Part("PlanetaryGear", "mixer", ("end", "arm", "ring"), {"ratio": 2.0}),
        Part("Inertia", "J5", ("end",), {"J": 0.2}),
        Part("Inertia", "J6", ("arm",), {"J": 0.4}),
        Part("Freewheel", "backstop", ("ring",), {}),
        Part("Inertia", "J7", ("ring",), {"J": 0.6}),
        Part("Brake", "brake", ("arm",), {"tau": 2.0, "t_on": 0.4, "t_lag": 0.1}),
        Part("Inertia", "J8", ("loose",), {"J": 0.5}),
        Part("HardStop", "buffer", ("loose",), {"upper": 0.1, "lower": -0.1, "restitution": 0.7, "omega_rest": 0.05}),
    ),
    {"J8.omega": 2.0},
    0.9,
)
WRONG: list[tuple[str, dict[str, Any]]] = [
    ("J1", {"J": 0.501}),
    ("push", {"tau": PULSE + 0.01}),
    ("bearing", {"tau_c": 2.99}),
    ("bearing", {"tau_s": 3.0}),
    ("bearing", {"d": 0.06}),
    ("gear", {"ratio": -2.001}),
    ("gear", {"efficiency": 0.81}),
    ("gear", {"efficiency_back": 0.61}),
    ("load", {"efficiency": 0.71}),
    ("load", {"m": 10.01}),
    ("gap", {"gap": 0.101}),
    ("buffer", {"restitution": 0.71}),
    ("stop", {"upper": 0.201}),
    ("stop", {"c": 2010.0}),
    ("clutch", {"tau": 5.9}),
    ("clutch", {"t_on": 0.31}),
    ("line", {"omega": LINE - sw.Step(0.001, 0.6)}),
    ("shaft", {"c": 401.0}),
    ("shaft", {"d": 0.51}),
    ("mixer", {"ratio": 2.001}),
    ("brake", {"t_lag": 0.11}),
]


@pytest.fixture(scope="module")
def motion() -> Motion:
    """A motion through most modes of all these parts."""
    return Motion(moved(DRIVE))


@pytest.mark.slow
def test_the_replayed_drive_has_no_objection_and_meets_what_is_to_be_judged(motion: Motion) -> None:
    assert all_objections(DRIVE.parts, motion) == []
    said = {(name, mode) for phase in motion.sol.phases for name, mode in phase.modes.items()}
    turns = {("gear", f"{drives} {way}") for drives in ("driving", "driven") for way in ("forward", "backward")}
    assert said >= turns | {("load", "stuck"), ("stop", "in contact"), ("clutch", "engaged"), ("backstop", "locked")}
    assert any(event[1] == "gap" and event[3] == "rebound" for event in motion.sol.events)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "values"), WRONG, ids=[f"{name}-{next(iter(values))}" for name, values in WRONG])
def test_a_part_with_another_value_is_found(name: str, values: dict[str, Any], motion: Motion) -> None:
    parts = tuple(
        replace(part, values={**part.values, **values}) if part.name == name else part for part in DRIVE.parts
    )
    assert all_objections(parts, motion) != []


@pytest.mark.slow
# without its source the law of a prescribed speed is asked of nothing, and a wheel in free motion has no torque
@pytest.mark.parametrize("name", [part.name for part in DRIVE.parts if part.name not in ("line", "J8")])
def test_a_part_that_is_forgotten_is_found(name: str, motion: Motion) -> None:
    assert all_objections(tuple(part for part in DRIVE.parts if part.name != name), motion) != []
