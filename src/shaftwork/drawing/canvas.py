"""A drawing as strokes and texts in groups, and as SVG, PDF, PNG and TikZ."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shaftwork.core.domains import ELECTRICAL, ROTATION
from shaftwork.core.errors import ParameterError
from shaftwork.core.files import in_a_folder
from shaftwork.drawing.items import Item, plain
from shaftwork.drawing.layout import SHEET, Box, Placement, Spot
from shaftwork.drawing.placement import placed
from shaftwork.drawing.strokes import THICK, THIN, WHITE, Stroke, Text, area, circle, line, moved, rectangle
from shaftwork.drawing.svg import svg_of
from shaftwork.drawing.symbols import EARTH, FRAME, LENGTH
from shaftwork.drawing.texts import FORMULA, box_of, letters_of, width_of
from shaftwork.drawing.windings import DEPTH, Core
from shaftwork.equations.spelling import in_text
from shaftwork.network.graph import CircuitGraph
from shaftwork.results.plotting import new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = ("svg", "pdf", "png", "tex")
LARGEST = {"png": 2**16 * 72 / SHEET.resolution, "tex": 16383.0}
"""The longest side, pt: pictures have 2^16 pixels, and TeX's lengths end at 2^14 pt."""


@dataclass(frozen=True)
class DrawnGroup:
    """What belongs together: the symbol of a part with its texts, or the wires of a node.

    Args:
        name: "part J1" or "node rotor".
        strokes: its lines and areas, the later ones above the earlier.
        texts: its texts.
    """

    name: str
    strokes: tuple[Stroke, ...]
    texts: tuple[Text, ...] = ()


