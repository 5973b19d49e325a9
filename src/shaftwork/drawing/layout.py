"""What stands in the rows, in which order, and what joins it.

Nodes (and parts with more than two ends, as boxes) stand in rows, in an order in which few joints pass by. The first
joint of neighbours lies on the row itself; every other joint has a track above, short ones lower, and its symbol stands
in a gap between two neighbours, where nothing rises. What ends at the frame hangs below its node. A node that has lines
in several rows ends there in marks with its name. So neither symbols nor labels can overlap, however the network is
joined.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Literal, NamedTuple

from shaftwork.drawing.items import End, Item
from shaftwork.drawing.ordering import in_order
from shaftwork.drawing.strokes import Point, Text
from shaftwork.drawing.windings import Core, core
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
        beside: from a hanging symbol to its label.
        shallow, lines: how far a symbol on the line may reach down, and how many lines a label below it may have.
        arrow: of a mark, between its line and its name.
        margin: around the drawing.
        resolution: of a picture, pixels per inch.
    """

    space: float = 8.0
    rise: float = 10.0
    small: float = 7.0
    line: float = 13.0
    half: float = 20.0
    lead: float = 10.0
    beside: float = 4.0
    shallow: float = 18.0
    lines: int = 2
    arrow: float = 8.0
    margin: float = 10.0
    resolution: int = 200


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
    """A part with more than two ends: from where to where it stands, and at which height its middle is.

    A transformer has its windings there, which hang from that height.
    """

    item: Item
    left: float
    right: float
    middle: float
    core: Core | None = None


@dataclass
class Placement:
    """A drawing without strokes: symbols, boxes, and the wires of each node.

    Args:
        spots: symbols with two ends or one.
        boxes: symbols with more.
        wires: by node, lines through points.
        leads: by node, lines to what hangs from it.
        dots: by node, where more than two lines meet.
        grounds: where the frame or the reference begins, and a node whose domain it is of.
        pins: names of the ends of boxes.
        marks: by node, where its line ends at its name, and whether the name is to the right.
    """

    spots: list[Spot] = field(default_factory=list)
    boxes: list[Box] = field(default_factory=list)
    wires: dict[End, list[tuple[Point, ...]]] = field(default_factory=lambda: defaultdict(list))
    leads: dict[End, list[tuple[Point, ...]]] = field(default_factory=lambda: defaultdict(list))
    dots: dict[End, list[Point]] = field(default_factory=lambda: defaultdict(list))
    grounds: list[tuple[Point, End]] = field(default_factory=list)
    pins: list[Text] = field(default_factory=list)
    marks: dict[End, list[tuple[Point, bool]]] = field(default_factory=lambda: defaultdict(list))

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
        self.grounds += [(_up(point, y), node) for point, node in other.grounds]
        self.pins += [replace(text, at=_up(text.at, y)) for text in other.pins]
        for node, marks in other.marks.items():
            self.marks[node] += [(_up(point, y), right) for point, right in marks]


def _up(point: Point, y: float) -> Point:
    return point[0], point[1] + y


class DrawnStation(NamedTuple):
    """What stands in a row.

    Args:
        kind: a node; a box, of a part with more than two ends; the mark of a node that is in another row too.
        number: of the node, or the place of the part among the items.
        piece: of a node from which several items hang, which of them; 1 of a mark at the right end of a row.
    """

    kind: Literal["node", "box", "mark"]
    number: int
    piece: int = 0


@dataclass(frozen=True)
class Joint:
    """What joins two stations: an item, or a wire.

    Args:
        first: where an item has its first end, or a wire its node.
        second: the other station; the box, where a wire ends at one.
        item: what lies between; None of a wire.
        node: of a wire.
        pin: of a wire to windings, the number of the end.
    """

    first: DrawnStation
    second: DrawnStation
    item: Item | None
    node: End
    pin: int = 0


