"""A motion through the phases of a network whose parts change their mode: gap, stick, lock, commutation.

Within a phase the equations are smooth, and an engine integrates them until a guard ends a mode. Then modes change one
after another until all of them are consistent with the motion that follows, and the next phase begins.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.model_observer import Impact
from shaftwork.codegen.timeline import Timeline
from shaftwork.codegen.undefined_laws import refuse_vanishing
from shaftwork.core.errors import AccuracyWarning, NetworkError, ParameterError, SimulationError
from shaftwork.core.notices import warn
from shaftwork.hybrid.commutation import takeovers
from shaftwork.hybrid.event_iteration import EventIteration
from shaftwork.hybrid.hybrid_state import Change, HybridState, Regime, Transition
from shaftwork.hybrid.in_place_events import InPlaceEvents, Phase
from shaftwork.hybrid.modes.mode_equations import ModeEquations
from shaftwork.hybrid.modes.mode_machines import NO_IMPACT, with_modes
from shaftwork.hybrid.phases import FOLLOWING, Phases
from shaftwork.hybrid.starts import refuse_incomplete, warn_of_what_may_have_begun
from shaftwork.integrate import choice
from shaftwork.integrate.problem import Problem, SeriesError, StickingError, Trajectory, changed
from shaftwork.pipeline.arguments import Demand
from shaftwork.pipeline.implicit import PRESCRIBED, at_rest
from shaftwork.pipeline.motion_start import Ending

if TYPE_CHECKING:
    from shaftwork.waves.hybrid_waves import WaveRun

CHATTER = ((200, 1e-9), (3000, 1e-6))
"""So many changes of mode, each within this part of the run of the one before, are chatter. Rebounds come ever faster,
too, before they end: a thousand of them where nearly all speed is given back."""
SELDOM = max(part for _, part in CHATTER)
TIGHTEST_RTOL = 1e-14


@dataclass(frozen=True, eq=False)
class Span:
    """One run of an engine: phases in the same equations.

    Args:
        trajectory: the motion, in the states of these equations and their clocks.
        phases: at least one.
    """

    trajectory: Trajectory
    phases: tuple[Phase, ...]


@dataclass(frozen=True, eq=False)
class SharedByRuns:
    """What runs with the same values over the same time share.

    Args:
        settling: changes modes.
        timelines: by equations, the instants at which inputs jump or bend.
        begins: modes and states with which a motion from rest begins, and the changes that lead there.
    """

    settling: EventIteration
    timelines: dict[ModeEquations, Timeline] = field(default_factory=dict)
    begins: list[Transition] = field(default_factory=list)


class HybridRun:
    """One motion through its phases.

    Args:
        phases: the sets of equations.
        values: parameters that differ from the network's.
        demand: what is asked.
        by_combination: whether each combination of modes has equations of its own.
    """

    def __init__(
        self, phases: Phases, values: Mapping[str, float], demand: Demand, *, by_combination: bool = False
    ) -> None:
        self.phases, self.demand = phases, demand
        equations = None if by_combination else partial(phases.running, values=values, engine=demand.engine)
        key = tuple(sorted(values.items())), demand.span, by_combination, demand.engine
        self._shared: SharedByRuns = phases.last_run(
            key, lambda: SharedByRuns(EventIteration(phases, values, demand.span, equations))
        )
        self.settling: EventIteration = self._shared.settling
        self.spans: list[Span] = []
        self.changes: list[Change] = []
        self.jumps: list[Impact] = []
        self.engine, self.why, self.steps = "", "", 0
        self.waves: WaveRun | None = None
        self._soon = [0] * len(CHATTER)

    def march(self, initial: Mapping[str, float] | None) -> None:
        """Go through all phases from the start values, from one change of equations to the next."""
        t, end = self.demand.span
        moment = self.begin(initial)
        while t < end:
            t, moment = self._span(t, moment)

    def begin(self, initial: Mapping[str, float] | None) -> HybridState:
        """The states and modes at the start."""
        start, begins = self.demand.span[0], self._shared.begins
        if self.settling.regime(self.phases.first).assembly.model.form.waves:
            begins = []  # what leaves the ends before the start is of the run
        if isinstance(initial, Ending):
            moment, changes = self._resumed(initial)
        elif initial is None and begins:
            moment, changes = begins[0]
        else:
            moment, changes = self._started(initial)
            if initial is None:
                begins.append((moment, changes))
        if initial and start != 0 and not isinstance(initial, Ending):
            for element, mode in zip(self.phases.elements, moment.regime.modes, strict=True):
                warn_of_what_may_have_begun(element.name, element.modes, mode, start)
        self.note(start, changes)
        return moment

    def _started(self, initial: Mapping[str, float] | None) -> Transition:
        """The states and modes at the start, and what changes there; currents may need diodes that conduct."""
        if not initial:
            return self._joined({}, self._read(initial, {}))
        readings, failed = list[tuple[int, dict[int, str], HybridState]](), None
        start, closed = self.demand.span[0], self._closed()
        for joins in [{}, closed] if closed else [{}]:
            try:
                moment = self._read(initial, joins)
            except ParameterError as error:
                failed = failed or error
            else:
                stored = moment.stored(start)
                readings.append((sum(stored[name] != 0 for name in stored.keys() - initial.keys()), joins, moment))
        if readings:  # what is not named rests, if the circuit lets it
            _, joins, moment = min(readings, key=itemgetter(0))
            return self._joined(joins, moment)
        for joins in takeovers(self.phases.elements, with_modes(self.phases.first, closed)):
            with suppress(ParameterError, SimulationError, NetworkError):
                transition = self._joined(closed | joins, self._read(initial, closed | joins))
                stored = transition[0].stored(start)
                if all(abs(stored.get(k, v) - v) <= NO_IMPACT * max(abs(v), 1.0) for k, v in initial.items()):
                    return transition
        assert failed is not None  # noqa: S101 (as no reading is left)
        raise failed

    def _closed(self) -> dict[int, str]:
        """Switches that the time closes at the start, and their modes."""
        switches = [k for k, element in enumerate(self.phases.elements) if element.is_switch]
        if not switches:
            return {}
        regime = self.settling.regime(self.phases.first)
        rest = np.zeros(len(regime.model.states))
        modes = regime.assembly.first_modes(self._after(regime), rest, regime.p)
        joins = {k: modes[k] for k in switches if modes[k] != self.phases.first[k]}
        return joins if self.settling.possible(with_modes(self.phases.first, joins)) else {}

    def _read(self, initial: Mapping[str, float] | None, joins: Mapping[int, str]) -> HybridState:
        """Start values in the equations in which some elements join something."""
        start, regime = self.demand.span[0], self.settling.regime(with_modes(self.phases.first, joins))
        assembly = regime.assembly
        if isinstance(initial, Mapping) and initial and start != 0:
            refuse_incomplete(assembly.stores.names, initial, start)
        x, waves = assembly.model.start(assembly.prepared(regime.p), initial, self.demand.span)
        return HybridState(regime, self._beside_waves(regime, x, waves))

    def _after(self, regime: Regime) -> float:
        """A time just after the start."""
        return self.timeline(regime.assembly, regime.p).sides(self.demand.span[0])[1]

    def _joined(self, joins: Mapping[int, str], read: HybridState) -> Transition:
        """The modes that go on from a start that has been read where some elements join something, and the changes."""
        after = self._after(read.regime)
        return self.settling.settle(self.demand.span[0], after, self.settling.started(after, read.x, joins), None)

    def _beside_waves(self, regime: Regime, x: Array, start: Any) -> Array:
        """The states at the start, and behind them what arrives by waves, if there are any."""
        if not regime.form.waves:
            return x
        from shaftwork.waves.hybrid_waves import WaveRun

        self.waves = WaveRun(regime.bound, start, self.demand.span)
        return np.concatenate([x, self.waves.arriving(self.demand.span[0])])

    def _resumed(self, ending: Ending) -> Transition:
        """The states and modes in which another motion ended, and what changes at that instant."""
        start, first = self.demand.span[0], self.settling.regime(self.phases.first)
        x = self._beside_waves(first, np.zeros(len(first.model.states)), ending.waves)
        moment, changes = self.settling.resumed(ending.beside(first.assembly.arriving(x))), list[Change]()
        after = self._instants(moment).sides(start)[1]
        if after != ending.read and moment.regime.form.has_impulses:
            moment, changes, _ = self.settling.jumped(start, moment, ending.read, after)
        moment, further = self.settling.settle(start, after, moment, None)
        return moment, [*changes, *further]

    def choose(self) -> tuple[str, str]:
        """The engine for the first phase, and why."""
        moment = self.begin(None)
        problem = self._problem(self.demand.span[0], moment)
        return self._engine(moment, lambda: problem) if problem.x0.size else ("exact", PRESCRIBED)

    def _engine(self, moment: HybridState, problem: Callable[[], Problem]) -> tuple[str, str]:
        regime = moment.regime
        judged = partial(regime.assembly.judged, regime.p)
        return self.phases.engine(regime.assembly, regime.modes, lambda: judged(problem()), self.demand.engine)

    def _suits_heyoka(self, t: float, moment: HybridState) -> bool:
        """Whether heyoka goes on from a time on: it is what was asked for, or suits the modes."""
        return self.demand.engine != "auto" or self._engine(moment, lambda: self._problem(t, moment))[0] == "heyoka"

    def timeline(self, assembly: ModeEquations, p: Array) -> Timeline:
        """The instants at which inputs jump or bend."""
        timelines = self._shared.timelines
        if assembly.whole not in timelines:
            timelines[assembly.whole] = assembly.model.switching.timeline(p, *self.demand.span)
        return timelines[assembly.whole]

    def _instants(self, moment: HybridState) -> Timeline:
        return self.timeline(moment.regime.assembly, moment.regime.p)

    def note(self, t: float, changes: list[Change]) -> None:
        """Put down what has changed at a time.

        Raises:
            SimulationError: changes follow each other without time going on.
        """
        if not changes:
            return
        passed = (t - self.changes[-1].time) / (self.demand.span[1] - self.demand.span[0]) if self.changes else 1.0
        self.changes += changes
        if passed >= SELDOM:
            self._soon = [0] * len(CHATTER)
            return
        for number, (most, part) in enumerate(CHATTER):
            self._soon[number] = self._soon[number] + 1 if passed < part else 0
            if self._soon[number] > most:
                last = changes[-1]
                raise SimulationError(
                    f"{type(last.element.part.component).__name__} '{last.element.name}' changes again and again "
                    f"between '{last.before}' and '{last.after}' at t = {t:.9g} s, {most} times with hardly any time "
                    "going on. Give it damping or its neighbours an inertia, or let it rest (omega_rest)."
                )

    def _problem(self, t: float, moment: HybridState, passing: InPlaceEvents | None = None) -> Problem:
        """The motion from a time on, up to the next instant at which an input jumps."""
        demand, regime, times = self.demand, moment.regime, self._instants(moment)
        following = bisect_right(times.stops, t)
        end = min([*times.stops[following : following + 1], demand.span[1]])
        problem = moment.problem((t, end), times)
        states = regime.model.states
        atol = demand.rtol * problem.atol
        atol[: len(states)] = demand.tolerances(problem.atol[: len(states)], states)
        return changed(
            problem,
            rtol=demand.rtol,
            atol=atol,
            overall=demand.sizes.overall,
            t_eval=self._outputs(t, end),
            max_steps=demand.max_steps - self.steps,
            earlier_steps=self.steps,
            react=passing,
            progress=demand.progress,
        )

    def _span(self, t: float, moment: HybridState) -> tuple[float, HybridState]:
        """One run of the engine, up to other equations or an instant at which an input jumps; what goes on then."""
        regime, form = moment.regime, moment.regime.form
        bind = partial(regime.assembly.bound, regime.p)
        refuse_vanishing(form, bind, lambda: np.array([t]), lambda _: moment.x[None])
        trajectory, passing = self._followed(t, moment)
        passing.close()
        refuse_vanishing(form, bind, lambda: trajectory.dense.steps, trajectory.dense)
        self.steps += trajectory.statistics.get("steps", 0)
        assert trajectory.end is not None  # noqa: S101 (engines that follow guards say it)
        t, x = trajectory.end
        if self.demand.t_eval is not None and t in trajectory.t[-1:] and t < self.demand.span[1]:
            # an output at an event belongs to the next phase, which has it too
            trajectory = replace(trajectory, t=trajectory.t[:-1], x=trajectory.x[:-1])
        self.spans.append(Span(trajectory, tuple(passing.phases)))
        return t, self._settled(t, x[: moment.x.size], passing, trajectory.met)

    def _settled(self, t: float, x: Array, passing: InPlaceEvents, met: int | None) -> HybridState:
        """What goes on at the end of a run of the engine, from its states (n,) and the guard that is met, or None."""
        moment = HybridState(passing.regime, x, passing.bands)
        sides = self._instants(moment).sides(t)
        if met is not None and passing.beyond is not None and sides == (t, t):
            moment, changes = passing.beyond
            self.note(t, changes)
            return moment
        if sides != (t, t) and moment.regime.form.has_impulses:
            moment, changes, at_once = self.settling.jumped(t, moment, *sides)
            self.note(t, changes)
            self.jumps.append(at_once)
            met = None if changes else met
        if met is None and t >= self.demand.span[1]:
            return moment
        after = self._instants(moment).sides(t)[1]  # those of other equations, where a jump has led there
        moment, changes = self.settling.settle(t, after, moment, met)
        self.note(t, changes)
        return moment

    def _outputs(self, t: float, end: float) -> Array | None:
        """The output times of a phase: an event belongs to the next one."""
        if self.demand.t_eval is None:
            return None
        first, last = self.demand.t_eval.searchsorted((t, end))
        return self.demand.t_eval[first : last + (end == self.demand.span[1])]

    def _followed(self, t: float, moment: HybridState) -> tuple[Trajectory, InPlaceEvents]:
        """One run of the engine; where heyoka cannot go on, or a stiff phase is long, another engine begins it anew."""
        passing = InPlaceEvents(self.settling, moment, t, self.note, self._suits_heyoka)
        problem, noted, soon = self._problem(t, moment, passing), len(self.changes), [*self._soon]
        if not problem.x0.size:
            still = at_rest(problem, moment.regime.model.degree)
            return replace(still, end=(problem.t_end, problem.x0)), passing
        name, why = self._engine(moment, lambda: problem)
        if self.waves is not None:
            return self._solve(problem, name, why, self.waves.solver(moment.regime)), passing
        stiff = name != "heyoka"
        if self.demand.engine != "auto" or (stiff and not self.phases.tries_heyoka(moment.regime.assembly)):
            return self._solve(problem, name, why), passing
        most = problem.max_steps
        tried, last = [("heyoka", min(most, choice.patience(problem)) if stiff else most)], name
        sticks: StickingError | None = None
        failed: SeriesError | None = None
        for engine, steps in tried:
            try:
                because = why if failed is None else choice.no_series(failed, engine)
                return self._solve(changed(problem, max_steps=steps), engine, because), passing
            except SimulationError as error:
                failed = error if isinstance(error, SeriesError) and not stiff else failed
                sticks = error if isinstance(error, StickingError) else sticks
                if engine == "heyoka" and not stiff and not isinstance(error, SeriesError):
                    raise
                if isinstance(error, StickingError) and error.driven_back:
                    raise
            if engine == "heyoka" and not stiff:  # only then: whether an engine is installed takes a while to tell
                *others, (last, _) = choice.without_series(most)
                tried += others
            del self.changes[noted:]
            self._soon = [*soon]
            passing = InPlaceEvents(self.settling, moment, t, self.note)
            problem = changed(problem, react=passing)
        if sticks is not None and len(tried) > 1:
            raise sticks
        return self._solve(problem, last, why if failed is None else choice.no_series(failed, last)), passing

    def _solve(
        self, problem: Problem, name: str, why: str, solver: Callable[[Problem], Trajectory] | None = None
    ) -> Trajectory:
        share, loosest = FOLLOWING[name]
        tight = max(min(share * problem.rtol, loosest), min(problem.rtol, TIGHTEST_RTOL))
        if tight != problem.rtol:
            problem = changed(problem, rtol=tight, atol=problem.atol * (tight / problem.rtol))
        trajectory = choice.solve(problem, name, why)[0] if solver is None else solver(problem)
        if trajectory.caveat:
            warn(trajectory.caveat, AccuracyWarning)
        if not self.engine:
            self.engine, self.why = name.removesuffix("-adams"), why
        return trajectory
