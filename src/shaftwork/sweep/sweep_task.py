"""What a sweep computes, chunk by chunk: each variant by itself or many side by side, in one process or several."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from shaftwork.codegen.model_observer import ModelObserver
from shaftwork.components.base import Component
from shaftwork.core.errors import (
    AccuracyWarning,
    CompileError,
    NetworkWarning,
    ParameterError,
    ShaftworkError,
    SimulationError,
    as_reason,
    in_one_line,
    no_quantity,
)
from shaftwork.core.notices import muted
from shaftwork.core.parameters import in_si
from shaftwork.core.storing import is_found_elsewhere
from shaftwork.integrate.engines import available
from shaftwork.network.netlist import Netlist
from shaftwork.pipeline.model import Model
from shaftwork.pipeline.motion_start import Ending
from shaftwork.pipeline.network import Network
from shaftwork.pipeline.settled import steady_start
from shaftwork.results.fatigue import SNLine
from shaftwork.results.measures import Measure
from shaftwork.results.observer import Array
from shaftwork.results.solution import Solution

if TYPE_CHECKING:
    from shaftwork.sweep.device.device_lanes import Device
    from shaftwork.sweep.ensemble import Ensemble

SIDE_BY_SIDE, FIRST_CHUNK, CHUNK, DEVICE_CHUNK, LONE_CHUNK = 16, 512, 2048, 65536, 8
"""Variants: from which on it is worth while to compile a program for many of them; and that are computed and stored at
once: side by side at first and at most, on a graphics processor, and one by one."""

Index = NDArray[np.intp]
Reader = Measure | Callable[[Solution], float]


@dataclass(frozen=True, eq=False)
class Task:
    """A sweep, as every process gets it.

    Args:
        network: of which there are variants.
        columns: (k,) values by parameter, "shaft.c", in SI.
        measures: by name.
        sn: S-N lines by quantity.
        t_end: end of the motions, s.
        options: of `Model.simulate`.
        steady: whether each variant starts in its own steady state at t = 0.
        precision: of variants on a graphics processor, "double" or "single"; empty where they run elsewhere.
    """

    network: Network
    columns: Mapping[str, Array]
    measures: Mapping[str, Reader]
    sn: Mapping[str, SNLine]
    t_end: float
    options: Mapping[str, Any]
    steady: bool = False
    precision: str = ""

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def values(self, variant: int) -> dict[str, float]:
        """The parameters of a variant."""
        return {name: float(column[variant]) for name, column in self.columns.items()}

    def rows(self, variants: Any) -> dict[str, Array]:
        """The columns of some variants."""
        return {name: column[variants] for name, column in self.columns.items()}


@dataclass(frozen=True, eq=False)
class Chunk:
    """What came out for some variants.

    Args:
        variants: (k,) their numbers.
        values: (k, measures); NaN where a variant failed.
        reasons: k texts; empty where it did not.
        alone: k texts: why a variant ran by itself where others run side by side; empty of others.
        stored: whether a store takes it; not where computers failed, since the same call may do better.
    """

    variants: NDArray[np.intp]
    values: Array
    reasons: tuple[str, ...]
    alone: tuple[str, ...]
    stored: bool = True


class Worker:
    """Computes variants of a sweep; each process has its own.

    Args:
        task: the sweep.
        device: where variants run side by side; None for this processor.

    Raises:
        NetworkError: the network cannot be assembled.
        ParameterError: the start values are no mapping, or one is not finite or of another unit.
        SignalError: a start value is of a quantity that does not exist.
    """

    def __init__(self, task: Task, device: Device | None = None) -> None:
        self._task, self._model, self._device = task, task.network.compile(), device
        self._netlist: Netlist = task.network.netlist()
        self._check_start()
        self.why = ""
        """Why variants run one by one."""
        self._ensemble = self._side_by_side()
        self.chunk = LONE_CHUNK if self._ensemble is None else DEVICE_CHUNK if device else CHUNK

    def parts(self, variants: Index) -> Iterator[Index]:
        """Variants in chunks, of which each that is done is stored."""
        return paced(variants, self.chunk) if self._device is None else iter(parted(variants, self.chunk))

    def _check_start(self) -> None:
        observer = ModelObserver(self._model.form, self._model.bind)
        initial = self._task.options["initial"] or {}
        if not isinstance(initial, Mapping):
            raise ParameterError(f"initial = {initial!r} must map quantities to values, such as {{'J1.omega': 3.0}}.")
        units = {**observer.units, **{name: unit for name, (unit, _) in observer.profiles.items()}}
        for name, value in () if isinstance(initial, Ending) else initial.items():
            if str(name) not in units:
                raise no_quantity(name, self._model.name, observer.units)
            in_si(f"the start value of '{name}'", value, units[str(name)])

    def _side_by_side(self) -> Ensemble | None:
        task, options = self._task, self._task.options
        read = [reader for reader in task.measures.values() if isinstance(reader, Measure)]
        reasons = {
            f"there are fewer than {SIDE_BY_SIDE} variants": len(task) < SIDE_BY_SIDE,
            "a measure is a function of a whole solution": len(read) < len(task.measures),
            f"engine = '{options['engine']}' was asked for": options["engine"] != "auto",
            "start values are given": bool(options["initial"]),
            "each variant starts in its own steady state": task.steady,
            "numba is not installed (extra 'fast')": not available("numba"),
        }
        self.why = next((reason for reason, holds in reasons.items() if holds), "")
        if self.why:
            return None
        kind, span, names = _kind_of(self._model), (0.0, task.t_end), tuple(task.columns)
        programs = () if self._device is None else (self._device.program,)
        firsts = ({},) if self._objection(0, task.columns) else (task.values(0), {})
        for first in firsts:  # the network itself, where the first variant fails
            try:
                ensemble = kind(self._model, names, first, read, span, options["rtol"], *programs)
            except CompileError as error:
                self.why = as_reason(str(error))
                return None
            except ShaftworkError:
                self.why = "the first of them fails, and the network as it is too"
            else:
                self.why = ""
                return ensemble
        return None

    def run(self, variants: NDArray[np.intp], rows: Mapping[str, Array] | None = None) -> Chunk:
        """Measures of some variants.

        Args:
            variants: their numbers.
            rows: their columns, where the sweep of this worker has not all of them.
        """
        rows = self._task.rows(variants) if rows is None else rows
        values = np.full((variants.size, len(self._task.measures)), np.nan)
        reasons = [self._objection(row, rows) if self._checked_parts else "" for row in range(variants.size)]
        open_, alone = np.array([not reason for reason in reasons]), np.full(variants.size, "", dtype=object)
        if self._ensemble is not None and open_.any():
            here = np.flatnonzero(open_)
            measured, left = self._ensemble.run(np.array([column[here] for column in rows.values()]))
            done, alone[here] = left == "", left
            values[here[done]], open_[here[done]] = measured[:, done].T, False
        for row in np.flatnonzero(open_).tolist():
            values[row], reasons[row] = self._alone({name: float(column[row]) for name, column in rows.items()})
        return Chunk(variants, values, tuple(reasons), tuple(alone))

    @cached_property
    def _checked_parts(self) -> list[tuple[Component, list[tuple[str, str]]]]:
        """Parts that check whether their values go together, with those that vary and the names of their columns.

        Left out are those whose check reads nothing that varies: it says the same of all variants as of the network.
        """
        by_part: dict[str, list[tuple[str, str]]] = {}
        for name in self._task.columns:
            owner, _, parameter = name.rpartition(".")
            by_part.setdefault(owner, []).append((parameter, name))
        parts = (placed.part for placed in self._netlist.placed)
        varied = [(part, by_part[part.name]) for part in parts if part.name in by_part]
        return [(part, table) for part, table in varied if not _checked(part).isdisjoint({"__dict__", *dict(table)})]

    def _objection(self, row: int, rows: Mapping[str, Array]) -> str:
        """Why the values in a row of columns do not go together; empty where they do."""
        for part, columns in self._checked_parts:
            changed: Any = object.__new__(type(part))  # its values have been looked at one by one
            vars(changed).update(vars(part))
            vars(changed).update({parameter: float(rows[name][row]) for parameter, name in columns})
            try:
                changed.__post_init__()
            except ParameterError as error:
                return in_one_line(error)
        return ""

    def _alone(self, parameters: Mapping[str, float]) -> tuple[Array, str]:
        """Measures of one variant, and why it failed."""
        task, nothing = self._task, np.full(len(self._task.measures), np.nan)
        options = dict(task.options)
        try:
            if task.steady:
                options["initial"] = steady_start(self._model, options["initial"] or {}, parameters)
            solution = self._model.simulate(task.t_end, parameters=parameters, **options)
        except ShaftworkError as error:
            return nothing, in_one_line(error)
        values = []
        for name, reader in task.measures.items():
            try:
                value = reader.of(solution, task.sn) if isinstance(reader, Measure) else float(reader(solution))
            except Exception as error:  # noqa: BLE001 (of the user's own function: a reason, not the end of the sweep)
                return nothing, f"measure '{name}': {type(error).__name__}: {in_one_line(error)}"
            if not np.isfinite(value):
                return nothing, f"measure '{name}' is {value}"
            values.append(value)
        return np.array(values), ""


def _kind_of(model: Model) -> type[Ensemble]:
    """What runs variants of a network side by side."""
    if model.phased:
        from shaftwork.sweep.switching.hybrid_ensemble import HybridEnsemble

        return HybridEnsemble
    from shaftwork.sweep.ensemble import Ensemble

    return Ensemble


def _checked(part: Component) -> set[str]:
    """The names that a part's check of its values reads, for the values that it has."""
    read = set[str]()

    class ToldParts(type(part)):  # type: ignore[misc] # the same part, which tells what is read of it
        def __getattribute__(self, name: str) -> Any:
            read.add(name)
            return super().__getattribute__(name)

    told: Any = object.__new__(ToldParts)
    object.__getattribute__(told, "__dict__").update(vars(part))
    with muted(NetworkWarning, AccuracyWarning):  # what is odd about it was said when it was made
        told.__post_init__()
    return read - {"__post_init__"}


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

    Raises:
        ParameterError: something cannot be sent to the processes that are asked for.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        sys.exit(1)  # a script without a guard, run again by a process that it has started: the first one says so
    unsendable, count = _unsendable(task), processes or cores()
    if processes is None and unsendable:
        count = 1
    if count > 1 and unsendable:
        raise ParameterError(
            f"processes = {count}: other processes do not find {unsendable}, as it is a lambda, stands inside a "
            "function, or in a notebook. Define it in a module, or take processes=1."
        )
    if processes is not None and count > 1 and worker.why:
        yield from _in_processes(task, parted(variants, worker.chunk), count)
        return
    done = 0
    for part in worker.parts(variants):
        began = time.monotonic()
        yield worker.run(part)
        first, done = not done, done + part.size
        left = (time.monotonic() - began) / part.size * (variants.size - done)
        # Processes pay where more than 8 s are left: each needs seconds to import and to compile.
        if not first and count > 1 and left > 8.0:  # the first one compiles
            yield from _in_processes(task, parted(variants[done:], part.size), count)
            return


