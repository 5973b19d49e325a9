"""What a page moves: where the nodes of a train stand on a screen, how large they are, and what is at them."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any

from shaftwork.animation.turning import Train

INERTIAS = ("J", "m")
"""Parameters by which a disc is the larger."""


def moved(train: Train) -> Train:
    """The train that a page moves; empty where it has too many nodes."""
    return train if len(train.nodes) <= 60 else Train((), ())  # more would be dots on a screen


def described(train: Train, parameters: Collection[str]) -> Mapping[str, Any]:
    """A train as a page takes it: nodes with their place and inertias, links between two of them, ends at one.

    Args:
        train: what is moved.
        parameters: those that can be set, by name.
    """
    links = [
        {"part": part.name, "a": part.nodes[0], "b": other, "twists": bool(part.torque)}
        for part in train.parts
        for other in part.nodes[1:]
    ]
    columns, rows = _places(len(train.nodes), links)
    inertias: list[list[str]] = [[] for _ in train.nodes]
    for part in train.parts:
        names = (f"{part.name}.{key}" for key in INERTIAS)
        for node in part.nodes[:1]:
            inertias[node] += [name for name in names if name in parameters]
    return {
        "nodes": [
            {"name": node.name, "turns": node.turns, "inertias": inertias[k], "column": columns[k], "row": rows[k]}
            for k, node in enumerate(train.nodes)
        ],
        "links": links,
        "ends": [{"part": part.name, "node": part.nodes[0]} for part in train.parts if len(part.nodes) == 1],
    }


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
