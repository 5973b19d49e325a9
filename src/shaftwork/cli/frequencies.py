"""Vibrations: `shaftwork modes` at one point, `shaftwork campbell` and `shaftwork torsional` over the speed."""

from __future__ import annotations

import math
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

from shaftwork.cli.command import Data, Say, command, folder_option, load, point_of, point_options
from shaftwork.cli.folder import Folder, write_picture
from shaftwork.cli.settings import follows_speed, named, once, point, speeds_in
from shaftwork.core.errors import ParameterError
from shaftwork.core.files import write_rows
from shaftwork.core.screen import MOST_MODES, in_columns

if TYPE_CHECKING:
    from shaftwork.pipeline.network import Network
    from shaftwork.torsional import Section, TorsionalCalculation

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
    orders_option(parser)
    point_options(parser, "; J1.omega=n or J2.omega=n/3 follows the speed n")
    folder_option(parser, "the diagram and its crossings as CSV")


@command("natural frequencies and orders over the speed of a shaft", campbell_options, machines=True)
def campbell(options: Namespace, say: Say) -> Data:
    """Where excitation orders of a turning shaft meet natural frequencies."""
    import numpy as np

    from shaftwork.results.observer import RPM

    net, _ = load(options)
    if not 0 <= options.n_min < options.n_max < math.inf:
        raise ParameterError(
            f"--n-min {options.n_min:g} --n-max {options.n_max:g}: give two speeds in 1/min, the lower one 0 or more, "
            "such as --n-min 0 --n-max 3000."
        )
    folder = Folder(options.out, ("campbell.csv", "campbell.png"), options.line) if options.out else None
    speeds = np.linspace(options.n_min, options.n_max, 61) / RPM
    moves = any(map(follows_speed, options.at)) and not options.steady
    at = partial(point, options.at) if moves else point_of(options, net)
    wanted = {"count": options.count, "exact": options.exact, "t": options.t}
    diagram = net.campbell(speeds, options.orders, options.f_max, at=at, **wanted)
    say(str(diagram))
    rows = [(one.speed * RPM, one.speed, one.order, one.frequency, one.mode) for one in diagram.crossings]
    if folder:
        with folder.new_files(say) as place:
            write_rows(place / "campbell.csv", ("speed [1/min]", "speed [rad/s]", "order", "f [Hz]", "mode"), rows)
            write_picture(place / "campbell.png", diagram.plot)
    keys = ("n", "speed", "order", "frequency", "mode")
    return {"network": diagram.title, "crossings": [dict(zip(keys, row, strict=True)) for row in rows]}


def orders_option(parser: ArgumentParser) -> None:
    """The option `--orders` of a Campbell diagram."""
    parser.add_argument(
        "--orders", metavar="K,...", type=_orders, default=(1.0, 2.0, 3.0), help="excitations per turn (default 1,2,3)"
    )


def _orders(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(order) for order in text.split(","))
    except ValueError:
        raise ArgumentTypeError(f"{text!r} must be numbers with commas between them, such as 1,2,3.") from None


def calculation_options(parser: ArgumentParser) -> None:
    """The options that say what a torsional calculation is about."""
    speeds = "speeds of the reference shaft in 1/min, as first:last:count or with commas between them"
    parser.add_argument("--speeds", metavar="N:N:COUNT", help=speeds)
    section = (
        "diameter, bore, scf, design, strength and alloy of the shaft NAME, in SI or with units; as often as needed"
    )
    parser.add_argument("--cross-section", metavar="NAME;KEY=X;...", action="append", default=[], help=section)
    parser.add_argument("--rated", metavar="N", type=float, help="maximum continuous speed in 1/min, for limits")
    permissible = "vibratory torque in N m, or with its unit, that the part NAME bears; as often as needed"
    parser.add_argument("--permissible", metavar="NAME=X", action="append", default=[], help=permissible)
    misfire = "a cylinder without swing, or with a share of it; as often as needed"
    parser.add_argument("--misfire", metavar="NAME[=SHARE]", action="append", default=[], help=misfire)
    parser.add_argument("--exact", action="store_true", help="shafts as they are, without a mesh")


def calculation_of(options: Namespace, net: Network) -> TorsionalCalculation:
    """The torsional calculation that the options ask for.

    Raises:
        ParameterError: speeds are missing, or an option is wrong.
        MissingExtraError: a value has a unit, and pint is not installed.
    """
    from shaftwork.results.observer import RPM
    from shaftwork.torsional.calculation import torsional_calculation

    if options.speeds is None:
        raise ParameterError("A torsional calculation needs speeds of the shaft in 1/min, such as --speeds 300:900:61.")
    sections = [_section(text) for text in options.cross_section]
    if options.rated is None and (bare := [one.shaft for one in sections if one.design is not None]):
        raise ParameterError(
            f"The cross-section of '{bare[0]}' has a design, whose permitted stress depends on the rated speed. Give "
            "--rated, the maximum continuous speed in 1/min."
        )
    return torsional_calculation(
        net,
        speeds_in(options.speeds),
        sections=sections,
        permissible=point(options.permissible, option="--permissible"),
        rated=None if options.rated is None else options.rated / RPM,
        misfire=once("--misfire", map(_misfire, options.misfire)) or None,
        exact=options.exact,
    )


