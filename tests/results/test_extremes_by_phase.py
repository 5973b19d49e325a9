"""True extremes against closed forms: at jumps and ends, phase by phase, along shafts, of motions that were stored."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
import sympy
from scipy.optimize import minimize_scalar

import shaftwork as sw
from tests.reference.modal_extremes import Chain

ENGINES = ["auto", "scipy", "heyoka"]
LONG = {"length": 10.0, "diameter": 0.1, "density": 7900.0, "shear_modulus": 79e9}
DELAY = LONG["length"] / math.sqrt(LONG["shear_modulus"] / LONG["density"])
IMPEDANCE = math.sqrt(LONG["shear_modulus"] * LONG["density"]) * math.pi * LONG["diameter"] ** 4 / 32


@pytest.mark.parametrize("engine", ENGINES)
def test_a_jump_has_an_extreme_on_each_side(engine: str) -> None:
    """The torque rises to 4 N m, jumps to -3 N m and rises again: neither side of the jump is at an output time."""
    jump, end = 0.123456789, 0.2
    before, after = 1.0 + 3.0 * sw.t / jump, -3.0 + 2.0 * (sw.t - jump)
    net = sw.Network("jump")
    net.add(sw.TorqueSource("pull", tau=sympy.Piecewise((before, sw.t < jump), (after, True))), "a")
    net.add(sw.Inertia("J", J=2.0), "a")
    sol = net.simulate(end, engine=engine, t_eval=31)
    assert sol.max("pull.tau") == pytest.approx(4.0, rel=1e-12)
    assert sol.min("pull.tau") == pytest.approx(-3.0, rel=1e-12)
    assert sol.max("pull.tau").t == pytest.approx(jump, abs=1e-12)
    assert sol.min("pull.tau").t == pytest.approx(jump, abs=1e-12)
    top = 2.5 * jump / 2.0  # speed: the impulse of the rising torque, whose mean is 2.5 N m
    assert sol.max("J.omega") == pytest.approx(top, rel=1e-9)
    assert sol.max("J.omega").t == pytest.approx(jump, abs=1e-9)
    assert sol.min("pull.power") == pytest.approx(-4.0 * top, rel=1e-9)  # what it takes, on the one side of the jump
    assert sol.max("pull.power") == pytest.approx(3.0 * top, rel=1e-9)  # and on the other


@pytest.mark.parametrize("engine", [*ENGINES, "exact"])
@pytest.mark.parametrize("t_eval", [None, 2, "steps", [0.3, 0.4]])
def test_extremes_at_the_first_and_the_last_instant_do_not_depend_on_the_output_times(
    engine: str, t_eval: object
) -> None:
    net = sw.Network("run out")
    net.add(sw.Inertia("J", J=2.0), "a")
    net.add(sw.Damper("water", d=5.0), "a")
    options = {"t_eval": t_eval, "engine": engine, "rtol": 1e-11}
    sol = net.simulate(1.5, t_start=0.25, initial={"J.omega": 10.0}, **options)  # type: ignore[arg-type]
    most, least = sol.max("J.omega"), sol.min("J.omega")
    assert (most, most.t) == (10.0, 0.25)
    assert least == pytest.approx(10.0 * math.exp(-2.5 * 1.25), rel=1e-9)
    assert least.t == 1.5


@pytest.mark.parametrize("engine", ENGINES)
def test_a_constant_is_its_own_extreme_at_the_start(engine: str) -> None:
    net = sw.Network("constant")
    net.add(sw.TorqueSource("pull", tau=0.3), "a")
    net.add(sw.Inertia("J", J=2.0), "a")
    sol = net.simulate(1.0, engine=engine)
    least, most = sol.extremes["pull.tau"]
    assert (least, most, least.t, most.t) == (0.3, 0.3, 0.0, 0.0)


def hits_of_a_gap(turns: int) -> tuple[list[float], list[float], float]:
    """Peaks of the torque in a gap, their times, and the end of the last contact.

    A rotor runs to and fro between the flanks, pushed by a constant torque. In the gap its speed is a straight line; on
    a flank it swings about the twist that the push holds, y = rest + A cos(rate s - alpha), and leaves as it came.
    """
    x, v, t, peaks, times = 0.0, W0, 0.0, list[float](), list[float]()
    rate, rest = math.sqrt(C / J), PUSH / C
    for _ in range(turns):
        flank = math.copysign(GAP / 2, v)
        roots = np.roots([PUSH / J / 2, v, x - flank])
        flight = float(min(root.real for root in roots if root.real > 1e-12))
        t, v = t + flight, v + PUSH / J * flight
        alpha = math.atan2(v / rate, -rest) + (math.pi if v < 0 else 0.0)
        peaks.append(C * (rest + math.copysign(math.hypot(v / rate, rest), v)))
        times.append(t + alpha / rate)
        x, v, t = flank, -v, t + 2 * alpha / rate
    return peaks, times, t


J, C, GAP, W0, PUSH = 0.5, 8e4, 0.01, 1.5, -6.0


@pytest.mark.parametrize("engine", ENGINES)
def test_the_torque_in_a_gap_is_largest_in_the_right_contact(engine: str) -> None:
    peaks, times, end = hits_of_a_gap(5)
    assert len({round(peak, 6) for peak in peaks}) == 2  # forward and backward
    net = sw.Network("gap")
    net.add(sw.TorqueSource("push", tau=PUSH), "a")
    net.add(sw.Inertia("J", J=J), "a")
    net.add(sw.Backlash("gap", gap=GAP, c=C), "a", "ground")
    sol = net.simulate(end, initial={"J.omega": W0}, engine=engine, rtol=1e-11, t_eval=50)
    assert sum(row.modes["gap"] != "open" for row in sol.phases) == len(peaks)
    assert sol.max("gap.tau") == pytest.approx(max(peaks), rel=1e-8)
    assert sol.min("gap.tau") == pytest.approx(min(peaks), rel=1e-8)
    assert min(abs(sol.max("gap.tau").t - time) for time in times) < 1e-6


@pytest.mark.parametrize("engine", ENGINES)
def test_a_clutch_gives_its_slip_torque_until_both_turn_alike_and_then_what_they_need(engine: str) -> None:
    """It engages at 0.1 s; then the speeds are straight lines that meet, and the torque jumps to its share."""
    J1, J2, drive, tau, t_on = 2.0, 3.0, 30.0, 70.0, 0.1
    net = sw.Network("clutch")
    net.add(sw.TorqueSource("drive", tau=drive), "a")
    net.add(sw.Inertia("J1", J=J1), "a")
    net.add(sw.Clutch("clutch", tau=tau, t_on=t_on), "a", "b")
    net.add(sw.Inertia("J2", J=J2), "b")
    start = 40.0
    sol = net.simulate(2.0, initial={"J1.omega": start}, engine=engine, rtol=1e-11, t_eval=50)
    at_on = start + drive / J1 * t_on
    meet = at_on / (tau / J2 + (tau - drive) / J1)
    together = tau / J2 * meet
    assert sol.max("J1.omega") == pytest.approx(max(at_on, together + drive / (J1 + J2) * (1.9 - meet)), rel=1e-9)
    assert sol.max("clutch.tau") == pytest.approx(tau, rel=1e-9)
    assert sol.max("clutch.tau").t == pytest.approx(t_on, abs=1e-9)
    assert sol.min("clutch.tau") == 0.0
    late = sol.at(np.linspace(t_on + meet + 1e-6, 2.0, 50))
    np.testing.assert_allclose(late["clutch.tau"], drive * J2 / (J1 + J2), rtol=1e-9)


@pytest.mark.slow
def test_a_travelling_wave_is_largest_where_it_is_reflected() -> None:
    """A step on a rotor at one end of a clamped shaft: until the third delay the clamp takes twice what arrives.

    tau_b(t) = 2 Z omega(t - T), and omega = tau / Z (1 - exp(-Z t / J)) before the first echo is back.
    """
    tau, J = 100.0, 2.0 * IMPEDANCE * DELAY
    net = sw.Network("wave")
    net.add(sw.TorqueSource("push", tau=tau), "a")
    net.add(sw.Inertia("J", J=J), "a")
    net.add(sw.Shaft("line", **LONG, model=sw.Wave()), "a", "ground")
    sol = net.simulate(2.9 * DELAY, t_eval=20, rtol=1e-11)

    def speed(t: float) -> float:
        return tau / IMPEDANCE * (1 - math.exp(-IMPEDANCE * t / J))

    end = 2 * IMPEDANCE * speed(1.9 * DELAY)
    assert sol.max("line.tau_b") == pytest.approx(end, rel=1e-8)
    assert sol.max("line.tau_b").t == pytest.approx(2.9 * DELAY, rel=1e-15)
    assert sol.min("line.tau_b") == 0.0
    along = net.simulate(1.9 * DELAY, t_eval=20, rtol=1e-11).max("line.tau")  # before echoes of the echo
    assert along == pytest.approx(2 * IMPEDANCE * speed(0.9 * DELAY), rel=1e-8)
    assert along.place == LONG["length"]

    def torque_of_rotor(t: float) -> float:
        """After the first echo, J omega' = tau - Z omega - 2 Z omega(t - 2 T), from speed(2 T)."""
        s, rate = t - 2 * DELAY, IMPEDANCE / J
        level = tau / IMPEDANCE
        return (
            level
            - (level - speed(2 * DELAY)) * math.exp(-rate * s)
            - 2 * level * (1 - math.exp(-rate * s) - rate * s * math.exp(-rate * s))
        )

    top = minimize_scalar(lambda t: -torque_of_rotor(t), bounds=(2 * DELAY, 2.9 * DELAY), options={"xatol": 1e-12})
    assert sol.max("J.omega") == pytest.approx(max(speed(2 * DELAY), -top.fun), rel=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["auto", "scipy"])
