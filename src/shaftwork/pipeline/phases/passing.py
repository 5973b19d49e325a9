"""Past the guards at which only a number in the equations changes: the engine need not stop there."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shaftwork.codegen.elements import Array
from shaftwork.core.errors import no_value
from shaftwork.integrate.problem import Reaction, SeriesError
from shaftwork.pipeline.phases.elements import Element, ModeNames
from shaftwork.pipeline.phases.moments import Change, Moment, Regime, clear_of_limit
from shaftwork.pipeline.phases.settling import Settling

# Of so many roundings of the time a guard may be late that is met together with another one.
LATE = 1e4


class Phase(NamedTuple):
    """A span of time in which no mode changes.

    Args:
        start: s.
        modes: of every element.
        p: parameters of the equations.
    """

    start: float
    modes: ModeNames
    p: Array


_Following = tuple[Regime, Sequence[float], list[Change]]
"""The modes that follow, how far rounding moves their guards, and the changes that lead there."""


def _always(_t: float, _moment: Moment) -> bool:
    return True


@dataclass(frozen=True, eq=False)
class _Way:
    """From one combination of modes to another in the same equations, by one guard.

    Args:
        to: the modes that follow.
        side: on which the guard was met.
        watched: guards and sides of those modes, and whether it is another one than leads there.
        change: its element, and the modes before and after.
    """

    to: Regime
    side: float
    watched: tuple[tuple[int, float, bool], ...]
    change: tuple[Element, str, str]


class Passing:
    """Lets an engine go on past guards; `Problem.react`.

    A change that leaves all other modes as they are is looked up and checked here; any other is settled in full.

    Args:
        settling: changes modes.
        moment: at the start of the engine's run.
        start: s.
        note: is told what has changed.
        suits: whether the engine goes on well from a time on.
    """

    def __init__(
        self,
        settling: Settling,
        moment: Moment,
        start: float,
        note: Callable[[float, list[Change]], None],
        suits: Callable[[float, Moment], bool] = _always,
    ) -> None:
        self._settling, self._suits = settling, suits
        self.regime, self.bands = moment.regime, moment.bands
        """The modes that go on, and how far rounding moves each guard."""
        self._note: Callable[[float, list[Change]], None] | None = note
        self._size = moment.x.size
        self.phases = [Phase(start, self.regime.modes, self.regime.p)]
        """The phases so far."""
        self._reactions: list[Reaction] = []
        self._suited: set[Regime] = set()
        self.beyond: tuple[Moment, list[Change]] | None = None
        """What comes after the last guard, where the engine had to stop for it."""

    def __call__(self, number: int, met: int, t: float, x: Array) -> Reaction | None:
        if number < len(self._reactions):  # the run is made once more, for its dense output
            return self._reactions[number]
        if self.beyond is not None or self._note is None:
            return None
        found = self._direct(met, t, x) or self._settled(met, t, x)
        if found is None:
            return None
        regime, bands, changes = found
        if regime not in self._suited:
            moment = Moment(regime, x[: self._size].copy(), bands)
            if not self._suits(t, moment):
                self.beyond = moment, changes
                return None
            self._suited.add(regime)
        self.regime, self.bands = regime, bands
        self._note(t, changes)
        self.phases.append(Phase(t, regime.modes, regime.p))
        reaction = Reaction(regime.p, regime.ends, bands, regime.equations)
        self._reactions.append(reaction)
        return reaction

    def close(self) -> None:
        """Let go of who is told: the run is over, and only made once more for its dense output.

        Else a motion and its run would refer to each other, and such circles wait for the garbage collector.
        """
        self._note, self._suits = None, _always

    def _settled(self, met: int, t: float, x: Array) -> _Following | None:
        before = Moment(self.regime, x[: self._size].copy(), self.bands)
        self.refuse_missed(met, t, x)
        moment, changes = self._settling.settle(t, t, before, met)
        if moment.x is before.x:
            return moment.regime, moment.bands, changes
        self.beyond = moment, changes  # other states are other equations, or an impact in these
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
            law = regime.assembly.without_value(regime.p, regime.modes, np.array([t]), np.array([here[1]]))
            if law is not None:
                raise no_value(*law)
        for number, made in regime.watched:
            k = made.guard
            if k != met and min(made.side * now[k], made.side * before[k]) > bands[k]:
                element = self._settling.elements[number]
                words = (
                    f"'{element.name}' ceased to be {element.modes[regime.modes[number]].words} before t = {t:.9g} s"
                )
                found = f"{words}, and the series of heyoka have not shown it"
                raise SeriesError(f"The heyoka engine has not seen that {words}. Take engine='scipy'.", found)

    def _direct(self, met: int, t: float, x: Array) -> _Following | None:
        """The modes that follow by this guard alone, or None where it takes more to tell.

        The same as in `Settling`, for the guards of one combination of modes only, as it is asked at every change.
        """
        ways = self.regime.ways
        way: _Way | None = ways[met] if met in ways else ways.setdefault(met, self._find(self.regime, met))
        if way is None:
            return None
        to, before = way.to, self.bands
        now, near, later = to.near(t, x.tolist()[: self._size], to.tick, to.moves, to.longest)
        bands = [0.0] * len(now)
        for guard, side, other in way.watched:
            beyond, band = side * now[guard], abs(near[guard] - now[guard])
            if other and (beyond >= -band or beyond >= -before[guard]):
                return None
            bands[guard] = clear_of_limit(beyond, band)
        if way.side * now[met] < 0:
            return None
        if not way.side * (later[met] - now[met]) > 0:  # it is not left behind for good
            return None
        return to, bands, [Change(t, *way.change)]

    def _find(self, regime: Regime, met: int) -> _Way | None:
        """Where a guard leads in the same equations."""
        pairs = [pair for pair in regime.watched if pair[1].guard == met]
        (number, ended), elements = pairs[0], self._settling.elements
        element, leave = elements[number], ended.leave
        before = regime.modes[number]
        if len(pairs) > 1 or not leave.to or leave.rebound is not None:
            return None
        if element.modes[leave.to].form != element.modes[before].form:
            return None
        to = self._settling.regime((*regime.modes[:number], leave.to, *regime.modes[number + 1 :]))
        watched = tuple((guard, side, guard != met or side == ended.side) for guard, side in to.ends)
        return _Way(to, ended.side, watched, (element, before, leave.to))
