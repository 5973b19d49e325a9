"""A sweep on the workers of a cluster: the same bits as in one process, also where workers are lost."""

from __future__ import annotations

import os
import re
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.sweep.cluster import libraries, measured
from shaftwork.sweep.sweep_store import Store
from shaftwork.sweep.sweep_task import Chunk
from tests.faults.killed import stored

dask, distributed = pytest.importorskip("dask"), pytest.importorskip("distributed")
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]  # of the cluster, about workers that are lost


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


def samples(count: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    return {"shaft.c": rng.uniform(2e4, 3e4, count), "shaft.d": rng.uniform(10.0, 20.0, count)}


def slipping() -> sw.Network:
    """Two inertias that a torque turns, one behind a damper."""
    net = sw.Network("slipping")
    net.add(sw.TorqueSource("motor", tau=400.0), "a")
    net.add(sw.Inertia("J1", J=27.35), "a")
    net.add(sw.Damper("oil", d=200.0), "a", "b")
    net.add(sw.Inertia("J2", J=62.5), "b")
    return net


MEASURES = ["max shaft.tau", "end J2.omega", "rms shaft.tau"]


def test_the_cluster_gives_the_bits_of_one_process(client: Any) -> None:
    call: dict[str, Any] = {"samples": samples(5000), "t_end": 2.0, "measures": MEASURES}
    one = sw.studies.sweep(sw.scenes.crane_start(), processes=1, **call)
    many = sw.studies.sweep(sw.scenes.crane_start(), on=client, **call)
    assert one.why == many.why
    for name in MEASURES:
        assert one.measures[name].tobytes() == many.measures[name].tobytes()


def test_a_call_brings_hardly_more_than_it_does(client: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Dask keeps the last 1000 messages: those of slow variants must not each bring all that is still to be done."""
    sent, submit = [], client.submit

    def counted(function: Any, *arguments: Any, **options: Any) -> Any:
        sent.append(arguments[-2].size)
        return submit(function, *arguments, **options)

    monkeypatch.setattr(client, "submit", counted)
    sw.studies.sweep(sw.scenes.crane_start(), samples=samples(8000), t_end=800.0, measures=MEASURES, on=client)
    assert sum(sent) <= 3 * 8000


def test_variants_one_by_one_and_failed_ones_are_the_same(client: Any) -> None:
    call: dict[str, Any] = {
        "samples": {"shaft.c": np.append(np.linspace(2e4, 3e4, 30), 2e4)},
        "t_end": 1.0,
        "measures": MEASURES,
        "engine": "scipy",
        "initial": {"J1.omega": 1.0},
    }
    one = sw.studies.sweep(sw.scenes.crane_start(), processes=1, **call)
    many = sw.studies.sweep(sw.scenes.crane_start(), on=client, **call)
    assert one.reasons == many.reasons
    for name in MEASURES:
        assert one.measures[name].tobytes() == many.measures[name].tobytes()


def test_workers_that_are_killed_lose_nothing(client: Any, tmp_path: Path) -> None:
    call: dict[str, Any] = {"samples": samples(60_000), "t_end": 6.5, "measures": MEASURES}
    over, kills = threading.Event(), []

    def kill() -> None:
        for number in (0, 1, 0):  # oftener, a worker would be killed before it has started, and not start again
            if over.wait(1.0):
                return
            if pid := client.cluster.workers[number].pid:
                os.kill(pid, signal.SIGKILL)
                kills.append(pid)

    killer = threading.Thread(target=kill)
    killer.start()
    try:
        many = sw.studies.sweep(sw.scenes.crane_start(), on=client, store=tmp_path / "store.sqlite", **call)
    finally:
        over.set()
        killer.join()
    assert kills
    again = sw.studies.sweep(sw.scenes.crane_start(), processes=1, store=tmp_path / "store.sqlite", **call)
    one = sw.studies.sweep(sw.scenes.crane_start(), processes=1, **call)
    for name in MEASURES:
        assert one.measures[name].tobytes() == many.measures[name].tobytes() == again.measures[name].tobytes()


@contextmanager
def at_the_first_loss() -> Iterator[Any]:
    """A client whose cluster blames a call for the first worker that is lost with it, not the fourth."""
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


def test_a_variant_at_which_workers_die_fails_and_no_other(tmp_path: Path) -> None:
    dies = True

    def ends_its_process(solution: sw.Solution) -> float:
        speed = float(solution["J2.omega"][-1])
        if dies and 1.9 < speed < 2.0:
            os.kill(os.getpid(), signal.SIGKILL)
        return speed

    call: dict[str, Any] = {
        "parameters": {"J2.J": np.linspace(50.0, 70.0, 8)},
        "t_end": 0.5,
        "measures": {"a": ends_its_process},
        "store": tmp_path / "store.sqlite",
    }
    with at_the_first_loss() as client:
        many = sw.studies.sweep(slipping(), on=client, **call)
    dies = False
    one = sw.studies.sweep(slipping(), **{**call, "store": None})
    deadly = (one.measures["a"] > 1.9) & (one.measures["a"] < 2.0)
    assert 0 < deadly.sum() < 4
    assert (many.failed == deadly).all()
    assert all(re.match("workers of the cluster were lost", many.reasons[k]) for k in np.flatnonzero(deadly))
    assert many.measures["a"][~deadly].tobytes() == one.measures["a"][~deadly].tobytes()
    again = sw.studies.sweep(slipping(), **call)
    assert again.measures["a"].tobytes() == one.measures["a"].tobytes(), "no store takes what computers have lost"


def test_workers_that_die_with_whatever_they_run_end_a_sweep() -> None:
    def ends_its_process(_: sw.Solution) -> float:
        os._exit(1)

    with (
        at_the_first_loss() as client,
        pytest.raises(sw.SimulationError, match=r"lost again and again with variant \d+, .* memory is the most common"),
    ):
        sw.studies.sweep(
            slipping(), {"J2.J": np.linspace(50.0, 70.0, 16)}, t_end=0.1, measures={"a": ends_its_process}, on=client
        )


def test_a_sweep_that_is_interrupted_leaves_the_cluster_idle_and_goes_on(
    client: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    call: dict[str, Any] = {"samples": samples(30_000), "t_end": 6.5, "measures": MEASURES}
    path = tmp_path / "store.sqlite"

    write = Store.append

    def interrupted(store: Store, chunk: Chunk) -> None:
        write(store, chunk)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Store, "append", interrupted)
        with pytest.raises(KeyboardInterrupt):
            sw.studies.sweep(sw.scenes.crane_start(), on=client, store=path, **call)
    assert 0 < len(stored(path)) < 30_000
    assert client.submit(abs, -1).result(timeout=60) == 1
    assert not client.run_on_scheduler(
        lambda dask_scheduler: [key for key in dask_scheduler.tasks if "meas" in str(key)]
    )
    many = sw.studies.sweep(sw.scenes.crane_start(), on=client, store=path, **call)
    one = sw.studies.sweep(sw.scenes.crane_start(), processes=1, **call)
    for name in MEASURES:
        assert one.measures[name].tobytes() == many.measures[name].tobytes()


def test_variants_that_switch_have_the_bits_of_one_process(client: Any) -> None:
    net = sw.Network("gap, brake and friction")
    net.add(sw.TorqueSource("motor", tau=60.0 * sympy.cos(2 * sw.t) - 0.5 * sw.omega), "rotor")
    net.add(sw.Inertia("J1", J=27.35), "rotor")
    net.add(sw.Backlash("shaft", gap=0.003, c=24206.0, d=14.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=62.5), "wheel")
    net.add(sw.Brake("brake", tau=150.0, t_on=1.0), "wheel")
    net.add(sw.DryFriction("friction", tau_c=8.0), "wheel")
    call: dict[str, Any] = {"samples": samples(3000), "t_end": 1.5, "measures": MEASURES}
    one = sw.studies.sweep(net, processes=1, **call)
    many = sw.studies.sweep(net, on=client, **call)
    assert one.why == many.why == ""
    for name in MEASURES:
        assert one.measures[name].tobytes() == many.measures[name].tobytes()


@pytest.mark.parametrize("library", ["shaftwork", "python", "numpy"])
def test_a_worker_with_other_libraries_is_refused(library: str) -> None:
    expected = {**libraries(), library: "1.0"}
    with pytest.raises(sw.SimulationError, match=rf"A worker of the cluster has {library} \d[^,]* for 1\.0, and may"):
        measured(b"", expected, "", np.arange(3), {})


def test_a_measure_that_cannot_be_sent_is_refused(client: Any) -> None:
    lock = threading.Lock()

    def locked(_: sw.Solution) -> float:
        return float(lock.locked())

    with pytest.raises(sw.ParameterError, match="A measure cannot be sent to a cluster: cannot pickle"):
        sw.studies.sweep(sw.scenes.crane_start(), {"shaft.c": [2e4]}, t_end=0.1, measures={"a": locked}, on=client)


def test_a_client_that_is_closed_is_refused(client: Any) -> None:
    closed = distributed.Client(client.scheduler.address)
    closed.close()
    with pytest.raises(sw.ParameterError, match="is asynchronous or closed"):
        sw.studies.sweep(sw.scenes.crane_start(), {"shaft.c": [2e4]}, t_end=0.1, measures=MEASURES, on=closed)


def test_a_scheduler_that_vanishes_is_an_error() -> None:
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster.scheduler_address, timeout=3) as client,
    ):
        end = threading.Timer(2.0, cluster.close)
        end.start()
        with pytest.raises(sw.SimulationError, match="scheduler of the cluster does not answer any more"):
            sw.studies.sweep(
                sw.scenes.crane_start(), samples=samples(200_000), t_end=100.0, measures=MEASURES, on=client
            )
        end.join()


def test_what_is_no_client_is_refused() -> None:
    with pytest.raises(sw.ParameterError, match=r"on = 'tcp://here' must be a client"):
        sw.studies.sweep(
            sw.scenes.crane_start(), {"shaft.c": [2e4, 3e4]}, t_end=0.1, measures=MEASURES, on="tcp://here"
        )
