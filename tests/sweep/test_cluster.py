"""A sweep on the workers of a cluster: the same bits as in one process, also where workers are lost."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shaftwork as sw
from shaftwork.sweep.cluster import libraries, measured

distributed = pytest.importorskip("distributed")
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


MEASURES = ["max shaft.tau", "end J2.omega", "rms shaft.tau"]


def test_the_cluster_gives_the_bits_of_one_process(client: Any) -> None:
    call: dict[str, Any] = {"samples": samples(5000), "t_end": 2.0, "measures": MEASURES}
    one = sw.studies.sweep(sw.scenes.crane_start(), processes=1, **call)
    many = sw.studies.sweep(sw.scenes.crane_start(), on=client, **call)
    assert one.why == many.why
    for name in MEASURES:
        assert one.measures[name].tobytes() == many.measures[name].tobytes()


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


def test_a_variant_at_which_workers_die_is_named(client: Any) -> None:
    def ends_its_process(solution: sw.Solution) -> float:
        if solution["J1.omega"][-1] > 1.0:
            os.kill(os.getpid(), signal.SIGKILL)
        return 0.0

    with pytest.raises(sw.SimulationError, match=r"lost again and again with variant 0: .* memory is the most common"):
        sw.studies.sweep(
            sw.scenes.crane_start(), {"shaft.c": [2e4]}, t_end=2.0, measures={"a": ends_its_process}, on=client
        )


def test_a_worker_with_other_libraries_is_refused() -> None:
    expected = {**libraries(), "numpy": "1.0"}
    with pytest.raises(sw.SimulationError, match=rf"A worker of the cluster has numpy {np.__version__} for 1\.0"):
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
