"""The command `shaftwork`: command line, messages, exit codes. Its commands are in the modules of this package."""

from __future__ import annotations

import argparse
import io
import json
import math
import os
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from shaftwork.cli import drawings, export, frequencies, inspection, live, reports, run, studies
from shaftwork.cli.command import Command
from shaftwork.core.errors import ShaftworkError, SimulationError
from shaftwork.core.notices import VALUES, on_the_command_line

DONE, FAILED, WRONG_INPUT, INTERRUPTED = 0, 1, 2, 130
COMMANDS: tuple[Command, ...] = (
    inspection.scenes,
    inspection.check,
    inspection.latex,
    drawings.draw,
    run.run,
    reports.report,
    live.open_page,
    frequencies.modes,
    frequencies.campbell,
    frequencies.torsional,
    studies.sweep,
    studies.compare,
    export.export,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code.

    0 done, 1 the computation failed, 2 the input is wrong, 130 interrupted with Ctrl-C.
    """
    line = sys.argv[1:] if arguments is None else list(arguments)
    options = _parser().parse_args(line)
    options.line = line
    _write_what_a_terminal_cannot_show_as_escapes()
    try:
        values = "--initial" if "initial" in options and "at" not in options else VALUES
        with on_the_command_line(values), _warnings_on_standard_error():
            data = options.command.run(options, _silent if options.json else _say)
            if options.json:
                print(json.dumps(_plain(data), indent=2, ensure_ascii=False, allow_nan=False))
        sys.stdout.flush()
    except KeyboardInterrupt as stop:
        return _ended(INTERRUPTED, ": ".join(["interrupted", *map(str, stop.args)]))
    except BrokenPipeError:  # whoever reads, such as head, has enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # for what Python still flushes when it ends
        return DONE
    except SimulationError as error:
        return _ended(FAILED, str(error))
    except (ShaftworkError, OSError) as error:
        return _ended(WRONG_INPUT, str(error))
    except Exception as error:  # noqa: BLE001 (numpy and sympy may raise anything on laws beyond all measure)
        doing = " ".join([options.command.name, *([options.model] if "model" in options else [])])
        reason = " ".join(str(error).split())
        return _ended(
            FAILED, f"'{doing}' failed with {type(error).__name__}: {reason}. Look for extreme laws or values."
        )
    return DONE


def _say(text: str) -> None:
    print(text, flush=True)


def _silent(_: str) -> None:
    pass


def _ended(code: int, message: str) -> int:
    print(f"shaftwork: {message}", file=sys.stderr)
    return code


def _plain(data: Any) -> Any:
    """A result in the words of JSON, which has no infinity and no NaN."""
    if isinstance(data, Mapping):
        return {str(key): _plain(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_plain(value) for value in data]
    if hasattr(data, "tolist"):
        return _plain(data.tolist())
    if isinstance(data, float):
        return float(data) if math.isfinite(data) else None
    return data


def _write_what_a_terminal_cannot_show_as_escapes() -> None:
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


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
    version = sys.modules[__name__.partition(".")[0]].__version__
    parser.add_argument("--version", action="version", version=f"%(prog)s {version}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for command in COMMANDS:
        subparser = commands.add_parser(command.name, help=command.text, description=command.text)
        subparser.set_defaults(command=command, json=False)
        if command.model:
            subparser.add_argument("model", metavar="SCENE|FILE.toml", help="a ready scene or a model file")
            subparser.add_argument(
                "--set",
                metavar="PART.PARAMETER=X",
                action="append",
                default=[],
                help="another value, in SI or with its unit: shaft.c=2e4, 'J1.J=3 kg*m^2'; as often as needed",
            )
            subparser.add_argument(
                "--trust",
                metavar="PACKAGE",
                action="append",
                default=[],
                help="a package whose modules may run where the file names them for parts; as often as needed",
            )
        if command.declare:
            command.declare(subparser)
        if command.machines:
            subparser.add_argument("--json", action="store_true", help="the result as JSON instead of words")
    return parser
