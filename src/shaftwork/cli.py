"""The command `shaftwork`."""

from __future__ import annotations

import argparse
import os
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from shaftwork.core.errors import ParameterError, ShaftworkError, SimulationError
from shaftwork.core.progress import Progress

if TYPE_CHECKING:
    from shaftwork.equations.records import Equations
    from shaftwork.pipeline.network import Network
    from shaftwork.results.solution import Solution
    from shaftwork.scenes.catalog import Scene
    from shaftwork.studies.work_precision import Trial

DONE, FAILED, WRONG_INPUT = 0, 1, 2
FALLBACK_END = 10.0
"""End time of a model file when none is given, s."""
COMPARED = 1.0
"""Models are compared over at most so much motion when no end is given, s: errors show early."""
LISTED = 12
"""Phases shown of the beginning, and as many of the end, of a motion that has more."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code: 0 done, 1 the computation failed, 2 the input is wrong."""
    options = _parser().parse_args(arguments)
    command: Callable[[argparse.Namespace], None] = options.command
    try:
        with _warnings_on_standard_error():
            command(options)
        sys.stdout.flush()
    except BrokenPipeError:  # whoever reads, such as head, has enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # for what Python still flushes when it ends
        return DONE
    except SimulationError as error:
        return _ended(FAILED, str(error))
    except (ShaftworkError, OSError) as error:
        return _ended(WRONG_INPUT, str(error))
    except Exception as error:  # noqa: BLE001 (numpy and sympy may raise anything on laws beyond all measure)
        doing = " ".join([options.name, *([options.model] if "model" in options else [])])
        reason = " ".join(str(error).split())
        return _ended(
            FAILED, f"'{doing}' failed with {type(error).__name__}: {reason}. Look for extreme laws or values."
        )
    return DONE


def _ended(code: int, message: str) -> int:
    print(f"shaftwork: {message}", file=sys.stderr)
    return code


@contextmanager
def _warnings_on_standard_error() -> Iterator[None]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            yield
        finally:
            for warning in caught:
                print(f"warning: {warning.message}", file=sys.stderr)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="shaftwork", description="Drive trains: Kirchhoff equations, fast models, simulation and LaTeX."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def command(
        name: str, run: Callable[[argparse.Namespace], None], text: str, *, model: bool = True
    ) -> argparse.ArgumentParser:
        made = commands.add_parser(name, help=text, description=text)
        made.set_defaults(command=run, name=name)
        if model:
            made.add_argument("model", metavar="SCENE|FILE.toml", help="a ready scene or a model file")
        return made

    command("scenes", _scenes, "the ready scenes, a line each with the source", model=False)
    run = command("run", _run, "simulate: a table on the screen, plots and CSV in DIR")
    run.add_argument("--out", metavar="DIR", type=Path, help="folder for plots and CSV")
    run.add_argument("--t-end", metavar="S", type=float, help="end of the motion in s")
    run.add_argument("--rtol", type=float, default=1e-8, help="relative tolerance (default %(default)g)")
    run.add_argument(
        "--engine",
        default="auto",
        choices=("auto", "scipy", "scipy-radau", "heyoka", "sundials", "exact", "banded", "wave"),
    )
    latex = command("latex", _latex, "print the equations as LaTeX")
    forms = ("kirchhoff", "state", "second-order", "lagrange")
    latex.add_argument("--form", choices=forms, help="which equations (default: the first two)")
    latex.add_argument("--phase", metavar="WORDS", help="of one phase, such as 'gap open, load stuck'")
    latex.add_argument("--values", action="store_true", help="numbers instead of symbols")
    latex.add_argument("--document", action="store_true", help="a whole document that pdflatex compiles")
    compare = command("compare", _compare, "lumped against distributed shafts: error against run time")
    compare.add_argument("--shaft", metavar="NAME", help="which shaft (default: the first)")
    compare.add_argument(
        "--t-end", metavar="S", type=float, help=f"end of the motion in s (default: the scene's, at most {COMPARED:g})"
    )
    compare.add_argument("--out", metavar="DIR", type=Path, help="folder for picture and CSV")
    command("check", _check, "structure, states, time constants, stiffness, and the engine that auto would take")
    return parser


def _scenes(_: argparse.Namespace) -> None:
    from shaftwork.scenes import SCENES

    width = max(len(name) for name in SCENES)
    for scene in SCENES.values():
        print(f"{scene.name:{width}}  {scene.title} ({scene.source})")


def _load(name: str) -> tuple[Network, Scene | None]:
    from shaftwork.core.errors import ModelFileError
    from shaftwork.pipeline.network import Network
    from shaftwork.scenes import SCENES

    if name in SCENES:
        return SCENES[name](), SCENES[name]
    if not name.endswith(".toml"):
        raise ModelFileError(f"'{name}' is neither a scene nor a .toml file. The scenes are: {', '.join(SCENES)}.")
    return Network.load(name), None


def _run(options: argparse.Namespace) -> None:
    from shaftwork.results.summary import summary

    net, scene = _load(options.model)
    if options.out:
        _make_folder(options.out)
    t_end = options.t_end if options.t_end is not None else scene.t_end if scene else FALLBACK_END
    model = net.compile()
    solution = model.simulate(t_end, rtol=options.rtol, engine=options.engine, progress=_progress(t_end))
    signals = scene.signals if scene else _worth_seeing(solution)
    print(f"{net.name}: {t_end:g} s of motion" + (f" ({scene.source})" if scene else ""))
    for line in scene.chosen if scene else ():
        print(f"  chosen: {line}")
    print(f"engine {solution.engine}: {solution.why}")
    print(", ".join(f"{count} {name}" for name, count in solution.statistics.items()), end="; ")
    print(f"energy residual {solution.energy_residual:.1e} of the work done\n")
    print(summary(solution, signals))
    _phases(solution)
    if options.out:
        _write(solution, signals, options.out)


