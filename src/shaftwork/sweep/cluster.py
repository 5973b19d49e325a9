"""Chunks of a sweep on the workers of a cluster, by Dask: workers may be lost and come again at any time."""

from __future__ import annotations

import queue
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from importlib import metadata
from typing import Any

import numpy as np

from shaftwork.core.errors import ParameterError, ShaftworkError, SimulationError, imported
from shaftwork.core.notices import warn
from shaftwork.results.observer import Array
from shaftwork.sweep.sweep_task import SIDE_BY_SIDE, Chunk, Index, Task, Worker

_workers: dict[bytes, Worker] = {}
"""The worker of the last sweep of a process, by the bytes of its task."""
_one = threading.Lock()


def on_cluster(worker: Worker, task: Task, variants: Index, client: Any) -> Iterator[Chunk]:
    """Chunks as they are done.

    Each call brings all that it needs, so that nothing is lost with a worker. Only so many wait on the cluster that
    each of its threads has its next one.

    Raises:
        ParameterError: it is no client, or a measure cannot be sent.
        SimulationError: the scheduler is gone, or workers have other libraries or are lost with most of what they run.
    """
    distributed = imported("distributed", "cluster", "sweep(on=...)")
    if not isinstance(client, distributed.Client):
        raise ParameterError(f"on = {client!r} must be a client of Dask, distributed.Client(...), or 'gpu'.")
    if client.asynchronous or client.status == "closed":
        raise ParameterError(f"on = {client!r} is asynchronous or closed. Give one that is open and can be waited for.")
    calls = _Calls(worker, task, variants, client, distributed)
    try:
        while calls.submit():
            yield from calls.next()
    except (OSError, distributed.client.ClosedClientError) as error:
        raise SimulationError(
            f"The scheduler of the cluster does not answer any more: {error}. What a store has is kept: start another "
            "one, and the same call with a new client goes on from there."
        ) from None
    finally:
        if client.status == "running":
            client.cancel(list(calls.waiting))


class _Calls:
    """What waits on a cluster, and what is to follow.

    Args:
        worker: of this process.
        task: the sweep.
        variants: (k,) what is to be done.
        client: of Dask.
        distributed: the library.
    """

    def __init__(self, worker: Worker, task: Task, variants: Index, client: Any, distributed: Any) -> None:
        self._task, self._client, self._distributed = task, client, distributed
        try:  # as bytes, which only workers unpack
            head = _packing().dumps(replace(task, columns=task.rows(slice(0, SIDE_BY_SIDE))))
        except Exception as error:  # noqa: BLE001 (every kind of object has its own)
            raise ParameterError(
                f"A measure cannot be sent to a cluster: {error}. Give a function of a file."
            ) from None
        self._head = head, libraries(), worker.why
        self._rest = [variants] if variants.size else []
        self._size, self._most = worker.chunk, 8 * worker.chunk
        """Variants of a call, about twice what one does: each client and scheduler keeps its last 1000 messages."""
        self._done: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._suspected: list[Index] = []
        self._alone: Any = None
        """What workers were lost with, and what of it runs, beside nothing else: Dask blames all at a worker."""
        self._calls, self._fatal = 0, 0
        """How many calls were done, and variants at which workers die."""
        self._room, self._looked, self._busy, self._told = 0, -np.inf, time.monotonic(), False
        self.waiting: dict[Any, Index] = {}
        """Variants by future."""

    def submit(self) -> bool:
        """Send as much as keeps the cluster busy, which may grow meanwhile; whether anything waits."""
        if (now := time.monotonic()) > self._looked + 1.0:
            threads = sum(self._client.nthreads().values())
            self._room, self._looked = 2 * max(1, threads), now
            self._busy = now if threads else self._busy
            self._say_idle(now - self._busy)
        if self._suspected and not self.waiting:
            self._alone = self._send(self._suspected.pop())
        while self._rest and not self._suspected and self._alone is None and len(self.waiting) < self._room:
            self._send(self._taken())
        return bool(self.waiting)

    def _taken(self) -> Index:
        """The next variants, which do not wait any more."""
        variants = self._rest.pop()
        if variants.size > self._size:
            self._rest.append(variants[self._size :])
        return variants[: self._size]

    def _send(self, variants: Index) -> Any:
        """The future of some variants."""
        future = self._client.submit(measured, *self._head, variants, self._task.rows(variants), pure=False)
        self.waiting[future] = variants
        future.add_done_callback(self._done.put)
        return future

    def _say_idle(self, idle: float) -> None:
        """What is said where there have been no workers for a time in s.

        Raises:
            SimulationError: there will be none.
        """
        text = "The cluster has had no workers for {:.0f} s. Their logs tell why."
        local = self._client.cluster is None or isinstance(self._client.cluster, self._distributed.LocalCluster)
        if idle > 300.0 and local:  # others may be waiting in a queue
            raise SimulationError(
                f"{text.format(idle)} What a store has is kept, and the same call goes on from there."
            )
        if idle > 60.0 and not self._told:
            self._told = True
            warn(f"{text.format(idle)} The sweep waits for them.", UserWarning)

    def next(self) -> list[Chunk]:
        """Chunks of a call that is done; none where none is within a second."""
        try:
            future = self._done.get(timeout=1.0)
        except queue.Empty:
            return []
        variants = self.waiting.pop(future)
        alone, self._alone = future is self._alone, None
        try:
            done: list[Chunk] = future.result()
        except self._distributed.KilledWorker as error:
            if alone and variants.size == 1:
                return [self._deadly(variants, error.last_worker)]
            self._suspected += [part for part in np.array_split(variants, 8 if alone else 1) if part.size]
            return []
        except self._distributed.client.FutureCancelledError:  # with a scheduler that may come again
            self._rest.append(variants)
            return []
        except ShaftworkError:
            raise
        except Exception as error:
            raise SimulationError(
                f"A worker of the cluster failed: {type(error).__name__}: {error}. The scheduler and all workers need "
                "the Shaftwork of this process, and the files of functions that measure."
            ) from error
        if (count := sum(chunk.variants.size for chunk in done)) < variants.size:
            self._rest.append(variants[count:])
        if not alone:
            self._size = min(2 * count, self._most)
        self._calls += 1
        return done

    def _deadly(self, variant: Index, worker: Any) -> Chunk:
        """What is said of a variant at which workers die.

        Raises:
            SimulationError: there are more of them than calls that were done, so that it is the workers.
        """
        reason = (
            f"workers of the cluster were lost again and again with variant {variant[0]}, the last at "
            f"{worker.address}; their logs tell why, and too little memory is the most common reason"
        )
        self._fatal += 1
        if self._fatal > self._calls:
            raise SimulationError(
                f"W{reason[1:]}. Hardly anything else was done meanwhile. What a store has is kept, and the same call "
                "goes on from there."
            )
        return Chunk(variant, np.full((1, len(self._task.measures)), np.nan), (reason,), ("",), stored=False)


