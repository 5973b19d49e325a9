"""Networks, models, motions and results can be pickled and copied, and read the same afterwards."""

from __future__ import annotations

import copy
import multiprocessing
import pickle
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.studies import frequency_sensitivities, motion_sensitivities, sweep


def pickled(made: Any) -> Any:
    """What is read back of something that was written."""
    return pickle.loads(pickle.dumps(made))  # noqa: S301 (written here)


WAYS: dict[str, Callable[[Any], Any]] = {
    "pickled": pickled,
    "copied": copy.deepcopy,
}
LONG = {"length": 1.0, "diameter": 0.02, "density": 7900.0, "shear_modulus": 77.5e9}


def train(shaft: sw.Component | None = None) -> sw.Network:
    """A motor, a shaft and a load."""
    net = sw.Network("train")
    net.add(sw.TorqueSource("motor", tau=sw.Step(10.0, start=0.01)), "rotor")
    net.add(sw.Inertia("J1", J=2.0), "rotor")
    net.add(shaft or sw.Spring("shaft", c=1e4, d=1.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=3.0), "wheel")
    return net


def looped() -> sw.Network:
    """A train with a nonlinear damper in series: a loop that has to be solved."""
    net = train()
    net.add(sw.TorqueSource("seal", tau=-sympy.tanh(sw.omega) - sw.omega), "end")
    net.add(sw.Damper("film", d=0.5), "wheel", "end")
    return net


NETWORKS: dict[str, Callable[[], sw.Network]] = {
    "linear": train,
    "hybrid": lambda: sw.scenes.crane(gap=0.01),
    "wave": lambda: train(sw.Shaft("shaft", **LONG, model=sw.Wave())),
    "chain": lambda: train(sw.Shaft("shaft", **LONG, model=sw.Lumped(20))),
}
ENGINES = {
    "linear": ("auto", "scipy", "scipy-radau", "heyoka", "sundials", "exact", "banded"),
    "hybrid": ("auto", "scipy", "sundials"),
    "wave": ("auto",),
    "chain": ("auto", "banded"),
}
SPANS = {"linear": 0.2, "hybrid": 0.2, "wave": 0.03, "chain": 0.002}
"""s; a wave crosses the shaft in 0.3 ms."""
RUNS = [pytest.param(kind, engine, id=f"{kind}-{engine}") for kind, engines in ENGINES.items() for engine in engines]


@cache
def model_of(kind: str) -> Any:
    return NETWORKS[kind]().compile()


def same(first: Any, second: Any) -> bool:
    """Whether two values are equal, arrays and mappings to the last bit."""
    if isinstance(first, Mapping):
        return list(first) == list(second) and all(same(first[key], second[key]) for key in first)
    if isinstance(first, np.ndarray):
        return np.array_equal(first, second, equal_nan=True)
    return bool(first == second)


def read(sol: sw.Solution) -> dict[str, Any]:
    """All that can be read of a motion."""
    between = np.linspace(sol.t[0], sol.t[-1], 77)
    other = sol.at(between)
    torque = next(name for name in sol if name.endswith(("shaft.tau", "shaft.tau_a")))
    return {
        "rows": {name: sol[name] for name in (*sol, *sol.places)},
        "between": {name: other[name] for name in (*other, *other.places)},
        "steps": sol.steps,
        "residual": sol.energy_residual,
        "tables": (sol.events, sol.phases, sol.engine, sol.why, sol.states),
        "parameters": dict(sol.parameters),
        "cycles": str(sol.rainflow(torque)),
    }


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("kind", "engine"), RUNS)
def test_a_stored_motion_reads_the_same(kind: str, engine: str, way: str) -> None:
    sol = model_of(kind).simulate(SPANS[kind], t_eval=50, engine=engine)
    again = WAYS[way](sol)
    assert np.array_equal(again.x, sol.x)
    stored, first = read(again), read(sol)
    assert [name for name in first if not same(stored[name], first[name])] == []


@pytest.mark.slow
def test_a_stored_motion_can_be_stored_again() -> None:
    sol = model_of("hybrid").simulate(0.2, t_eval=50)
    assert same(read(pickled(pickled(sol))), read(sol))


@pytest.mark.parametrize("t_eval", ["steps", [0.0, 0.05, 0.2], None], ids=str)
def test_a_motion_at_other_times_with_other_values_is_stored_with_its_call(t_eval: Any) -> None:
    model = model_of("linear")
    sol = model.simulate(
        0.2, t_eval=t_eval, initial={"J1.omega": 3.0}, parameters={"shaft.c": 2e4, "shaft.d": 0.0}, rtol=1e-6
    )
    assert same(read(WAYS["pickled"](sol)), read(sol))


@pytest.mark.slow
def test_a_motion_with_a_loop_reads_the_same_when_stored() -> None:
    sol = looped().simulate(0.1, algebraic_loops="solve", t_eval=11)
    assert same(WAYS["pickled"](sol)["film.tau"], sol["film.tau"])


def test_a_stored_motion_is_not_compiled_before_more_of_it_is_read() -> None:
    again = pickled(model_of("linear").simulate(0.1))
    assert again.x.shape == (1001, 3)
    assert not {"dense", "observer"} & vars(again).keys()


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", NETWORKS)
def test_a_stored_model_moves_as_the_first(kind: str, way: str) -> None:
    model = model_of(kind)
    again = WAYS[way](model)
    assert again.states == model.states
    assert dict(again.parameters) == dict(model.parameters)
    x = np.linspace(1.0, 2.0, len(model.states))
    if kind == "hybrid":
        name = model.simulate(0.05).phases[0].name
        first, other = model.phase(name), again.phase(name)
        x = np.linspace(1.0, 2.0, len(first.states))
        assert np.array_equal(other.rhs(0.5, x), first.rhs(0.5, x))
    elif kind != "wave":
        assert np.array_equal(again.rhs(0.5, x), model.rhs(0.5, x))
    assert np.array_equal(again.simulate(0.05, t_eval=9).x, model.simulate(0.05, t_eval=9).x)


