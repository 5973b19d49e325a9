"""A chain by the modes of its pieces instead of groups, and the network that moves so."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from shaftwork.components.rotation import Inertia, PlanetaryGear, Spring
from shaftwork.network.netlist import REFERENCE
from shaftwork.pipeline.network import Network
from shaftwork.reduce.chain import Chain, Link, series
from shaftwork.reduce.groups import add_circuits, add_link, add_riders
from shaftwork.reduce.pieces import NOTHING, Carried, FixedBoundaryMode, Substructure, common, piece_of
from shaftwork.reduce.tridiagonal_modes import Array, singular_values


@dataclass(frozen=True, eq=False)
class ModalChain:
    """A chain by its boundaries, the ends of one link and what has a prescribed speed, and modes of what is between.

    Args:
        chain: as it was.
        kept: place of the link.
        boundaries: places of their stations.
        ends: (b,) what turns rigidly with each of them, kg m^2.
        joints: what is between neighbours of them.
        support: (b, 2) stiffness and damping of what else holds each of them, for the supports of other stations.
        carried: what two of them carry together.
        modes: lowest first.
        still: (n, b) speed of each station by those of the boundaries while nothing swings.
    """

    chain: Chain
    kept: int
    boundaries: tuple[int, ...]
    ends: Array
    joints: tuple[Link, ...]
    support: Array
    carried: tuple[Carried, ...]
    modes: tuple[FixedBoundaryMode, ...]
    still: Array

    def speeds(self) -> Array:
        """(n, b + m) speed of each station by those of the b boundaries and of the m inertias of modes."""
        if not self.modes:
            return self.still
        swings = np.array([mode.shares for mode in self.modes]).T
        return np.hstack([self.still - swings @ np.array([mode.base for mode in self.modes]), swings])

    def frequencies(self) -> Array:
        """(f,) natural frequencies in Hz, ascending, 0 for the turning of the whole: as many as speeds are free."""
        count, modes = len(self.boundaries), np.array([mode.inertia for mode in self.modes])
        held = self.support[:, 0] + [self.chain.stations[k].support for k in self.boundaries]
        springs = np.array([*(link.c for link in self.joints), *held, *(mode.c for mode in self.modes)])
        twists = np.eye(len(springs), count + len(modes), 1 - count)
        twists[: count - 1, :count] = np.diff(np.eye(count), axis=0)
        twists[len(springs) - len(modes) :, :count] = -np.array([mode.base for mode in self.modes]).reshape(-1, count)
        ends = self.ends + sum(item.inertia * item.base**2 for item in self.carried)
        free = [not self.chain.prescribed[k] for k in self.boundaries] + [True] * len(modes)
        roots = np.sqrt(np.append(ends, modes)[free])
        return singular_values(np.sqrt(springs)[:, None] * twists[:, free] / roots) / (2 * np.pi)

    def network(self, name: str) -> Network:
        """The same as a network: inertias on springs at the boundaries, and what sits elsewhere on planetary gears.

        A place between has no inertia of its own; its speed is the sum of those of boundaries and modes, each by its
        share, as sun and ring sum to the carrier. So every part keeps its node.
        """
        net, named = Network(name), partial(_free, _names(self.chain))
        add_circuits(net, self.chain)
        stations = [self.chain.stations[k] for k in self.boundaries]
        nodes = [station.node for station in stations]
        for station, size, (c, d) in zip(stations, self.ends, self.support.tolist(), strict=True):
            if size > NOTHING * self.ends.max():
                own = station.heaviest if station.inertias else named(f"share of {station.node}")
                net.add(Inertia(own, J=float(size)), station.node)
            if c:
                net.add(Spring(named(f"support of {station.node}"), c=c, d=d), station.node, REFERENCE)
        for link, pair in zip(self.joints, pairwise(stations), strict=True):
            add_link(net, link, *pair)
        for item in self.carried:
            title = named(f"between {' and '.join(nodes[k] for k in item.between)}")
            net.add(Inertia(title, J=item.inertia), _add_sum(net, title, nodes, item.base, named))
        boundaries = tuple(nodes)
        for number, mode in enumerate(self.modes, 1):
            nodes.append(named(f"mode {number}"))
            base = _add_sum(net, named(f"base of {nodes[-1]}"), boundaries, mode.base, named)
            net.add(Inertia(nodes[-1], J=mode.inertia), nodes[-1])
            net.add(Spring(named(f"spring of {nodes[-1]}"), c=mode.c, d=mode.d), base, nodes[-1])
        for station, row in zip(self.chain.stations, self.speeds(), strict=True):
            if station in stations:
                add_riders(net, station, station.node)
                continue
            rest = tuple(item for item in station.riders if item.part not in station.bearings)
            if rest:
                add_riders(net, replace(station, riders=rest), _add_sum(net, station.node, nodes, row, named))
        return net


def truncated(chain: Chain, unknowns: int, kept: int) -> ModalChain:
    """A chain by its boundaries and the lowest modes of what is between and beyond them.

    Law: boundaries are the ends of the kept link and what has a prescribed speed. Between them x = C x_b + Phi q, with
    C the deflection under the boundaries alone and Phi the modes while they are held. With the participation
    L = Phi^T J C a mode is an inertia s^2 on a spring s^2 omega^2 that the boundaries carry by the shares L / s.
    Besides they carry sum L^T L of the modes left out, rigidly, and C^T K C, as springs between them and to the frame.
    What hangs on one boundary alone, without a support, follows it, C = 1. At one boundary s = L, and the spring of the
    mode sits at this place. Every frequency is an upper bound; with two unknowns and no support beyond the kept link it
    is the model of two groups. Gaps are taken as closed where there are stations between two boundaries or beyond them;
    of the damping each mode has its own, without what it takes from others.

    Args:
        chain: stations with inertia, or with a prescribed speed.
        unknowns: the number of boundaries and modes together.
        kept: place of the link.

    Source: Craig and Bampton, Coupling of substructures for dynamic analyses, AIAA Journal 6(7), 1968.
    """
    inertias = np.array([station.inertia for station in chain.stations])
    boundaries = tuple(k for k, held in enumerate(chain.prescribed) if held or k in (kept, kept + 1))
    bounds = list(pairwise((-1, *boundaries, len(inertias))))
    pieces = [piece_of(chain, len(boundaries), number, range(a + 1, b)) for number, (a, b) in enumerate(bounds)]
    found = (mode for piece in pieces for mode in piece.modes)
    modes = sorted(found, key=lambda mode: mode.c / mode.inertia)[: unknowns - len(boundaries)]
    still, ends, carried = np.zeros((len(inertias), len(boundaries))), inertias[list(boundaries)], []
    still[list(boundaries)] = np.eye(len(boundaries))
    for piece in pieces:
        still += piece.still
        left_out = (mode for mode in piece.modes if mode not in modes)
        rest = sum((mode.inertia * np.outer(mode.base, mode.base) for mode in left_out), np.zeros(2 * still.shape[1:]))
        shared = common(rest, piece.between) if len(piece.between) > 1 else None
        if shared:
            carried.append(shared)
            rest -= shared.inertia * np.outer(shared.base, shared.base)
        ends = ends + np.maximum(rest.diagonal(), 0.0)
    joints = tuple(_joint(chain.links[a:b], piece) for (a, b), piece in zip(bounds[1:-1], pieces[1:-1], strict=True))
    support = np.sum([piece.support for piece in pieces], axis=0)
    return ModalChain(chain, kept, boundaries, ends, joints, support, tuple(carried), tuple(modes), still)


def _joint(links: Sequence[Link], piece: Substructure) -> Link:
    """The links between two boundaries as one."""
    if len(links) == 1:
        return links[0]
    c, d = piece.joint
    return replace(series(links), c=c, d=d, gap=0.0)


def _names(chain: Chain) -> frozenset[str]:
    """Of its parts and nodes."""
    riders = (item for station in chain.stations for item in station.riders)
    placed = [*chain.circuits, *riders, *(item for link in chain.links for item in link.placed)]
    inertias = (name for station in chain.stations for name, _ in station.inertias)
    nodes = (node for item in placed for node in item.nodes)
    own = (name for link in chain.links for name in link.parts)
    stations = (station.node for station in chain.stations)
    return frozenset((*(item.part.name for item in placed), *inertias, *nodes, *own, *stations))


def _free(taken: frozenset[str], name: str) -> str:
    """A name that nothing has yet."""
    while name in taken:
        name += "'"
    return name


def _add_sum(net: Network, node: str, nodes: Sequence[str], shares: Array, named: Callable[[str], str]) -> str:
    """Add planetary gears by which a node turns as the sum of shares of others, and return its name.

    What shares lack of one has the frame. Positive ones first, the largest of all first, every sum on the way is
    positive: so each gear has a ratio above zero. A node that turns with one other alone is that one.
    """
    pairs = [*zip(shares, nodes, strict=True), (1 - shares.sum(), REFERENCE)]
    terms = [(float(share), each) for share, each in pairs if abs(share) > NOTHING]
    (total, here), *rest = sorted(terms, reverse=True)
    for number, (share, other) in enumerate(rest, 1):
        there = node if number == len(rest) else named(f"{node}, {number + 1} terms")
        gear = named(f"sum {number} of {node}")
        if share > 0:
            net.add(PlanetaryGear(gear, ratio=share / total), here, there, other)
        else:
            net.add(PlanetaryGear(gear, ratio=-share / (total + share)), there, here, other)
        total, here = total + share, there
    return here
