"""Natural frequencies, at one point and over the speed: `shaftwork modes` and `shaftwork campbell`."""

from __future__ import annotations

import math
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from functools import partial

from shaftwork.cli.command import Data, Say, command, folder_option, load, point_of, point_options
from shaftwork.cli.folder import Folder, write_picture
from shaftwork.cli.settings import follows_speed, point
from shaftwork.core.errors import ParameterError
from shaftwork.core.files import write_rows

HEAD = ("mode", "frequency [Hz]", "damping", "rate, real part [1/s]", "rate, imaginary part [1/s]", "moves most")


def modes_options(parser: ArgumentParser) -> None:
    """The options of `shaftwork modes`."""
    point_options(parser)
    folder_option(parser, "the shapes as a picture and a table as CSV")


@command("natural frequencies, damping and shapes", modes_options, machines=True)
def modes(options: Namespace, say: Say) -> Data:
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


def campbell_options(parser: ArgumentParser) -> None:
    """The options of `shaftwork campbell`."""
    parser.add_argument("--n-max", metavar="N", type=float, required=True, help="highest speed in 1/min")
    parser.add_argument("--n-min", metavar="N", type=float, default=0.0, help="lowest speed in 1/min (default 0)")
    parser.add_argument(
        "--orders", metavar="K,...", type=_orders, default=(1.0, 2.0, 3.0), help="excitations per turn (default 1,2,3)"
    )
    point_options(parser, "; J1.omega=n or J2.omega=n/3 follows the speed n")
    folder_option(parser, "the diagram and its crossings as CSV")


@command("natural frequencies and orders over the speed of a shaft", campbell_options, machines=True)
def campbell(options: Namespace, say: Say) -> Data:
    """Where excitation orders of a turning shaft meet natural frequencies."""
    import numpy as np

    net, _ = load(options)
    if not 0 <= options.n_min < options.n_max < math.inf:
        raise ParameterError(
            f"--n-min {options.n_min:g} --n-max {options.n_max:g}: give two speeds in 1/min, the lower one 0 or more, "
            "such as --n-min 0 --n-max 3000."
        )
    folder = Folder(options.out, ("campbell.csv", "campbell.png"), options.line) if options.out else None
    speeds = np.linspace(options.n_min, options.n_max, 61) * math.pi / 30
    moves = any(map(follows_speed, options.at)) and not options.steady
    at = partial(point, options.at) if moves else point_of(options, net)
    wanted = {"count": options.count, "exact": options.exact, "t": options.t}
    diagram = net.campbell(speeds, options.orders, options.f_max, at=at, **wanted)
    say(str(diagram))
    rows = [(one.speed * 30 / math.pi, one.speed, one.order, one.frequency, one.mode) for one in diagram.crossings]
    if folder:
        with folder.new_files(say) as place:
            write_rows(place / "campbell.csv", ("speed [1/min]", "speed [rad/s]", "order", "f [Hz]", "mode"), rows)
            write_picture(place / "campbell.png", diagram.plot)
    keys = ("n", "speed", "order", "frequency", "mode")
    return {"network": diagram.title, "crossings": [dict(zip(keys, row, strict=True)) for row in rows]}


def _orders(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(order) for order in text.split(","))
    except ValueError:
        raise ArgumentTypeError(f"{text!r} must be numbers with commas between them, such as 1,2,3.") from None
