"""Pictures of a torsional calculation: stress over speed, order by order and together, with what is permitted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from shaftwork.results.observer import RPM, Array
from shaftwork.results.plotting import new_figure
from shaftwork.torsional.shaft_sections import MPA
from shaftwork.torsional.shaft_vibration import ShaftVibration

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def picture(title: str, shafts: Sequence[ShaftVibration]) -> Figure:
    """One axis for each shaft, speeds in common.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    figure = new_figure("TorsionalCalculation.plot()", 9.0, 0.8 + 2.6 * len(shafts), title)
    axes = np.atleast_1d(figure.subplots(len(shafts), 1, sharex=True))
    for axis, shaft in zip(axes, shafts, strict=True):
        _draw(axis, shaft)
    axes[-1].set_xlabel("speed in 1/min")
    return figure


def _draw(axis: Axes, shaft: ShaftVibration) -> None:
    n = shaft.speeds * RPM
    scale, unit = 1e-3, "torque in kN m"
    if shaft.section is not None:
        scale, unit = 1 / (shaft.section.modulus * MPA), "stress in N/mm²"
    together = _shown(scale * shaft.amplitude)
    axis.plot(n, together, color="C0", linewidth=1.6, label="all orders")
    largest = np.argsort(-np.where(np.isfinite(shaft.by_order), shaft.by_order, 0.0).max(axis=0), kind="stable")
    for k, place in enumerate(sorted(largest[:4].tolist()), 1):  # of more a reader cannot tell the lines apart
        axis.plot(
            n,
            _shown(scale * shaft.by_order[:, place]),
            color=f"C{k}",
            linewidth=0.8,
            label=f"order {shaft.orders[place]:g}",
        )
    top = float(np.nanmax(together, initial=0.0))
    if shaft.limits is not None:
        for values, style, label in zip(shaft.limits, ("-", "--"), (r"$\tau_c$", r"$\tau_t$"), strict=True):
            limit = _shown(values / MPA)
            axis.plot(n, limit, style, color="0.3", linewidth=1.2, label=label)
            top = max(top, float(np.nanmax(limit, initial=0.0)))
    if shaft.permissible is not None:
        axis.axhline(scale * shaft.permissible, linestyle="-.", color="0.3", linewidth=1.2, label="permissible")
        top = max(top, scale * shaft.permissible)
    for barred in shaft.barred:
        colour = "0.85" if barred.allowed else "#f4c7c3"
        axis.axvspan(barred.start * RPM, barred.end * RPM, color=colour, zorder=0)
    axis.set_ylim(0.0, 1.15 * top or 1.0)  # some room above the largest stress, or the limits
    axis.set_xlim(n[0], n[-1])
    axis.set_ylabel(unit)
    axis.set_title(f"{shaft.shaft}: {shaft.verdict}", loc="left", fontsize=10)
    axis.grid(alpha=0.3)
    axis.legend(loc="upper right", fontsize=8, ncols=2, framealpha=0.8, edgecolor="none")


def _shown(values: Array) -> Array:
    """A curve with a gap where it has no bound."""
    return np.where(np.isfinite(values), values, np.nan)
