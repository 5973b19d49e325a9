"""The solution of a motion through phases: what was found in each, read as one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import chain, groupby
from operator import attrgetter
from typing import TYPE_CHECKING

import numpy as np

from shaftwork.codegen.array_form.elements import Array, Index
from shaftwork.codegen.model_observer import DenseWaves, Impact, ModelObserver
from shaftwork.codegen.timeline import Timeline
from shaftwork.components.base import Component
from shaftwork.hybrid.hybrid_run import HybridRun, Segment
from shaftwork.hybrid.hybrid_state import Regime, Transition
from shaftwork.hybrid.impacts.impulses import summed
from shaftwork.hybrid.modes.mode_machines import ModeMachine
from shaftwork.results.observer import PhaseRow
from shaftwork.results.solution import Solution

if TYPE_CHECKING:
    from shaftwork.waves.hybrid_waves import WaveRun


def solution(run: HybridRun, name: str) -> Solution:
    """The motion as a whole, to be read."""
    whole = DenseMotion(run) if run.waves is None else _WithWaves(run, run.waves)
    return Solution(
        name=name,
        t=np.concatenate([segment.trajectory.t for segment in run.segments]),
        x=np.concatenate([*_outputs(run, whole)]),
        states=whole.names,
        engine=run.engine,
        why=run.why,
        statistics={"steps": run.steps, "changes": len(run.transitions)},
        dense=whole,
        observer=PhaseObserver(run, whole),
        events=tuple(_events(run.transitions)),
        phases=_table(run),
    )


@dataclass(eq=False)
class DensePhase:
    """A phase as it is read.

    Args:
        regime: its modes and equations.
        instants: at which inputs jump.
        segment: the run of an engine in which it is.
    """

    regime: Regime
    instants: Timeline
    segment: Segment

    @cached_property
    def observer(self) -> ModelObserver:
        """Of the equations."""
        regime = self.regime
        return ModelObserver(regime.form, lambda: regime.bound, self.instants, regime.equations.quantities)

    def stored(self, t: Array, x: Array) -> Array:
        """(k, stores) all that is stored at times (k,) with states (k, n), and behind it what arrives by waves.

        Behind the states there may be clocks, which are left out.
        """
        regime, states = self.regime, len(self.regime.model.states)
        waves = x[:, states : states + len(regime.form.waves)]
        x = x[:, : states + waves.shape[1]]
        stored = regime.stores.of(lambda: regime.bound, self.instants.one_sided(t), x)
        return np.hstack([stored, waves]) if waves.size else stored


class DenseMotion:
    """All phases of a motion, by time, and all that is stored at any time; each is made when it is first read.

    Args:
        run: the motion.
    """

    def __init__(self, run: HybridRun) -> None:
        self._run, self._dense = run, dict[int, DensePhase]()
        self._pairs = [(segment, phase) for segment in run.segments for phase in segment.phases]
        self._starts = np.array([phase.start for _, phase in self._pairs])
        self.names = self._pairs[0][1].regime.stores.names
        """Of all that is stored."""

    def __getitem__(self, number: int) -> DensePhase:
        if number not in self._dense:
            segment, (_, regime) = self._pairs[number]
            instants = self._run.timeline(regime)
            self._dense[number] = DensePhase(regime, instants, segment)
        return self._dense[number]

    @property
    def steps(self) -> Array:
        """Ends of the integration steps."""
        return np.unique(np.concatenate([segment.trajectory.steps for segment in self._run.segments]))

    def numbers(self, t: Array) -> Index:
        """The numbers of the phases at times (k,), of a time between two that of the later one."""
        numbers: Index = np.clip(np.searchsorted(self._starts, t, side="right") - 1, 0, None)
        return numbers

    def groups(self, t: Array) -> Iterator[tuple[DensePhase, Index]]:
        """Of phases in equal modes the first, and the places of the times (k,) in all of them.

        A time between two phases belongs to the later one; of one that is listed twice in a row the first does not.
        """
        numbers = self.numbers(t)
        numbers = numbers - (np.append(t[1:] == t[:-1], False) & (self._starts[numbers] == t) & (numbers > 0))
        alike: dict[Regime, list[int]] = {}
        for number in np.unique(numbers).tolist():
            alike.setdefault(self._pairs[number][1].regime, []).append(number)
        for group in alike.values():
            yield self[group[0]], np.flatnonzero(np.isin(numbers, group))

    def __call__(self, times: Array) -> Array:
        """(k, stores) all that is stored at times (k,), and behind it what arrives by waves."""
        t = np.atleast_1d(np.asarray(times, dtype=float))
        stored = np.empty((t.size, len(self.names) + len(self[0].regime.form.waves)))
        numbers = self.numbers(t)
        for number in np.unique(numbers).tolist():
            places = np.flatnonzero(numbers == number)
            stored[places] = self[number].stored(t[places], self[number].segment.trajectory.dense(t[places]))
        return stored


class _WithWaves(DenseMotion):
    """The same beside travelling waves, which are a motion between the phases too.

    Args:
        run: the motion.
        waves: of it.
    """

    def __init__(self, run: HybridRun, waves: WaveRun) -> None:
        super().__init__(run)
        self.held, self.leaving, self.carried = waves.held, waves.leaving, waves.carried


def _outputs(run: HybridRun, dense: DenseMotion) -> Iterator[Array]:
    """(k, stores) of each segment: all that is stored at its output times, and what arrives by waves."""
    first = 0
    for segment in run.segments:
        t, x, phases = segment.trajectory.t, segment.trajectory.x, len(segment.phases)
        numbers = np.clip(dense.numbers(t), first, first + phases - 1)
        if segment.phases[0].regime.stores.by_loops:  # then they follow alike in all of its phases
            numbers[:] = first
        stored = [dense[k].stored(t[numbers == k], x[numbers == k]) for k in np.unique(numbers).tolist()]
        first += phases
        yield from stored  # times do not fall, and so numbers do not


class PhaseObserver:
    """Recovers every quantity from all that is stored, in each phase by its own equations.

    Args:
        run: the motion.
        dense: its phases.
    """

    def __init__(self, run: HybridRun, dense: DenseMotion) -> None:
        self._run, self._dense, self._names = run, dense, dense.names
        self._last: tuple[Array, Array, tuple[tuple[ModelObserver, Index, Array, Array], ...]] | None = None

    def impacts(self, _dense: DenseWaves) -> tuple[Impact, ...]:
        """Instants at which energy may be given or lost at once."""
        return _impacts(self._run)

    @property
    def _first(self) -> ModelObserver:
        return self._dense[0].observer

    @property
    def units(self) -> Mapping[str, str]:
        """Every quantity that can be read and its unit."""
        return self._first.units

    @property
    def wiring(self) -> Mapping[str, str]:
        """By part, what it is, where it is, and what is no number of it."""
        return self._first.wiring

    def nodes_of(self, name: str) -> tuple[str, ...]:
        """The moving nodes that a torque or speed is of, by its name in `units`; none for other quantities."""
        return self._first.nodes_of(name)

    @property
    def profiles(self) -> Mapping[str, tuple[str, tuple[float, ...]]]:
        """Every quantity that can be read along a part."""
        return self._first.profiles

    def signal(self, name: str, t: Array, x: Array, dense: DenseWaves | None = None) -> Array:
        """(k,) a quantity by its name in `units`."""
        values = np.empty(len(t))
        for observer, places, times, states in self._pieces(t, x):
            values[places] = observer.signal(name, times, states, dense)
        return values

    def profile(self, name: str, t: Array, x: Array, dense: DenseWaves) -> Array:
        """(k, places) a quantity along a part by its name in `profiles`."""
        values = np.empty((len(t), len(self.profiles[name][1])))
        for observer, places, times, states in self._pieces(t, x):
            values[places] = observer.profile(name, times, states, dense)
        return values

    def stored(self, t: Array, x: Array, dense: DenseWaves) -> dict[str, Array]:
        """Stored energy by part."""
        energies: dict[str, Array] = {}
        for observer, places, times, states in self._pieces(t, x):
            _fill(energies, observer.stored(times, states, dense), places, len(t))
        return energies

    def powers(self, t: Array, x: Array) -> tuple[dict[str, Array], dict[str, Array]]:
        """Lost power and supplied power by part."""
        lost: dict[str, Array] = {}
        supplied: dict[str, Array] = {}
        for observer, places, times, states in self._pieces(t, x):
            for totals, powers in zip((lost, supplied), observer.powers(times, states), strict=True):
                _fill(totals, powers, places, len(t))
        return lost, supplied

    def held(self, t: float, x: Array) -> dict[str, float]:  # noqa: ARG002
        """All that is stored, by name, which is what the states (n,) of a motion through phases are."""
        return dict(zip(self._names, x.tolist(), strict=False))  # waves may follow

    def read_at(self, t: float) -> float:
        """When inputs are read at a time in s, as in one phase."""
        return self._at(t).observer.read_at(t)

    def modes_at(self, t: float) -> dict[str, str]:
        """The mode of every machine at a time in s."""
        regime = self._at(t).regime
        return {machine.name: name for machine, name in zip(regime.machines, regime.modes, strict=True)}

    def _at(self, t: float) -> DensePhase:
        return self._dense[int(self._dense.numbers(np.array([t]))[0])]

    def part(self, name: str) -> Component:
        """A component of the network, with the parameter values of this motion."""
        return self._first.part(name)

    def _pieces(self, t: Array, x: Array) -> tuple[tuple[ModelObserver, Index, Array, Array], ...]:
        """By observer the places of times (k,), the times and the states there; the last ones asked for are kept.

        An observer, too, keeps what it has computed for the very arrays that it was given last: of many quantities at
        the same times only the first costs.
        """
        last = self._last
        if last is None or last[0] is not t or last[1] is not x:
            last = self._last = t, x, tuple(self._cut(t, x))
        return last[2]

    def _cut(self, t: Array, x: Array) -> Iterator[tuple[ModelObserver, Index, Array, Array]]:
        names = self._names
        for first, places in self._dense.groups(t):
            columns = [*map(names.index, first.regime.model.states), *range(len(names), x.shape[1])]
            yield first.observer, places, self._sided(first.instants, t, places), x[places][:, columns]

    @staticmethod
    def _sided(instants: Timeline, t: Array, places: Index) -> Array:
        """The times, and where an instant is listed twice and only its first is here, one before it."""
        times = t[places].copy()
        alone = np.append(t[1:] == t[:-1], False)[places] & ~np.isin(places + 1, places)
        for k in np.flatnonzero(alone).tolist():
            times[k] = instants.sides(float(times[k]))[0]
        return times


def _fill(totals: dict[str, Array], values_of: Mapping[str, Array], places: Index, count: int) -> None:
    """Put what is known of parts at some places of `count` times to the rest of it."""
    for name, values in values_of.items():
        totals.setdefault(name, np.zeros(count))[places] = values


def _impacts(run: HybridRun) -> tuple[Impact, ...]:
    """Where speeds may jump: transitions and sources, those of one time in one, with the part that hits or changes."""
    jumps = [jump for jump in run.jumps if jump.given or jump.lost]
    for one in sorted(run.transitions, key=lambda transition: (transition.time, not transition.impact)):
        modes = one.machine.modes
        if one.rebound or one.given or one.lost or modes[one.before].form != modes[one.after].form:
            jumps.append(Impact(one.time, one.machine.part.name, one.given, one.lost))
    by_time: dict[float, Impact] = {}
    for jump in jumps:
        earlier = by_time.get(jump.time, Impact(jump.time, "", {}, {}))
        given, lost = summed((earlier.given, jump.given)), summed((earlier.lost, jump.lost))
        by_time[jump.time] = Impact(jump.time, earlier.part or jump.part, given, lost)
    return tuple(by_time.values())


def _without_detours(transitions: list[Transition]) -> list[Transition]:
    """Transitions of one instant without those by which a machine came back to a mode; but an impact stays."""
    if len(transitions) == 1 or any(transition.impact for transition in transitions):
        return transitions
    direct: list[Transition] = []
    for transition in transitions:
        of_machine = [earlier for earlier in direct if earlier.machine is transition.machine]
        back = next((k for k, earlier in enumerate(of_machine) if earlier.before == transition.after), None)
        if back is None:
            direct.append(transition)
        else:
            direct = [earlier for earlier in direct if earlier not in of_machine[back:]]
    return direct


def _events(transitions: Iterable[Transition]) -> Iterator[tuple[float, str, str, str]]:
    """Transitions in words, without those that lead nowhere: what says the same before and after is none."""

    @cache  # a motion may have thousands of a few kinds
    def in_words(machine: ModeMachine, before: str, after: str, rebound: bool) -> tuple[str, str, str]:  # noqa: FBT001
        return machine.name, machine.modes[before].words, "rebound" if rebound else machine.modes[after].words

    at_once = (_without_detours([*one_time]) for _, one_time in groupby(transitions, attrgetter("time")))
    for transition in chain.from_iterable(at_once):
        name, was, now = in_words(transition.machine, transition.before, transition.after, transition.rebound)
        if was != now:
            yield transition.time, name, was, now


def _table(run: HybridRun) -> tuple[PhaseRow, ...]:
    """The phases in words: those that say the same are one."""
    phases, machines = [phase for segment in run.segments for phase in segment.phases], run.equation_sets.machines
    last = run.demand.span[1]
    by_words: dict[tuple[str, ...], Mapping[str, str]] = {}

    @cache
    def in_words(regime: Regime) -> Mapping[str, str]:
        words = tuple(machine.modes[name].words for machine, name in zip(machines, regime.modes, strict=True))
        return by_words.setdefault(words, dict(zip((machine.name for machine in machines), words, strict=True)))

    rows: list[tuple[float, Mapping[str, str]]] = []
    for phase, end in zip(phases, [*(phase.start for phase in phases[1:]), last], strict=True):
        modes = in_words(phase.regime)
        if end > phase.start and not (rows and rows[-1][1] is modes):
            rows.append((phase.start, modes))
    ends = [*(start for start, _ in rows[1:]), last]
    return tuple(PhaseRow(start, end, modes) for (start, modes), end in zip(rows, ends, strict=True))
