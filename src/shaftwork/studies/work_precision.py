"""Error against run time for the models of a shaft and the engines that solve them."""

from __future__ import annotations

import csv
import dataclasses
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

import numpy as np

from shaftwork.components.shaft_models import CentralDifference, Lumped, OneSpring, ShaftModel, Spectral, Wave
from shaftwork.components.shafts import Shaft
from shaftwork.core.errors import ParameterError, ShaftworkError
from shaftwork.core.parameters import in_si
from shaftwork.pipeline.model import Model
from shaftwork.pipeline.network import Network
from shaftwork.results.observer import Array
from shaftwork.results.solution import Solution
from shaftwork.studies.truth import QUANTITIES, Truth, quantities, truth, with_model

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LADDER: tuple[ShaftModel, ...] = (
    OneSpring(),
    *(Lumped(m) for m in (5, 10, 20, 40, 80, 160)),
    *(CentralDifference(m) for m in (10, 20, 40, 80)),
    *(CentralDifference(m, order=4) for m in (10, 20, 40)),
    *(Spectral(n) for n in (2, 4, 8, 16, 32, 48)),
    Wave(3),
)
"""The models and sizes that are compared where none are named."""
POINTS, CALLS = 401, 5
"""Output times, and warm calls of which the median counts."""
SLOW = 3.0
"""Where a run has taken longer, in s, larger models of its kind are left out."""
MOST_STATES = 500
"""Up to this many states natural frequencies are computed."""
TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-6)
"""Errors for which the cheapest model is named."""
MODES = 3
"""Elastic natural frequencies that are compared."""


@dataclass(frozen=True)
class Trial:
    """One model with one engine.

    Args:
        model: as text, such as "Lumped(m=20)".
        engine: name of the engine that ran.
        states: number of states.
        setup: CPU time from the network to the first result, less a warm call, s.
        cpu: CPU time of a warm call with reading both end torques, s; the median of several.
        errors: largest error of each quantity over its largest value, by name; of frequencies, relative to each.
        extra_modes: oscillating modes, up to halfway between the highest frequency that is judged and the next, less
            those of the exact shaft: spurious ones, or missing ones where negative; None where unknown.
        why: why it failed or was not tried; empty where it was.
        asked: name of the engine that was asked for.
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

    @property
    def family(self) -> str:
        """The model without its size."""
        name, _, arguments = self.model.rstrip(")").partition("(")
        _, comma, choices = arguments.partition(",")
        return f"{name}{comma}{choices}"

    @property
    def error(self) -> float:
        """The larger error of the two end torques; infinite where it failed."""
        return max(self.errors["tau_a"], self.errors["tau_b"]) if self.errors else np.inf


@dataclass(frozen=True)
class WorkPrecision:
    """The comparison of models and engines.

    Args:
        name: of the network.
        shaft: name of the shaft.
        trials: in the order in which they were asked for.
        truth: where the truth comes from, and its own error.
    """

    name: str
    shaft: str
    trials: tuple[Trial, ...]
    truth: tuple[str, float]

    def cheapest(self, tolerance: float) -> Trial | None:
        """The trial of the least CPU time whose end torques are right to a tolerance."""
        good = [trial for trial in self.trials if trial.error <= tolerance]
        return min(good, key=lambda trial: trial.cpu, default=None)

    @property
    def advice(self) -> str:
        """For each of some tolerances the cheapest model, a line each."""
        lines = []
        for tolerance in TOLERANCES:
            best = self.cheapest(tolerance)
            what = "none of these" if best is None else f"{best.model} on {best.engine}, {1e3 * best.cpu:.2g} ms"
            lines.append(f"end torques to {tolerance:g}: {what}")
        return "\n".join(lines)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the errors that were computed."""
        return tuple(dict.fromkeys(name for trial in self.trials for name in trial.errors))

    def __str__(self) -> str:
        header = ["model", "engine", "states", "set-up ms", "CPU ms", *self.columns, "extra modes"]
        rows = [
            [trial.model, trial.engine, str(trial.states), f"{1e3 * trial.setup:.0f}", f"{1e3 * trial.cpu:.2f}"]
            + [f"{trial.errors[name]:.1e}" if name in trial.errors else "-" for name in self.columns]
            + ["-" if trial.extra_modes is None else f"{trial.extra_modes}"]
            + ([trial.why] if trial.why else [])
            for trial in self.trials
        ]
        widths = [max(len(row[k]) for row in [header, *rows] if k < len(row)) for k in range(len(header))]
        text = "\n".join(
            "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=False)).rstrip()
            + (f"  {row[-1]}" if len(row) > len(header) else "")
            for row in [header, *rows]
        )
        return f"{self.name}, shaft '{self.shaft}', errors against {self.truth[0]} ({self.truth[1]:.0e})\n{text}"

    def to_csv(self, path: str | Path) -> None:
        """Write every trial with all its errors."""
        with Path(path).open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(["model", "engine", "states", "setup_s", "cpu_s", *self.columns, "extra_modes", "why"])
            for trial in self.trials:
                errors = [trial.errors.get(name, "") for name in self.columns]
                last = ("" if trial.extra_modes is None else trial.extra_modes, trial.why)
                writer.writerow([trial.model, trial.engine, trial.states, trial.setup, trial.cpu, *errors, *last])

    def plot(self) -> Figure:
        """Error of the end torques over CPU time, a curve for each kind of model (extra `plot`)."""
        from shaftwork.studies.picture import work_precision_figure

        return work_precision_figure(self)