def _compare(options: argparse.Namespace) -> None:
    for library in ("OPENBLAS", "MKL", "OMP"):  # threads that wait for each other would count as CPU time
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    from shaftwork.components.shafts import Shaft
    from shaftwork.core.errors import ParameterError
    from shaftwork.studies import work_precision

    net, scene = _load(options.model)
    shafts = [part.name for part in net.parts if isinstance(part, Shaft)]
    if not shafts:
        raise ParameterError(
            f"'{net.name}' has no shaft whose models could be compared. Try: shaftwork compare shaft-step."
        )
    if options.out:
        _make_folder(options.out)
    t_end = options.t_end if options.t_end is not None else min(scene.t_end if scene else COMPARED, COMPARED)
    shaft = options.shaft or shafts[0]
    print(
        f"comparing over {t_end:g} s of motion (set by --t-end), after the exact solution:", file=sys.stderr, flush=True
    )
    study = work_precision(net, shaft, t_end=t_end, report=_done)
    print(f"{study}\n\n{study.advice}")
    if options.out:
        study.to_csv(options.out / "work-precision.csv")
        study.plot().savefig(options.out / "work-precision.png", dpi=150)
        print(f"\nwritten: {options.out / 'work-precision.csv'}, {options.out / 'work-precision.png'}")


def _done(trial: Trial) -> None:
    what = trial.why or f"{1e3 * trial.cpu:.3g} ms, end torques to {trial.error:.1g}"
    print(f"{trial.model} on {trial.engine}: {what}", file=sys.stderr, flush=True)


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ParameterError(f"--out {folder} is no folder to write to: {error}. Give another folder.") from None
    if not os.access(folder, os.W_OK):
        raise ParameterError(f"--out {folder} is a folder that you may not write to. Give another folder.")


def _progress(t_end: float) -> Callable[[float], None] | None:
    """A line on a terminal's standard error that shows how far a long run has come."""
    if not sys.stderr.isatty():
        return None
    progress = Progress()
    return lambda t: progress.show(t / t_end, f"{t:.4g} of {t_end:g} s")


def _worth_seeing(solution: Solution) -> tuple[str, ...]:
    """The states of a model that no scene comments; the first and last few where there are many."""
    names = tuple(name for name in solution.states if name in solution)
    return names if len(names) <= 12 else (*names[:6], *names[-6:])


def _phases(solution: Solution) -> None:
    """The phases of a motion in words; those in the middle of a long list are counted alone."""
    rows = solution.phases
    if not rows:
        return
    print(f"\n{'from s':>9} {'to s':>9}  {len(rows)} phases, {len(solution.events)} events")
    for number, row in enumerate(rows):
        if not LISTED <= number < len(rows) - LISTED:
            print(f"{row.start:9.4f} {row.end:9.4f}  {row.name}")
        elif number == LISTED:
            print(f"{'...':>9} {'...':>9}  {len(rows) - 2 * LISTED} more")


def _write(solution: Solution, signals: Sequence[str], folder: Path) -> None:
    import numpy as np

    written = [folder / "signals.csv"]
    columns = np.column_stack([solution.t, *(solution[name] for name in signals)])
    header = ",".join(["t [s]", *(f"{name} [{solution.observer.units[name]}]" for name in signals)])
    np.savetxt(written[0], columns, delimiter=",", header=header, comments="", fmt="%.12g")
    if solution.phases:
        parts = solution.phases[0].modes
        phases = ((row.start, row.end, *row.modes.values()) for row in solution.phases)
        written.append(_rows(folder / "phases.csv", ("start [s]", "end [s]", *parts), phases))
        written.append(_rows(folder / "events.csv", ("t [s]", "part", "from", "to"), solution.events))
    written.append(folder / "signals.png")
    solution.plot(*signals).savefig(written[-1], dpi=150)
    print(f"\nwritten: {', '.join(str(path) for path in written)}")


def _rows(path: Path, head: Sequence[str], rows: Iterable[Sequence[object]]) -> Path:
    import csv

    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([head, *rows])
    return path


def _latex(options: argparse.Namespace) -> None:
    net, scene = _load(options.model)
    if options.phase:
        print(_typeset(net.equations(phase=options.phase), options))
    elif options.document or not (scene and scene.phases):
        print(_typeset(net.equations(), options))
    else:
        for phase in scene.phases:
            print(rf"\section*{{{phase}}}")
            print(_typeset(net.equations(phase=phase), options))


def _typeset(equations: Equations, options: argparse.Namespace) -> str:
    if options.form == "lagrange":
        from shaftwork.equations.lagrange import lagrangian

        made = lagrangian(equations)
        return made.document(values=options.values) if options.document else made.latex(values=options.values)
    if options.document:
        return equations.document(values=options.values)
    return equations.latex(form=options.form, values=options.values)


def _check(options: argparse.Namespace) -> None:
    from shaftwork.pipeline.report import structure_report

    net, scene = _load(options.model)
    print(structure_report(net, scene.t_end if scene else FALLBACK_END))


if __name__ == "__main__":
    sys.exit(main())
