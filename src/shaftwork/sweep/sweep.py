"""Variants of a network: every combination of values, or a table of samples; measured, judged and ranked."""

from __future__ import annotations

import math
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shaftwork.core.errors import NetworkWarning, ParameterError
from shaftwork.core.notices import muted
from shaftwork.core.parameters import whole
from shaftwork.core.screen import progress
from shaftwork.network.netlist import Netlist
from shaftwork.pipeline.arguments import (
    OutputTimes,
    by_name,
    checked_parameter,
    engine_names,
    output_times,
    relative_tolerance,
    repeated,
    time_span,
)
from shaftwork.pipeline.columns import column_in_si
from shaftwork.pipeline.measured_units import parameter_units, units_of
from shaftwork.pipeline.motion_start import ending_of, refuse_motion, time_of_start
from shaftwork.pipeline.network import Network, network_of
from shaftwork.results.fatigue import SNLine
from shaftwork.results.measures import Measure
from shaftwork.results.observer import Array
from shaftwork.results.solution import Solution
from shaftwork.sweep.sweep_result import VERDICTS, Limits, Sweep, limits_of, requirements
from shaftwork.sweep.sweep_store import Store
from shaftwork.sweep.sweep_task import SIDE_BY_SIDE, Chunk, Index, Reader, Task, Worker, chunks

if TYPE_CHECKING:
    from shaftwork.sweep.device.device_lanes import Device

Measures = Mapping[str, "str | Callable[[Solution], float]"] | Iterable[str]


def sweep(
    net: Network,
    parameters: Mapping[str, Iterable[float]] | None = None,
    *,
    t_end: float,
    measures: Measures,
    samples: Any = None,
    require: Mapping[str, tuple[float | None, float | None]] | None = None,
    sn: SNLine | Mapping[str, SNLine] | None = None,
    rtol: float = 1e-8,
    engine: str = "auto",
    initial: Mapping[str, float] | Solution | None = None,
    steady: bool = False,
    t_eval: OutputTimes = None,
    processes: int | None = None,
    on: Any = None,
    precision: str = "double",
    store: str | Path | None = None,
) -> Sweep:
    """Simulate variants of a network and measure each of them; nothing is compiled anew.

    Where all measures have names, many variants run side by side in compiled code (extra `fast`), and those that it
    cannot follow run one by one. Results do not depend on the number of processes, and that of a variant not on those
    beside it, except the first: that one gives the nominal sizes of the states, for the absolute tolerance, and says in
    which modes variants run side by side. Another first one changes results within the tolerance.

    Args:
        net: the network.
        parameters: a grid, {"shaft.c": [2e4, 3e4], "motor.tau_k": [8, 9, 10]}: all combinations, the last name fastest.
        samples: instead of it a table, a mapping to columns of equal length or a pandas data frame: a variant each row.
        t_end: end of the motions, s.
        measures: names such as "max shaft.tau", or a mapping from names of your own to these, or to functions of a
            solution. First words are "max", "min", "peak", "mean", "rms", "end" and "damage", see
            `results.measures.KINDS`.
        require: by measure, (low, high), numbers in its SI unit or quantities; None leaves a side open.
        sn: S-N line for measures of damage, or one by quantity.
        rtol: relative tolerance of a step; the absolute one beside it is `rtol` times the size of a state at a speed of
            0.001 rad/s. Side by side a tenth of it, and never more than 1e-7: what is looser costs the same.
        engine: as in `Model.simulate`; one that is named follows each variant by itself.
        initial: start values, or a motion that each variant goes on from, as there.
        steady: whether each variant starts in its own steady state at t = 0, of which `initial` changes some values.
        t_eval: output times of the solutions that functions get, as there; names measure the motion, not the outputs.
        processes: how many; by default as many as there are cores, where the sweep takes long enough.
        on: "gpu" for the first graphics processor that JAX sees (extra `gpu`), or a device of JAX: variants run side by
            side there. Or a client of Dask, `distributed.Client(...)`, whose workers do all of it (extra `cluster`).
        precision: of numbers on a graphics processor. In "single", `Sweep.errors` says how far results are off.
        store: a file to which all that is done is written. The same call with the same file goes on where it stopped;
            functions that measure are known in it by their names.

    Raises:
        ParameterError: an argument is out of its range, there is no such parameter, measure or device, or the store is
            that of another sweep, in use by one, damaged, or cannot be written any more.
        NetworkError: the network cannot be assembled.
        SignalError: a measure is of a quantity that does not exist.
    """
    columns = _columns(network_of(net).netlist(), parameters, samples)
    start = _start(net, initial, steady=steady)
    readers = _readers(measures, columns)
    units = {**parameter_units(net, columns), **units_of(net, readers)}
    limits = _limits(require, readers, units)
    _, end = time_span(time_of_start(None, start), t_end)
    output_times(t_eval, time_of_start(None, start), end)  # said once, not of every variant
    options = _options(readers, rtol, engine, start, t_eval)
    device = _device(on, precision)
    told = "" if device is None else precision
    task = Task(net, columns, readers, _lines(sn, readers), end, options, steady, told)
    worker = Worker(task, device)
    values, reasons, why = _run(worker, task, _count(processes), on, store)
    errors = _errors(task, values, reasons) if told == "single" and not worker.why else {}
    return Sweep(net.name, columns, dict(zip(readers, values.T, strict=True)), limits, reasons, why, errors, units)


