"""What a command is, and the options that several have."""

from __future__ import annotations

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Say = Callable[[str], None]
"""Prints a line for people; with `--json` nothing."""
Data = Mapping[str, Any]
"""A result for machines."""

FALLBACK_END = 10.0
"""End time of a model file when none is given, s."""
ENGINES = ("auto", "scipy", "scipy-radau", "heyoka", "sundials", "exact", "banded", "wave")


@dataclass(frozen=True)
class Command:
    """One of the commands of `shaftwork`.

    Args:
        name: as it is written.
        text: what it does, one line.
        run: does it; says lines for people and returns the same for machines.
        arguments: declares its options.
        model: whether it is about a scene or a model file.
        machines: whether it takes `--json`.
    """

    name: str
    text: str
    run: Callable[[Namespace, Say], Data]
    arguments: Callable[[ArgumentParser], None] = lambda _: None
    model: bool = True
    machines: bool = False


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
        "--engine", default="auto", choices=ENGINES, metavar="NAME", help=f"one of {', '.join(ENGINES)}"
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
