"""Which modes go on at an instant: one changes after another until all are consistent with the motion that follows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import islice
from types import MappingProxyType

from shaftwork.codegen.array_form.elements import Array
from shaftwork.core.errors import NetworkError, SimulationError
from shaftwork.hybrid.commutation import Commutation
from shaftwork.hybrid.equation_sets import EquationSets
from shaftwork.hybrid.hybrid_state import (
    EventOutcome,
    HybridState,
    Transition,
    differences,
    exceeded,
    passes_limit,
    resting,
)
from shaftwork.hybrid.hybrid_transfer import HybridTransfer, mode_anew, refuse_beyond
from shaftwork.hybrid.impacts.impacts import Impacts
from shaftwork.hybrid.modes.mode_equations import ModeEquations
from shaftwork.hybrid.modes.mode_machines import ActiveGuard, ModeNames, limited, with_modes


class EventIteration:
    """Changes modes at an instant.

    Args:
        equation_sets: the sets of equations.
        values: parameters that differ from the network's.
        span: start and end of the run, s.
        equations: for a combination of modes; by default each has its own, as an analysis reads them.
    """

    def __init__(
        self,
        equation_sets: EquationSets,
        values: Mapping[str, float],
        span: tuple[float, float],
        equations: Callable[[ModeNames], ModeEquations] | None = None,
    ) -> None:
        self.machines = equation_sets.machines
        self.transfer = HybridTransfer(equation_sets, values, span, equations or equation_sets.of)
        self._together = equation_sets.netlist.impacts == "together"

    @cached_property
    def impacts(self) -> Impacts:
        """What happens where speeds change at once."""
        return Impacts(self.transfer, together=self._together)

    @cached_property
    def _commutation(self) -> Commutation:
        return Commutation(self.transfer)

    def in_start_modes(self, t: float, x: Array, rigid: Mapping[int, str] = MappingProxyType({})) -> HybridState:
        """The modes in which a motion starts, from the states of the equations in which no machine is rigid.

        A machine that nothing else lets start in its mode, as a friction that a prescribed speed is about to turn,
        starts in one to which that mode leads.

        Args:
            t: time in s at which inputs are read.
            x: (n,) states.
            rigid: machines that are rigid in these equations all the same, and the modes in which they are.

        Raises:
            ParameterError: a twist lies beyond a rigid limit.
        """
        loose = HybridState(self.transfer.regime(with_modes(self.transfer.first, rigid)), x)
        refuse_beyond(loose, t)
        regime, modes = loose.regime, loose.regime.modes
        wanted = with_modes(regime.equations.first_modes(t, x, regime.p), rigid)
        if self.transfer.possible(wanted):
            return self.transfer.to_modes(loose, t, wanted)
        # of switches the time tells, so that others give way
        for k in sorted(range(len(wanted)), key=lambda k: not self.machines[k].is_switch):
            leaves = (leave for leave in self.machines[k].modes[wanted[k]].leaves if not leave.by_time)
            names = (wanted[k], *(leave.to for leave in leaves if leave.to))
            options = (with_modes(modes, {k: name}) for name in names)
            modes = next(filter(self.transfer.possible, options), modes)
        return self.transfer.to_modes(loose, t, modes)

    def started(self, t: float, x: Array) -> HybridState:
        """The modes that go on where a motion starts at a time in s with states (n,), as in `in_start_modes`."""
        return self.run(t, t, self.in_start_modes(t, x), None)[0]

    def run(self, t: float, after: float, state: HybridState, met: int | None) -> EventOutcome:
        """The hybrid state that goes on, and the transitions that lead there.

        Args:
            t: the instant, s.
            after: a time just after it, s, at which inputs are read.
            state: what was before.
            met: the guard that ended the phase, or None.

        Raises:
            SimulationError: no modes are consistent; names the pair between which a machine changes for ever.
        """
        ends = met is not None or passes_limit(state._replace(bands=()), after)
        holding = resting(state, after) if ends else {}
        if not holding:
            return self._fewest(t, after, state, met)
        # All parts that hold are decided together, from rest. To follow the guard that was met alone could end in a
        # mode in which nothing moves: of two frictions one has given way at rest, and now the other one does, backward.
        # With that motion the first one has less torque than it holds at rest, and would move forward, which the other
        # one bars.
        modes = state.regime.modes
        stuck = self.transfer.to_modes(state, after, with_modes(modes, self.transfer.compatible(modes, holding)))
        new, transitions = self._consistent(t, after, stuck, None)
        if new.regime.modes == modes:  # rounding hides what was met
            crossed = [(active.machine, active.leave) for active in state.regime.watched if active.guard == met]
            same = (active.guard for active in stuck.regime.watched if (active.machine, active.leave) in crossed)
            new, transitions = self._fewest(t, after, stuck, next(same, None))
        return new, _together([*differences(t, self.machines, modes, stuck.regime.modes), *transitions])

    def _fewest(self, t: float, after: float, state: HybridState, met: int | None) -> EventOutcome:
        """The outcome with the fewest transitions, of those in which another one of the guards met goes first.

        Of several guards that are met at one instant, rounding decides which one the engine reports. Two contacts in a
        row that carry the same torque, for example, reach zero together; one of them opens, and the other one stays.
        """
        if met is None:
            return self._consistent(t, after, state, None)
        named = next(active for active in state.regime.watched if active.guard == met)
        outcomes: list[EventOutcome] = []
        failed: list[SimulationError] = []
        met_at_once = self._at_once(state, after, named)
        # an angle waits for nothing
        least = max(1, len({active.machine for active in met_at_once if active.leave.by_twist}))
        for first in met_at_once:
            try:
                outcomes.append(self._consistent(t, after, state, first))
            except SimulationError as error:
                failed.append(error)
            else:
                transitions = outcomes[-1][1]
                if len(transitions) == 1 or (len(transitions) == least and not any(one.impact for one in transitions)):
                    break  # none can be fewer
        if not outcomes:
            raise failed[0]
        return min(outcomes, key=lambda outcome: len(outcome[1]))

    def _at_once(self, state: HybridState, t: float, named: ActiveGuard) -> list[ActiveGuard]:
        """The guards that are met at the instant at which one is, in the order of their machines."""
        met = [active for _, active in exceeded(state, t, state, in_order=True)[1]]
        if named not in met and (not named.leave.by_torque or all(active.leave.by_torque for active in met)):
            met.append(named)
        return sorted(met, key=state.regime.watched.index)

    def _consistent(
        self,
        t: float,
        after: float,
        state: HybridState,
        first: ActiveGuard | None,
        most_transitions: int = 2000,
        most_returns: int = 2,
    ) -> EventOutcome:
        """Modes that are consistent with the motion that follows, by one transition after another; see `run`.

        Args:
            t, after, state: as there.
            first: the guard to begin with, or None.
            most_transitions: so many have no end: those of two rigid flanks without a gap between them, say.
            most_returns: so often modes may come back. After the first time guards are taken in their order, which
                nearly always ends.
        """
        transitions: list[Transition] = []
        idle: list[ActiveGuard] = []
        seen: dict[ModeNames, None] = {}
        blocked, repeats, late = None, 0, 0.0
        tried: Counter[tuple[ModeNames, int]] = Counter()  # other modes than what contradicts, each of them once
        # a guard is met where it is beyond zero by its band, which then still is the band of what is the same after it
        before = state
        worst = first
        if worst is None:
            state, worst = _worst(state, after, before, idle, repeats)
        while worst is not None:
            here = state.regime.modes, worst.machine
            state, latest, contradiction, since = self._follow(t, after, state, worst, tried[here])
            late += since
            transitions, blocked = [*transitions, *latest], contradiction or blocked
            if contradiction is not None:
                tried[here] += 1
                if tried[here] > 1:
                    seen.clear()
            impact = bool(latest) and latest[0].impact
            again = bool(latest) and not impact and state.regime.modes in seen
            repeats += again
            if len(transitions) > most_transitions or repeats > most_returns:
                raise _endless(t, transitions, blocked)
            if again or impact:
                seen.clear()
            if impact:
                tried.clear()  # what contradicted others need not do so at other speeds
            idle = [] if latest else [*idle, worst]
            seen[state.regime.modes] = None
            state, worst = _worst(state, after, before, idle, repeats)
            if worst is None and late:  # on from where it was hit, in the modes that go on, if nothing stops it
                later, late = state.moved(after, late), 0.0
                if not passes_limit(later, after):
                    state, worst = _worst(later, after, before, idle, repeats)
        return state, transitions

    def _follow(
        self, t: float, after: float, state: HybridState, crossed: ActiveGuard, tried: int
    ) -> tuple[HybridState, list[Transition], NetworkError | None, float]:
        """The mode of a machine changes, or what hits is thrown back; what kept it from what it wanted, and how long
        ago, in s, it was hit. Of the other modes instead of what contradicts, some have been tried.
        """
        number, leave, regime = crossed.machine, crossed.leave, state.regime
        machine = self.machines[number]
        before = regime.modes[number]
        to = leave.to or mode_anew(state, after, number)
        if machine.is_switch and (switched := self._commutation.switched(t, after, state, number, to)):
            return *switched, None, 0.0
        speed = self.impacts.meets(state, after, machine.modes[to], number)
        slips = next((name for side, name in machine.modes[to].gives_way if side * speed > 0), "")
        if slips == before:  # it was met by rounding alone: it is moving away
            return state, [], None, 0.0
        if slips:  # its torque is limited, so it takes no speed away at once
            to, speed = slips, 0.0
        try:
            if speed or (leave.rebound is not None and not slips):
                hit = self.impacts.hit(t, after, state, replace(crossed, leave=replace(leave, to=to)))
                return *hit[:2], None, hit[2]
            return *self._commutation.commutated(t, after, state, {number: to}), None, 0.0
        except NetworkError as error:
            return *self._instead(t, after, state, (number, to), error, tried), error, 0.0

    def _instead(
        self, t: float, after: float, state: HybridState, wanted: tuple[int, str], error: NetworkError, tried: int
    ) -> EventOutcome:
        """Past a mode whose equations contradict others: into one to which it leads, or something else gives way.

        A friction that a prescribed speed turns cannot stick: it passes from slipping one way to slipping the other.
        """
        modes, (number, to) = state.regime.modes, wanted
        machine, before = self.machines[number], modes[number]
        gears = self.impacts.gears
        if number in gears and (other := self._passing_on(after, state, number, to)) is not None:
            return other[0], [Transition(t, machine, before, other[1])]
        leads = (leave for leave in machine.modes[to].leaves if leave.to not in ("", before))
        # neither the other flank nor a time to come is there
        leads_on = [{number: leave.to} for leave in leads if leave.rebound is None and not leave.by_twist]
        sides = limited(self.machines, modes).items()
        yields = [{number: to, k: name} for k, gives_way in sides for _, name in gives_way if k != number]
        # a gear jams only where nothing beside it gives way
        options = [*yields, *leads_on] if number in gears else [*leads_on, *yields]
        for k in gears:
            options += [{number: to, k: leave.to} for leave in self.machines[k].modes[modes[k]].leaves if k != number]
        combinations = filter(self.transfer.possible, (with_modes(modes, option) for option in options))
        for combination in islice(combinations, tried, None):
            try:
                new = self.impacts.jammed(after, state, self.transfer.to_modes(state, after, combination))
            except NetworkError:  # what slips behind the gear lets another one jam
                continue
            return new, differences(t, self.machines, modes, new.regime.modes)
        raise SimulationError(
            f"'{machine.name}' can neither stay {machine.modes[before].words} nor become {machine.modes[to].words} "
            f"at t = {t:.9g} s. {error.problems[0]}"
        ) from error

    def _passing_on(self, t: float, state: HybridState, number: int, to: str) -> tuple[HybridState, str] | None:
        """Another mode of a gear at rest, and what follows, that contradicts nothing and leaves all else as it is."""
        modes, options = state.regime.modes, self.machines[number].modes
        if state.across(number, t) != 0:
            return None
        stored = state.stored(t)
        leads = [leave.to for name in (to, modes[number]) for leave in options[name].leaves]
        for name in dict.fromkeys(leads):
            combination = with_modes(modes, {number: name})
            if name in (to, modes[number]) or not self.transfer.possible(combination):
                continue
            new = self.transfer.to_modes(state, t, combination)
            if new.stored(t) == stored and not exceeded(new, t, new)[1]:
                return new, name
        return None


def _worst(
    state: HybridState, t: float, before: HybridState, idle: Sequence[ActiveGuard], repeats: int
) -> tuple[HybridState, ActiveGuard | None]:
    """The guard that is farthest beyond its limit, or on it and about to go beyond; the hybrid state with its bands.

    Args:
        state, t, before, idle: as in `exceeded`.
        repeats: how often modes have come back. After the first time the first guard is taken. The worst leads faster
            to modes that are consistent, as a rule; but this always does where parts hold each other (Murty, Linear
            Complementarity, 1988, section 4.1).
    """
    in_order = repeats > 0
    state, excesses = exceeded(state, t, before, idle, in_order=in_order, again=in_order)
    if not excesses:
        return state, None
    first = min(excesses, key=lambda one: one[1].machine) if in_order else max(excesses, key=lambda one: one[0])
    return state, first[1]


def _endless(t: float, transitions: list[Transition], blocked: NetworkError | None) -> SimulationError:
    """The error of transitions within one instant that come to no end, or of what contradicts what among them."""
    last = transitions[-1]
    others = dict.fromkeys(transition.machine.name for transition in transitions)
    before, after = (last.machine.modes[name].words for name in (last.before, last.after))
    if blocked is not None:
        advice = str(blocked.problems[0])
    elif last.rebound:
        after, advice = "rebound", "Take a restitution below 1, a larger omega_rest, or a gap between its limits."
    else:
        advice = (
            "Give the node between them an inertia or damping. Of a part of your own, no mode may end at once where "
            "another one leads into it: the limit that ends holding lies above the torque at which it begins."
        )
    return SimulationError(
        f"At t = {t:.9g} s no modes of {', '.join(others)} are consistent: '{last.machine.name}' changes for ever "
        f"between {before} and {after}. {advice}"
    )


def _together(transitions: list[Transition]) -> list[Transition]:
    """The transitions of one instant, with those of each machine in one; but an impact stays apart."""
    if any(transition.impact for transition in transitions):
        return transitions
    by_machine: dict[int, Transition] = {}
    for transition in transitions:
        earlier = by_machine.get(id(transition.machine), transition)
        by_machine[id(transition.machine)] = transition._replace(before=earlier.before)
    return [transition for transition in by_machine.values() if transition.before != transition.after]
