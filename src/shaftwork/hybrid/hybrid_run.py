"""A motion through the phases of a network whose parts change their mode: gap, stick, lock, commutation.

Within a phase the equations are smooth, and an engine integrates them until a guard ends a mode. Then modes change one
after another until all of them are consistent with the motion that follows, and the next phase begins.
"""

from __future__ import annotations

import math
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
from shaftwork.hybrid.equation_sets import EquationSets
from shaftwork.hybrid.event_iteration import EventIteration
from shaftwork.hybrid.hybrid_state import EventOutcome, HybridState, Regime, Transition
from shaftwork.hybrid.in_place_events import InPlaceEvents, Phase
from shaftwork.hybrid.modes.mode_equations import ModeEquations
from shaftwork.hybrid.modes.mode_machines import NO_IMPACT, with_modes
from shaftwork.hybrid.modes.starts import refuse_incomplete, warn_of_what_may_have_begun
from shaftwork.integrate import choice
from shaftwork.integrate.engines import ENGINES
from shaftwork.integrate.problem import Problem, SeriesError, Trajectory, changed
from shaftwork.pipeline.arguments import Demand
from shaftwork.pipeline.implicit import PRESCRIBED, without_states
from shaftwork.pipeline.motion_start import Ending

if TYPE_CHECKING:
    from shaftwork.waves.hybrid_waves import WaveRun

CHATTER = ((200, 1e-9), (3000, 1e-6))
"""So many transitions, each within this part of the run of the one before, are chatter. Rebounds come ever faster,
too, before they end: a thousand of them where nearly all speed is given back."""
SELDOM = max(part for _, part in CHATTER)


