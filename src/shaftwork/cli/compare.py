"""`shaftwork compare`."""

from __future__ import annotations

import dataclasses
import os
import sys
from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING

from shaftwork.cli.command import Command, Data, Say, end_option, folder_option
from shaftwork.cli.folder import Folder, write_picture
from shaftwork.cli.models import end_of, load
from shaftwork.core.errors import ParameterError

if TYPE_CHECKING:
    from shaftwork.studies.work_precision import Trial

FILES = ("work-precision.csv", "work-precision.png")
COMPARED = 1.0
"""Models are compared over at most so much motion when no end is given, s: errors show early."""


def arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.add_argument("--shaft", metavar="NAME", help="which shaft (default: the first)")
    end_option(parser, f"that of the scene, at most {COMPARED:g}")
    folder_option(parser, "picture and CSV")


def run(options: Namespace, say: Say) -> Data:
    """Error of the end torques against run time, model by model."""
    for library in ("OPENBLAS", "MKL", "OMP"):  # threads that wait for each other would count as CPU time
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    from shaftwork.components.shafts import Shaft
    from shaftwork.studies import work_precision

    net, scene = load(options)
    shafts = [part.name for part in net.parts if isinstance(part, Shaft)]
    if not shafts:
        raise ParameterError(
            f"'{net.name}' has no shaft whose models could be compared. Try: shaftwork compare shaft-step."
        )
    t_end = end_of(options, scene)
    t_end = t_end if options.t_end is not None else min(t_end, COMPARED)
    folder = Folder(options.out, FILES, options.line) if options.out else None
    begun = f"comparing over {t_end:g} s of motion (set by --t-end), after the exact solution:"
    print(begun, file=sys.stderr, flush=True)
    done: list[Trial] = []

    def report(trial: Trial) -> None:
        done.append(trial)
        what = trial.why or f"{1e3 * trial.cpu:.3g} ms, end torques to {trial.error:.1g}"
        print(f"{trial.model} on {trial.engine}: {what}", file=sys.stderr, flush=True)

    try:
        study = work_precision(net, options.shaft or shafts[0], t_end=t_end, report=report)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"{len(done)} models are done, as told above; nothing was written") from None
    say(f"{study}\n\n{study.advice}")
    if folder:
        with folder.new_files(say) as place:
            study.to_csv(place / "work-precision.csv")
            write_picture(place / "work-precision.png", study.plot)
    return dataclasses.asdict(study)


COMMAND = Command("compare", "lumped against distributed shafts: error against run time", run, arguments, machines=True)
