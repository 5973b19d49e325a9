"""The order of stations along the rows: such that few joints pass by a station."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from heapq import heappop, heappush
from typing import TypeVar

Vertex = TypeVar("Vertex", bound=Hashable)


def in_order(vertices: Iterable[Vertex], edges: Iterable[tuple[Vertex, Vertex]]) -> tuple[Vertex, ...]:
    """All vertices, one connected piece after another, each from one of its ends.

    Next comes the vertex after which the fewest edges lead on to later ones; of several the one farthest from the other
    end, so that branches come before the rest of the line, then the one beside the vertex before. The cost grows in
    proportion to the edges, but for a logarithm.
    """
    neighbours: dict[Vertex, list[Vertex]] = {vertex: [] for vertex in vertices}
    for first, second in edges:
        neighbours[first].append(second)
        neighbours[second].append(first)
    order: dict[Vertex, int] = {}
    for vertex in neighbours:
        if vertex not in order:
            _append_piece(order, vertex, neighbours)
    return tuple(order)


def _append_piece(
    order: dict[Vertex, int], declared_first: Vertex, neighbours: Mapping[Vertex, Sequence[Vertex]]
) -> None:
    """Append the connected piece of a vertex, from that of its ends which is nearer to the vertex."""
    from_first = _distances(declared_first, neighbours)
    far = max(from_first, key=from_first.__getitem__)
    from_far = _distances(far, neighbours)
    other = max(from_far, key=from_far.__getitem__)
    start, end = (far, other) if from_first[far] < from_first[other] else (other, far)
    to_end = from_far if end == far else _distances(end, neighbours)
    rank = {vertex: number for number, vertex in enumerate(from_first)}
    open_edges = {vertex: len(neighbours[vertex]) for vertex in from_first}
    heap: list[tuple[int, int, int, int, Vertex]] = [(0, 0, 0, rank[start], start)]
    while heap:
        *_, vertex = heappop(heap)
        if vertex in order:
            continue
        order[vertex] = len(order)
        for other in neighbours[vertex]:
            open_edges[other] -= 2  # an edge that leads on there becomes one that ends there
            if other not in order:
                heappush(heap, (open_edges[other], -to_end[other], -order[vertex], rank[other], other))


def _distances(start: Vertex, neighbours: Mapping[Vertex, Sequence[Vertex]]) -> dict[Vertex, int]:
    """Edges from a vertex to each one of its piece, nearest first."""
    distances, pending = {start: 0}, [start]
    for vertex in pending:
        for other in neighbours[vertex]:
            if other not in distances:
                distances[other] = distances[vertex] + 1
                pending.append(other)
    return distances
