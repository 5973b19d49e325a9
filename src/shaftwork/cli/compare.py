"""`shaftwork compare`."""

from __future__ import annotations

import os
import sys
from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from shaftwork.cli.command import ENGINES, Command, Data, Say, end_option, folder_option
from shaftwork.cli.folder import Folder, write_picture
from shaftwork.cli.models import end_of, load
from shaftwork.core.errors import ParameterError, SimulationError

if TYPE_CHECKING:
    from shaftwork.studies.work_precision_result import Trial

FILES = ("work-precision.csv", "work-precision.png", "torques.png")
COMPARED = 1.0
"""Models are compared over at most so much motion when no end is given, s: errors show early."""


def arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.add_argument("--shaft", metavar="NAME", help="which shaft (default: the first)")
    parser.add_argument(
        "--models",
        metavar="MODEL",
        nargs="+",
        help="models, as Lumped, Lumped(20) or CentralDifference(closure='printed') (default: a ladder of all)",
    )
    parser.add_argument("--sizes", metavar="M", nargs="+", type=int, help="sizes of models that are named without one")
    parser.add_argument(
        "--engines", metavar="NAME", nargs="+", default=["auto"], choices=ENGINES, help=f"some of {', '.join(ENGINES)}"
    )
    parser.add_argument(
        "--rtol", metavar="X", nargs="+", type=float, default=[1e-8], help="relative tolerances (default: 1e-8)"
    )
    parser.add_argument("--budget", metavar="S", type=float, default=45.0, help="CPU time in s (default: %(default)g)")
    end_option(parser, f"that of the scene, at most {COMPARED:g}")
    folder_option(parser, "pictures and CSV")


def run(options: Namespace, say: Say) -> Data:
    """Error of the end torques against run time, model by model."""
    for library in ("OPENBLAS", "MKL", "OMP"):  # threads that wait for each other would count as CPU time
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    from shaftwork.components.shafts import Shaft
    from shaftwork.studies import work_precision
    from shaftwork.studies.study_arguments import rungs
    from shaftwork.studies.work_precision_result import milliseconds

    net, scene = load(options)
    shafts = [part.name for part in net.parts if isinstance(part, Shaft)]
    if not shafts:
        raise ParameterError(
            f"'{net.name}' has no shaft whose models could be compared. Try: shaftwork compare shaft-step."
        )
    t_end = end_of(options, scene)
    t_end = t_end if options.t_end is not None else min(t_end, COMPARED)
    folder = Folder(options.out, FILES, options.line) if options.out else None
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
            options.shaft or shafts[0],
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


COMMAND = Command("compare", "lumped against distributed shafts: error against run time", run, arguments, machines=True)
