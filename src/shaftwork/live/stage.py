"""What a page moves: the turning and sliding nodes of a network, what joins them, and what holds or drives them."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from shaftwork.core.domains import ROTATION, TRANSLATION
from shaftwork.network.graph import GROUND, CircuitGraph, GraphPart

MOST_NODES = 60
"""Nodes up to which a network is moved; more would be dots on a screen."""
TWISTS = ("phi_rel", "phi", "s_rel", "s")
"""Quantities that tell how far the ends of a part are turned or shifted against each other, the first that there is."""


@dataclass(frozen=True)
class Stage:
    """The network as a page moves it.

    Args:
        nodes: each with its name, its speed as a quantity, its place, and the parameters that are its inertia.
        links: parts between two of the nodes.
        ends: parts at one of them.
    """

    nodes: tuple[Mapping[str, Any], ...]
    links: tuple[Mapping[str, Any], ...]
    ends: tuple[Mapping[str, Any], ...]

    @property
    def signals(self) -> tuple[str, ...]:
        """The quantities that are needed to move it."""
        return (
            *(str(node["speed"]) for node in self.nodes),
            *(str(link["twist"]) for link in self.links if link["twist"]),
        )

    def described(self) -> dict[str, Any]:
        """As the page takes it."""
        return {"nodes": self.nodes, "links": self.links, "ends": self.ends}


def stage_of(graph: CircuitGraph, names: Collection[str]) -> Stage:
    """The stage of a network; empty where it has too many nodes.

    Args:
        graph: of the network.
        names: all quantities of its motions.
    """
    units = {ROTATION: "omega", TRANSLATION: "v"}
    outer = {part.name: _outer(part, graph, units) for part in graph.parts}
    speeds = {
        node: f"{graph.node_name(node)}.{units[graph.domains[node]]}" for nodes in outer.values() for node in nodes
    }
    nodes = [node for node, speed in speeds.items() if speed in names]
    if not 0 < len(nodes) <= MOST_NODES:
        return Stage((), (), ())
    number = {node: k for k, node in enumerate(nodes)}
    links, ends = [], []
    for part in graph.parts:
        places = [number[node] for node in outer[part.name] if node in number]
        label = {"part": part.name, "kind": type(part.component).__name__, "role": part.component.role}
        if len(places) == 1:
            ends.append({**label, "node": places[0]})
        for other in places[1:]:
            twist = next((f"{part.name}.{name}" for name in TWISTS if f"{part.name}.{name}" in names), "")
            links.append({**label, "a": places[0], "b": other, "twist": twist, "ratio": _ratio(part)})
    inertias: dict[int, list[str]] = {k: [] for k in range(len(nodes))}
    for part in graph.parts:
        for node in outer[part.name][:1]:
            stored = (key for key in ("J", "m") if key in part.component.declared and node in number)
            inertias[number.get(node, 0)] += [f"{part.name}.{key}" for key in stored]
    columns, rows = _places(len(nodes), links)
    described = (
        {
            "name": graph.node_name(node),
            "speed": speeds[node],
            "turns": graph.domains[node] is ROTATION,
            "inertias": inertias[k],
            "column": columns[k],
            "row": rows[k],
        }
        for node, k in number.items()
    )
    return Stage(tuple(described), tuple(links), tuple(ends))


def _outer(part: GraphPart, graph: CircuitGraph, units: Collection[Any]) -> list[int]:
    """The moving nodes at which a part is joined to others, each once."""
    nodes = (part.nodes[port.name] for port in part.component.ports if port.name in part.nodes)
    return [node for node in dict.fromkeys(nodes) if node != GROUND and graph.domains[node] in units]


def _ratio(part: GraphPart) -> str:
    """The parameter by which the speed of the first node is a multiple of that of the second; empty without one."""
    return f"{part.name}.ratio" if part.component.role == "coupling" and "ratio" in part.component.declared else ""


def _places(count: int, links: Iterable[Mapping[str, Any]]) -> tuple[list[int], list[int]]:
    """Column and row of each node: as many links from the first node, those of one column below each other."""
    columns, rows = [0] * count, [0] * count
    filled: dict[int, int] = {}
    for node, column in _depths(count, [(link["a"], link["b"]) for link in links]):
        columns[node], rows[node] = column, filled.get(column, 0)
        filled[column] = rows[node] + 1
    return columns, rows


def _depths(count: int, pairs: Iterable[tuple[int, int]]) -> Iterator[tuple[int, int]]:
    """Each node and how many links it is from the first one of its train, in which another train follows behind."""
    near: dict[int, list[int]] = {k: [] for k in range(count)}
    for a, b in pairs:
        near[a].append(b)
        near[b].append(a)
    seen, start = set[int](), 0
    for first in range(count):
        queue, last = deque([(first, start)] if first not in seen else []), start
        seen.add(first)
        while queue:
            node, depth = queue.popleft()
            last = max(last, depth + 1)
            yield node, depth
            for other in near[node]:
                if other not in seen:
                    seen.add(other)
                    queue.append((other, depth + 1))
        start = last
