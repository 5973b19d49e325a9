"""Declared parameters: bounds, units, laws, and what the constructor says of wrong arguments."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pint
import pytest

import shaftwork as sw
from shaftwork.core.parameters import Parameter, whole


def problem_of(part: sw.Component) -> str:
    net = sw.Network("one part")
    net.add(part, *[f"n{k}" for k in range(len(part.ports))])
    return str(next(problem for problem in net.check() if problem.severity == "error" and part.name in problem.parts))


@pytest.mark.parametrize(
    ("part", "words"),
    [
        (sw.Inertia("J1", J=-1.0), ("J1", "J", "at least 0", "-1")),
        (sw.Inertia("J1", J=math.nan), ("J1", "finite")),
        (sw.Inertia("J1", J=math.inf), ("J1", "finite")),
        (sw.Inertia("J1", J="heavy"), ("J1", "number", "heavy")),
        (sw.Inertia("J1", J=None), ("J1", "number")),
        (sw.Inertia("J1", J=True), ("J1", "number")),
        (sw.Inertia("J1", J=[1.0, 2.0]), ("J1", "number", "list")),
        (sw.Damper("J1", d=sw.t), ("J1", "number")),
        (sw.Inertia("J1", J=1 + 2j), ("J1", "number")),
        (sw.Brake("b", tau=-5.0), ("b", "tau = -5.0 must be at least 0", "Give tau (torque, also over time) in N*m")),
        (sw.Clutch("b", tau=-5.0), ("b", "tau = -5.0 must be at least 0")),
        (
            sw.BLDCMotor("m", U=1.0, R=1.0, L=1.0, k=1.0, pole_pairs=1.5),
            ("pole_pairs = 1.5 must be above 0 and whole",),
        ),
        (sw.HardStop("h", upper=1.0, restitution=2.0), ("Give restitution (of rigid flanks", "at most 1.")),
    ],
)
def test_a_value_that_cannot_be_is_named_with_its_part_and_bound(part: sw.Component, words: tuple[str, ...]) -> None:
    message = problem_of(part)
    for word in words:
        assert word in message


def test_a_wrong_or_missing_argument_is_answered_with_the_parameters() -> None:
    with pytest.raises(sw.ParameterError, match=r"J \[kg\*m\^2\] moment of inertia"):
        sw.Inertia("J1", j=1.0)
    with pytest.raises(sw.ParameterError, match=r"Spring 'shaft'.*missing.*'c'"):
        sw.Spring("shaft", d=1.0)
    with pytest.raises(sw.ParameterError, match="no parameters"):
        sw.Ground("frame", J=1.0)


def test_what_is_per_speed_says_whether_it_counts_revolutions_or_radians() -> None:
    """3 N m per revolution a minute are 3 / (2 pi / 60) N m s/rad; of 3 N m per 1/min nobody knows."""
    unit = pint.UnitRegistry()
    newton_metre, volt = unit.N * unit.m, unit.V
    for d, expected in (
        (3 * newton_metre / unit.rpm, 90 / math.pi),
        (3 * newton_metre * unit.s, 3.0),
        (3 * newton_metre * unit.minute / unit.rad, 180.0),
    ):
        net = sw.Network("per speed")
        net.add(sw.SpeedSource("drive", omega=1.0), "a")
        net.add(sw.Damper("d", d=d), "a")
        assert net.compile().parameters["d.d"] == pytest.approx(expected, rel=1e-12)
    for part in (
        sw.Damper("d", d=3 * newton_metre / (1 / unit.minute)),
        sw.Damper("d", d=3 * newton_metre / unit.Hz),
        sw.Spring("d", c=1.0, d=3 * newton_metre * unit.hour),
        sw.DCMachine("d", k=2 * volt / (1000 / unit.minute)),
    ):
        assert "may count revolutions or radians; write rpm or rad into it" in problem_of(part)
    unit.formatter.default_format = "~P"  # symbols for names: what is shown says nothing of what is counted
    assert "may count revolutions" in problem_of(sw.Damper("d", d=3 * newton_metre * unit.minute))
    net = sw.Network("symbols")
    net.add(sw.SpeedSource("drive", omega=60 * unit.rpm), "a")
    net.add(sw.Damper("d", d=1.0), "a")
    assert net.compile().parameters["drive.omega"] == pytest.approx(2 * math.pi)


def test_quantities_with_units_are_converted_and_wrong_units_are_refused() -> None:
    unit = pint.UnitRegistry()
    net = sw.Network("units")
    net.add(sw.Inertia("J1", J=10000.0 * unit.g * unit.m**2), "a")
    net.add(sw.TorqueSource("T", tau=0.02 * unit.kN * unit.m), "a")
    net.add(sw.KlossMotor("M", tau_k=9.6 * unit.N * unit.m, s_k=0.25, n_sync=3000 / unit.minute), "a")
    model = net.compile()
    assert model.parameters["J1.J"] == pytest.approx(10.0)
    assert model.parameters["T.tau"] == pytest.approx(20.0)
    assert model.parameters["M.n_sync"] == pytest.approx(3000.0)
    for speed in (3000 * unit.rpm, 50 * unit.turn / unit.s, 50 * unit.Hz, 100 * math.pi * unit.rad / unit.s):
        net = sw.Network("speed")
        net.add(sw.KlossMotor("M", tau_k=9.6, s_k=0.25, n_sync=speed), "a")
        net.add(sw.Inertia("J", J=1.0), "a")
        assert net.compile().parameters["M.n_sync"] == pytest.approx(3000.0)
    net = sw.Network("prescribed")
    net.add(sw.SpeedSource("drive", omega=60 * unit.rpm), "a")
    net.add(sw.Damper("d", d=1.0 * unit.N * unit.m * unit.s), "a")
    assert net.simulate(1 * unit.minute, t_eval=2)["drive.tau"] == pytest.approx([2 * math.pi] * 2)
    assert "rpm or rad/s" in problem_of(sw.SpeedSource("drive", omega=1 * unit.Hz))
    assert "kg*m^2" in problem_of(sw.Inertia("J1", J=3.0 * unit.kg))
    assert "N*m/rad" in problem_of(sw.Spring("s", c=3.0 * unit.N / unit.m))


def test_numpy_and_integer_values_are_numbers() -> None:
    net = sw.Network("numbers")
    net.add(sw.Inertia("J1", J=np.float32(2.0)), "a")
    net.add(sw.Inertia("J2", J=np.array(3)), "a")
    net.add(sw.Inertia("J3", J=4), "a")
    assert list(net.compile().parameters.values()) == [2.0, 3.0, 4.0]


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: sw.DryFriction("p", tau_c=5.0, tau_s=3.0), "up to tau_s = 3 N.m, which is less than tau_c = 5 N.m"),
        (lambda: sw.Brake("p", tau=1.0, t_on=3.0, t_off=1.0), "t_off = 1 s is not later than t_on = 3 s"),
        (lambda: sw.FrequencyDrive("p", tau_k=9.0, s_k=0.1, n_sync=3000.0, f=50.0, f_end=60.0), "Leave one of them"),
    ],
)
def test_values_that_do_not_go_together_are_refused_when_a_part_is_made(
    make: Callable[[], sw.Component], words: str
) -> None:
    with pytest.raises(sw.ParameterError, match=f"'p': .*{words}"):
        make()


def test_new_values_are_judged_together_and_one_that_was_not_given_is_said_to_be_none() -> None:
    net = sw.Network("brakes")
    net.add(sw.Inertia("J", J=2.0), "a")
    net.add(sw.Brake("b", tau=1.0, t_on=1.0, t_off=2.0), "a")
    net.add(sw.Brake("c", tau=sw.Ramp(1.0, 2.0)), "a")
    model, start = net.compile(), {"J.omega": 9.0}
    later = model.simulate(5.0, initial=start, parameters={"b.t_on": 3.0, "b.t_off": 4.0, "c.t_on": 9.0})
    assert [round(event[0], 9) for event in later.events] == [3.0, 4.0]
    with pytest.raises(sw.ParameterError, match="t_off = 2 s is not later than t_on = 3 s"):
        model.simulate(5.0, parameters={"b.t_on": 3.0})
    with pytest.raises(
        sw.ParameterError, match=r"t_off was not given when .*Give a number there, t_off=.*are: c\.t_on"
    ):
        model.simulate(5.0, parameters={"c.t_off": 3.0})
    with pytest.raises(sw.ParameterError, match="tau is no number when"):
        model.simulate(5.0, parameters={"c.tau": 3.0})
    with pytest.raises(sw.ParameterError, match=r"no parameter 'c\.tua'\. There are: c\.t_on, c\.t_rise, c\.t_lag\."):
        model.simulate(5.0, parameters={"c.tua": 3.0})


def test_bounds_read_as_words() -> None:
    assert Parameter("eta", "1", "efficiency", above=0, at_most=1).bounds == "above 0 and at most 1"
    assert Parameter("i", "1", "ratio", nonzero=True).bounds == "not zero"
    assert Parameter("x", "m", "place").bounds == ""
    assert Parameter("p", "1", "pairs", above=0, whole=True).bounds == "above 0 and whole"


@pytest.mark.parametrize("three", [3, np.int64(3), np.uint8(3)])
def test_a_count_may_be_an_integer_of_any_kind(three: int) -> None:
    """numpy's are what a loop over an array gives."""
    assert type(whole(three)) is int
    assert repr(sw.Lumped(three)) == repr(sw.Lumped(3))
    net = sw.Network("one")
    net.add(sw.TorqueSource("motor", tau=1.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    made = sw.studies.sweep(net, {"J.J": [1.0, 2.0]}, t_end=0.1, measures=["end J.omega"], processes=three // three)
    assert len(made.best("end J.omega", three)) == 2


@pytest.mark.parametrize("none", [True, np.bool_(1), 2.0, np.float64(3.0), "4", None, 0, 9])
def test_what_is_no_count_or_out_of_its_range_is_none(none: object) -> None:
    assert whole(none, 1, 8) is None


@pytest.mark.parametrize(("length", "whole_shown"), [(80, True), (81, False)])
def test_a_wrong_value_is_shown_up_to_a_line(length: int, *, whole_shown: bool) -> None:
    wrong = "x" * (length - 2)  # with its quotes
    with pytest.raises(sw.ParameterError) as refused:
        sw.Port("p", wrong)  # type: ignore[arg-type]
    assert (repr(wrong) in str(refused.value)) == whole_shown
