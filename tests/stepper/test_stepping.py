"""Many steps are one motion: with events inside them, with inputs set between them, saved and restored."""

from __future__ import annotations

import pickle
from collections.abc import Callable

import numpy as np
import pytest
from sympy import Piecewise, sin

import shaftwork as sw
from shaftwork.scenes import SCENES

RTOL = 1e-11  # errors of a hundred steps add up to less than 1e-9
LEVELS = (0.0, 10.0, -4.0, 7.5, 0.0, 3.0)
HOLD, STEPS = 0.15, 3  # s that a level holds, and steps in it
T = sw.t


def stairs(levels: tuple[float, ...] = LEVELS) -> Piecewise:
    """The levels as one law of time."""
    return Piecewise(*((level, (k + 1) * HOLD > T) for k, level in enumerate(levels[:-1])), (levels[-1], True))


def two_masses(tau: object, *others: tuple[object, str], shaft: object = None) -> sw.Network:
    net = sw.Network("two masses")
    net.add(sw.TorqueSource("motor", tau=tau), "rotor")
    net.add(sw.Inertia("J1", J=2.0), "rotor")
    net.add(shaft or sw.Spring("shaft", c=100.0, d=1.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=3.0), "wheel")
    for part, node in others:
        net.add(part, node)
    return net


def geared(tau: object) -> sw.Network:
    net = two_masses(tau)
    net.add(sw.Gear("gear", ratio=3.0), "wheel", "slow")
    net.add(sw.Inertia("J3", J=5.0), "slow")  # no state: it turns with J2
    return net


NETWORKS: dict[str, Callable[[object], sw.Network]] = {
    "linear": two_masses,
    "friction": lambda tau: two_masses(tau, (sw.CoulombLoad("load", tau=4.0), "wheel")),
    "brake": lambda tau: two_masses(tau, (sw.Brake("brake", tau=20.0, t_on=0.37), "rotor")),
    "gap": lambda tau: two_masses(
        tau, (sw.CoulombLoad("load", tau=1.0), "wheel"), shaft=sw.Backlash("shaft", c=100.0, d=1.0, gap=0.02)
    ),
    "angle": lambda tau: two_masses(tau, (sw.TorqueSource("weight", tau=-5 * sin(sw.phi)), "wheel")),
    "laws of time": lambda tau: two_masses(tau, (sw.TorqueSource("w", tau=sin(20 * T) + sw.Step(2.0, start=0.2)), "wheel")),
    "noise": lambda tau: two_masses(tau, (sw.RandomLoad("load", mean=2.0, std=1.0, interval=0.04, seed=1.0), "wheel")),
    "dependent inertia": geared,
}


def error(value: object, course: np.ndarray, k: int) -> float:
    return float(np.max(np.abs(np.asarray(value) - course[k])) / np.abs(course).max())


def followed(run: sw.Simulation, wanted: sw.Solution, name: str, levels: tuple[float, ...] = LEVELS) -> float:
    """Set a level, make some steps; the largest difference of speeds and torque from one run."""
    worst, k = 0.0, 0
    for level in levels:
        run.set(name, level)
        for _ in range(STEPS):
            run.step(HOLD / STEPS)
            k += 1
            worst = max(worst, *(error(run[one], wanted[one], k) for one in ("J1.omega", "J2.omega", "shaft.tau")))
    return worst


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_steps_of_a_scene_are_one_run(name: str) -> None:
    scene, steps = SCENES[name], 40
    model, end = scene().compile(), min(scene.t_end, 10.0)
    wanted = model.simulate(end, rtol=RTOL, t_eval=steps + 1)
    run = model.start(rtol=RTOL)
    for k in range(1, steps + 1):
        run.step(end / steps)
        for one in scene.signals:
            assert error(run[one], wanted[one], k) < 1e-9, (one, run.t)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_a_restored_scene_goes_on_to_the_last_bit(name: str) -> None:
    model, dt = SCENES[name]().compile(), min(SCENES[name].t_end, 10.0) / 200
    run = model.start()

    def course(steps: int) -> list[tuple[float, ...]]:
        values = []
        for _ in range(steps):
            run.step(dt)
            values.append(tuple(run[one] for one in run.names[:12]))
        return values

    course(7)
    state, first = pickle.loads(pickle.dumps(run.save_state())), course(9)  # noqa: S301
    run.restore(state)
    assert run.t == state.t
    assert course(9) == first
    run.restore(run.save_state())
    assert course(3) == (course(3) if False else _again(run, state, 12, dt))


def _again(run: sw.Simulation, state: object, steps: int, dt: float) -> list[tuple[float, ...]]:
    run.restore(state)
    values = []
    for _ in range(steps):
        run.step(dt)
        values.append(tuple(run[one] for one in run.names[:12]))
    return values[-3:]


@pytest.mark.parametrize("engine", ["auto", "scipy"])
@pytest.mark.parametrize("name", NETWORKS)
def test_an_input_that_is_set_acts_as_a_law_with_its_steps(name: str, engine: sw.EngineName) -> None:
    net = NETWORKS[name]
    wanted = net(stairs()).compile().simulate(len(LEVELS) * HOLD, rtol=RTOL, t_eval=len(LEVELS) * STEPS + 1)
    run = net(0.0).compile().start(inputs=["motor.tau"], rtol=RTOL, engine=engine)
    assert followed(run, wanted, "motor.tau") < 1e-9