def test_models_of_one_stored_network_are_one_model() -> None:
    model = train().compile(angles=("J2",))
    again = pickled(model)
    assert "J2.phi" in again.states
    assert pickled(model.simulate(0.1))["J2.phi"].size == 1001


def results() -> dict[str, tuple[Any, Callable[[Any], Any]]]:
    """Every other kind of result, and what is compared of it."""
    net, model = train(), model_of("linear")
    hybrid, wave = NETWORKS["hybrid"](), NETWORKS["wave"]()
    f, sn = np.linspace(1.0, 30.0, 7), sw.SNLine(amplitude=10.0, cycles=1e6, slope=5)
    sol = model.simulate(0.2)

    def small(made: Any) -> Any:
        return made.A, made.D, made.modes().frequencies, made.frequency_response("motor.tau", "shaft.tau", f).values

    def modes(made: Any) -> Any:
        return made.frequencies, made.damping, {name: made.shapes[name] for name in made.shapes}, str(made)

    return {
        "network": (net, lambda made: made.netlist()),
        "netlist": (net.netlist(), lambda made: made),
        "graph": (net.graph(), lambda made: (made.nodes, made.wiring, [str(b.template.law) for b in made.branches])),
        "equations": (net.equations(), lambda made: made.latex(values=True)),
        "equations in a phase": (hybrid.equations(), lambda made: made.latex(phase=hybrid_phase(hybrid))),
        "lagrangian": (net.lagrangian(), lambda made: made.latex()),
        "linear model": (model.linearize(), small),
        "linear model of a loop": (
            looped().compile(algebraic_loops="solve").linearize(),
            lambda made: (made.A, made.C),
        ),
        "modes": (net.modes(), modes),
        "exact modes": (wave.modes(f_max=2000.0), modes),
        "frequency response": (net.frequency_response("motor.tau", "shaft.tau", f), lambda made: (made.f, made.values)),
        "exact frequency response": (
            wave.frequency_response("motor.tau", "shaft.tau_a", f),
            lambda made: (made.f, made.values),
        ),
        "campbell": (net.campbell([1.0, 50.0]), lambda made: (made.frequencies, made.crossings)),
        "energy": (sol.energy, lambda made: made.residual),
        "rainflow": (sol.rainflow("shaft.tau"), str),
        "damage": (sol.damage("shaft.tau", sn=sn), lambda made: made.damage),
        "sn line": (sn, lambda made: made),
        "sweep": (
            sweep(net, {"shaft.c": [1e3, 1e4]}, t_end=0.1, measures={"peak": "max shaft.tau"}),
            str,
        ),
        "frequency sensitivities": (
            frequency_sensitivities(net, parameters=["shaft.c"]),
            lambda made: made.of_frequencies,
        ),
        "motion sensitivities": (
            motion_sensitivities(net, {"peak": "max shaft.tau"}, t_end=0.1, parameters=["shaft.c"]),
            lambda made: made["peak"],
        ),
        "referred": (sw.reduce.refer(net, to="wheel"), lambda made: (made.network.netlist(), str(made.table))),
        "simplified": (
            sw.reduce.simplify(net, masses=2, keep="shaft"),
            lambda made: (made.network.netlist(), str(made.table)),
        ),
        "duty": (sw.sizing.duty(sol, "motor"), str),
    }


def hybrid_phase(net: sw.Network) -> str:
    return net.simulate(0.5).phases[0].name


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_every_result_reads_the_same_when_stored(way: str) -> None:
    differ = [name for name, (made, facts) in results().items() if not _alike(facts(WAYS[way](made)), facts(made))]
    assert differ == []


def _alike(first: Any, second: Any) -> bool:
    if isinstance(first, tuple):
        return len(first) == len(second) and all(map(_alike, first, second))
    return same(first, second)


def _peak(model: Any, stiffness: float) -> sw.Solution:
    return model.simulate(0.1, parameters={"shaft.c": stiffness})


@pytest.mark.parametrize("start", ["fork", pytest.param("spawn", marks=pytest.mark.slow)])
def test_motions_come_back_from_other_processes(start: str) -> None:
    model, values = model_of("linear"), [1e3, 1e4]
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context(start)) as pool:
        motions = list(pool.map(_peak, [model, model], values))
    for sol, stiffness in zip(motions, values, strict=True):
        own = _peak(model, stiffness)
        assert same(sol["shaft.tau"], own["shaft.tau"])
        assert same(sol.at([0.033])["J2.omega"], own.at([0.033])["J2.omega"])


def test_a_stored_network_is_printed_as_before() -> None:
    """A record that is the default is not listed, also where it was read again."""
    net = sw.scenes.excavator()
    assert repr(pickle.loads(pickle.dumps(net))) == repr(net)  # noqa: S301


def test_equations_with_speeds_that_no_store_fixes_are_stored() -> None:
    equations = sw.scenes.bldc_shaft().equations()
    assert str(pickle.loads(pickle.dumps(equations))) == str(equations)  # noqa: S301
