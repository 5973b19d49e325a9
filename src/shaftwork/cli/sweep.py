"""`shaftwork sweep`."""

from __future__ import annotations

import re
from argparse import ArgumentParser, Namespace

from shaftwork.cli.command import Command, Data, Say, end_option, folder_option, solver_options, start_options
from shaftwork.cli.folder import Folder, write_picture
from shaftwork.cli.models import end_of, load
from shaftwork.cli.settings import point, varied
from shaftwork.core.errors import ParameterError

FILES = ("sweep.csv", "sweep.png")


def arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
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


def run(options: Namespace, say: Say) -> Data:
    """Every combination of values, measured and judged."""
    from shaftwork.studies import sweep

    net, scene = load(options)
    folder = Folder(options.out, FILES, options.line) if options.out else None
    try:
        made = sweep(
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
    say(str(made))
    if made.why:
        say(f"\n{made.why}")
    if folder:
        with folder.new_files(say) as place:
            made.to_csv(place / "sweep.csv")
            write_picture(place / "sweep.png", made.plot)
    return {"network": made.name, "columns": made.columns, "why": made.why}


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


COMMAND = Command("sweep", "variants of a model: every combination of values, measured", run, arguments, machines=True)
