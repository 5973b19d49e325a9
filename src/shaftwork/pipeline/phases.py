"""A motion through the phases of a network whose parts change their mode: gap, stick, lock, commutation.

Within a phase the equations are smooth, and an engine integrates them until a guard ends a mode. Then modes change one
after another until all of them are consistent with the motion that follows, and the next phase begins.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from shaftwork.codegen.elements import Array
from shaftwork.codegen.observer import ModelObserver
from shaftwork.codegen.phase_observer import PhaseObserver, Stretch, Stretches
from shaftwork.codegen.timeline import Timeline
from shaftwork.components.modes import Choice
from shaftwork.core.errors import NetworkError, ParameterError, SimulationError
from shaftwork.integrate import choice
from shaftwork.integrate.problem import Problem, Reaction, Trajectory
from shaftwork.network.netlist import Netlist
from shaftwork.pipeline.arguments import watched_by
from shaftwork.pipeline.assemblies import Assembly, ModeNames, elements_of
from shaftwork.pipeline.implicit import at_rest
from shaftwork.pipeline.settling import Change, Moment, Settling
from shaftwork.results.solution import PhaseRow, Solution

if TYPE_CHECKING:
    from shaftwork.pipeline.model import Model

# So many changes of mode, each within this part of the run of the one before, are chatter.
CHATTER_EVENTS, CHATTER_SPAN = 200, 1e-9
# Engines that follow guards. An error grows with every change of mode, by some hundreds on the way through sixty
# contacts, so they run with this part of the tolerance that is asked for, and with no looser one than the second number.
FOLLOWING = {
    "heyoka": (1.0, 1.0),
    "scipy": (1 / 30, 1e-7),
    "scipy-radau": (1 / 30, 1e-7),
    "sundials": (1 / 300, 1e-8),
    "sundials-adams": (1 / 100, 1e-8),
}
TIGHTEST_RTOL = 1e-14


@dataclass(frozen=True, eq=False)
class Phase:
    """A span of time in which no mode changes.

    Args:
        start: s.
        modes: of every element.
        p: parameters of the equations.
    """

    start: float
    modes: ModeNames
    p: Array


@dataclass(frozen=True, eq=False)
class Span:
    """One run of an engine: phases in the same equations.

    Args:
        assembly: the equations.
        trajectory: the motion, in the states of these equations and their clocks.
        phases: at least one.
    """

    assembly: Assembly
    trajectory: Trajectory
    phases: tuple[Phase, ...]


@dataclass(frozen=True)
class Demand:
    """What is asked of a run; see `Model.simulate`. The output times are None for those of the steps."""

    span: tuple[float, float]
    rtol: float
    atol: Any
    t_eval: Array | None
    engine: str
    max_steps: int
    progress: Callable[[float], None] | None


class Phases:
    """All sets of equations of a network whose parts change their mode; each is made when a motion first needs it.

    Args:
        base: the model in the first mode of each element, in which no mode joins anything rigidly.
        rebuild: makes the model of a changed netlist.
    """

    def __init__(self, base: Model, rebuild: Callable[[Netlist], Model]) -> None:
        self.netlist, self._rebuild = base.netlist, rebuild
        self.elements = elements_of(base)
        self.first: ModeNames = tuple(element.modes.options[0].name for element in self.elements)
        self._assemblies: dict[tuple[str, ...], Assembly | NetworkError] = {}
        self._engines: dict[Any, tuple[str, str]] = {}

    def assembly(self, modes: ModeNames) -> Assembly:
        """The equations for a combination of modes.

        Raises:
            NetworkError: they contradict each other, as where a stuck brake is turned by a prescribed speed.
        """
        forms = tuple(element.modes[name].form for element, name in zip(self.elements, modes, strict=True))
        if forms not in self._assemblies:
            try:
                self._assemblies[forms] = Assembly(self._rebuild(self._netlist(forms)), self.elements, forms)
            except NetworkError as error:
                self._assemblies[forms] = error
        made = self._assemblies[forms]
        if isinstance(made, NetworkError):
            raise made
        return made

    def _netlist(self, forms: tuple[str, ...]) -> Netlist:
        chosen: dict[str, tuple[Choice, ...]] = {}
        for element, form in zip(self.elements, forms, strict=True):
            chosen[element.part.name] = (*chosen.get(element.part.name, ()), Choice(form))
        return self.netlist.with_choices(chosen)

    def numbers(self, modes: ModeNames) -> dict[str, float]:
        """The number of each element's mode by the name of its parameter."""
        pairs = zip(self.elements, modes, strict=True)
        return {element.number: element.modes[name].value for element, name in pairs}

    def engine(self, assembly: Assembly, problem: Problem, asked: str) -> tuple[str, str]:
        """The engine for a phase, and why.

        Raises:
            ParameterError: the one that is asked for follows no modes.
        """
        if asked != "auto":
            choice.check(asked)
            if asked not in FOLLOWING:
                raise ParameterError(
                    f"The engine '{asked}' follows no parts that change their mode "
                    f"({', '.join(element.name for element in self.elements)}). Take one of: {', '.join(FOLLOWING)}."
                )
            if asked == "sundials" and not choice.is_stiff(problem):
                return "sundials-adams", "asked for; the motion is not stiff, so Adams' formulas are taken."
            return asked, "asked for"
        if assembly not in self._engines:
            name, why = choice.choose(problem)
            self._engines[assembly] = name, why
        return self._engines[assembly]


