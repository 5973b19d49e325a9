"""Every engine follows a motion through the switches of its laws, however briefly a contact is closed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

import shaftwork as sw
from shaftwork.integrate.crossings import Crossings
from shaftwork.integrate.engines import available
from shaftwork.integrate.problem import Problem
from shaftwork.integrate.smooth_intervals import pieces

ENGINES = ["heyoka", "numba", "scipy", "scipy-radau", "sundials", "banded"]
RTOLS = [1e-4, 1e-6, 1e-9]
# Of the largest speed, in tolerances. The errors of CVODE's formulas, of order 5 at most, add up over thousands of
# steps, in smooth motions as well (a factor 1000 in `test_engines_agree`): 830 was met here, and 43 of other engines.
WORTH = dict.fromkeys(ENGINES, 100.0) | {"sundials": 2000.0}


def flight(x: float, v: float, a: float, walls: tuple[float, ...], longest: float) -> tuple[float, float]:
    """The time of free flight x + v t + a t^2 / 2 out through a wall, and the wall, or the longest time and NaN."""
    found = [(longest, np.nan)]
    for wall in walls:
        for root in np.roots([a / 2, v, x - wall]):
            outwards = (v + a * root.real) * np.sign(wall or -1.0) > 0
            if root.imag == 0 and root.real > 1e-9 and outwards:
                found.append((float(root.real), wall))
    return min(found)


def contact(rate: Callable, force: Callable, start: float, x: np.ndarray, end: float) -> tuple[float, np.ndarray]:
    """Time and state when the force of a contact becomes zero, or at the end."""

    def lost(_t: float, x: np.ndarray) -> float:
        return force(x)

    lost.terminal, lost.direction = True, -1  # type: ignore[attr-defined]
    run = solve_ivp(rate, (start, end), x, "DOP853", rtol=1e-13, atol=1e-15, events=lost, max_step=5e-3)
    return float(run.t[-1]), run.y[:, -1]


def crane_gap() -> float:
    """Speed after 4 s of the first of two inertias that rattle in a gap, by free flights and contacts in turns."""
    J1, J2, c, d, half = 27.35, 62.5, 24206.0, 14.0, 0.01
    t, x, side = 0.1, np.zeros(3), np.nan
    while t < 4.0:
        end, tau = (2.0, 300.0) if t < 2.0 else (4.0, -200.0)
        if np.isnan(side):
            phi, w1, w2 = x
            span, wall = flight(phi, w1 - w2, tau / J1, (half, -half), end - t)
            t, side = t + span, float(np.sign(wall))
            x = np.array([phi + (w1 - w2) * span + tau / J1 * span**2 / 2, w1 + tau / J1 * span, w2])
        else:

            def force(x: np.ndarray, side: float = side) -> float:
                return side * (c * (x[0] - side * half) + d * (x[1] - x[2]))

            def rate(_t: float, x: np.ndarray, side: float = side, tau: float = tau) -> list[float]:
                return [x[1] - x[2], (tau - side * force(x, side)) / J1, side * force(x, side) / J2]

            t, x = contact(rate, force, t, x, end)
            side = side if t == end else np.nan
    return float(x[1])


def gap_network() -> sw.Network:
    net = sw.Network("crane gap")
    net.add(sw.TorqueSource("m", tau=sw.Step(300.0, start=0.1) - sw.Step(500.0, start=2.0)), "a")
    net.add(sw.Inertia("J1", J=27.35), "a")
    net.add(sw.Backlash("gap", gap=0.02, c=24206.0, d=14.0), "a", "b")
    net.add(sw.Inertia("J2", J=62.5), "b")
    return net


def body(tau: object) -> sw.Network:
    net = sw.Network("body")
    net.add(sw.Inertia("J", J=1.0), "n")
    net.add(sw.TorqueSource("m", tau=tau), "n")
    return net


SOFT, HARD, BEND, SPEED = 40.0, 900.0, 0.1, 2.0
STOP_DAMPING = 10.0


def bent_spring() -> float:
    """Speed after 3 s of an inertia of 1 kg m2 on a spring that is harder beyond a twist, by arcs of circles."""
    slow, fast = np.sqrt(SOFT), np.sqrt(HARD)
    # from zero twist to the bend, and from there to the turn, where the spring pulls as one of `HARD` about `rest`
    first = np.arcsin(BEND * slow / SPEED) / slow
    speed, rest = np.sqrt(SPEED**2 - SOFT * BEND**2), BEND - SOFT * BEND / HARD
    reach = np.hypot(BEND - rest, speed / fast)
    second = np.arccos((BEND - rest) / reach) / fast
    t = 3.0 % (2 * first + 2 * second + np.pi / slow)
    if t < first:
        return SPEED * np.cos(slow * t)
    if t < first + 2 * second:
        return -reach * fast * np.sin(fast * (t - first - second))
    return -SPEED * np.cos(slow * (t - 2 * first - 2 * second))


def bouncing() -> float:
    """Speed after 2 s of an inertia that a torque drives against a damped stop, thrown away from it at 2 rad/s."""
    t, phi, speed = 0.0, 0.0, 2.0
    while t < 2.0:
        span, wall = flight(phi, speed, -10.0, (0.0,), 2.0 - t)
        t, phi, speed = t + span, phi + speed * span - 5.0 * span**2, speed - 10.0 * span
        if wall == 0.0:
            t, x = contact(
                lambda _t, x: [x[1], -10.0 - 4e4 * x[0] - STOP_DAMPING * x[1]],
                lambda x: -4e4 * x[0] - STOP_DAMPING * x[1],
                t,
                np.array([0.0, speed]),
                2.0,
            )
            phi, speed = x
    return speed


BENT = sympy.Piecewise((-SOFT * sw.phi, sw.phi < BEND), (-SOFT * BEND - HARD * (sw.phi - BEND), True))
STOP = -10 + sympy.Piecewise((sympy.Max(0, -4e4 * sw.phi - STOP_DAMPING * sw.omega), sw.phi < 0), (0, True))
MOTIONS = {
    "gap": (gap_network(), 4.0, {}, "J1.omega", crane_gap, 6.6),
    "bent spring": (body(BENT), 3.0, {"J.omega": SPEED}, "J.omega", bent_spring, SPEED),
    "bounce": (body(STOP), 2.0, {"J.omega": 2.0}, "J.omega", bouncing, 2.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("motion", MOTIONS)
def test_every_engine_follows_a_motion_through_its_switches(motion: str, engine: str) -> None:
    """The gap is closed at 2.52 s for 8 ms in the midst of a free flight, where every method takes longer steps."""
    if not available(engine):
        pytest.skip(f"{engine} is not installed")
    if (motion, engine) == ("gap", "banded"):  # a part with modes, which this engine does not follow, and says so
        with pytest.raises(sw.ParameterError, match="gap"):
            gap_network().simulate(4.0, engine=engine)
        return
    network, t_end, initial, signal, reference, largest = MOTIONS[motion]
    model, expected = network.compile(), reference()
    for rtol in RTOLS:
        found = model.simulate(t_end, engine=engine, rtol=rtol, initial=initial)[signal][-1]
        assert abs(found - expected) < WORTH[engine] * rtol * largest, rtol


def falling(switches: Callable | None) -> Problem:
    """Free flight: x'' = -2 from x = 1 with x' = -2 + a little, which just touches zero at about 1 s."""
    return Problem(
        rhs=lambda _t, x: np.array([x[1], 2.0]),
        jacobian=None,
        x0=np.array([1.0, -2.0]),
        t0=0.0,
        t_end=3.0,
        names=("x", "v"),
        atol=np.full(2, 1e-9),
        switches=switches,
    )


