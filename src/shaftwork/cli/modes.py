"""`shaftwork modes`."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from shaftwork.cli.command import Command, Data, Say, folder_option, point_options
from shaftwork.cli.folder import Folder, write_picture, write_rows
from shaftwork.cli.models import load, point_of

HEAD = ("mode", "frequency [Hz]", "damping", "rate, real part [1/s]", "rate, imaginary part [1/s]", "moves most")


def arguments(parser: ArgumentParser) -> None:
    """The options of the command."""
    point_options(parser)
    folder_option(parser, "the shapes as a picture and a table as CSV")


def run(options: Namespace, say: Say) -> Data:
    """Natural frequencies, damping and shapes."""
    net, _ = load(options)
    folder = Folder(options.out, ("modes.csv", "modes.png"), options.line) if options.out else None
    modes = net.modes(point_of(options, net), options.count, f_max=options.f_max, exact=options.exact, t=options.t)
    say(str(modes))
    rows = [(name, f, damping, rate.real, rate.imag, node) for name, f, damping, rate, node in modes.table]
    if folder:
        with folder.new_files(say) as place:
            write_rows(place / "modes.csv", HEAD, rows)
            write_picture(place / "modes.png", modes.plot)
    keys = ("name", "frequency", "damping", "rate_real", "rate_imaginary", "moves_most")
    return {"network": modes.title, "modes": [dict(zip(keys, row, strict=True)) for row in rows]}


COMMAND = Command("modes", "natural frequencies, damping and shapes", run, arguments, machines=True)