def work_precision(
    net: Network,
    shaft: str,
    *,
    t_end: float,
    models: Sequence[ShaftModel | str] = LADDER,
    engines: Iterable[str] = ("auto",),
    points: int = POINTS,
) -> WorkPrecision:
    """Solve a network with each model of its shafts, by each engine, and measure error and CPU time.

    Args:
        net: the network.
        shaft: name of the shaft at which errors are measured; all shafts get the same model.
        t_end: end of the motion, s.
        models: models, or their texts.
        engines: engines by name.
        points: number of output times.

    Raises:
        ParameterError: there is no such shaft.
    """
    shafts = [part.name for part in net.parts if isinstance(part, Shaft)]
    if shaft not in shafts:
        raise ParameterError(f"'{net.name}' has no shaft {shaft!r}. It has: {', '.join(shafts) or 'none'}.")
    end = in_si("t_end", t_end, "s", above=0)
    # the fronts of waves that start at zero pass at multiples of the delay; these times are none
    t = end * (np.arange(1, points + 1) - 0.5) / points
    known = truth(net, shaft, end, t)
    trials: list[Trial] = []
    for model in (ShaftModel.read(model) if isinstance(model, str) else model for model in models):
        for engine in engines:
            slow = _slower(trials, _text(model), engine)
            trials.append(slow or _trial(net, shaft, model, engine, end, t, known))
    return WorkPrecision(net.name, shaft, tuple(trials), (known.source, known.error))


def _slower(trials: Sequence[Trial], model: str, engine: str) -> Trial | None:
    """The row of a model that is not tried, because a smaller one of its kind has taken too long already."""
    asked = Trial(model, engine, 0, 0.0, np.inf, {})
    for trial in trials:
        if trial.family == asked.family and trial.asked == engine and trial.cpu > SLOW:
            return dataclasses.replace(asked, why=f"not tried, since {trial.model} took {trial.cpu:.0f} s")
    return None


def _trial(net: Network, shaft: str, model: ShaftModel, engine: str, t_end: float, t: Array, known: Truth) -> Trial:
    def call(compiled: Model) -> Solution:
        solution = compiled.simulate(t_end, t_eval=t, engine=engine)  # type: ignore[arg-type]
        solution[f"{shaft}.tau_a"], solution[f"{shaft}.tau_b"]
        return solution

    began = time.process_time()
    try:
        varied = with_model(net, "", model)
        compiled = varied.compile()
        solution = call(compiled)
        first = time.process_time() - began
        times = []
        for _ in range(CALLS):
            began = time.process_time()
            call(compiled)
            times.append(time.process_time() - began)
            if sum(times) > 1.0:
                break
    except ShaftworkError as error:
        return Trial(_text(model), engine, 0, 0.0, np.inf, {}, why=str(error).splitlines()[0])
    found = quantities(solution, shaft)
    errors = {name: float(np.abs(found[name] - known.values[name]).max()) / _size(known, name) for name in QUANTITIES}
    exact, present = known.frequencies, _frequencies(varied, compiled, known.frequencies)
    extra = None
    if present is not None and len(exact) > MODES:
        errors |= {f"f_{k + 2}": float(np.abs(present / f - 1).min()) for k, f in enumerate(exact[:MODES])}
        extra = int((present < exact[MODES - 1 : MODES + 1].mean()).sum()) - MODES
    cpu = median(times)
    return Trial(_text(model), solution.engine, len(compiled.states), first - cpu, cpu, errors, extra, asked=engine)


def _size(known: Truth, name: str) -> float:
    """The largest value, of all torques or all speeds together, so that no quantity is judged by its own zero."""
    kind = name.partition("_")[0]
    family = [value for other, value in known.values.items() if other.startswith(kind)]
    return float(max(np.abs(value).max() for value in family)) or 1.0


def _frequencies(net: Network, compiled: Model, judged: Array) -> Array | None:
    """Natural frequencies in Hz of a network that has some and is small enough, the rigid motion left out."""
    if len(compiled.states) > MOST_STATES or not compiled.linear:
        return None
    if compiled.form.waves:
        modes = net.modes(f_max=float(judged[-1])) if judged.size else None
        return None if modes is None else modes.frequencies[modes.frequencies > 0]
    rates = np.linalg.eigvals(compiled.jacobian(0.0, np.zeros(len(compiled.states))).toarray())
    found = rates.imag[rates.imag > 1e-6 * np.abs(rates).max()] / (2 * np.pi)
    return found if found.size else None


def _text(model: ShaftModel) -> str:
    """The model with its size and what differs from the default, so that a row is short."""
    fields = dataclasses.fields(model)
    shown = [f for k, f in enumerate(fields) if k == 0 or getattr(model, f.name) != f.default]
    return f"{type(model).__name__}({', '.join(f'{f.name}={getattr(model, f.name)!r}' for f in shown)})"
