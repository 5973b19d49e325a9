"""Many runs of one model: `shaftwork sweep` over values, and `shaftwork compare` over shaft models."""

from __future__ import annotations

import os
import re
import sys
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
    start_options,
)
from shaftwork.cli.folder import Folder, write_picture
from shaftwork.cli.settings import point, varied
from shaftwork.core.errors import ParameterError, SimulationError
from shaftwork.integrate.engines import ENGINE_NAMES

if TYPE_CHECKING:
    from shaftwork.studies.work_precision_result import Trial

SWEEP_FILES = ("sweep.csv", "sweep.png")
COMPARISON_FILES = ("work-precision.csv", "work-precision.png", "torques.png")
COMPARED = 1.0
"""Models are compared over at most so much motion when no end is given, s: errors show early."""


def sweep_options(parser: ArgumentParser) -> None:
    """The options of `shaftwork sweep`."""
    values = "values of a parameter: with commas between them, or first:last:count; of several all combinations"
    parser.add_argument("--vary", metavar="PART.PARAMETER=X,...", action="append", required=True, help=values)
    measure = "what is measured, such as 'max shaft.tau': max, min, peak, mean, rms or end"
    parser.add_argument("--measure", metavar="WORDS", action="append", required=True, help=measure)
    parser.add_argument(
        "--require", metavar="WORDS", action="append", default=[], help="a limit, such as 'max shaft.tau<=300'"
    )
    end_option(parser, "that of the scene, else 10")
    solver_options(parser)
    start_options(parser)
    parser.add_argument("--processes", metavar="N", type=int, help="how many (default: as many as there are cores)")
    parser.add_argument(
        "--store", metavar="FILE", help="keeps what is done; the same command goes on where it was stopped"
    )
    folder_option(parser, "the table as CSV and a picture")


@command("variants of a model: every combination of values, measured", sweep_options, machines=True)
def sweep(options: Namespace, say: Say) -> Data:
    """Every combination of values, measured and judged."""
    from shaftwork.studies import sweep as sweep_of

    net, scene = load(options)
    folder = Folder(options.out, SWEEP_FILES, options.line) if options.out else None
    try:
        table = sweep_of(
            net,
            varied(net, options.vary, options.set),
            t_end=end_of(options, scene),
            measures=options.measure,
            require=_limits(options.require),
            rtol=options.rtol,
            engine=options.engine,
            initial=point(options.initial, option="--initial"),
            steady=options.steady,
            processes=options.processes,
            store=options.store,
        )
    except KeyboardInterrupt:
        done = f"what is done is in {options.store}" if options.store else "--store FILE keeps what is done"
        raise KeyboardInterrupt(f"{done}; the same command then goes on from there") from None
    say(str(table))
    if table.why:
        say(f"\n{table.why}")
    if folder:
        with folder.new_files(say) as place:
            table.to_csv(place / "sweep.csv")
            write_picture(place / "sweep.png", table.plot)
    return {"network": table.name, "columns": table.columns, "why": table.why}


def _limits(texts: list[str]) -> dict[str, tuple[float | None, float | None]]:
    limits: dict[str, dict[str, float]] = {}
    for text in texts:
        match = re.fullmatch(r"\s*([^<>=]+?)\s*(<=|>=)\s*(\S+)\s*", text)
        try:
            value = float(match[3] if match else "")
        except ValueError:
            raise ParameterError(
                f"--require {text!r}: write 'max shaft.tau<=300', or >= for a least value, with a number in the SI "
                "unit of the measure. Two limits are two --require."
            ) from None
        assert match is not None  # noqa: S101 (else there was no number)
        sides = limits.setdefault(match[1], {})
        if match[2] in sides:
            raise ParameterError(f"--require gives '{match[1]}{match[2]}' twice. Give it once.")
        sides[match[2]] = value
    return {name: (sides.get(">="), sides.get("<=")) for name, sides in limits.items()}


