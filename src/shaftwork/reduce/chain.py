"""A train as a chain, read and written: inertias in a row with springs between them, and what sits on each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import networkx as nx
import numpy as np

from shaftwork.components.contacts import Backlash
from shaftwork.components.mechanics import Damper, Inertia, Spring
from shaftwork.components.sources import SpeedSource
from shaftwork.core.domains import ROTATION
from shaftwork.core.errors import Diagnostic, NetworkError
from shaftwork.network.netlist import REFERENCE, Netlist, Placed
from shaftwork.pipeline.network import Network
from shaftwork.reduce.tridiagonal_modes import Array, TridiagonalChain


@dataclass(frozen=True)
class Station:
    """A place in a chain.

    Args:
        node: its name.
        inertia: kg m^2, all together.
        inertias: names and sizes of the parts.
        riders: other parts that sit here.
        support: stiffness of springs from here to the frame, N m/rad.
    """

    node: str
    inertia: float = 0.0
    inertias: tuple[tuple[str, float], ...] = ()
    riders: tuple[Placed, ...] = ()
    support: float = 0.0

    @property
    def heaviest(self) -> str:
        """The name of its largest inertia."""
        return max(self.inertias, key=lambda part: part[1])[0]

    @property
    def bearings(self) -> tuple[Spring, ...]:
        """The springs of its support."""
        return tuple(item.part for item in self.riders if isinstance(item.part, Spring) and item.part.c)

    @property
    def prescribed_by(self) -> tuple[str, ...]:
        """Names of the sources that prescribe its speed: to what swings it is a clamp."""
        return tuple(item.part.name for item in self.riders if isinstance(item.part, SpeedSource))


@dataclass(frozen=True)
class Link:
    """What is between two neighbours: springs, gaps and dampers beside each other, or in series.

    Args:
        name: of the spring, of the softest where there are several.
        c: stiffness with gaps closed, N m/rad.
        d: damping, N m s/rad.
        gap: whole free twist, rad.
        parts: names of its springs and gaps.
        placed: the parts themselves; none where several springs in series are one.
    """

    name: str
    c: float
    d: float
    gap: float
    parts: tuple[str, ...]
    placed: tuple[Placed, ...] = ()

    def has(self, name: str) -> bool:
        """Whether a part of this name is in it."""
        return any(item.part.name == name for item in self.placed)


@dataclass(frozen=True)
class Chain:
    """Stations from one end to the other, a link between neighbours, and circuits beside them."""

    stations: tuple[Station, ...]
    links: tuple[Link, ...]
    circuits: tuple[Placed, ...] = ()

    def frequencies(self) -> Array:
        """(m,) natural frequencies without damping in Hz, ascending, 0 for the turning of the whole.

        There is one for each station whose speed is not prescribed.
        """
        free, row = self.row
        rates = row.rates()
        return np.append(np.zeros(len(free) - len(rates)), rates) / (2 * np.pi)

    @cached_property
    def row(self) -> tuple[tuple[int, ...], TridiagonalChain]:
        """Places of the stations whose speed is not prescribed, and how they swing: the others are a frame to them."""
        free = tuple(k for k, prescribed in enumerate(self.prescribed) if not prescribed)
        c = np.array([0.0, *(link.c for link in self.links), 0.0])
        clamped = np.array([True, *self.prescribed, True])
        supports = np.array([station.support for station in self.stations])
        supports += np.where(clamped[:-2], c[:-1], 0.0) + np.where(clamped[2:], c[1:], 0.0)
        inertias = np.array([station.inertia for station in self.stations])
        between = [c[a + 1] if b == a + 1 else 0.0 for a, b in pairwise(free)]
        return free, TridiagonalChain(inertias[list(free)], np.array(between), supports[list(free)])

    def swing(self, rate: float) -> tuple[Array, Array]:
        """(n,) shape at one of its rates, with a modal inertia of 1 kg m^2, and (n - 1,) torques in the links.

        Where the speed of a station is prescribed, it stands still.
        """
        free, row = self.row
        shape = np.zeros(len(self.stations))
        shape[list(free)], inner = row.swing(rate)
        torques = -np.array([link.c for link in self.links]) * np.diff(shape)
        for (a, b), torque in zip(pairwise(free), inner, strict=True):
            if b == a + 1:
                torques[a] = torque
        return shape, torques

    @property
    def prescribed(self) -> tuple[bool, ...]:
        """(n,) whether a source prescribes the speed of each station."""
        return tuple(bool(station.prescribed_by) for station in self.stations)


def series(links: Sequence[Link]) -> Link:
    """Springs and gaps one after the other as one.

    Law: 1/c = sum 1/c_k; d = sum d_k (c/c_k)^2, so that a slow twist, which divides as the compliances do, loses as
    much; gap = sum gap_k, since one torque closes all of them. Source: Abdelkader 2016, (15).
    """
    if len(links) == 1:
        return links[0]
    c = 1 / sum(1 / link.c for link in links)
    d = sum(link.d * (c / link.c) ** 2 for link in links)
    softest = min(links, key=lambda link: link.c)
    return Link(softest.name, c, d, sum(link.gap for link in links), tuple(n for link in links for n in link.parts))


def read_chain(netlist: Netlist, keep: str) -> Chain:
    """The chain that a network without gears is.

    Args:
        netlist: of the network.
        keep: a spring or gap that stays a link of its own; empty for none.

    Raises:
        NetworkError: it is no chain of inertias and springs; names every part and node that is in the way.
    """
    problems: list[Diagnostic] = []
    stations: dict[str, Station] = {}
    links: dict[tuple[str, str], list[Placed]] = {}
    circuits: list[Placed] = []
    for item in netlist.placed:
        nodes = turning_nodes(item)
        if len(nodes) == 2 and isinstance(item.part, Spring | Damper | Backlash):
            a, b = sorted(nodes)
            links.setdefault((a, b), []).append(item)
            for node in nodes:
                stations.setdefault(node, Station(node))
        elif len(nodes) == 1:
            here = stations.setdefault(nodes[0], Station(nodes[0]))
            stations[nodes[0]] = _with(here, item)
        elif not nodes:
            circuits.append(item)
        else:
            problems.append(_not_in_a_chain(item))
    problems += (problem for items in links.values() for problem in _objections(items, keep))
    if not problems:
        problems += _not_a_row(stations, links)
    if problems:
        raise NetworkError(f"'{netlist.name}' is no chain of inertias and springs", tuple(problems))
    row = _in_a_row(stations, links)
    return replace(_condensed(row, keep, netlist.name), circuits=tuple(circuits))


def turning_nodes(item: Placed) -> tuple[str, ...]:
    """The nodes of a part that turn, without the frame."""
    pairs = zip(item.part.ports, item.nodes, strict=False)
    return tuple(node for port, node in pairs if port.domain is ROTATION and node != REFERENCE)


def _with(station: Station, item: Placed) -> Station:
    if isinstance(item.part, Inertia):
        size = float(item.part.J)
        return replace(station, inertia=station.inertia + size, inertias=(*station.inertias, (item.part.name, size)))
    support = float(item.part.c) if isinstance(item.part, Spring) else 0.0
    return replace(station, riders=(*station.riders, item), support=station.support + support)


def _objections(items: Sequence[Placed], keep: str) -> Iterator[Diagnostic]:
    """Gaps that no chain of springs describes."""
    beside = [item.part.name for item in items if not isinstance(item.part, Damper)]
    for item in items:
        part = item.part
        if not isinstance(part, Backlash):
            continue
        if part.c is None:
            yield Diagnostic(
                "rigid gap",
                f"Backlash '{part.name}' has rigid flanks, which have no stiffness to swing by.",
                "Give it a stiffness c.",
                (part.name,),
            )
        elif len(beside) > 1 and keep not in beside:
            yield Diagnostic(
                "gap beside a spring",
                f"Backlash '{part.name}' lies beside {', '.join(name for name in beside if name != part.name)}: in "
                "series with others they are no one gap.",
                f"Keep it, keep='{part.name}'.",
                (part.name,),
            )


def _not_in_a_chain(item: Placed) -> Diagnostic:
    kind, name = type(item.part).__name__, item.part.name
    hint = "net.expanded() writes a long shaft out part by part." if kind == "Shaft" else "Put springs in its place."
    return Diagnostic("no part of a chain", f"{kind} '{name}' joins {', '.join(item.nodes)}.", hint, (name,))


def _not_a_row(stations: dict[str, Station], links: dict[tuple[str, str], list[Placed]]) -> Iterator[Diagnostic]:
    """Where a chain branches, closes or falls apart, and links without a spring."""
    for (a, b), items in links.items():
        if not any(float(getattr(item.part, "c", None) or 0.0) for item in items):
            names = tuple(item.part.name for item in items)
            yield Diagnostic("no spring", f"Between '{a}' and '{b}' there is no spring.", "Give it one.", names, (a, b))
    for node in stations:
        beside = [pair for pair in links if node in pair]
        if len(beside) > 2:
            yield Diagnostic(
                "branching", f"At node '{node}' {len(beside)} shafts meet.", "Simplify one branch.", (), (node,)
            )
    if not stations:
        what = "no part turns: the reference of the train is a node that moves along a line"
        hint = (
            "Give a node that turns, to='...'. Where there is none, add Drum('drum', radius=1.0) from a new node to "
            "one of the train, and TorqueSource('none', tau=0.0) there: seen from it, masses are inertias of the same "
            "numbers, and forces torques."
        )
        yield Diagnostic("no row", f"{what}.", hint)
    elif len(links) != len(stations) - 1:
        what = f"{len(stations)} nodes are joined by {len(links)} shafts"
        yield Diagnostic(
            "no row", f"{what}; a chain has one shaft less than nodes.", "Open the loop, or join the parts."
        )


def _in_a_row(stations: dict[str, Station], links: dict[tuple[str, str], list[Placed]]) -> Chain:
    joints = nx.Graph()
    joints.add_nodes_from(stations)
    joints.add_edges_from(links)
    ends = [node for node, degree in joints.degree if degree < 2]
    row = nx.shortest_path(joints, ends[0], ends[-1])
    return Chain(
        tuple(stations[node] for node in row), tuple(_link(links[min(pair), max(pair)]) for pair in pairwise(row))
    )


def _link(items: Sequence[Placed]) -> Link:
    """What lies side by side between two stations."""
    c, d, gap = (sum(float(getattr(item.part, name, 0.0)) for item in items) for name in ("c", "d", "gap"))
    springs = tuple(item.part.name for item in items if not isinstance(item.part, Damper))
    return Link(springs[0], c, d, gap, springs, tuple(items))


def _condensed(chain: Chain, keep: str, title: str) -> Chain:
    """Springs that meet at a node without inertia, where nothing sits, are one."""
    stations, links = list(chain.stations), list(chain.links)
    problems: list[Diagnostic] = []
    for station in chain.stations:
        if station.inertia or station.prescribed_by:
            continue
        k = stations.index(station)
        beside = links[max(k - 1, 0) : k + 1]
        if station.riders or len(beside) < 2 or any(link.has(keep) for link in beside):
            where = f"Node '{station.node}' has no inertia"
            problems.append(
                Diagnostic(
                    "massless node",
                    f"{where}, and is the end of the kept shaft or of the chain, or parts sit there.",
                    "Give it the inertia of what it stands for.",
                    (),
                    (station.node,),
                )
            )
            continue
        del stations[k]
        links[k - 1 : k + 1] = [series(beside)]
    if problems:
        raise NetworkError(f"'{title}' is no chain of inertias and springs", tuple(problems))
    return Chain(tuple(stations), tuple(links))


def add_chain(net: Network, chain: Chain) -> None:
    """Add the parts of a chain to a network, station by station."""
    add_circuits(net, chain)
    for k, station in enumerate(chain.stations):
        add_riders(net, station, station.node)
        if station.inertias:
            net.add(Inertia(station.heaviest, J=station.inertia), station.node)
        if k < len(chain.links):
            add_link(net, chain.links[k], station, chain.stations[k + 1])


def add_circuits(net: Network, chain: Chain) -> None:
    """Add the circuits beside a chain."""
    for item in chain.circuits:
        net.add(item.part, *item.nodes)


def add_riders(net: Network, station: Station, node: str) -> None:
    """Add what sits at a station, at a node."""
    for item in station.riders:
        moved = turning_nodes(item)
        net.add(item.part, *(node if each in moved else each for each in item.nodes))


def add_link(net: Network, link: Link, station: Station, other: Station) -> None:
    """Add what is between two stations: its own parts, or one spring or gap for several in series."""
    ends = station.node, other.node
    for item in link.placed:
        net.add(item.part, *(ends if item.nodes[0] == station.node else ends[::-1]))
    if not link.placed and link.gap:
        net.add(Backlash(link.name, c=link.c, d=link.d, gap=link.gap), *ends)
    elif not link.placed:
        net.add(Spring(link.name, c=link.c, d=link.d), *ends)
