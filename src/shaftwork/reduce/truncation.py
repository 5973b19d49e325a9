"""A chain by the modes of its pieces instead of groups, and the network that moves so."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from shaftwork.components.rotation import Inertia, PlanetaryGear, Spring
from shaftwork.pipeline.network import Network
from shaftwork.reduce.chain import Array, Chain, hertz, row_matrix
from shaftwork.reduce.groups import add_circuits, add_link, add_riders

NOTHING = 1e-12
"""A share of a mode in the speed of a place that is only rounding."""


@dataclass(frozen=True, eq=False)
class Mode:
    """How what is beyond an end of the kept shaft swings while this end is held: an inertia on a spring at this end.

    Args:
        end: 0 or 1.
        inertia: the share of the inertia beyond that swings along, kg m^2.
        c: its stiffness, N m/rad.
        d: its damping, N m s/rad.
        shares: (n,) speed of each station against the end, over that of this inertia; zero on the other side.
    """

    end: int
    inertia: float
    c: float
    d: float
    shares: Array


@dataclass(frozen=True, eq=False)
class ModalChain:
    """A chain by the two ends of one link, and modes of what is beyond them.

    Args:
        chain: as it was.
        kept: place of the link.
        ends: what turns rigidly with each of its ends, kg m^2.
        modes: lowest first.
    """

    chain: Chain
    kept: int
    ends: tuple[float, float]
    modes: tuple[Mode, ...]

    def speeds(self) -> Array:
        """(n, 2 + m) speed of each station by those of the ends and of the m inertias of modes."""
        left = np.arange(len(self.chain.stations)) <= self.kept
        made = np.array([left, ~left, *(mode.shares for mode in self.modes)], dtype=float)
        for mode in self.modes:
            made[mode.end] -= mode.shares
        return made.T

    def frequencies(self) -> Array:
        """(2 + m,) natural frequencies in Hz, ascending, 0 for the turning of the whole."""
        count = 2 + len(self.modes)
        speeds, supports = self.speeds(), np.array([station.support for station in self.chain.stations])
        stiffness = speeds.T @ (supports[:, None] * speeds)
        stiffness[:2, :2] += row_matrix([self.chain.links[self.kept].c])
        for place, mode in enumerate(self.modes, 2):
            row = np.eye(count)[place] - np.eye(count)[mode.end]
            stiffness += mode.c * np.outer(row, row)
        root = 1 / np.sqrt([*self.ends, *(mode.inertia for mode in self.modes)])
        return hertz(np.asarray(np.linalg.eigvalsh(root[:, None] * stiffness * root)), self.chain)

    def network(self, name: str) -> Network:
        """The same as a network: inertias on springs at both ends, and what sits elsewhere behind planetary gears.

        A place beyond an end has no inertia of its own; its speed is the sum of those of the end and of the modes, each
        by its share, as sun and ring sum to the carrier. So every part keeps its node.
        """
        net = Network(name)
        add_circuits(net, self.chain)
        pair = self.chain.stations[self.kept : self.kept + 2]
        for station, size in zip(pair, self.ends, strict=True):
            net.add(Inertia(station.heaviest, J=size), station.node)
        add_link(net, self.chain.links[self.kept], *pair)
        nodes = [station.node for station in pair]
        for number, mode in enumerate(self.modes, 1):
            nodes.append(f"mode {number}")
            net.add(Inertia(nodes[-1], J=mode.inertia), nodes[-1])
            net.add(Spring(f"spring of {nodes[-1]}", c=mode.c, d=mode.d), nodes[mode.end], nodes[-1])
        for station, row in zip(self.chain.stations, self.speeds(), strict=True):
            if station.riders:
                here = station.node if station in pair else _add_sum(net, station.node, nodes, row)
                add_riders(net, station, here)
        return net


def truncated(chain: Chain, unknowns: int, kept: int) -> ModalChain:
    """A chain by the ends of one link and the lowest modes of what is beyond them.

    Law: beyond an end x = 1 x_end + Phi q, with Phi the modes of the rest while the end is held. What is held at one
    place follows it rigidly, so that a mode with the participation L = Phi^T J 1 is an inertia L^2 on a spring
    L^2 omega^2 at the end, and the end has the inertia that is left. Every frequency is an upper bound. With two
    unknowns it is the model of two groups. Springs to the frame act at their places and bend no mode; gaps beyond are
    taken as closed; of the damping each mode has its own, without what it takes from others.

    Args:
        chain: stations with inertia.
        unknowns: the number of ends and modes together, from 2 to that of the stations.
        kept: place of the link.

    Source: Craig and Bampton, Coupling of substructures for dynamic analyses, AIAA Journal 6(7), 1968.
    """
    inertias = np.array([station.inertia for station in chain.stations])
    sides = (range(kept), range(kept + 2, len(inertias)))
    found = [mode for end, side in enumerate(sides) for mode in _modes(chain, inertias, end, side)]
    taken = sorted(found, key=lambda mode: mode.c / mode.inertia)[: unknowns - 2]
    sums = (inertias[: kept + 1].sum(), inertias[kept + 1 :].sum())
    left, right = (float(total - sum(m.inertia for m in taken if m.end == end)) for end, total in enumerate(sums))
    return ModalChain(chain, kept, (left, right), tuple(taken))


def _modes(chain: Chain, inertias: Array, end: int, side: range) -> Iterator[Mode]:
    """The modes of the stations beyond an end that is held."""
    if not side:
        return
    beyond = np.array(side)
    inner = np.ix_(beyond, beyond)
    stiffness, damping = (row_matrix([getattr(link, name) for link in chain.links])[inner] for name in ("c", "d"))
    squares, shapes = eigh(stiffness, np.diag(inertias[beyond]))
    for square, shape in zip(squares, shapes.T, strict=True):
        takes_part = float(shape @ inertias[beyond])
        shares = np.zeros(len(inertias))
        shares[beyond] = takes_part * shape
        size = takes_part**2
        yield Mode(end, size, size * float(square), size * float(shape @ damping @ shape), shares)


def _add_sum(net: Network, node: str, nodes: list[str], shares: Array) -> str:
    """Add planetary gears by which a node turns as the sum of shares of others, and return its name.

    The shares sum to one. Positive ones first, the largest of all first, every sum on the way is positive: so each gear
    has a ratio above zero. A node that turns with one other alone is that one.
    """
    terms = [(float(share), each) for share, each in zip(shares, nodes, strict=True) if abs(share) > NOTHING]
    (total, here), *rest = sorted(terms, reverse=True)
    for number, (share, other) in enumerate(rest, 1):
        there = node if number == len(rest) else f"{node}, {number + 1} terms"
        gear = f"sum {number} of {node}"
        if share > 0:
            net.add(PlanetaryGear(gear, ratio=share / total), here, there, other)
        else:
            net.add(PlanetaryGear(gear, ratio=-share / (total + share)), there, here, other)
        total, here = total + share, there
    return here