def compare_options(parser: ArgumentParser) -> None:
    """The options of `shaftwork compare`."""
    parser.add_argument("--shaft", metavar="NAME", help="which shaft (default: the first)")
    parser.add_argument(
        "--models",
        metavar="MODEL",
        nargs="+",
        help="models, as Lumped, Lumped(20) or CentralDifference(closure='printed') (default: a ladder of all)",
    )
    parser.add_argument("--sizes", metavar="M", nargs="+", type=int, help="sizes of models that are named without one")
    parser.add_argument(
        "--engines",
        metavar="NAME",
        nargs="+",
        default=["auto"],
        choices=ENGINE_NAMES,
        help=f"some of {', '.join(ENGINE_NAMES)}",
    )
    parser.add_argument(
        "--rtol", metavar="X", nargs="+", type=float, default=[1e-8], help="relative tolerances (default: 1e-8)"
    )
    parser.add_argument("--budget", metavar="S", type=float, default=45.0, help="CPU time in s (default: %(default)g)")
    end_option(parser, f"that of the scene, at most {COMPARED:g}")
    folder_option(parser, "pictures and CSV")


@command("lumped against distributed shafts: error against run time", compare_options, machines=True)
def compare(options: Namespace, say: Say) -> Data:
    """Error of the end torques against run time, model by model."""
    for library in ("OPENBLAS", "MKL", "OMP"):  # threads that wait for each other would count as CPU time
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    from shaftwork.components.shafts import Shaft
    from shaftwork.studies import work_precision
    from shaftwork.studies.study_arguments import rungs
    from shaftwork.studies.work_precision import affordable_end
    from shaftwork.studies.work_precision_result import milliseconds

    net, scene = load(options)
    shafts = [part.name for part in net.parts if isinstance(part, Shaft)]
    if not shafts:
        raise ParameterError(
            f"'{net.name}' has no shaft whose models could be compared. Try: shaftwork compare shaft-step."
        )
    shaft = options.shaft or shafts[0]
    wanted = end_of(options, scene)
    wanted = wanted if options.t_end is not None else min(wanted, COMPARED)
    folder = Folder(options.out, COMPARISON_FILES, options.line) if options.out else None
    t_end = affordable_end(net, shaft, wanted) if shaft in shafts else wanted
    if t_end < wanted and options.t_end is None:
        tell(f"{wanted:g} s of motion take too long with the engines that are installed; --t-end asks for them")
    elif t_end < wanted:
        tell(f"--t-end {wanted:g} takes too long with the engines that are installed; --t-end {t_end:g} would not")
        t_end = wanted
    tell(
        f"comparing over {t_end:g} s of motion (--t-end), for {options.budget:g} s of CPU (--budget) once it is known:"
    )
    done: list[Trial] = []

    def report(trial: Trial) -> None:
        done.append(trial)
        came = trial.why or f"{milliseconds(trial.cpu)} ms, end torques to {trial.error:.1g}"
        tell(f"{trial.model} on {trial.engine}: {came}")

    try:
        study = work_precision(
            net,
            shaft,
            t_end=t_end,
            models=rungs(options.models, options.sizes),
            engines=options.engines,
            rtols=options.rtol,
            budget=options.budget,
            report=report,
            tell=tell,
        )
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"{len(done)} models are done, as told above; nothing was written") from None
    say(f"{study}\n\n{study.advice}")
    if not any(trial.errors for trial in study.trials):
        why, named = next(iter(study.left_out.items()))
        raise SimulationError(f"No model of shaft '{study.shaft}' could be compared. {', '.join(named)}: {why}")
    if folder:
        with folder.new_files(say) as place:
            study.to_csv(place / "work-precision.csv")
            write_picture(place / "work-precision.png", study.plot)
            write_picture(place / "torques.png", study.plot_courses)
    return study.data


def tell(line: str) -> None:
    """What is done just now, for who waits."""
    print(line, file=sys.stderr, flush=True)
