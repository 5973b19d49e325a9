"""The six-step motor beside equations written by hand, its balances, its average, closed forms at a locked rotor."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.components.bldc import _shape
from tests.reference.bldc import Motor, simulate
from tests.reference.chopper import Chopper

# Popenda 2019: back EMF 212 V at 3000 1/min, taken as the flat top of a phase; L_mu 7.4 mH and L_sigma 1.6 mH together
# as the inductance of a phase. Chosen: the mean rectified voltage of 400 V mains, and two pole pairs.
DATA = {"U": 540.0, "R": 0.5, "L": 0.009, "k": 212 / (100 * np.pi), "pole_pairs": 2.0}
RATED, J, END = 12.73, 0.025, 0.05


def _motor(kind: type[sw.Component] = sw.BLDCMotor, **changed: float) -> sw.Network:
    net = sw.Network("six steps")
    net.add(kind("m", **(DATA | changed)), "rotor")
    net.add(sw.Inertia("J", J=J), "rotor")
    net.add(sw.TorqueSource("load", tau=-RATED * sympy.tanh(sw.omega)), "rotor")
    return net


@cache
def _model(**changed: float) -> sw.Model:
    return _motor(**changed).compile()


@cache
def _truth(**changed: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    t = np.linspace(0, END, 301)
    motor = Motor(**(DATA | changed), J=J, load=lambda w: RATED * np.tanh(w))
    return t, *simulate(motor, t)


CASES = [{}, {"flat": 1.8}, {"dead_time": 1e-4}]


@pytest.mark.slow
@pytest.mark.parametrize("changed", CASES, ids=str)
@pytest.mark.parametrize("engine", ["scipy", "heyoka", "sundials"])
def test_every_engine_follows_the_motor_written_by_hand(engine: str, changed: dict[str, float]) -> None:
    """Run-up from rest through some hundred commutations, diodes and open phases included."""
    t, x, _ = _truth(**changed)
    sol = _model(**changed).simulate(END, rtol=1e-10, engine=engine, t_eval=t)
    names = ("m.i_a", "m.i_b", "m.i_c", "J.omega")
    # 1e-10 a step, and a commutation moves in time by the error of the angle before it
    for name, column in zip(names, x.T, strict=False):
        assert np.abs(sol[name] - column).max() < 1e-6 * np.abs(column).max(), name
    total = sol["m.i_a"] + sol["m.i_b"] + sol["m.i_c"]
    assert np.abs(total).max() <= 8 * np.finfo(float).eps * np.abs(x[:, :3]).max()


@pytest.mark.slow
def test_switches_turn_at_their_angles_exactly() -> None:
    """Every 60 degrees from 30 on, to the rounding of the angle and of the time."""
    model = _model()
    sol = model.simulate(END, rtol=1e-9)
    times = np.array([row[0] for row in sol.events if row[3] in ("high", "low")])
    assert times.size > 10
    angle = DATA["pole_pairs"] * model.simulate(END, rtol=1e-9, t_eval=times)["m.phi"]
    steps = angle / (np.pi / 3) - 0.5
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-11)
    assert np.all(np.diff(np.round(steps)) == 1)


@pytest.mark.slow
def test_electrical_power_is_mechanical_power_copper_loss_and_what_is_stored() -> None:
    """Over the run, phase by phase of the motion, by a fine trapezoidal rule between outputs at its events."""
    model = _model()
    sol = model.simulate(END, rtol=1e-10)
    assert sol.energy_residual < 1e-8
    edges = np.unique([0.0, *(row[0] for row in sol.events), END])
    nodes, weights = np.polynomial.legendre.leggauss(12)
    half = np.diff(edges) / 2
    t = (edges[:-1, None] + half[:, None] * (1 + nodes)).ravel()
    inside = model.simulate(END, rtol=1e-10, t_eval=t)
    by_time = (half[:, None] * weights).ravel()
    currents, voltages = (np.array([inside[f"m.{name}_{phase}"] for phase in "abc"]) for name in "iu")
    electrical = by_time @ (currents * voltages).sum(axis=0)
    copper = DATA["R"] * by_time @ (currents**2).sum(axis=0)
    mechanical = by_time @ (inside["m.tau"] * inside["J.omega"])
    last = np.array([sol[f"m.i_{phase}"][-1] for phase in "abc"])
    stored = DATA["L"] / 2 * (last**2).sum()
    assert electrical == pytest.approx(mechanical + copper + stored, rel=1e-8)


@pytest.mark.slow
def test_a_locked_rotor_takes_the_current_of_two_phases_in_series() -> None:
    """At theta = 66 degrees a is high and b is low, c open: i = U / 2R (1 - exp(-R t / L)), tau = 2 k i."""
    net = sw.Network("locked")
    net.add(sw.BLDCMotor("m", **DATA), "rotor")
    net.add(sw.SpeedSource("lock", omega=0.0), "rotor", "ground")
    start = {"m.phi": np.pi / 3 / DATA["pole_pairs"] + 0.05}
    sol = net.simulate(0.1, initial=start, rtol=1e-12)
    current = DATA["U"] / (2 * DATA["R"]) * -np.expm1(-DATA["R"] * sol.t / DATA["L"])
    np.testing.assert_allclose(np.abs(sol["m.i_b"]), current, rtol=1e-9, atol=1e-9 * current.max())
    np.testing.assert_allclose(sol["m.tau"], 2 * DATA["k"] * current, rtol=1e-9, atol=1e-9)
    assert np.all(sol["m.i_a"] + sol["m.i_b"] + sol["m.i_c"] == 0)
    assert np.all(sol["m.i_c"] == 0)


def _current(t: np.ndarray, pieces: list[tuple[float, float, float]]) -> np.ndarray:
    """Of two phases in series under a voltage from some times on that is u + rise (t - begin), as (begin, u, rise)."""
    found, start, lag = np.zeros_like(t), 0.0, DATA["L"] / DATA["R"]
    ends = [*(begin for begin, *_ in pieces[1:]), np.inf]
    for (begin, u, rise), end in zip(pieces, ends, strict=True):

        def course(s: np.ndarray, u: float = u, rise: float = rise, start: float = start) -> np.ndarray:
            steady = (u + rise * (s - lag)) / (2 * DATA["R"])
            return steady + (start - (u - rise * lag) / (2 * DATA["R"])) * np.exp(-s / lag)

        inside = (t >= begin) & (t < end)
        found[inside] = course(t[inside] - begin)
        start = float(course(np.array([end - begin]))[0]) if np.isfinite(end) else start
    return found


PULSES = [(k * 0.002 + late, u, 0.0) for k in range(10) for late, u in ((0.0, 300.0), (0.0006, 0.0))]


@pytest.mark.parametrize("engine", ["scipy", "heyoka", "sundials"])
@pytest.mark.parametrize(
    ("U", "pieces"),
    [
        (sw.Ramp(80.0, 0.01), [(0.0, 0.0, 8000.0), (0.01, 80.0, 0.0)]),
        (sw.Table([0.0, 0.005, 0.02], [20.0, 60.0, 60.0]), [(0.0, 20.0, 8000.0), (0.005, 60.0, 0.0)]),
        (300 * sympy.Piecewise((1, 500 * sw.t - sympy.floor(500 * sw.t) < 0.3), (0, True)), PULSES),
    ],
    ids=["ramp", "table", "pulses"],
)
def test_a_locked_rotor_follows_a_voltage_over_time(U: object, pieces: list, engine: str) -> None:
    net = sw.Network("locked")
    net.add(sw.BLDCMotor("m", **(DATA | {"U": U})), "rotor")
    net.add(sw.SpeedSource("lock", omega=0.0), "rotor", "ground")
    start = {"m.phi": np.pi / 3 / DATA["pole_pairs"] + 0.05}
    sol = net.simulate(0.02, initial=start, rtol=1e-10, engine=engine, t_eval=np.linspace(0.0, 0.0199, 200))
    wanted = _current(sol.t, pieces)
    np.testing.assert_allclose(np.abs(sol["m.i_b"]), wanted, rtol=0, atol=1e-8 * wanted.max())
    assert sol.energy_residual < 1e-9


@pytest.mark.parametrize("U", [540.0 + 0 * sw.t, 500.0 + 0.8 * sw.omega], ids=["over time", "over speed"])
def test_a_law_of_the_supply_is_read_at_the_rotor(U: object) -> None:
    """At 50 rad/s both are 540 V."""
    found = []
    for voltage in (540.0, U):
        net = sw.Network("driven")
        net.add(sw.BLDCMotor("m", **(DATA | {"U": voltage})), "rotor")
        net.add(sw.SpeedSource("drive", omega=50.0), "rotor", "ground")
        found.append(net.simulate(0.03, rtol=1e-10, t_eval=31))
    for name in ("m.i_a", "m.i_b", "m.i_c", "m.tau"):
        np.testing.assert_allclose(found[1][name], found[0][name], rtol=0, atol=1e-8 * np.abs(found[0][name]).max())


@pytest.mark.slow
@pytest.mark.parametrize("pole_pairs", [1.0, 2.0])
def test_the_mean_of_the_steady_motion_is_that_of_the_averaged_motor(pole_pairs: float) -> None:
    """The average leaves out the resistance within a step and the fall of the back EMF while a phase hands over."""
    mean = _motor(sw.AveragedBLDC, pole_pairs=pole_pairs).compile().steady_state()
    start = {"J.omega": mean["J.omega"]}
    whole = _motor(pole_pairs=pole_pairs).simulate(0.4, rtol=1e-7, t_eval=4001, initial=start)
    settled = whole.t > 0.2
    assert whole["J.omega"][settled].mean() == pytest.approx(mean["J.omega"], rel=5e-3)
    assert whole["m.tau"][settled].mean() == pytest.approx(RATED, rel=5e-3)


def test_the_average_of_a_motor_without_inductance_in_its_commutation_is_a_direct_current_machine() -> None:
    """At standstill the term of commutation vanishes: the starting current has no part of it."""
    net = sw.Network("locked average")
    net.add(sw.AveragedBLDC("m", **DATA), "rotor")
    net.add(sw.SpeedSource("lock", omega=0.0), "rotor", "ground")
    sol = net.simulate(0.2, rtol=1e-12)
    current = DATA["U"] / (2 * DATA["R"]) * -np.expm1(-DATA["R"] * sol.t / DATA["L"])
    np.testing.assert_allclose(sol["m.i"], current, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(sol["m.tau"], 2 * DATA["k"] * current, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("flat", [1.0, 2 * np.pi / 3, 3.0])
def test_the_back_emf_is_a_trapezoid_with_flat_tops_of_the_asked_width(flat: float) -> None:
    angle, x = np.linspace(-2 * np.pi, 2 * np.pi, 1000, endpoint=False), sympy.Symbol("x", real=True)
    made = sympy.lambdify(x, _shape(x, sympy.Float(flat)), "numpy")
    wanted = Motor(1, 0, 1, 1, 1, 1, abs, flat=flat)
    np.testing.assert_allclose(made(angle), [wanted.shapes(at)[0] for at in angle], atol=1e-14)
    assert np.mean(np.abs(made(angle)) > 1 - 1e-12) == pytest.approx(flat / np.pi, abs=0.01)


@pytest.mark.slow
def test_copper_is_lost_in_the_motor_and_all_that_its_source_gives_is_supplied() -> None:
    """A locked rotor: two windings in series at U, i = U / 2R (1 - exp(-R t / L))."""
    U, R, L, t = 48.0, 0.7, 2e-3, 0.02
    net = sw.Network("locked")
    net.add(sw.BLDCMotor("motor", U=U, R=R, L=L, k=0.08, pole_pairs=2), "rotor")
    net.add(sw.SpeedSource("lock", omega=0.0), "rotor")
    energy = net.simulate(t).energy
    rise, current = L / R, U / (2 * R)
    once, twice = (1 - math.exp(-k * t / rise) for k in (1, 2))
    assert energy.lost_in["motor"] == pytest.approx(
        2 * R * current**2 * (t - 2 * rise * once + rise / 2 * twice), rel=1e-9
    )
    assert energy.supplied_by["motor"] == pytest.approx(U * current * (t - rise * once), rel=1e-9)


CONTROL = {"i_ref": 8.0, "k_p": 15.0, "t_i": 0.004, "f_c": 1500.0}


@pytest.mark.parametrize("engine", [pytest.param("scipy", marks=pytest.mark.slow), "heyoka"])
def test_a_controlled_current_is_that_of_its_chopper_by_hand(engine: str) -> None:
    net = sw.Network("locked")
    net.add(sw.BLDCMotor("m", **DATA, **CONTROL), "rotor")
    net.add(sw.SpeedSource("lock", omega=0.0), "rotor", "ground")
    times = np.linspace(0, 0.006, 61)[1:]
    made = net.simulate(0.006, initial={"m.phi": (math.pi / 6 + 0.05) / 2}, rtol=1e-10, engine=engine, t_eval=times)
    values = {name: DATA[name] for name in ("U", "R", "L")}
    i, control = Chopper(**values, **CONTROL).run(times).T
    # a switch moves in time by the error of the current before it
    assert np.abs(made["m.i_a"] - i).max() < 1e-7 * i.max()
    assert np.abs(made["m.i_b"] + i).max() < 1e-7 * i.max()
    assert np.abs(made["m.u_i"] - control).max() < 1e-7 * np.abs(control).max()
    assert made.energy.residual < 1e-9


def test_a_supply_that_comes_after_whole_periods_of_the_carrier_gives_the_same_current_later() -> None:
    def current(later: float, supply: Any) -> Any:
        net = sw.Network("locked")
        net.add(sw.BLDCMotor("m", **DATA | {"U": supply}, **CONTROL), "rotor")
        net.add(sw.SpeedSource("lock", omega=0.0), "rotor", "ground")
        times = later + np.linspace(0, 0.004, 41)[1:]
        return net.simulate(times[-1], initial={"m.phi": 0.3}, rtol=1e-10, t_eval=times)

    later = 3 / CONTROL["f_c"]
    once, again = current(0.0, DATA["U"]), current(later, sw.Step(DATA["U"], start=later))
    assert np.abs(again["m.i_a"] - once["m.i_a"]).max() < 1e-7 * np.abs(once["m.i_a"]).max()
    assert again.energy.residual < 1e-9


def test_a_supply_below_zero_shorts_the_motor_as_none_does() -> None:
    def current(supply: Any) -> Any:
        net = sw.Network("locked")
        net.add(sw.BLDCMotor("m", **DATA | {"U": supply}), "rotor")
        net.add(sw.SpeedSource("lock", omega=0.0), "rotor", "ground")
        return net.simulate(0.004, initial={"m.phi": 0.3}, rtol=1e-9, t_eval=[0.002, 0.003, 0.004])["m.i_a"]

    below = 40 - 20000 * sw.t
    np.testing.assert_allclose(current(below), current(sympy.Max(0, below)), rtol=1e-7)


def test_a_current_below_zero_is_refused_as_it_cannot_be_held() -> None:
    net = sw.Network("locked")
    net.add(sw.BLDCMotor("m", **DATA, **CONTROL | {"i_ref": -8.0}), "rotor")
    net.add(sw.SpeedSource("lock", omega=0.0), "rotor", "ground")
    with pytest.raises(sw.NetworkError, match=r"i_ref = -8\.0 must be at least 0"):
        net.compile()


def test_what_a_controlled_motor_is_supplied_with_is_electrical_work_alone() -> None:
    """The locked motor: the work of U is that of 2 R i^2 and of the coils, whatever the integral part has stored."""
    net = sw.Network("locked")
    net.add(sw.BLDCMotor("m", **DATA, **CONTROL | {"k_p": 1.0}), "rotor")
    net.add(sw.SpeedSource("lock", omega=0.0), "rotor", "ground")
    made = net.simulate(0.02, initial={"m.phi": 0.3}, rtol=1e-9, t_eval=np.linspace(0, 0.02, 40001))
    i = made["m.i_a"]
    copper = np.trapezoid(2 * DATA["R"] * i**2, made.t)
    coils = DATA["L"] * i[-1] ** 2
    assert made["m.u_i"][-1] ** 2 * CONTROL["t_i"] / 2 > 0.1 * (copper + coils)  # it would be seen
    # the trapezoidal rule on 1333 points in a pulse
    assert made.energy.supplied_by["m"] == pytest.approx(copper + coils, rel=1e-6)
    assert made.energy.residual < 1e-9


def test_the_mean_current_is_the_one_that_is_asked_for_once_it_has_settled() -> None:
    net = sw.Network("locked")
    net.add(sw.BLDCMotor("m", **DATA, **CONTROL), "rotor")
    net.add(sw.SpeedSource("lock", omega=0.0), "rotor", "ground")
    made = net.simulate(0.06, initial={"m.phi": 0.3}, rtol=1e-8, t_eval=np.linspace(0.04, 0.06, 6001))
    # a triangle about its mean, sampled evenly over whole periods
    assert np.mean(made["m.i_a"]) == pytest.approx(8.0, rel=1e-3)


def test_pulses_of_a_share_of_the_time_give_that_share_of_the_voltage() -> None:
    net = sw.Network("pulses")
    net.add(sw.VoltageSource("supply", u=300 * sw.PWM(0.3, 2000.0)), "p", "ground")
    net.add(sw.Resistor("R", R=2.0), "p", "q")
    net.add(sw.Inductor("L", L=0.05), "q", "ground")
    made = net.simulate(0.4, rtol=1e-8, t_eval=np.linspace(0.38, 0.4, 4001))
    # a triangle about its mean, sampled evenly over whole periods
    assert np.mean(made["L.i"]) == pytest.approx(0.3 * 300 / 2, rel=2e-4)
    assert np.ptp(made["L.i"]) == pytest.approx(300 / 0.05 * 0.3 * 0.7 / 2000, rel=1e-2)


@pytest.mark.parametrize("engine", ["heyoka", "scipy"])
@pytest.mark.parametrize(("duty", "frequency"), [(0.3, 1e3), (0.3, 2e3), (0.5, 500.0)])
def test_pulses_at_a_coil_are_exponentials_from_edge_to_edge(engine: str, duty: float, frequency: float) -> None:
    net = sw.Network("coil")
    net.add(sw.VoltageSource("supply", u=100 * sw.PWM(duty, frequency)), "p", "ground")
    net.add(sw.Resistor("R", R=1.0), "p", "q")
    net.add(sw.Inductor("L", L=5e-3), "q", "ground")
    made = net.simulate(0.02, rtol=1e-10, engine=engine)
    i, before = 0.0, 0.0
    for edge in (place for k in range(round(0.02 * frequency)) for place in (k + duty / 2, k + 1 - duty / 2)):
        voltage = 100.0 * (edge % 1 < 0.5)  # a pulse ends in the first half of a period
        i = voltage + (i - voltage) * math.exp(-(edge - before) / frequency / 5e-3)
        before = edge
    i = 100.0 + (i - 100.0) * math.exp(-(round(0.02 * frequency) - before) / frequency / 5e-3)
    assert made["L.i"][-1] == pytest.approx(i, rel=1e-8)


@pytest.mark.parametrize("duty", ["0.3", None, True, 0.3 + 1j, [0.3]])
def test_a_duty_that_is_no_law_is_refused_by_its_name(duty: Any) -> None:
    with pytest.raises(sw.ParameterError, match=r"PWM: duty = .* (is no law|is not finite and real)"):
        sw.PWM(duty, 1e3)


@pytest.mark.parametrize(("duty", "value"), [(-0.2, 0), (0.0, 0), (1.0, 1), (1.4, 1)])
def test_pulses_of_no_share_and_of_all_have_neither_pulses_nor_gaps(duty: float, value: int) -> None:
    assert sw.PWM(duty, 10.0) == value
    # at whole and half periods the triangle touches 0 and 1
    law = sw.PWM(duty + 0 * sw.t + 1e-300 * sw.t, 10.0)
    assert {int(law.subs(sw.t, t)) for t in np.linspace(0.001, 0.098, 41)} == {value}


@pytest.mark.parametrize("given", [{"i_ref": 8.0}, {"i_ref": 8.0, "k_p": 2.0}, {"k_p": 2.0}, {"f_c": 1e3}])
def test_half_a_current_controller_is_refused(given: dict[str, float]) -> None:
    with pytest.raises(sw.ParameterError, match="Give i_ref, k_p and f_c, or none of them"):
        sw.BLDCMotor("m", **DATA, **given)
