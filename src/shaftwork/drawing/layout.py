"""The order in which things are drawn: nodes in a row along the train, what joins two of them between or above.

Nodes (and parts with more than two ends, as boxes) stand in a row, ordered so that the joints are short. The first
joint of neighbours lies on the row itself; every other joint has a track above, short ones lower, and its symbol stands
in a gap between two neighbours, where nothing rises. What ends at the frame hangs below its node. So neither symbols
nor labels can overlap, however the network is joined.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import networkx as nx
import numpy as np

from shaftwork.drawing.items import End, Item
from shaftwork.drawing.strokes import Point, Text
from shaftwork.network.graph import GROUND


class Sheet(NamedTuple):
    """The lengths of a drawing, pt.

    Args:
        space: between things that must not touch.
        rise: between lines that rise side by side.
        small: size of the letters of the names of ends.
        line: height of a line of text.
        half: half of the height of a box.
        lead: from a shaft or wire to the symbol that hangs from it.
        width: a row that is longer goes on in the next one: a page across.
    """

    space: float = 8.0
    rise: float = 10.0
    small: float = 7.0
    line: float = 13.0
    half: float = 20.0
    lead: float = 10.0
    width: float = 760.0


SHEET = Sheet()


@dataclass
class Spot:
    """Where an item stands.

    Args:
        item: the item.
        at: the point where its symbol begins, of one on a line its middle.
        label: the point of its label, above the middle of a lying symbol, right of a hanging one.
        turned: whether it hangs down.
        mirrored: whether its first end is where the symbol ends.
    """

    item: Item
    at: Point
    label: Point
    turned: bool = False
    mirrored: bool = False


@dataclass
class Box:
    """A part with more than two ends: from where to where it stands, and at which height its middle is."""

    item: Item
    left: float
    right: float
    middle: float


@dataclass
class Placement:
    """A drawing without strokes: symbols, boxes, and the wires of each node.

    Args:
        spots: symbols with two ends or one.
        boxes: symbols with more.
        wires: by node, lines through points.
        leads: by node, lines to what hangs from it.
        dots: by node, where more than two lines meet.
        grounds: where the frame or the reference begins.
        pins: names of the ends of boxes.
    """

    spots: list[Spot] = field(default_factory=list)
    boxes: list[Box] = field(default_factory=list)
    wires: dict[End, list[tuple[Point, ...]]] = field(default_factory=lambda: defaultdict(list))
    leads: dict[End, list[tuple[Point, ...]]] = field(default_factory=lambda: defaultdict(list))
    dots: dict[End, list[Point]] = field(default_factory=lambda: defaultdict(list))
    grounds: list[Point] = field(default_factory=list)
    pins: list[Text] = field(default_factory=list)

    def take(self, other: Placement, y: float) -> None:
        """Add what another has, at another height."""
        for spot in other.spots:
            self.spots.append(replace(spot, at=_up(spot.at, y), label=_up(spot.label, y)))
        self.boxes += [replace(box, middle=box.middle + y) for box in other.boxes]
        for mine, others in ((self.wires, other.wires), (self.leads, other.leads)):
            for node, lines in others.items():
                mine[node] += [tuple(_up(point, y) for point in line) for line in lines]
        for node, points in other.dots.items():
            self.dots[node] += [_up(point, y) for point in points]
        self.grounds += [_up(point, y) for point in other.grounds]
        self.pins += [replace(text, at=_up(text.at, y)) for text in other.pins]


def _up(point: Point, y: float) -> Point:
    return point[0], point[1] + y


Station = tuple[str, int]
"""A node ("node", number) or a part with more than two ends ("box", place among the items)."""


@dataclass(frozen=True)
class Joint:
    """What joins two stations: an item, or a pin of a box with its node."""

    first: Station
    second: Station
    item: Item | None
    node: End


class Layout:
    """Places items.

    Args:
        items: what is drawn.
        width_of: how wide a text is, pt.
    """

    def __init__(self, items: Iterable[Item], width_of: Callable[[str], float]) -> None:
        self.items, self.width_of = tuple(items), width_of
        self.shunts: dict[End, list[Item]] = defaultdict(list)
        self.boxes: dict[Station, Item] = {}
        self.joints: list[Joint] = []
        for place, item in enumerate(self.items):
            self._sort(place, item)

    def _sort(self, place: int, item: Item) -> None:
        alive = [end for end in item.ends if end != GROUND]
        if item.below is not None:
            self.shunts[item.ends[0]].append(item)
        elif len(alive) == 1 and len(item.ends) <= 2:
            self.shunts[alive[0]].append(item)
        elif len(item.ends) == 2 and alive[0] != alive[1]:
            first, second = (("node", end) for end in item.ends)
            self.joints.append(Joint(first, second, item, GROUND))
        else:
            box = ("box", place)
            self.boxes[box] = item
            self.joints += [Joint(("node", end), box, None, end) for end in alive]

    @cached_property
    def order(self) -> tuple[Station, ...]:
        """The stations in a row."""
        graph = nx.Graph()
        graph.add_nodes_from(dict.fromkeys(("node", end) for item in self.items for end in _row_ends(item)))
        graph.add_nodes_from(self.boxes)
        graph.add_edges_from((joint.first, joint.second) for joint in self.joints)
        rows = [row(graph.subgraph(nodes)) for nodes in nx.connected_components(graph)]
        return tuple(station for each in rows for station in each)

    @cached_property
    def place(self) -> dict[Station, int]:
        """The place of each station in the row."""
        return {station: place for place, station in enumerate(self.order)}

    def span(self, joint: Joint) -> tuple[int, int]:
        """The places that a joint joins, the lower first."""
        first, second = self.place[joint.first], self.place[joint.second]
        return min(first, second), max(first, second)

    @cached_property
    def tracks(self) -> dict[int, int]:
        """The track of each joint by its number: 0 is the row, the others are above it."""
        tracks: dict[int, int] = {}
        used: dict[int, list[tuple[int, int]]] = defaultdict(list)
        for number in sorted(range(len(self.joints)), key=lambda k: (np.diff(self.span(self.joints[k]))[0], k)):
            low, high = self.span(self.joints[number])
            track = 0 if high == low + 1 and (low, high) not in used[0] else 1
            while any(low < last and first < high for first, last in used[track]):
                track += 1
            tracks[number] = track
            used[track].append((low, high))
        return tracks


def _row_ends(item: Item) -> tuple[End, ...]:
    """The nodes of an item that stand in the row: not those between what hangs below each other."""
    return item.ends[:1] if item.below is not None else tuple(end for end in item.ends if end != GROUND)


def row(graph: nx.Graph) -> tuple[Station, ...]:
    """Connected stations in an order in which joints are short: by Fiedler's vector, then neighbours exchanged."""
    stations = list(graph)
    if len(stations) > 2:
        laplacian = nx.laplacian_matrix(graph, stations).toarray().astype(float)
        vector = np.linalg.eigh(laplacian)[1][:, 1]
        if vector[0] > 0:
            vector = -vector
        stations = [stations[k] for k in np.argsort(np.round(vector, 9), kind="stable")]
    place = {station: k for k, station in enumerate(stations)}

    def length(station: Station) -> int:
        return sum(abs(place[station] - place[other]) for other in graph[station])

    better = True
    while better:
        better = False
        for k in range(len(stations) - 1):
            first, second = stations[k], stations[k + 1]
            before = length(first) + length(second)
            place[first], place[second] = k + 1, k
            if length(first) + length(second) < before:
                stations[k], stations[k + 1], better = second, first, True
            else:
                place[first], place[second] = k, k + 1
    return tuple(stations)
