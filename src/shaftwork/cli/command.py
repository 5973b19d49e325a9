"""What a command is, the options that several have, and what they stand for."""

from __future__ import annotations

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shaftwork.cli.settings import point, with_settings
from shaftwork.core.errors import ModelFileError, ParameterError
from shaftwork.integrate.engines import ENGINE_NAMES

if TYPE_CHECKING:
    from shaftwork.pipeline.model import Model
    from shaftwork.pipeline.network import Network
    from shaftwork.scenes.catalog import Scene

Say = Callable[[str], None]
"""Prints a line for people; with `--json` nothing."""
Data = Mapping[str, Any]
"""A result for machines."""


@dataclass(frozen=True)
class Command:
    """One of the commands of `shaftwork`, under the name of the function that does it.

    Args:
        run: does it; says lines for people and returns the same for machines.
        text: what it does, one line.
        declare: declares its options.
        model: whether it is about a scene or a model file.
        machines: whether it takes `--json`.
    """

    run: Callable[[Namespace, Say], Data]
    text: str
    declare: Callable[[ArgumentParser], None] | None
    model: bool
    machines: bool

    @property
    def name(self) -> str:
        """The name under which it is called; that of its function may say more."""
        return self.run.__name__.partition("_")[0]


def command(
    text: str, declare: Callable[[ArgumentParser], None] | None = None, *, model: bool = True, machines: bool = False
) -> Callable[[Callable[[Namespace, Say], Data]], Command]:
    """Make a function a command; arguments as of `Command`."""
    return lambda run: Command(run, text, declare, model, machines)


def folder_option(parser: ArgumentParser, what: str) -> None:
    """The option `--out`."""
    parser.add_argument("--out", metavar="DIR", type=_folder, help=f"folder for {what}; files of an older run go")


def end_option(parser: ArgumentParser, default: str) -> None:
    """The option `--t-end`."""
    parser.add_argument("--t-end", metavar="S", type=float, help=f"end of the motion in s (default: {default})")


def solver_options(parser: ArgumentParser) -> None:
    """The options `--rtol` and `--engine`."""
    parser.add_argument("--rtol", type=float, default=1e-8, help="relative tolerance (default %(default)g)")
    parser.add_argument(
        "--engine", default="auto", choices=ENGINE_NAMES, metavar="NAME", help=f"one of {', '.join(ENGINE_NAMES)}"
    )


def start_options(parser: ArgumentParser) -> None:
    """The options that say how a motion starts."""
    parser.add_argument(
        "--initial",
        metavar="PART.QUANTITY=X",
        action="append",
        default=[],
        help="start value of a speed, twist or torque, in SI or with its unit: J1.omega=8.5, 'J1.omega=80 rpm'; all "
        "else is at rest; as often as needed",
    )
    parser.add_argument(
        "--steady",
        action="store_true",
        help="start in the steady state at t = 0 instead of at rest; --initial then gives other values to some of it",
    )


def point_options(parser: ArgumentParser, besides: str = "") -> None:
    """The options that say about which point a network is linearised, and how many modes are wanted."""
    parser.add_argument(
        "--at",
        metavar="NAME=X",
        action="append",
        default=[],
        help=f"a speed, twist or torque of the point, in SI or with its unit: J1.omega=8.5, 'J1.omega=80 rpm'{besides}",
    )
    parser.add_argument("--steady", action="store_true", help="about the steady operation instead of rest")
    parser.add_argument(
        "--t", metavar="S", type=float, help="time in s at which laws are read (default: after their last change)"
    )
    parser.add_argument("--count", metavar="N", type=int, help="modes wanted, the lowest (default: all)")
    parser.add_argument("--f-max", metavar="HZ", type=float, help="highest frequency in Hz")
    parser.add_argument("--exact", action="store_true", help="shafts as they are, without a mesh")


def _folder(text: str) -> Path:
    if not text.strip():
        raise ArgumentTypeError("'' names no folder. Write --out . for this one.")
    return Path(text)


def load(options: Namespace) -> tuple[Network, Scene | None]:
    """The network of a scene or a model file with the values that were set, and the scene if it is one.

    Raises:
        ModelFileError: it is neither.
        ParameterError: a value cannot be set.
    """
    from shaftwork.pipeline.network import Network
    from shaftwork.scenes import SCENES

    name = options.model
    scene = SCENES.get(name)
    if scene is None and not name.endswith(".toml"):
        raise ModelFileError(f"'{name}' is neither a scene nor a .toml file. The scenes are: {', '.join(SCENES)}.")
    return with_settings(Network.load(name, trust=options.trust) if scene is None else scene(), options.set), scene


def end_of(options: Namespace, scene: Scene | None) -> float:
    """The end of the motion in s: as given, of the scene, or `FALLBACK_END`.

    Raises:
        ParameterError: no motion can end then.
    """
    from shaftwork.pipeline.arguments import FALLBACK_END, time_span

    end = options.t_end if options.t_end is not None else scene.t_end if scene else FALLBACK_END
    return time_span(0.0, end)[1]


def start_of(options: Namespace, model: Model) -> dict[str, float] | None:
    """The start values of a motion: of the steady state at t = 0 where that is wanted, with those given; None for rest.

    Raises:
        ParameterError: a start value is none.
        SimulationError: there is no steady state.
    """
    from shaftwork.pipeline.settled import steady_start

    values = point(options.initial, option="--initial")
    return steady_start(model, values) if options.steady else values or None


def point_of(options: Namespace, net: Network) -> dict[str, float] | None:
    """The point about which a network is linearised: as named, the steady operation, or None for rest.

    Raises:
        ParameterError: both are asked for.
        SimulationError: there is no steady operation.
    """
    if options.steady and options.at:
        raise ParameterError("--steady and --at both name a point. Leave out one of them.")
    if options.steady:
        model = net.compile()
        return model.steady_state() if options.t is None else model.steady_state(t=options.t)
    return point(options.at) or None
