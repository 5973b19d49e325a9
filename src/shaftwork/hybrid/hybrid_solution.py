"""The solution of a motion through phases: what was found in each, read as one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import cache, cached_property, partial
from itertools import chain, groupby
from operator import attrgetter
from typing import TYPE_CHECKING

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.model_observer import Impact, ModelObserver
from shaftwork.hybrid.hybrid_run import HybridRun, Span
from shaftwork.hybrid.hybrid_state import Change, without_detours
from shaftwork.hybrid.impacts.impulses import summed
from shaftwork.hybrid.in_place_events import Phase
from shaftwork.hybrid.modes.mode_equations import ModeEquations
from shaftwork.hybrid.modes.mode_machines import ModeMachine, ModeNames
from shaftwork.hybrid.phase_observer import PhaseObserver, Stretch, Stretches
from shaftwork.results.observer import PhaseRow
from shaftwork.results.solution import Solution

if TYPE_CHECKING:
    from shaftwork.waves.hybrid_waves import WaveRun


def solution(run: HybridRun, name: str) -> Solution:
    """The motion as a whole, to be read."""
    names = run.spans[0].phases[0].assembly.stores.names
    whole = _Whole(run) if run.waves is None else _WithWaves(run, run.waves)
    return Solution(
        name=name,
        t=np.concatenate([span.trajectory.t for span in run.spans]),
        x=np.concatenate([_stored(run, span, names) for span in run.spans]),
        states=names,
        engine=run.engine,
        why=run.why,
        statistics={"steps": run.steps, "changes": len(run.changes)},
        dense=whole,
        observer=PhaseObserver(names, lambda: whole.stretches, lambda: _impacts(run)),
        events=tuple(_events(run.changes)),
        phases=_table(run),
    )


def _stored(run: HybridRun, span: Span, names: tuple[str, ...]) -> Array:
    """(k, stores) all that is stored at the output times of a span, and what arrives by waves."""
    assembly = span.phases[0].assembly
    t, states = span.trajectory.t, span.trajectory.x[:, : _width(assembly)]
    arrived = states[:, len(assembly.model.states) :]
    if not t.size:
        return np.empty((0, len(names) + arrived.shape[1]))
    return np.hstack([_stores(run, span, names, states), arrived])


def _stores(run: HybridRun, span: Span, names: tuple[str, ...], states: Array) -> Array:
    t, first = span.trajectory.t, span.phases[0]
    stores = first.assembly.stores
    if stores.by_loops:
        return stores.of(lambda: first.assembly.bound(first.p), t, states)
    starts = np.array([phase.start for phase in span.phases])
    read_at = run.timeline(first.assembly, first.p).one_sided(t)
    stored = np.empty((t.size, len(names)))
    index = np.clip(np.searchsorted(starts, t, side="right") - 1, 0, None)
    for number in np.unique(index).tolist():
        here = index == number
        phase = span.phases[number]
        stored[here] = stores.of(partial(phase.assembly.bound, phase.p), read_at[here], states[here])
    return stored


def _width(assembly: ModeEquations) -> int:
    """The number of states, and of what arrives by waves behind them."""
    return len(assembly.model.states) + len(assembly.model.form.waves)


class _Whole:
    """All that is stored at any time of a motion; what it needs is made when it is first asked."""

    def __init__(self, run: HybridRun) -> None:
        self._run = run

    @cached_property
    def stretches(self) -> Stretches:
        """The phases as they are read."""
        run = self._run
        pairs = [(span, phase) for span in run.spans for phase in span.phases]
        return Stretches([phase.start for _, phase in pairs], lambda number: _stretch(run, *pairs[number]))

    @property
    def steps(self) -> Array:
        """Ends of the integration steps."""
        return np.unique(np.concatenate([span.trajectory.steps for span in self._run.spans]))

    def __call__(self, times: Array) -> Array:
        return self.stretches.dense(times)


class _WithWaves(_Whole):
    """The same beside travelling waves, which are a motion between the phases too.

    Args:
        run: the motion.
        waves: of it.
    """

    def __init__(self, run: HybridRun, waves: WaveRun) -> None:
        super().__init__(run)
        self.held, self.leaving, self.carried = waves.held, waves.leaving, waves.carried


def _stretch(run: HybridRun, span: Span, phase: Phase) -> Stretch:
    assembly, states = phase.assembly, phase.assembly.model.states
    size, dense = _width(assembly), span.trajectory.dense
    instants = run.timeline(assembly, phase.p)
    bind = partial(assembly.bound, phase.p)
    return Stretch(
        start=phase.start,
        key=(id(assembly), phase.p.tobytes()),
        stores=assembly.stores,
        bind=bind,
        observer=ModelObserver(assembly.model.form, bind, instants, assembly.quantities),
        instants=instants,
        dense=lambda times: dense(times)[:, :size],
        states=states,
        ends=len(assembly.model.form.waves),
        modes=dict(zip((element.name for element in run.phases.elements), phase.modes, strict=True)),
    )


def _impacts(run: HybridRun) -> tuple[Impact, ...]:
    """Changes and sources with which speeds may jump, those of one time in one, with the part that hits or changes."""
    jumps = [jump for jump in run.jumps if jump.given or jump.lost]
    for change in sorted(run.changes, key=lambda change: (change.time, not change.impact)):
        modes = change.element.modes
        if change.rebound or change.given or change.lost or modes[change.before].form != modes[change.after].form:
            jumps.append(Impact(change.time, change.element.part.name, change.given, change.lost))
    by_time: dict[float, Impact] = {}
    for jump in jumps:
        earlier = by_time.get(jump.time, Impact(jump.time, "", {}, {}))
        given, lost = summed((earlier.given, jump.given)), summed((earlier.lost, jump.lost))
        by_time[jump.time] = Impact(jump.time, earlier.part or jump.part, given, lost)
    return tuple(by_time.values())


def _events(changes: Iterable[Change]) -> Iterator[tuple[float, str, str, str]]:
    """Changes in words, without those that lead nowhere: what says the same before and after is none."""

    @cache  # a motion may have thousands of a few kinds
    def in_words(element: ModeMachine, before: str, after: str, rebound: bool) -> tuple[str, str, str]:  # noqa: FBT001
        return element.name, element.modes[before].words, "rebound" if rebound else element.modes[after].words

    at_once = (without_detours([*one_time]) for _, one_time in groupby(changes, attrgetter("time")))
    for time, *change in chain.from_iterable(at_once):
        name, was, now = in_words(*change[:4])
        if was != now:
            yield time, name, was, now


def _table(run: HybridRun) -> tuple[PhaseRow, ...]:
    """The phases in words: those that say the same are one."""
    phases, elements = [phase for span in run.spans for phase in span.phases], run.phases.elements
    last = run.demand.span[1]
    by_words: dict[tuple[str, ...], Mapping[str, str]] = {}

    @cache
    def in_words(modes: ModeNames) -> Mapping[str, str]:
        words = tuple(element.modes[name].words for element, name in zip(elements, modes, strict=True))
        return by_words.setdefault(words, dict(zip((element.name for element in elements), words, strict=True)))

    rows: list[tuple[float, Mapping[str, str]]] = []
    for phase, end in zip(phases, [*(phase.start for phase in phases[1:]), last], strict=True):
        modes = in_words(phase.modes)
        if end > phase.start and not (rows and rows[-1][1] is modes):
            rows.append((phase.start, modes))
    ends = [*(start for start, _ in rows[1:]), last]
    return tuple(PhaseRow(start, end, modes) for (start, modes), end in zip(rows, ends, strict=True))
