"""The chunks of a sweep, in this process or in several."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from shaftwork.core.errors import SimulationError
from shaftwork.results.measures import Measure
from shaftwork.studies.sweep_task import Chunk, Task, Worker

WORTH = 8.0
"""Processes are started where what is left would take so long in s: each needs seconds to import and to compile."""

Index = NDArray[np.intp]


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def chunks(worker: Worker, task: Task, variants: Index, processes: int | None) -> Iterator[Chunk]:
    """Chunks as they are done.

    Args:
        worker: of this process.
        task: the sweep.
        variants: (k,) what is to be done.
        processes: how many; None for as many as there are cores. Variants side by side take to them only where what is
            left takes long enough, others also where so many are asked for.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        sys.exit(1)  # a script without a guard, run again by a process that it has started: the first one says so
    parts = [variants[first : first + worker.chunk] for first in range(0, variants.size, worker.chunk)]
    asked = processes if processes is not None else cores() if _can_be_sent(task) else 1
    if processes is not None and asked > 1 and worker.why:
        yield from _in_processes(task, parts, asked)
        return
    for number, part in enumerate(parts):
        began = time.monotonic()
        yield worker.run(part)
        left = len(parts) - number - 1
        if number and asked > 1 and (time.monotonic() - began) * left > WORTH:  # the first one compiles
            yield from _in_processes(task, parts[number + 1 :], asked)
            return


def _can_be_sent(task: Task) -> bool:
    """Whether another process finds the functions that measure: those of a notebook or of `python -c` it does not."""
    functions = [reader for reader in task.measures.values() if not isinstance(reader, Measure)]
    main = sys.modules["__main__"]
    here = any(getattr(function, "__module__", "") == "__main__" for function in functions)
    local = any("<" in getattr(function, "__qualname__", "") for function in functions)
    return not local and not (here and not hasattr(main, "__file__"))


def _in_processes(task: Task, parts: Sequence[Index], count: int) -> Iterator[Chunk]:
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(min(count, len(parts)) or 1, context, _begin, (task,))
    try:
        with _uninterrupted():
            pending: set[Future[Chunk]] = {pool.submit(_run, part) for part in parts}
        while pending:
            done, pending = wait(pending, return_when=FIRST_COMPLETED)
            for future in done:
                yield future.result()
    except BrokenProcessPool as error:
        raise SimulationError(
            "A process of the sweep has ended before its work was done. A script that starts processes must do so "
            "under 'if __name__ == \"__main__\":', and memory must be enough for all; processes=1 needs neither."
        ) from error
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Processes that start meanwhile ignore Ctrl-C from their first moment: that which a user stops ends them."""
    before = signal.getsignal(signal.SIGINT)
    if before is None or threading.current_thread() is not threading.main_thread():  # not to be changed from here
        yield
        return
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


_worker: Worker | None = None


def _begin(task: Task) -> None:
    global _worker  # noqa: PLW0603 (a process has one task)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process that a user stops says what happens
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _worker = Worker(task)


def _end_with_parent() -> None:
    """An idle process waits for work, which comes no more once its parent has been killed."""
    parent = multiprocessing.parent_process()
    assert parent is not None  # noqa: S101 (a process of a sweep has one)
    parent.join()
    os._exit(1)


def _run(part: Index) -> Chunk:
    assert _worker is not None  # noqa: S101 (`_begin` came first)
    return _worker.run(part)