def measured(
    head: bytes, expected: Mapping[str, str], why: str, variants: Index, rows: Mapping[str, Array]
) -> list[Chunk]:
    """The first chunks of some variants, for about a second, in a process of the cluster, which compiles a sweep once.

    Args:
        head: a task of the first variants.
        expected: versions of libraries.
        why: variants run one by one, where the sweep was begun.
        variants: (k,) their numbers.
        rows: their columns.
    """
    with _one:
        if head not in _workers:
            _workers.clear()
            _workers[head] = _begun(head, expected, why)
        worker, done, end = _workers[head], [], time.monotonic() + 1.0
        for part in worker.parts(np.arange(variants.size)):
            done.append(worker.run(variants[part], {name: column[part] for name, column in rows.items()}))
            if time.monotonic() > end:
                break
        return done


def _begun(head: bytes, expected: Mapping[str, str], why: str) -> Worker:
    """What computes a sweep in this process.

    Raises:
        SimulationError: it would come to other digits than where the sweep was begun.
    """
    there = libraries()
    if differing := [
        f"{name} {there[name]} for {version}" for name, version in expected.items() if there[name] != version
    ]:
        raise SimulationError(
            f"A worker of the cluster has {', '.join(differing)}, and may come to other digits. Install the same there."
        )
    worker = Worker(_packing().loads(head))
    if worker.why != why:
        raise SimulationError(f"A worker of the cluster runs variants in another way: '{worker.why}' for '{why}'.")
    return worker


def _packing() -> Any:
    """How Dask itself sends what a cluster runs."""
    return imported("distributed.protocol.pickle", "cluster", "sweep(on=...)")


def libraries() -> dict[str, str]:
    """Versions of what the digits of a result depend on."""
    shaftwork = str(sys.modules[__name__.partition(".")[0]].__version__)
    versions = {"shaftwork": shaftwork, "python": "{}.{}".format(*sys.version_info)}
    for name in ("numpy", "scipy", "sympy", "heyoka", "numba", "scikit-sundae"):
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = "none"
    return versions
