"""A motion through the phases of a network whose parts change their mode: gap, stick, lock, commutation.

Within a phase the equations are smooth, and an engine integrates them until a guard ends a mode. Then modes change one
after another until all of them are consistent with the motion that follows, and the next phase begins.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from shaftwork.codegen.elements import Array
from shaftwork.codegen.observer import ModelObserver
from shaftwork.codegen.phase_observer import PhaseObserver, Stretch, Stretches
from shaftwork.codegen.timeline import Timeline
from shaftwork.components.modes import Choice
from shaftwork.core.errors import NetworkError, ParameterError, SimulationError
from shaftwork.integrate import choice
from shaftwork.integrate.problem import Problem, Trajectory
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
# Engines that follow guards.
FOLLOWING = ("heyoka", "scipy", "scipy-radau", "sundials")


@dataclass(frozen=True, eq=False)
class Phase:
    """A span of time in which no mode changes.

    Args:
        start: s.
        modes: of every element.
        assembly: the equations.
        p: their parameters.
        trajectory: the motion, in the states of these equations and their clocks.
    """

    start: float
    modes: ModeNames
    assembly: Assembly
    p: Array
    trajectory: Trajectory


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
            return asked, "asked for"
        if assembly not in self._engines:
            name, why = choice.choose(problem)
            known = name if name in FOLLOWING else "scipy"
            self._engines[assembly] = known, why
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
        self.found: list[Phase] = []
        self.changes: list[Change] = []
        self.engine, self.why, self.steps = "", "", 0
        self._timelines: dict[Assembly, Timeline] = {}

    def march(self, initial: Mapping[str, float] | None) -> None:
        """Go through all phases from the start values."""
        start, end = self.demand.span
        moment = self._start(initial)
        moment = self._settle(start, moment, None)
        t = before = start
        short = 0
        while t < end:
            t, moment, met = self._phase(t, moment)
            if t < end or met is not None:
                moment = self._settle(t, moment, met)
            short = short + 1 if t - before < CHATTER_SPAN * (end - start) and met is not None else 0
            if short > CHATTER_EVENTS:
                raise self._chatter(t)
            before = t

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
        self.changes += changes
        return moment

    def _phase(self, t: float, moment: Moment) -> tuple[float, Moment, int | None]:
        """One phase, or what of it lies before the next instant at which an input jumps."""
        demand, assembly, times = self.demand, moment.assembly, self.timeline(moment.assembly, moment.p)
        end = next((time for time in times.times if time > t), demand.span[1])
        problem = assembly.problem(moment.p, moment.modes, moment.x, (t, min(end, demand.span[1])), times)
        atol = demand.rtol * problem.atol
        if demand.atol is not None:
            atol[: moment.x.size] = demand.atol
        problem = replace(
            problem,
            rtol=demand.rtol,
            atol=atol,
            t_eval=self._outputs(t, problem.t_end),
            max_steps=demand.max_steps - self.steps,
        )
        if demand.progress is not None:
            problem = replace(problem, rhs=watched_by(problem.rhs, demand.progress))
        assert problem.guards is not None  # noqa: S101 (assemblies make them)
        band = self.settling.band(moment, times.sides(t)[1])
        problem = replace(problem, guards=replace(problem.guards, offsets=band))
        trajectory = self._solve(assembly, problem)
        self.steps += trajectory.statistics.get("steps", 0)
        self.found.append(Phase(t, moment.modes, assembly, moment.p, trajectory))
        assert trajectory.end is not None  # noqa: S101 (engines that follow guards say it)
        t, x = trajectory.end
        x = x[: moment.x.size]
        if trajectory.met is None and assembly.model.form.has_impulses:
            x = assembly.bound(moment.p).impulse(x, *times.sides(t))
        return t, replace(moment, x=x), trajectory.met

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
        trajectory, name, why = choice.solve(problem, name, why, fallback=self.demand.engine == "auto")
        if not self.engine:
            self.engine, self.why = name, why
        return trajectory

    def _chatter(self, t: float) -> SimulationError:
        last = self.changes[-1]
        return SimulationError(
            f"{type(last.element.part.component).__name__} '{last.element.name}' changes again and again between "
            f"'{last.before}' and '{last.after}' at t = {t:.9g} s, {CHATTER_EVENTS} times without time going on. "
            "Give it damping or its neighbours an inertia, or let it rest."
        )


def motion(
    phases: Phases, values: Mapping[str, float], initial: Mapping[str, float] | None, demand: Demand, name: str
) -> Solution:
    """A motion through all its phases."""
    run = Run(phases, values, demand)
    run.march(initial)
    return solution(run, name)


def solution(run: Run, name: str) -> Solution:
    """The motion as a whole, to be read."""
    stretches = Stretches([_stretch(run, phase) for phase in run.found])
    names = stretches.names
    t = np.concatenate([phase.trajectory.t for phase in run.found])
    x = np.concatenate(
        [_stored(stretch, phase, names) for stretch, phase in zip(stretches.all, run.found, strict=True)]
    )
    events = tuple(_event(change) for change in run.changes if _is_event(change))
    return Solution(
        name=name,
        t=t,
        x=x,
        states=names,
        engine=run.engine,
        why=run.why,
        statistics={"steps": run.steps, "phases": len(run.found), "assemblies": len(run._timelines)},
        dense=PhasedDense(stretches, tuple(phase.trajectory for phase in run.found)),
        observer=PhaseObserver(stretches),
        events=events,
        phases=_table(run),
    )


def _stretch(run: Run, phase: Phase) -> Stretch:
    assembly, p = phase.assembly, phase.p
    states = assembly.model.states
    size, dense = len(states), phase.trajectory.dense
    instants = run.timeline(assembly, p)
    return Stretch(
        start=phase.start,
        key=(id(assembly), p.tobytes()),
        stores=assembly.stores,
        bind=lambda: assembly.bound(p),
        observer=ModelObserver(assembly.model.form, lambda: assembly.bound(p), instants),
        instants=instants,
        dense=lambda times: dense(times)[:, :size],
        states=states,
    )


def _stored(stretch: Stretch, phase: Phase, names: tuple[str, ...]) -> Array:
    trajectory = phase.trajectory
    if not trajectory.t.size:
        return np.empty((0, len(names)))
    return stretch.stores.of(stretch.bind, trajectory.t, trajectory.x[:, : len(stretch.states)])


class PhasedDense:
    """All that is stored at any time of a motion.

    Args:
        stretches: its phases.
        trajectories: of the phases.
    """

    def __init__(self, stretches: Stretches, trajectories: tuple[Trajectory, ...]) -> None:
        self._stretches, self._trajectories = stretches, trajectories

    @property
    def steps(self) -> Array:
        """Ends of the integration steps; the end of a phase is listed once more as the start of the next."""
        return np.concatenate([trajectory.steps for trajectory in self._trajectories])

    def __call__(self, times: Array) -> Array:
        return self._stretches.dense(times)


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
    ends = [*(phase.start for phase in run.found[1:]), run.demand.span[1]]
    for phase, end in zip(run.found, ends, strict=True):
        pairs = zip(run.phases.elements, phase.modes, strict=True)
        modes = {element.name: element.modes[name].words for element, name in pairs}
        name = ", ".join(f"{part} {words}" for part, words in modes.items())
        if rows and rows[-1].name == name:
            rows[-1] = replace(rows[-1], end=end)
        elif end > phase.start:
            rows.append(PhaseRow(phase.start, end, name, modes))
    return tuple(rows)
