"""Which modes go on at an instant: one changes after another until all are consistent with the motion that follows."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from shaftwork.codegen.elements import Array
from shaftwork.components.branches import ACROSS
from shaftwork.components.modes import Leave, Mode
from shaftwork.core.errors import NetworkError, SimulationError
from shaftwork.pipeline.assemblies import ModeNames, Watched
from shaftwork.pipeline.moments import ROUNDINGS, Change, Course, Moment, Regime, clear_of_limits

if TYPE_CHECKING:
    from shaftwork.pipeline.phases import Phases

# How far ahead that course is looked at: parts of the time in which a state moves by its nominal size, and of the run.
AHEAD, AHEAD_OF_RUN = 1e-3, 1e-7

# A speed across what is joined, as part of the largest one or of one, up to which it is an error of the run, no impact.
NO_IMPACT = 1e-8


class Settling:
    """Changes modes at an instant.

    Args:
        phases: the sets of equations.
        values: parameters that differ from the network's.
        span: start and end of the run, s.
    """

    def __init__(self, phases: Phases, values: Mapping[str, float], span: tuple[float, float]) -> None:
        self._phases, self._values = phases, dict(values)
        self.elements = phases.elements
        self._ahead = AHEAD_OF_RUN * (span[1] - span[0])
        self.tick = ROUNDINGS * math.ulp(max(map(abs, span)))
        """How far in s rounding moves the time."""
        self._regimes: dict[ModeNames, Regime] = {}

    def regime(self, modes: ModeNames) -> Regime:
        """A combination of modes.

        Raises:
            NetworkError: the equations of these modes contradict each other.
        """
        if modes not in self._regimes:
            assembly = self._phases.assembly(modes)
            p = assembly.vector(self._values, self._phases.numbers(modes))
            made = Regime(
                modes,
                assembly,
                p,
                assembly.motion(p),
                assembly.sides(modes),
                assembly.sizes(p),
                assembly.watched(modes),
            )
            self._regimes[modes] = made
        return self._regimes[modes]

    def started(self, t: float, x: Array) -> Moment:
        """The modes in which a motion starts, from the states of the equations in which no mode joins anything.

        Args:
            t: time in s at which inputs are read.
            x: (n,) states.
        """
        loose = self.regime(self._phases.first)
        return self._changed(Moment(loose, x), t, loose.assembly.first_modes(t, x, loose.p))

    def _changed(self, moment: Moment, t: float, modes: ModeNames) -> Moment:
        """The same instant in other modes: all that is stored goes over.

        Raises:
            NetworkError: the equations of these modes contradict each other.
        """
        new, old = self.regime(modes), moment.regime
        if new.assembly is old.assembly:
            return Moment(new, moment.x)
        return Moment(new, new.assembly.stores.states(new.assembly.bound(new.p), t, self.held(moment, t)))

    def held(self, moment: Moment, t: float) -> dict[str, float]:
        """All that is stored, by name."""
        assembly, p = moment.regime.assembly, moment.regime.p
        values = assembly.stores.of(lambda: assembly.bound(p), np.array([t]), moment.x[None, :])[0]
        return dict(zip(assembly.stores.names, values.tolist(), strict=True))

    def ends(self, moment: Moment, t: float, x: Array) -> bool:
        """Whether states are beyond a guard of the modes of a moment."""
        now = moment.regime.motion(t, x.tolist())[1]
        wide = moment.bands or [0.0] * len(now)
        return any(made.side * now[made.guard] > wide[made.guard] for _, made in moment.regime.watched)

    def settle(self, t: float, after: float, moment: Moment, met: int | None) -> tuple[Moment, list[Change]]:
        """The modes that go on, and the changes that lead there.

        Args:
            t: the instant, s.
            after: a time just after it, s, at which inputs are read.
            moment: what was before.
            met: the guard that ended the phase, or None.

        Raises:
            SimulationError: no modes are consistent; names the pair that changes for ever.
        """
        changes: list[Change] = []
        seen: dict[ModeNames, None] = {}
        in_order = False
        # a guard is met where it is beyond zero by its band, which then still is the band of what is the same after it
        ended = moment
        if met is None:
            moment, found = self._violated(moment, after, ended)
        else:
            found = next(pair for pair in moment.regime.watched if pair[1].guard == met)
        while found is not None:
            moment, made = self._follow(t, after, moment, *found)
            changes += made
            if made and made[0].impact:
                seen.clear()
            elif made and moment.regime.modes in seen:
                if in_order:
                    raise self._endless(t, changes)
                in_order = True
                seen.clear()
            seen[moment.regime.modes] = None
            moment, found = self._violated(moment, after, ended, in_order=in_order)
        return moment, changes

    def _violated(
        self, moment: Moment, t: float, ended: Moment, *, in_order: bool = False
    ) -> tuple[Moment, tuple[int, Watched] | None]:
        """The guard that is farthest beyond its limit, or on it and about to go beyond; the moment with its bands.

        Args:
            moment: modes and states.
            t: s.
            ended: the moment before any change.
            in_order: take the first one instead. The worst leads faster to modes that are consistent, as a rule; but
                this always does where parts hold each other (Murty, Linear Complementarity, 1988, section 4.1).
        """
        regime, x = moment.regime, moment.x.tolist()
        rates, now = regime.motion(t, x)
        moved = regime.rounded(x, rates, self.tick)
        others, near = regime.motion(t + self.tick, moved)
        bands = [abs(n - g) for n, g in zip(near, now, strict=True)]
        wide = bands
        if ended.bands and ended.regime.assembly is regime.assembly:
            wide = list(map(max, bands, ended.bands))
        beyond, on_limit = [], []
        for pair in regime.watched:
            k = pair[1].guard
            value = pair[1].side * now[k]
            if value < -wide[k]:
                continue
            if value <= wide[k] or pair[1].leave.rebound is not None:  # only what comes nearer is thrown back
                on_limit.append(pair)
            elif value > 0:
                beyond.append((value, pair))
        # impacts come first: torques are those of the motion after them
        hits = [found for found in beyond if not found[1][1].leave.by_torque]
        if on_limit and not hits:
            leaving = self._leaving(regime, (t, x, rates, now), (t + self.tick, moved, others, near), on_limit)
            hits = [found for found in leaving if found[1][1].leave.rebound is not None]
            beyond = beyond + leaving if in_order else beyond or leaving
        chosen = _chosen(hits or beyond, in_order=in_order)
        return Moment(regime, moment.x, clear_of_limits(regime, now, bands)), chosen

    def ahead(self, regime: Regime, rates: list[float]) -> float:
        """How far in s the further course is looked at."""
        step = self._ahead
        for rate, size in zip(rates, regime.sizes, strict=True):
            if rate and AHEAD * size < step * abs(rate):
                step = AHEAD * size / abs(rate)
        return step

    def _leaving(
        self, regime: Regime, here: Course, beside: Course, on_limit: list[tuple[int, Watched]]
    ) -> list[tuple[float, tuple[int, Watched]]]:
        """Of guards on their limit those that are about to go beyond it, and how far, as surely as rounding tells.

        Args:
            regime: the modes.
            here: time, states, rates and guards of the moment.
            beside: the same, rounding away from it.
            on_limit: elements and guards.
        """
        step = self.ahead(regime, here[2])
        ways, found = (here, beside), []
        for _ in range(2):  # where nothing moves yet, its acceleration tells
            ways = _later(regime, step, ways[0]), _later(regime, step, ways[1])
            for number, made in on_limit:
                k = made.guard
                gain, other = made.side * (ways[0][3][k] - here[3][k]), made.side * (ways[1][3][k] - beside[3][k])
                if gain > max(0.0, abs(gain - other)):
                    found.append((gain, (number, made)))
            if found:
                break
        return found

    def _follow(
        self, t: float, after: float, moment: Moment, number: int, ended: Watched
    ) -> tuple[Moment, list[Change]]:
        """The mode of an element changes, or what hits is thrown back."""
        element, leave, regime = self._phases.elements[number], ended.leave, moment.regime
        before = regime.modes[number]
        to = leave.to or regime.assembly.start_of(number, before, after, moment.x, regime.p)
        speed = self._meets(moment, after, element.modes[to], number)
        slips = next((name for side, name in element.modes[to].gives_way if side * speed > 0), "")
        if slips == before:  # it was met by rounding alone: it is moving away
            return moment, []
        if slips:  # its torque is limited, so it takes no speed away at once
            to, speed = slips, 0.0
        try:
            if speed or (leave.rebound is not None and not slips):
                new, changes = self._hit(t, after, moment, number, replace(leave, to=to))
                return (self._at_limit(new, after, number, ended) if changes[0].rebound else new), changes
            modes = _with(regime.modes, {number: to})
            new, conducting = self._commutated(moment, after, modes, self._changed(moment, after, modes))
            others = [Change(t, self._phases.elements[k], regime.modes[k], name) for k, name in conducting.items()]
            return new, [Change(t, element, before, to), *others]
        except NetworkError:
            return self._around(t, after, moment, number, to)

    def _commutated(self, moment: Moment, t: float, modes: ModeNames, plain: Moment) -> tuple[Moment, dict[int, str]]:
        """What takes over a torque or current that a change would cut off from its store: a diode, a freewheel.

        Without one it is cut off, with the energy of the store.
        """
        names = plain.regime.assembly.stores.through
        if plain.x is moment.x or not names:
            return plain, {}
        held = self.held(moment, t)

        def lost(other: Moment) -> float:
            kept = self.held(other, t)
            return sum(abs(kept[name] - held[name]) for name in names)

        least = NO_IMPACT * sum(abs(held[name]) for name in names)
        if lost(plain) <= least:
            return plain, {}
        ways = [
            (k, leave.to)
            for k, name in enumerate(modes)
            for leave in self._phases.elements[k].modes[name].leaves
            if leave.when == ACROSS and leave.to
        ]
        for count in (1, 2):
            for chosen in combinations(ways, count):
                other = self._changed(moment, t, _with(modes, dict(chosen)))
                if lost(other) <= least and not self._violated(other, t, other)[1]:
                    return other, dict(chosen)
        return plain, {}

    def _meets(self, moment: Moment, t: float, to: Mode, number: int) -> float:
        """The speed across an element that is joined from now on; zero where it is no more than an error of the run."""
        regime, modes = moment.regime, self._phases.elements[number].modes
        if to.form in (modes.options[0].form, modes[regime.modes[number]].form):
            return 0.0
        speed = regime.assembly.across(number, t, moment.x, regime.p)
        speeds = moment.x[: len(regime.assembly.model.form.across_states)]
        least = NO_IMPACT * np.abs(speeds).max(initial=1.0)
        if abs(speed) <= least:
            return 0.0
        try:
            joined = self._changed(moment, t, _with(regime.modes, {number: to.name}))
        except NetworkError:
            return speed
        held, after = self.held(moment, t), self.held(joined, t)
        # between dampers alone a speed is whatever their torques make it: joining them stops no inertia
        return speed if any(abs(after[name] - value) > least for name, value in held.items()) else 0.0

    def _hit(self, t: float, after: float, moment: Moment, number: int, leave: Leave) -> tuple[Moment, list[Change]]:
        """An impact: the element is joined for an instant, and for good where nothing throws it back.

        Law: v = v_joined + e (v_joined - v_before), which gives e times the speed back and keeps every momentum.
        """
        elements, regime = self._phases.elements, moment.regime
        speed = abs(regime.assembly.across(number, after, moment.x, regime.p))
        share, rest = (regime.assembly.constant(number, given, regime.p) for given in (leave.rebound, leave.rest))
        # what moves more slowly than the rest of an impact stays as it is: two contacts would part and meet for ever
        joined = self._joined(moment, after, number, leave.to, max(rest, NO_IMPACT * speed))
        rebound = leave.rebound is not None and share * speed > rest
        changes = [Change(t, elements[number], regime.modes[number], leave.to, rebound, impact=True)]
        for k, (before, name) in enumerate(zip(regime.modes, joined.regime.modes, strict=True)):
            if k != number and name != before:
                changes.append(Change(t, elements[k], before, name))
        if not rebound:
            return joined, changes
        held, plastic = self.held(moment, after), self.held(joined, after)
        thrown = {name: plastic[name] + share * (plastic[name] - value) for name, value in held.items()}
        new = self.regime(_with(joined.regime.modes, {number: regime.modes[number]}))
        return Moment(new, new.assembly.stores.states(new.assembly.bound(new.p), after, thrown)), changes

    def _at_limit(self, moment: Moment, t: float, number: int, ended: Watched) -> Moment:
        """What was thrown back, its twist right at the limit: the little beyond it would add up over many rebounds."""
        regime, x = moment.regime, moment.x.copy()
        state = regime.assembly.twist(number)
        if state is None:
            return moment
        beyond = regime.motion(t, x.tolist())[1][ended.guard]
        x[state] += 1.0
        slope = regime.motion(t, x.tolist())[1][ended.guard] - beyond
        x[state] = moment.x[state] - (beyond / slope if slope else 0.0)
        return Moment(regime, x)

    def _joined(self, moment: Moment, t: float, number: int, to: str, least: float) -> Moment:
        """After an inelastic impact. What holds by a limited torque slips in it; contacts are pressed, not pulled."""
        before, elements = moment.regime.modes, self._phases.elements
        gives = {k: elements[k].modes[name].gives_way for k, name in enumerate(before) if k != number}
        gives = {k: ways for k, ways in gives.items() if ways}
        made = {number: to, **{k: ways[0][1] for k, ways in gives.items()}}
        while True:
            joined = self._changed(moment, t, _with(before, made))
            after = joined.regime
            speeds = {k: after.assembly.across(k, t, joined.x, after.p) for k in gives}
            ways = {k: [name for side, name in gives[k] if side * speeds[k] > 0] for k in gives}
            pressed = [k for k in gives if abs(speeds[k]) > least and not ways[k]]
            if not pressed:
                break
            for k in pressed:
                made[k] = before[k]
                del gives[k]
        made |= {k: ways[k][0] if abs(speeds[k]) > least else before[k] for k in gives}
        return self._changed(joined, t, _with(before, made))

    def _around(self, t: float, after: float, moment: Moment, number: int, to: str) -> tuple[Moment, list[Change]]:
        """Past a mode whose equations contradict others: into the other one that it leads to.

        A friction that a prescribed speed turns cannot stick: it passes from slipping one way to slipping the other.
        """
        element, modes = self._phases.elements[number], moment.regime.modes
        before = modes[number]
        others = [leave.to for leave in element.modes[to].leaves if leave.to != before]
        for other in others:
            return self._changed(moment, after, _with(modes, {number: other})), [Change(t, element, before, other)]
        raise SimulationError(f"'{element.name}' can neither stay '{before}' nor become '{to}' at t = {t:.9g} s.")

    def _endless(self, t: float, changes: list[Change]) -> SimulationError:
        last = changes[-1]
        others = dict.fromkeys(change.element.name for change in changes)
        return SimulationError(
            f"At t = {t:.9g} s no modes of {', '.join(others)} are consistent: '{last.element.name}' changes for ever "
            f"between '{last.before}' and '{last.after}'. Give the node between them an inertia or damping."
        )


def _with(modes: ModeNames, changed: Mapping[int, str]) -> ModeNames:
    """A combination of modes with some of them changed."""
    return tuple(changed.get(k, name) for k, name in enumerate(modes))


def _chosen(found: list[tuple[float, tuple[int, Watched]]], *, in_order: bool) -> tuple[int, Watched] | None:
    """Of elements and guards the first one, or else the one that is farthest beyond."""
    if not found:
        return None
    return (min(found, key=lambda one: one[1][0]) if in_order else max(found, key=lambda one: one[0]))[1]


def _later(regime: Regime, step: float, course: Course) -> Course:
    """A step further along a straight line."""
    t, x, rates, _ = course
    later = [v + step * rate for v, rate in zip(x, rates, strict=True)]
    return t + step, later, *regime.motion(t + step, later)