def _device(on: Any, precision: str) -> Device | None:
    """The graphics processor that is meant, or None.

    Raises:
        ParameterError: there is none, or no such precision there.
        MissingExtraError: JAX is not installed.
    """
    jax = sys.modules.get("jax")
    on_device = isinstance(on, str) or (jax is not None and isinstance(on, jax.Device))
    if precision not in ("double", "single") or (precision == "single" and not on_device):
        raise ParameterError(
            f"precision = {precision!r} must be 'double', or 'single' on a graphics processor: on='gpu'."
        )
    if not on_device:
        return None
    from shaftwork.sweep.device.device_lanes import Device

    return Device.of(on, precision)


def _errors(task: Task, values: Array, reasons: Sequence[str]) -> dict[str, float]:
    """By measure, the largest difference of some variants from double precision, over their largest size."""
    good = np.flatnonzero([not reason for reason in reasons])
    some = good[np.unique(np.linspace(0, good.size - 1, SIDE_BY_SIDE).round().astype(int))] if good.size else good
    again = Worker(replace(task, precision="")).run(some)
    both = np.array([not reason for reason in again.reasons], dtype=bool)
    expected, found = again.values[both], values[some[both]]
    sizes = np.abs(expected).max(axis=0, initial=0.0)
    apart = np.abs(found - expected).max(axis=0, initial=0.0)
    return dict(zip(task.measures, (apart / np.where(sizes > 0, sizes, 1.0)).tolist(), strict=True))


def _start(net: Network, initial: Any, *, steady: bool) -> Any:
    """Start values; of a motion what it ends with."""
    if steady:
        refuse_motion(initial, "sweep(steady=True)")
    if not isinstance(initial, Solution):
        return initial
    with muted(NetworkWarning):  # compilation warns
        return ending_of(initial, net.graph())


def _options(
    readers: Mapping[str, Reader], rtol: float, engine: str, initial: Any, t_eval: OutputTimes
) -> dict[str, Any]:
    """What each simulation is told."""
    (name,) = engine_names([engine])
    if t_eval is None and all(isinstance(reader, Measure) for reader in readers.values()):
        t_eval = 2  # they read the motion between these
    return {"rtol": relative_tolerance(rtol), "engine": name, "initial": initial, "t_eval": t_eval}


def _count(processes: int | None) -> int | None:
    """How many processes; None for as many as there are cores."""
    if processes is None:
        return None
    if (count := whole(processes)) is None:
        raise ParameterError(f"processes = {processes!r} must be a number, 1 or more; leave it out for all cores.")
    return count


def _run(
    worker: Worker, task: Task, processes: int | None, on: Any, path: str | Path | None
) -> tuple[Array, tuple[str, ...], str]:
    """(variants, measures), why variants failed, and why some or all ran one by one."""
    values, reasons = np.full((len(task), len(task.measures)), np.nan), [""] * len(task)
    open_, alone, failed = np.ones(len(task), dtype=bool), dict[int, str](), 0

    def take(chunk: Chunk) -> None:
        nonlocal failed
        new = open_[chunk.variants]  # a store may hold some twice
        alone.update((k, why) for k, why in zip(chunk.variants.tolist(), chunk.alone, strict=True) if why)
        failed += sum(bool(reason) for reason in compress(chunk.reasons, new))
        values[chunk.variants], open_[chunk.variants] = chunk.values, False
        for variant, reason in zip(chunk.variants.tolist(), chunk.reasons, strict=True):
            reasons[variant] = reason

    with nullcontext() if path is None else Store(path, task) as store:
        for chunk in store.chunks if store else []:
            take(chunk)
        with progress(len(task), "variants", "compiling") as show:
            for chunk in _chunks(worker, task, np.flatnonzero(open_), processes, on):
                if store and chunk.stored:
                    store.append(chunk)
                take(chunk)
                show(len(task) - int(open_.sum()), f"{failed} failed" if failed else "sweep")
    return values, tuple(reasons), worker.why or _said(alone, len(task))


