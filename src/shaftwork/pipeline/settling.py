"""Which modes go on at an instant: one changes after another until all are consistent with the motion that follows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from shaftwork.codegen.elements import Array
from shaftwork.core.errors import NetworkError, SimulationError
from shaftwork.pipeline.assemblies import Assembly, Element, ModeNames, Watched

if TYPE_CHECKING:
    from shaftwork.pipeline.phases import Phases

EPS = float(np.finfo(float).eps)
# A guard within so many rounding units of zero is on its limit, and only its further course tells its side.
ROUNDINGS = 64.0
# How far ahead that course is looked at: parts of the time in which a state moves by its nominal size, and of the run.
AHEAD, AHEAD_OF_RUN = 1e-3, 1e-7


@dataclass(frozen=True, eq=False)
class Change:
    """A change of mode: when in s, of which element, from which mode to which; or a rebound, back to the one before."""

    time: float
    element: Element
    before: str
    after: str
    rebound: bool = False


@dataclass(frozen=True, eq=False)
class Moment:
    """Modes, their equations and parameters, the states, and how far rounding moves each guard."""

    modes: ModeNames
    assembly: Assembly
    p: Array
    x: Array
    bands: Sequence[float] = ()


class Settling:
    """Changes modes at an instant.

    Args:
        phases: the sets of equations.
        values: parameters that differ from the network's.
        span: start and end of the run, s.
    """

    def __init__(self, phases: Phases, values: Mapping[str, float], span: tuple[float, float]) -> None:
        self._phases, self._values = phases, dict(values)
        self._ahead = AHEAD_OF_RUN * (span[1] - span[0])
        self._vectors: dict[ModeNames, Array] = {}

    def moment(self, modes: ModeNames, assembly: Assembly) -> Moment:
        """Modes without states."""
        if modes not in self._vectors:
            self._vectors[modes] = assembly.vector(self._values, self._phases.numbers(modes))
        return Moment(modes, assembly, self._vectors[modes], np.empty(0))

    def started(self, t: float, x: Array) -> Moment:
        """The modes in which a motion starts, from the states of the equations in which no mode joins anything.

        Args:
            t: time in s at which inputs are read.
            x: (n,) states.
        """
        first = self._phases.first
        loose = replace(self.moment(first, self._phases.assembly(first)), x=x)
        return self.changed(loose, t, loose.assembly.first_modes(t, x, loose.p))

    def changed(self, moment: Moment, t: float, modes: ModeNames) -> Moment:
        """The same instant in other modes: all that is stored goes over.

        Raises:
            NetworkError: the equations of these modes contradict each other.
        """
        assembly = self._phases.assembly(modes)
        new = self.moment(modes, assembly)
        if assembly is moment.assembly:
            return replace(new, x=moment.x)
        return replace(new, x=assembly.stores.states(assembly.bound(new.p), t, self.held(moment, t)))

    def held(self, moment: Moment, t: float) -> dict[str, float]:
        """All that is stored, by name."""
        assembly = moment.assembly
        values = assembly.stores.of(lambda: assembly.bound(moment.p), np.array([t]), moment.x[None, :])[0]
        return dict(zip(assembly.stores.names, values.tolist(), strict=True))

    def ends(self, moment: Moment, t: float, x: Array) -> bool:
        """Whether states are beyond a guard of the modes of a moment."""
        now = moment.assembly.motion(moment.p)(t, x.tolist())[1]
        wide = moment.bands or [0.0] * len(now)
        return any(made.side * now[made.guard] > wide[made.guard] for _, made in moment.assembly.watched(moment.modes))

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
        # a guard is met where it is beyond zero by its band, which then still is the band of what is the same after it
        ended = moment
        if met is None:
            moment, found = self._violated(moment, after, ended)
        else:
            found = next(pair for pair in moment.assembly.watched(moment.modes) if pair[1].guard == met)
        while found is not None:
            moment, change = self._follow(t, after, moment, *found)
            changes.append(change)
            if moment.modes in seen and not change.rebound:
                raise self._endless(t, changes)
            seen[moment.modes] = None
            moment, found = self._violated(moment, after, ended)
        return moment, changes

    def _violated(self, moment: Moment, t: float, ended: Moment) -> tuple[Moment, tuple[int, Watched] | None]:
        """The guard that is farthest beyond its limit, or on it and about to go beyond; the moment with its bands."""
        now, bands, ahead, unsure = self._course(moment, t)
        # a phase that started right at its limit would be taken to have met it
        clear = [8 * band if band < 4 * abs(g) < 16 * band else band for g, band in zip(now, bands, strict=True)]
        moment = replace(moment, bands=clear)
        wide = bands if ended.assembly is not moment.assembly else list(map(max, bands, ended.bands or bands))
        worst, largest = None, 0.0
        on_limit = []
        for pair in moment.assembly.watched(moment.modes):
            k, side = pair[1].guard, pair[1].side
            value = side * now[k]
            if value < -wide[k]:
                continue
            if value <= wide[k] or pair[1].leave.rebound is not None:  # only what comes nearer is thrown back
                on_limit.append(pair)
            elif value > largest:
                worst, largest = pair, value
        for pair in on_limit if worst is None else ():
            k, side = pair[1].guard, pair[1].side
            gain = side * (ahead[k] - now[k])
            if gain > unsure[k] and gain > largest:
                worst, largest = pair, gain
        return moment, worst

    def _course(self, moment: Moment, t: float) -> tuple[list[float], list[float], list[float], list[float]]:
        """The guards now, how far rounding of states and time moves them; what they are soon after, how surely."""
        assembly, x = moment.assembly, moment.x.tolist()
        motion = assembly.motion(moment.p)
        ulp, tiny = ROUNDINGS * math.ulp(t), ROUNDINGS * EPS
        rates, now = motion(t, x)
        step = self._ahead
        for rate, size in zip(rates, assembly.sizes(moment.p), strict=True):
            if rate and AHEAD * size < step * abs(rate):
                step = AHEAD * size / abs(rate)
        moved = [v * (1 + tiny if k % 2 else 1 - tiny) for k, v in enumerate(x)]
        others, near = motion(t, moved)
        later = motion(t + ulp, [v + ulp * rate for v, rate in zip(x, rates, strict=True)])[1]
        ahead = motion(t + step, [v + step * rate for v, rate in zip(x, rates, strict=True)])[1]
        beside = motion(t + step, [v + step * rate for v, rate in zip(moved, others, strict=True)])[1]
        bands = [abs(n - g) + abs(later[k] - g) for k, (n, g) in enumerate(zip(near, now, strict=True))]
        unsure = [abs((b - n) - (a - g)) for a, b, g, n in zip(ahead, beside, now, near, strict=True)]
        return now, bands, ahead, unsure

    def _follow(self, t: float, after: float, moment: Moment, number: int, ended: Watched) -> tuple[Moment, Change]:
        """The mode of an element changes, or what hits is thrown back."""
        element, leave = self._phases.elements[number], ended.leave
        before = moment.modes[number]
        to = leave.to or moment.assembly.start_of(number, before, after, moment.x, moment.p)
        modes = (*moment.modes[:number], to, *moment.modes[number + 1 :])
        try:
            new = self.changed(moment, after, modes)
        except NetworkError:
            return self._around(t, after, moment, number, to)
        if leave.rebound is not None and (back := self._rebound(moment, new, number, after, ended)) is not None:
            return back, Change(t, element, before, to, rebound=True)
        return new, Change(t, element, before, to)

    def _around(self, t: float, after: float, moment: Moment, number: int, to: str) -> tuple[Moment, Change]:
        """Past a mode whose equations contradict others: into the other one that it leads to.

        A friction that a prescribed speed turns cannot stick: it passes from slipping one way to slipping the other.
        """
        element, before = self._phases.elements[number], moment.modes[number]
        others = [leave.to for leave in element.modes[to].leaves if leave.to != before]
        for other in others:
            modes = (*moment.modes[:number], other, *moment.modes[number + 1 :])
            return self.changed(moment, after, modes), Change(t, element, before, other)
        raise SimulationError(f"'{element.name}' can neither stay '{before}' nor become '{to}' at t = {t:.9g} s.")

    def _rebound(self, moment: Moment, joined: Moment, number: int, t: float, ended: Watched) -> Moment | None:
        """The states after an impact with restitution; None where it is too slow for one.

        Law: v = v_joined + e (v_joined - v_before), which gives e times the speed back and keeps every momentum.
        """
        leave = ended.leave
        assembly, p = moment.assembly, moment.p
        share = assembly.constant(number, leave.rebound, p)
        rest = assembly.constant(number, leave.rest, p)
        if share * abs(assembly.across(number, t, moment.x, p)) <= rest:
            return None
        held, plastic = self.held(moment, t), self.held(joined, t)
        thrown = {name: plastic[name] + share * (plastic[name] - value) for name, value in held.items()}
        return replace(moment, x=assembly.stores.states(assembly.bound(p), t, thrown))

    def _endless(self, t: float, changes: list[Change]) -> SimulationError:
        last = changes[-1]
        others = dict.fromkeys(change.element.name for change in changes)
        return SimulationError(
            f"At t = {t:.9g} s no modes of {', '.join(others)} are consistent: '{last.element.name}' changes for ever "
            f"between '{last.before}' and '{last.after}'. Give the node between them an inertia or damping."
        )
