"""The comparison of models of a shaft and of engines: its table, its advice and its pictures."""

from __future__ import annotations

import dataclasses
import itertools
import textwrap
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shaftwork.core.files import write_rows
from shaftwork.core.screen import in_columns
from shaftwork.numerics.tolerances import SAME
from shaftwork.results.observer import Array
from shaftwork.results.plotting import new_figure
from shaftwork.studies.study_arguments import LADDER, family_of, text_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RTOL = 1e-8
"""Relative tolerance of the runs where none is given."""
MARKERS = "osD^vP*X<>"
"""One for each kind of model, the same in every study; the colours go with them."""


@dataclass(frozen=True)
class Trial:
    """One model with one engine.

    Args:
        model: as text, such as "Lumped(m=20)".
        engine: name of the engine that ran.
        states: number of states.
        setup: CPU time from the network to the first result, less a warm call, s; of a trial that failed, all of it.
        cpu: CPU time of a warm call with reading both end torques, s; the median of several.
        errors: largest error of each quantity over its largest value, by name, and no less than that of the truth; of
            frequencies, relative to each.
        extra_modes: oscillating modes, up to halfway between the highest frequency that is judged and the next, less
            those of the exact shaft: spurious ones, or missing ones where negative; None where unknown.
        why: why it failed or was not tried; empty where it was.
        asked: name of the engine that was asked for.
        rtol: relative tolerance of the runs.
        courses: (k, 2) torque at both ends at the output times; None where it failed.
    """

    model: str
    engine: str
    states: int
    setup: float
    cpu: float
    errors: dict[str, float]
    extra_modes: int | None = None
    why: str = ""
    asked: str = "auto"
    rtol: float = RTOL
    courses: Array | None = field(default=None, repr=False, compare=False)

    @property
    def family(self) -> str:
        """The model without its size."""
        return family_of(self.model)

    @property
    def line(self) -> tuple[str, str, float]:
        """What it shares with larger models of its kind: the family, the engine and the tolerance."""
        return self.family, self.asked, self.rtol

    @property
    def spent(self) -> float:
        """CPU time of set-up and one call, s; of a trial that failed, until then."""
        return self.setup + (self.cpu if self.errors else 0.0)

    @property
    def costs(self) -> tuple[str, str, str]:
        """States, set-up and CPU time in ms as they are printed."""
        if not self.errors:
            return "-", "-", "-"
        return f"{self.states}", f"{1e3 * self.setup:.0f}", f"{1e3 * self.cpu:.2f}"

    @property
    def error(self) -> float:
        """The larger error of the two end torques; infinite where it failed."""
        return max(self.errors["tau_a"], self.errors["tau_b"]) if self.errors else np.inf


UNKNOWN = Trial("", "", 0, 0.0, np.inf, {})
"""A trial of which nothing came."""