def _said(alone: Mapping[int, str], count: int) -> str:
    """How many of so many variants ran by themselves, for each reason."""
    if not alone:
        return ""
    parts = "; ".join(f"{number} because {why}" for why, number in Counter(alone.values()).most_common())
    return f"{len(alone)} of {count} variants ran one by one: {parts}"


def _chunks(worker: Worker, task: Task, variants: Index, processes: int | None, on: Any) -> Iterator[Chunk]:
    """Chunks of variants as they are done, on this machine or on the workers of a cluster."""
    if on is None or task.precision:
        return chunks(worker, task, variants, 1 if task.precision and not worker.why else processes)
    from shaftwork.sweep.cluster import on_cluster

    return on_cluster(worker, task, variants, on)


def _columns(netlist: Netlist, parameters: Any, samples: Any) -> dict[str, Array]:
    """(variants,) values by parameter, in SI.

    Raises:
        ParameterError: there is no such parameter, a value is not admissible, or columns differ in length.
    """
    if (parameters is None) == (samples is None):
        raise ParameterError(
            "Give a grid, sweep(net, {'shaft.c': [...]}, ...), or a table, samples={'shaft.c': [...]}."
        )
    table = samples if parameters is None else parameters
    if not hasattr(table, "items"):
        raise ParameterError(f"{table!r} must map parameters to their values, such as {{'shaft.c': [2e4, 3e4]}}.")
    named = [(str(name), values) for name, values in table.items()]
    if twice := repeated(name for name, _ in named):  # a data frame may have two columns of one name
        raise ParameterError(f"There are two columns '{twice}'. Give each parameter one.")
    checked = {
        name: column_in_si(name, values, partial(checked_parameter, netlist, name), rows=parameters is None)
        for name, values in named
    }
    if not checked or not all(len(values) for values in checked.values()):
        raise ParameterError("A sweep needs at least one parameter, and a value for each.")
    if parameters is None:
        if len({len(values) for values in checked.values()}) > 1:
            lengths = ", ".join(f"{name} {len(values)}" for name, values in checked.items())
            raise ParameterError(f"The columns of samples differ in length: {lengths}.")
        return checked
    return _grid(checked)


def _grid(values: Mapping[str, Array]) -> dict[str, Array]:
    """Every combination of values, the last name fastest."""
    count = math.prod(map(len, values.values()))
    most = 10_000_000  # so many take hours, and more are a typing error
    if count > most:
        sizes = " x ".join(f"{len(column)}" for column in values.values())
        raise ParameterError(
            f"A grid of {sizes} values has {count} variants, more than {most}. Give fewer values, or draw "
            "samples={...} of them."
        )
    grids = np.meshgrid(*values.values(), indexing="ij")
    return {name: grid.ravel() for name, grid in zip(values, grids, strict=True)}


def _readers(measures: Measures, columns: Iterable[str]) -> dict[str, Reader]:
    """Measures by name, none of them that of another column of the table."""
    readers: dict[str, Reader] = {}
    for name, reader in by_name(measures).items():
        if not isinstance(reader, str) and not callable(reader):
            raise ParameterError(f"measure '{name}' = {reader!r} must be a name, 'max shaft.tau', or a function.")
        readers[name] = Measure.read(reader) if isinstance(reader, str) else reader
    if taken := [name for name in (*columns, *VERDICTS) if name in readers]:
        raise ParameterError(
            f"No measure can be called '{taken[0]}': the table has another column of that name. Give it another one, "
            f"measures={{'my {taken[0]}': ...}}."
        )
    return readers


def _limits(
    require: Mapping[str, Any] | None, readers: Mapping[str, Reader], units: Mapping[str, str]
) -> dict[str, Limits]:
    required = requirements(require)
    if others := [name for name in required if name not in readers]:
        raise ParameterError(f"require: there is no measure '{others[0]}'. There are: {', '.join(readers)}.")
    return limits_of(required, units.get)


def _lines(sn: Any, readers: Mapping[str, Reader]) -> dict[str, SNLine]:
    """The S-N line of every quantity whose damage is measured."""
    named = (reader for reader in readers.values() if isinstance(reader, Measure))
    quantities = [measure.quantity for measure in named if measure.kind == "damage"]
    lines = dict(sn) if isinstance(sn, Mapping) else dict.fromkeys(quantities, sn)
    if missing := [name for name in quantities if not isinstance(lines.get(name), SNLine)]:
        raise ParameterError(f"The damage of '{missing[0]}' needs an S-N line: sn=SNLine(...), or sn={{name: SNLine}}.")
    return {name: lines[name] for name in quantities}
