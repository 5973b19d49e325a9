"""The faces of a planar graph, as nodes of its dual, and what forbids a graph to be planar."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import networkx as nx

from shaftwork.analogues.elements import Edge

Vertex = int | Edge
"""A node of the graph, or the middle of an edge: edges between the same nodes are then told apart."""


@dataclass(frozen=True)
class DualEnds:
    """Where the duals of edges are.

    Args:
        ends: of each edge that is no loop the faces on its left and on its right; 0 is the reference.
        bridges: edges with the same face on both sides, which nothing passes through.
    """

    ends: Mapping[Edge, tuple[int, int]]
    bridges: tuple[Edge, ...]


@dataclass(frozen=True)
class Kuratowski:
    """Why a graph is not planar.

    Args:
        name: "K5" or "K3,3".
        nodes: the five or six nodes that are joined.
        edges: the edges of the paths between them.
    """

    name: str
    nodes: tuple[int, ...]
    edges: tuple[Edge, ...]


def dual_ends(edges: Mapping[Edge, tuple[int, int]], near_reference: Sequence[Edge]) -> DualEnds | Kuratowski:
    """The ends of the dual of each edge, from the face on its left to that on its right, block by block.

    Nothing but couplings acts from one block to another, so each may have a mirror image and a reference of its own:
    the face with most edges of `near_reference`, then with most edges. Mirrored is a block whose edges would rather
    begin than end there. Source: Whitney 1933; planarity: Boyer and Myrvold 2004, by networkx.

    Args:
        edges: first and second node of each edge; none is a loop.
        near_reference: edges whose duals are to end at the reference where they can.
    """
    graph: nx.Graph[Vertex] = nx.Graph()
    for key, (plus, minus) in edges.items():
        graph.add_edges_from(((plus, key), (key, minus)))
    is_planar, certificate = nx.check_planarity(graph, counterexample=True)
    if not is_planar:
        return _kuratowski(certificate)
    blocks = _Blocks(edges, frozenset(near_reference))
    for block in nx.biconnected_component_edges(graph):
        blocks.add(block)
    numbers = {0: 0}  # in the order of the edges
    ends = {}
    for key in edges:
        left, right = blocks.ends[key]
        ends[key] = numbers.setdefault(left, len(numbers)), numbers.setdefault(right, len(numbers))
    return DualEnds(ends, tuple(key for key in edges if key in blocks.bridges))


def _kuratowski(subgraph: nx.Graph[Vertex]) -> Kuratowski:
    branching = tuple(node for node in subgraph if isinstance(node, int) and subgraph.degree(node) > 2)
    edges = tuple(vertex for vertex in subgraph if isinstance(vertex, tuple))
    return Kuratowski("K5" if len(branching) == 5 else "K3,3", branching, edges)


class _Blocks:
    """Numbers the faces of one block after another."""

    def __init__(self, edges: Mapping[Edge, tuple[int, int]], near_reference: frozenset[Edge]) -> None:
        self._edges, self._near = edges, near_reference
        self._count = 0
        self.ends: dict[Edge, tuple[int, int]] = {}
        self.bridges: dict[Edge, None] = {}

    def add(self, block: Sequence[tuple[Vertex, Vertex]]) -> None:
        """Take the faces of a block; half an edge alone is a bridge, which gets a face of its own.

        An edge has on its right the face on the right of its first half, and on its left that of the way back.
        """
        keys = list(dict.fromkeys(sorted(end for half in block for end in half if isinstance(end, tuple))))
        if len(block) == 1:
            (key,) = keys
            if key not in self.bridges:  # both of its halves are blocks
                self._count += 1
                self.ends[key], self.bridges[key] = (self._count, 0), None
            return
        faces = _faces([half for key in keys for half in ((self._edges[key][0], key), (key, self._edges[key][1]))])
        sides = {key: (faces[key, self._edges[key][0]], faces[self._edges[key][0], key]) for key in keys}
        reference = self._reference(sides)
        begin = sum((left == reference) - (right == reference) for left, right in sides.values())
        numbers: dict[int, int] = {reference: 0}
        for key, pair in sides.items():
            for face in pair:
                if face not in numbers:
                    self._count += 1
                    numbers[face] = self._count
            left, right = (numbers[face] for face in pair)
            self.ends[key] = (right, left) if begin > 0 else (left, right)

    def _reference(self, sides: Mapping[Edge, tuple[int, int]]) -> int:
        ranks: dict[int, list[int]] = {}
        for key, pair in sides.items():
            for face in pair:
                rank = ranks.setdefault(face, [0, 0])
                rank[0] += key in self._near
                rank[1] += 1
        return max(ranks, key=lambda face: ranks[face])


def _faces(halves: Sequence[tuple[Vertex, Vertex]]) -> dict[tuple[Vertex, Vertex], int]:
    """The number of the face on the right of each half of an edge, in each direction."""
    graph: nx.Graph[Vertex] = nx.Graph()
    graph.add_edges_from(halves)
    _, embedding = nx.check_planarity(graph)
    faces: dict[tuple[Vertex, Vertex], int] = {}
    for number, (start, end) in enumerate(_directed(halves)):
        if (start, end) not in faces:
            border = embedding.traverse_face(start, end)
            faces |= dict.fromkeys(zip(border, (*border[1:], border[0]), strict=True), number)
    return faces


def _directed(halves: Sequence[tuple[Vertex, Vertex]]) -> Iterator[tuple[Vertex, Vertex]]:
    for start, end in halves:
        yield start, end
        yield end, start
