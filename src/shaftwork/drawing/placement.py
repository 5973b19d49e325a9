"""Where everything is drawn, in points: stations from left to right in rows that are as wide as a page."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace
from operator import attrgetter

from shaftwork.drawing.items import End, Item
from shaftwork.drawing.layout import SHEET, Box, DrawnStation, Joint, Layout, Placement, Spot
from shaftwork.drawing.strokes import Point, Text
from shaftwork.drawing.symbols import LENGTH
from shaftwork.drawing.windings import DEPTH
from shaftwork.network.graph import GROUND


def placed(
    items: Sequence[Item], width_of: Callable[[str], float], name_of: Callable[[End], str], width: float
) -> Placement:
    """Every item in its place, in rows below each other.

    Args:
        items: what is drawn.
        width_of: how wide a text is, pt.
        name_of: the name of a node.
        width: of a row, pt; what cannot be divided may be wider.
    """
    layout, whole, first, bottom = Layout(items, width_of, name_of, width), Placement(), 0, 0.0
    while first < len(layout.order):
        row = _row_from(first, layout)
        y = bottom - row.above if first else 0.0
        whole.take(row.result, y)
        bottom, first = y - row.below - 2 * SHEET.space, row.last + 1
    return whole


def _row_from(first: int, layout: Layout) -> DrawnRow:
    """The row that begins with a station: the rest if it has room, else up to where the fewest lines lead on."""
    rows: list[DrawnRow] = []
    for last in range(first, len(layout.order)):
        row = DrawnRow(layout, first, last)
        if rows and row.end > layout.width:
            # From 0.6 of the width on a row may end, where fewer lines lead on than farther to the right.
            full = [each for each in rows if each.end > 0.6 * layout.width] or rows[-1:]
            return min(reversed(full), key=attrgetter("leading_on"))
        rows.append(row)
    return rows[-1]


class DrawnRow:
    """Stations in a row about its own line y = 0, from left to right: the slots of each, then the gap behind it.

    Args:
        layout: what is drawn.
        first: place of its first station.
        last: place of its last station.
    """

    def __init__(self, layout: Layout, first: int, last: int) -> None:
        self.layout, self.first, self.last = layout, first, last
        self.result = Placement()
        self.above, self.below, self.end = 0.0, 0.0, 0.0
        """How far it reaches up, down and to the right."""
        self.low = 0.0
        """Up to where labels of hanging symbols reach; what stands above them on the line is shallow."""
        self.leading_on = 0
        """How many nodes go on in later rows."""
        self.joints: list[Joint] = []
        self.stations = self._cut_out()
        self.place = {station: place for place, station in enumerate(self.stations)}
        self.spans = [sorted((self.place[joint.first], self.place[joint.second])) for joint in self.joints]
        self.tracks = self._tracks()
        self.direct = {self.spans[n][0]: n for n, track in enumerate(self.tracks) if track == 0}
        self.home = [(low + high - 1) // 2 for low, high in self.spans]
        self.leaves: dict[tuple[int, DrawnStation], float] = {}
        self.touches: dict[DrawnStation, list[tuple[float, int]]] = defaultdict(list)
        self.gaps: list[tuple[float, float]] = []
        self._place_all()
        self.tops = self._heights()
        for number in range(len(self.joints)):
            self._joint(number)
        self._wires()

    def _cut_out(self) -> tuple[DrawnStation, ...]:
        """The stations of the row, between the marks of nodes that are in other rows too.

        A joint between two nodes is drawn in the later row, a wire from a box to a node in that of the box.
        """
        inside = self.layout.order[self.first : self.last + 1]
        marks: dict[tuple[End, bool], DrawnStation] = {}  # by node and whether it leads on, not back
        links: dict[tuple[End, bool], DrawnStation] = {}  # where lines of this row lead to marks
        for number in sorted(dict.fromkeys(n for station in inside for n in self.layout.joints_at[station])):
            joint = self.layout.joints[number]
            outer = [end for end in (joint.first, joint.second) if not self._has(end)]
            if not outer:
                self.joints.append(joint)
                continue
            (there,) = outer
            here = joint.second if there == joint.first else joint.first
            later = self.layout.place[there] > self.last
            drawn_here = here.kind == "box" or (joint.item is not None and not later)
            node = there.number if drawn_here else here.number
            mark = marks.setdefault((node, later), DrawnStation("mark", node, int(later)))
            if drawn_here:
                ends = (mark, here) if there == joint.first else (here, mark)
                self.joints.append(replace(joint, first=ends[0], second=ends[1]))
            else:
                links.setdefault((node, later), here)
        self.joints += [Joint(station, marks[key], None, key[0]) for key, station in links.items()]
        back, forth = ([mark for (_, later), mark in marks.items() if later is which] for which in (False, True))
        self.leading_on = len(forth)
        return (*back, *inside, *forth)

    def _has(self, station: DrawnStation) -> bool:
        return self.first <= self.layout.place[station] <= self.last

    def _tracks(self) -> list[int]:
        """The track of each joint: 0 is the row, the others are above it."""
        tracks = [0] * len(self.joints)
        used: dict[int, list[tuple[int, int]]] = defaultdict(list)
        for number in sorted(range(len(self.joints)), key=lambda n: (self.spans[n][1] - self.spans[n][0], n)):
            low, high = self.spans[number]
            wound = {place for place in (low, high) if self._is_wound(self.stations[place])}
            track = 0 if high == low + 1 and (low, high) not in used[0] and not wound else 1
            while track and any(
                (low < last and begin < high) or not wound.isdisjoint((begin, last)) for begin, last in used[track]
            ):
                track += 1
            tracks[number] = track
            used[track].append((low, high))
        return tracks

    def _is_wound(self, station: DrawnStation) -> bool:
        return station.kind == "box" and bool(self.layout.boxes[station].windings)

    def _place_all(self) -> None:
        x, last = 0.0, len(self.stations) - 1
        for place in range(last + 1):
            begin = self._station(place, x)
            x = begin + self._gap_width(place) if place < last else begin
            if place < last and self.stations[place + 1].kind == "box":
                x = max(x, self.low)
            self.gaps.append((begin, x))
        self.end = max(x, self.low)

    def _rising(self, place: int, side: int) -> list[int]:
        """The joints above the line that leave a station to a side (-1 left, 1 right), from left to right."""
        numbers = [n for n, span in enumerate(self.spans) if self.tracks[n] and span[side < 0] == place]
        return sorted(numbers, key=self.tracks.__getitem__, reverse=side > 0)

    def _station(self, place: int, x: float) -> float:
        """Place what stands at a station from x on; its end."""
        station = self.stations[place]
        if station.kind == "box":
            return self._box(place, x)
        if station.kind == "mark" and not station.piece:
            x = self._mark(station, x, right=False)
        if place - 1 in self.direct:
            self.touches[station].append((x, 1))
        for number in self._rising(place, -1):
            x = self._riser(number, station, x)
        if station.kind == "node" and station.number in self.layout.shunts:
            x = self._shunt(self.layout.shunts[station.number][station.piece], station, x)
        for number in self._rising(place, 1):
            x = self._riser(number, station, x)
        if place in self.direct:
            item = self.joints[self.direct[place]].item
            if item is not None and item.shape.below > SHEET.shallow:
                x = max(x, self.low)
            self.touches[station].append((x, 1))
        if station.kind == "mark" and station.piece:
            x = self._mark(station, x, right=True)
        return x

    def _mark(self, station: DrawnStation, x: float, *, right: bool) -> float:
        """The end of a line at the name of its node; the end of both."""
        room = self.layout.width_of(self.layout.name_of(station.number)) + SHEET.arrow + 2.0
        at = x if right else x + room
        self.touches[station].append((at, 0))
        self.result.marks[station.number].append(((at, 0.0), right))
        self.above, self.below = max(self.above, SHEET.line), max(self.below, SHEET.space)
        return x + room

    def _riser(self, number: int, station: DrawnStation, x: float) -> float:
        self.leaves[number, station] = x + SHEET.rise / 2
        self.touches[station].append((x + SHEET.rise / 2, 1))
        return x + SHEET.rise

    def _shunt(self, item: Item, station: DrawnStation, x: float) -> float:
        shape, (middle, width) = item.shape, self.layout.shunt(item)
        if shape.on_line:
            self.result.spots.append(Spot(item, (x + middle, 0.0), (x + middle, shape.above + 3.0)))
            self.above = max(self.above, shape.above + _text_height(item))
            self.touches[station].append((x + middle, 0))
            return x + width
        x = max(x, self.low)
        column = [item] if item.below is None else [item, item.below]
        above, foot = station.number, (x + middle, 0.0)
        label_x = foot[0] + max(each.shape.above for each in column) + SHEET.beside
        for each in column:
            begin = foot[0], foot[1] - SHEET.lead
            self.result.leads[above].append((foot, begin))
            above, foot = each.ends[-1], (foot[0], begin[1] - LENGTH)
            mirrored = each.ends[0] == GROUND
            label = (label_x, begin[1] - LENGTH / 2)
            self.result.spots.append(Spot(each, begin, label, turned=True, mirrored=mirrored))
        self.result.grounds.append((foot, station.number))
        self.below = max(self.below, SHEET.space - foot[1])
        self.touches[station].append((x + middle, 1))
        self.low = x + width
        return label_x if len(item.lines) <= SHEET.lines else self.low

    def _box(self, place: int, x: float) -> float:
        station = self.stations[place]
        item = self.layout.boxes[station]
        if item.windings:
            return self._windings(item, station, x)
        rising = [*self._rising(place, -1), *self._rising(place, 1)]
        name = max(map(self.layout.width_of, item.ports.values()), default=0.0)
        apart = max(SHEET.rise, name + 3.0)
        width = max(
            2 * SHEET.half,
            2 * name + SHEET.space,
            apart * (len(rising) + 1),
            self.layout.text_width(item) + SHEET.space,
        )
        start = x + (width - apart * (len(rising) - 1)) / 2
        for k, number in enumerate(rising):
            self.leaves[number, station] = start + apart * k
        self.result.boxes.append(Box(item, x, x + width, 0.0))
        self.above, self.below = max(self.above, SHEET.half), max(self.below, SHEET.half)
        if GROUND in item.ends:
            node = next(end for end in item.ends if end != GROUND)
            self.result.grounds.append(((x + width / 2, -SHEET.half), node))
            self.below = max(self.below, SHEET.half + SHEET.space)
        return x + width

    def _windings(self, item: Item, station: DrawnStation, x: float) -> float:
        """A transformer, all ends of which rise from the line."""
        core = self.layout.core(item)
        width = max(core.width, self.layout.text_width(item)) + SHEET.space
        left = x + (width - core.width) / 2
        for number, joint in enumerate(self.joints):
            if joint.second == station:
                self.leaves[number, station] = left + core.pins[joint.pin]
        self.result.boxes.append(Box(item, left, left + core.width, 0.0, core))
        self.below = max(self.below, DEPTH + SHEET.line * (len(item.lines) + 1))
        return x + width

    def _gap_width(self, place: int) -> float:
        """As wide as the symbols and labels in the gap."""
        before, after = self.stations[place : place + 2]
        width = 0.0 if before.kind == after.kind == "node" and after.piece else SHEET.space
        for number, home in enumerate(self.home):
            item = self.joints[number].item
            if home == place:
                if item is not None:
                    width = max(width, max(LENGTH, self.layout.text_width(item)) + 2 * SHEET.space)
                elif self.joints[number].second.kind == "box":
                    width = max(width, 3 * SHEET.space)
        return width

    def _heights(self) -> list[float]:
        """The height of each track above the line."""
        count = 1 + max(self.tracks, default=0)
        above, below = [self.above, *[0.0] * (count - 1)], [0.0] * count
        for joint, track in zip(self.joints, self.tracks, strict=True):
            if joint.item is not None:
                above[track] = max(above[track], joint.item.shape.above + _text_height(joint.item))
                below[track] = max(below[track], joint.item.shape.below)
        tops = [0.0]
        for track in range(1, count):
            tops.append(tops[-1] + above[track - 1] + below[track] + SHEET.space)
        self.above, self.below = tops[-1] + above[-1], max(self.below, below[0])
        return tops

    def _joint(self, number: int) -> None:
        """The wires of a joint, and its symbol between them."""
        joint, track, (low, high) = self.joints[number], self.tracks[number], self.spans[number]
        left, right = self.stations[low], self.stations[high]
        begin, end = self.gaps[self.home[number]]
        y = self.tops[track]
        if track == 0:
            first, last = [(begin, y)], [(end, y)]
        else:
            feet = [self._top_of(station) for station in (left, right)]
            xs = self.leaves[number, left], self.leaves[number, right]
            first, last = ([(x, foot), (x, y)] for x, foot in zip(xs, feet, strict=True))
        if joint.item is None:
            self.result.wires[joint.node].append((*first, *reversed(last)))
            if joint.second.kind == "box" and not self._is_wound(joint.second):
                self._pin(joint, first, last)
            return
        x = (begin + end - LENGTH) / 2
        self.result.wires[left.number].append((*first, (x, y)))
        self.result.wires[right.number].append((*last, (x + LENGTH, y)))
        label = (x + LENGTH / 2, y + joint.item.shape.above + 3.0)
        self.result.spots.append(Spot(joint.item, (x, y), label, mirrored=left != joint.first))

    def _top_of(self, station: DrawnStation) -> float:
        """Where a line that rises from a station begins."""
        return SHEET.half if station.kind == "box" and not self._is_wound(station) else 0.0

    def _pin(self, joint: Joint, first: list[Point], last: list[Point]) -> None:
        """The name of the end of a box at which a wire comes in: inside, beside the wire."""
        left = self.place[joint.second] < self.place[joint.first]
        (x, y), rises = (first if left else last)[0], len(first) > 1
        words = self.layout.boxes[joint.second].ports[joint.node]
        if rises:
            self.result.pins.append(Text((x, y - 9.0), words, "centre", SHEET.small))
        else:
            beside = (x - 3.0, y + 2.0) if left else (x + 3.0, y + 2.0)
            self.result.pins.append(Text(beside, words, "right" if left else "left", SHEET.small))

    def _wires(self) -> None:
        """The line of each station along the row, with dots where more than two lines meet."""
        for station, touches in self.touches.items():
            low, high = min(x for x, _ in touches), max(x for x, _ in touches)
            if low < high:
                self.result.wires[station.number].append(((low, 0.0), (high, 0.0)))
            for x in {x for x, _ in touches}:
                lines = (x > low) + (x < high) + sum(count for at, count in touches if at == x)
                if lines > 2:
                    self.result.dots[station.number].append((x, 0.0))


def _text_height(item: Item) -> float:
    return SHEET.line * len(item.lines) + 3.0
