"""Motions under noise of time and of angle: every engine sees the same load, steps where it steps, and agrees."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
import sympy
from scipy import sparse
from scipy.integrate import solve_ivp

import shaftwork as sw
from shaftwork.components import noise
from shaftwork.core.errors import ParameterError
from shaftwork.integrate import choice
from shaftwork.integrate.problem import Problem

ENGINES = ["heyoka", "scipy", "sundials"]
# Of the largest value, in tolerances. The stiff shaft makes 100 of scipy's out of 10 of a speed, and the errors of
# CVODE's formulas add up over thousands of steps: 0.04, 103 and 2300 were met at 1e-9, and about as many from 1e-6 to
# 1e-11. A step of the load that is missed by one pitch is wrong by 1e-2, which is 1e7 of them.
WORTH = {"heyoka": 10.0, "scipy": 500.0, "sundials": 10000.0}
ANGLE, TIME = sw.phi * 4, sw.t / 0.05


def crane(load: object) -> sw.Network:
    """Two masses, a motor and a load on the second."""
    net = sw.Network("crane")
    net.add(sw.KlossMotor("motor", tau_k=9.6, s_k=0.25, n_sync=3000, ratio=35.5, efficiency=0.95), "a")
    net.add(sw.Inertia("J1", J=27.35), "a")
    net.add(sw.Spring("shaft", c=24206.0, d=14.0), "a", "b")
    net.add(sw.Inertia("J2", J=62.5), "b")
    net.add(load if isinstance(load, sw.Component) else sw.TorqueSource("w", tau=load), "b")
    return net


def body(tau: object) -> sw.Network:
    """One mass."""
    net = sw.Network("body")
    net.add(sw.TorqueSource("m", tau=tau), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    return net


LOADS = {
    "held in time": sw.RandomLoad("w", mean=22.4, std=10.0, interval=0.05, seed=1.0),
    "held and rounded": sw.RandomLoad("w", mean=22.4, std=10.0, interval=0.05, seed=1.0, omega_s=0.01),
    "smooth in time": sw.RandomLoad("w", mean=22.4, std=10.0, interval=0.05, seed=1.0, kind="band-limited"),
    "held in angle": -(22.4 + 10 * sw.HeldNoise(ANGLE, 1)) * sympy.tanh(sw.omega / 0.01),
    "smooth in angle": -(22.4 + 10 * sw.SmoothNoise(ANGLE, 1)) * sympy.tanh(sw.omega / 0.01),
    "bucket wheel": sw.BucketWheelLoad("w", radius=0.03, edge=0.02, t_on=1.0, seed=2.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LOADS)
def test_engines_agree_on_a_two_mass_train(name: str) -> None:
    """To what each is worth at 1e-9, against heyoka at 1e-13."""
    model = crane(LOADS[name]).compile()
    true = model.simulate(4.0, engine="heyoka", rtol=1e-13, t_eval=201)
    for engine in ENGINES:
        sol = model.simulate(4.0, engine=engine, rtol=1e-9, t_eval=201)
        for signal in ("J1.omega", "J2.omega", "shaft.tau"):
            error = np.abs(sol[signal] - true[signal]).max()
            assert error < WORTH[engine] * 1e-9 * np.abs(true[signal]).max(), (engine, signal)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_a_load_is_the_same_bits_in_every_engine(engine: str) -> None:
    """As a function of time, or of the angle that the engine finds; four pitches to the radian round nowhere."""
    times = 0.05 * (np.arange(40) + 0.5)
    for law, function in ((sw.HeldNoise, noise.held), (sw.SmoothNoise, noise.smooth)):
        sol = body(law(TIME, 3.0)).simulate(2.0, engine=engine, t_eval=times)
        np.testing.assert_array_equal(sol["m.tau"], function(times * 20.0, 3.0))
        sol = body(3 + law(ANGLE, 3.0)).simulate(2.0, engine=engine, t_eval=times)
        np.testing.assert_array_equal(sol["m.tau"], 3 + function(4 * sol["m.phi"], 3.0))


def steps_of_angle(pitch: float, drive: float, drag: float, seed: float, t_end: float) -> float:
    """Speed of one mass after a time, from pitch to pitch: within one the noise is constant."""
    t, omega, number = 0.0, 0.0, 0
    while t < t_end:
        tau, start = drive + noise.normal(number, seed), number * pitch

        def passed(_t: float, x: np.ndarray, end: float = start + pitch) -> float:
            return x[0] - end

        passed.terminal = True  # type: ignore[attr-defined]
        run = solve_ivp(
            lambda _t, x, tau=tau: [x[1], tau - drag * x[1]], (t, t_end), [start, omega], "DOP853",
            rtol=1e-13, atol=1e-14, events=passed,
        )  # fmt: skip
        t, omega, number = float(run.t[-1]), float(run.y[1, -1]), number + 1
    return omega


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_noise_of_the_angle_steps_where_an_independent_march_from_pitch_to_pitch_has_it_step(engine: str) -> None:
    sol = body(3 - 0.2 * sw.omega + sw.HeldNoise(sw.phi / 0.5, 7.0)).simulate(5.0, engine=engine, rtol=1e-10)
    true = steps_of_angle(0.5, 3.0, 0.2, 7.0, 5.0)
    assert sol["J.omega"][-1] == pytest.approx(true, rel=WORTH[engine] * 1e-10)


def slips_and_sticks(tau: float, J: float, load: np.ndarray, interval: float) -> np.ndarray:
    """Speed at the end of each interval, of one mass under a constant torque and a resistance that is held in each."""
    omega, speeds = 0.0, []
    for size in load.tolist():
        if omega == 0 and tau <= size:
            speeds.append(0.0)
            continue
        rate = (tau - size) / J
        omega = max(0.0, omega + rate * interval)  # the torque is positive: it never turns backwards
        speeds.append(omega)
    return np.array(speeds)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_a_mass_sticks_and_breaks_away_as_its_random_resistance_rises_and_falls(engine: str) -> None:
    """While it sticks no law of a branch changes, and the step of the resistance alone sets it free."""
    net = sw.Network("travel")
    net.add(sw.TorqueSource("m", tau=21.0), "a")
    net.add(sw.Inertia("J", J=2.0), "a")
    net.add(sw.RandomLoad("w", mean=22.4, std=10.0, interval=0.05, seed=3.0), "a")
    sol = net.simulate(5.0, engine=engine, rtol=1e-9, t_eval=0.025 * np.arange(1, 201))  # middles and ends
    load = np.maximum(0.0, 22.4 + 10.0 * noise.held(np.arange(100), 3.0))
    true = slips_and_sticks(21.0, 2.0, load, 0.05)
    assert (true == 0).sum() > 10
    assert (np.diff(np.sign(true)) > 0).sum() > 3
    np.testing.assert_allclose(sol["J.omega"][1::2], true, atol=1e-7)
    rests = (true == 0) & (np.append(0.0, true[:-1]) == 0)
    assert (sol["J.omega"][::2][rests] == 0).all()


FLOOR = sympy.floor(sw.phi)
HARD = {
    "starts downwards from a whole number": -3 - 0.2 * sw.omega + sw.HeldNoise(sw.phi / 0.3, 1),
    "turns round": 5 * sympy.sin(2 * sw.t) - 0.1 * sw.omega + 0.5 * sw.HeldNoise(sw.phi / 0.7, 1),
    "several step at once": 3 - 0.2 * sw.omega + sum(sw.HeldNoise(k * sw.phi, k) for k in (1, 2, 3)),
    "kinks where it steps": 3
    - 0.2 * sw.omega
    + sympy.Max(0, 0.5 + FLOOR - sw.phi) * sw.HeldNoise(sw.phi, 1)
    + sympy.Max(0, 1 + FLOOR - sw.phi) * sw.HeldNoise(sw.phi - 1, 1),
    "noise of steps": 3 - 0.2 * sw.omega + sw.HeldNoise(FLOOR / 3, 1),
    "time and angle": 3 - 0.2 * sw.omega + sw.HeldNoise(sw.phi + sw.t, 1) + sw.HeldNoise(sw.t / 0.07, 4),
    "cut off at zero": 3 - 0.2 * sw.omega + sympy.Max(0, sw.HeldNoise(sw.phi, 1)),
    "a sawtooth": 3 - 0.2 * sw.omega + sw.phi - FLOOR,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", HARD)
def test_the_series_follows_steps_of_the_angle_as_the_stepper_does(name: str) -> None:
    """scipy locates every step by itself, within its tolerance of 1e-9; a missed one would be wrong by parts of one."""
    model = body(HARD[name]).compile()
    series, stepper = (model.simulate(4.0, engine=engine, rtol=1e-9, t_eval=81) for engine in ("heyoka", "scipy"))
    np.testing.assert_allclose(series["J.omega"], stepper["J.omega"], atol=1e-6)


def test_steps_in_time_are_known_before_the_run() -> None:
    """Each once, to the last rounding, and none outside the run."""
    model = body(sw.HeldNoise(sw.t / 0.3, 1) + sw.SmoothNoise(sw.t / 0.3, 2)).compile()
    found = model.switching.timeline(model.vector({}), 0.5, 3.0).times
    np.testing.assert_allclose(found, 0.3 * np.arange(2, 11), rtol=1e-14)
    assert model.switching.known(model.vector({})) == ()  # they have no end


@pytest.mark.slow
def test_noise_of_time_leaves_a_linear_network_to_the_exact_engine() -> None:
    """Between its steps it is constant: 1 kg m^2 gains the sum of all samples times the interval."""
    sol = body(sw.HeldNoise(sw.t / 0.1, 5)).simulate(100.0)
    assert sol.engine == "exact"
    assert sol["J.omega"][-1] == pytest.approx(0.1 * noise.held(np.arange(1000), 5.0).sum(), rel=1e-10)


def test_too_many_steps_are_refused_with_their_part() -> None:
    with pytest.raises(ParameterError, match=r"'m': .* switches too often"):
        body(sw.HeldNoise(1e6 * sw.t, 1)).simulate(10.0)


class Instant(float):
    """A time that counts how often it is compared."""

    def __eq__(self, other: object) -> bool:
        return float(self) == other

    def __hash__(self) -> int:
        return super().__hash__()


def _work(engine: str, samples: int) -> int:
    """Calls of functions in a run whose input steps so many times."""
    calls = 0

    def count(_frame: object, event: str, _argument: object) -> None:
        nonlocal calls
        calls += event == "call"

    steps = tuple(Instant(k / samples) for k in range(1, samples))
    rhs = {"rhs": lambda t, x: np.cos(samples * t) - x, "jacobian": lambda _t, _x: sparse.csc_array([[-1.0]])}
    problem = Problem(
        **rhs, x0=np.zeros(1), t0=0.0, t_end=1.0, names=("x",), atol=np.array([1e-6]), rtol=1e-4, breakpoints=steps
    )
    choice.solve(replace(problem, t_eval=np.array([1.0])), engine)
    sys.setprofile(count)
    try:
        choice.solve(replace(problem, t_eval=np.array([1.0])), engine)
    finally:
        sys.setprofile(None)
    return calls


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["scipy", "sundials"])
def test_a_run_of_many_samples_takes_no_more_work_for_each_of_them(engine: str) -> None:
    """Four times as many samples are four times the calls; what looked back at all before would make it more."""
    assert _work(engine, 800) < 4.2 * _work(engine, 200)
