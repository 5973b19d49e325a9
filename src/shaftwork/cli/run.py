"""One motion: `shaftwork run`."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from shaftwork.cli.command import (
    Data,
    Say,
    command,
    end_of,
    end_option,
    folder_option,
    load,
    solver_options,
    start_of,
    start_options,
)
from shaftwork.cli.folder import Folder, write_picture
from shaftwork.core.domains import DOMAINS
from shaftwork.core.files import write_rows
from shaftwork.core.screen import ROWS, counted, progress

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from shaftwork.pipeline.model import Model
    from shaftwork.pipeline.network import Network
    from shaftwork.results.solution import Solution

FILES = ("signals.csv", "signals.png", "phases.csv", "events.csv")
INTEGRALS = tuple(domain.integral.name for domain in DOMAINS)
"""Quantities that are recorded only when asked for."""


def run_options(parser: ArgumentParser) -> None:
    """The options of `shaftwork run`."""
    folder_option(parser, "plots and CSV")
    end_option(parser, "that of the scene, else 10")
    solver_options(parser)
    start_options(parser)
    parser.add_argument(
        "--signals", metavar="NAME,...", action="append", default=[], help="quantities to show, such as shaft.tau"
    )


@command("simulate: a table on the screen, plots and CSV in DIR", run_options, machines=True)
def run(options: Namespace, say: Say) -> Data:
    """The motion as a table, and as curves and CSV in a folder."""
    net, scene = load(options)
    t_end = end_of(options, scene)
    folder = Folder(options.out, FILES, options.line) if options.out else None
    wanted = tuple(name.strip() for text in options.signals for name in text.split(","))
    solution = motion_of(net, t_end, wanted, options)
    unset = "" if options.t_end is not None else " (a model file has no end time; --t-end sets it)"
    say(f"{net.name}: {t_end:g} s of motion{f' ({scene.source})' if scene else unset}")
    for line in scene.chosen if scene else ():
        say(f"  chosen: {line}")
    if start := [*(["the steady state at t = 0 s"] if options.steady else []), *options.initial]:
        say(f"  start: {', '.join(start)}")
    signals = wanted or (scene.signals if scene else _worth_seeing(solution))
    say(f"engine {solution.engine}: {solution.why}")
    counts = ", ".join(f"{count} {_word(name, count)}" for name, count in solution.statistics.items())
    say(f"{counts}; energy residual {solution.energy_residual:.1e} of the work done\n")
    say(solution.extremes.table(signals))
    _say_phases(solution, say)
    if folder:
        with folder.new_files(say) as place:
            _write(solution, signals, place)
    return _data(solution, signals)


def _word(name: str, count: int) -> str:
    """What a statistic counts, "steps", or "step" where there is one."""
    return name if count != 1 or name == "rhs" else name.removesuffix("s")


def motion_of(net: Network, t_end: float, wanted: tuple[str, ...], options: Namespace) -> Solution:
    """The run, in which the wanted quantities can be read, or a line on how far it came until it was interrupted."""
    reached = 0.0
    try:
        with progress(t_end, "s", f"{net.name}, compiling") as show:

            def report(t: float) -> None:
                nonlocal reached
                reached = max(reached, t)
                show(t, net.name)

            started = tuple(name.strip() for name, _, _ in (text.partition("=") for text in options.initial))
            model = net.compile(angles=_angles(net, (*wanted, *started)))
            _refuse_unknown(model, wanted)
            start = start_of(options, model)
            return model.simulate(t_end, rtol=options.rtol, engine=options.engine, initial=start, progress=report)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"the motion had come to t = {reached:.4g} of {t_end:g} s") from None


def _angles(net: Network, wanted: tuple[str, ...]) -> tuple[str, ...]:
    """The parts whose angle, position or flux linkage is wanted."""
    parts = {part.name for part in net.parts}
    pairs = (name.rpartition(".") for name in wanted)
    owners = (owner for owner, _, name in pairs if name.partition("_")[0] in INTEGRALS and not name.endswith("_rel"))
    return tuple(dict.fromkeys(owner for owner in owners if owner in parts))


def _refuse_unknown(model: Model, wanted: tuple[str, ...]) -> None:
    """Refuse a quantity that there will not be, before anything is computed."""
    from shaftwork.codegen.model_observer import ModelObserver
    from shaftwork.core.errors import no_quantity

    observer = ModelObserver(model.form, lambda: model.bind(model.defaults))
    there = dict.fromkeys((*observer.units, *observer.profiles))
    for name in wanted:
        if name not in there:
            raise no_quantity(name, model.name, there)


def _worth_seeing(solution: Solution) -> tuple[str, ...]:
    """The states of a model that no scene comments; the first and last few where there are many."""
    names = tuple(name for name in solution.states if name in solution)
    return names if len(names) <= 12 else (*names[:6], *names[-6:])


def _say_phases(solution: Solution, say: Say) -> None:
    """The phases of a motion in words; those in the middle of a long list are counted alone."""
    rows = solution.phases
    if not rows:
        return
    say(f"\n{'from s':>9} {'to s':>9}  {counted(len(rows), 'phase')}, {counted(len(solution.events), 'event')}")
    for number, row in enumerate(rows):
        if not ROWS <= number < len(rows) - ROWS:
            say(f"{row.start:9.4f} {row.end:9.4f}  {row.name}")
        elif number == ROWS:
            say(f"{'...':>9} {'...':>9}  {len(rows) - 2 * ROWS} more")


def _write(solution: Solution, signals: Sequence[str], place: Path) -> None:
    import numpy as np

    from shaftwork.results.extremes import warn_of_coarse_samples

    warn_of_coarse_samples(solution.reader, solution.t, solution.x, signals)
    units, profiles = solution.observer.units, solution.observer.profiles
    head, columns = ["t [s]"], [solution.t]
    for name in signals:
        unit, places = profiles.get(name, (units.get(name, ""), ()))
        head += [f"{name} at {place:g} m [{unit}]" for place in places] or [f"{name} [{unit}]"]
        columns.append(solution[name])
    rows = np.column_stack(columns)
    np.savetxt(
        place / "signals.csv", rows, delimiter=",", header=",".join(head), comments="", fmt="%.12g", encoding="utf-8"
    )
    if solution.phases:
        parts = solution.phases[0].modes
        phases = ((row.start, row.end, *row.modes.values()) for row in solution.phases)
        write_rows(place / "phases.csv", ("start [s]", "end [s]", *parts), phases)
        write_rows(place / "events.csv", ("t [s]", "part", "from", "to"), solution.events)
    write_picture(place / "signals.png", lambda: solution.plot(*signals))


def _data(solution: Solution, signals: Sequence[str]) -> Data:
    """The same for machines."""
    rows = {name: solution.extremes.row(name) for name in signals}
    return {
        "network": solution.name,
        "t_end": solution.steps[-1],
        "start": dict(zip(solution.states, solution.x[0], strict=False)),  # behind them is what waves bring
        "engine": solution.engine,
        "why": solution.why,
        "statistics": solution.statistics,
        "energy_residual": solution.energy_residual,
        "signals": {
            name: {
                "unit": row.least.unit,
                "minimum": {"value": float(row.least), "t": row.least.t, "place": row.least.place},
                "maximum": {"value": float(row.most), "t": row.most.t, "place": row.most.place},
                "mean": row.mean,
                "end": row.end,
            }
            for name, row in rows.items()
        },
        "phases": [row._asdict() for row in solution.phases],
        "events": [dict(zip(("t", "part", "from", "to"), event, strict=True)) for event in solution.events],
    }