class Run:
    """One motion through its phases.

    Args:
        phases: the sets of equations.
        values: parameters that differ from the network's.
        demand: what is asked.
    """

    def __init__(self, phases: Phases, values: Mapping[str, float], demand: Demand) -> None:
        self.phases, self.demand = phases, demand
        self.settling = Settling(phases, values, demand.span)
        self.spans: list[Span] = []
        self.changes: list[Change] = []
        self.engine, self.why, self.steps = "", "", 0
        self._soon = 0
        self._timelines: dict[Assembly, Timeline] = {}

    def march(self, initial: Mapping[str, float] | None) -> None:
        """Go through all phases from the start values."""
        t, end = self.demand.span
        moment = self._settle(t, self._start(initial), None)
        while t < end:
            t, moment, met = self._span(t, moment)
            if t < end or met is not None:
                moment = self._settle(t, moment, met)

    def _start(self, initial: Mapping[str, float] | None) -> Moment:
        """The states and modes at the start, before modes have settled."""
        assembly = self.phases.assembly(self.phases.first)
        loose = self.settling.moment(self.phases.first, assembly)
        prepared = assembly.prepared(loose.p)
        x, _ = assembly.model.start(prepared, initial, self.demand.span)
        after = self.timeline(assembly, loose.p).sides(self.demand.span[0])[1]
        modes = assembly.first_modes(after, x, loose.p)
        return self.settling.changed(replace(loose, x=x), after, modes)

    def timeline(self, assembly: Assembly, p: Array) -> Timeline:
        """The instants at which inputs jump or bend."""
        if assembly not in self._timelines:
            self._timelines[assembly] = assembly.model.switching.timeline(p, *self.demand.span)
        return self._timelines[assembly]

    def _settle(self, t: float, moment: Moment, met: int | None) -> Moment:
        after = self.timeline(moment.assembly, moment.p).sides(t)[1]
        moment, changes = self.settling.settle(t, after, moment, met)
        self.note(t, changes)
        return moment

    def note(self, t: float, changes: list[Change]) -> None:
        """Put down what has changed at a time.

        Raises:
            SimulationError: changes follow each other without time going on.
        """
        if not changes:
            return
        span = self.demand.span[1] - self.demand.span[0]
        soon = bool(self.changes) and t - self.changes[-1].time < CHATTER_SPAN * span
        self._soon = self._soon + 1 if soon else 0
        self.changes += changes
        if self._soon > CHATTER_EVENTS:
            last = changes[-1]
            raise SimulationError(
                f"{type(last.element.part.component).__name__} '{last.element.name}' changes again and again between "
                f"'{last.before}' and '{last.after}' at t = {t:.9g} s, {CHATTER_EVENTS} times without time going on. "
                "Give it damping or its neighbours an inertia, or let it rest."
            )

    def _span(self, t: float, moment: Moment) -> tuple[float, Moment, int | None]:
        """One run of the engine, up to a change of equations or the next instant at which an input jumps."""
        demand, assembly, times = self.demand, moment.assembly, self.timeline(moment.assembly, moment.p)
        end = min(next((time for time in times.times if time > t), np.inf), demand.span[1])
        problem = assembly.problem(moment.p, moment.modes, moment.x, moment.bands, (t, end), times)
        atol = demand.rtol * problem.atol
        if demand.atol is not None:
            atol[: moment.x.size] = demand.atol
        passing = _Passing(self, moment, t)
        problem = replace(
            problem,
            rtol=demand.rtol,
            atol=atol,
            t_eval=self._outputs(t, end),
            max_steps=demand.max_steps - self.steps,
            react=passing,
            rhs=problem.rhs if demand.progress is None else watched_by(problem.rhs, demand.progress),
        )
        trajectory = self._solve(assembly, problem)
        self.steps += trajectory.statistics.get("steps", 0)
        self.spans.append(Span(assembly, trajectory, tuple(passing.phases)))
        assert trajectory.end is not None  # noqa: S101 (engines that follow guards say it)
        t, x = trajectory.end
        x = x[: moment.x.size]
        if trajectory.met is None and assembly.model.form.has_impulses:
            x = assembly.bound(moment.p).impulse(x, *times.sides(t))
        return t, replace(passing.moment, x=x), trajectory.met

    def _outputs(self, t: float, end: float) -> Array | None:
        """The output times of a phase: an event belongs to the next one."""
        if self.demand.t_eval is None:
            return None
        first, last = np.searchsorted(self.demand.t_eval, (t, end), side="left")
        return self.demand.t_eval[first : last + (end == self.demand.span[1])]

    def _solve(self, assembly: Assembly, problem: Problem) -> Trajectory:
        if not problem.x0.size:
            made, _, _ = at_rest(problem)
            return replace(made, end=(problem.t_end, problem.x0))
        name, why = self.phases.engine(assembly, problem, self.demand.engine)
        share, loosest = FOLLOWING[name]
        tight = max(min(share * problem.rtol, loosest), min(problem.rtol, TIGHTEST_RTOL))
        problem = replace(problem, rtol=tight, atol=problem.atol * (tight / problem.rtol))
        trajectory, name, why = choice.solve(problem, name, why, fallback=self.demand.engine == "auto")
        if not self.engine:
            self.engine, self.why = name, why
        return trajectory


