"""Past the guards at which only a number in the equations changes: the engine need not stop there."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.hybrid.consistency import CLEAR, clear_of_limit, side_of_limit
from shaftwork.hybrid.event_iteration import EventIteration
from shaftwork.hybrid.hybrid_state import Change, HybridState, Regime, Transition
from shaftwork.hybrid.modes.mode_machines import ActiveGuard, ModeMachine, is_same, with_modes
from shaftwork.integrate.problem import Reaction, SeriesError

LATE = 1e4
"""Of so many roundings of the time a guard may be late that is met together with another one."""


class Phase(NamedTuple):
    """A span of time in which no mode changes.

    Args:
        start: s.
        regime: the modes and their equations.
    """

    start: float
    regime: Regime


Successor = tuple[Regime, Sequence[float], list[Change], Array | None]
"""The modes that follow, how far rounding moves their guards, the changes that lead there, and the states if other."""

Entry = tuple[Sequence[float], Sequence[float], list[float], Array | None]
"""Guards at an instant and later, how far beyond zero each is met, and the states if they are other ones."""


def _always(_t: float, _state: HybridState) -> bool:
    return True


@dataclass(frozen=True, eq=False)
class ModeChange:
    """From one combination of modes to another in the same equations, by one guard.

    Args:
        to: the modes that follow.
        side: on which the guard was met.
        watched: guards and sides of those modes, and whether each must be within its limit there.
        change: its machine, and the modes before and after.
        holds: whether the machine comes to hold its ends together, or does so no more.
    """

    to: Regime
    side: float
    watched: tuple[tuple[int, float, bool], ...]
    change: tuple[ModeMachine, str, str]
    holds: bool


class InPlaceEvents:
    """Lets an engine go on past guards; `Problem.react`.

    A change that leaves all other modes as they are is looked up and checked here; the event iteration makes any other.

    Args:
        event_iteration: of all other changes.
        state: at the start of the engine's run.
        start: s.
        note: is told what has changed.
        suits: whether the engine goes on well from a time on.
    """

    def __init__(
        self,
        event_iteration: EventIteration,
        state: HybridState,
        start: float,
        note: Callable[[float, list[Change]], None],
        suits: Callable[[float, HybridState], bool] = _always,
    ) -> None:
        self._event_iteration, self._suits = event_iteration, suits
        self.regime, self.bands = state.regime, state.bands
        """The modes that go on, and how far rounding moves each guard."""
        self._note: Callable[[float, list[Change]], None] | None = note
        self._size = state.x.size
        self.phases = [Phase(start, self.regime)]
        """The phases so far."""
        self._reactions: list[Reaction] = []
        self._suited: set[Regime] = set()
        self.beyond: Transition | None = None
        """What comes after the last guard, where the engine had to stop for it."""

    def __call__(self, number: int, met: int, t: float, x: Array) -> Reaction | None:
        if number < len(self._reactions):  # the run is made once more, for its dense output
            return self._reactions[number]
        if self.beyond is not None or self._note is None:
            return None
        successor = self._by_this_guard(met, t, x) or self._by_iteration(met, t, x)
        if successor is None:
            return None
        regime, bands, changes, y = successor
        if regime not in self._suited:
            state = HybridState(regime, x[: self._size].copy() if y is None else y, bands)
            if not self._suits(t, state):
                self.beyond = state, changes
                return None
            self._suited.add(regime)
        self.regime, self.bands = regime, bands
        self._note(t, changes)
        self.phases.append(Phase(t, regime))
        reaction = Reaction(regime.values, regime.ends, bands, regime.right_side, y)
        self._reactions.append(reaction)
        return reaction

    def close(self) -> None:
        """Let go of who is told: the run is over, and only made once more for its dense output.

        Else a motion and its run would refer to each other, and such circles wait for the garbage collector.
        """
        self._note, self._suits = None, _always

    def _by_iteration(self, met: int, t: float, x: Array) -> Successor | None:
        before = HybridState(self.regime, x[: self._size].copy(), self.bands)
        self.refuse_missed(met, t, x)
        state, changes = self._event_iteration.run(t, t, before, met)
        if state.x is before.x:
            return state.regime, state.bands, changes, None
        if state.regime.equations.whole is self.regime.equations.whole and is_same(state.x, before.x):
            return state.regime, state.bands, changes, state.x
        self.beyond = state, changes  # other equations, or an impact in these
        return None

    def refuse_missed(self, met: int | None, t: float, x: Array) -> None:
        """Fail where another guard has been beyond its limit for longer than rounding of the time explains.

        Raises:
            SeriesError: the engine has not seen it.
            SimulationError: a law or a guard has no value.
        """
        regime, bands = self.regime, self.bands
        here = regime.course(t, x[: self._size].tolist())
        now, before = here[3], regime.limits(*regime.later(here, -LATE * regime.tick))
        if any(map(math.isnan, now)):
            error = regime.equations.without_value(regime.p, regime.modes, np.array([t]), np.array([here[1]]))
            if error is not None:
                raise error
        for active in regime.watched:
            k, side = active.guard, active.side
            if k != met and min(side * now[k], side * before[k]) > CLEAR * bands[k]:
                name, mode = regime.machines[active.machine].name, regime.mode(active.machine)
                words = f"'{name}' ceased to be {mode.words} before t = {t:.9g} s"
                cause = f"{words}, and the series of heyoka have not shown it"
                raise SeriesError(f"The heyoka engine has not seen that {words}. Take engine='scipy'.", cause)

    def _by_this_guard(self, met: int, t: float, x: Array) -> Successor | None:
        """The modes that follow by this guard alone, or None where it takes more to tell.

        The same as in `EventIteration`, for the guards of one combination of modes only: it is asked at every change.
        What comes to hold by more than it can gives way at once.
        """
        step = self._successor(self.regime, met)
        if step is None:
            return None
        entry, changes = self._entered(step, t, x), [Change(t, *step.change)]
        if isinstance(entry, int):
            machine, before, _ = step.change
            step = self._successor(step.to, entry) if step.holds else None
            if step is None or step.change[0] is not machine or not step.holds or step.change[2] == before:
                return None
            entry, changes = self._entered(step, t, x), [*changes, Change(t, *step.change)]
        if entry is None or isinstance(entry, int):
            return None
        now, later, bands, y = entry
        # it is left behind for good
        if not step.holds and (step.side * now[met] < 0 or not step.side * (later[met] - now[met]) > 0):
            return None
        return step.to, bands, changes, y

    def _entered(self, step: ModeChange, t: float, x: Array) -> Entry | int | None:
        """Guards now and later and their bands in the modes of a step, with the states where they are others; or the
        number of one that is beyond its limit; None where it takes more to tell.
        """
        to, before, y = step.to, self.bands, None
        if step.holds:
            y = to.equations.taking_over(x[: self._size], to.p)
            if y is None:  # what comes to hold stops something
                return None
        states = (x if y is None else y).tolist()[: self._size]
        now, near, later = to.near(t, states, to.tick, to.moves, to.longest)
        bands = [0.0] * len(now)
        for guard, side, other in step.watched:
            excess, band = side * now[guard], abs(near[guard] - now[guard])
            # nearly all guards are far from their limits, and a call for each would show at every event
            if other and (excess >= -band or excess >= -before[guard]):
                return guard if side_of_limit(excess, max(band, before[guard])) > 0 else None
            bands[guard] = clear_of_limit(excess, band)
        return now, later, bands, y

    def _successor(self, regime: Regime, met: int) -> ModeChange | None:
        """Where a guard leads in the same equations."""
        try:
            change: ModeChange | None = regime.successors[met]
        except KeyError:
            change = regime.successors.setdefault(met, self._change_by(regime, met))
        return change

    def _change_by(self, regime: Regime, met: int) -> ModeChange | None:
        ended, *others = (active for active in regime.watched if active.guard == met)
        number = ended.machine
        machine, leave, before = regime.machines[number], ended.leave, regime.modes[number]
        if others or not leave.to or leave.rebound is not None:
            return None
        holds = machine.modes[leave.to].form != machine.modes[before].form
        if holds and not regime.equations.holds_by_numbers(number):
            return None
        to = self._event_iteration.transfer.regime(with_modes(regime.modes, {number: leave.to}))
        watched = tuple((one.guard, one.side, _tells(ended, one, holds=holds)) for one in to.watched)
        return ModeChange(to, ended.side, watched, (machine, before, leave.to), holds)


def _tells(ended: ActiveGuard, active: ActiveGuard, *, holds: bool) -> bool:
    """Whether a guard must be within its limit where another one has led to its mode: it is not the same one.

    What gives way is at rest, and about to move as the torque that it has met grows.
    """
    if holds:
        return active.machine != ended.machine or not active.leave.by_speed
    return active.guard != ended.guard or active.side == ended.side
