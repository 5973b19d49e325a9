"""Curves over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from shaftwork.core.errors import MissingExtraError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from shaftwork.results.solution import Solution

POINTS = 2000
"""Points of a curve: more than a screen has, so that no oscillation is cut off."""


def plot_signals(solution: Solution, names: tuple[str, ...]) -> Figure:
    """One axis for each unit among the quantities, time in common.

    Args:
        solution: the motion.
        names: quantities, such as "shaft.tau".

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingExtraError("matplotlib", "plot", "Solution.plot()") from None
    units = solution.observer.units
    groups: dict[str, list[str]] = {}
    for name in names:
        groups.setdefault(units[name], []).append(name)
    fine = solution.at(np.linspace(solution.steps[0], solution.steps[-1], POINTS))
    figure = Figure(figsize=(9, 1.2 + 2.4 * len(groups)), layout="constrained")
    axes = np.atleast_1d(figure.subplots(len(groups), 1, sharex=True))
    for axis, (unit, members) in zip(axes, groups.items(), strict=True):
        for name in members:
            axis.plot(fine.t, fine[name], linewidth=1.2, label=name)
        axis.set_ylabel(unit.replace("*", " "))
        axis.grid(alpha=0.3)
        axis.legend(loc="best", frameon=False)
    axes[-1].set_xlabel("t in s")
    figure.suptitle(solution.name)
    return figure
