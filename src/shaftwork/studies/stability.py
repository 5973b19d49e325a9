"""What every shaft model and every engine does where drives are extreme, and whether it says so."""

from __future__ import annotations

import re
import time
import warnings
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from shaftwork.components.shaft_models import ShaftModel, Wave
from shaftwork.core.errors import ParameterError, ShaftworkError, SimulationError, in_one_line
from shaftwork.core.files import write_rows
from shaftwork.core.screen import in_columns
from shaftwork.integrate.engines import ENGINE_NAMES, available
from shaftwork.numerics.tolerances import SAME
from shaftwork.pipeline.arguments import NOMINAL, engine_names, several
from shaftwork.pipeline.model import Model
from shaftwork.results.observer import Array
from shaftwork.results.plotting import new_figure
from shaftwork.studies.stability_cases import CASES, TORQUE, Case
from shaftwork.studies.study_arguments import shaft_models, text_of
from shaftwork.studies.truth import ENDS, MOST_PREDICTED, ShaftMotion, exact, predicted

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RIGHT, FAITHFUL = 1e-2, 1e-3
"""Parts of the largest torque or speed: largest error of what is right; largest deviation of a run from what its model
must do, and largest residual of its energy balance."""
MOST_BALANCED = 2 * MOST_PREDICTED
"""Up to so many states, a speed and a torque for each element, the energy balance is drawn for the engine "auto", where
all of the motion is output."""

Verdict = Literal["right", "coarse", "warned", "refused", "failed", "too long", "unknown", "wrong"]
VERDICTS: tuple[Verdict, ...] = get_args(Verdict)


@dataclass(frozen=True)
class Cell:
    """What one model does with one engine in one case.

    Args:
        case: name of the case.
        model: as text, such as "Lumped(m=10)".
        engine: the engine that was asked for.
        ran: the engine that ran; empty where none did.
        verdict: "right": the error is at most `RIGHT`; "coarse": it is larger, and it is the error that the model has
            by its definition; "warned": it is neither, and a warning was given; "refused": no run was begun, for the
            reason given; "failed": a run was ended, for the reason given; "too long": the steps that were allowed were
            not enough; "unknown": it is not right, and what its model must do is not known (a spring without an inertia
            at its end, more than 200 elements); "wrong": none of these, without a word.
        error: largest of the errors of end torques and speeds, of the largest torque or speed; NaN without a run.
        expected: that error of the model's own motion; NaN where that is not known.
        deviation: of the run from the model's own motion; NaN where that is not known.
        energy: what the energy balance of the run leaves over, of the work done; NaN where it is not drawn.
        cpu: CPU time of the run, s.
        why: the reason of a refusal or failure, or the warning.
    """

    case: str
    model: str
    engine: str
    ran: str
    verdict: Verdict
    error: float = np.nan
    expected: float = np.nan
    deviation: float = np.nan
    energy: float = np.nan
    cpu: float = 0.0
    why: str = ""

    def __str__(self) -> str:
        return f"{self.verdict} {self.error:.0e}" if np.isfinite(self.error) else self.verdict


