"""Error against run time for the models of a shaft and the engines that solve them."""

from __future__ import annotations

import dataclasses
import itertools
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from shaftwork.components.shaft_models import ShaftModel
from shaftwork.components.shafts import Shaft
from shaftwork.core.errors import ParameterError, ShaftworkError, SimulationError, in_one_line
from shaftwork.core.parameters import in_si, whole
from shaftwork.pipeline.arguments import engine_names, several
from shaftwork.pipeline.model import Model
from shaftwork.pipeline.network import Network
from shaftwork.results.observer import Array
from shaftwork.results.solution import Solution
from shaftwork.studies.study_arguments import LADDER, shaft_models, text_of
from shaftwork.studies.truth import (
    COARSE,
    MODES,
    QUANTITIES,
    ShaftMotion,
    exact_frequencies,
    exact_motion,
    frequencies,
    quantities,
    with_model,
)
from shaftwork.studies.work_precision_result import RTOL, Trial, WorkPrecision

LONGEST = 5.0
"""A run is given up after so long, s of CPU. Of a kind that took half of it, larger models are left out."""
LOWEST = 4 * (MODES + 2)
"""Modes of a model that are computed, those of smallest rate: twice as many pairs as there are exact ones up to the
second beyond those that are judged, since a model may have spurious ones between them."""


