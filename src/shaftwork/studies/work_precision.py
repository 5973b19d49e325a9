"""Error against run time for the models of a shaft and the engines that solve them."""

from __future__ import annotations

import csv
import dataclasses
import itertools
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from operator import itemgetter
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np

from shaftwork.components.shaft_models import ShaftModel
from shaftwork.components.shafts import Shaft
from shaftwork.core.errors import ParameterError, ShaftworkError, SimulationError, in_one_line
from shaftwork.core.files import replaced
from shaftwork.core.parameters import in_si, whole
from shaftwork.pipeline.model import Model
from shaftwork.pipeline.network import Network
from shaftwork.results.observer import Array
from shaftwork.results.solution import Solution
from shaftwork.studies.arguments import engine_names, several, shaft_models
from shaftwork.studies.ladder import LADDER, family_of, text_of
from shaftwork.studies.truth import QUANTITIES, Truth, frequencies, quantities, truth, with_model

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RTOL = 1e-8
"""Relative tolerance of the runs where none is given."""
POINTS, CALLS = 401, 5
"""Output times, and warm calls of which the median counts."""
SLOW = 3.0
"""Where set-up and run have taken longer, in s of CPU, larger models of its kind are left out."""
LONGEST = 5.0
"""A run is given up after so long, s of CPU."""
BUDGET = 45.0
"""CPU time in s for all trials, from when the truth is known."""
LOWEST = 20
"""Modes of a model that are computed, those of smallest rate; as many as the exact ones up to f_5 and their doubles."""
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
        setup: CPU time from the network to the first result, less a warm call, s; of a trial that failed, all of it.
        cpu: CPU time of a warm call with reading both end torques, s; the median of several.
        errors: largest error of each quantity over its largest value, by name; of frequencies, relative to each.
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
        for tolerance in TOLERANCES:
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
        with replaced(path) as file:
            writer = csv.writer(file)
            first = ["model", "engine", "rtol", "states", "setup_s", "cpu_s"]
            writer.writerow([*first, *self.columns, "extra_modes", "why"])
            for trial in self.trials:
                errors = [trial.errors.get(name, "") for name in self.columns]
                last = ("" if trial.extra_modes is None else trial.extra_modes, trial.why)
                costs = (trial.rtol, trial.states, trial.setup, trial.cpu)
                writer.writerow([trial.model, trial.engine, *costs, *errors, *last])

    @property
    def data(self) -> dict[str, Any]:
        """All of it in plain values, without the courses."""
        trials = [dataclasses.asdict(dataclasses.replace(trial, courses=None)) for trial in self.trials]
        for trial in trials:
            del trial["courses"]
        return {"name": self.name, "shaft": self.shaft, "trials": trials, "truth": self.truth}

    def plot(self) -> Figure:
        """Error of the end torques over CPU time, a curve for each kind of model (extra `plot`)."""
        from shaftwork.studies.picture import work_precision_figure

        return work_precision_figure(self)

    def plot_courses(self, end: str = "b") -> Figure:
        """The torque at an end, "a" or "b", by each kind of model and as it truly is, and the differences below."""
        from shaftwork.studies.picture import courses_figure

        return courses_figure(self, end)

    @property
    def left_out(self) -> Mapping[str, tuple[str, ...]]:
        """Models of which there is no error, by the reason."""
        found: dict[str, list[str]] = {}
        for trial in self.trials:
            if trial.why:
                found.setdefault(trial.why, []).append(trial.model)
        return {why: tuple(dict.fromkeys(models)) for why, models in found.items()}

    @property
    def representatives(self) -> tuple[Trial, ...]:
        """Of each kind of model the one that is most accurate."""
        best: dict[str, Trial] = {}
        for trial in self.trials:
            if trial.courses is not None and trial.error < best.get(trial.family, UNKNOWN).error:
                best[trial.family] = trial
        return tuple(best.values())


