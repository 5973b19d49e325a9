"""Past the guards at which only a number in the equations changes: the engine need not stop there."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.hybrid.consistency import CLEAR, clear_of_limit, side_of_limit
from shaftwork.hybrid.event_iteration import EventIteration
from shaftwork.hybrid.hybrid_state import EventOutcome, HybridState, Regime, Transition
from shaftwork.hybrid.modes.mode_machines import ActiveGuard, ModeMachine, is_same, with_modes
from shaftwork.integrate.problem import Reset, SeriesError


class Phase(NamedTuple):
    """A span of time in which no mode changes.

    Args:
        start: s.
        regime: the modes and their equations.
    """

    start: float
    regime: Regime


def _always(_t: float, _state: HybridState) -> bool:
    return True


@dataclass(frozen=True, eq=False)
class InPlaceTransition:
    """By which transition one guard leads to other modes in the same equations, at whatever time.

    Args:
        to: the modes that follow.
        side: on which the guard was met.
        watched: guards and sides of those modes, and whether each must be within its limit there.
        machine, before, after: as of a `Transition`.
        changes_form: whether the machine comes to hold its ends together, or does so no more.
    """

    to: Regime
    side: float
    watched: tuple[tuple[int, float, bool], ...]
    machine: ModeMachine
    before: str
    after: str
    changes_form: bool

    def at(self, t: float) -> Transition:
        """The transition at a time in s."""
        return Transition(t, self.machine, self.before, self.after)


class InPlaceEvents:
    """Lets an engine go on past guards; `Problem.past_guards`.

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
        note: Callable[[float, list[Transition]], None],
        suits: Callable[[float, HybridState], bool] = _always,
    ) -> None:
        self._event_iteration, self._suits = event_iteration, suits
        self.regime, self.bands = state.regime, state.bands
        """The modes that go on, and how far rounding moves each guard."""
        self._note: Callable[[float, list[Transition]], None] | None = note
        self._size = state.x.size
        self.phases = [Phase(start, self.regime)]
        """The phases so far."""
        self._resets: list[Reset] = []
        self._suited: set[Regime] = set()
        self.beyond: EventOutcome | None = None
        """What comes after the last guard, where the engine had to stop for it."""

    def __call__(self, number: int, met: int, t: float, x: Array) -> Reset | None:
        if number < len(self._resets):  # the run is made once more, for its dense output
            return self._resets[number]
        if self.beyond is not None or self._note is None:
            return None
        x = x[: self._size]
        outcome = self._by_this_guard(met, t, x) or self._by_iteration(met, t, x)
        if outcome is None:
            return None
        state, transitions = outcome
        regime = state.regime
        if regime not in self._suited:
            if not self._suits(t, state):
                self.beyond = state._replace(x=state.x.copy()), transitions  # the engine goes on writing into its own
                return None
            self._suited.add(regime)
        self.regime, self.bands = regime, state.bands
        self._note(t, transitions)
        self.phases.append(Phase(t, regime))
        others = None if state.x is x else state.x
        reset = Reset(regime.values, regime.ends, state.bands, regime.right_side, others)
        self._resets.append(reset)
        return reset

    def close(self) -> None:
        """Let go of who is told: the run is over, and only made once more for its dense output.

        Else a motion and its run would refer to each other, and such circles wait for the garbage collector.
        """
        self._note, self._suits = None, _always

    def _by_iteration(self, met: int, t: float, x: Array) -> EventOutcome | None:
        """What the event iteration makes of it, or None where the engine must stop."""
        self.refuse_missed(met, t, x)
        outcome = self._event_iteration.run(t, t, HybridState(self.regime, x, self.bands), met)
        state = outcome[0]
        alike = state.regime.equations.whole is self.regime.equations.whole and is_same(state.x, x)
        if state.x is x or alike:
            return outcome
        self.beyond = outcome  # other equations, or an impact in these
        return None

    def refuse_missed(self, met: int | None, t: float, x: Array, late: float = 1e4) -> None:
        """Fail where another guard has been beyond its limit for longer than rounding of the time explains.

        Args:
            met: the guard at which the engine has stopped, or None.
            t: time, s.
            x: states.
            late: so many times as far as rounding moves the time, a guard may be late that is met with another one.

        Raises:
            SeriesError: the engine has not seen it.
            SimulationError: a law or a guard has no value.
        """
        regime, bands = self.regime, self.bands
        here = regime.course(t, x[: self._size].tolist())
        now, before = here[3], regime.guards_at(*regime.later(here, -late * regime.tick))
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

    def _by_this_guard(self, met: int, t: float, x: Array) -> EventOutcome | None:
        """Where this guard leads by itself, or None where it takes more to tell.

        The same as in `EventIteration`, for the guards of one combination of modes only: it is asked at every event.
        What comes to hold by more than it can gives way at once.
        """
        first = self._transition(self.regime, met)
        if first is None:
            return None
        state, transitions = self._state_after(first, met, t, x), [first.at(t)]
        if isinstance(state, int):
            second = self._transition(first.to, state) if first.changes_form else None
            if second is None or second.machine is not first.machine or not second.changes_form:
                return None
            if second.after == first.before:
                return None
            state, transitions = self._state_after(second, met, t, x), [first.at(t), second.at(t)]
        return None if state is None or isinstance(state, int) else (state, transitions)

    def _state_after(self, transition: InPlaceTransition, met: int, t: float, x: Array) -> HybridState | int | None:
        """The state in the modes that follow; or the number of a guard that is beyond its limit there; None where it
        takes more to tell.
        """
        to, wide, side = transition.to, self.bands, transition.side
        states = to.equations.states_held(x, to.p) if transition.changes_form else x
        if states is None:  # what comes to hold stops something
            return None
        now, near, later = to.near(t, states.tolist(), to.tick, to.moves, to.longest)
        bands = [0.0] * len(now)
        for guard, end, must_be_within in transition.watched:
            excess, band = end * now[guard], abs(near[guard] - now[guard])
            # nearly all guards are far from their limits, and a call for each would show at every event
            if must_be_within and (excess >= -band or excess >= -wide[guard]):
                return guard if side_of_limit(excess, max(band, wide[guard])) > 0 else None
            bands[guard] = clear_of_limit(excess, band)
        # a machine that neither comes to hold nor gives way must leave its guard behind for good
        if not transition.changes_form and (side * now[met] < 0 or not side * (later[met] - now[met]) > 0):
            return None
        return HybridState(to, states, bands)

    def _transition(self, regime: Regime, met: int) -> InPlaceTransition | None:
        """The transition to which a guard leads by itself in the same equations, or None where there is none."""
        try:
            transition: InPlaceTransition | None = regime.in_place[met]
        except KeyError:
            transition = regime.in_place.setdefault(met, self._first_met(regime, met))
        return transition

    def _first_met(self, regime: Regime, met: int) -> InPlaceTransition | None:
        crossed, *others = (active for active in regime.watched if active.guard == met)
        number = crossed.machine
        machine, leave, before = regime.machines[number], crossed.leave, regime.modes[number]
        if others or not leave.to or leave.rebound is not None:
            return None
        changes_form = machine.modes[leave.to].form != machine.modes[before].form
        if changes_form and not regime.equations.holds_by_numbers(number):
            return None
        to = self._event_iteration.transfer.regime(with_modes(regime.modes, {number: leave.to}))
        watched = tuple((one.guard, one.side, _tells(crossed, one, changes_form=changes_form)) for one in to.watched)
        return InPlaceTransition(to, crossed.side, watched, machine, before, leave.to, changes_form)


def _tells(crossed: ActiveGuard, active: ActiveGuard, *, changes_form: bool) -> bool:
    """Whether a guard must be within its limit where another one has led to its mode: it is not the same one.

    What gives way is at rest, and about to move as the torque that it has met grows.
    """
    if changes_form:
        return active.machine != crossed.machine or not active.leave.by_speed
    return active.guard != crossed.guard or active.side == crossed.side
