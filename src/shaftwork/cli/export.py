"""The command that writes a network for others: `shaftwork export`."""

from __future__ import annotations

import shlex
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from shaftwork.cli.command import Data, Say, command, load
from shaftwork.core.errors import ParameterError

if TYPE_CHECKING:
    from shaftwork.pipeline.network import Network


class Export(NamedTuple):
    """A format of another tool.

    Args:
        option: of the command line, without dashes.
        place: what it takes, for the help.
        text: the help.
        write: writes a network into a place with inputs, outputs and the end of an example in s.
        files: that it writes there.
    """

    option: str
    place: str
    text: str
    write: Callable[[Network, Path, list[str], list[str] | None, float], object]
    files: Callable[[Network, Path], tuple[Path, ...]] = lambda _, place: (place,)


def _c(net: Network, place: Path, inputs: list[str], outputs: list[str] | None, t_end: float) -> None:
    net.compile().to_c(place, inputs=inputs, outputs=outputs, t_end=t_end)


def _c_files(net: Network, place: Path) -> tuple[Path, ...]:
    from shaftwork.ccode.c_export import file_names

    return tuple(place / file for file in file_names(net.name))


def _fmu(net: Network, place: Path, inputs: list[str], outputs: list[str] | None, t_end: float) -> None:
    net.compile().to_fmu(place, inputs=inputs, outputs=outputs, t_end=t_end)


def _spice(net: Network, place: Path, inputs: list[str], outputs: list[str] | None, t_end: float) -> None:
    _refuse_chosen("spice", inputs, outputs)
    net.to_spice(place, t_end=t_end)


def _modelica(net: Network, place: Path, inputs: list[str], outputs: list[str] | None, t_end: float) -> None:
    _refuse_chosen("modelica", inputs, outputs)
    net.to_modelica(place, t_end=t_end)


def _refuse_chosen(option: str, inputs: list[str], outputs: list[str] | None) -> None:
    if inputs or outputs:
        raise ParameterError(f"--{option} writes all sources and quantities. Leave out --input and --output.")


EXPORTS = (
    Export("c", "DIR", "C code in a folder: equations, modes, events, integrators and an example", _c, _c_files),
    Export("fmu", "NEW.fmu", "functional mock-up unit (FMI 3.0) for model exchange and co-simulation", _fmu),
    Export("spice", "NEW.cir", "analogue circuit for ngspice", _spice),
    Export("modelica", "NEW.mo", "package in Modelica, part by part", _modelica),
)
"""The formats beside model files."""


def export_options(parser: ArgumentParser) -> None:
    """The options of `shaftwork export`."""
    parser.add_argument("file", metavar="NEW.toml", nargs="?", help="file to write (default: the screen)")
    for export in EXPORTS:
        parser.add_argument(f"--{export.option}", metavar=export.place, help=export.text)
    parser.add_argument(
        "--input",
        metavar="PART.PARAMETER",
        action="append",
        default=[],
        help="what the other program sets as it runs, in place of its law: motor.tau; as often as needed",
    )
    parser.add_argument(
        "--output", metavar="NAME", action="append", help="a quantity that it tells (default: all); as often as needed"
    )
    parser.add_argument("--replace", action="store_true", help="write over files that exist")


@command("the model file of a scene; or C code, FMU, SPICE, Modelica", export_options)
def export(options: Namespace, say: Say) -> Data:
    """The model file of a scene, or of another model file with other values; or the same for other tools."""
    chosen = [one for one in EXPORTS if getattr(options, one.option) is not None]
    if not chosen:
        _refuse_without(options)
        return _model_file(options, say)
    if options.file is not None:
        raise ParameterError(f"'{options.file}' and --{chosen[0].option} both name a place to write to. Leave out one.")
    from shaftwork.pipeline.arguments import FALLBACK_END

    net, scene = load(options)
    places = [(one, Path(getattr(options, one.option))) for one in chosen]
    files = [file for one, place in places for file in one.files(net, place)]
    _refuse_existing(files, options)
    for one, place in places:
        one.write(net, place, options.input, options.output, scene.t_end if scene else FALLBACK_END)
    for file in files:
        say(f"written: {file}")
    return {}


def _refuse_existing(files: Iterable[Path], options: Namespace) -> None:
    for file in files:
        if file.is_file() and not options.replace:
            raise ParameterError(f"'{file}' exists already. Give another name, or write over it by --replace.")


def _refuse_without(options: Namespace) -> None:
    if options.input or options.output:
        names = " or ".join(f"--{one.option}" for one in EXPORTS)
        raise ParameterError(f"A model file has no --input and --output. Add {names}, or leave them out.")


def _model_file(options: Namespace, say: Say) -> Data:
    from shaftwork.modelfiles.storage import netlist_text

    net, scene = load(options)
    if options.file is None:
        say(netlist_text(net.netlist()).rstrip("\n"))
    else:
        path = Path(options.file)
        if path.suffix != ".toml":
            raise ParameterError(f"'{path}' must end in .toml, so that the other commands take it for a model file.")
        _refuse_existing([path], options)
        net.save(path)
        say(f"written: {path}")
    if scene:
        line = shlex.join(["shaftwork", "run", options.file or "FILE.toml", "--t-end", f"{scene.t_end:g}"])
        print(f"A model file has no end time. For the motion of the scene: {line}", file=sys.stderr)
    return {}
