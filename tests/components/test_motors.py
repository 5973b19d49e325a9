"""Motors by their torque-speed curve: the points of a catalogue, closed forms of starts, switching, nameplates."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sympy
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import shaftwork as sw
from shaftwork.components import Component
from shaftwork.components.branches import ACROSS
from shaftwork.components.motors import pull_out_slip, pull_up_share

EXCAVATOR: dict[str, float] = {
    "tau_a": 5310.0,
    "tau_s": 4350.0,
    "tau_k": 5550.0,
    "tau_n": 2410.0,
    "n_n": 985.0,
    "n_sync": 1000.0,
}
PER_MINUTE = 2 * math.pi / 60
KLOSS: dict[str, float] = {"tau_k": 8.0, "s_k": 0.3, "n_sync": 3000.0}


def alone(motor: Component, inertia: float = 1.0) -> sw.Model:
    """A motor on an inertia of 1 kg m^2: its torque is the rate of the only state."""
    net = sw.Network("motor")
    net.add(motor, "shaft")
    net.add(sw.Inertia("J", J=inertia), "shaft")
    return net.compile()


def curve(motor: Component, speeds: Any, time: float = 0.0) -> NDArray[np.float64]:
    """Torque at speeds in 1/min."""
    model = alone(motor)
    return np.array([model.rhs(time, np.array([n * PER_MINUTE]))[0] for n in np.atleast_1d(speeds)])


def slopes(motor: Component, speeds: Any) -> NDArray[np.float64]:
    """Derivative of the torque by the speed in rad/s, by differentiation of the law, at speeds in 1/min."""
    model = alone(motor)
    return np.array([model.jacobian(0.0, np.array([n * PER_MINUTE])).toarray()[0, 0] for n in np.atleast_1d(speeds)])


def pieces(motor: Component) -> list[sympy.Expr]:
    """The torque of a motor as exact expressions of ACROSS: below standstill, up to the pull-out point, beyond."""
    p = SimpleNamespace(
        **{key: None if value is None else sympy.nsimplify(value) for key, value in motor.values.items()}
    )
    for made in motor.derived(p):
        setattr(p, made.name, made.law)
    (branch,) = motor.branches(p)
    return [pair.expr for pair in (-branch.through).args]


@pytest.mark.slow
@pytest.mark.parametrize("given", [{"n_k": 930.0}, {"n_k": 930.0, "n_s": 260.0}, {"n_s": 300.0}, {}], ids=str)
def test_a_cage_curve_has_the_values_and_slopes_of_its_points_exactly(given: dict[str, float]) -> None:
    """To 40 digits, differentiated on both sides of the points: no error of rounding could hide one of the formula."""
    motor = sw.CageMotor("m", **{**EXCAVATOR, **given})
    behind, starting, running = pieces(motor)
    tau_a, tau_s, tau_k = (sympy.nsimplify(motor.values[name]) for name in ("tau_a", "tau_s", "tau_k"))
    slip = pull_out_slip(*map(sympy.nsimplify, (5550, 2410, 985, 1000)))
    n_k = sympy.nsimplify(given["n_k"]) if "n_k" in given else 1000 * (1 - slip)
    n_s = sympy.nsimplify(given["n_s"]) if "n_s" in given else n_k * pull_up_share(tau_a, tau_s, tau_k)
    points = [(starting, 0, tau_a), (starting, n_s, tau_s), (starting, n_k, tau_k), (running, n_k, tau_k)]
    assert behind == tau_a
    for law, n, torque in points:
        value, slope = (sympy.N(made.subs(ACROSS, 2 * sympy.pi * n / 60), 50) for made in (law, law.diff(ACROSS)))
        assert abs(value - torque) < 1e-40 * torque
        assert n == 0 or abs(slope) < 1e-40 * torque
    assert sympy.N(starting.diff(ACROSS, 4)) != 0
    assert starting.diff(ACROSS, 5).expand() == 0


@pytest.mark.slow
def test_a_compiled_cage_curve_keeps_its_points_to_rounding() -> None:
    """1e-12 of the torque, and of torque over speed: a few hundred roundings."""
    motor = sw.CageMotor("m", **EXCAVATOR)
    n_k = 1000 * (1 - float(pull_out_slip(5550.0, 2410.0, 985.0, 1000.0)))
    n_s = n_k * float(pull_up_share(5310.0, 4350.0, 5550.0))
    np.testing.assert_allclose(curve(motor, [0.0, n_s, n_k, 985.0]), [5310.0, 4350.0, 5550.0, 2410.0], rtol=1e-12)
    assert np.abs(slopes(motor, [n_s, n_k])).max() * n_k * PER_MINUTE < 1e-12 * 5550.0
    assert curve(motor, 1000.0) == pytest.approx(0.0, abs=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.0, 1e-3, 0.3, 0.8, 1.0, 5.0, 60.0])
def test_the_chosen_pull_up_speed_makes_a_curve_that_falls_and_rises(share: float) -> None:
    """share is (tau_a - tau_s) / (tau_k - tau_s); no warning, which would be an error here."""
    motor = sw.CageMotor("m", tau_a=1.0 + share, tau_s=1.0, tau_k=2.0, n_sync=1000.0, n_k=900.0)
    n_s = 900.0 * float(pull_up_share(1.0 + share, 1.0, 2.0))
    inside = np.linspace(0.0, 1.0, 42)[1:-1]
    assert (slopes(motor, n_s * inside) < 0).all() or share == 0
    assert (slopes(motor, n_s + (900.0 - n_s) * inside) > 0).all()


@pytest.mark.parametrize("n_s", [10.0, 700.0])
def test_a_quartic_that_turns_once_more_is_warned_of_with_the_speed(n_s: float) -> None:
    with pytest.warns(sw.NetworkWarning, match="turns once more at .* 1/min") as told:
        motor = sw.CageMotor("m", **EXCAVATOR, n_s=n_s)
    speed = float(re.search(r"at ([\d.]+) 1/min", str(told[0].message))[1])  # type: ignore[index]
    below, above = slopes(motor, [speed - 1.0, speed + 1.0])  # the message has four digits
    assert below * above < 0
    assert told[0].filename == __file__


def test_the_quartic_of_a_slow_motor_is_warned_of_as_well() -> None:
    """At a thousandth of the speeds, all below 1 1/min, the curve has the same shape."""
    slow = EXCAVATOR | {name: EXCAVATOR[name] / 1000 for name in ("n_sync", "n_n")}
    with pytest.warns(sw.NetworkWarning, match="turns once more at 0"):
        sw.CageMotor("m", **slow, n_s=0.7)


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [1.0, -4.0])
def test_a_cage_motor_is_continuous_and_finite_at_every_speed(ratio: float) -> None:
    """Backwards it gives its locked-rotor torque, above the synchronous speed it brakes with at most -tau_k."""
    motor = sw.CageMotor("m", **EXCAVATOR, ratio=ratio, efficiency=0.9)
    n_k = 1000 * (1 - float(pull_out_slip(5550.0, 2410.0, 985.0, 1000.0)))
    size = ratio * 0.9
    at = lambda *speeds: curve(motor, np.array(speeds) / ratio)  # noqa: E731 (speeds of the motor's own shaft)
    np.testing.assert_allclose(at(-1e6, -1000.0, -1e-9), size * 5310.0, rtol=1e-12)
    for n in (0.0, n_k, 1000.0):
        # 2e-6 1/min times the largest slope of the curve, some 170 N m / (1/min), times the ratio
        assert np.ptp(at(n - 1e-6, n, n + 1e-6)) < 2e-3
    assert at(2000.0 - n_k)[0] == pytest.approx(-size * 5550.0, rel=1e-12)
    assert np.isfinite(at(1e9)).all()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"tau_s": 6000.0}, "tau_s = 6000 N m must be less than tau_k = 5550 N m"),
        ({"tau_a": 4000.0}, "not more than tau_a = 4000 N m"),
        ({"tau_n": None}, "give the rated point tau_n and n_n, or the pull-out speed n_k"),
        ({"tau_n": 6000.0}, "the rated torque tau_n = 6000 N m"),
        ({"n_n": 1000.0}, "the synchronous speed n_sync = 1000 1/min"),
        ({"n_n": 700.0}, "the pull-out speed n_k = -313"),
        ({"n_k": 1200.0}, "the pull-out speed n_k = 1200 1/min must lie between 0 and n_sync"),
        ({"n_s": 950.0}, "n_s = 950 1/min must be less than the pull-out speed 934"),
        ({"t_on": 2.0, "t_off": 1.0}, "t_off = 1 s is not later than t_on = 2 s"),
    ],
)
def test_values_that_give_no_curve_are_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(sw.ParameterError, match=re.escape(words)):
        sw.CageMotor("m", **{**EXCAVATOR, **changes})


def test_a_value_that_is_no_number_is_left_to_the_checks_of_the_network() -> None:
    net = sw.Network("wrong")
    net.add(sw.CageMotor("m", **{**EXCAVATOR, "n_s": "low"}), "shaft")  # type: ignore[arg-type]
    net.add(sw.Inertia("J", J=1.0), "shaft")
    assert any("n_s = 'low' must be a number" in str(problem) for problem in net.check())


def test_a_change_of_a_parameter_moves_the_pull_out_point_without_compiling_again() -> None:
    """The point follows from the torques, as symbols: the changed model is the one that is built so."""
    model = alone(sw.CageMotor("m", **EXCAVATOR))
    new = alone(sw.CageMotor("m", **{**EXCAVATOR, "tau_k": 6000.0}))
    changed = np.array([6000.0 if name == "m.tau_k" else value for name, value in model.parameters.items()])
    for n in (100.0, 500.0, 930.0, 960.0):
        x = np.array([n * PER_MINUTE])
        assert model.rhs(0.0, x, changed) == pytest.approx(new.rhs(0.0, x), rel=1e-13)


def test_a_kloss_motor_reaches_a_slip_at_the_time_of_the_closed_form() -> None:
    """J omega_0 / (2 tau_k) ((1 - s^2) / (2 s_k) + s_k ln(1 / s)), from J d(omega)/dt = tau(s); after t_on."""
    slip, t_on = 0.05, 0.4
    synchronous = 3000.0 * PER_MINUTE
    needed = 0.02 * synchronous / (2 * 8.0) * ((1 - slip**2) / (2 * 0.3) + 0.3 * math.log(1 / slip))
    model = alone(sw.KlossMotor("m", **KLOSS, t_on=t_on), inertia=0.02)
    sol = model.simulate(t_on + needed, rtol=1e-11, t_eval=3)
    assert sol["J.omega"][-1] == pytest.approx((1 - slip) * synchronous, rel=1e-9)  # 100 rtol


MOTORS: dict[str, Callable[..., Component]] = {
    "kloss": lambda **times: sw.KlossMotor("m", **KLOSS, **times),
    "cage": lambda **times: sw.CageMotor("m", **EXCAVATOR, **times),
    "wound": lambda **times: sw.WoundRotorMotor("m", **KLOSS, resistance=3.0, **times),
    "table": lambda **times: sw.TableMotor("m", curve=sw.Table([0.0, 500.0, 1000.0], [5.0, 6.0, 0.0]), **times),
    "drive": lambda **times: sw.FrequencyDrive("m", **KLOSS, t_ramp=0.5, **times),
    "held": lambda **times: sw.PullOutDrive("m", **KLOSS, overspeed=2.0, **times),
}
INERTIA = {"cage": 100.0}  # kg m^2; the others are smaller motors


@pytest.mark.slow
@pytest.mark.parametrize("name", MOTORS)
def test_a_motor_gives_exactly_no_torque_before_t_on_and_from_t_off_on(name: str) -> None:
    times = np.linspace(0.0, 2.0, 41)
    sol = alone(MOTORS[name](t_on=0.5, t_off=1.5), INERTIA.get(name, 0.3)).simulate(2.0, t_eval=times)
    off = (times < 0.5) | (times >= 1.5)
    assert (sol["m.tau"][off] == 0.0).all()
    assert (sol["m.tau"][~off] > 0.0).all()
    assert (sol["J.omega"][times <= 0.5] == 0.0).all()
    assert np.ptp(sol["J.omega"][times >= 1.5]) < 1e-12 * sol["J.omega"][-1]


@pytest.mark.slow
@pytest.mark.parametrize("name", MOTORS)
def test_switched_on_later_it_starts_in_the_same_way(name: str) -> None:
    first = alone(MOTORS[name](), INERTIA.get(name, 0.3)).simulate(1.0, rtol=1e-11, t_eval=5)
    later = alone(MOTORS[name](t_on=0.7), INERTIA.get(name, 0.3)).simulate(1.7, rtol=1e-11, t_eval=0.7 + first.t)
    np.testing.assert_allclose(later["J.omega"], first["J.omega"], rtol=1e-9)  # 100 rtol


@pytest.mark.parametrize("name", MOTORS)
def test_times_that_are_not_given_leave_no_trace_in_the_law(name: str) -> None:
    plain, switched = (alone(MOTORS[name](**times)) for times in ({}, {"t_on": 1.0}))
    assert [parameter for parameter in switched.parameters if parameter not in plain.parameters] == ["m.t_on"]
    (law,) = (branch.template.law for branch in plain.form.graph.branches if branch.part == 0)
    assert not {"t_on", "t_off"} & {symbol.name for symbol in law.free_symbols}


def test_a_table_motor_is_a_torque_source_with_its_table() -> None:
    table = sw.Table([0.0, 600.0, 900.0, 1000.0], [80.0, 120.0, 90.0, 0.0])
    motor = sw.TableMotor("m", curve=table, ratio=3.0, efficiency=0.9)
    source = sw.TorqueSource("m", tau=3.0 * 0.9 * table(3.0 * sw.omega / PER_MINUTE))
    speeds = np.linspace(-100.0, 400.0, 51)
    np.testing.assert_allclose(curve(motor, speeds), curve(source, speeds), rtol=1e-12, atol=1e-10)
    assert curve(sw.TableMotor("m", curve=5.0), [0.0, 900.0]) == pytest.approx([5.0, 5.0])
    with pytest.raises(sw.ParameterError, match="take a TorqueSource"):
        sw.TableMotor("m", curve=5.0 - sw.omega)


def test_resistance_in_the_rotor_moves_the_pull_out_point_and_keeps_its_torque() -> None:
    wound = sw.WoundRotorMotor("m", **KLOSS, resistance=3.0)
    speeds = np.linspace(-1000.0, 4000.0, 21)
    np.testing.assert_allclose(
        curve(wound, speeds), curve(sw.KlossMotor("m", **{**KLOSS, "s_k": 0.9}), speeds), rtol=1e-12
    )
    assert curve(wound, 3000.0 * (1 - 0.9)) == pytest.approx(8.0, rel=1e-12)


@pytest.mark.parametrize("value", [-2.0, 0.0, 0.5, math.nan])
def test_a_rotor_circuit_of_less_resistance_than_the_rotor_is_refused(value: float) -> None:
    net = sw.Network("wound")
    net.add(sw.WoundRotorMotor("m", **KLOSS, resistance=value), "shaft")
    net.add(sw.Inertia("J", J=1.0), "shaft")
    (problem,) = net.check()
    assert problem.kind == "parameter"
    assert "at least 1" in str(problem)
    sound = alone(sw.WoundRotorMotor("m", **KLOSS, resistance=3.0))
    with pytest.raises(sw.ParameterError, match="WoundRotorMotor 'm': resistance"):
        sound.simulate(0.1, parameters={"m.resistance": value})


def test_a_rotor_resistance_that_falls_below_that_of_the_rotor_leaves_the_slip_rings_closed() -> None:
    """3 - 4 t is 1 at half a second: from there on it is the motor alone."""
    falling = alone(sw.WoundRotorMotor("m", **KLOSS, resistance=3.0 - 4.0 * sw.t), inertia=0.1)
    stopped = alone(sw.WoundRotorMotor("m", **KLOSS, resistance=sw.Ramp(-2.0, 0.5, before=3.0)), inertia=0.1)
    found, wanted = (model.simulate(2.0, rtol=1e-11, t_eval=21)["J.omega"] for model in (falling, stopped))
    np.testing.assert_allclose(found, wanted, rtol=1e-9)  # 100 rtol


def test_a_start_over_resistors_takes_the_time_of_the_closed_form_of_each_step() -> None:
    """As for the Kloss motor, from slip to slip: the resistor is taken out when the slip is 0.4."""
    synchronous, inertia = 3000.0 * PER_MINUTE, 0.02

    def needed(first: float, last: float, s_k: float) -> float:
        drop = (first**2 - last**2) / (2 * s_k) + s_k * math.log(first / last)
        return inertia * synchronous / (2 * 8.0) * drop

    switched = needed(1.0, 0.4, 0.9)
    steps = sw.Step(-2.0, start=switched, before=3.0)
    model = alone(sw.WoundRotorMotor("m", **KLOSS, resistance=steps), inertia)
    sol = model.simulate(switched + needed(0.4, 0.05, 0.3), rtol=1e-11, t_eval=2)
    assert sol["J.omega"][-1] == pytest.approx(0.95 * synchronous, rel=1e-9)  # 100 rtol


@pytest.mark.slow
def test_an_excavator_start_is_the_same_with_every_engine_and_by_hand() -> None:
    """100 rtol between the engines. The differential equations by hand are run piece by piece from event to event."""
    net = sw.Network("excavator")
    net.add(sw.motors["excavator 250 kW"].cage("motor"), "rotor")
    net.add(sw.Inertia("J1", J=27.0), "rotor")
    net.add(sw.Spring("shaft", c=1608.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=8.2), "wheel")
    model = net.compile()
    found = {
        engine: model.simulate(2.0, rtol=1e-10, t_eval=21, engine=engine) for engine in ("scipy", "heyoka", "sundials")
    }
    n_k = 1000 * (1 - float(pull_out_slip(5550.0, 2410.0, 985.0, 1000.0)))
    n_s = n_k * float(pull_up_share(5310.0, 4350.0, 5550.0))
    # the quartic of the source, from its five conditions
    rows = [[n**k for k in range(5)] for n in (0.0, n_s / n_k, 1.0)]
    rows += [[k * n ** max(k - 1, 0) for k in range(5)] for n in (n_s / n_k, 1.0)]
    quartic = np.linalg.solve(rows, [5310.0, 4350.0, 5550.0, 0.0, 0.0])

    def rates(_t: float, x: NDArray[np.float64]) -> list[float]:
        n, s_k = x[0] / PER_MINUTE, 1 - n_k / 1000
        slip = 1 - n / 1000
        running = 2 * 5550.0 * slip * s_k / (slip**2 + s_k**2)
        torque = float(np.polynomial.polynomial.polyval(n / n_k, quartic)) if n < n_k else running
        return [(torque - x[2]) / 27.0, x[2] / 8.2, 1608.0 * (x[0] - x[1])]

    by_hand = solve_ivp(rates, (0.0, 2.0), [0.0] * 3, "DOP853", found["scipy"].t, rtol=1e-11, atol=1e-9).y
    for sol in found.values():
        for name, row in zip(("J1.omega", "J2.omega", "shaft.tau"), by_hand, strict=True):
            np.testing.assert_allclose(sol[name], row, atol=1e-8 * np.abs(row).max())


def test_a_motor_supplies_below_and_absorbs_above_its_synchronous_speed() -> None:
    """`power` is what a part absorbs."""
    model = alone(sw.CageMotor("m", **EXCAVATOR), inertia=20.0)
    driving = model.simulate(0.2, t_eval=5, initial={"J.omega": 800.0 * PER_MINUTE})
    braking = model.simulate(0.2, t_eval=5, initial={"J.omega": 1100.0 * PER_MINUTE})
    assert (driving["m.power"] < 0).all()
    assert (braking["m.power"] > 0).all()
    for sol in (driving, braking):
        np.testing.assert_allclose(sol["m.power"], -sol["m.tau"] * sol["J.omega"], rtol=1e-13)
        assert sol.energy_residual < 1e-8


def test_the_nameplates_hold_what_the_source_prints_and_say_what_is_chosen() -> None:
    crane, excavator = sw.motors["KBF-90 LA 2"], sw.motors["excavator 250 kW"]
    assert (crane.power, crane.n_n, crane.tau_n) == (1000.0, 2510.0, 3.8)
    assert (excavator.power, excavator.n_n, excavator.tau_n) == (250e3, 985.0, 2410.0)
    assert (excavator.tau_a, excavator.tau_s, excavator.tau_k) == (5310.0, 4350.0, 5550.0)
    assert tuple(crane.chosen) == ("n_sync", "tau_a", "tau_s", "tau_k")
    assert tuple(excavator.chosen) == ("n_sync", "f_n")
    for plate in sw.motors.values():
        assert all(why.startswith("chosen: ") for why in plate.chosen.values())
        assert plate.table.count("printed") == 8 - len(plate.chosen)
        # what is printed of power, speed and torque agrees to the digits that are printed
        assert plate.tau_n * plate.n_n * PER_MINUTE == pytest.approx(plate.power, rel=6e-3)
        for part in (plate.cage("m"), plate.kloss("m"), plate.drive("m", f=plate.f_n)):
            assert curve(part, plate.n_n) == pytest.approx(plate.tau_n, rel=1e-12)
    assert sw.motors["KBF-90 LA 2"].cage("m", ratio=35.5, t_off=6.5).t_off == 6.5


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"tau_k": 3.0}, r"tau_n = 3.8 N m is not less than the pull-out torque tau_k = 3 N m.*times tau_n"),
        ({"tau_k": 3.8}, r"tau_n = 3.8 N m is not less than the pull-out torque tau_k = 3.8 N m"),
        ({"n_n": 3010.0}, r"n_n = 3010 1/min is not less than the synchronous speed n_sync = 3000 1/min.*60 f / pole"),
    ],
)
def test_a_rated_point_that_no_curve_passes_through_is_refused_with_what_to_give(wrong, said: str) -> None:
    with pytest.raises(sw.ParameterError, match=f"Nameplate 'KBF-90 LA 2': .*{said}"):
        dataclasses.replace(sw.motors["KBF-90 LA 2"], **wrong)
    plate = {"tau_a": 7.0, "tau_s": 2.0, "tau_k": 8.0, "tau_n": 3.8, "n_n": 2510.0, "n_sync": 3000.0}
    with pytest.raises(sw.ParameterError, match=f"CageMotor 'm': .*{said}"):
        sw.CageMotor("m", **(plate | wrong))
