"""Pictures: an empty one with its title, and curves over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from shaftwork.core.errors import MissingExtraError
from shaftwork.core.screen import in_lines
from shaftwork.results.course import course
from shaftwork.results.observer import RPM, Array, PhaseRow, Reader

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_SIGNALS = 8
"""States drawn when nobody chooses: as many as colours can be told apart."""

Curve = tuple[Array, Array]
"""Times (k,) and values (k,) or, along a part, (k, places)."""


def new_figure(purpose: str, width: float, height: float, title: str = "") -> Figure:
    """An empty picture.

    Args:
        purpose: who draws it, "Solution.plot()".
        width: in.
        height: in.
        title: above all of it.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingExtraError("matplotlib", "plot", purpose) from None
    figure = Figure(figsize=(width, height), layout="constrained")
    if title:
        figure.suptitle(plain(in_lines(title, width)))
    return figure


def plain(text: str) -> str:
    """A text for a picture, in which names are no formulas."""
    return text.replace("$", r"\$")


def label(name: str, unit: str, between: str = " ") -> str:
    """A name with its unit for an axis; of a pure number, or where the unit is not known, the name alone."""
    return plain(name if unit in ("", "1") else f"{name}{between}in {unit}")


def plot_signals(
    reader: Reader, names: tuple[str, ...], phases: Sequence[PhaseRow], events: Sequence[tuple[float, str, str, str]]
) -> Figure:
    """Curves of like size and the same unit on one axis, time in common; below them the phases of the motion.

    Extremes are drawn as high as they are, however fast the motion swings.

    Args:
        reader: of the motion.
        names: quantities, such as "shaft.tau"; of one along a part all places are drawn.
        phases: of the motion.
        events: between them.

    Raises:
        MissingExtraError: matplotlib is not installed.
        SignalError: there is no such quantity.
    """
    units = {name: reader.unit(name) for name in names}
    curves = {name: curve(reader, name) for name in units}
    groups = grouped(curves, units)
    parts = tuple(phases[0].modes) if len(phases) > 1 else ()
    # inches: of an axis, and of a row of phases
    heights = [2.4] * len(groups) + ([0.3 * (len(parts) + 1)] if parts else [])
    figure = new_figure("Solution.plot()", 9.0, 1.2 + sum(heights), reader.title)
    axes = np.atleast_1d(figure.subplots(len(heights), 1, sharex=True, gridspec_kw={"height_ratios": heights}))
    for axis, (unit, members) in zip(axes, groups, strict=False):
        _draw(axis, unit, {name: curves[name] for name in members})
        if len(events) <= 60:  # more lines would hide the curves, and the phases show the changes too
            for time, *_ in events:
                axis.axvline(time, color="0.75", linewidth=0.6, zorder=0)
    if parts:
        _draw_phases(axes[-1], phases, parts)
    axes[-1].set_xlabel("t in s")
    axes[-1].set_xlim(reader.steps[0], reader.steps[-1])
    figure.align_ylabels()
    return figure


def curve(reader: Reader, name: str) -> Curve:
    """A quantity of a motion at even times and where it turns, as many as can be seen."""
    even = np.linspace(reader.steps[0], reader.steps[-1], 2000)  # more than a screen has
    if reader.places(name):
        return even, reader.values(name, even, reader.dense(even))
    read = reader.quantity(name)
    turning, values = course(read, reader.steps).points()
    times, values = np.append(turning, even), np.append(values, read(even))
    order = np.argsort(times, kind="stable")
    times, values = times[order], values[order]
    # Of more points only the lowest and the highest of what falls on the same place are drawn.
    return (times, values) if len(times) <= 20_000 else _envelope(times, values, even.size)


def _envelope(times: Array, values: Array, count: int) -> Curve:
    """The lowest and the highest of what falls on the same of so many places of the picture, in their order."""
    firsts = np.unique(np.searchsorted(times, np.linspace(times[0], times[-1], count, endpoint=False)))
    places = [
        first + place
        for first, part in zip(firsts.tolist(), np.split(values, firsts[1:]), strict=True)
        for place in sorted({int(part.argmin()), int(part.argmax())})
    ]
    return times[places], values[places]


def grouped(curves: Mapping[str, Curve], units: Mapping[str, str]) -> list[tuple[str, list[str]]]:
    """Names by axis, with their unit: those of one unit whose largest values are alike, in the order of the first."""
    sizes = {name: float(np.abs(values).max()) for name, (_, values) in curves.items()}
    groups: list[tuple[str, list[str]]] = []
    for name in sorted(sizes, key=lambda name: -sizes[name]):
        for unit, members in groups:
            # beside a curve ten times as large it would look flat
            if unit == units[name] and (sizes[members[0]] <= 10.0 * sizes[name] or sizes[name] == 0.0):
                members.append(name)
                break
        else:
            groups.append((units[name], [name]))
    order = {name: number for number, name in enumerate(curves)}
    ordered = [(unit, sorted(members, key=order.__getitem__)) for unit, members in groups]
    return sorted(ordered, key=lambda group: order[group[1][0]])


def _draw(axis: Axes, unit: str, curves: Mapping[str, Curve]) -> None:
    for number, (name, (times, values)) in enumerate(curves.items()):
        if values.ndim == 1:
            axis.plot(times, values, linewidth=1.2, color=f"C{number}", label=plain(name))
            continue
        lines = axis.plot(times, values, linewidth=0.8, alpha=0.4, color=f"C{number}")
        lines[0].set_label(f"{plain(name)} at {values.shape[1]} places")
    axis.set_ylabel(unit)
    axis.grid(alpha=0.3)
    axis.legend(loc="best", framealpha=0.8, edgecolor="none")
    if unit == "rad/s":
        axis.secondary_yaxis(
            "right", functions=(lambda x: np.multiply(x, RPM), lambda n: np.divide(n, RPM))
        ).set_ylabel("1/min")


def _draw_phases(axis: Axes, phases: Sequence[PhaseRow], parts: Sequence[str]) -> None:
    """A row for each part that changes its mode, in the colour of its mode."""
    from matplotlib.colors import to_rgba
    from matplotlib.patches import Patch

    words = list(dict.fromkeys(row.modes[part] for part in parts for row in phases))
    colors = {word: to_rgba(f"C{number % 10}", 0.55) for number, word in enumerate(words)}
    for place, part in enumerate(parts):
        spans = [(row.start, row.end - row.start) for row in phases]
        shades = [colors[row.modes[part]] for row in phases]
        axis.broken_barh(spans, (place - 0.4, 0.8), facecolors=shades, linewidth=0)
    axis.set_yticks(range(len(parts)), [plain(part) for part in parts])
    axis.set_ylim(len(parts) - 0.5, -0.5)
    handles = [Patch(color=color, label=word) for word, color in colors.items()]
    axis.figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 5), frameon=False)
