"""`shaftwork export`."""

from __future__ import annotations

import shlex
import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path

from shaftwork.cli.command import Command, Data, Say
from shaftwork.cli.models import load
from shaftwork.core.errors import ParameterError


def arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.add_argument("file", metavar="NEW.toml", nargs="?", help="file to write (default: the screen)")


def run(options: Namespace, say: Say) -> Data:
    """The model file of a scene, or of another model file with other values."""
    from shaftwork.network.storage import netlist_text

    net, scene = load(options)
    if options.file is None:
        say(netlist_text(net.netlist()).rstrip("\n"))
    else:
        path = Path(options.file)
        if path.suffix != ".toml":
            raise ParameterError(f"'{path}' must end in .toml, so that the other commands take it for a model file.")
        if path.exists():
            raise ParameterError(f"'{path}' exists already. Give another name, or delete it.")
        net.save(path)
        say(f"written: {path}")
    if scene:
        line = shlex.join(["shaftwork", "run", options.file or "FILE.toml", "--t-end", f"{scene.t_end:g}"])
        print(f"A model file has no end time. For the motion of the scene: {line}", file=sys.stderr)
    return {}


COMMAND = Command("export", "the model file of a scene, to change and run", run, arguments)