class Layout:
    """Items as stations in order with joints between them.

    Args:
        items: what is drawn.
        width_of: how wide a text is, pt.
        name_of: the name of a node.
        width: of a row, pt.
    """

    def __init__(
        self,
        items: Iterable[Item],
        width_of: Callable[[str], float],
        name_of: Callable[[End], str],
        width: float,
    ) -> None:
        self.items, self.width_of, self.name_of, self.width = tuple(items), width_of, name_of, width
        self.shunts: dict[End, list[Item]] = defaultdict(list)
        self.boxes: dict[DrawnStation, Item] = {}
        self._joints: list[Joint] = []
        for place, item in enumerate(self.items):
            self._sort(place, item)

    def _sort(self, place: int, item: Item) -> None:
        alive = [end for end in item.ends if end != GROUND]
        if item.windings:
            box = DrawnStation("box", place)
            self.boxes[box] = item
            pins = [end for winding in item.windings for end in (winding.plus, winding.minus) if end != GROUND]
            self._joints += [Joint(DrawnStation("node", end), box, None, end, pin) for pin, end in enumerate(pins)]
        elif item.below is not None:
            self.shunts[item.ends[0]].append(item)
        elif len(alive) == 1 and len(item.ends) <= 2:
            self.shunts[alive[0]].append(item)
        elif len(item.ends) == 2 and alive[0] != alive[1]:
            first, second = (DrawnStation("node", end) for end in item.ends)
            self._joints.append(Joint(first, second, item, GROUND))
        else:
            box = DrawnStation("box", place)
            self.boxes[box] = item
            self._joints += [Joint(DrawnStation("node", end), box, None, end) for end in alive]

    def text_width(self, item: Item) -> float:
        """Of the widest of its lines, pt."""
        return max(map(self.width_of, item.lines), default=0.0)

    def core(self, item: Item) -> Core:
        """The windings of an item, with room for the names of its ends below them."""
        names = max(self.width_of(winding.name) for winding in item.windings)
        return core(item.windings, names + SHEET.space)

    def shunt(self, item: Item) -> tuple[float, float]:
        """Of what hangs from a node, the middle from where its room begins, and the width of the room, pt."""
        if item.shape.on_line:
            half = max(self.text_width(item) / 2, 12.0) + SHEET.space / 2
            return half, 2 * half
        column = [item] if item.below is None else [item, item.below]
        middle = max(each.shape.below for each in column) + SHEET.space / 2
        label = middle + max(each.shape.above for each in column) + SHEET.beside
        return middle, label + max(map(self.text_width, column)) + SHEET.space

    @cached_property
    def order(self) -> tuple[DrawnStation, ...]:
        """The stations in the order in which they stand; a node has a piece for each item that hangs from it."""
        nodes = dict.fromkeys(DrawnStation("node", end) for item in self.items for end in _row_ends(item))
        whole = in_order((*nodes, *self.boxes), ((joint.first, joint.second) for joint in self._joints))
        return tuple(
            station._replace(piece=piece) for station in whole for piece in range(self._last_piece(station) + 1)
        )

    def _last_piece(self, station: DrawnStation) -> int:
        return max(0, len(self.shunts.get(station.number, ())) - 1) if station.kind == "node" else 0

    @cached_property
    def place(self) -> dict[DrawnStation, int]:
        """The place of each station in the order."""
        return {station: place for place, station in enumerate(self.order)}

    @cached_property
    def joints(self) -> tuple[Joint, ...]:
        """All joints: from node to node and to box, at the piece nearest to the other end; and from piece to piece."""
        joints = []
        for joint in self._joints:
            first, second = joint.first, joint.second
            if self.place[first] < self.place[second]:
                first = first._replace(piece=self._last_piece(first))
            else:
                second = second._replace(piece=self._last_piece(second))
            joints.append(replace(joint, first=first, second=second))
        for before, after in pairwise(self.order):
            if after.piece:
                joints.append(Joint(before, after, None, after.number))
        return tuple(joints)

    @cached_property
    def joints_at(self) -> dict[DrawnStation, list[int]]:
        """The numbers of the joints that end at each station."""
        numbers: dict[DrawnStation, list[int]] = defaultdict(list)
        for number, joint in enumerate(self.joints):
            numbers[joint.first].append(number)
            numbers[joint.second].append(number)
        return numbers


def _row_ends(item: Item) -> tuple[End, ...]:
    """The nodes of an item that stand in a row: not those between what hangs below each other."""
    return item.ends[:1] if item.below is not None else tuple(end for end in item.ends if end != GROUND)
