"""Error over run time as a picture that says at a glance which model to use."""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from shaftwork.core.errors import MissingExtraError
from shaftwork.studies.ladder import LADDER, family_of, text_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from shaftwork.studies.work_precision import Trial, WorkPrecision

MARKERS = "osD^vP*X<>"
"""One for each kind of model, the same in every study; the colours go with them."""
FLOOR = 1e-12
"""Errors below this part of the largest value are drawn here: they are rounding."""


def work_precision_figure(study: WorkPrecision) -> Figure:
    """Two panels: error over CPU time, and error over the number of states; each curve is a kind of model."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingExtraError("matplotlib", "plot", "WorkPrecision.plot()") from None
    figure = Figure(figsize=(11, 5.4), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    families: dict[str, list[Trial]] = {}
    for trial in study.trials:
        if np.isfinite(trial.error):
            families.setdefault(trial.family, []).append(trial)
    for family, members in families.items():
        style = _style(family, families)
        errors = [max(trial.error, FLOOR) for trial in members]
        costs = [1e3 * trial.cpu for trial in members]
        sizes = [float(max(trial.states, 1)) for trial in members]
        for axis, values in zip(axes, (costs, sizes), strict=True):
            axis.loglog(values, errors, markersize=6, linewidth=1.3, label=family, **style)
            ends = {len(members) - 1: (4, -9, "left"), 0: (-4, 4, "right")}  # of one alone the first is meant
            for k, (x, y, side) in ends.items():
                text = {"fontsize": 7, "color": style["color"], "ha": side}
                axis.annotate(_size(members[k]), (values[k], errors[k]), (x, y), textcoords="offset points", **text)
    for axis, label in zip(axes, ("CPU time of a warm call in ms", "number of states"), strict=True):
        axis.set_xlabel(label)
        axis.grid(which="both", alpha=0.2)
    axes[0].set_ylabel("largest error of the end torques / largest torque")
    axes[0].text(0.02, 0.02, "better: down and left", transform=axes[0].transAxes, fontsize=8, alpha=0.7)
    axes[1].legend(frameon=False, fontsize=8)
    left_out = (f"left out, {why}: {', '.join(models)}" for why, models in study.left_out.items())
    if note := "\n".join(textwrap.shorten(line, 180) for line in left_out):
        figure.supxlabel(note, fontsize=7, x=0.01, ha="left")
    figure.suptitle(f"{study.name}: which model of '{study.shaft}' reaches which accuracy at which cost")
    return figure


def courses_figure(study: WorkPrecision, end: str) -> Figure:
    """Two panels: the torque at an end by the best model of each kind and as it truly is, and the differences."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingExtraError("matplotlib", "plot", "WorkPrecision.plot_courses()") from None
    figure = Figure(figsize=(11, 7), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    column, symbol = ("ab".index(end), rf"$\tau_{end}$")
    true = study.courses[:, column]
    least = FLOOR * (np.abs(true).max(initial=0.0) or 1.0)
    families = [trial.family for trial in study.representatives]
    for trial, dashes in zip(study.representatives, itertools.cycle(("-", "--", "-.", ":")), strict=False):
        assert trial.courses is not None  # noqa: S101 (that of a representative)
        course, colour = trial.courses[:, column], _style(trial.family, families)["color"]
        upper.plot(study.t, course, dashes, linewidth=1.0, color=colour, label=trial.model)
        lower.semilogy(study.t, np.maximum(np.abs(course - true), least), dashes, linewidth=1.0, color=colour)
    upper.plot(study.t, true, color="black", linewidth=1.4, zorder=0, label=study.truth[0])
    upper.set_ylabel(f"{symbol} of '{study.shaft}' in N m")
    lower.set_ylabel("error in N m")
    lower.set_xlabel("t in s")
    figure.legend(loc="outside lower center", frameon=False, fontsize=8, ncols=4)
    for axis in (upper, lower):
        axis.grid(alpha=0.2)
    figure.suptitle(f"{study.name}: torque at end {end} of '{study.shaft}', the best model of each kind")
    return figure


def _style(family: str, others: Iterable[str]) -> dict[str, str]:
    """Colour and marker of a kind of model: its place among those that are compared by default, and then others."""
    known = dict.fromkeys(family_of(text_of(model)) for model in LADDER)
    place = list(known | dict.fromkeys(sorted(others))).index(family)
    return {"color": f"C{place % 10}", "marker": MARKERS[place % len(MARKERS)]}


def _size(trial: Trial) -> str:
    return trial.model.partition("=")[2].split(",")[0].rstrip(")")
