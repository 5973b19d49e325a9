"""Frequencies, speeds and times with units mean what they say."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pint
import pytest

import shaftwork as sw

UNIT = pint.UnitRegistry()


def train() -> sw.Network:
    """A motor, a shaft and a load."""
    net = sw.Network("train")
    net.add(sw.TorqueSource("motor", tau=10.0), "rotor")
    net.add(sw.Inertia("J1", J=2.0), "rotor")
    net.add(sw.Spring("shaft", c=1e4, d=1.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=3.0), "wheel")
    return net


@pytest.mark.parametrize("f", [[600.0] * UNIT.rpm, [10.0] * UNIT.Hz, [20 * np.pi] * UNIT.rad / UNIT.s], ids=str)
def test_a_frequency_counts_revolutions_whatever_it_is_given_in(f: object) -> None:
    response = train().frequency_response("motor.tau", "shaft.tau", f)
    assert response.f == pytest.approx([10.0], rel=1e-14)  # rounding of the conversion


def test_speeds_in_rpm_are_converted_and_those_in_hertz_refused() -> None:
    diagram = train().campbell([0.0, 600.0] * UNIT.rpm)
    assert diagram.speeds == pytest.approx([0.0, 20 * np.pi], rel=1e-14)
    with pytest.raises(sw.ParameterError, match="rpm or rad/s"):
        train().campbell([0.0, 10.0] * UNIT.Hz)


def test_times_with_units_are_converted_or_refused() -> None:
    sol = train().simulate(0.1, t_eval=[0.0, 50.0, 100.0] * UNIT.ms)
    assert sol.t == pytest.approx([0.0, 0.05, 0.1], rel=1e-14)
    assert sol.at([20.0] * UNIT.ms).t == pytest.approx([0.02], rel=1e-14)
    with pytest.raises(sw.ParameterError, match="needs s"):
        sol.at([1.0] * UNIT.m)


def test_numbers_in_the_unit_of_a_quantity_that_is_named_elsewhere_refuse_units_of_their_own() -> None:
    """A line of cycles and the limit of a function do not know what is counted, so 2 kN m could be taken for 2 N m."""
    torque, net = 2.0 * UNIT.kN * UNIT.m, train()
    for find in (
        lambda: sw.studies.sweep(
            net, {"shaft.c": [1e4]}, t_end=0.1, measures={"own": lambda _: 1.0}, require={"own": (None, torque)}
        ),
        lambda: sw.optimize(
            net,
            {"shaft.c": (1e4, 2e4)},
            "max shaft.tau",
            t_end=0.1,
            functions={"own": lambda _: 1.0},
            require={"own": (None, torque)},
        ),
    ):
        with pytest.raises(sw.ParameterError, match=r"require\['own'\] = 2.0 .* has a unit"):
            find()
    line = {"amplitude": 2e3, "cycles": 1e6, "slope": 5.0}
    for name in ("amplitude", "limit", "ultimate"):
        with pytest.raises(sw.ParameterError, match=rf"{name} = 2.0 .* has a unit"):
            sw.SNLine(**{**line, name: torque})
    with pytest.raises(sw.ParameterError, match=r"amplitude = 2.0 .* has a unit"):
        sw.SNLine(**line).borne(torque)


def test_limits_of_measures_are_converted_to_the_unit_of_their_quantity() -> None:
    net, low, high = train(), 60.0 * UNIT.rpm, 2.0 * UNIT.kN * UNIT.m
    wanted = {
        "end J1.omega": (low, None),
        "max shaft.tau": (None, high),
        "peak shaft.tau": [1.0, 2.0] * UNIT.kN * UNIT.m,
    }
    made = sw.studies.sweep(net, {"shaft.c": [1e4]}, t_end=0.1, measures=list(wanted), require=wanted)
    assert made.require["end J1.omega"] == (pytest.approx(2.0 * math.pi, rel=1e-14), None)  # a product of two numbers
    assert made.require["max shaft.tau"] == (None, 2000.0)
    assert made.require["peak shaft.tau"] == (1000.0, 2000.0)
    found = sw.optimize(
        net, {"shaft.c": (1e4, 2e4)}, "rms shaft.tau", t_end=0.1, require={"max shaft.tau": (None, high)}
    )
    assert found.require["max shaft.tau"] == (None, 2000.0)
    for find in (
        lambda pair: sw.studies.sweep(
            net, {"shaft.c": [1e4]}, t_end=0.1, measures=["max shaft.tau"], require={"max shaft.tau": pair}
        ),
        lambda pair: sw.optimize(
            net, {"shaft.c": (1e4, 2e4)}, "rms shaft.tau", t_end=0.1, require={"max shaft.tau": pair}
        ),
    ):
        with pytest.raises(
            sw.ParameterError, match=r"require\['max shaft.tau'\]\[1\] is given in 'newton', but needs N\*m"
        ):
            find((None, 2.0 * UNIT.N))


def test_the_limit_of_a_probability_is_converted_and_that_of_a_function_refused() -> None:
    made = sw.studies.uncertainty(
        train(), {"J1.J": (1.0, 2.0)}, measures=["end J1.omega"], t_end=0.1, samples=16, processes=1
    )
    middle = float(np.median(made.values("end J1.omega")))
    for side in ("above", "below"):
        assert made.probability("end J1.omega", **{side: middle * 1e3 * UNIT.mrad / UNIT.s}) == made.probability(
            "end J1.omega", **{side: middle}
        )
        assert made.probability("end J1.omega", **{side: middle}).value == 0.5
        with pytest.raises(sw.ParameterError, match=rf"{side} is given in 'newton', but needs rad/s"):
            made.probability("end J1.omega", **{side: 1.0 * UNIT.N})
    own = sw.studies.uncertainty(lambda columns: {"y": columns["a"]}, {"a": (0.0, 1.0)}, samples=8)
    with pytest.raises(sw.ParameterError, match=r"above = .* has a unit"):
        own.probability("y", above=1.0 * UNIT.N)


@pytest.mark.parametrize("study", ["uncertainty", "bands"])
def test_uncertain_parameters_are_converted_or_refused_as_those_of_a_sweep(study: str) -> None:
    def columns(distribution: object) -> np.ndarray:
        distributions, net = {"shaft.c": distribution}, train()
        if study == "bands":
            return sw.studies.bands(net, "shaft.tau", [0.0, 0.1], distributions, samples=8).parameters["shaft.c"]
        options = {"measures": ["max shaft.tau"], "t_end": 0.1, "samples": 8, "processes": 1}
        return sw.studies.uncertainty(net, distributions, **options).sweep.parameters["shaft.c"]

    stiffness = UNIT.kN * UNIT.m / UNIT.rad
    uniform = columns((20e3, 30e3))
    assert ((uniform >= 20e3) & (uniform < 30e3)).all()
    for same in ((20.0 * stiffness, 30e3), (20.0 * stiffness, 30.0 * stiffness)):
        assert columns(same) == pytest.approx(uniform, rel=1e-14)  # a product of two numbers
    listed = columns([20e3, 30e3])
    for same in ([20.0 * stiffness, 30e3], [20.0, 30.0] * stiffness):
        assert columns(same) == pytest.approx(listed, rel=1e-14)
    for wrong in ((20.0 * UNIT.N, 30.0 * UNIT.N), [20.0 * UNIT.N, 30e3], [20.0, 30.0] * UNIT.N):
        with pytest.raises(sw.ParameterError, match=r"'shaft': c = .* is given in 'newton', but needs N\*m/rad"):
            columns(wrong)
    for text in (("a", "b"), ["a", 30e3]):
        with pytest.raises(sw.ParameterError, match="'shaft': c = 'a' must be a number"):
            columns(text)
    with pytest.raises(sw.ParameterError, match=r"'shaft\.c': .* is no distribution"):
        columns(20.0 * stiffness)


def test_values_of_one_parameter_with_units_are_several() -> None:
    with pytest.raises(sw.ParameterError, match=r"'shaft\.c': .* must be a sequence of values"):
        sw.studies.sweep(
            train(), {"shaft.c": 20.0 * UNIT.kN * UNIT.m / UNIT.rad}, t_end=0.1, measures=["max shaft.tau"]
        )


def test_states_and_parameters_of_a_right_hand_side_are_plain_numbers_one_for_each() -> None:
    model = train().compile()
    x = np.array([1.0, 2.0, 3e-4])
    assert model.rhs(0.0 * UNIT.ms, x) == pytest.approx(model.rhs(0.0, x))
    for call in (model.rhs, model.jacobian):
        with pytest.raises(sw.ParameterError, match=r"x = .* has a unit"):
            call(0.0, x * UNIT.rpm)
        with pytest.raises(sw.ParameterError, match=r"x has the shape \(4,\): give 3 numbers, one for each state"):
            call(0.0, np.zeros(4))
        with pytest.raises(sw.ParameterError, match=r"p has the shape \(1,\): give 5 numbers, one for each parameter"):
            call(0.0, x, np.ones(1))


@pytest.mark.parametrize("steps", [1.5, 0, "many", 1000.0 * UNIT.ms], ids=str)
def test_a_limit_of_steps_is_a_whole_number(steps: object) -> None:
    with pytest.raises(sw.ParameterError, match=r"max_steps = .* must be a whole number of steps"):
        train().simulate(0.1, max_steps=steps)


def test_the_pull_out_torque_of_the_crane_may_have_a_unit() -> None:
    kilo = sw.scenes.crane_start(pull_out_torque=0.013 * UNIT.kN * UNIT.m).simulate(1.0)
    assert kilo.max("motor.tau") == pytest.approx(sw.scenes.crane_start(13.0).simulate(1.0).max("motor.tau"), rel=1e-12)
    with pytest.raises(sw.ParameterError, match=r"pull_out_torque = 3.0 N m must be more than the rated 3.8"):
        sw.scenes.crane_start(pull_out_torque=0.003 * UNIT.kN * UNIT.m)


@pytest.mark.parametrize(
    ("speed", "words"), [(80 * UNIT.rpm, "80 1/min"), (8 * UNIT("rad/s"), "8 rad/s"), (0.5 * UNIT.krpm, "0.5 krpm")]
)
def test_titles_have_the_units_of_their_point_as_diagrams_do(speed: Any, words: str) -> None:
    net = sw.Network("fan")
    net.add(sw.Inertia("J", J=2.0), "a")
    net.add(sw.FanLoad("load", tau_n=20.0, n_n=100.0), "a")
    assert net.modes(at={"J.omega": speed}).title == f"fan at J.omega = {words}"