@pytest.mark.parametrize("depth", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("end", [1.6, 2.0, 2.9])
def test_a_touch_is_seen_however_short_a_part_of_the_step_it_is(depth: float, end: float) -> None:
    problem = falling(lambda _t, x: x[:, :1])

    def dense(t: np.ndarray) -> np.ndarray:
        return np.column_stack([(1 - t) ** 2 - depth, 2 * (t - 1)])

    first, last = dense(np.array([0.0, end]))
    cut = Crossings(problem, pieces(problem)[0]).cut(0.0, first, end, last, dense)
    # just past the switch: no state moves by more than a part of its tolerance, 1e-9 + 1e-8 |v|, at a rate of 2
    assert cut is not None
    assert 0 < cut - (1 - np.sqrt(depth)) < 1e-8


def test_a_step_that_attempts_do_not_end_at_its_switch_is_halved() -> None:
    """The motion of a shorter step is another one, whose switch may again lie elsewhere, and so on without end."""
    problem = falling(lambda _t, x: x[:, :1])

    def dense(t: np.ndarray) -> np.ndarray:
        return np.column_stack([(1 - t) ** 2 - 0.01, 2 * (t - 1)])

    first, last = dense(np.array([0.0, 1.0]))
    crossings = Crossings(problem, pieces(problem)[0])
    cuts = [crossings.cut(0.0, first, 1.0, last, dense) for _ in range(5)]
    assert cuts == pytest.approx([0.9, 0.9, 0.9, 0.9, 0.5], abs=1e-8)


@pytest.mark.parametrize("depth", [-1e-2, -1e-5])
def test_a_step_that_only_comes_near_to_a_switch_stands(depth: float) -> None:
    problem = falling(lambda _t, x: x[:, :1])

    def dense(t: np.ndarray) -> np.ndarray:
        return np.column_stack([(1 - t) ** 2 - depth, 2 * (t - 1)])

    first, last = dense(np.array([0.0, 2.0]))
    assert Crossings(problem, pieces(problem)[0]).cut(0.0, first, 2.0, last, dense) is None


RESTS = {
    # damped towards the twist at which the spring becomes harder, and to a stop where the drag changes its sign
    "at a bend": (
        sympy.Piecewise((-40 * (sw.phi - 0.1), sw.phi < 0.1), (-900 * (sw.phi - 0.1), True)) - 5 * sw.omega,
        0.1,
    ),
    "at a stop": (-sympy.Abs(sw.omega) * sw.omega - 3 * sw.omega - 40 * sw.phi, 0.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("rest", RESTS)
def test_a_motion_that_comes_to_rest_on_a_switch_goes_on(rest: str, engine: str) -> None:
    if not available(engine):
        pytest.skip(f"{engine} is not installed")
    law, place = RESTS[rest]
    sol = body(law).simulate(200.0, engine=engine, rtol=1e-6, initial={"J.omega": 2.0})
    assert sol["m.phi"][-1] == pytest.approx(place, abs=1e-6)
    assert sol.statistics["steps"] < 2000  # some hundred for the decay, and long steps for the rest of 200 s


@pytest.mark.parametrize("engine", ENGINES[:3])
def test_a_law_bends_after_the_last_part_has_changed_its_mode(engine: str) -> None:
    """A switch that closes for good leaves no guard; the fan still turns round."""
    net = sw.Network("for good")
    net.add(sw.TorqueSource("motor", tau=5 * sympy.sin(7 * sw.t)), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.FanLoad("fan", tau_n=5.0, n_n=10.0), "a")
    net.add(sw.VoltageSource("source", u=2.0), "p", "ground")
    net.add(sw.Switch("switch", t_on=0.2), "p", "q")
    net.add(sw.Resistor("R", R=5.0), "q", "c")
    net.add(sw.Capacitor("C", C=0.1), "c", "ground")
    omega = solve_ivp(
        lambda t, x: 5 * np.sin(7 * t) - 5.0 * x * abs(x) / (10 * np.pi / 30) ** 2, (0, 2), [0.0], "DOP853",
        rtol=1e-12, atol=1e-14, max_step=1e-2,
    ).y[0, -1]  # fmt: skip
    sol = net.compile().simulate(2.0, engine=engine, rtol=1e-9)
    assert sol["J.omega"][-1] == pytest.approx(omega, abs=1e-7)


def test_a_network_without_such_laws_is_not_looked_at() -> None:
    problem = falling(None)
    untouched = Crossings(problem, pieces(problem)[0])

    def dense(_t: np.ndarray) -> np.ndarray:
        raise AssertionError("the step was looked at")

    assert untouched.cut(0.0, problem.x0, 1.0, problem.x0, dense) is None
    time_alone = body(sw.Step(1.0, start=0.5) - sw.omega**3).compile()
    assert not time_alone.arrays.inputs.switching
    assert body(BENT).compile().arrays.inputs.switching


def test_a_measured_curve_is_followed_from_point_to_point() -> None:
    """A table is smooth but at its points: the run ends a step at each of them, whatever the tolerance."""
    speeds = np.linspace(-2.0, 2.0, 9)
    model = body(sw.Table(speeds, -speeds * np.abs(speeds))(sw.omega)).compile()
    sol = model.simulate(3.0, engine="scipy", rtol=1e-6, initial={"J.omega": 2.0})
    passed = sol.at(sol.steps)["J.omega"]
    for speed in speeds[(speeds < 2.0) & (speeds > passed[-1])]:
        assert np.abs(passed - speed).min() < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("d", [20.0, 50.0, 200.0])
def test_a_speed_that_dies_away_turns_until_it_is_rounding(d: float) -> None:
    """The motor is off and its curve still asks for the sign of a speed, whose turns heyoka cannot tell any more."""
    net = sw.Network("held")
    net.add(sw.motors["KBF-90 LA 2"].cage("motor", t_off=0.1), "rotor")
    net.add(sw.Inertia("J", J=0.63), "rotor")
    net.add(sw.Spring("shaft", c=26e4, d=d), "rotor", "ground")
    net.add(sw.TorqueSource("weight", tau=20.0), "rotor")
    sol = net.simulate(3.0, engine="heyoka")
    assert sol["shaft.tau"][-1] == pytest.approx(20.0, rel=1e-9)
    assert sol["J.omega"][-1] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.slow
def test_a_law_of_the_speed_acts_from_where_a_long_shaft_brings_the_first_motion() -> None:
    """The far end moves by rounding at first, which turns its speed to and fro; the fan must follow what comes then."""
    net = sw.Network("fan behind shafts")
    net.add(sw.TorqueSource("motor", tau=5000.0), "rotor")
    net.add(sw.Inertia("J", J=53.0), "rotor")
    net.add(sw.Spring("coupling", c=1.2e5, d=200.0), "rotor", "hub")
    net.add(sw.Inertia("hub", J=1.5), "hub")
    for name, ends, diameter in (("first", ("hub", "flange"), 0.12), ("second", ("flange", "fan"), 0.13)):
        shaft = sw.Shaft(name, length=2.5, diameter=diameter, damping=161.0, model=sw.Spectral(6))
        net.add(shaft, *ends)
    net.add(sw.Inertia("J_fan", J=38.0), "fan")
    net.add(sw.FanLoad("fan", tau_n=5000.0, n_n=900.0), "fan")
    motion = net.simulate(0.03, engine="heyoka")
    other = net.simulate(0.03, engine="scipy", rtol=1e-10)
    assert motion.energy_residual < 1e-12  # of rounding; the fan on the wrong side is 1e-5
    np.testing.assert_allclose(motion["J_fan.omega"], other["J_fan.omega"], atol=1e-9)  # of scipy's tolerance
