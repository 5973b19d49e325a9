"""Optimal designs that are known in closed form, and limits that bind."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest
import sympy

import shaftwork as sw

LIGHT, HEAVY = {"motor.tau": 2.0, "JM.J": 0.01}, {"motor.tau": 3.0, "JM.J": 0.04}


def axis() -> sw.Network:
    """Its load has turned up to i tau t / (J_L + i^2 J_M), which is largest at i = sqrt(J_L / J_M) = 20."""
    net = sw.Network("axis")
    net.add(sw.TorqueSource("motor", tau=2.0), "rotor")
    net.add(sw.Inertia("JM", J=0.01), "rotor")
    net.add(sw.Gear("gear", ratio=5.0), "rotor", "drum")
    net.add(sw.Inertia("JL", J=4.0), "drum")
    return net


def test_the_ratio_of_the_largest_acceleration_matches_the_inertias() -> None:
    best = sw.optimize(axis(), {"gear.ratio": (2.0, 60.0)}, "end JL.omega", t_end=1.0, maximize=True)
    assert best.values["gear.ratio"] == pytest.approx(20.0, rel=1e-4)  # flat there: half of the digits
    assert best.best.goals["end JL.omega"] == pytest.approx(20.0 * 2.0 / 8.0, rel=1e-8)
    assert best.designed.compile().parameters["gear.ratio"] == best.values["gear.ratio"]


def test_a_best_design_at_an_end_of_a_range_is_said_to_be_there() -> None:
    inner = sw.optimize(axis(), {"gear.ratio": (2.0, 60.0)}, "end JL.omega", t_end=1.0, maximize=True)
    outer = sw.optimize(axis(), {"gear.ratio": (2.0, 15.0)}, "end JL.omega", t_end=1.0, maximize=True)
    assert inner.best.at_ends == ()
    assert outer.best.at_ends == ("gear.ratio",)
    assert "15  1      an end of its range" in str(outer)


def test_a_limit_that_binds_is_kept() -> None:
    # the motor turns i times as fast: i^2 tau / (J_L + i^2 J_M) = 80 at i^2 = 80 J_L / (tau - 80 J_M)
    best = sw.optimize(
        axis(),
        {"gear.ratio": (2.0, 60.0)},
        "end JL.omega",
        t_end=1.0,
        maximize=True,
        require={"max JM.omega": (None, 80.0)},
        starts=3,
    )
    assert best.values["gear.ratio"] == pytest.approx((80 * 4.0 / (2.0 - 0.8)) ** 0.5, rel=1e-6)
    assert best.best.goals["max JM.omega"] <= 80.0 * (1 + 1e-6)
    assert "at most 80" in str(best)


def test_of_a_catalogue_the_better_motor_is_taken() -> None:
    best = sw.optimize(
        axis(),
        {"gear.ratio": (2.0, 60.0)},
        "end JL.omega",
        t_end=1.0,
        maximize=True,
        choices={"motor": [LIGHT, HEAVY]},
    )
    # tau / (2 sqrt(J_L J_M)): 5.0 of the light one, 3.75 of the heavy one
    assert best.best.choice == {"motor": 0}
    assert [attempt.goals["end JL.omega"] for attempt in best.attempts] == pytest.approx([5.0, 3.75], rel=1e-7)


def test_a_price_becomes_least_within_what_the_motion_must_do() -> None:
    best = sw.optimize(
        axis(),
        {"motor.tau": (0.5, 10.0), "gear.ratio": (2.0, 60.0)},
        lambda values: values["motor.tau"] ** 2,
        t_end=1.0,
        require={"end JL.omega": (6.0, None)},
    )
    assert best.values["gear.ratio"] == pytest.approx(20.0, rel=1e-3)
    assert best.values["motor.tau"] == pytest.approx(6.0 * 8.0 / 20.0, rel=1e-6)


def test_a_function_of_parameters_can_be_limited() -> None:
    best = sw.optimize(
        axis(),
        {"gear.ratio": (2.0, 60.0)},
        "end JL.omega",
        t_end=1.0,
        maximize=True,
        functions={"size": lambda values: 0.1 * values["gear.ratio"] ** 2},
        require={"size": (None, 14.4)},
    )
    assert best.values["gear.ratio"] == pytest.approx(12.0, rel=1e-6)


def test_a_motion_through_phases_is_no_worse_than_a_grid() -> None:
    net = sw.scenes.six_phases()
    spans = {"shaft.c": (1e4, 4e4), "shaft.d": (5.0, 60.0)}
    best = sw.optimize(net, spans, "max shaft.tau", t_end=3.0, starts=3)
    grid = sw.studies.sweep(
        net,
        {name: np.linspace(low, high, 5) for name, (low, high) in spans.items()},
        t_end=3.0,
        measures=["max shaft.tau"],
    )
    assert best.best.goals["max shaft.tau"] <= grid.measures["max shaft.tau"].min() * (1 + 1e-6)


@pytest.mark.parametrize("limits", [(None, np.inf), (-np.inf, None), (-np.inf, np.inf)])
def test_an_infinite_limit_is_none(limits: tuple[float | None, float | None]) -> None:
    require, span = {"max JM.omega": limits}, {"gear.ratio": (2.0, 60.0)}
    best = sw.optimize(axis(), span, "end JL.omega", t_end=1.0, maximize=True, require=require)
    assert best.best.goals["end JL.omega"] == pytest.approx(5.0, rel=1e-8)
    assert best.require == {"max JM.omega": (None, None)}


@pytest.mark.parametrize("steady", [False, True])
def test_differences_are_as_small_as_the_range_of_a_variable(*, steady: bool) -> None:
    net = axis()
    net.add(sw.TorqueSource("brake", tau=-1.0), "drum")  # moved into the range, it starts from 0
    best = sw.optimize(
        net,
        {"brake.tau": (0.0, 1e-7)},
        lambda values: 1.0 + (values["brake.tau"] / 1e-7 - 0.3) ** 2,
        t_end=0.1,
        steady=steady,
    )
    # a step of 1e-8 of the range moves the bottom of the parabola by half of that, and it is flat there
    assert best.values["brake.tau"] == pytest.approx(3e-8, rel=1e-4)


STEEP: dict[str, tuple[Callable[[float], float], float]] = {
    "exponential": (lambda r: np.cosh(2 * (r - 20)), 20.0),  # 5e12 at the start, r = 5
    "quartic": (lambda r: (r - 20) ** 4, 20.0),
    "zero at the start": (lambda r: (r - 20) ** 2 - 225 + 1e-4, 20.0),
}


@pytest.mark.parametrize("name", STEEP)
def test_the_size_of_the_goal_at_the_start_does_not_decide_where_a_descent_ends(name: str) -> None:
    goal, expected = STEEP[name]
    best = sw.optimize(axis(), {"gear.ratio": (2.0, 60.0)}, lambda v: float(goal(v["gear.ratio"])), t_end=1.0)
    assert best.best.success
    assert best.values["gear.ratio"] == pytest.approx(expected, rel=1e-4)  # flat there: half of the digits


def test_a_goal_that_still_falls_after_all_new_starts_has_no_minimum_yet() -> None:
    def goal(values: Mapping[str, float]) -> float:
        return float(np.exp((values["gear.ratio"] - 20) ** 2))  # 1e97 at the start

    best = sw.optimize(axis(), {"gear.ratio": (2.0, 40.0)}, goal, t_end=1.0)
    assert not best.best.success
    assert "given up after 4 new starts" in str(best)


def _within(goal: Callable[[float], float], level: Callable[[float], float], least: float) -> sw.Optimum:
    return sw.optimize(
        axis(),
        {"gear.ratio": (2.0, 60.0)},
        lambda values: float(goal(values["gear.ratio"])),
        t_end=1.0,
        functions={"level": lambda values: float(level(values["gear.ratio"]))},
        require={"level": (least, None)},
    )


def test_a_descent_that_fails_gives_the_best_design_that_it_has_met() -> None:
    """SLSQP runs to the end of the range at 60, where the level is below its limit, and fails; the start is within."""
    made = _within(
        lambda r: 0.157 * np.sin(0.307 * r + 0.05) - 0.0306 * r,
        lambda r: 0.047 * np.cos(0.053 * r - 0.82) + 0.964 * np.sin(0.106 * r),
        0.273,
    )
    assert not made.best.success
    assert made.best.goals["level"] >= 0.273
    assert "no minimum yet" in str(made)


def test_a_better_design_on_the_way_is_not_left_behind() -> None:
    """SLSQP looks at a deeper valley, goes back and ends at 36.4, where the goal is -1.59."""
    tried: list[tuple[float, float]] = []

    def goal(r: float) -> float:
        value = 0.629 * np.sin(0.318 * r + 0.825) - 0.041 * r
        tried.append((level(r), value))
        return value

    def level(r: float) -> float:
        return 0.55 * np.cos(0.21 * r - 0.606) - 0.41 * np.sin(0.42 * r)

    best = _within(goal, level, 0.236).best
    assert best.success
    assert best.goals["objective"] <= min(value for at, value in tried if at >= 0.236) + 1e-6


def test_whether_a_descent_succeeded_is_not_read_from_its_message() -> None:
    made = sw.optimize(axis(), {"gear.ratio": (2.0, 60.0)}, "end JL.omega", t_end=1.0, maximize=True)
    failed = replace(made, attempts=(replace(made.best, success=False, message="without success"),))
    assert made.best.success
    assert "no minimum yet" not in str(made)
    assert "no minimum yet" in str(failed)


@pytest.mark.slow
def test_a_descent_takes_few_motions_where_the_goal_is_smooth_and_some_hundred_where_peaks_are_alike() -> None:
    net = sw.scenes.six_phases()
    names = ("shaft.c", "shaft.d", "J1.J", "J2.J", "brake.tau", "shaft.gap")
    ranges = {name: (0.5 * value, 2 * value) for name in names for value in [net.compile().parameters[name]]}
    smooth = sw.optimize(net, ranges, "max shaft.tau", t_end=3.0)
    assert smooth.best.motions <= 20  # 8

    net = sw.Network("absorber")
    net.add(sw.TorqueSource("step", tau=5.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Spring("s", c=100.0, d=0.5), "a", "ground")
    net.add(sw.Spring("k", c=10.0, d=1.0), "a", "b")
    net.add(sw.Inertia("A", J=0.1), "b")
    three = {"k.c": (1.0, 200.0), "k.d": (0.1, 10.0), "A.J": (0.01, 0.5)}
    kinked = sw.optimize(net, three, "max s.tau", t_end=10.0)
    assert 20 < kinked.best.motions <= 200  # 98
    assert kinked.best.success


def test_where_no_design_meets_the_limits_the_error_says_how_near_they_came() -> None:
    made = sw.optimize(
        axis(), {"gear.ratio": (2.0, 60.0)}, "max JM.omega", t_end=1.0, require={"end JL.omega": (9.0, None)}
    )
    with pytest.raises(sw.SimulationError, match=r"end JL\.omega must be at least 9 and is 5\."):
        _ = made.best


def test_of_limits_that_no_value_meets_the_error_names_the_worst_first() -> None:
    # at the ratio 20 the load turns up to 5 rad/s and the motor to 100: 4 short of 9, and 5 times 20
    made = sw.optimize(
        axis(),
        {"gear.ratio": (20.0, 60.0)},
        "max JM.omega",
        t_end=1.0,
        require={"end JL.omega": (9.0, None), "max JM.omega": (None, 20.0)},
    )
    with pytest.raises(
        sw.SimulationError, match=r"max JM\.omega must be at most 20 and is.*; end JL\.omega must be at"
    ):
        _ = made.best


def test_a_descent_whose_limit_no_value_meets_ends_soon() -> None:
    """Its slope has a jump: towards the limit, and back to the goal, it would go on for thousands of designs."""
    asked: list[float] = []

    def price(values: Mapping[str, float]) -> float:
        asked.append(values["gear.ratio"])
        return values["gear.ratio"]

    made = sw.optimize(
        axis(),
        {"gear.ratio": (2.0, 60.0)},
        price,
        t_end=1.0,
        functions={"torque": lambda values: 400.0 - 0.1 * min(values["gear.ratio"], 40.0)},
        require={"torque": (None, 100.0)},
    )
    assert "the last 30 of them no better" in made.attempts[0].message
    assert len(asked) < 3 * 60  # 30 designs after the best, each with two for the slope
    with pytest.raises(sw.SimulationError, match=r"torque must be at most 100 and is 396\."):
        _ = made.best


def test_each_design_can_start_in_its_own_steady_state() -> None:
    """From rest under a push an undamped step of 5 N m adds 10; from a twist of nothing the push would count twice."""
    net = sw.Network("pushed")
    net.add(sw.TorqueSource("push", tau=4.0), "a")
    net.add(sw.TorqueSource("step", tau=5.0 * sympy.Heaviside(sw.t - 0.1)), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Spring("shaft", c=1e3), "a", "ground")
    best = sw.optimize(
        net,
        {"push.tau": (1.0, 50.0)},
        lambda values: values["push.tau"],
        t_end=0.5,  # one swing lasts 0.2 s
        maximize=True,
        require={"max shaft.tau": (None, 40.0)},
        steady=True,
    )
    assert best.values["push.tau"] == pytest.approx(30.0, rel=1e-5)  # differences are of motions to 1e-8


def test_nothing_is_asked_outside_the_ranges() -> None:
    low, high = 0.0, 3.0
    asked: list[float] = []

    def price(values: Mapping[str, float]) -> float:
        asked.append(values["coupling.gap"])
        return -((values["coupling.gap"] - 1.0) ** 2)  # least at the upper end, and at the lower one from below 1

    net = axis()
    net.add(sw.Backlash("coupling", gap=0.5, c=100.0), "drum", "load")
    net.add(sw.Inertia("J load", J=1.0), "load")
    made = sw.optimize(net, {"coupling.gap": (low, high)}, price, t_end=0.1, starts=3)
    assert made.values["coupling.gap"] == high
    assert min(asked) == low  # a start of the middle of the lower part comes there
    assert max(asked) == high


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"variables": {}}, "Nothing is variable"),
        ({"variables": {"gear.ratio": 3.0}}, "is no range"),
        ({"variables": {"gear.ratio": (None, 3.0)}}, "has an open side"),
        ({"variables": {"gear.ratio": (3.0, 2.0)}}, "is no range"),
        ({"variables": {"gear.i": (3.0, 2.0)}}, "no parameter 'gear.i'"),
        ({"goal": "JL.omega"}, "is no measure"),
        ({"goal": 5}, "goal = 5 must be a measure, or a function of all parameters"),
        ({"functions": {"price": "max JL.omega"}, "require": {"price": (0, 1)}}, r"functions\['price'\] = 'max"),
        ({"require": len}, "require = <built-in function len> must map measures to limits"),
        ({"choices": {"a": 5}}, r"choices\['a'\] must be a list of sets"),
        ({"goal": "damage JL.omega"}, "no derivative"),
        ({"starts": 0}, "starts = 0"),
        ({"seed": -1}, "seed = -1 must be a whole number, 0 or more"),
        ({"seed": 1.5}, r"seed = 1\.5 must be a whole number"),
        ({"require": {"end JL.omega": (np.inf, None)}}, "no value is at least inf"),
        ({"require": {"end JL.omega": (None, np.nan)}}, "no value is at least None and at most nan"),
        ({"require": {"end JL.omega": 3.0}}, "must be .low, high."),
        ({"require": {"end JL.omega": ("a", None)}}, r"is a text"),
        ({"functions": {"size": len}}, "a function without limits"),
        ({"choices": {"motor": []}}, "nothing to choose"),
        (
            {"choices": {"motor": [LIGHT, {"motor.tau": 3.0}]}},
            r"choices\['motor'\]: number 1 has no 'JM\.J', which another",
        ),
        ({"choices": {"motor": [3.0]}}, r"choices\['motor'\] holds 3\.0"),
        ({"choices": {"box": [{"gear.ratio": 3.0}]}}, r"'gear\.ratio' is in variables and in choices\['box'\]"),
        ({"choices": {"one": [LIGHT], "two": [HEAVY]}}, r"'motor\.tau' is in choices\['one'\] and in choices\['two'\]"),
        ({"goal": lambda _: "3"}, r"'objective' gives '3' at gear\.ratio = 5\. It must give a number"),
        ({"goal": lambda _: None}, "'objective' gives None"),
        ({"goal": lambda _: 1j}, "'objective' gives 1j"),
        ({"functions": {"price": lambda _: "a"}, "require": {"price": (None, 1.0)}}, "'price' gives 'a'"),
    ],
)
def test_what_is_wrong_is_said(change: dict[str, object], words: str) -> None:
    arguments: dict[str, object] = {"variables": {"gear.ratio": (2.0, 60.0)}, "goal": "end JL.omega", **change}
    with pytest.raises(sw.ParameterError, match=words):
        sw.optimize(axis(), t_end=1.0, **arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_function_without_a_finite_value_is_named_with_the_place(value: float) -> None:
    span, limits = {"gear.ratio": (2.0, 60.0)}, {"price": (None, 1.0)}
    as_goal = sw.optimize(axis(), span, lambda _: value, t_end=1.0)
    as_limit = sw.optimize(
        axis(), span, "end JL.omega", t_end=1.0, functions={"price": lambda _: value}, require=limits
    )
    for optimum, name in ((as_goal, "objective"), (as_limit, "price")):
        with pytest.raises(sw.SimulationError, match=rf"{name} is {value:g} at gear\.ratio = 5\. Give functions"):
            _ = optimum.best


def test_a_function_that_fails_at_one_design_ends_no_other_start() -> None:
    def price(values: Mapping[str, float]) -> float:
        return 1.0 / (values["gear.ratio"] - 5.0) if values["gear.ratio"] <= 5.0 else values["gear.ratio"]

    made = sw.optimize(axis(), {"gear.ratio": (2.0, 60.0)}, price, t_end=1.0, starts=4)  # the first is at 5
    (failed,) = [attempt.message for attempt in made.attempts if not attempt.complete]
    assert failed.startswith("the function 'objective' raises ZeroDivisionError: ")
    assert any(attempt.success for attempt in made.attempts)
    with pytest.raises(sw.SimulationError, match=r"'objective' raises KeyError: 'gear' at gear\.ratio = 5"):
        _ = sw.optimize(axis(), {"gear.ratio": (2.0, 60.0)}, lambda values: values["gear"], t_end=1.0).best


@pytest.mark.parametrize("shift", np.linspace(0.1, 1.0, 10))
def test_a_limit_of_zero_is_met_to_a_millionth_of_what_is_limited(shift: float) -> None:
    level = 17.0 + shift
    made = sw.optimize(
        axis(),
        {"gear.ratio": (2.0, 60.0)},
        lambda values: values["gear.ratio"],
        t_end=1.0,
        functions={"margin": lambda values: values["gear.ratio"] ** 1.5 - level**1.5},
        require={"margin": (0.0, None)},
    )
    assert made.values["gear.ratio"] == pytest.approx(level, rel=1e-6)  # as far as the limit is told apart


@pytest.mark.parametrize("steady", [False, True])
def test_a_variable_that_is_zero_in_the_network_is_named(*, steady: bool) -> None:
    net = axis()
    net.add(sw.Damper("oil", d=0.0), "drum")
    with pytest.raises(sw.ParameterError, match=r"'oil\.d' is zero in the network"):
        sw.optimize(net, {"oil.d": (1.0, 50.0)}, "max JL.omega", t_end=1.0, steady=steady)


def test_the_table_has_units() -> None:
    made = sw.optimize(axis(), {"gear.ratio": (2.0, 60.0)}, "max JL.omega", t_end=1.0, maximize=True)
    lines = str(made).splitlines()
    assert lines[1].split() == ["best", "unit"]
    assert lines[3].split()[-2:] == ["rad/s", "goal"]


def test_at_the_edge_of_a_function_the_slope_is_that_of_the_side_which_has_values() -> None:
    best = sw.optimize(
        axis(),
        {"gear.ratio": (2.0, 60.0)},
        lambda values: values["gear.ratio"] ** 2 if values["gear.ratio"] <= 5.0 else np.nan,  # starts at 5
        t_end=1.0,
    )
    assert best.values["gear.ratio"] == pytest.approx(2.0, rel=1e-9)  # the lower end, to the tolerance of the descent


def test_a_design_without_motion_is_no_design() -> None:
    net = axis()
    net.add(sw.TorqueSource("pole", tau=sw.Table([0.0, 50.0, 50.1], [0.0, 0.0, 1e9])(sw.omega)), "drum")
    made = sw.optimize(
        net,
        {"motor.tau": (0.5, 1000.0)},
        lambda values: -values["motor.tau"],
        t_end=1.0,
        require={"max JL.omega": (None, 1e6)},
        starts=3,
    )
    assert np.isfinite(made.best.goals["max JL.omega"])


def test_the_name_of_the_goal_is_no_name_of_a_function() -> None:
    with pytest.raises(sw.ParameterError, match="is the name of the goal"):
        sw.optimize(
            axis(),
            {"gear.ratio": (2.0, 60.0)},
            "end JL.omega",
            t_end=1.0,
            functions={"objective": lambda values: values["gear.ratio"]},
            require={"objective": (None, 3.0)},
        )