@dataclass(frozen=True)
class WorkPrecision:
    """The comparison of models and engines.

    Args:
        name: of the network.
        shaft: name of the shaft.
        trials: in the order in which they were asked for.
        truth: where the truth comes from, and its own error.
        t: (k,) output times, s.
        courses: (k, 2) the true torques at both ends.
    """

    name: str
    shaft: str
    trials: tuple[Trial, ...]
    truth: tuple[str, float]
    t: Array = field(default_factory=lambda: np.empty(0), repr=False, compare=False)
    courses: Array = field(default_factory=lambda: np.empty((0, 2)), repr=False, compare=False)

    def cheapest(self, tolerance: float) -> Trial | None:
        """The trial of the least CPU time whose end torques are right to a tolerance."""
        good = [trial for trial in self.trials if trial.error <= tolerance]
        return min(good, key=lambda trial: trial.cpu, default=None)

    @property
    def advice(self) -> str:
        """For each of some tolerances the cheapest model, a line each."""
        lines = []
        tried = "none of these" if all(trial.errors for trial in self.trials) else "none of those that were tried"
        for tolerance in (1e-1, 1e-2, 1e-3, 1e-4, 1e-6):
            best = self.cheapest(tolerance)
            what = tried if best is None else f"{best.model} on {best.engine}, {milliseconds(best.cpu)} ms"
            lines.append(f"end torques to {tolerance:g}: {what}")
        return "\n".join(lines)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the errors that were computed."""
        return tuple(dict.fromkeys(name for trial in self.trials for name in trial.errors))

    def __str__(self) -> str:
        shows_rtol = len({trial.rtol for trial in self.trials}) > 1
        header = ["model", "engine", *(["rtol"] if shows_rtol else []), "states", "set-up ms", "CPU ms"]
        header += [*self.columns, "extra modes"]
        rows = [
            [trial.model, trial.engine, *([f"{trial.rtol:g}"] if shows_rtol else []), *trial.costs]
            + [f"{trial.errors[name]:.1e}" if name in trial.errors else "-" for name in self.columns]
            + [f"{'-' if trial.extra_modes is None else trial.extra_modes}  {trial.why}"]
            for trial in self.trials
        ]
        title = f"{self.name}, shaft '{self.shaft}', errors against {self.truth[0]} ({self.truth[1]:.0e})"
        return "\n".join([title, *in_columns([header, *rows])])

    def to_csv(self, path: str | Path) -> None:
        """Write every trial with all its errors."""
        head = ("model", "engine", "rtol", "states", "setup_s", "cpu_s", *self.columns, "extra_modes", "why")
        rows = (
            [trial.model, trial.engine, trial.rtol, trial.states, trial.setup, trial.cpu]
            + [trial.errors.get(name, "") for name in self.columns]
            + ["" if trial.extra_modes is None else trial.extra_modes, trial.why]
            for trial in self.trials
        )
        write_rows(path, head, rows)

    @property
    def data(self) -> dict[str, Any]:
        """All of it in plain values, without the courses."""
        trials = [dataclasses.asdict(dataclasses.replace(trial, courses=None)) for trial in self.trials]
        for trial in trials:
            del trial["courses"]
        return {"name": self.name, "shaft": self.shaft, "trials": trials, "truth": self.truth}

    def plot(self) -> Figure:
        """Error of the end torques over CPU time, a curve for each kind of model (extra `plot`)."""
        return _work_precision_figure(self)

    def plot_courses(self, end: str = "b") -> Figure:
        """The torque at an end, "a" or "b", by each kind of model and as it truly is, and the differences below."""
        return _courses_figure(self, end)

    @property
    def left_out(self) -> Mapping[str, tuple[str, ...]]:
        """Models of which there is no error, by the reason."""
        by_reason: dict[str, list[str]] = {}
        for trial in self.trials:
            if trial.why:
                by_reason.setdefault(trial.why, []).append(trial.model)
        return {why: tuple(dict.fromkeys(models)) for why, models in by_reason.items()}

    @property
    def representatives(self) -> tuple[Trial, ...]:
        """Of each kind of model the one that is most accurate."""
        best: dict[str, Trial] = {}
        for trial in self.trials:
            if trial.courses is not None and trial.error < best.get(trial.family, UNKNOWN).error:
                best[trial.family] = trial
        return tuple(best.values())


def milliseconds(cpu: float) -> str:
    """A CPU time in s as it is read."""
    return f"{1e3 * cpu:.3g}" if cpu < 1 else f"{1e3 * cpu:.0f}"


def _work_precision_figure(study: WorkPrecision) -> Figure:
    """Two panels: error over CPU time, and error over the number of states; each curve is a kind of model."""
    figure = new_figure("WorkPrecision.plot()", 11.0, 5.4)
    axes = figure.subplots(1, 2, sharey=True)
    families: dict[str, list[Trial]] = {}
    for trial in study.trials:
        if np.isfinite(trial.error):
            families.setdefault(trial.family, []).append(trial)
    for family, members in families.items():
        style = _style(family, families)
        errors = [max(trial.error, SAME) for trial in members]
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


def _courses_figure(study: WorkPrecision, end: str) -> Figure:
    """Two panels: the torque at an end by the best model of each kind and as it truly is, and the differences."""
    figure = new_figure("WorkPrecision.plot_courses()", 11.0, 7.0)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    column, symbol = ("ab".index(end), rf"$\tau_{end}$")
    true = study.courses[:, column]
    least = SAME * (np.abs(true).max(initial=0.0) or 1.0)
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
    kinds = dict.fromkeys(family_of(text_of(model)) for model in LADDER)
    place = list(kinds | dict.fromkeys(sorted(others))).index(family)
    return {"color": f"C{place % 10}", "marker": MARKERS[place % len(MARKERS)]}


def _size(trial: Trial) -> str:
    return trial.model.partition("=")[2].split(",")[0].rstrip(")")