@dataclass(frozen=True)
class Stability:
    """The table.

    Args:
        cells: case by case, model by model, engine by engine.
    """

    cells: tuple[Cell, ...]

    @property
    def wrong(self) -> tuple[Cell, ...]:
        """What is wrong without a word."""
        return tuple(cell for cell in self.cells if cell.verdict == "wrong")

    @property
    def engines(self) -> tuple[str, ...]:
        """The engines that were asked for."""
        return tuple(dict.fromkeys(cell.engine for cell in self.cells))

    @property
    def rows(self) -> dict[tuple[str, str], dict[str, Cell]]:
        """By case and model, then by engine."""
        rows: dict[tuple[str, str], dict[str, Cell]] = {}
        for cell in self.cells:
            rows.setdefault((cell.case, cell.model), {})[cell.engine] = cell
        return rows

    @property
    def reasons(self) -> tuple[str, ...]:
        """Every reason why a run was refused, failed or took too long, once."""
        return tuple(dict.fromkeys(f"{cell.verdict}: {cell.why}" for cell in self.cells if cell.why))

    @property
    def counts(self) -> dict[str, int]:
        """Number of cells by verdict."""
        return {verdict: sum(cell.verdict == verdict for cell in self.cells) for verdict in VERDICTS}

    def __str__(self) -> str:
        table = [["case", "model", *self.engines]]
        for (case, model), row in self.rows.items():
            table.append([case, model, *(str(row[name]) if name in row else "" for name in self.engines)])
        counts = ", ".join(f"{count} {verdict}" for verdict, count in self.counts.items() if count)
        total = f"{len(self.cells)} cells: {counts}; wrong without a warning: {len(self.wrong)}"
        return "\n".join([*in_columns(table), "", total])

    def to_csv(self, path: str | Path) -> None:
        """Write every cell with all that is known about it."""
        names = tuple(Cell.__dataclass_fields__)
        write_rows(path, names, ([getattr(cell, name) for name in names] for cell in self.cells))

    def plot(self) -> Figure:
        """The table as a coloured matrix (extra `plot`)."""
        return _figure(self)


def stability(
    cases: Sequence[Case | str] = CASES,
    models: Sequence[ShaftModel | str] = (),
    engines: Iterable[str] = (),
) -> Stability:
    """Run extreme drives with every shaft model and every engine, and judge each run by what is independent of it.

    The truth is that of travelling waves, or with damping of polynomials of high degree; the error that a model may
    have is that of its own matrices, exponentiated. A run that is neither right nor as coarse as its model must be,
    and that says nothing, is wrong.

    Args:
        cases: cases, or names of those in `CASES`.
        models: models or their texts; by default those of each case.
        engines: engines by name; by default "auto" and all that are installed.

    Raises:
        ParameterError: there is no such case, model or engine.
    """
    names = engine_names(engines) or tuple(name for name in ENGINE_NAMES if name == "auto" or available(name))
    read = shaft_models(models)
    cells: list[Cell] = []
    for case in [_named(case) if isinstance(case, str) else case for case in several("cases", cases)]:
        truth = exact(case)
        for model in read or case.models:
            cells += _row(case, model, [name for name in names if name in (case.engines or names)], truth)
    return Stability(tuple(cells))


def _named(name: str) -> Case:
    for case in CASES:
        if case.name == name:
            return case
    raise ParameterError(f"There is no case {name!r}. There are: {', '.join(case.name for case in CASES)}.")


def _row(case: Case, model: ShaftModel, engines: Sequence[str], truth: ShaftMotion) -> list[Cell]:
    """One model with each engine."""
    ideal = truth if isinstance(model, Wave) else predicted(case, model)
    label = (case.name, text_of(model))
    try:
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            compiled = case.network(model).compile()
    except ShaftworkError as error:
        return [Cell(*label, engine, "", "refused", why=in_one_line(error)) for engine in engines]
    warned = "; ".join(str(warning.message) for warning in said)
    return [_cell(case, label, compiled, engine, truth, ideal, warned) for engine in engines]


def _cell(
    case: Case,
    label: tuple[str, str],
    compiled: Model,
    engine: str,
    truth: ShaftMotion,
    ideal: ShaftMotion | None,
    warned: str,
) -> Cell:
    began = time.process_time()
    try:
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            run = compiled.simulate(case.t_end, t_eval=case.times, engine=engine, max_steps=case.steps)  # type: ignore[arg-type]
            quantities = {name: run[f"line.{name}"] for name in ENDS}
            cpu = time.process_time() - began
            balanced = engine == "auto" and not case.periods and len(compiled.states) <= MOST_BALANCED
            energy = run.energy_residual if balanced else np.nan
    except SimulationError as error:
        why = in_one_line(error)
        verdict: Verdict = "too long" if re.search(r"steps (were|are) not enough", why) else "failed"
        return Cell(*label, engine, "", verdict, cpu=time.process_time() - began, why=why)
    except ShaftworkError as error:
        return Cell(*label, engine, "", "refused", why=in_one_line(error))
    why = "; ".join(filter(None, [warned, *(str(warning.message) for warning in said)]))
    measured, expected, deviation = distances(quantities, truth, ideal)
    verdict = judge(measured, deviation, energy, truth.error, warned=bool(why))
    return Cell(*label, engine, run.engine, verdict, measured, expected, deviation, energy, cpu, why)