def _section(text: str) -> Section:
    """A section as "NAME; diameter=0.12; design=propeller".

    Raises:
        ParameterError: it is none; says what is wrong.
    """
    from shaftwork.torsional.shaft_sections import Section

    shaft, *pairs = (piece.strip() for piece in text.split(";"))
    example = "'shaft; diameter=0.12; scf=1.4'"
    values: dict[str, Any] = once("--cross-section", (named(pair, "--cross-section", example) for pair in pairs))
    for name, written in values.items():
        if name not in Section.__dataclass_fields__ or name == "shaft":
            there = ", ".join(field for field in Section.__dataclass_fields__ if field != "shaft")
            raise ParameterError(f"--cross-section {text!r}: there is no {name!r}. There are: {there}.")
        if name == "alloy":
            values[name] = written.lower() in ("yes", "true")
        elif name != "design":
            values |= point([f"{name}={written}"], option="--cross-section")
    return Section(shaft, **values)


def _misfire(text: str) -> tuple[str, float]:
    """A cylinder and the share of its swing that is left.

    Raises:
        ParameterError: the share is no number.
    """
    if "=" not in text:
        return text.strip(), 0.0
    name, share = named(text, "--misfire", "'combustion 2=0.3'")
    try:
        return name, float(share)
    except ValueError:
        raise ParameterError(f"--misfire {text!r}: write a share from 0 to 1, as in 'combustion 2=0.3'.") from None


def torsional_options(parser: ArgumentParser) -> None:
    """The options of `shaftwork torsional`."""
    calculation_options(parser)
    parser.add_argument("--csv", metavar="FILE", help="write the response here, a row for each shaft and speed")
    folder_option(parser, "pictures of the response and tables as CSV")


TORSIONAL_FILES = ("torsional.csv", "resonances.csv", "torsional.png")
RESPONSE = ("shaft", "speed [1/min]", "torque [N*m]", "stress [Pa]", "tau_c [Pa]", "tau_t [Pa]")
RESONANCES = ("speed [1/min]", "order", "f [Hz]", "damping", "mode")


@command("torsional vibration by orders: modes, vibratory torques, limits", torsional_options, machines=True)
def torsional(options: Namespace, say: Say) -> Data:
    """Forced torsional vibration over the speed, with its modes, resonances and limits."""
    from shaftwork.results.observer import RPM

    net, _ = load(options)
    folder = Folder(options.out, TORSIONAL_FILES, options.line) if options.out else None
    calculation = calculation_of(options, net)
    modes = calculation.modes.modes[:MOST_MODES]
    largest = [max(mode.masses, key=lambda mass: abs(mass.amplitude)).name for mode in modes]
    rows = [
        (mode.name, f"{mode.frequency:.6g}", f"{60 * mode.frequency:.6g}", f"{mode.damping:.4g}", mass)
        for mode, mass in zip(modes, largest, strict=True)
    ]
    met = [(one.speed * RPM, one.order, one.frequency, one.damping, one.mode) for one in calculation.resonances]
    cells = [(f"{n:.6g}", f"{k:g}", f"{f:.6g}", f"{damping:.4g}", mode) for n, k, f, damping, mode in met]
    say("\n".join(in_columns([("mode", "Hz", "1/min", "damping", "moves most"), *rows])))
    say("\n" + "\n".join(in_columns([("resonance at 1/min", "order", "Hz", "damping", "mode"), *cells])))
    say(f"\n{calculation}")
    if options.csv:
        write_rows(options.csv, RESPONSE, _response(calculation))
        say(f"\nwritten: {options.csv}")
    if folder:
        with folder.new_files(say) as place:
            write_rows(place / "torsional.csv", RESPONSE, _response(calculation))
            write_rows(place / "resonances.csv", RESONANCES, met)
            write_picture(place / "torsional.png", calculation.plot)
    return {
        "network": calculation.title,
        "modes": [
            {"name": mode.name, "frequency": mode.frequency, "damping": mode.damping, "moves_most": mass}
            for mode, mass in zip(modes, largest, strict=True)
        ],
        "resonances": [dict(zip(("n", "order", "frequency", "damping", "mode"), row, strict=True)) for row in met],
        "shafts": [
            {"shaft": one.shaft, "torque": one.amplitude.max(), "verdict": one.verdict, "permitted": one.permitted}
            for one in calculation.values()
        ],
        "barred": [[start * RPM, end * RPM] for start, end in calculation.barred],
        "permitted": calculation.permitted,
    }


def _response(calculation: TorsionalCalculation) -> Iterator[tuple[Any, ...]]:
    """Rows of `RESPONSE`; empty where a shaft has no section or no limits."""
    from shaftwork.results.observer import RPM

    for one in calculation.values():
        stress = [""] * len(one.speeds) if one.section is None else one.stress.tolist()
        limits = [("", "")] * len(one.speeds) if one.limits is None else list(zip(*one.limits, strict=True))
        for n, torque, nominal, permitted in zip(one.speeds * RPM, one.amplitude, stress, limits, strict=True):
            yield one.shaft, n, torque, nominal, *permitted