@dataclass(frozen=True, eq=False)
class Segment:
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
        event_iteration: changes modes.
        timelines: by equations, the instants at which inputs jump or bend.
        begins: modes and states with which a motion from rest begins, and the transitions that lead there.
    """

    event_iteration: EventIteration
    timelines: dict[ModeEquations, Timeline] = field(default_factory=dict)
    begins: list[EventOutcome] = field(default_factory=list)


class HybridRun:
    """One motion through its phases.

    Args:
        equation_sets: the sets of equations.
        values: parameters that differ from the network's.
        demand: what is asked.
        by_combination: whether each combination of modes has equations of its own.
    """

    def __init__(
        self, equation_sets: EquationSets, values: Mapping[str, float], demand: Demand, *, by_combination: bool = False
    ) -> None:
        self.equation_sets, self.demand = equation_sets, demand
        equations = None if by_combination else partial(equation_sets.running, values=values, engine=demand.engine)
        key = tuple(sorted(values.items())), demand.span, by_combination, demand.engine
        self._shared: SharedByRuns = equation_sets.last_run(
            key, lambda: SharedByRuns(EventIteration(equation_sets, values, demand.span, equations))
        )
        self.event_iteration: EventIteration = self._shared.event_iteration
        self.segments: list[Segment] = []
        self.transitions: list[Transition] = []
        self.jumps: list[Impact] = []
        self.engine, self.why, self.steps = "", "", 0
        self.waves: WaveRun | None = None
        self._soon = [0] * len(CHATTER)
        self._sampled_at = -math.inf
        self._duration = demand.span[1] - demand.span[0]

    def march(self, initial: Mapping[str, float] | None) -> None:
        """Go through all phases from the start values, from one set of equations to the next."""
        t, end = self.demand.span
        state = self.begin(initial)
        while t < end:
            t, state = self._segment(t, state)

    def begin(self, initial: Mapping[str, float] | None) -> HybridState:
        """The states and modes at the start."""
        start, begins = self.demand.span[0], self._shared.begins
        self._sampled_at = -math.inf
        if self.event_iteration.transfer.regime(self.equation_sets.first).equations.model.form.waves:
            begins = []  # what leaves the ends before the start is of the run
        if isinstance(initial, Ending):
            state, transitions = self._resumed(initial)
        elif initial is None and begins:
            state, transitions = begins[0]
        else:
            state, transitions = self._started(initial)
            if initial is None:
                begins.append((state, transitions))
        state, further = self._past_samples(start, state)
        transitions = [*transitions, *further]
        if initial and start != 0 and not isinstance(initial, Ending):
            for machine, mode in zip(self.equation_sets.machines, state.regime.modes, strict=True):
                warn_of_what_may_have_begun(machine.name, machine.modes, mode, start)
        self.note(start, transitions)
        return state

    def _started(self, initial: Mapping[str, float] | None) -> EventOutcome:
        """The states and modes at the start, and the transitions there; currents may need diodes that conduct."""
        if not initial:
            return self._going_on({}, self._read(initial, {}))
        readings, failed = list[tuple[int, dict[int, str], HybridState]](), None
        start, closed = self.demand.span[0], self._closed()
        for rigid in [{}, closed] if closed else [{}]:
            try:
                state = self._read(initial, rigid)
            except ParameterError as error:
                failed = failed or error
            else:
                stored = state.stored(start)
                readings.append((sum(stored[name] != 0 for name in stored.keys() - initial.keys()), rigid, state))
        if readings:  # what is not named rests, if the circuit lets it
            _, rigid, state = min(readings, key=itemgetter(0))
            return self._going_on(rigid, state)
        for rigid in takeovers(self.equation_sets.machines, with_modes(self.equation_sets.first, closed)):
            with suppress(ParameterError, SimulationError, NetworkError):
                outcome = self._going_on(closed | rigid, self._read(initial, closed | rigid))
                stored = outcome[0].stored(start)
                if all(abs(stored.get(k, v) - v) <= NO_IMPACT * max(abs(v), 1.0) for k, v in initial.items()):
                    return outcome
        assert failed is not None  # noqa: S101 (as no reading is left)
        raise failed

    def _closed(self) -> dict[int, str]:
        """Switches that the time closes at the start, and their modes."""
        switches = [k for k, machine in enumerate(self.equation_sets.machines) if machine.is_switch]
        if not switches:
            return {}
        regime = self.event_iteration.transfer.regime(self.equation_sets.first)
        rest = np.zeros(len(regime.model.states))
        modes = regime.equations.first_modes(self.timeline(regime).sides(self.demand.span[0])[1], rest, regime.p)
        rigid = {k: modes[k] for k in switches if modes[k] != self.equation_sets.first[k]}
        return rigid if self.event_iteration.transfer.possible(with_modes(self.equation_sets.first, rigid)) else {}

    def _read(self, initial: Mapping[str, float] | None, rigid: Mapping[int, str]) -> HybridState:
        """Start values in the equations in which some machines are rigid."""
        regime = self.event_iteration.transfer.regime(with_modes(self.equation_sets.first, rigid))
        start, equations = self.demand.span[0], regime.equations
        if isinstance(initial, Mapping) and initial and start != 0:
            refuse_incomplete(equations.stores.names, initial, start)
        x, waves = equations.model.state_at_start(equations.prepared(regime.p), initial, self.demand.span)
        return HybridState(regime, self._beside_waves(regime, x, waves))

    def _going_on(self, rigid: Mapping[int, str], read: HybridState) -> EventOutcome:
        """The modes that go on from a start that has been read where some machines are rigid, and the transitions."""
        start = self.demand.span[0]
        after = self.timeline(read.regime).sides(start)[1]
        return self.event_iteration.run(start, after, self.event_iteration.in_start_modes(after, read.x, rigid), None)

    def _beside_waves(self, regime: Regime, x: Array, start: Any) -> Array:
        """The states at the start, and behind them what arrives by waves, if there are any."""
        if not regime.form.waves:
            return x
        from shaftwork.waves.hybrid_waves import WaveRun

        self.waves = WaveRun(regime.bound, start, self.demand.span)
        return np.concatenate([x, self.waves.arriving(self.demand.span[0])])

    def _resumed(self, ending: Ending) -> EventOutcome:
        """The states and modes in which another motion ended, and the transitions at that instant."""
        start, first = self.demand.span[0], self.event_iteration.transfer.regime(self.equation_sets.first)
        x = self._beside_waves(first, np.zeros(len(first.model.states)), ending.waves)
        state = self.event_iteration.transfer.resumed(ending.beside(first.equations.arriving(x)))
        transitions = list[Transition]()
        after = self.timeline(state.regime).sides(start)[1]
        if after != ending.read and state.regime.form.has_impulses:
            state, transitions, _ = self.event_iteration.impacts.jumped(start, state, ending.read, after)
        state, further = self.event_iteration.run(start, after, state, None)
        return state, [*transitions, *further]

    def choose(self) -> tuple[str, str]:
        """The engine for the first phase, and why."""
        state = self.begin(None)
        problem = self.problem(self.demand.span[0], state)
        return self._engine(state, lambda: problem) if problem.x0.size else ("exact", PRESCRIBED)

    def _engine(self, state: HybridState, problem: Callable[[], Problem]) -> tuple[str, str]:
        regime = state.regime
        judged = partial(regime.equations.judged, regime.p)
        return self.equation_sets.engine(regime.equations, regime.modes, lambda: judged(problem()), self.demand.engine)

    def _suits_heyoka(self, t: float, state: HybridState) -> bool:
        """Whether heyoka goes on from a time on: it is what was asked for, or suits the modes."""
        return self.demand.engine != "auto" or self._engine(state, lambda: self.problem(t, state))[0] == "heyoka"

    def timeline(self, regime: Regime) -> Timeline:
        """The instants at which inputs jump or bend."""
        timelines, equations = self._shared.timelines, regime.equations.whole
        if equations not in timelines:
            timelines[equations] = regime.model.switching.timeline(regime.p, *self.demand.span)
        return timelines[equations]

    def note(self, t: float, transitions: list[Transition]) -> None:
        """Put down the transitions at a time.

        Raises:
            SimulationError: transitions follow each other without time going on.
        """
        if not transitions:
            return
        passed = (t - self.transitions[-1].time) / self._duration if self.transitions else 1.0
        self.transitions += transitions
        if passed >= SELDOM:
            self._soon = [0] * len(CHATTER)
            return
        for number, (most, part) in enumerate(CHATTER):
            self._soon[number] = self._soon[number] + 1 if passed < part else 0
            if self._soon[number] > most:
                last = transitions[-1]
                raise SimulationError(
                    f"{type(last.machine.part.component).__name__} '{last.machine.name}' changes again and again "
                    f"between '{last.before}' and '{last.after}' at t = {t:.9g} s, {most} times with hardly any time "
                    "going on. Give it damping or its neighbours an inertia, or let it rest (omega_rest)."
                )

    def problem(self, t: float, state: HybridState, in_place: InPlaceEvents | None = None) -> Problem:
        """The motion from a time on, up to the next instant at which an input jumps."""
        demand, regime, times = self.demand, state.regime, self.timeline(state.regime)
        following = bisect_right(times.stops, t)
        end = min([*times.stops[following : following + 1], demand.span[1]])
        problem = state.problem((t, end), times)
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
            past_guards=in_place,
            progress=demand.progress,
        )

    def _segment(self, t: float, state: HybridState) -> tuple[float, HybridState]:
        """One run of an engine, up to other equations or an instant at which an input jumps; what goes on then."""
        regime, form = state.regime, state.regime.form
        bind = partial(regime.equations.bound, regime.p)
        if form.doubtful:
            refuse_vanishing(form, bind, lambda: np.array([t]), lambda _: state.x[None])
        trajectory, in_place = self._followed(t, state)
        in_place.close()
        if form.doubtful:
            refuse_vanishing(form, bind, lambda: trajectory.dense.steps, trajectory.dense)
        self.steps += trajectory.statistics.get("steps", 0)
        assert trajectory.end is not None  # noqa: S101 (engines that follow guards say it)
        t, x = trajectory.end
        if self.demand.t_eval is not None and t in trajectory.t[-1:] and t < self.demand.span[1]:
            # an output at an event belongs to the next phase, which has it too
            trajectory = replace(trajectory, t=trajectory.t[:-1], x=trajectory.x[:-1])
        self.segments.append(Segment(trajectory, tuple(in_place.phases)))
        state = self._next_state(t, x[: state.x.size], in_place, trajectory.met)
        if trajectory.met is not None:  # where a guard is met at a sampling instant, its event comes first
            state, transitions = self._past_samples(t, state)
            self.note(t, transitions)
        return t, state

    def _next_state(self, t: float, x: Array, in_place: InPlaceEvents, met: int | None) -> HybridState:
        """What goes on at the end of a run of the engine, from its states (n,) and the guard that is met, or None."""
        state = HybridState(in_place.regime, x, in_place.bands)
        if met is None:
            state = self._sampled(t, state)
        sides = self.timeline(state.regime).sides(t)
        if met is not None and in_place.beyond is not None and sides == (t, t):
            state, transitions = in_place.beyond
            self.note(t, transitions)
            return state
        if sides != (t, t) and state.regime.form.has_impulses:
            state, transitions, at_once = self.event_iteration.impacts.jumped(t, state, *sides)
            self.note(t, transitions)
            self.jumps.append(at_once)
            met = None if transitions else met
        if met is None and t >= self.demand.span[1]:
            return state
        after = self.timeline(state.regime).sides(t)[1]  # those of other equations, where a jump has led there
        state, transitions = self.event_iteration.run(t, after, state, met)
        self.note(t, transitions)
        return state

    def _sampled(self, t: float, state: HybridState) -> HybridState:
        """The same modes with what controllers hold after a time in s; the same state where none samples then."""
        sampled = state.regime.equations.prepared(state.regime.p).sampled(self.demand.span)
        if sampled is None or not self._sampled_at < t < self.demand.span[1]:
            return state
        self._sampled_at, x = t, sampled(t, state.x)
        return state if (x == state.x).all() else state._replace(x=x)

    def _past_samples(self, t: float, state: HybridState) -> EventOutcome:
        """What goes on after what is sampled at a time in s, and the transitions that follow from it."""
        if (sampled := self._sampled(t, state)) is state:
            return state, []
        return self.event_iteration.run(t, self.timeline(state.regime).sides(t)[1], sampled, None)

    def _outputs(self, t: float, end: float) -> Array | None:
        """The output times of a phase: an event belongs to the next one."""
        if self.demand.t_eval is None:
            return None
        first, last = self.demand.t_eval.searchsorted((t, end))
        return self.demand.t_eval[first : last + (end == self.demand.span[1])]

    def _followed(self, t: float, state: HybridState) -> tuple[Trajectory, InPlaceEvents]:
        """One run of the engine; where heyoka cannot go on, or a stiff phase is long, another engine begins it anew."""
        in_place = InPlaceEvents(self.event_iteration, state, t, self.note, self._suits_heyoka)
        problem, noted, soon = self.problem(t, state, in_place), len(self.transitions), [*self._soon]
        if not problem.x0.size:
            still = without_states(problem, state.regime.model.degree)
            return replace(still, end=(problem.t_end, problem.x0)), in_place
        name, why = self._engine(state, lambda: problem)
        if self.waves is not None:
            return self._solve(problem, name, why, partial(self.waves.solve, state.regime)), in_place
        stiff, most = name != "heyoka", problem.max_steps
        if self.demand.engine != "auto" or (stiff and not self.equation_sets.tries_heyoka(state.regime.equations)):
            return self._solve(problem, name, why), in_place

        def anew(engine: str, steps: int, because: str) -> tuple[Trajectory, InPlaceEvents]:
            del self.transitions[noted:]
            self._soon = [*soon]
            events = InPlaceEvents(self.event_iteration, state, t, self.note)
            return self._solve(changed(problem, past_guards=events, max_steps=steps), engine, because), events

        steps = min(most, choice.patience(problem)) if stiff else most
        try:
            return self._solve(changed(problem, max_steps=steps), "heyoka", why), in_place
        except SimulationError as error:
            failed = error
        if isinstance(failed, SeriesError) and not stiff:
            return choice.without_series(anew, failed, most)
        if not stiff or choice.is_driven_back(failed):
            raise failed
        return anew(name, most, why)

    def _solve(
        self, problem: Problem, name: str, why: str, solver: Callable[[Problem], Trajectory] | None = None
    ) -> Trajectory:
        entry, problem = ENGINES[name], tightened_for(problem, name)
        trajectory = choice.solve(problem, name, why)[0] if solver is None else solver(problem)
        if trajectory.caveat:
            warn(trajectory.caveat, AccuracyWarning)
        if not self.engine:
            self.engine, self.why = entry.part_of or name, why
        return trajectory


def tightened_for(problem: Problem, engine: str) -> Problem:
    """The same problem with the tolerance with which an engine follows guards."""
    following = ENGINES[engine].following
    assert following is not None  # noqa: S101 (`EquationSets.engine` refuses others)
    share, loosest = following
    # nearer to rounding than this no engine gets more exact
    tight = max(min(share * problem.rtol, loosest), min(problem.rtol, 1e-14))
    if tight == problem.rtol:
        return problem
    return changed(problem, rtol=tight, atol=problem.atol * (tight / problem.rtol))
