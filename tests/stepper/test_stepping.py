"""Many steps are one motion: with events inside them, with inputs set between them, saved and restored."""

from __future__ import annotations

import pickle
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import assume, given
from sympy import Piecewise, sin

import shaftwork as sw
from shaftwork.scenes import SCENES
from shaftwork.stepper.simulation import Simulation
from tests.properties.examples import compiled, processor_time_limit, share_of_examples
from tests.reference.mna import Piece
from tests.strategies import Network, networks

RTOL = 1e-11  # errors of a hundred steps add up to less than 1e-9
LEVELS = (0.0, 10.0, -4.0, 7.5, 0.0, 3.0)
HOLD, STEPS = 0.15, 3  # s that a level holds, and steps in it
T = sw.t


def stairs() -> Piecewise:
    """The levels as one law of time."""
    return Piecewise(*((level, (k + 1) * HOLD > T) for k, level in enumerate(LEVELS[:-1])), (LEVELS[-1], True))


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
    "laws of time": lambda tau: two_masses(
        tau, (sw.TorqueSource("w", tau=sin(20 * T) + sw.Step(2.0, start=0.2)), "wheel")
    ),
    "noise": lambda tau: two_masses(tau, (sw.RandomLoad("load", mean=2.0, std=1.0, interval=0.04, seed=1.0), "wheel")),
    "dependent inertia": geared,
}


def error(value: object, course: np.ndarray, k: int) -> float:
    return float(np.max(np.abs(np.asarray(value) - course[k])) / np.abs(course).max())


def followed(run: Simulation, wanted: sw.Solution, name: str) -> float:
    """Set a level, make some steps; the largest difference of speeds and torque from one run."""
    worst, k = 0.0, 0
    for level in LEVELS:
        run.set(name, level)
        for _ in range(STEPS):
            run.step(HOLD / STEPS)
            k += 1
            worst = max(worst, *(error(run[one], wanted[one], k) for one in ("J1.omega", "J2.omega", "shaft.tau")))
    return worst