def test_along_a_chain_the_extreme_is_that_of_the_worst_spring(engine: str) -> None:
    """`Lumped(6)` is a chain of springs, whose modes are summed and bracketed."""
    m, end = 6, 30 * DELAY
    J, c = IMPEDANCE * DELAY, IMPEDANCE / DELAY
    inertias = np.full(m + 1, J / m)
    inertias[[0, -1]] /= 2
    inertias[[0, -1]] += 0.4 * J, 0.7 * J
    water = 0.3 * IMPEDANCE
    damping, torque = np.zeros(m + 1), np.zeros(m + 1)
    damping[-1], torque[0] = water, 100.0
    chain = Chain(inertias, np.full(m, c * m), np.zeros(m), damping, torque, np.zeros(m + 1))
    exact = [chain.torque_between(k).largest(end)[1] for k in range(m)]
    net = sw.Network("chain")
    net.add(sw.TorqueSource("push", tau=100.0), "a")
    net.add(sw.Inertia("J1", J=0.4 * J), "a")
    net.add(sw.Shaft("line", **LONG, model=sw.Lumped(m)), "a", "b")
    net.add(sw.Inertia("J2", J=0.7 * J), "b")
    net.add(sw.Damper("water", d=water), "b")
    sol = net.simulate(end, t_eval=20, engine=engine, rtol=1e-11)
    most = sol.max("line.tau")
    assert most == pytest.approx(max(exact), rel=1e-8)
    assert most.place is not None
    assert min(abs(most.place - LONG["length"] * (np.argmax(exact) + side) / m) for side in (0, 0.5, 1)) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["crane", "shaft_step"])
def test_extremes_of_a_stored_motion_are_those_of_the_motion(scene: str) -> None:
    sol = getattr(sw.scenes, scene)().simulate(0.3, t_eval=20)
    read = pickle.loads(pickle.dumps(sol))  # noqa: S301 (written here)
    for name in sol.names[:4]:
        for own, other in zip(sol.extremes[name], read.extremes[name], strict=True):
            assert (other, other.t, other.unit) == (own, own.t, own.unit)
