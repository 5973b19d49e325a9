"""The instants of a run at which something jumps or bends, as far as rounding tells them apart."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shaftwork.codegen.array_form.elements import Array

# Instants of a run keep this many rounding units of its latest time clear on each side: no solver takes shorter steps.
CLEARANCE = 16


@dataclass(frozen=True)
class Timeline:
    """The instants of a run at which inputs jump or bend, and for each the times in s to read them before and after.

    At the start there is nothing before, and at the end nothing after: both times are then the one inside the run.

    Args:
        times: strictly increasing.
        before: for each of them, earlier than whatever jumps there.
        after: for each of them, later than whatever jumps there.
        narrow: where a pulse or an edge may be that is narrower than any step, in s, increasing.
    """

    times: tuple[float, ...] = ()
    before: tuple[float, ...] = ()
    after: tuple[float, ...] = ()
    narrow: tuple[float, ...] = ()

    @cached_property
    def stops(self) -> tuple[float, ...]:
        """Times in s at which an engine ends a step, increasing: the instants, and where inputs may be narrow."""
        return tuple(sorted({*self.times, *self.narrow}))

    def sides(self, time: float) -> tuple[float, float]:
        """Times to read the inputs before and after a time: itself where nothing jumps."""
        index = bisect_left(self.times, time)
        if index < len(self.times) and self.times[index] == time:
            return self.before[index], self.after[index]
        return time, time

    def one_sided(self, t: Array) -> Array:
        """The times (k,), moved out of every instant to its side; of one listed twice the first is before it."""
        if not self.times:
            return t
        times, before, after = self._arrays
        index = np.minimum(np.searchsorted(np.maximum(times, after), t), times.size - 1)
        inside = (np.minimum(times, before)[index] <= t) & (t <= np.maximum(times, after)[index])
        first_of_two = np.append(t[1:] == t[:-1], False) & (t == times[index])
        early = (t < times[index]) | first_of_two
        return np.where(inside, np.where(early, before[index], after[index]), t)

    @cached_property
    def _arrays(self) -> tuple[Array, Array, Array]:
        return np.array(self.times), np.array(self.before), np.array(self.after)


def timeline(places: Iterable[tuple[float, float]], t0: float, t_end: float, narrow: Iterable[float] = ()) -> Timeline:
    """The instants of a run from t0 to t_end.

    Those that rounding does not tell apart are one, at the earliest of their times; at a rounding from the start or the
    end they are there.

    Args:
        places: time and reach in s of everything that jumps or bends; farther away than its reach it does not.
        t0: start of the run, s.
        t_end: its end, s.
        narrow: times in s at which nothing jumps and yet a step is to end.
    """
    clearance = CLEARANCE * math.ulp(max(abs(t0), abs(t_end)))
    spans = ((time, max(reach, clearance)) for time, reach in places)
    merged: list[tuple[float, float, float]] = []
    for low, time, high in sorted((time - reach, time, time + reach) for time, reach in spans):
        if high < t0 or low > t_end:
            continue
        if merged and low <= merged[-1][2]:
            first, earliest, last = merged[-1]
            merged[-1] = first, min(earliest, time), max(last, high)
        else:
            merged.append((low, time, high))
    instants = [_clipped(low, time, high, t0, t_end) for low, time, high in merged]
    lows, highs = (np.array([row[place] for row in merged]) for place in (0, 2))
    inside = (time for time in sorted(set(narrow)) if t0 + clearance < time < t_end - clearance)
    apart = tuple(time for time in inside if not np.any((lows <= time) & (time <= highs)))
    times, before, after = zip(*instants, strict=True) if instants else ((), (), ())
    return Timeline(times, before, after, apart)


def _clipped(low: float, time: float, high: float, t0: float, t_end: float) -> tuple[float, float, float]:
    """Time, before and after of an instant that may touch an end of the run."""
    if low <= t0:
        return t0, min(high, t_end), min(high, t_end)
    if high >= t_end:
        return t_end, low, low
    return time, low, high


NOTHING = Timeline()
"""Of a run in which no input jumps or bends."""