def course(run: Simulation, names: tuple[str, ...], steps: int, dt: float) -> list[list[object]]:
    values = []
    for _ in range(steps):
        run.step(dt)
        values.append([run[name] for name in names])
    return values


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_steps_of_a_scene_are_one_run_and_come_back_to_the_last_bit(name: str) -> None:
    scene, steps = SCENES[name], 40
    model, end = scene().compile(), min(scene.t_end, 10.0 if name.startswith(("crane", "six", "excavator")) else 0.5)
    wanted = model.simulate(end, rtol=RTOL, t_eval=steps + 1)
    run = model.start(rtol=RTOL)
    first = course(run, scene.signals, steps // 2, end / steps)
    state = pickle.loads(pickle.dumps(run.save_state()))  # noqa: S301
    second = course(run, scene.signals, steps // 2, end / steps)
    run.restore(state)
    assert run.t == pytest.approx(end / 2, rel=1e-15)
    assert course(run, scene.signals, steps // 2, end / steps) == second
    for signal, values in zip(scene.signals, zip(*first, *second, strict=True), strict=True):
        for k, value in enumerate(values, 1):
            assert error(value, wanted[signal], k) < 1e-9, (signal, k)


@pytest.mark.parametrize("engine", ["auto", "numba", "scipy"])
@pytest.mark.parametrize(
    "name", [name if name == "gap" else pytest.param(name, marks=pytest.mark.slow) for name in NETWORKS]
)
def test_an_input_that_is_set_acts_as_a_law_with_its_steps(name: str, engine: str) -> None:
    net = NETWORKS[name]
    wanted = net(stairs()).compile().simulate(len(LEVELS) * HOLD, rtol=RTOL, t_eval=len(LEVELS) * STEPS + 1)
    run = net(0.0).compile().start(inputs=["motor.tau"], rtol=RTOL, engine=engine)
    assert followed(run, wanted, "motor.tau") < 1e-9


@pytest.mark.slow
@share_of_examples(0.5)
@given(networks(max_inertias=8))
def test_inputs_of_random_networks_act_as_laws_with_their_steps(pieces: Network) -> None:
    """Tolerance 1e-7 of the largest speed, as that of the reference: its engine is exact, these are adaptive."""
    sources = [piece for piece in pieces if piece.type == "TorqueSource"]
    assume(sources)
    name, levels = sources[0].name, [sources[0].values["tau"] * level for level in LEVELS]
    law = Piecewise(*((v, (k + 1) * HOLD > T) for k, v in enumerate(levels[:-1])), (levels[-1], True))
    driven = tuple(Piece(p.type, p.name, p.nodes, {"tau": law}) if p.name == name else p for p in pieces)
    with processor_time_limit(60.0):
        wanted = compiled(driven).simulate(len(LEVELS) * HOLD, t_eval=len(LEVELS) + 1, engine="exact")
        run = compiled(pieces).start(inputs=[f"{name}.tau"], rtol=RTOL)
        largest = np.abs(wanted.x).max()
        for k, level in enumerate(levels, 1):
            run.set(f"{name}.tau", level)
            run.step(HOLD)
            for state, values in zip(wanted.states, wanted.x[k], strict=True):
                assert abs(run[state] - values) <= 1e-7 * largest, (state, k)


def test_a_speed_that_is_set_is_an_impulse_to_what_is_joined_to_it() -> None:
    net = sw.Network("prescribed")
    net.add(sw.SpeedSource("drive", omega=sin(T)), "a")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Spring("shaft", c=100.0, d=1.0), "a", "b")
    net.add(sw.Inertia("J2", J=3.0), "b")
    run = net.compile().start(rtol=RTOL)
    course(run, (), 7, 0.1)
    run.set("drive.omega", 2.0)
    assert run["J1.omega"] == 2.0
    course(run, (), 5, 0.1)
    net.replace(sw.SpeedSource("drive", omega=Piecewise((sin(T), T < 0.7), (2.0, True))))
    with pytest.warns(sw.NetworkWarning, match="impulse"):
        wanted = net.compile().simulate(1.2, rtol=RTOL)
    assert run["shaft.tau"] == pytest.approx(wanted["shaft.tau"][-1], rel=1e-9)


def test_an_input_holds_its_law_until_it_is_set() -> None:
    model = two_masses(sw.Step(10.0, start=0.2)).compile()
    run, other = model.start(inputs=["motor.tau"], rtol=RTOL), model.start(rtol=RTOL)
    assert course(run, ("J1.omega",), 5, 0.1) == course(other, ("J1.omega",), 5, 0.1)
    assert run["motor.tau"] == 10.0
    run.set("motor.tau", 4.0)
    assert run["motor.tau"] == 4.0


def test_parameters_are_set_as_a_motion_goes_on_with_others() -> None:
    """A damping of zero, and one that is none any more, are other equations."""
    model = two_masses(10.0).compile()
    run, motion, values = model.start(rtol=RTOL), model.simulate(0.1, rtol=RTOL), {}
    run.step(0.1)
    for name, value in (("shaft.d", 0.0), ("J2.J", 5.0), ("shaft.d", 2.0), ("motor.tau", 0.0), ("shaft.c", 70.0)):
        values[name] = value
        motion = model.simulate(motion.t[-1] + 0.1, initial=motion, parameters=values, rtol=RTOL)
        run.set(name, value)
        run.step(0.1)
        assert run["shaft.tau"] == pytest.approx(motion["shaft.tau"][-1], rel=1e-9)
        assert run["J2.omega"] == pytest.approx(motion["J2.omega"][-1], rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_what_is_set_by_chance_acts_as_in_runs_one_after_another(seed: int) -> None:
    """Torques, dampings, masses and ratios change at once; looking, saving and restoring change nothing."""
    net = NETWORKS["gap"](1.1)  # with 1.0 the gap closes at the end of a step, where `simulate` tells what was before
    net.add(sw.Brake("brake", tau=3.0, t_on=0.7), "wheel")
    net.add(sw.Gear("gear", ratio=2.0), "wheel", "slow")
    net.add(sw.Spring("rope", c=90.0, d=0.5), "slow", "end")
    net.add(sw.Inertia("J3", J=1.0), "end")
    ranges = {
        "motor.tau": (-15, 15),
        "load.tau": (0.5, 4),
        "J3.J": (0.5, 2),
        "rope.d": (0.1, 1),
        "gear.ratio": (1.5, 2.5),
    }
    chance, model = np.random.default_rng(seed), net.compile()
    run, motion, values = model.start(inputs=["motor.tau"], rtol=RTOL), None, dict[str, float]()
    for _ in range(30):
        if chance.random() < 0.5:
            name = str(chance.choice([*ranges]))
            values[name] = float(chance.uniform(*ranges[name]))
            run.set(name, values[name])
        assert chance.random() < 0.7 or run["J2.omega"] is not None
        if chance.random() < 0.2:
            run.restore(run.save_state())
        run.step(float(chance.choice([0.01, 0.05, 0.1])))
        motion = model.simulate(run.t, initial=motion, parameters=values, rtol=RTOL, t_eval=2)
        for one in ("J1.omega", "J3.omega", "shaft.tau", "rope.tau"):
            assert run[one] == pytest.approx(motion[one][-1], abs=1e-7)


@pytest.mark.parametrize("name", ["brake", "noise", "dependent inertia"])
def test_every_quantity_is_that_of_the_motion(name: str) -> None:
    """Tolerance 1e-9 of the largest value of a quantity, or of 1."""
    model = NETWORKS[name](7.0).compile()
    wanted = model.simulate(0.43, rtol=RTOL)
    run = model.start(rtol=RTOL)
    course(run, (), 43, 0.01)
    assert {*wanted.names} == {*run.names}
    for one in run.names:
        assert abs(run[one] - wanted[one][-1]) < 1e-9 * max(1.0, np.abs(wanted[one]).max()), one


def test_looking_changes_no_bit() -> None:
    model = NETWORKS["gap"](0.0).compile()
    runs = model.start(inputs=["motor.tau"]), model.start(inputs=["motor.tau"])
    for k in range(40):
        for run, looks in zip(runs, (False, True), strict=True):
            run.set("motor.tau", 9.0 * (-1.0) ** (k // 7))
            assert not looks or [run[name] for name in run.names]
            run.step(0.03)
            assert not looks or run.save_state().t == run.t
    assert [runs[0][name] for name in runs[0].names] == [runs[1][name] for name in runs[1].names]


@pytest.mark.parametrize("engine", ["numba", "scipy", pytest.param("sundials", marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["gap", pytest.param("brake", marks=pytest.mark.slow)])
def test_every_engine_comes_back_to_the_last_bit(name: str, engine: str) -> None:
    names = ("J1.omega", "J2.omega", "shaft.tau")

    def start() -> Simulation:
        return NETWORKS[name](5.0).compile().start(inputs=["motor.tau"], engine=engine)

    def on(run: Simulation) -> list[list[object]]:
        run.set("motor.tau", 9.0)
        return course(run, names, 20, 0.02)

    run = start()
    course(run, names, 20, 0.02)
    state = pickle.loads(pickle.dumps(run.save_state()))  # noqa: S301
    wanted, other = on(run), start()
    for again in (run, run, other):
        again.restore(state)
        assert on(again) == wanted


@pytest.mark.parametrize("engine", ["heyoka", "numba"])
def test_limits_that_move_with_time_come_back_to_the_last_bit(engine: str) -> None:
    """They are integrated beside the motion, with tolerances that depend on where a span began."""
    net = sw.Network("one way")
    net.add(sw.TorqueSource("motor", tau=6.0 * sin(9.0 * T)), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Freewheel("free"), "a", "b")
    net.add(sw.Inertia("J2", J=0.7), "b")
    net.add(sw.CoulombLoad("load", tau=1.0), "b")
    run = net.compile().start(rtol=RTOL, engine=engine)
    for k in range(60):
        course(run, (), 1 + k % 3, 0.031)
        state = run.save_state()
        wanted = course(run, ("J1.omega", "J2.omega"), 3, 0.031)
        run.restore(state)
        assert course(run, ("J1.omega", "J2.omega"), 3, 0.031) == wanted


def test_modes_are_those_of_now() -> None:
    run = NETWORKS["friction"](0.0).compile().start(inputs=["motor.tau"])
    assert run.modes == {"load": "stuck"}
    run.set("motor.tau", 30.0)
    course(run, (), 10, 0.1)
    assert run.modes == {"load": "slipping forward"}
    assert run.modes == NETWORKS["friction"](30.0).simulate(1.0).phases[-1].modes


def test_a_stepped_motion_goes_on_from_another_one() -> None:
    model = NETWORKS["gap"](5.0).compile()
    motion, whole = model.simulate(0.5, rtol=RTOL), model.simulate(0.9, rtol=RTOL)
    run = model.start(initial=motion, rtol=RTOL)
    assert run.t == 0.5
    course(run, (), 4, 0.1)
    assert run["J2.omega"] == pytest.approx(whole["J2.omega"][-1], rel=1e-9)


@pytest.mark.slow
def test_steps_follow_travelling_waves() -> None:
    shaft = sw.Shaft("shaft", length=10.0, diameter=0.1, model=sw.Wave())
    wanted = two_masses(stairs(), shaft=shaft).compile()
    wanted = wanted.simulate(len(LEVELS) * HOLD, rtol=RTOL, t_eval=len(LEVELS) * STEPS + 1)
    run = two_masses(0.0, shaft=shaft).compile().start(inputs=["motor.tau"], rtol=RTOL)
    assert followed(run, wanted, "motor.tau") < 1e-9


def test_what_waves_hold_is_told_after_setting_and_restoring() -> None:
    """A wave is not in the states of an instant: its energy and power are those of the motion that goes on."""
    shaft = sw.Shaft("shaft", length=10.0, diameter=0.1, model=sw.Wave())
    run, names = two_masses(5.0, shaft=shaft).compile().start(), ("shaft.energy", "shaft.power", "shaft.tau_b")
    run.step(0.01)
    before = [run[name] for name in names if run.names]
    state = run.save_state()
    run.set("motor.tau", 1.0)
    assert [run[name] for name in names] == pytest.approx(before, rel=1e-9)
    run.step(0.01)
    run.restore(state)
    assert [run[name] for name in names] == pytest.approx(before, rel=1e-9)


def test_a_hundred_hundredths_are_one() -> None:
    run = two_masses(1.0).compile().start()
    course(run, (), 100, 0.01)
    assert run.t == 1.0


@pytest.mark.parametrize(
    ("wrong", "error", "words"),
    [
        (lambda run: run.set("motor.omega", 1.0), sw.ParameterError, r"no input or parameter 'motor.omega'.*motor.tau"),
        (lambda run: run.set("engine.tau", 1.0), sw.ParameterError, r"There are: motor.tau, J1.J"),
        (lambda run: run.set(["motor.tau"], 1.0), sw.ParameterError, "no input or parameter"),
        (lambda run: run.set("motor.tau", float("nan")), sw.ParameterError, "must be a finite number"),
        (lambda run: run.set("motor.tau", sin(T)), sw.ParameterError, "must be a number here"),
        (lambda run: run.set("J1.J", -1.0), sw.ParameterError, "must be"),
        (lambda run: run.set("J1.J", 0.0), sw.CompileError, "inertia matrix of the parts 'J1' is singular"),
        (lambda run: run.step(0.0), sw.ParameterError, "dt = 0.0 must be above 0"),
        (lambda run: run.step(-1.0), sw.ParameterError, "above 0"),
        (lambda run: run.step(float("nan")), sw.ParameterError, "finite"),
        (lambda run: run.step(1e-30), sw.ParameterError, "lost in the rounding"),
        (lambda run: run["J2.omgea"], sw.SignalError, "'J2' has: J2.omega"),
        (lambda run: run["J2.phi"], sw.SignalError, "recorded when asked for"),
        (lambda run: run.restore("state"), sw.ParameterError, "str is no state"),
        (
            lambda run: run.restore(geared(1.0).compile().start().save_state()),
            sw.ParameterError,
            "another network than 'two masses'",
        ),
    ],
)
def test_what_is_wrong_is_said_and_changes_nothing(
    wrong: Callable[[Simulation], object], error: type[Exception], words: str
) -> None:
    run = two_masses(3.0).compile().start()
    run.step(1.0)
    before = [run[name] for name in run.names]
    with pytest.raises(error, match=words):
        wrong(run)
    assert [run[name] for name in run.names] == before
    run.step(0.1)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"inputs": ["motor.omega"]}, "no input or parameter"),
        ({"inputs": 3}, "no name"),
        ({"engine": "rk4"}, "no engine 'rk4'"),
        ({"parameters": {"shaft.k": 3.0}}, "no input or parameter"),
        ({"parameters": 3.0}, "must map names"),
        ({"rtol": -1.0}, "rtol"),
        ({"t_start": "now"}, "t_start"),
        ({"initial": 3.0}, "must map"),
        ({"t_eval": 3}, r"start\(\) has no option 't_eval'. It has: inputs, t_start"),
    ],
)
def test_wrong_options_are_refused_at_the_start(options: dict[str, object], words: str) -> None:
    with pytest.raises(sw.ParameterError, match=words):
        two_masses(3.0).compile().start(**options)


def test_a_motion_that_has_failed_says_so_until_it_is_restored() -> None:
    net = sw.Network("runs away")
    net.add(sw.TorqueSource("motor", tau=sw.omega**2 + 1.0), "a")  # omega = tan(t), with a pole at pi / 2
    net.add(sw.Inertia("J", J=1.0), "a")
    run = net.compile().start()
    run.step(1.0)
    state = run.save_state()
    with pytest.raises(sw.SimulationError, match=r"failed at t = 1\.57"):
        run.step(1.0)
    assert run.t == 1.0
    with pytest.raises(sw.SimulationError, match=r"has failed before and stands at t = 1 s.*Restore"):
        run.step(0.1)
    with pytest.raises(sw.SimulationError, match="has failed before"):
        run.set("J.J", 2.0)
    run.restore(state)
    run.step(0.1)
    assert run["J.omega"] == pytest.approx(np.tan(1.1), rel=1e-7)
