"""A chain by the modes of its pieces instead of groups, and the network that moves so."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.linalg import eigh

from shaftwork.components.rotation import Inertia, PlanetaryGear, Spring
from shaftwork.network.netlist import REFERENCE
from shaftwork.pipeline.network import Network
from shaftwork.reduce.chain import Array, Chain, Link, hertz, row_matrix, series
from shaftwork.reduce.groups import add_circuits, add_link, add_riders

NOTHING = 1e-12
"""A share of a speed or of an inertia that is only rounding."""


@dataclass(frozen=True, eq=False)
class Carried:
    """An inertia that the boundaries carry, each by its share.

    Args:
        inertia: its size, kg m^2.
        base: (b,) share of the speed of each boundary in its own.
        between: places of the boundaries beside it, one or two.
    """

    inertia: float
    base: Array
    between: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Mode(Carried):
    """How a piece of a chain swings while its boundaries are held: an inertia on a spring that they carry.

    Args:
        c: stiffness of the spring, N m/rad.
        d: its damping, N m s/rad.
        shares: (n,) speed of each station against what the boundaries give it, over that of the inertia against its
            base; zero in other pieces.
    """

    c: float
    d: float
    shares: Array


@dataclass(frozen=True, eq=False)
class Piece:
    """The stations between boundaries, or beyond the outer ones.

    Args:
        still: (n, b) speed of each station by those of the boundaries while nothing swings; zero in other pieces.
        inertias: (b, b) what it is for the boundaries then, kg m^2.
        between: places of the boundaries beside it, one or two.
        modes: all of its modes.
    """

    still: Array
    inertias: Array
    between: tuple[int, ...]
    modes: tuple[Mode, ...]


@dataclass(frozen=True, eq=False)
class ModalChain:
    """A chain by its boundaries, the ends of one link and what has a prescribed speed, and modes of what is between.

    Args:
        chain: as it was.
        kept: place of the link.
        boundaries: places of their stations.
        ends: (b,) what turns rigidly with each of them, kg m^2.
        carried: what two of them carry together.
        modes: lowest first.
        still: (n, b) speed of each station by those of the boundaries while nothing swings.
    """

    chain: Chain
    kept: int
    boundaries: tuple[int, ...]
    ends: Array
    carried: tuple[Carried, ...]
    modes: tuple[Mode, ...]
    still: Array

    def speeds(self) -> Array:
        """(n, b + m) speed of each station by those of the b boundaries and of the m inertias of modes."""
        if not self.modes:
            return self.still
        swings = np.array([mode.shares for mode in self.modes]).T
        return np.hstack([self.still - swings @ np.array([mode.base for mode in self.modes]), swings])

    def frequencies(self) -> Array:
        """(f,) natural frequencies in Hz, ascending, 0 for the turning of the whole: as many as speeds are free."""
        count = len(self.boundaries)
        speeds, supports = self.speeds(), np.array([station.support for station in self.chain.stations])
        stiffness = speeds.T @ (supports[:, None] * speeds)
        stiffness[:count, :count] += row_matrix([series(links).c for links in self._links()])
        for place, mode in enumerate(self.modes, count):
            row = np.append(-mode.base, np.zeros(len(self.modes)))
            row[place] = 1.0
            stiffness += mode.c * np.outer(row, row)
        ends = self.ends + sum(item.inertia * item.base**2 for item in self.carried)
        free = [not self.chain.prescribed[k] for k in self.boundaries] + [True] * len(self.modes)
        root = 1 / np.sqrt(np.append(ends, [mode.inertia for mode in self.modes])[free])
        inner = stiffness[np.ix_(free, free)]
        return hertz(np.asarray(np.linalg.eigvalsh(root[:, None] * inner * root)), self.chain)

    def _links(self) -> Iterator[tuple[Link, ...]]:
        """The links from each boundary to the next."""
        return (self.chain.links[a:b] for a, b in pairwise(self.boundaries))

    def network(self, name: str) -> Network:
        """The same as a network: inertias on springs at the boundaries, and what sits elsewhere on planetary gears.

        A place between has no inertia of its own; its speed is the sum of those of boundaries and modes, each by its
        share, as sun and ring sum to the carrier. So every part keeps its node.
        """
        net = Network(name)
        add_circuits(net, self.chain)
        stations = [self.chain.stations[k] for k in self.boundaries]
        nodes = [station.node for station in stations]
        for station, size in zip(stations, self.ends, strict=True):
            if size > NOTHING * self.ends.max():
                own = station.heaviest if station.inertias else f"share of {station.node}"
                net.add(Inertia(own, J=float(size)), station.node)
        for links, pair in zip(self._links(), pairwise(stations), strict=True):
            link = links[0] if len(links) == 1 else replace(series(links), gap=0.0)
            add_link(net, link, *pair)
        for item in self.carried:
            title = f"between {' and '.join(nodes[k] for k in item.between)}"
            net.add(Inertia(title, J=item.inertia), _add_sum(net, title, nodes, item.base))
        boundaries = tuple(nodes)
        for number, mode in enumerate(self.modes, 1):
            nodes.append(f"mode {number}")
            base = _add_sum(net, f"base of {nodes[-1]}", boundaries, mode.base)
            net.add(Inertia(nodes[-1], J=mode.inertia), nodes[-1])
            net.add(Spring(f"spring of {nodes[-1]}", c=mode.c, d=mode.d), base, nodes[-1])
        for station, row in zip(self.chain.stations, self.speeds(), strict=True):
            if station.riders:
                here = station.node if station in stations else _add_sum(net, station.node, nodes, row)
                add_riders(net, station, here)
        return net


def truncated(chain: Chain, unknowns: int, kept: int) -> ModalChain:
    """A chain by its boundaries and the lowest modes of what is between and beyond them.

    Law: boundaries are the ends of the kept link and what has a prescribed speed. Between them x = C x_b + Phi q, with
    C the deflection under the boundaries alone and Phi the modes while they are held. With the participation
    L = Phi^T J C a mode is an inertia s^2 on a spring s^2 omega^2 that the boundaries carry by the shares L / s; what a
    piece is for its boundaries besides, C^T J C - sum L^T L, they carry rigidly. What is held at one place only follows
    it, C = 1: then s = L, and the spring of the mode sits at this place. Every frequency is an upper bound. With two
    unknowns it is the model of two groups. Springs to the frame act at their places and bend no mode; gaps are taken as
    closed where there are stations between two boundaries or beyond them; of the damping each mode has its own, without
    what it takes from others.

    Args:
        chain: stations with inertia, or with a prescribed speed.
        unknowns: the number of boundaries and modes together.
        kept: place of the link.

    Source: Craig and Bampton, Coupling of substructures for dynamic analyses, AIAA Journal 6(7), 1968.
    """
    inertias = np.array([station.inertia for station in chain.stations])
    boundaries = tuple(k for k, held in enumerate(chain.prescribed) if held or k in (kept, kept + 1))
    bounds = pairwise((-1, *boundaries, len(inertias)))
    pieces = [_piece(chain, inertias, boundaries, number, range(a + 1, b)) for number, (a, b) in enumerate(bounds)]
    found = (mode for piece in pieces for mode in piece.modes)
    modes = sorted(found, key=lambda mode: mode.c / mode.inertia)[: unknowns - len(boundaries)]
    still, ends, carried = np.zeros((len(inertias), len(boundaries))), inertias[list(boundaries)], []
    still[list(boundaries)] = np.eye(len(boundaries))
    for piece in pieces:
        still += piece.still
        rest = piece.inertias - sum(
            mode.inertia * np.outer(mode.base, mode.base) for mode in modes if mode in piece.modes
        )
        common = _common(rest, piece.between) if len(piece.between) > 1 else None
        if common:
            carried.append(common)
            rest -= common.inertia * np.outer(common.base, common.base)
        ends = ends + np.maximum(rest.diagonal(), 0.0)
    return ModalChain(chain, kept, boundaries, ends, tuple(carried), tuple(modes), still)


def _piece(chain: Chain, inertias: Array, boundaries: Sequence[int], number: int, inner: range) -> Piece:
    """The stations before a boundary of this number, behind the one before."""
    between = tuple(k for k in (number - 1, number) if 0 <= k < len(boundaries))
    still = np.zeros((len(inertias), len(boundaries)))
    if len(between) == 1:
        still[inner, between[0]] = 1.0
    elif inner:
        passed = np.cumsum([1 / link.c for link in chain.links[inner.start - 1 : inner.stop]])
        still[inner, between[1]] = passed[:-1] / passed[-1]
        still[inner, between[0]] = 1 - still[inner, between[1]]
    rigid = still.T @ (inertias[:, None] * still)
    return Piece(still, rigid, between, tuple(_modes(chain, inertias, still, between, np.array(inner, dtype=int))))


def _modes(chain: Chain, inertias: Array, still: Array, between: tuple[int, ...], beyond: Array) -> Iterator[Mode]:
    """The modes of stations while the boundaries beside them are held."""
    if not beyond.size:
        return
    inner = np.ix_(beyond, beyond)
    stiffness, damping = (row_matrix([getattr(link, name) for link in chain.links])[inner] for name in ("c", "d"))
    squares, shapes = eigh(stiffness, np.diag(inertias[beyond]))
    for square, shape in zip(squares, shapes.T, strict=True):
        size, base = _scaled((shape * inertias[beyond]) @ still[beyond])
        shares = np.zeros(len(inertias))
        shares[beyond] = size * shape
        c, d = size**2 * float(square), size**2 * float(shape @ damping @ shape)
        yield Mode(size**2, base, between, c, d, shares)


def _scaled(participation: Array) -> tuple[float, Array]:
    """A size and shares that multiply to a participation: shares that sum to one, unless they nearly cancel."""
    total, norm = float(participation.sum()), math.hypot(*participation)
    size = total if abs(total) > norm / 2 else norm
    return size, participation / size


def _common(inertias: Array, between: tuple[int, ...]) -> Carried | None:
    """What couples two boundaries, as an inertia that both carry and that leaves neither with less than nothing."""
    first, second = (max(float(inertias[k, k]), 0.0) for k in between)
    shared, largest = float(inertias[between]), math.sqrt(first * second)
    if abs(shared) <= NOTHING * inertias.max() or not largest:
        return None
    parts = np.zeros(len(inertias))
    parts[list(between)] = math.sqrt(first), math.copysign(math.sqrt(second), shared)
    size, base = _scaled(math.sqrt(min(abs(shared) / largest, 1.0)) * parts)
    return Carried(size**2, base, between)


def _add_sum(net: Network, node: str, nodes: Sequence[str], shares: Array) -> str:
    """Add planetary gears by which a node turns as the sum of shares of others, and return its name.

    What shares lack of one has the frame. Positive ones first, the largest of all first, every sum on the way is
    positive: so each gear has a ratio above zero. A node that turns with one other alone is that one.
    """
    pairs = [*zip(shares, nodes, strict=True), (1 - shares.sum(), REFERENCE)]
    terms = [(float(share), each) for share, each in pairs if abs(share) > NOTHING]
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