@dataclass(frozen=True)
class Drawing:
    """A drawing of a network.

    Args:
        name: of the network.
        groups: what is drawn, in points.

    Examples:
        >>> import shaftwork as sw
        >>> drawing = sw.scenes.crane_start().draw(as_circuit=True)
        >>> drawing.svg[:5]
        '<?xml'
    """

    name: str
    groups: tuple[DrawnGroup, ...]

    @cached_property
    def size(self) -> tuple[float, float, float, float]:
        """Left, bottom, right and top of all that is drawn, pt."""
        xs, ys = [0.0], [0.0]
        for group in self.groups:
            for stroke in group.strokes:
                xs += [x + r for x, _ in stroke.points for r in (stroke.radius, -stroke.radius)]
                ys += [y + r for _, y in stroke.points for r in (stroke.radius, -stroke.radius)]
            for text in group.texts:
                left, bottom, right, top = box_of(text)
                xs += [left, right]
                ys += [bottom, top]
        return min(xs) - SHEET.margin, min(ys) - SHEET.margin, max(xs) + SHEET.margin, max(ys) + SHEET.margin

    def figure(self) -> Figure:
        """As a figure of matplotlib, in its own size.

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        left, bottom, right, top = self.size
        figure = new_figure("Network.draw()", (right - left) / 72.0, (top - bottom) / 72.0)
        figure.set_layout_engine("none")
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        axes.set(xlim=(left, right), ylim=(bottom, top))
        for order, group in enumerate(self.groups):
            for stroke in group.strokes:
                _draw(axes, stroke, order)
            for text in group.texts:
                runs, bars = letters_of(text)
                for run in runs:
                    style: dict[str, Any] = {
                        "family": run.family,
                        "style": "oblique" if run.slanted else "normal",
                        "zorder": order,
                    }
                    axes.text(run.x, run.y, run.words, size=run.size, parse_math=False, va="baseline", **style)
                for bar in bars:
                    _draw(axes, bar, order)
        return figure

    def save(self, path: str | Path) -> None:
        """Write it; the format follows from the end of the name: .svg, .pdf, .png, or .tex for TikZ.

        Raises:
            ParameterError: another end; no such folder; a drawing that is too large for the format.
            MissingExtraError: matplotlib is not installed.
        """
        path = in_a_folder(path)
        ending = path.suffix.removeprefix(".").lower()
        if ending not in FORMATS:
            raise ParameterError(f"A drawing is no '{path.suffix}'. Take .{', .'.join(FORMATS)}.")
        left, bottom, right, top = self.size
        longest, limit = max(right - left, top - bottom), LARGEST.get(ending, math.inf)
        if longest > limit:
            raise ParameterError(
                f"The drawing is {longest:.0f} pt long, and a file .{ending} may have {limit:.0f} pt. Save it as .svg "
                "or .pdf, or choose a width= in draw() that makes it shorter."
            )
        if ending == "tex":
            path.write_text(self.tikz, encoding="utf-8")
        elif ending == "svg":
            path.write_text(self.svg, encoding="utf-8")
        else:
            path.write_bytes(self._bytes(ending))

    def _bytes(self, ending: str) -> bytes:
        import matplotlib as mpl

        stream = io.BytesIO()
        title = "".join(sign for sign in self.name if sign.isprintable())
        metadata = {"Title": title, "CreationDate": None} if ending == "pdf" else {}
        with mpl.rc_context({"pdf.fonttype": 42}):
            self.figure().savefig(stream, format=ending, dpi=SHEET.resolution, metadata=metadata)
        return stream.getvalue()

    @cached_property
    def svg(self) -> str:
        """As SVG; the ids of its groups end with "part J1" or "node rotor" for what they belong to."""
        return svg_of(self.name, self.groups, self.size)

    @property
    def tikz(self) -> str:
        """As TikZ, for a LaTeX document that loads the package tikz; lengths in pt."""
        lines = [r"\begin{tikzpicture}[x=1pt, y=1pt]"]
        for group in self.groups:
            lines.append(f"% {group.name}")
            lines += [_tikz_stroke(stroke) for stroke in group.strokes]
            lines += [_tikz_text(text) for text in group.texts]
        return "\n".join([*lines, r"\end{tikzpicture}", ""])

    def _repr_svg_(self) -> str:
        return self.svg[self.svg.index("<svg") :]


def _draw(axes: Any, stroke: Stroke, order: int) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Curve
    from matplotlib.transforms import Affine2D

    if stroke.radius:
        first, last = stroke.angles
        unit = Curve.arc(first, last) if last - first < 360.0 else Curve.unit_circle()
        curve = Affine2D().scale(stroke.radius).translate(*stroke.points[0]).transform_path(unit)
    else:
        curve = Curve([*stroke.points, stroke.points[0]] if stroke.closed else stroke.points, closed=stroke.closed)
    face = "none" if stroke.fill is None else str(stroke.fill)
    style = {"capstyle": "round", "joinstyle": "round", "zorder": order}
    axes.add_patch(PathPatch(curve, facecolor=face, edgecolor="black", linewidth=stroke.width, **style))


def _tikz_stroke(stroke: Stroke) -> str:
    options = [f"line width={stroke.width:g}pt", "line cap=round", "line join=round"]
    if stroke.fill is not None:
        options.append(f"fill=black!{100 * (1 - stroke.fill):g}")
    if stroke.radius:
        (x, y), (first, last) = stroke.points[0], stroke.angles
        if last - first >= 360.0:
            path = f"({x:.2f},{y:.2f}) circle[radius={stroke.radius:g}]"
        else:
            path = (
                f"({x:.2f},{y:.2f}) ++({first:g}:{stroke.radius:g}) "
                f"arc[start angle={first:g}, end angle={last:g}, radius={stroke.radius:g}]"
            )
    else:
        path = " -- ".join(f"({x:.2f},{y:.2f})" for x, y in stroke.points) + (" -- cycle" if stroke.closed else "")
    return rf"\draw[{', '.join(options)}] {path};"


def _tikz_text(text: Text) -> str:
    anchor = {"left": "base west", "centre": "base", "right": "base east"}[text.anchor]
    pieces = FORMULA.split(text.words)
    words = "$".join(piece if k % 2 else in_text(piece.replace(r"\$", "$")) for k, piece in enumerate(pieces))
    return rf"\node[anchor={anchor}, inner sep=0pt] at ({text.at[0]:.2f},{text.at[1]:.2f}) {{{words}}};"


def drawn(graph: CircuitGraph, items: Sequence[Item], *, train: bool, width: float) -> Drawing:
    """Items as a drawing.

    Args:
        graph: of the network.
        items: what is drawn.
        train: thick lines for shafts and hatches for the frame; else a circuit with wires and dots.
        width: of the drawing, pt; longer rows go on in the next one.

    Raises:
        ParameterError: a width that is no number above zero.
    """
    if not (isinstance(width, int | float) and width > 0):
        raise ParameterError(f"width = {width!r} must be a number of points above 0, or math.inf for one row.")
    result = placed(items, width_of, lambda node: plain(graph.node_name(node)), width - 2 * SHEET.margin)
    return Drawing(graph.name, tuple(_groups(result, graph, train=train)))


def _groups(result: Placement, graph: CircuitGraph, *, train: bool) -> Iterator[DrawnGroup]:
    for node in dict.fromkeys((*result.wires, *result.leads)):
        wires = result.wires[node]
        width = THICK if train and graph.domains[node] is ROTATION else THIN
        dots = () if train else (circle(point, 1.8, 0.0) for point in result.dots[node])
        leads = (line(*wire) for wire in result.leads[node])
        lines = (line(*wire, width=width) for wire in wires)
        name = graph.node_name(node)
        begins = [(x if right else x - 5.0, y) for (x, y), right in result.marks[node]]
        heads = (area((x, y - 3.0), (x, y + 3.0), (x + 5.0, y), fill=0.0) for x, y in begins)
        texts = (
            Text((x + SHEET.arrow, y - 3.5), plain(name), "left")
            if right
            else Text((x - SHEET.arrow, y - 3.5), plain(name), "right")
            for (x, y), right in result.marks[node]
        )
        yield DrawnGroup(f"node {name}", (*leads, *lines, *dots, *heads), tuple(texts))
    feet = (
        (point, FRAME if train and graph.domains[node] is not ELECTRICAL else EARTH) for point, node in result.grounds
    )
    yield DrawnGroup("frame", tuple(stroke for point, foot in feet for stroke in moved(foot, point)))
    for spot in result.spots:
        yield DrawnGroup(f"part {spot.item.part}", tuple(_symbol(spot)), tuple(_texts(spot)))
    for box in result.boxes:
        if box.core is not None:
            strokes = moved(box.core.strokes, (box.left, box.middle))
            yield DrawnGroup(f"part {box.item.part}", strokes, tuple(_winding_texts(box, box.core)))
            continue
        frame = rectangle(box.left, box.middle - SHEET.half, box.right, box.middle + SHEET.half, WHITE)
        yield DrawnGroup(f"part {box.item.part}", (frame,), tuple(_box_texts(box)))
    yield DrawnGroup("ends", (), tuple(result.pins))


def _symbol(spot: Spot) -> Iterator[Stroke]:
    for stroke in spot.item.shape.strokes:
        ready = stroke.mirrored(LENGTH) if spot.mirrored else stroke
        yield ready.moved(spot.at, 1 if spot.turned else 0)


def _texts(spot: Spot) -> Iterator[Text]:
    item, (x, y) = spot.item, spot.label
    lines = item.lines
    if spot.turned:
        for k, words in enumerate(lines):
            yield Text((x, y - 3.0 + SHEET.line * (len(lines) - 1) / 2 - SHEET.line * k), words, "left")
    else:
        for k, words in enumerate(reversed(lines)):
            yield Text((x, y + 2.0 + SHEET.line * k), words)
    if item.shape.mark:
        middle = (spot.at[0], spot.at[1] - LENGTH / 2) if spot.turned else (spot.at[0] + LENGTH / 2, spot.at[1])
        yield Text((middle[0], middle[1] - 3.5), item.shape.mark)


def _winding_texts(box: Box, core: Core) -> Iterator[Text]:
    y = box.middle - DEPTH
    names = [winding.name for winding in box.item.windings]
    if any(names):
        y -= SHEET.line
        yield from (
            Text((box.left + x, y + 3.0), name, size=SHEET.small)
            for x, name in zip(core.middles, names, strict=True)
            if name
        )
    for words in box.item.lines:
        y -= SHEET.line
        yield Text(((box.left + box.right) / 2, y + 3.0), words)


def _box_texts(box: Box) -> Iterator[Text]:
    yield Text(((box.left + box.right) / 2, box.middle - 15.0), box.item.lines[0])