def work_precision(
    net: Network,
    shaft: str,
    *,
    t_end: float,
    models: Sequence[ShaftModel | str] = LADDER,
    engines: Iterable[str] = ("auto",),
    rtols: Iterable[float] = (RTOL,),
    points: int = 401,
    budget: float = 45.0,
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
            `LONGEST` s of CPU, and larger models of a kind that took half of it are left out.
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
    planned = [
        (model, Trial(text_of(model), engine, 0, 0.0, np.inf, {}, asked=engine, rtol=rtol))
        for model, engine, rtol in itertools.product(shaft_models(models), engine_names(engines), tolerances)
    ]
    # the fronts of waves that start at zero pass at multiples of the delay; these times are none
    t = end * (np.arange(1, count + 1) - 0.5) / count
    tell = tell or _nothing
    tell("the exact natural frequencies")
    judged = exact_frequencies(net, shaft)
    exact = exact_motion(net, shaft, end, t, tell)
    trials = _tried(_Motion(net, shaft, end, t, exact, judged), planned, allowed, report or _nothing)
    return WorkPrecision(net.name, shaft, trials, (exact.source, exact.error), t, _ends(exact.values))


def affordable_end(net: Network, shaft: str, t_end: float) -> float:
    """The end of a motion over which models of a shaft can be compared, s.

    It is the one that is given where a coarse model comes to it before its run would be given up. Else it is a part of
    the time that this model comes to, since finer ones take longer, and the truth is finer still.
    """
    model = with_model(net, shaft, COARSE).compile()
    began, reached = time.thread_time(), 0.0

    def watch(t: float) -> None:
        nonlocal reached
        if time.thread_time() - began > LONGEST:
            raise SimulationError(f"given up after {LONGEST:g} s")
        reached = t

    try:
        model.simulate(t_end, progress=watch)
    except SimulationError:
        # the finest models of a nonlinear network take about ten times as long as a coarse one
        return float(f"{reached / 10.0:.1g}") or t_end
    return t_end


def _nothing(_: object) -> None:
    pass


@dataclass(frozen=True, eq=False)
class _Motion:
    """The motion that all models are compared on, the true one of its shaft, and true natural frequencies in Hz."""

    net: Network
    shaft: str
    t_end: float
    t: Array
    exact: ShaftMotion
    frequencies: Array


def _tried(
    motion: _Motion,
    planned: Sequence[tuple[ShaftModel, Trial]],
    budget: float,
    report: Callable[[Trial], None],
) -> tuple[Trial, ...]:
    """All trials: first the first model of each kind, then the second ones, as long as the budget lasts."""
    began, done, seen = time.thread_time(), dict[int, Trial](), Counter[tuple[str, str, float]]()
    turns: list[tuple[int, int]] = []  # how many of its kind come before a trial, and its number
    for number, (_, plan) in enumerate(planned):
        turns.append((seen[plan.line], number))
        seen[plan.line] += 1
    for rank, number in sorted(turns):
        model, plan = planned[number]
        why = _too_slow(plan, done.values())
        if rank and time.thread_time() - began > budget:
            why = f"not tried, since the budget of {budget:g} s of CPU is spent"
        done[number] = dataclasses.replace(plan, why=why) if why else _trial(motion, model, plan)
        report(done[number])
    return tuple(done[number] for number in range(len(planned)))


def _too_slow(plan: Trial, trials: Iterable[Trial]) -> str:
    """Why a model is left out: a smaller one of its kind has taken too long already. Empty where it is not."""
    for trial in trials:
        if trial.line == plan.line and trial.spent > LONGEST / 2:
            return f"not tried, since {trial.model} took {trial.spent:.0f} s"
    return ""


def _ends(values: Mapping[str, Array]) -> Array:
    """(k, 2) the torques at both ends."""
    return np.column_stack([values["tau_a"], values["tau_b"]])


def _trial(motion: _Motion, model: ShaftModel, plan: Trial) -> Trial:
    began, shaft, exact = time.thread_time(), motion.shaft, motion.exact
    try:
        varied = with_model(motion.net, shaft, model)
        compiled = varied.compile()
        built = time.thread_time() - began
        if compiled.form.waves:
            _bearable(compiled, shaft, plan, motion.t_end)
        solution, first = _timed(compiled, shaft, plan, motion.t_end, motion.t)
        times = [first] if built + first > LONGEST / 2 else []
        while not times or (len(times) < 5 and sum(times) < 1.0):  # their median counts
            times.append(_timed(compiled, shaft, plan, motion.t_end, motion.t)[1])
    except ShaftworkError as error:
        return dataclasses.replace(plan, setup=time.thread_time() - began, why=in_one_line(error))
    values, cpu = quantities(solution, varied, shaft), median(times)
    gaps = {name: float(np.abs(values[name] - exact.values[name]).max()) for name in QUANTITIES}
    errors = {name: max(gap / _size(exact, name), exact.error) for name, gap in gaps.items()}
    extra = None
    if motion.frequencies.size and (present := _frequencies(varied, compiled, motion.frequencies)).size:
        judged, limit = motion.frequencies[:MODES], float(motion.frequencies[MODES - 1 : MODES + 1].mean())
        errors |= {f"f_{k + 2}": float(np.abs(present / f - 1).min()) for k, f in enumerate(judged)}
        extra = int((present < limit).sum()) - MODES
    return dataclasses.replace(
        plan,
        engine=solution.engine,
        states=len(compiled.states),
        setup=built + max(first - cpu, 0.0),
        cpu=cpu,
        errors=errors,
        extra_modes=extra,
        courses=_ends(values),
    )


def _bearable(compiled: Model, shaft: str, plan: Trial, t_end: float) -> None:
    """Refuse a run of waves, which nothing interrupts, where the first part of it says that it takes too long."""
    for part in (t_end / 16, t_end / 8, t_end / 4, t_end / 2):
        _, cpu = _timed(compiled, shaft, plan, part, np.array([part]))
        if cpu > LONGEST / 2:
            raise SimulationError(f"given up: {part:.3g} s of {t_end:g} s took {cpu:.0f} s")


def _timed(compiled: Model, shaft: str, plan: Trial, t_end: float, t: Array) -> tuple[Solution, float]:
    """A run in which both end torques are read, and its CPU time in s."""
    began, engine = time.thread_time(), plan.asked

    def watch(reached: float) -> None:
        if time.thread_time() - began > LONGEST:
            raise SimulationError(f"given up after {LONGEST:g} s at t = {reached:.3g} s of {t_end:g} s")

    solution = compiled.simulate(
        t_end,
        t_eval=t,
        engine=engine,  # type: ignore[arg-type]
        rtol=plan.rtol,
        progress=watch,
    )
    solution[f"{shaft}.tau_a"], solution[f"{shaft}.tau_b"]
    return solution, time.thread_time() - began


def _size(exact: ShaftMotion, name: str) -> float:
    """The largest value, of all torques or all speeds together, so that no quantity is judged by its own zero."""
    kind = name.partition("_")[0]
    family = [value for other, value in exact.values.items() if other.startswith(kind)]
    return float(max(np.abs(value).max() for value in family)) or 1.0


def _frequencies(net: Network, compiled: Model, judged: Array) -> Array:
    """The lowest natural frequencies in Hz of a network at rest; empty where they are not found."""
    try:
        if compiled.form.waves:
            return frequencies(net.modes(f_max=float(judged[-1])))
        return frequencies(compiled.linearize(None).modes(count=LOWEST))
    except ShaftworkError:
        return np.empty(0)
