"""A drawing as SVG, written from its strokes and letters."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING
from xml.sax.saxutils import escape, quoteattr

from shaftwork.drawing.strokes import Stroke, Text
from shaftwork.drawing.texts import Run, letters_of

if TYPE_CHECKING:
    from shaftwork.drawing.canvas import DrawnGroup

Corner = tuple[float, float]


def svg_of(name: str, groups: Iterable[DrawnGroup], size: tuple[float, float, float, float]) -> str:
    """The text of an SVG file; y points down in it.

    Args:
        name: the title.
        groups: what is drawn, pt.
        size: left, bottom, right and top, pt.
    """
    left, bottom, right, top = size
    width, height = _number(right - left), _number(top - bottom)
    lines = [
        '<?xml version="1.0" encoding="utf-8"?>',
        '<svg xmlns="http://www.w3.org/2000/svg" '
        f'width="{width}pt" height="{height}pt" viewBox="0 0 {width} {height}">',
        f"<title>{escape(_printable(name))}</title>",
        f'<rect width="{width}" height="{height}" fill="white"/>',
    ]
    for order, group in enumerate(groups):
        lines.append(f"<g id={quoteattr(_printable(f'{order}:{group.name}'))}>")
        lines += [_path(stroke, (left, top)) for stroke in group.strokes]
        for text in group.texts:
            lines += _letters(text, (left, top))
        lines.append("</g>")
    return "\n".join([*lines, "</svg>", ""])


def _printable(words: str) -> str:
    return "".join(sign for sign in words if sign.isprintable())


def _number(value: float) -> str:
    return f"{round(value, 3) + 0.0:.10g}"


def _pair(point: tuple[float, float], corner: Corner) -> str:
    return f"{_number(point[0] - corner[0])} {_number(corner[1] - point[1])}"


def _path(stroke: Stroke, corner: Corner) -> str:
    fill = "none" if stroke.fill is None else f"#{3 * f'{round(255 * stroke.fill):02x}'}"
    style = (
        f'fill="{fill}" stroke="black" stroke-width="{stroke.width:g}" stroke-linecap="round" stroke-linejoin="round"'
    )
    radius, (first, last) = _number(stroke.radius), stroke.angles
    if not stroke.radius:
        path = "M" + " L".join(_pair(point, corner) for point in stroke.points) + (" Z" if stroke.closed else "")
    elif last - first >= 360.0:
        (x, y), (left, top) = stroke.points[0], corner
        return f'<circle cx="{_number(x - left)}" cy="{_number(top - y)}" r="{radius}" {style}/>'
    else:
        ends = (_pair(_on_circle(stroke, angle), corner) for angle in stroke.angles)
        path = f"M{next(ends)} A{radius} {radius} 0 {int(last - first > 180.0)} 0 {next(ends)}"
    return f'<path d="{path}" {style}/>'


def _on_circle(stroke: Stroke, angle: float) -> tuple[float, float]:
    (x, y), turn = stroke.points[0], math.radians(angle)
    return x + stroke.radius * math.cos(turn), y + stroke.radius * math.sin(turn)


def _letters(text: Text, corner: Corner) -> Iterator[str]:
    runs, bars = letters_of(text)
    yield f"<text>{''.join(_run(run, corner) for run in runs)}</text>"
    yield from (_path(bar, corner) for bar in bars)


def _run(run: Run, corner: Corner) -> str:
    """Letters; plain words are stretched to the width that was measured, whatever fonts the reader has."""
    at = f'x="{_number(run.x - corner[0])}" y="{_number(corner[1] - run.y)}"'
    style = f'font-family="{run.family}, sans-serif" font-size="{run.size:g}"' + ' font-style="oblique"' * run.slanted
    length = f' textLength="{_number(run.width)}" lengthAdjust="spacingAndGlyphs"' if run.width else ""
    return f"<tspan {at} {style}{length}>{escape(_printable(run.words))}</tspan>"