class _Passing:
    """Lets an engine go on past guards that change a number in its equations only; `Problem.react`.

    Args:
        run: to which changes are told.
        moment: at the start of the engine's run.
        start: s.
    """

    def __init__(self, run: Run, moment: Moment, start: float) -> None:
        self._run, self.moment = run, moment
        self.phases = [Phase(start, moment.modes, moment.p)]
        self._reactions: list[Reaction] = []

    def __call__(self, number: int, met: int, t: float, x: Array) -> Reaction | None:
        if number < len(self._reactions):  # the run is made once more, for its dense output
            return self._reactions[number]
        before = replace(self.moment, x=x[: self.moment.x.size])
        moment, changes = self._run.settling.settle(t, t, before, met)
        if moment.assembly is not before.assembly or any(change.rebound for change in changes):
            return None
        self._run.note(t, changes)
        self.moment = moment
        self.phases.append(Phase(t, moment.modes, moment.p))
        reaction = Reaction(moment.p, moment.assembly.sides(moment.modes), np.array(moment.bands))
        self._reactions.append(reaction)
        return reaction


def motion(
    phases: Phases, values: Mapping[str, float], initial: Mapping[str, float] | None, demand: Demand, name: str
) -> Solution:
    """A motion through all its phases."""
    run = Run(phases, values, demand)
    run.march(initial)
    return solution(run, name)


