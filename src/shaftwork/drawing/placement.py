"""Where everything is drawn, in points: stations from left to right in rows that are as wide as a page."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from shaftwork.drawing.items import End, Item
from shaftwork.drawing.layout import (
    SHEET,
    Box,
    Joint,
    Layout,
    Placement,
    Spot,
    Station,
)
from shaftwork.drawing.strokes import Point, Text
from shaftwork.drawing.symbols import LENGTH
from shaftwork.network.graph import GROUND


def placed(items: Sequence[Item], width_of: Callable[[str], float]) -> Placement:
    """Every item in its place."""
    return _Placing(Layout(items, width_of)).result


@dataclass
class _Row:
    """A row of stations, about its own line y = 0.

    Args:
        result: what stands in it.
        tops: height of each track above the line.
        above: how far it reaches up.
        below: how far it reaches down.
        end: where it ends.
        height: of its line in the drawing.
    """

    result: Placement = field(default_factory=Placement)
    tops: list[float] = field(default_factory=list)
    above: float = 0.0
    below: float = 0.0
    end: float = 0.0
    height: float = 0.0


class _Placing:
    """Works from left to right: the slots of each station, then the gap behind it; rows from the top down."""

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.leaves: dict[tuple[int, Station], float] = {}
        self.touches: dict[End, list[tuple[float, int]]] = defaultdict(list)
        self.gaps: list[tuple[float, float]] = []
        self.spans = {n: layout.span(joint) for n, joint in enumerate(layout.joints)}
        self.direct = {self.spans[n][0]: n for n, track in layout.tracks.items() if track == 0}
        self.home = {n: (low + high - 1) // 2 for n, (low, high) in self.spans.items()}
        self.rows, self.row_of = [_Row()], list[_Row]()
        self._stations()
        for row in self.rows:
            self._heights(row)
        for number in range(len(layout.joints)):
            self._joint(number)
        self._wires()
        self.result = self._joined()

    def _stations(self) -> None:
        """Place all stations and gaps. A row ends behind a gap that no joint passes, or one on the line alone."""
        x, last = 0.0, len(self.layout.order) - 1
        for place in range(last + 1):
            row = self.rows[-1]
            self.row_of.append(row)
            x = self._station(place, x, row)
            width = self._gap_width(place) if place < last else 0.0
            self.gaps.append((x, x + width))
            x = row.end = x + width
            passing = sum(low <= place < high for low, high in self.spans.values())
            if x > SHEET.width and place < last and passing == (place in self.direct):
                self.rows.append(_Row())
                x = 0.0

    def _text_width(self, item: Item) -> float:
        return max(map(self.layout.width_of, item.lines), default=0.0)

    def _rising(self, place: int, side: int) -> list[int]:
        """The joints above the line that leave a station to a side (-1 left, 1 right), from left to right."""
        station, numbers = self.layout.order[place], []
        for number, joint in enumerate(self.layout.joints):
            if (
                self.layout.tracks[number]
                and station in (joint.first, joint.second)
                and (side > 0) == (self.spans[number][0] == place)
            ):
                numbers.append(number)
        return sorted(numbers, key=lambda n: self.layout.tracks[n], reverse=side > 0)

    def _station(self, place: int, x: float, row: _Row) -> float:
        """Place what stands at a station from x on; its end."""
        station = self.layout.order[place]
        if station in self.layout.boxes:
            return self._box(place, station, x, row)
        node = station[1]
        if place - 1 in self.direct:
            self.touches[node].append((x, 1))
        for number in self._rising(place, -1):
            x = self._riser(number, station, x)
        for item in self.layout.shunts[node]:
            x = self._shunt(item, node, x, row)
        for number in self._rising(place, 1):
            x = self._riser(number, station, x)
        if place in self.direct:
            self.touches[node].append((x, 1))
        return x

    def _riser(self, number: int, station: Station, x: float) -> float:
        self.leaves[number, station] = x + SHEET.rise / 2
        self.touches[station[1]].append((x + SHEET.rise / 2, 1))
        return x + SHEET.rise

    def _shunt(self, item: Item, node: End, x: float, row: _Row) -> float:
        shape = item.shape
        if shape.on_line:
            text = self._text_width(item)
            half = max(text / 2, 12.0) + SHEET.space / 2
            row.result.spots.append(Spot(item, (x + half, 0.0), (x + half, shape.above + 3.0)))
            row.above = max(row.above, shape.above + _text_height(item))
            self.touches[node].append((x + half, 0))
            return x + 2 * half
        column = [item] if item.below is None else [item, item.below]
        text = max(map(self._text_width, column))
        centre = x + max(each.shape.below for each in column) + SHEET.space / 2
        above, foot = node, (centre, 0.0)
        label_x = centre + max(each.shape.above for each in column) + 4.0
        for each in column:
            begin = centre, foot[1] - SHEET.lead
            row.result.leads[above].append((foot, begin))
            above, foot = each.ends[-1], (centre, begin[1] - LENGTH)
            mirrored = each.ends[0] == GROUND
            label = (label_x, begin[1] - LENGTH / 2)
            row.result.spots.append(Spot(each, begin, label, turned=True, mirrored=mirrored))
        row.result.grounds.append(foot)
        row.below = max(row.below, -foot[1])
        self.touches[node].append((centre, 1))
        return label_x + text + SHEET.space

    def _box(self, place: int, station: Station, x: float, row: _Row) -> float:
        item = self.layout.boxes[station]
        rising = [*self._rising(place, -1), *self._rising(place, 1)]
        name = max(map(self.layout.width_of, item.ports.values()), default=0.0)
        apart = max(SHEET.rise, name + 3.0)
        width = max(
            2 * SHEET.half, 2 * name + SHEET.space, apart * (len(rising) + 1), self._text_width(item) + SHEET.space
        )
        start = x + (width - apart * (len(rising) - 1)) / 2
        for k, number in enumerate(rising):
            self.leaves[number, station] = start + apart * k
        row.result.boxes.append(Box(item, x, x + width, 0.0))
        row.above, row.below = max(row.above, SHEET.half), max(row.below, SHEET.half)
        if GROUND in item.ends:
            row.result.grounds.append((x + width / 2, -SHEET.half))
        return x + width

    def _gap_width(self, place: int) -> float:
        """As wide as the symbols and labels in the gap."""
        width = SHEET.space
        for number, home in self.home.items():
            item = self.layout.joints[number].item
            if home == place:
                width = max(
                    width, 3 * SHEET.space if item is None else max(LENGTH, self._text_width(item)) + 2 * SHEET.space
                )
        return width

    def _heights(self, row: _Row) -> None:
        """The height of each track of a row."""
        numbers = [n for n, (low, _) in self.spans.items() if self.row_of[low] is row]
        count = 1 + max((self.layout.tracks[n] for n in numbers), default=0)
        above, below = [row.above, *[0.0] * (count - 1)], [0.0] * count
        for number in numbers:
            item, track = self.layout.joints[number].item, self.layout.tracks[number]
            if item is not None:
                above[track] = max(above[track], item.shape.above + _text_height(item))
                below[track] = max(below[track], item.shape.below)
        row.tops = [0.0]
        for track in range(1, count):
            row.tops.append(row.tops[-1] + above[track - 1] + below[track] + SHEET.space)
        row.above, row.below = row.tops[-1] + above[-1], max(row.below, below[0])

    def _joint(self, number: int) -> None:
        """The wires of a joint, and its symbol between them."""
        joint, track, (low, high) = self.layout.joints[number], self.layout.tracks[number], self.spans[number]
        left, right = self.layout.order[low], self.layout.order[high]
        row, (begin, end) = self.row_of[low], self.gaps[self.home[number]]
        y = row.tops[track]
        if track == 0:
            first, last = [(begin, y)], [(end, y)]
        else:
            feet = [SHEET.half if station in self.layout.boxes else 0.0 for station in (left, right)]
            xs = self.leaves[number, left], self.leaves[number, right]
            first, last = ([(x, foot), (x, y)] for x, foot in zip(xs, feet, strict=True))
        if joint.item is None:
            row.result.wires[joint.node].append((*first, *reversed(last)))
            self._pin(joint, first, last, row)
            return
        x = (begin + end - LENGTH) / 2
        row.result.wires[left[1]].append((*first, (x, y)))
        row.result.wires[right[1]].append((*last, (x + LENGTH, y)))
        label = (x + LENGTH / 2, y + joint.item.shape.above + 3.0)
        row.result.spots.append(Spot(joint.item, (x, y), label, mirrored=left != joint.first))

    def _pin(self, joint: Joint, first: list[Point], last: list[Point], row: _Row) -> None:
        """The name of the end of a box at which a wire comes in: inside, beside the wire."""
        left = self.layout.place[joint.second] < self.layout.place[joint.first]
        (x, y), rises = (first if left else last)[0], len(first) > 1
        words = self.layout.boxes[joint.second].ports[joint.node]
        if rises:
            row.result.pins.append(Text((x, y - 9.0), words, "centre", SHEET.small))
        else:
            beside = (x - 3.0, y + 2.0) if left else (x + 3.0, y + 2.0)
            row.result.pins.append(Text(beside, words, "right" if left else "left", SHEET.small))

    def _wires(self) -> None:
        """The line of each node along its row, with dots where more than two lines meet."""
        for node, touches in self.touches.items():
            result = self.row_of[self.layout.place["node", node]].result
            low, high = min(x for x, _ in touches), max(x for x, _ in touches)
            if low < high:
                result.wires[node].append(((low, 0.0), (high, 0.0)))
            for x in {x for x, _ in touches}:
                lines = (x > low) + (x < high) + sum(count for at, count in touches if at == x)
                if lines > 2:
                    result.dots[node].append((x, 0.0))

    def _joined(self) -> Placement:
        """The rows below each other, each led on to the next where a joint passes from one to the other."""
        whole = Placement()
        y = between = 0.0
        for row in self.rows:
            row.height = y = between - row.above - 2 * SHEET.space if row is not self.rows[0] else 0.0
            between = y - row.below - 2 * SHEET.space
            whole.take(row.result, y)
        for place, number in self.direct.items():
            row, after = self.row_of[place], self.row_of[place + 1]
            if row is not after:
                station = self.layout.order[place + 1]
                node = self.layout.joints[number].node if station in self.layout.boxes else station[1]
                right, left, between = row.end + SHEET.lead, -2 * SHEET.lead, row.height - row.below - 2 * SHEET.space
                corners = (right, row.height), (right, between), (left, between), (left, after.height)
                whole.wires[node].append(((row.end, row.height), *corners, (0.0, after.height)))
        return whole


def _text_height(item: Item) -> float:
    return SHEET.line * len(item.lines) + 3.0