def work_precision(
    net: Network,
    shaft: str,
    *,
    t_end: float,
    models: Sequence[ShaftModel | str] = LADDER,
    engines: Iterable[str] = ("auto",),
    rtols: Iterable[float] = (RTOL,),
    points: int = POINTS,
    budget: float = BUDGET,
    report: Callable[[Trial], None] | None = None,
    tell: Callable[[str], None] | None = None,
) -> WorkPrecision:
    """Solve a network with each model of its shafts, by each engine, and measure error and CPU time.

    CPU time is that of the calling thread: other threads of the linear algebra, which mostly wait for work at these
    sizes, are not counted. Times are the surest where there is one thread: set OPENBLAS_NUM_THREADS=1 (MKL_, OMP_)
    before numpy is imported, as `shaftwork compare` does.

    Args:
        net: the network.
        shaft: name of the shaft at which errors are measured. All shafts get the same model; but others that are rigid
            or one spring stay so, in the truth as well.
        t_end: end of the motion, s.
        models: models, or their texts.
        engines: engines by name.
        rtols: relative tolerances of the runs.
        points: number of output times.
        budget: CPU time in s for all trials together, from when the truth is known. The smallest model of each kind is
            tried in any case, with every engine and tolerance; then the next sizes of all. A run is given up after
            `LONGEST` s of CPU, and larger models of a kind that took `SLOW` s are left out.
        report: is told of each trial when it is done.
        tell: is told what is done meanwhile, in a line.

    Raises:
        ParameterError: there is no such shaft, model or engine, or a number is out of its range.
        ShaftworkError: the network cannot be solved with shafts as they are, so there is no truth.
    """
    shafts = [part.name for part in net.parts if isinstance(part, Shaft)]
    if shaft not in shafts:
        raise ParameterError(f"'{net.name}' has no shaft {shaft!r}. It has: {', '.join(shafts) or 'none'}.")
    end, allowed = in_si("t_end", t_end, "s", above=0), in_si("budget", budget, "s", above=0)
    if (count := whole(points)) is None:
        raise ParameterError(f"points = {points!r} must be a number of output times, 1 or more.")
    tolerances = [in_si("rtol", rtol, "1", above=0) for rtol in several("rtols", rtols)]
    asked = [
        (model, Trial(text_of(model), engine, 0, 0.0, np.inf, {}, asked=engine, rtol=rtol))
        for model, engine, rtol in itertools.product(shaft_models(models), engine_names(engines), tolerances)
    ]
    # the fronts of waves that start at zero pass at multiples of the delay; these times are none
    t = end * (np.arange(1, count + 1) - 0.5) / count
    known = truth(net, shaft, end, t, tell or _nothing)
    began, made = time.thread_time(), dict[int, Trial]()
    for number, rank in _in_turn([trial for _, trial in asked]):
        model, trial = asked[number]
        why = _not_tried(trial, made.values())
        if rank and time.thread_time() - began > allowed:
            why = f"not tried, since the budget of {allowed:g} s of CPU is spent"
        made[number] = dataclasses.replace(trial, why=why) if why else _trial(net, shaft, model, trial, end, t, known)
        if report is not None:
            report(made[number])
    trials = tuple(made[number] for number in range(len(asked)))
    return WorkPrecision(net.name, shaft, trials, (known.source, known.error), t, _ends(known.values))


def milliseconds(cpu: float) -> str:
    """A CPU time in s as it is read."""
    return f"{1e3 * cpu:.3g}" if cpu < 1 else f"{1e3 * cpu:.0f}"


def _nothing(_: str) -> None:
    pass


def _in_turn(asked: Sequence[Trial]) -> list[tuple[int, int]]:
    """Numbers of trials in the order in which they are made: first the first of each kind, then the second ones.

    Behind each number how many of its kind come before it.
    """
    ranks, seen = list[tuple[int, int]](), Counter[tuple[str, str, float]]()
    for number, trial in enumerate(asked):
        ranks.append((number, seen[trial.line]))
        seen[trial.line] += 1
    return sorted(ranks, key=itemgetter(1))


