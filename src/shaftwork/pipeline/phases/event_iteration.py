"""Which modes go on at an instant: one changes after another until all are consistent with the motion that follows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from types import MappingProxyType
from typing import TYPE_CHECKING

from shaftwork.codegen.elements import Array
from shaftwork.core.errors import NetworkError, SimulationError
from shaftwork.pipeline.phases.commutation import Commutation, by_time, is_switch
from shaftwork.pipeline.phases.courses import Way, chosen, endless, leaving
from shaftwork.pipeline.phases.hybrid_state import Change, HybridState, Transition, clear_of_limits, together
from shaftwork.pipeline.phases.impacts import Impacts
from shaftwork.pipeline.phases.mode_machines import ActiveGuard, ModeNames
from shaftwork.pipeline.phases.regimes import Regimes, anew, refuse_beyond, with_modes

if TYPE_CHECKING:
    from shaftwork.pipeline.phases.assemblies import ModeEquations
    from shaftwork.pipeline.phases.phases import Phases

# So many changes within one instant have no end: of two rigid flanks without a gap between them, say.
MOST_AT_ONCE = 2000
MOST_REPEATS = 2
# A guard that is farther from its limit than this many times what it is met by is not met now.
NEAR = 64


class EventIteration:
    """Changes modes at an instant.

    Args:
        phases: the sets of equations.
        values: parameters that differ from the network's.
        span: start and end of the run, s.
        equations: for a combination of modes; by default each has its own, as an analysis reads them.
    """

    def __init__(
        self,
        phases: Phases,
        values: Mapping[str, float],
        span: tuple[float, float],
        equations: Callable[[ModeNames], ModeEquations] | None = None,
    ) -> None:
        self._phases, self.elements = phases, phases.elements
        self._regimes = Regimes(phases, values, span, equations or phases.assembly)
        self.regime, self.held, self.resumed = self._regimes.regime, self._regimes.held, self._regimes.resumed
        self._impacts = Impacts(self._regimes, self.elements, together=phases.netlist.impacts == "together")
        self._commutation = Commutation(self._regimes, self.elements, self._beyond)
        self.jumped, self.possible = self._impacts.jumped, self._regimes.possible

    def started(self, t: float, x: Array, joins: Mapping[int, str] = MappingProxyType({})) -> HybridState:
        """The modes in which a motion starts, from the states of the equations in which no mode joins anything.

        An element that nothing else lets start in its mode, as a friction that a prescribed speed is about to turn,
        starts in one to which that mode leads.

        Args:
            t: time in s at which inputs are read.
            x: (n,) states.
            joins: elements that do join something in these equations, and the modes in which they do.

        Raises:
            ParameterError: a twist lies beyond a rigid limit.
        """
        loose = self.regime(with_modes(self._phases.first, joins))
        refuse_beyond(loose, self.elements, t, x)
        modes, wanted = loose.modes, with_modes(loose.assembly.first_modes(t, x, loose.p), joins)
        if self._regimes.possible(wanted):
            modes = wanted
        else:  # of switches the time tells, so that others give way
            for k in sorted(range(len(wanted)), key=lambda k: not is_switch(self.elements[k].modes)):
                leaves = (leave for leave in self.elements[k].modes[wanted[k]].leaves if not by_time(leave))
                names = (wanted[k], *(leave.to for leave in leaves if leave.to))
                options = (with_modes(modes, {k: name}) for name in names)
                modes = next(filter(self._regimes.possible, options), modes)
        return self._regimes.changed(HybridState(loose, x), t, modes)

    def ends(self, moment: HybridState, t: float, x: Array) -> bool:
        """Whether states are beyond a guard of the modes of a moment."""
        now = moment.regime.limits(t, x.tolist())
        wide = moment.bands or [0.0] * len(now)
        return any(made.side * now[made.guard] > wide[made.guard] for _, made in moment.regime.watched)

    def settle(self, t: float, after: float, moment: HybridState, met: int | None) -> Transition:
        """The modes that go on, and the changes that lead there.

        Args:
            t: the instant, s.
            after: a time just after it, s, at which inputs are read.
            moment: what was before.
            met: the guard that ended the phase, or None.

        Raises:
            SimulationError: no modes are consistent; names the pair that changes for ever.
        """
        before = moment.regime
        ends = met is not None or self.ends(moment._replace(bands=()), after, moment.x)
        resting = self._resting(moment, after) if ends else {}
        if not resting:
            return self._settled(t, after, moment, met)
        # Who carries is told anew. A law that falls at once would tell a way in which nothing moves: of two frictions
        # one has given way at rest, and now the other one does, backward. Once it moves, the first one has less torque
        # than it holds at rest, and would move forward instead, which the other one does not let it.
        joined, begun = self._joined(t, after, moment, resting)
        new, changes = self._settled(t, after, joined, None)
        if new.regime.modes == before.modes:  # rounding hides what was met
            leaves = [(k, watched.leave) for k, watched in before.watched if watched.guard == met]
            same = (watched.guard for k, watched in joined.regime.watched if (k, watched.leave) in leaves)
            new, changes = self._settled(t, after, joined, next(same, None))
        return new, together([*begun, *changes])

    def _settled(self, t: float, after: float, moment: HybridState, met: int | None) -> Transition:
        """The same where nothing rests by now; what does so then is joined, in the order of the network."""
        new, changes = self._fewest(t, after, moment, met)
        resting = self._resting(new, after) if changes else {}
        if not resting:
            return new, changes
        try:  # joined all at once: what was slipping a change ago must not tell who carries
            joined, at_once = self._joined(t, after, new, resting)
            held, further = self._consistent(t, after, joined, None)
        except (NetworkError, SimulationError):
            return new, changes
        # back where it came from: a limit has just been exceeded there
        if held.regime.modes == moment.regime.modes or any(one.impact for one in further):
            return new, changes
        if held.regime.modes == new.regime.modes:
            return new, together(changes) or changes
        return held, together([*changes, *at_once, *further])

    def _joined(self, t: float, after: float, moment: HybridState, joins: Mapping[int, str]) -> Transition:
        """The same instant with elements in modes in which they hold, and the changes to these."""
        modes, held = moment.regime.modes, self._regimes.joinable(moment.regime.modes, joins)
        changes = [Change(t, self.elements[k], modes[k], name) for k, name in held.items()]
        return self._regimes.changed(moment, after, with_modes(modes, held)), changes

    def _resting(self, moment: HybridState, t: float) -> dict[int, str]:
        """Elements that slip, with no speed across them as others hold their ends, and the modes in which they hold."""
        regime, found = moment.regime, {}
        for k, made in regime.watched:
            modes, name = self.elements[k].modes, regime.modes[k]
            if made.leave.to and any(back.by_torque and back.to == name for back in modes[made.leave.to].leaves):
                found[k] = made
        if not found:
            return {}
        here = moment.course(t)
        now, near = here[3], regime.limits(*regime.beside(here))
        still = regime.assembly.resting
        return {
            k: made.leave.to
            for k, made in found.items()
            if (k in still and made.leave.by_speed) or now[made.guard] == near[made.guard] == 0.0
        }

    def _fewest(self, t: float, after: float, moment: HybridState, met: int | None) -> Transition:
        """Of several guards that are met at one instant, rounding tells which of them ends the phase.

        So each is followed first, and the fewest changes are taken: two flanks that one torque has pressed together
        part where they have to, and not at both.
        """
        if met is None:
            return self._consistent(t, after, moment, None)
        named = next(pair for pair in moment.regime.watched if pair[1].guard == met)
        found: list[Transition] = []
        failed: list[SimulationError] = []
        ways = self._at_once(moment, after, named)
        least = max(1, len({number for number, made in ways if made.leave.by_twist}))  # an angle waits for nothing
        for first in ways:
            try:
                found.append(self._consistent(t, after, moment, first))
            except SimulationError as error:
                failed.append(error)
            else:
                changes = found[-1][1]
                if len(changes) == 1 or (len(changes) == least and not any(one.impact for one in changes)):
                    break  # none can be fewer
        if not found:
            raise failed[0]
        return min(found, key=lambda made: len(made[1]))

    def _at_once(self, moment: HybridState, t: float, named: Way) -> list[Way]:
        """The guards that are met at the instant at which one is, in the order of their elements."""
        regime, others = moment.regime, [pair for pair in moment.regime.watched if pair is not named]
        now, bands = regime.limits(t, moment.x.tolist()), moment.bands
        if bands and all(made.side * now[made.guard] < -NEAR * bands[made.guard] for _, made in others):
            return [named]
        ways = [pair for _, pair in self._exceeded(moment, t, moment, (), in_order=True, again=False)[1]]
        if named not in ways and (not named[1].leave.by_torque or all(pair[1].leave.by_torque for pair in ways)):
            ways.append(named)
        return sorted(ways, key=moment.regime.watched.index)

    def _consistent(self, t: float, after: float, moment: HybridState, first: Way | None) -> Transition:
        """Modes that are consistent with the motion that follows, by one change after another; see `settle`.

        Args:
            t, after, moment: as there.
            first: the element and the guard to begin with, or None.
        """
        changes: list[Change] = []
        still: list[Way] = []
        seen: dict[ModeNames, None] = {}
        blocked, repeats, passed = None, 0, 0.0
        tried: Counter[tuple[ModeNames, int]] = Counter()  # ways round what contradicts others, each of them once
        # a guard is met where it is beyond zero by its band, which then still is the band of what is the same after it
        ended = moment
        exceeded = first
        if exceeded is None:
            moment, exceeded = self._violated(moment, after, ended, still)
        while exceeded is not None:
            here = moment.regime.modes, exceeded[0]
            moment, latest, contradiction, since = self._follow(t, after, moment, *exceeded, tried[here])
            passed += since
            changes, blocked = [*changes, *latest], contradiction or blocked
            if contradiction is not None:
                tried[here] += 1
                if tried[here] > 1:
                    seen.clear()
            impact = bool(latest) and latest[0].impact
            again = bool(latest) and not impact and moment.regime.modes in seen
            repeats += again
            if repeats > MOST_REPEATS or len(changes) > MOST_AT_ONCE:
                raise endless(t, changes, blocked)
            if again or impact:
                seen.clear()
            if impact:
                tried.clear()  # what contradicted others need not do so at other speeds
            still = [] if latest else [*still, exceeded]
            seen[moment.regime.modes] = None
            moment, exceeded = self._violated(moment, after, ended, still, repeats)
            if exceeded is None and passed:  # in the modes that go on, how long ago it was hit
                moment, exceeded = self._violated(moment.moved(after, passed), after, ended, still, repeats)
                passed = 0.0
        return moment, changes

    def _violated(
        self, moment: HybridState, t: float, ended: HybridState, still: Sequence[Way], repeats: int = 0
    ) -> tuple[HybridState, Way | None]:
        """The guard that is farthest beyond its limit, or on it and about to go beyond; the moment with its bands.

        Args:
            moment, t, ended, still: as in `_exceeded`.
            repeats: how often modes have come back. After the first time the first guard is taken. The worst leads
                faster to modes that are consistent, as a rule; but this always does where parts hold each other
                (Murty, Linear Complementarity, 1988, section 4.1).
        """
        in_order = repeats > 0
        moment, found = self._exceeded(moment, t, ended, still, in_order=in_order, again=in_order)
        return moment, chosen(found, in_order=in_order)

    def _beyond(self, moment: HybridState, t: float) -> list[Way]:
        """Elements and guards that end modes at once."""
        return [way for _, way in self._exceeded(moment, t, moment, (), in_order=False, again=False)[1]]

    def _exceeded(
        self, moment: HybridState, t: float, ended: HybridState, idle: Sequence[Way], *, in_order: bool, again: bool
    ) -> tuple[HybridState, list[tuple[float, Way]]]:
        """The guards beyond their limits, or on them and about to go beyond, and how far; the moment with its bands.

        Args:
            moment: modes and states.
            t: s.
            ended: the moment before any change.
            idle: elements and guards that were found here already and change nothing.
            in_order: whether the first one will be taken, and not the worst.
            again: whether modes have come back.
        """
        regime, here = moment.regime, moment.course(t)
        beside, now = regime.course(*regime.beside(here)), here[3]
        bands = regime.bands(here, beside[3])
        wide = bands
        if ended.bands and ended.regime.assembly is regime.assembly:
            wide = list(map(max, bands, ended.bands))
        beyond, on_limit = [], []
        for pair in regime.watched:
            k = pair[1].guard
            value = pair[1].side * now[k]
            if value < -wide[k] or pair in idle:
                continue
            if value <= wide[k] or pair[1].leave.rebound is not None:  # only what comes nearer is thrown back
                on_limit.append(pair)
            elif value > 0:
                beyond.append((value, pair))
        # impacts come first: torques are those of the motion after them
        hits = [excess for excess in beyond if not excess[1][1].leave.by_torque]
        # then what the time ends: what else gives way shows when all of that has changed
        timed = [pair for pair in on_limit if by_time(pair[1].leave)]
        hits = hits or (leaving(regime, here, beside, timed, again=False) if timed else [])
        if on_limit and not hits:
            soon_beyond = leaving(regime, here, beside, on_limit, again=again)
            hits = [excess for excess in soon_beyond if excess[1][1].leave.rebound is not None]
            beyond = beyond + soon_beyond if in_order else beyond or soon_beyond
        return HybridState(regime, moment.x, clear_of_limits(regime, now, bands)), hits or beyond

    def _follow(
        self, t: float, after: float, moment: HybridState, number: int, ended: ActiveGuard, tried: int = 0
    ) -> tuple[HybridState, list[Change], NetworkError | None, float]:
        """The mode of an element changes, or what hits is thrown back; what kept it from what it wanted, and how long
        ago, in s, it was hit. Of the ways round what keeps it, some have been tried.
        """
        element, leave, regime = self.elements[number], ended.leave, moment.regime
        before = regime.modes[number]
        to = leave.to or anew(self.elements, moment, after, number)
        if is_switch(element.modes) and (switched := self._commutation.switched(t, after, moment, number, to)):
            return *switched, None, 0.0
        speed = self._impacts.meets(moment, after, element.modes[to], number)
        slips = next((name for side, name in element.modes[to].gives_way if side * speed > 0), "")
        if slips == before:  # it was met by rounding alone: it is moving away
            return moment, [], None, 0.0
        if slips:  # its torque is limited, so it takes no speed away at once
            to, speed = slips, 0.0
        try:
            if speed or (leave.rebound is not None and not slips):
                new, changes, since = self._hit(t, after, moment, number, replace(ended, leave=replace(leave, to=to)))
                return new, changes, None, since
            modes = with_modes(regime.modes, {number: to})
            new, conducting = self._commutation.commutated(moment, after, modes)
            others = [Change(t, self.elements[k], regime.modes[k], name) for k, name in conducting.items()]
            return new, [Change(t, element, before, to), *others], None, 0.0
        except NetworkError as error:
            return *self._around(t, after, moment, (number, to), error, tried), error, 0.0

    def _hit(
        self, t: float, after: float, moment: HybridState, number: int, ended: ActiveGuard
    ) -> tuple[HybridState, list[Change], float]:
        """An impact; what hits stays where a rebound would lose less than it gains, as it is found late by rounding.

        It is thrown back where it has passed its limit, and how long ago, in s, is said: what it would gain between
        there and here would add up over many rebounds.
        """
        number, ended = self._impacts.fastest(after, moment, number, ended)
        since = 0.0 if ended.leave.rebound is None else self._since(after, moment, ended)
        new, changes = self._impacts.hit(t, after, moment.moved(after, -since), number, ended.leave)
        if not changes[0].rebound:
            return new, changes, since
        if self._impacts.is_last(after, moment, new, number, ended):
            return *self._impacts.hit(t, after, moment, number, replace(ended.leave, rebound=None)), 0.0
        return new, changes, since

    def _since(self, t: float, moment: HybridState, met: ActiveGuard) -> float:
        """How long ago, in s, a guard passed through zero along a straight line."""
        regime, here = moment.regime, moment.course(t)
        step, beyond = regime.ahead(here[2]), met.side * here[3][met.guard]
        gain = met.side * regime.limits(*regime.later(here, step))[met.guard] - beyond
        return beyond * step / gain if 0 < beyond < gain else 0.0

    def _around(
        self, t: float, after: float, moment: HybridState, wanted: tuple[int, str], error: NetworkError, tried: int
    ) -> Transition:
        """Past a mode whose equations contradict others: into one to which it leads, or something else gives way.

        A friction that a prescribed speed turns cannot stick: it passes from slipping one way to slipping the other.
        """
        modes, (number, to) = moment.regime.modes, wanted
        element, before = self.elements[number], modes[number]
        if number in self._impacts.gears and (other := self._passing_on(after, moment, number, to)) is not None:
            return other[0], [Change(t, element, before, other[1])]
        leads = (leave for leave in element.modes[to].leaves if leave.to not in ("", before))
        # neither the other flank nor a time to come is there
        ways = [{number: leave.to} for leave in leads if leave.rebound is None and not leave.by_twist]
        limited = self._impacts.limited(modes).items()
        yields = [{number: to, k: name} for k, sides in limited for _, name in sides if k != number]
        # a gear jams only where nothing beside it gives way
        ways = [*yields, *ways] if number in self._impacts.gears else [*ways, *yields]
        for k in self._impacts.gears:
            ways += [{number: to, k: leave.to} for leave in self.elements[k].modes[modes[k]].leaves if k != number]
        for new in islice(filter(self._regimes.possible, (with_modes(modes, way) for way in ways)), tried, None):
            try:
                made = self._impacts.jammed(after, moment, self._regimes.changed(moment, after, new))
            except NetworkError:  # what slips behind the gear lets another one jam
                continue
            pairs = zip(self.elements, modes, made.regime.modes, strict=True)
            return made, [Change(t, *names) for names in pairs if names[1] != names[2]]
        raise SimulationError(
            f"'{element.name}' can neither stay {element.modes[before].words} nor become {element.modes[to].words} "
            f"at t = {t:.9g} s. {error.problems[0]}"
        ) from error

    def _passing_on(self, t: float, moment: HybridState, number: int, to: str) -> tuple[HybridState, str] | None:
        """Another mode of a gear at rest, and what follows, that contradicts nothing and leaves all else as it is."""
        modes, own = moment.regime.modes, self.elements[number].modes
        if moment.across(number, t) != 0:
            return None
        held = self._regimes.held(moment, t)
        leads = [leave.to for name in (to, modes[number]) for leave in own[name].leaves]
        for name in dict.fromkeys(leads):
            new = with_modes(modes, {number: name})
            if name in (to, modes[number]) or not self._regimes.possible(new):
                continue
            made = self._regimes.changed(moment, t, new)
            if self._regimes.held(made, t) == held and not self._beyond(made, t):
                return made, name
        return None
