"""Strokes and texts in points: all that a drawing is made of."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

Point = tuple[float, float]
THIN, THICK, GREY, WHITE = 0.9, 2.2, 0.85, 1.0
"""Width of lines and of shafts, pt; what areas are filled with."""


@dataclass(frozen=True)
class Stroke:
    """A line through points, a closed area, or a circular arc.

    Args:
        points: its corners, pt; of an arc its centre alone.
        width: of the line, pt.
        fill: grey value from 0 (black) to 1 of the area inside; None leaves it empty.
        closed: whether the last point is joined to the first.
        radius: of an arc, pt.
        angles: from which to which an arc goes, counterclockwise, degrees.
    """

    points: tuple[Point, ...]
    width: float = THIN
    fill: float | None = None
    closed: bool = False
    radius: float = 0.0
    angles: tuple[float, float] = (0.0, 360.0)

    def moved(self, to: Point, turned: int = 0) -> Stroke:
        """The same turned by so many quarters clockwise about the origin, and moved."""
        points = self.points
        for _ in range(turned):
            points = tuple((y, -x) for x, y in points)
        first, last = self.angles
        angles = (first - 90.0 * turned, last - 90.0 * turned)
        return replace(self, points=tuple((x + to[0], y + to[1]) for x, y in points), angles=angles)

    def mirrored(self, length: float) -> Stroke:
        """The same with the ends at x = 0 and x = length exchanged."""
        first, last = self.angles
        points = tuple((length - x, y) for x, y in self.points)
        return replace(self, points=points, angles=(180.0 - last, 180.0 - first))


@dataclass(frozen=True)
class Text:
    """A text.

    Args:
        at: where, pt.
        words: with formulas between dollar signs.
        anchor: which of its sides is there.
        size: of its letters, pt.
    """

    at: Point
    words: str
    anchor: Literal["left", "centre", "right"] = "centre"
    size: float = 10.0


def line(*points: Point, width: float = THIN) -> Stroke:
    """A line through points."""
    return Stroke(points, width)


def area(*points: Point, fill: float | None = None) -> Stroke:
    """A closed area."""
    return Stroke(points, fill=fill, closed=True)


def rectangle(left: float, bottom: float, right: float, top: float, fill: float | None = None) -> Stroke:
    """A rectangle by two of its corners."""
    return area((left, bottom), (right, bottom), (right, top), (left, top), fill=fill)


def circle(centre: Point, radius: float, fill: float | None = None) -> Stroke:
    """A circle."""
    return Stroke((centre,), fill=fill, radius=radius)


def arc(centre: Point, radius: float, first: float, last: float) -> Stroke:
    """An arc, counterclockwise from the first angle to the last, degrees."""
    return Stroke((centre,), radius=radius, angles=(first, last))


def arrow(start: Point, end: Point, size: float = 5.0) -> tuple[Stroke, Stroke]:
    """A line with a head at its end."""
    dx, dy = end[0] - start[0], end[1] - start[1]
    length = (dx * dx + dy * dy) ** 0.5
    ux, uy = size * dx / length, size * dy / length
    sides = ((end[0] - ux - s * uy / 2.5, end[1] - uy + s * ux / 2.5) for s in (1, -1))
    return line(start, end), area(end, *sides, fill=0.0)


def moved(strokes: Iterable[Stroke], to: Point, turned: int = 0) -> tuple[Stroke, ...]:
    """Strokes turned by quarters clockwise about the origin, and moved."""
    return tuple(stroke.moved(to, turned) for stroke in strokes)