def solution(run: Run, name: str) -> Solution:
    """The motion as a whole, to be read."""
    names = run.spans[0].assembly.stores.names
    whole = _Whole(run)
    return Solution(
        name=name,
        t=np.concatenate([span.trajectory.t for span in run.spans]),
        x=np.concatenate([_stored(span, names) for span in run.spans]),
        states=names,
        engine=run.engine,
        why=run.why,
        statistics={"steps": run.steps, "changes": len(run.changes)},
        dense=whole,
        observer=PhaseObserver(names, whole.stretches),
        events=tuple(_event(change) for change in run.changes if _is_event(change)),
        phases=_table(run),
    )


def _stored(span: Span, names: tuple[str, ...]) -> Array:
    """(k, stores) all that is stored at the output times of a span."""
    t, states = span.trajectory.t, span.trajectory.x[:, : len(span.assembly.model.states)]
    if not t.size:
        return np.empty((0, len(names)))
    stores = span.assembly.stores
    if stores.by_loops:
        return stores.of(lambda: span.assembly.bound(span.phases[0].p), t, states)
    starts = np.array([phase.start for phase in span.phases])
    made = np.empty((t.size, len(names)))
    index = np.clip(np.searchsorted(starts, t, side="right") - 1, 0, None)
    for number in np.unique(index).tolist():
        here = index == number
        made[here] = stores.of(partial(span.assembly.bound, span.phases[number].p), t[here], states[here])
    return made


class _Whole:
    """All that is stored at any time of a motion; what it needs is made when it is first asked."""

    def __init__(self, run: Run) -> None:
        self._run = run

    @cache
    def stretches(self) -> Stretches:
        """The phases as they are read."""
        return Stretches([_stretch(self._run, span, phase) for span in self._run.spans for phase in span.phases])

    @property
    def steps(self) -> Array:
        """Ends of the integration steps; where an engine began anew the time is listed twice."""
        return np.concatenate([span.trajectory.steps for span in self._run.spans])

    def __call__(self, times: Array) -> Array:
        return self.stretches().dense(times)


def _stretch(run: Run, span: Span, phase: Phase) -> Stretch:
    assembly, states = span.assembly, span.assembly.model.states
    size, dense = len(states), span.trajectory.dense
    instants = run.timeline(assembly, phase.p)
    bind = partial(assembly.bound, phase.p)
    return Stretch(
        start=phase.start,
        key=(id(assembly), phase.p.tobytes()),
        stores=assembly.stores,
        bind=bind,
        observer=ModelObserver(assembly.model.form, bind, instants),
        instants=instants,
        dense=lambda times: dense(times)[:, :size],
        states=states,
    )


def _is_event(change: Change) -> bool:
    modes = change.element.modes
    return change.rebound or modes[change.before].words != modes[change.after].words


def _event(change: Change) -> tuple[float, str, str, str]:
    modes = change.element.modes
    after = "rebound" if change.rebound else modes[change.after].words
    return change.time, change.element.name, modes[change.before].words, after


def _table(run: Run) -> tuple[PhaseRow, ...]:
    """The phases in words: those that say the same are one."""
    rows: list[PhaseRow] = []
    phases = [phase for span in run.spans for phase in span.phases]
    ends = [*(phase.start for phase in phases[1:]), run.demand.span[1]]
    words: dict[ModeNames, dict[str, str]] = {}
    for phase, end in zip(phases, ends, strict=True):
        if phase.modes not in words:
            pairs = zip(run.phases.elements, phase.modes, strict=True)
            words[phase.modes] = {element.name: element.modes[name].words for element, name in pairs}
        modes = words[phase.modes]
        if rows and rows[-1].modes == modes:
            rows[-1] = replace(rows[-1], end=end)
        elif end > phase.start:
            rows.append(PhaseRow(phase.start, end, modes))
    return tuple(rows)
