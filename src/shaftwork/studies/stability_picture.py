"""The table of extreme drives as a coloured matrix."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from shaftwork.core.errors import MissingExtraError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from shaftwork.studies.stability import Cell, Stability

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


def stability_figure(study: Stability) -> Figure:
    """Cases downwards; models, and in each of them engines, from left to right; the exponent of the error in each cell.

    Models that differ by their size alone share a column.
    """
    try:
        from matplotlib.colors import ListedColormap
        from matplotlib.figure import Figure
        from matplotlib.patches import Patch
    except ImportError:
        raise MissingExtraError("matplotlib", "plot", "Stability.plot()") from None
    engines, cases = study.engines, tuple(dict.fromkeys(cell.case for cell in study.cells))
    kinds = tuple(dict.fromkeys(_kind(cell) for cell in study.cells))
    numbers = np.zeros((len(cases), len(kinds) * len(engines)))
    names = list(COLOURS)
    figure = Figure(figsize=(2.5 + 0.24 * numbers.shape[1], 2.2 + 0.22 * len(cases)), layout="constrained")
    axes = figure.subplots()
    for cell in study.cells:
        row = cases.index(cell.case)
        column = kinds.index(_kind(cell)) * len(engines) + engines.index(cell.engine)
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


def _kind(cell: Cell) -> str:
    return cell.model.partition("(")[0]
