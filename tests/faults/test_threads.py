"""Threads and processes: whoever runs a model beside others gets what it gets alone, to the last bit."""

from __future__ import annotations

import multiprocessing
import pickle
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import shaftwork as sw

THREADS = 8
STIFFNESSES = (20e3, 22e3, 24e3, 26e3)


@pytest.fixture(autouse=True)
def _threads_take_turns_often() -> Iterator[None]:
    usual = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    yield
    sys.setswitchinterval(usual)


def train(load: sw.Component | None = None) -> sw.Network:
    """Two inertias, a shaft and a motor whose torque falls with its speed; linear with the load that is usual."""
    net = sw.Network("train")
    net.add(sw.TorqueSource("motor", tau=50.0 - 2.0 * sw.omega), "a")
    net.add(sw.Inertia("J1", J=27.0), "a")
    net.add(sw.Spring("shaft", c=24e3, d=14.0), "a", "b")
    net.add(sw.Inertia("J2", J=62.0), "b")
    net.add(load or sw.Damper("load", d=3.0), "b", *(() if load else ("ground",)))
    return net


NETWORKS: dict[str, Callable[[], sw.Network]] = {
    "linear": train,
    "sticking": lambda: train(sw.CoulombLoad("load", tau=20.0)),
    "nonlinear": lambda: train(sw.TorqueSource("load", tau=-(sw.omega**3))),
}
ENGINES = ("auto", "scipy", "scipy-radau", "heyoka", "sundials")
RUNS = [(name, engine) for name in NETWORKS for engine in ENGINES] + [("linear", "exact"), ("linear", "banded")]


def told(solution: sw.Solution) -> tuple[Any, ...]:
    """All that a motion says, some of it read from the motion made again."""
    highest = solution.max("shaft.tau")
    half = float(solution.at(0.17)["shaft.tau"][0])
    return solution.x.tobytes(), float(highest), highest.t, half, solution.energy_residual, *solution.events


def of_stiffness(model: sw.Model, engine: Any, stiffness: float) -> tuple[Any, ...]:
    return told(model.simulate(0.3, engine=engine, parameters={"shaft.c": stiffness}))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "engine"), RUNS)
def test_threads_that_share_a_model_get_what_each_gets_alone(name: str, engine: str) -> None:
    net, stdout, filters = NETWORKS[name](), sys.stdout, list(warnings.filters)
    alone = [of_stiffness(net.compile(), engine, stiffness) for stiffness in STIFFNESSES]
    shared = net.compile()
    with ThreadPoolExecutor(THREADS) as pool:
        beside = list(pool.map(lambda c: of_stiffness(shared, engine, c), STIFFNESSES * 4))
    assert beside == alone * 4
    assert sys.stdout is stdout
    assert warnings.filters == filters


@pytest.mark.slow
def test_another_thread_gets_the_equations_of_its_own_parameters() -> None:
    """Two threads ask in turns for the rates with two stiffnesses, of a network too large for unrolled code."""
    net = sw.Network("chain")
    for k in range(70):
        net.add(sw.Inertia(f"J{k}", J=1.0), f"n{k}")
        net.add(sw.Spring(f"c{k}", c=1.0), f"n{k}", f"n{k + 1}" if k < 69 else "ground")
    model = net.compile()
    x = np.linspace(-1.0, 1.0, len(model.states))
    vectors = [model.vector({"c3.c": c}) for c in STIFFNESSES]
    alone = [model.rhs(0.0, x, p).tobytes() for p in vectors]
    with ThreadPoolExecutor(THREADS) as pool:
        beside = list(pool.map(lambda p: model.rhs(0.0, x, p).tobytes(), vectors * 25))
    assert beside == alone * 25


def studied(net: sw.Network) -> tuple[Any, ...]:
    point = {"J1.omega": 5.0, "J2.omega": 5.0}
    modes = net.modes(at=point)
    slopes = sw.studies.frequency_sensitivities(net, point)
    return modes.rates.tobytes(), modes.vectors.tobytes(), repr(slopes), net.equations().latex()


@pytest.mark.slow
def test_threads_that_compile_and_study_networks_of_their_own_find_what_one_finds() -> None:
    nets = [make for make in NETWORKS.values() for _ in range(4)]
    alone = [studied(make()) for make in nets]
    with ThreadPoolExecutor(THREADS) as pool:
        assert list(pool.map(lambda make: studied(make()), nets)) == alone


@pytest.mark.slow
def test_threads_read_one_motion_as_one_does() -> None:
    model = NETWORKS["sticking"]().compile()
    for engine in ("heyoka", "sundials"):
        alone = told(model.simulate(0.3, engine=engine))
        motion = model.simulate(0.3, engine=engine)
        with ThreadPoolExecutor(THREADS) as pool:
            assert list(pool.map(told, [motion] * 16)) == [alone] * 16


@pytest.mark.heyoka
def test_a_run_within_a_run_leaves_it_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """What `progress` calls may simulate the same model."""
    monkeypatch.setattr(
        "shaftwork.integrate.taylor.heyoka_taylor.UNINTERRUPTED", 12
    )  # else a run so short has no time for it
    model = NETWORKS["nonlinear"]().compile()
    alone = told(model.simulate(0.3, engine="heyoka"))
    within: list[tuple[Any, ...]] = []

    def look(_: float) -> None:
        within.append(of_stiffness(model, "heyoka", 22e3))

    assert told(model.simulate(0.3, engine="heyoka", progress=look)) == alone
    assert within
    assert set(within) == {of_stiffness(NETWORKS["nonlinear"]().compile(), "heyoka", 22e3)}


@pytest.mark.slow
def test_a_thread_that_mutes_warnings_mutes_no_other() -> None:
    def warned(_: int) -> int:
        net = train(sw.CoulombLoad("load", tau=20.0))
        net.add(sw.Gear("first", ratio=2.0), "b", "c")
        net.add(sw.Gear("second", ratio=3.0), "c", "b")  # nothing turns: worth a warning
        with pytest.warns(sw.NetworkWarning, match="locked"):
            net.compile()
        return 1

    before = list(warnings.filters)
    assert warned(0) == 1
    with ThreadPoolExecutor(THREADS) as pool:
        models = list(pool.map(lambda _: train(sw.CoulombLoad("load", tau=20.0)).simulate(0.1), range(16)))
    assert len(models) == 16
    assert warnings.filters == before
    assert warned(0) == 1


def in_child(stored: bytes, stiffness: float) -> tuple[Any, ...]:
    return of_stiffness(pickle.loads(stored), "auto", stiffness)  # noqa: S301 (of our own making)


@pytest.mark.slow
@pytest.mark.parametrize("start", ["fork", "spawn"])
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_models_in_other_processes_move_as_here(start: str) -> None:
    models: Mapping[str, sw.Model] = {name: make().compile() for name, make in NETWORKS.items()}
    context = multiprocessing.get_context(start)
    with ProcessPoolExecutor(2, context) as pool:
        for model in models.values():
            stored = pickle.dumps(model)
            found = [pool.submit(in_child, stored, c) for c in STIFFNESSES[:2]]
            assert [one.result() for one in found] == [of_stiffness(model, "auto", c) for c in STIFFNESSES[:2]]
