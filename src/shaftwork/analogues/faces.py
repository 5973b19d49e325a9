"""The faces of a planar graph, as nodes of its dual, and what forbids a graph to be planar."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import networkx as nx

from shaftwork.analogues.elements import Edge

Pair = tuple[int, int]
"""Two nodes, the lower number first."""
REFERENCE_FACE = 0
"""The number of the face that is the reference of the dual."""


@dataclass(frozen=True)
class DualEnds:
    """Where the duals of edges are.

    Args:
        ends: of each edge the faces on its left and on its right, by number.
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


def dual_ends(edges: Mapping[Edge, tuple[int, int]], ranks: Mapping[Edge, int]) -> DualEnds | Kuratowski:
    """The ends of the dual of each edge, from the face on its left to that on its right, block by block.

    Nothing but couplings acts from one block to another, so each may have a mirror image and a reference of its own:
    the face with most edges of rank 0, then with most edges. Mirrored is a block of which more edges would begin there
    than end. Edges between the same two nodes are in series in the dual, those of low rank next to the reference.
    Source: Whitney 1933; planarity: Boyer and Myrvold 2004, by networkx.

    Args:
        edges: first and second node of each edge; none is a loop.
        ranks: of each edge.
    """
    bundles: dict[Pair, list[Edge]] = {}
    for key, (plus, minus) in edges.items():
        bundles.setdefault((min(plus, minus), max(plus, minus)), []).append(key)
    graph: nx.Graph[int] = nx.Graph(list(bundles))
    is_planar, certificate = nx.check_planarity(graph, counterexample=True)
    if not is_planar:
        return _kuratowski(certificate, bundles)
    work = _Blocks(edges, ranks, bundles)
    for block in nx.biconnected_component_edges(graph):
        work.add(sorted((min(pair), max(pair)) for pair in block))
    numbers = {REFERENCE_FACE: REFERENCE_FACE}  # in the order of the edges
    ends = {}
    for key in edges:
        left, right = work.ends[key]
        ends[key] = numbers.setdefault(left, len(numbers)), numbers.setdefault(right, len(numbers))
    return DualEnds(ends, tuple(key for key in edges if key in work.bridges))


def _kuratowski(subgraph: nx.Graph[int], bundles: Mapping[Pair, Sequence[Edge]]) -> Kuratowski:
    branching = tuple(node for node in subgraph if subgraph.degree(node) > 2)
    edges = tuple(bundles[min(pair), max(pair)][0] for pair in subgraph.edges)
    return Kuratowski("K5" if len(branching) == 5 else "K3,3", tuple(sorted(branching)), tuple(sorted(edges)))


class _Blocks:
    """Numbers the faces of one block after another."""

    def __init__(
        self, edges: Mapping[Edge, tuple[int, int]], ranks: Mapping[Edge, int], bundles: Mapping[Pair, list[Edge]]
    ) -> None:
        self._edges, self._ranks, self._bundles = edges, ranks, bundles
        self._count = 0
        self.ends: dict[Edge, tuple[int, int]] = {}
        self.bridges: dict[Edge, None] = {}

    def add(self, block: Sequence[Pair]) -> None:
        """Take the faces of a block."""
        if len(block) == 1:
            keys = self._bundles[block[0]]
            if len(keys) == 1:
                self.bridges[keys[0]] = None
                self.ends[keys[0]] = self._new(), REFERENCE_FACE
            else:
                self._in_series(block[0], REFERENCE_FACE, REFERENCE_FACE)
            return
        faces = _faces(block)
        sides = {(low, high): (faces[high, low], faces[low, high]) for low, high in block}
        reference = self._reference(sides)
        begin = sum(self._beginning(pair, sides[pair], reference) for pair in block)
        numbers = {face: self._new() for face in dict.fromkeys(faces.values())} | {reference: REFERENCE_FACE}
        for pair, (left, right) in sides.items():
            ends = numbers[left], numbers[right]
            self._in_series(pair, *(ends if begin <= 0 else ends[::-1]))

    def _new(self) -> int:
        self._count += 1
        return self._count

    def _reference(self, sides: Mapping[Pair, tuple[int, int]]) -> int:
        counts: dict[int, list[int]] = {}
        for pair, faces in sides.items():
            for face in faces:
                count = counts.setdefault(face, [0, 0])
                count[0] += sum(self._ranks[key] == 0 for key in self._bundles[pair])
                count[1] += len(self._bundles[pair])
        return max(counts, key=lambda face: counts[face])

    def _beginning(self, pair: Pair, sides: tuple[int, int], reference: int) -> int:
        """How many edges between two nodes would begin at the reference, less those that would end there."""
        along = sum(1 if self._edges[key][0] == pair[0] else -1 for key in self._bundles[pair])
        return along * ((sides[0] == reference) - (sides[1] == reference))

    def _in_series(self, pair: Pair, left: int, right: int) -> None:
        """The edges between two nodes, in series from the face on the left of them all to that on their right."""
        keys = self._bundles[pair]
        if REFERENCE_FACE in (left, right):
            keys = sorted(keys, key=self._ranks.__getitem__, reverse=left != REFERENCE_FACE)
        places = [left, *(self._new() for _ in keys[1:]), right]
        for key, first, second in zip(keys, places, places[1:], strict=False):
            self.ends[key] = (first, second) if self._edges[key][0] == pair[0] else (second, first)


def _faces(block: Sequence[Pair]) -> dict[tuple[int, int], int]:
    """The number of the face on the right of each edge, in each direction."""
    _, embedding = nx.check_planarity(nx.Graph(list(block)))
    faces: dict[tuple[int, int], int] = {}
    for number, (start, end) in enumerate((*block, *((high, low) for low, high in block))):
        if (start, end) not in faces:
            border = embedding.traverse_face(start, end)
            faces |= dict.fromkeys(zip(border, (*border[1:], border[0]), strict=True), number)
    return faces
