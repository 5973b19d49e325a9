"""The moving train of a network, and how far it has turned as it is shown: slowed down, with enlarged twists."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.integrate import cumulative_simpson

from shaftwork.core.errors import SignalError
from shaftwork.results.observer import Array, Observer

FASTEST = np.pi
"""Of what is shown, rad/s: half a turn per second can be followed by eye."""
TWIST = np.pi / 6
"""Largest twist as shown, rad."""
SPEEDS = ("omega", "v")
"""Of nodes that turn and of nodes that slide."""
TWISTS = ("phi_rel", "phi", "s_rel", "s")
"""How far the two ends of a part are turned or shifted against each other; of a gap it is an angle of its own."""


class TrainNode(NamedTuple):
    """A node with the quantity that is its speed, and whether it turns; else it slides."""

    name: str
    speed: str
    turns: bool


class TrainPart(NamedTuple):
    """A part at moving nodes.

    Args:
        name: of the part.
        nodes: their numbers, each once, in the order of its ports.
        twist: the quantity that is its twist; empty where none is read.
        torque: the quantity that twists it between its two nodes; empty where nothing does.
    """

    name: str
    nodes: tuple[int, ...]
    twist: str = ""
    torque: str = ""


@dataclass(frozen=True, eq=False)
class Turning:
    """Angles of the nodes of a train over time.

    Args:
        angles: (k, n) as shown, rad; of nodes that slide, m.
        slowed: by which turning is slower than it is.
        enlarged: by which twists are larger than they are.
    """

    angles: Array
    slowed: float
    enlarged: float

    @property
    def words(self) -> str:
        """How it is shown."""
        turning = f"slowed {self.slowed:g} times" if self.slowed > 1 else "as it is"
        return f"turning {turning}, twists " + (
            f"enlarged {self.enlarged:g} times" if self.enlarged > 1 else "as they are"
        )


@dataclass(frozen=True)
class Train:
    """The moving nodes of a network in its order, and the parts at them; the inside of a long shaft is in none."""

    nodes: tuple[TrainNode, ...]
    parts: tuple[TrainPart, ...]

    @property
    def joints(self) -> list[TrainPart]:
        """The parts that something twists."""
        return [part for part in self.parts if part.torque]

    @cached_property
    def _twisting(self) -> tuple[Array, Array]:
        """(m, n) differences of angles over the joints, and (n, m) their pseudoinverse."""
        differences = np.zeros((len(self.joints), len(self.nodes)))
        for row, part in zip(differences, self.joints, strict=True):
            row[part.nodes[0]], row[part.nodes[1]] = 1.0, -1.0
        return differences, np.asarray(np.linalg.pinv(differences), dtype=float)

    def turning(self, times: Array, read: Callable[[str], Array], shown_seconds: float) -> Turning:
        """The angles of a motion as they are shown.

        Law: with the differences D over the joints, nodes that joints connect turn together by the mean of their
        angles, (1 - D+ D) phi, divided by `slowed`, and differ from it by `enlarged` times D+ twists, which is the
        least departure that has these twists. Both factors are 1, 2 or 5 times a power of ten, and at least 1.

        Args:
            times: (k,) ascending, s.
            read: a quantity at these times.
            shown_seconds: how long they are shown.
        """
        differences, inverse = self._twisting
        speeds = np.column_stack([read(node.speed) for node in self.nodes])
        true = cumulative_simpson(speeds, x=times, axis=0, initial=0.0)
        twists = true @ differences.T
        for column, part in enumerate(self.joints):  # integrals of two speeds drift apart, and begin at zero
            if part.twist:
                with suppress(SignalError):  # a spring whose stiffness was set to zero has none
                    twists[:, column] = read(part.twist)
        apart = twists @ inverse.T
        mean = true - true @ (inverse @ differences).T
        fastest = np.abs(np.diff(mean, axis=0)).max() / (shown_seconds / len(times))
        slowed = 1.0 / _rounded(FASTEST / fastest) if fastest > FASTEST else 1.0
        twist = np.abs(apart).max(initial=0.0)
        enlarged = _rounded(TWIST / twist) if 0.0 < twist < TWIST else 1.0
        return Turning(mean / slowed + enlarged * apart, slowed, enlarged)


def train_of(observer: Observer, speeds: Sequence[str] = SPEEDS) -> Train:
    """The train of a network.

    Args:
        observer: of the network.
        speeds: those of nodes that are in it, "omega" of what turns and "v" of what slides.
    """
    units, nodes_of = observer.units, observer.nodes_of
    shafts = {name.rpartition(".")[0] for name in observer.profiles}  # long ones, with nodes inside
    nodes: dict[str, TrainNode] = {}
    quantities: dict[str, list[str]] = {}
    for name in units:
        owner, _, quantity = name.rpartition(".")
        ends = nodes_of(name)
        if quantity in speeds and len(ends) == 1 and ends[0].rpartition(".")[0] not in shafts:
            nodes.setdefault(ends[0], TrainNode(owner, name, quantity == SPEEDS[0]))
        if owner in observer.wiring:
            quantities.setdefault(owner, []).append(quantity)
    numbers = {node: number for number, node in enumerate(nodes)}

    def part_of(owner: str, names: Iterable[str]) -> TrainPart:
        ends = dict.fromkeys(node for name in names for node in nodes_of(f"{owner}.{name}"))
        places = tuple(numbers[node] for node in ends if node in numbers)
        twist = next((f"{owner}.{name}" for name in TWISTS if name in names), "")
        if len(places) != 2 or not (twist or owner in shafts):
            return TrainPart(owner, places)
        through = ("tau_a", "f_a") if owner in shafts else ("tau", "f")
        torque = next((f"{owner}.{name}" for name in through if name in names), "")
        return TrainPart(owner, places, twist, torque)

    return Train(tuple(nodes.values()), tuple(part_of(*item) for item in quantities.items()))


def _rounded(number: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten up to a number."""
    power: float = 10.0 ** math.floor(math.log10(number))
    return power * max(factor for factor in (1, 2, 5) if factor * power <= number * (1 + 1e-9))