def paced(variants: Index, most: int) -> Iterator[Index]:
    """Variants in chunks that are few at first, and twice as many as long as one is done within a second."""
    size, done = min(most, FIRST_CHUNK), 0
    while done < variants.size:
        began = time.monotonic()
        yield variants[done : done + size]
        done += size
        size = min(2 * size, most) if time.monotonic() - began < 1.0 else size


def parted(variants: Index, size: int) -> list[Index]:
    """Variants in chunks of a size."""
    return [variants[first : first + size] for first in range(0, variants.size, size)]


def _unsendable(task: Task) -> str:
    """The first measure, part or value of one that another process does not find; empty where it finds all."""
    placed = [one.part for one in task.network.netlist().placed]
    things: dict[str, Any] = {f"the measure '{name}'": reader for name, reader in task.measures.items()}
    things |= {f"the class of '{part.name}'": type(part) for part in placed}
    things |= {f"'{part.name}.{name}'": value for part in placed for name, value in part.values.items()}
    return next((name for name, thing in things.items() if not is_found_elsewhere(thing)), "")


def _in_processes(task: Task, parts: Sequence[Index], count: int) -> Iterator[Chunk]:
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(min(count, len(parts)) or 1, context, _begin, (task,))
    try:
        rest, pending = iter(parts), set[Future[Chunk]]()
        with _uninterrupted():
            pending |= {pool.submit(_run, part) for part in islice(rest, 2 * count)}
        while pending:
            done, pending = wait(pending, return_when=FIRST_COMPLETED)
            pending |= {pool.submit(_run, part) for part in islice(rest, len(done))}
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
    if parent := multiprocessing.parent_process():
        parent.join()
    os._exit(1)


def _run(part: Index) -> Chunk:
    assert _worker is not None  # noqa: S101 (`_begin` came first)
    return _worker.run(part)
