"""Variants as lines through parallel axes, one for each parameter and measure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from shaftwork.core.errors import MissingExtraError, ParameterError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from shaftwork.studies.sweep_result import Sweep

MOST_LINES = 2000
"""More lines would hide each other."""
TICKS = 5


def parallel_coordinates(sweep: Sweep, names: tuple[str, ...]) -> Figure:
    """Each axis from the smallest to the largest value; what does not meet the requirements is grey, limits are red."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingExtraError("matplotlib", "plot", "Sweep.plot()") from None
    from matplotlib.collections import LineCollection

    given = {**sweep.parameters, **sweep.measures}
    if unknown := [name for name in names if name not in given]:
        raise ParameterError(f"There is no column '{unknown[0]}'. There are: {', '.join(given)}.")
    shown = names or tuple(given)
    rows = np.flatnonzero(~sweep.failed)[:MOST_LINES]
    low = {name: float(given[name][rows].min(initial=np.inf)) for name in shown} if rows.size else {}
    size = {name: (float(given[name][rows].max()) - low[name]) or 1.0 for name in low}
    figure = Figure(figsize=(2.2 * max(len(shown), 2), 4.8), layout="constrained")
    axes = figure.subplots()
    lines = np.array([[(k, (given[n][row] - low[n]) / size[n]) for k, n in enumerate(shown)] for row in rows.tolist()])
    passed = sweep.passed[rows]
    for chosen, color, order in ((~passed, "0.8", 1), (passed, "tab:blue", 2)):
        if chosen.any():
            axes.add_collection(
                LineCollection(list(lines[chosen]), colors=color, linewidths=0.7, alpha=0.6, zorder=order)
            )
    for k, name in enumerate(shown):
        axes.axvline(k, color="0.3", linewidth=0.8, zorder=3)
        for share in np.linspace(0.0, 1.0, TICKS) if name in low else ():
            text = f"{low[name] + share * size[name]:.4g}"
            axes.annotate(text, (k, share), (3, 0), textcoords="offset points", fontsize=7, va="center", zorder=4)
        for limit in sweep.require.get(name, ()) if name in low else ():
            if limit is not None:
                axes.plot([k - 0.08, k + 0.08], [(limit - low[name]) / size[name]] * 2, color="tab:red", zorder=4)
    axes.set_xlim(-0.2, len(shown) - 0.5)
    axes.set_ylim(-0.05, 1.05)
    axes.set_xticks(range(len(shown)), shown, fontsize=8)
    axes.set_yticks([])
    axes.set_title(f"{sweep.name}: {len(sweep)} variants, {int(sweep.passed.sum())} meet the requirements", fontsize=10)
    return figure
