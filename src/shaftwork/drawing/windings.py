"""Transformers with a winding for each term of a coupling: ends on the line, or at the reference below."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from shaftwork.drawing.strokes import GREY, Stroke, circle, line, rectangle
from shaftwork.drawing.symbols import EARTH, coil
from shaftwork.network.graph import GROUND

RADIUS, TURNS, RETURN = 4.0, 3, 11.0
"""Of a coil, with pt from it to the wire that comes back from its lower end."""
TOP, FOOT = -10.0, -10.0 - 2 * RADIUS * TURNS
EARTHED = FOOT - 10.0
DEPTH = 8.0 - EARTHED
"""How far windings reach below the line."""


@dataclass(frozen=True)
class Winding:
    """A winding of a coupling, the sum of whose factors times voltages is zero.

    Args:
        plus, minus: its nodes; the second may be `GROUND`.
        factor: sign of its factor; a dot marks the end to which its voltage points.
        name: of the end, where it has one.
    """

    plus: int
    minus: int
    factor: int
    name: str = ""


@dataclass(frozen=True)
class Core:
    """Windings as they are drawn.

    Args:
        strokes: from x = 0 on, below the line y = 0.
        pins: x of each end that is not grounded, winding by winding, the positive one first.
        middles: x of each winding.
        width: of all, pt.
    """

    strokes: tuple[Stroke, ...]
    pins: tuple[float, ...]
    middles: tuple[float, ...]
    width: float


def core(windings: Sequence[Winding], pitch: float) -> Core:
    """Two windings face each other across their core; more of them sit on the limbs of one between two yokes.

    The magnetic fluxes of the limbs add up to zero, and all limbs have the same magnetomotive force. So the voltages
    with their factors add up to zero, and the currents are in proportion to the factors.

    Args:
        windings: two or more.
        pitch: from one of more than two to the next, pt.
    """
    facing = len(windings) == 2
    apart = 2 * RADIUS + 10.0 if facing else max(pitch, RETURN + RADIUS + 18.0)
    strokes, pins, middles = list[Stroke](), list[float](), list[float]()
    for number, winding in enumerate(windings):
        x = RETURN + 6.0 + number * apart
        side = -1 if facing and number == 1 else 1
        strokes += _winding(winding, x, side)
        middles.append(x)
        pins += [x] if winding.minus == GROUND else [x, x - side * RETURN]
    behind = list(_limbs(middles, facing=facing))
    width = middles[-1] + RETURN + 6.0 + (0.0 if facing else RADIUS)
    return Core((*behind, *strokes), tuple(pins), tuple(middles), width)


def _limbs(middles: Sequence[float], *, facing: bool) -> Iterator[Stroke]:
    if facing:
        middle = sum(middles) / 2
        yield from (line((middle + dx, TOP), (middle + dx, FOOT)) for dx in (-1.5, 1.5))
        return
    yield from (rectangle(x + RADIUS + 2, FOOT - 1, x + RADIUS + 7, TOP + 1, GREY) for x in middles)
    left, right = middles[0] + RADIUS + 2, middles[-1] + RADIUS + 7
    yield from (rectangle(left, y, right, y + 4, GREY) for y in (FOOT - 5, TOP + 1))


def _winding(winding: Winding, x: float, side: int) -> Iterator[Stroke]:
    """A coil that bulges to a side, with the wires from its ends: up to the line, or down to the reference."""
    yield from coil((x, TOP), (0.0, -1.0), TURNS, RADIUS, side)
    back = x - side * RETURN
    yield line((x, 0.0), (x, TOP))
    if winding.minus == GROUND:
        yield line((x, FOOT), (x, EARTHED))
        yield from (stroke.moved((x, EARTHED)) for stroke in EARTH)
    else:
        yield line((x, FOOT), (back, FOOT), (back, 0.0))
    yield circle((x - side * 4.5, TOP - 2 if winding.factor > 0 else FOOT + 2), 1.2, 0.0)