def _not_tried(asked: Trial, trials: Iterable[Trial]) -> str:
    """Why a model is left out: a smaller one of its kind has taken too long already. Empty where it is not."""
    for trial in trials:
        if trial.line == asked.line and trial.spent > SLOW:
            return f"not tried, since {trial.model} took {trial.spent:.0f} s"
    return ""


def _ends(values: Mapping[str, Array]) -> Array:
    """(k, 2) the torques at both ends."""
    return np.column_stack([values["tau_a"], values["tau_b"]])


def _trial(net: Network, shaft: str, model: ShaftModel, asked: Trial, t_end: float, t: Array, known: Truth) -> Trial:
    began = time.thread_time()
    try:
        varied = with_model(net, shaft, model)
        compiled = varied.compile()
        built = time.thread_time() - began
        if compiled.form.waves:
            _bearable(compiled, shaft, asked, t_end)
        solution, first = _timed(compiled, shaft, asked, t_end, t)
        times = [first] if built + first > SLOW else []
        while not times or (len(times) < CALLS and sum(times) < 1.0):
            times.append(_timed(compiled, shaft, asked, t_end, t)[1])
    except ShaftworkError as error:
        return dataclasses.replace(asked, setup=time.thread_time() - began, why=in_one_line(error))
    found, cpu = quantities(solution, varied, shaft), median(times)
    errors = {name: float(np.abs(found[name] - known.values[name]).max()) / _size(known, name) for name in QUANTITIES}
    extra = None
    if known.frequencies.size and (present := _frequencies(varied, compiled, known.frequencies)).size:
        judged, limit = known.frequencies[:MODES], float(known.frequencies[MODES - 1 : MODES + 1].mean())
        errors |= {f"f_{k + 2}": float(np.abs(present / f - 1).min()) for k, f in enumerate(judged)}
        extra = int((present < limit).sum()) - MODES
    setup = built + max(first - cpu, 0.0)
    size = len(compiled.states)
    return Trial(
        asked.model, solution.engine, size, setup, cpu, errors, extra, "", asked.asked, asked.rtol, _ends(found)
    )


def _bearable(compiled: Model, shaft: str, asked: Trial, t_end: float) -> None:
    """Refuse a run of waves, which nothing interrupts, where the first part of it says that it takes too long."""
    for part in (t_end / 16, t_end / 8, t_end / 4, t_end / 2):
        _, cpu = _timed(compiled, shaft, asked, part, np.array([part]))
        if cpu > LONGEST / 2:
            raise SimulationError(f"given up: {part:.3g} s of {t_end:g} s took {cpu:.0f} s")


def _timed(compiled: Model, shaft: str, asked: Trial, t_end: float, t: Array) -> tuple[Solution, float]:
    """A run in which both end torques are read, and its CPU time in s."""
    began, engine = time.thread_time(), asked.asked

    def watch(reached: float) -> None:
        if time.thread_time() - began > LONGEST:
            raise SimulationError(f"given up after {LONGEST:g} s at t = {reached:.3g} s of {t_end:g} s")

    solution = compiled.simulate(
        t_end,
        t_eval=t,
        engine=engine,  # type: ignore[arg-type]
        rtol=asked.rtol,
        progress=watch,
    )
    solution[f"{shaft}.tau_a"], solution[f"{shaft}.tau_b"]
    return solution, time.thread_time() - began


def _size(known: Truth, name: str) -> float:
    """The largest value, of all torques or all speeds together, so that no quantity is judged by its own zero."""
    kind = name.partition("_")[0]
    family = [value for other, value in known.values.items() if other.startswith(kind)]
    return float(max(np.abs(value).max() for value in family)) or 1.0


def _frequencies(net: Network, compiled: Model, judged: Array) -> Array:
    """The lowest natural frequencies in Hz of a network at rest; empty where they are not found."""
    try:
        if compiled.form.waves:
            return frequencies(net.modes(f_max=float(judged[-1])))
        return frequencies(compiled.linearize(None).modes(count=LOWEST))
    except ShaftworkError:
        return np.empty(0)
