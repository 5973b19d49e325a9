"""The table of extreme drives as a coloured matrix."""

from __future__ import annotations

import re
from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from shaftwork.core.errors import MissingExtraError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from shaftwork.studies.stability import Stability

COLOURS = {
    "right": "#2e8b57",
    "coarse": "#a8d5a2",
    "warned": "#f2d45c",
    "refused": "#c3cad3",
    "failed": "#8795a8",
    "too long": "#f0a860",
    "unknown": "#b59ad6",
    "wrong": "#d62728",
}
ABSENT = "#ffffff"
LEAST = 1e-16
"""Errors below are drawn as this one."""
COLUMN, LETTER = 0.24, 0.075
"""Least width of a column, and width of a letter above the columns, in inches."""
SIZE = re.compile(r"\b(?:m|n|places)=\d+(?:, )?")


def stability_figure(study: Stability) -> Figure:
    """Cases downwards; models, and in each of them engines, from left to right; the exponent of the error in each cell.

    Models that differ by their size alone share columns, unless a case has several of them.
    """
    try:
        from matplotlib.colors import ListedColormap
        from matplotlib.figure import Figure
        from matplotlib.patches import Patch
    except ImportError:
        raise MissingExtraError("matplotlib", "plot", "Stability.plot()") from None
    engines, cases = study.engines, tuple(dict.fromkeys(cell.case for cell in study.cells))
    kind_of = _kinds(study)
    kinds = tuple(dict.fromkeys(kind_of.values()))
    numbers = np.zeros((len(cases), len(kinds) * len(engines)))
    names = list(COLOURS)
    longest = max(len(line) for kind in kinds for line in kind.splitlines())
    width = max(COLUMN * len(engines), LETTER * (longest + 2)) * len(kinds)
    figure = Figure(figsize=(max(2.5 + width, 8.0), 2.4 + 0.22 * len(cases)), layout="constrained")
    axes = figure.subplots()
    for cell in study.cells:
        row = cases.index(cell.case)
        column = kinds.index(kind_of[cell.model]) * len(engines) + engines.index(cell.engine)
        numbers[row, column] = 1 + names.index(cell.verdict)
        if np.isfinite(cell.error):
            exponent = int(np.ceil(np.log10(max(cell.error, LEAST))))
            colour = "white" if cell.verdict in ("right", "wrong") else "black"
            axes.text(column, row, str(exponent), ha="center", va="center", fontsize=6, color=colour)
    axes.imshow(numbers, cmap=ListedColormap([ABSENT, *COLOURS.values()]), vmin=0, vmax=len(names), aspect="auto")
    axes.set_yticks(range(len(cases)), cases, fontsize=7)
    axes.set_xticks(range(numbers.shape[1]), engines * len(kinds), fontsize=6, rotation=90)
    middles = np.arange(len(kinds)) * len(engines) + (len(engines) - 1) / 2
    above = axes.secondary_xaxis("top")
    above.set_xticks(middles, kinds, fontsize=8)
    above.tick_params(length=0)
    for k in range(1, len(kinds)):
        axes.axvline(k * len(engines) - 0.5, color="black", linewidth=1.2)
    for k in range(1, len(cases)):
        axes.axhline(k - 0.5, color="white", linewidth=1.0)
    counts = study.counts
    handles = [Patch(color=COLOURS[name], label=f"{name} ({counts[name]})") for name in names]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(names), fontsize=7, frameon=False)
    figure.suptitle("Extreme drives: verdict, and power of ten that the error does not exceed", fontsize=10)
    return figure


def _kinds(study: Stability) -> dict[str, str]:
    """The heading over the columns of each model: its name, and in a second line what it is beside its size."""
    models = tuple(dict.fromkeys(cell.model for cell in study.cells))
    short = {model: SIZE.sub("", model).replace(", )", ")").replace("()", "") for model in models}
    beside = Counter((case, short[model]) for case, model in study.rows)
    several = {kind for (_, kind), count in beside.items() if count > 1}
    return {model: (model if kind in several else kind).replace("(", "\n(", 1) for model, kind in short.items()}
