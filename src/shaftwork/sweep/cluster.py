"""Chunks of a sweep on the workers of a cluster, by Dask: workers may be lost and come again at any time."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any
from uuid import uuid4

from shaftwork.core.errors import ParameterError, SimulationError, imported
from shaftwork.results.observer import Array
from shaftwork.sweep.sweep_task import SIDE_BY_SIDE, Chunk, Index, Task, Worker

_workers: dict[str, Worker] = {}
"""The worker of the last sweep of a process."""
_one = threading.Lock()


def on_cluster(task: Task, parts: Sequence[Index], client: Any) -> Iterator[Chunk]:
    """Chunks as they are done.

    Each call brings all that it needs, so that nothing is lost with a worker. Only so many wait on the cluster that
    each of its threads has its next one.

    Raises:
        ParameterError: it is no client.
        SimulationError: workers are lost again and again with the same chunk.
    """
    distributed = imported("distributed", "cluster", "sweep(on=...)")
    if not isinstance(client, distributed.Client):
        raise ParameterError(f"on = {client!r} must be a client of Dask: distributed.Client(...).")
    calls = _Calls(task, parts, client, distributed.as_completed(loop=client.loop))
    lost = distributed.KilledWorker, distributed.client.FutureCancelledError
    try:
        calls.submit()
        for future in calls.completed:
            variants = calls.waiting.pop(future)
            try:
                chunk = future.result()
            except lost as error:
                calls.again(variants, error)
            else:
                yield chunk
            calls.submit()
    finally:
        client.cancel(list(calls.waiting))


class _Calls:
    """What waits on a cluster, and what is to follow.

    Args:
        task: the sweep.
        parts: variants of each call.
        client: of Dask.
        completed: its futures, as they are done.
    """

    def __init__(self, task: Task, parts: Sequence[Index], client: Any, completed: Any) -> None:
        self._task, self._client, self.completed = task, client, completed
        self._key, self._head = uuid4().hex, replace(task, columns=task.rows(slice(0, SIDE_BY_SIDE)))
        self._rest = [*parts][::-1]
        self._losses: dict[int, int] = {}
        self.waiting: dict[Any, Index] = {}
        """Variants by future."""

    def submit(self) -> None:
        """Send as much as keeps the cluster busy, which may grow meanwhile."""
        while self._rest and len(self.waiting) < 2 * max(1, sum(self._client.nthreads().values())):
            variants = self._rest.pop()
            rows = self._task.rows(variants)
            future = self._client.submit(_measured, self._key, self._head, variants, rows, pure=False)
            self.waiting[future] = variants
            self.completed.add(future)

    def again(self, variants: Index, error: Exception) -> None:
        """Send what was lost with a worker once more."""
        first = int(variants[0])
        self._losses[first] = count = self._losses.get(first, 0) + 1
        if count > 20:  # workers that are lost for other reasons are not lost so often with one call
            raise SimulationError(
                f"Workers of the cluster were lost {count} times with variants {first} to {variants[-1]}: {error}. "
                "Their logs tell why; memory is the most common reason."
            ) from error
        self._rest.append(variants)


def _measured(key: str, head: Task, part: Index, rows: Mapping[str, Array]) -> Chunk:
    """A chunk, in a process of the cluster, which compiles a sweep once."""
    with _one:
        if key not in _workers:
            _workers.clear()
            _workers[key] = Worker(head)
        return _workers[key].run(part, rows)
