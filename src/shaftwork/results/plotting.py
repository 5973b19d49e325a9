"""Curves over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from shaftwork.core.errors import MissingExtraError
from shaftwork.core.screen import in_lines
from shaftwork.results.course import course
from shaftwork.results.observer import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from shaftwork.results.solution import Solution

POINTS = 2000
"""Points of a curve besides those where it turns: more than a screen has."""
MOST_DRAWN = 20_000
"""Points of a curve beyond which only the lowest and the highest of what falls on the same place are drawn."""
ALIKE = 10.0
"""Curves whose largest values differ by more than this factor have axes of their own: the smaller would look flat."""
MARKED = 60
"""Changes of mode up to which each is a line across the curves; more would hide them, and the phases show them too."""
TURNS = 30 / np.pi
"""1/min of a rad/s."""
HEIGHT, STRIP = 2.4, 0.3
"""Inches of an axis, and of a row of phases."""

Curve = tuple[Array, Array]
"""Times (k,) and values (k,) or, along a part, (k, places)."""


def plot_signals(solution: Solution, names: tuple[str, ...]) -> Figure:
    """Curves of like size and the same unit on one axis, time in common; below them the phases of the motion.

    Extremes are drawn as high as they are, however fast the motion swings.

    Args:
        solution: the motion.
        names: quantities, such as "shaft.tau"; of one along a part all places are drawn.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingExtraError("matplotlib", "plot", "Solution.plot()") from None
    curves = {name: _curve(solution, name) for name in dict.fromkeys(names)}
    along, units = solution.observer.profiles, solution.observer.units
    groups = _groups(curves, {name: along[name][0] if name in along else units[name] for name in curves})
    parts = tuple(solution.phases[0].modes) if len(solution.phases) > 1 else ()
    heights = [HEIGHT] * len(groups) + ([STRIP * (len(parts) + 1)] if parts else [])
    figure = Figure(figsize=(9, 1.2 + sum(heights)), layout="constrained")
    axes = np.atleast_1d(figure.subplots(len(heights), 1, sharex=True, gridspec_kw={"height_ratios": heights}))
    for axis, (unit, members) in zip(axes, groups, strict=False):
        _draw(axis, unit, {name: curves[name] for name in members})
        if len(solution.events) <= MARKED:
            for time, *_ in solution.events:
                axis.axvline(time, color="0.75", linewidth=0.6, zorder=0)
    if parts:
        _draw_phases(axes[-1], solution, parts)
    axes[-1].set_xlabel("t in s")
    axes[-1].set_xlim(solution.steps[0], solution.steps[-1])
    figure.suptitle(in_lines(solution.name, 9.0))
    figure.align_ylabels()
    return figure


def _curve(solution: Solution, name: str) -> Curve:
    even = np.linspace(solution.steps[0], solution.steps[-1], POINTS)
    if name in solution.places:
        return even, solution.at(even)[name]
    read = solution.reader.quantity(name, None)
    turning, values = course(read, solution.steps).points()
    times, values = np.append(turning, even), np.append(values, read(even))
    order = np.argsort(times, kind="stable")
    times, values = times[order], values[order]
    return (times, values) if len(times) <= MOST_DRAWN else _envelope(times, values)


def _envelope(times: Array, values: Array) -> Curve:
    """The lowest and the highest of what falls on the same place of the picture, in their order."""
    firsts = np.unique(np.searchsorted(times, np.linspace(times[0], times[-1], POINTS, endpoint=False)))
    kept = [
        first + place
        for first, part in zip(firsts.tolist(), np.split(values, firsts[1:]), strict=True)
        for place in sorted({int(part.argmin()), int(part.argmax())})
    ]
    return times[kept], values[kept]


def _groups(curves: Mapping[str, Curve], units: Mapping[str, str]) -> list[tuple[str, list[str]]]:
    """Names by axis, with their unit: those of one unit whose largest values are alike, in the order of the first."""
    sizes = {name: float(np.abs(values).max()) for name, (_, values) in curves.items()}
    groups: list[tuple[str, list[str]]] = []
    for name in sorted(sizes, key=lambda name: -sizes[name]):
        for unit, members in groups:
            if unit == units[name] and (sizes[members[0]] <= ALIKE * sizes[name] or sizes[name] == 0.0):
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
            axis.plot(times, values, linewidth=1.2, color=f"C{number}", label=name)
            continue
        lines = axis.plot(times, values, linewidth=0.8, alpha=0.4, color=f"C{number}")
        lines[0].set_label(f"{name} at {values.shape[1]} places")
    axis.set_ylabel(unit)
    axis.grid(alpha=0.3)
    axis.legend(loc="best", framealpha=0.8, edgecolor="none")
    if unit == "rad/s":
        axis.secondary_yaxis(
            "right", functions=(lambda x: np.multiply(x, TURNS), lambda n: np.divide(n, TURNS))
        ).set_ylabel("1/min")


def _draw_phases(axis: Axes, solution: Solution, parts: Sequence[str]) -> None:
    """A row for each part that changes its mode, in the colour of its mode."""
    from matplotlib.colors import to_rgba
    from matplotlib.patches import Patch

    words = list(dict.fromkeys(row.modes[part] for part in parts for row in solution.phases))
    colors = {word: to_rgba(f"C{number % 10}", 0.55) for number, word in enumerate(words)}
    for place, part in enumerate(parts):
        spans = [(row.start, row.end - row.start) for row in solution.phases]
        axis.broken_barh(
            spans, (place - 0.4, 0.8), facecolors=[colors[row.modes[part]] for row in solution.phases], linewidth=0
        )
    axis.set_yticks(range(len(parts)), parts)
    axis.set_ylim(len(parts) - 0.5, -0.5)
    handles = [Patch(color=color, label=word) for word, color in colors.items()]
    axis.figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 5), frameon=False)