def distances(run: Mapping[str, Array], truth: ShaftMotion, ideal: ShaftMotion | None) -> tuple[float, float, float]:
    """Of a run from the truth, of its model's own motion from the truth, and of the run from that motion.

    All are the largest over time and quantities, of the largest torque or speed of the truth and of the model's own
    motion, and no less than the motor's torque and the speed that the absolute tolerance of a run is made for.
    """
    sizes = {"tau": TORQUE, "omega": NOMINAL}
    for motion in (truth, ideal or truth):
        for name, values in motion.values.items():
            kind = name.partition("_")[0]
            sizes[kind] = max(sizes[kind], float(np.abs(values).max()))

    def distance(one: Mapping[str, Array], other: Mapping[str, Array]) -> float:
        gaps = [np.abs(one[name] - other[name]).max() / sizes[name.partition("_")[0]] for name in ENDS]
        return float(np.max(gaps))

    if ideal is None:
        return distance(run, truth.values), np.nan, np.nan
    return distance(run, truth.values), distance(ideal.values, truth.values), distance(run, ideal.values)


def judge(error: float, deviation: float, energy: float, uncertainty: float, *, warned: bool) -> Verdict:
    """The verdict on a run that ended.

    Args:
        error: distance from the truth.
        deviation: distance from the model's own motion, NaN where that is not known.
        energy: what the energy balance leaves over, NaN where it is not drawn.
        uncertainty: error of the truth itself.
        warned: whether a warning was given.
    """
    sound = np.isfinite(error) and not energy > FAITHFUL and not deviation > FAITHFUL + uncertainty
    if sound and error <= RIGHT + uncertainty:
        return "right"
    if sound and deviation <= FAITHFUL + uncertainty:
        return "coarse"
    if warned:
        return "warned"
    return "unknown" if sound and np.isnan(deviation) else "wrong"


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
SIZE = re.compile(r"\b(?:m|n|places)=\d+(?:, )?")


def _figure(study: Stability) -> Figure:
    """Cases downwards; models, and in each of them engines, from left to right; the exponent of the error in each cell.

    Models that differ by their size alone share columns, unless a case has several of them.
    """
    engines, cases = study.engines, tuple(dict.fromkeys(cell.case for cell in study.cells))
    kind_of = _kinds(study)
    kinds = tuple(dict.fromkeys(kind_of.values()))
    numbers = np.zeros((len(cases), len(kinds) * len(engines)))
    names = list(COLOURS)
    longest = max(len(line) for kind in kinds for line in kind.splitlines())
    # inches: the least width of a column, and that of a letter above the columns
    width = max(0.24 * len(engines), 0.075 * (longest + 2)) * len(kinds)
    figure = new_figure("Stability.plot()", max(2.5 + width, 8.0), 2.4 + 0.22 * len(cases))
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    axes = figure.subplots()
    for cell in study.cells:
        row = cases.index(cell.case)
        column = kinds.index(kind_of[cell.model]) * len(engines) + engines.index(cell.engine)
        numbers[row, column] = 1 + names.index(cell.verdict)
        if np.isfinite(cell.error):
            exponent = int(np.ceil(np.log10(max(cell.error, SAME))))
            colour = "white" if cell.verdict in ("right", "wrong") else "black"
            axes.text(column, row, str(exponent), ha="center", va="center", fontsize=6, color=colour)
    axes.imshow(numbers, cmap=ListedColormap(["#ffffff", *COLOURS.values()]), vmin=0, vmax=len(names), aspect="auto")
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
