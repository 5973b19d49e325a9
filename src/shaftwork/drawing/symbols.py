"""The symbols of parts: strokes along the x axis, from (0, 0) to (LENGTH, 0), the positive side up."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from shaftwork.drawing.strokes import GREY, WHITE, Point, Stroke, arc, area, arrow, circle, line, rectangle

LENGTH = 54.0
"""Of a symbol between its ends, pt."""
MIDDLE = LENGTH / 2


@dataclass(frozen=True)
class Shape:
    """A symbol.

    Args:
        strokes: from (0, 0) to (LENGTH, 0).
        above, below: how far it reaches up and down, pt.
        mark: letters in its middle.
        on_line: whether it sits on a shaft line, with its middle at x = 0, and not between two ends.
    """

    strokes: tuple[Stroke, ...]
    above: float = 14.0
    below: float = 14.0
    mark: str = ""
    on_line: bool = False


def _leads(left: float, right: float) -> tuple[Stroke, Stroke]:
    return line((0.0, 0.0), (left, 0.0)), line((right, 0.0), (LENGTH, 0.0))


def _zigzag(left: float, right: float, y: float, height: float, teeth: int = 4) -> Stroke:
    step = (right - left) / (2 * teeth)
    inner = [(left + (k + 0.5) * step, y + height * (1 if k % 2 == 0 else -1)) for k in range(2 * teeth)]
    return line((left, y), *inner, (right, y))


def _dashpot(left: float, right: float, y: float, height: float) -> tuple[Stroke, ...]:
    middle = (left + right) / 2
    return (
        line((left, y), (middle, y)),
        line((middle, y - 0.7 * height), (middle, y + 0.7 * height)),
        line((middle - 7, y + height), (middle + 7, y + height), (middle + 7, y - height), (middle - 7, y - height)),
        line((middle + 7, y), (right, y)),
    )


def _plates(*extra: Stroke, gap: float = 4.0, height: float = 11.0) -> Shape:
    left, right = MIDDLE - gap / 2, MIDDLE + gap / 2
    faces = (line((left, -height), (left, height)), line((right, -height), (right, height)))
    return Shape((*_leads(left, right), *faces, *extra), height + 1, height + 1)


def _box(mark: str = "", half: float = 16.0, height: float = 11.0) -> Shape:
    frame = rectangle(MIDDLE - half, -height, MIDDLE + half, height, WHITE)
    return Shape((*_leads(MIDDLE - half, MIDDLE + half), frame), height + 1, height + 1, mark)


def _round(mark: str = "", *extra: Stroke) -> Shape:
    radius = 12.0
    return Shape(
        (*_leads(MIDDLE - radius, MIDDLE + radius), circle((MIDDLE, 0.0), radius, WHITE), *extra), 13.0, 13.0, mark
    )


def _spring_damper() -> Shape:
    left, right, y = 9.0, 45.0, 7.5
    ends = (line((left, -y), (left, y)), line((right, -y), (right, y)))
    return Shape(
        (*_leads(left, right), *ends, _zigzag(left, right, y, 4.0), *_dashpot(left, right, -y, 4.5)), 13.0, 13.0
    )


def _gear() -> Shape:
    left, right = MIDDLE - 9.0, MIDDLE + 9.0
    wheels = (rectangle(left, -8, MIDDLE, 8, GREY), rectangle(MIDDLE, -15, right, 15, GREY))
    teeth = tuple(line((left, y), (MIDDLE, y)) for y in (-4.0, 0.0, 4.0))
    teeth += tuple(line((MIDDLE, y), (right, y)) for y in (-10.0, -5.0, 0.0, 5.0, 10.0))
    return Shape((*_leads(left, right), *wheels, *teeth), 16.0, 16.0)


def _mirrored(shape: Shape) -> Shape:
    return replace(shape, strokes=tuple(stroke.mirrored(LENGTH) for stroke in shape.strokes))


def coil(start: Point, along: Point, turns: int, radius: float, side: int) -> tuple[Stroke, ...]:
    """Half circles in a row."""
    strokes = []
    for k in range(turns):
        x = start[0] + along[0] * (2 * k + 1) * radius
        y = start[1] + along[1] * (2 * k + 1) * radius
        first = (0.0 if side > 0 else 180.0) if along[0] else (-90.0 if side > 0 else 90.0)
        strokes.append(arc((x, y), radius, first, first + 180.0))
    return tuple(strokes)


def _transformer(*, reversing: bool = False) -> Shape:
    """Two windings that hang from the line, each with its foot on the frame; dots say where both are positive."""
    left, right, top, radius = MIDDLE - 9.0, MIDDLE + 9.0, -4.0, 4.0
    foot = top - 6 * radius
    strokes: list[Stroke] = [
        line((0.0, 0.0), (left, 0.0), (left, top)),
        line((LENGTH, 0.0), (right, 0.0), (right, top)),
        *coil((left, top), (0.0, -1.0), 3, radius, 1),
        *coil((right, top), (0.0, -1.0), 3, radius, -1),
        line((MIDDLE - 1.5, top), (MIDDLE - 1.5, foot)),
        line((MIDDLE + 1.5, top), (MIDDLE + 1.5, foot)),
        circle((left - 4, top - 1), 1.2, 0.0),
        circle((right + 4, foot + 1 if reversing else top - 1), 1.2, 0.0),
    ]
    for x in (left, right):
        strokes += [line((x, foot), (x, foot - 4)), *(stroke.moved((x, foot - 4)) for stroke in EARTH)]
    return Shape(tuple(strokes), 4.0, 44.0)


EARTH = (
    line((-7.0, 0.0), (7.0, 0.0)),
    line((-4.5, -3.0), (4.5, -3.0)),
    line((-2.0, -6.0), (2.0, -6.0)),
)
"""The reference of a circuit, below the point where it begins."""
FRAME = (
    line((-9.0, 0.0), (9.0, 0.0), width=1.4),
    *(line((x, 0.0), (x - 4.0, -5.0)) for x in (-5.0, -0.5, 4.0, 8.5)),
)
"""The frame, below the point where it begins."""

_PLUS = (line((6.0, 7.0), (12.0, 7.0)), line((9.0, 4.0), (9.0, 10.0)))
"""At the first end of what prescribes a voltage or a speed."""
_NONLINEAR = line((MIDDLE - 12.0, -11.0), (MIDDLE - 7.0, -11.0), (MIDDLE + 12.0, 11.0))

CIRCUIT: Mapping[str, Shape] = {
    "capacitor": _plates(gap=5.0),
    "inductor": Shape((*_leads(11.0, 43.0), *coil((11.0, 0.0), (1.0, 0.0), 4, 4.0, 1)), 6.0, 4.0),
    "resistor": _box(half=14.0, height=5.5),
    "nonlinear": Shape((*_box(half=14.0, height=5.5).strokes, _NONLINEAR), 12.0, 12.0),
    "current": _round("", *arrow((MIDDLE + 8.0, 0.0), (MIDDLE - 8.0, 0.0))),
    "voltage": _round("", line((MIDDLE - 12.0, 0.0), (MIDDLE + 12.0, 0.0)), *_PLUS),
    "transformer": _transformer(),
    "reversing transformer": _transformer(reversing=True),
    "wire": Shape((line((0.0, 0.0), (LENGTH, 0.0)),), 2.0, 2.0),
    "nonlinear inductor": Shape(
        (*_leads(11.0, 43.0), *coil((11.0, 0.0), (1.0, 0.0), 4, 4.0, 1), _NONLINEAR), 12.0, 12.0
    ),
    "line": Shape(
        (
            *_leads(4.0, 44.0),
            line((10.0, 6.0), (44.0, 6.0)),
            line((10.0, -6.0), (44.0, -6.0)),
            Stroke(((10.0, 0.0),), radius=6.0, angles=(90.0, 270.0)),
            circle((44.0, 0.0), 6.0, WHITE),
        ),
        8.0,
        8.0,
    ),
    "contact": Shape(
        (
            *_leads(18.0, 36.0),
            line((18.0, 0.0), (36.0, 0.0), width=1.8),
            circle((18.0, 0.0), 2.0, WHITE),
            circle((36.0, 0.0), 2.0, WHITE),
        ),
        5.0,
        5.0,
    ),
    "break": Shape(
        (
            *_leads(18.0, 36.0),
            line((18.0, 0.0), (34.0, 8.0)),
            circle((18.0, 0.0), 2.0, WHITE),
            circle((36.0, 0.0), 2.0, WHITE),
        ),
        10.0,
        5.0,
    ),
    "diode": Shape(
        (
            *_leads(20.0, 34.0),
            area((20.0, 7.0), (20.0, -7.0), (34.0, 0.0), fill=WHITE),
            line((34.0, -7.0), (34.0, 7.0)),
        ),
        9.0,
        9.0,
    ),
    "box": _box(),
}
"""Elements of a circuit. The arrow of a current source points to its first end, the positive side of a voltage too."""

TRAIN: Mapping[str, Shape] = {
    "disc": Shape((rectangle(-5.0, -17.0, 5.0, 17.0, GREY),), 18.0, 18.0, on_line=True),
    "mass": Shape((rectangle(-11.0, -11.0, 11.0, 11.0, GREY),), 12.0, 12.0, on_line=True),
    "spring": Shape((*_leads(11.0, 43.0), _zigzag(11.0, 43.0, 0.0, 7.0)), 9.0, 9.0),
    "damper": Shape((*_leads(11.0, 43.0), *_dashpot(11.0, 43.0, 0.0, 7.0)), 9.0, 9.0),
    "spring and damper": _spring_damper(),
    "shaft": Shape(
        (
            *_leads(6.0, 48.0),
            rectangle(6.0, -4.0, 48.0, 4.0, GREY),
            *(line((x, -4.0), (x + 6.0, 4.0)) for x in (12.0, 22.0, 32.0)),
        ),
        6.0,
        6.0,
    ),
    "gear": _gear(),
    "gear up": _mirrored(_gear()),
    "planetary gear": _box("P", half=13.0, height=13.0),
    "rack": Shape((*_leads(18.0, 36.0), circle((MIDDLE, 3.0), 9.0, GREY), line((14.0, -6.0), (40.0, -6.0))), 14.0, 8.0),
    "motor": _round("M"),
    "torque": _round("", *arrow((MIDDLE + 8.0, 0.0), (MIDDLE - 8.0, 0.0))),
    "speed": _round(r"$\omega$", *_PLUS),
    "wire": CIRCUIT["wire"],
    "load": Shape(
        (
            *_leads(MIDDLE - 14, MIDDLE + 14),
            rectangle(MIDDLE - 14, -10, MIDDLE + 14, 10, WHITE),
            *arrow((MIDDLE - 9.0, 0.0), (MIDDLE + 9.0, 0.0)),
        ),
        12.0,
        12.0,
    ),
    "friction": _plates(*(line((MIDDLE - 3.0, y), (MIDDLE + 3.0, y + 5.0)) for y in (-9.0, -3.0, 3.0)), gap=6.0),
    "brake": _plates(
        rectangle(MIDDLE - 7.0, -11.0, MIDDLE - 2.5, 11.0, GREY),
        rectangle(MIDDLE + 2.5, -11.0, MIDDLE + 7.0, 11.0, GREY),
        gap=14.0,
    ),
    "clutch": _plates(
        rectangle(MIDDLE - 6.0, -12.0, MIDDLE - 2.0, 12.0, GREY),
        rectangle(MIDDLE + 2.0, -12.0, MIDDLE + 6.0, 12.0, GREY),
        gap=12.0,
    ),
    "closed": _plates(
        rectangle(MIDDLE - 6.0, -11.0, MIDDLE, 11.0, GREY), rectangle(MIDDLE, -11.0, MIDDLE + 6.0, 11.0, GREY), gap=12.0
    ),
    "freewheel": _plates(area((MIDDLE - 6.0, 7.0), (MIDDLE - 6.0, -7.0), (MIDDLE + 6.0, 0.0), fill=WHITE), gap=12.0),
    "gap": _plates(
        *arrow((MIDDLE, 0.0), (MIDDLE - 8.0, 0.0), 4.0), *arrow((MIDDLE, 0.0), (MIDDLE + 8.0, 0.0), 4.0), gap=16.0
    ),
    "stop": Shape(
        (*_leads(20.0, 34.0), line((20.0, -8.0), (20.0, 8.0)), rectangle(30.0, -8.0, 34.0, 8.0, GREY)), 10.0, 10.0
    ),
    "rope": Shape(
        (line((0.0, 0.0), (10.0, 0.0)), arc((MIDDLE, 14.0), 22.0, 219.5, 320.5), line((44.0, 0.0), (LENGTH, 0.0))),
        6.0,
        10.0,
    ),
    "controller": _box("PI"),
    "resistor": CIRCUIT["resistor"],
    "inductor": CIRCUIT["inductor"],
    "capacitor": CIRCUIT["capacitor"],
    "voltage": CIRCUIT["voltage"],
    "current": CIRCUIT["current"],
    "switch": CIRCUIT["break"],
    "diode": CIRCUIT["diode"],
    "contact": CIRCUIT["contact"],
    "break": CIRCUIT["break"],
    "box": _box(),
}
"""Parts of a drive train, and the electrical ones that stand beside them."""
