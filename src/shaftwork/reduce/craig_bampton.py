"""A chain by its boundaries and the modes of its pieces (Craig and Bampton), and the network that moves so."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from shaftwork.components.mechanics import Inertia, PlanetaryGear, Spring
from shaftwork.network.netlist import REFERENCE
from shaftwork.numerics.tolerances import SAME
from shaftwork.pipeline.network import Network
from shaftwork.reduce.chain import Chain, Link, add_circuits, add_link, add_riders, series
from shaftwork.reduce.tridiagonal_modes import Array, TridiagonalChain, constraint_mode, singular_values


@dataclass(frozen=True, eq=False)
class BoundaryInertia:
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
class FixedBoundaryMode(BoundaryInertia):
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
class Substructure:
    """The stations between boundaries, or beyond the outer ones.

    Args:
        constraint_modes: (n, b) speed of each station by those of the boundaries while nothing swings; zero in other
            pieces.
        joint: stiffness, N m/rad, and damping, N m s/rad, of the spring that it is between two boundaries then.
        support: (b, 2) the same of the springs that it is from the boundaries to the frame.
        between: places of the boundaries beside it, one or two.
        modes: all of its modes.
    """

    constraint_modes: Array
    joint: tuple[float, float]
    support: Array
    between: tuple[int, ...]
    modes: tuple[FixedBoundaryMode, ...]


def substructure(chain: Chain, count: int, number: int, inner: range) -> Substructure:
    """The stations before the boundary of this number, of so many, and behind the one before it.

    Law: C is the deflection of the stations under the boundaries while nothing swings; the force that it takes to hold
    one boundary while another moves is that in the last spring on the way, c C, and what is not found there has gone
    into the supports, sum c_s C.
    """
    between = tuple(k for k in (number - 1, number) if 0 <= k < count)
    constraints = np.zeros((len(chain.stations), count))
    if not inner:
        return Substructure(constraints, (0.0, 0.0), np.zeros((count, 2)), between, ())
    fixed = _FixedBoundaries.of(chain, inner)
    motion = np.zeros((len(inner) + 2, count))
    for k, place, follow in zip((number - 1, number), (0, -1), (fixed.from_first, fixed.from_last), strict=True):
        if k in between:
            motion[place, k] = 1.0
            motion[1:-1, k] = follow()
    constraints[inner] = motion[1:-1]
    stiffness = fixed.c[-1] * float(constraints[inner[-1], number - 1]) if len(between) > 1 else 0.0
    losses = fixed.damping(motion)
    damping = max(-float(losses[between]), 0.0) if len(between) > 1 else 0.0
    support = np.stack([fixed.supports @ constraints[inner], np.maximum(losses.diagonal() - damping, 0.0)], axis=1)
    beside = [chain.stations[k].inertia for k in (inner.start - 1, inner.stop) if 0 <= k < len(chain.stations)]
    least = math.sqrt(SAME * min(size for size in (*beside, *fixed.inertias.tolist()) if size))
    modes = tuple(_modes(fixed, constraints, between, np.array(inner), number, least))
    return Substructure(constraints, (stiffness, damping), support, between, modes)


@dataclass(frozen=True, eq=False)
class _FixedBoundaries:
    """Stations while the boundaries beside them rest.

    Args:
        inertias: (m,) kg m^2.
        supports: (m,) stiffness of springs to the frame, N m/rad.
        bearings: (m,) their damping, N m s/rad.
        c: (m + 1,) stiffness of the springs between them, and before and behind them to the boundaries; there zero
            where there is none.
        d: (m + 1,) damping of the same.
    """

    inertias: Array
    supports: Array
    bearings: Array
    c: Array
    d: Array

    @classmethod
    def of(cls, chain: Chain, inner: range) -> _FixedBoundaries:
        stations = [chain.stations[k] for k in inner]
        inertias, supports = np.array([(station.inertia, station.support) for station in stations]).T
        bearings = np.array([sum(spring.d for spring in station.bearings) for station in stations])
        springs = np.array([(0.0, 0.0), *((link.c, link.d) for link in chain.links), (0.0, 0.0)])
        return cls(inertias, supports, bearings, *springs[inner.start : inner.stop + 1].T)

    @property
    def row(self) -> TridiagonalChain:
        """How they swing."""
        return TridiagonalChain(self.inertias, self.c[1:-1], _first(_last(self.supports, self.c[-1]), self.c[0]))

    def from_first(self) -> Array:
        """(m,) how they follow the boundary before them."""
        return constraint_mode(self.c[0], self.c[1:-1], _last(self.supports, self.c[-1]))

    def from_last(self) -> Array:
        """(m,) how they follow the boundary behind them."""
        return constraint_mode(self.c[-1], self.c[-2:0:-1], _first(self.supports, self.c[0])[::-1])[::-1]

    def damping(self, speeds: Array) -> Array:
        """(k, k) damping of motions in which they and the places beside them have (m + 2, k) speeds."""
        twists, inner = np.diff(speeds, axis=0), speeds[1:-1]
        return np.asarray(twists.T @ (self.d[:, None] * twists) + inner.T @ (self.bearings[:, None] * inner))


def _first(values: Array, more: float) -> Array:
    return np.concatenate([values[:1] + more, values[1:]])


def _last(values: Array, more: float) -> Array:
    return _first(values[::-1], more)[::-1]


def _modes(
    fixed: _FixedBoundaries, constraints: Array, between: tuple[int, ...], inner: Array, number: int, least: float
) -> Iterator[FixedBoundaryMode]:
    """The modes of stations while the boundaries beside them rest.

    Law: L = Phi^T J C, which is the force on each boundary, c Phi of the station beside it, over omega^2. The
    inertia is not made smaller than `least` squared, but the share by which it is carried.
    """
    row, count = fixed.row, constraints.shape[1]
    for rate in row.rates().tolist():
        shape, _ = row.swing(rate)
        forces = dict(zip((number - 1, number), (fixed.c[0] * shape[0], fixed.c[-1] * shape[-1]), strict=True))
        participation = np.array([forces[k] if k in between else 0.0 for k in range(count)]) / rate**2
        size, base = _scaled(participation)
        if abs(size) < least:
            size, base = least, participation / least
        shares = np.zeros(len(constraints))
        shares[inner] = size * shape
        damping = float(fixed.damping(np.pad(shape, 1)[:, None])[0, 0])
        yield FixedBoundaryMode(size**2, base, between, size**2 * rate**2, size**2 * damping, shares)


def _scaled(participation: Array) -> tuple[float, Array]:
    """A size and shares that multiply to a participation: shares that sum to one, unless they nearly cancel."""
    total, norm = float(participation.sum()), math.hypot(*participation)
    size = total if abs(total) > norm / 2 else norm
    return size, participation / size if size else participation


def coupling_inertia(inertias: Array, between: tuple[int, ...]) -> BoundaryInertia | None:
    """What couples two boundaries, as an inertia that both carry and that leaves neither with less than nothing."""
    first, second = (max(float(inertias[k, k]), 0.0) for k in between)
    shared, largest = float(inertias[between]), math.sqrt(first * second)
    if abs(shared) <= SAME * inertias.max() or not largest:
        return None
    parts = np.zeros(len(inertias))
    parts[list(between)] = math.sqrt(first), math.copysign(math.sqrt(second), shared)
    size, base = _scaled(math.sqrt(min(abs(shared) / largest, 1.0)) * parts)
    return BoundaryInertia(size**2, base, between)


@dataclass(frozen=True, eq=False)
class ModalChain:
    """A chain by its boundaries, the ends of one link and what has a prescribed speed, and modes of what is between.

    Args:
        chain: as it was.
        boundaries: places of their stations.
        ends: (b,) what turns rigidly with each of them, kg m^2.
        joints: what is between neighbours of them.
        support: (b, 2) stiffness and damping of what else holds each of them, for the supports of other stations.
        carried: what two of them carry together.
        modes: lowest first.
        constraint_modes: (n, b) speed of each station by those of the boundaries while nothing swings.
    """

    chain: Chain
    boundaries: tuple[int, ...]
    ends: Array
    joints: tuple[Link, ...]
    support: Array
    carried: tuple[BoundaryInertia, ...]
    modes: tuple[FixedBoundaryMode, ...]
    constraint_modes: Array

    def speeds(self) -> Array:
        """(n, b + m) speed of each station by those of the b boundaries and of the m inertias of modes."""
        if not self.modes:
            return self.constraint_modes
        swings = np.array([mode.shares for mode in self.modes]).T
        return np.hstack([self.constraint_modes - swings @ np.array([mode.base for mode in self.modes]), swings])

    def frequencies(self) -> Array:
        """(f,) natural frequencies in Hz, ascending, 0 for the turning of the whole: as many as speeds are free."""
        count, modes = len(self.boundaries), np.array([mode.inertia for mode in self.modes])
        grounded = self.support[:, 0] + [self.chain.stations[k].support for k in self.boundaries]
        springs = np.array([*(link.c for link in self.joints), *grounded, *(mode.c for mode in self.modes)])
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
            if size > SAME * self.ends.max():
                title = station.heaviest if station.inertias else named(f"share of {station.node}")
                net.add(Inertia(title, J=float(size)), station.node)
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


def truncated(chain: Chain, unknowns: int, link: int) -> ModalChain:
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
        link: place of the kept one.

    Source: Craig and Bampton, Coupling of substructures for dynamic analyses, AIAA Journal 6(7), 1968.
    """
    inertias = np.array([station.inertia for station in chain.stations])
    boundaries = tuple(k for k, prescribed in enumerate(chain.prescribed) if prescribed or k in (link, link + 1))
    bounds = list(pairwise((-1, *boundaries, len(inertias))))
    pieces = [substructure(chain, len(boundaries), number, range(a + 1, b)) for number, (a, b) in enumerate(bounds)]
    swinging = (mode for piece in pieces for mode in piece.modes)
    modes = sorted(swinging, key=lambda mode: mode.c / mode.inertia)[: unknowns - len(boundaries)]
    constraints, ends = np.zeros((len(inertias), len(boundaries))), inertias[list(boundaries)]
    shared: list[BoundaryInertia] = []
    constraints[list(boundaries)] = np.eye(len(boundaries))
    for piece in pieces:
        constraints += piece.constraint_modes
        left_out = (mode for mode in piece.modes if mode not in modes)
        products = (mode.inertia * np.outer(mode.base, mode.base) for mode in left_out)
        rest = sum(products, np.zeros(2 * constraints.shape[1:]))
        coupling = coupling_inertia(rest, piece.between) if len(piece.between) > 1 else None
        if coupling:
            shared.append(coupling)
            rest -= coupling.inertia * np.outer(coupling.base, coupling.base)
        ends = ends + np.maximum(rest.diagonal(), 0.0)
    joints = tuple(_joint(chain.links[a:b], piece) for (a, b), piece in zip(bounds[1:-1], pieces[1:-1], strict=True))
    support = np.sum([piece.support for piece in pieces], axis=0)
    return ModalChain(chain, boundaries, ends, joints, support, tuple(shared), tuple(modes), constraints)


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
    parts = (name for link in chain.links for name in link.parts)
    stations = (station.node for station in chain.stations)
    return frozenset((*(item.part.name for item in placed), *inertias, *nodes, *parts, *stations))


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
    terms = [(float(share), each) for share, each in pairs if abs(share) > SAME]
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
