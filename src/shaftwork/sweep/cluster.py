"""Chunks of a sweep on the workers of a cluster, by Dask: workers may be lost and come again at any time."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any
from uuid import uuid4

import numpy as np

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
    key, head = uuid4().hex, replace(task, columns=task.rows(slice(0, SIDE_BY_SIDE)))
    # a call over a network costs some milliseconds: eight chunks of one process are worth that
    calls = [np.concatenate(parts[first : first + 8]) for first in range(0, len(parts), 8)]
    losses, rest = dict[int, int](), list(reversed(list(enumerate(calls))))
    running = distributed.as_completed()
    numbers: dict[Any, int] = {}

    def submit() -> None:
        # a cluster may grow meanwhile
        while rest and len(numbers) < 2 * max(1, sum(client.nthreads().values())):
            number, part = rest.pop()
            future = client.submit(_measured, key, head, part, task.rows(part), pure=False, retries=0)
            numbers[future] = number
            running.add(future)

    try:
        submit()
        for future in running:
            number = numbers.pop(future)
            try:
                chunk = future.result()
            except (distributed.KilledWorker, distributed.client.FutureCancelledError) as error:
                losses[number] = losses.get(number, 0) + 1
                if losses[number] > 20:  # workers that are lost for other reasons are not lost so often with one chunk
                    raise SimulationError(
                        f"Workers of the cluster were lost {losses[number]} times with variants {calls[number][0]} to "
                        f"{calls[number][-1]}: {error}. Their logs tell why; memory is the most common reason."
                    ) from error
                rest.append((number, calls[number]))
            else:
                yield chunk
            submit()
    finally:
        client.cancel(list(numbers))


def _measured(key: str, head: Task, part: Index, rows: Mapping[str, Array]) -> Chunk:
    """A chunk, in a process of the cluster, which compiles a sweep once."""
    with _one:
        if key not in _workers:
            _workers.clear()
            _workers[key] = Worker(head)
        return _workers[key].run(part, rows)
