"""The instants of a run at which something jumps or bends: where a function of time does, found from samples of it, and
how far rounding tells them apart.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from shaftwork.codegen.array_form.elements import Array, Index
from shaftwork.numerics.tolerances import CLEARANCE, GOLDEN


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
    clearance = CLEARANCE / 2 * math.ulp(max(abs(t0), abs(t_end)))  # on each side of an instant
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


class Search(NamedTuple):
    """How closely functions of time are looked at in a run.

    Args:
        samples: of a run: what is narrower than a few of its parts of that number may be missed. The sides of a switch
            are looked at a fourth as often at first, and again four times as often until it changes them no more often.
        most: samples, at which a switch is given up.
        resolved: samples that there must be for each change of side.
        farthest: an argument rounds badly where its terms cancel: it is looked at farther and farther from a change of
            side, up to this part of the run, until it keeps its sides.
        plain: a function goes straight on, to this part of its range, where no bump is: waves of up to 50 periods do
            everywhere.
        apart: a bump has so many times its width of plain course on one side: no step passes what lasts longer
            unawares.
    """

    samples: int = 2**14
    most: int = 2**22
    resolved: int = 8
    farthest: float = 1e-6
    plain: float = 1e-4
    apart: float = 2.0


SEARCH = Search()
PROBES = np.array([1.0, 1.5, 2.0, 3.0, 4.0])
"""Where the sides beside a change are looked at, in parts of its reach."""
STOPS = np.linspace(-0.5, 1.5, 13)
"""Where steps end at a bump, in its widths: where it shows it is 1e-4 high, and began before."""
Sides = Callable[[Array], Index]
"""From times (k,) to the sides of a switch (k,): numbers that differ where it jumps or bends."""


def irregular(t0: float, t_end: float, size: int) -> Array:
    """Times (size + 1,) from t0 to t_end without a frequency that they mistake for another."""
    places = np.arange(size)
    return np.append(t0 + (t_end - t0) * ((places + places * GOLDEN % 1.0) / size), t_end)


def sampled(sides: Sides, t0: float, t_end: float) -> Array | None:
    """Times (k,) from t0 to t_end between which a switch changes sides at most once, or None."""
    size, before = SEARCH.samples // 4, -1
    while size <= SEARCH.most:
        t = irregular(t0, t_end, size)
        changes = int(np.count_nonzero(np.diff(sides(t))))
        if changes == before and changes * SEARCH.resolved <= size:
            return np.unique(t)
        size, before = 4 * size, changes
    return None


def nearest(distance: Callable[[Array], Array], t: Array) -> Array:
    """The times of the least distances between the times (k,), by golden sections."""
    x = distance(t)
    valleys = 1 + np.flatnonzero((x[1:-1] < x[:-2]) & (x[1:-1] < x[2:]))
    low, high = t[valleys - 1], t[valleys + 1]
    for _ in range(80):
        early, late = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        left = distance(early) < distance(late)
        low, high = np.where(left, low, early), np.where(left, late, high)
    return np.asarray((low + high) / 2)


def changes_of(sides: Sides, t: Array) -> list[tuple[float, float]]:
    """Times in s at which a switch changes sides between the times (k,), and the reach of their rounding."""
    grain = math.ulp(max(abs(float(t[0])), abs(float(t[-1]))))
    low, high, old, new = _bisected(sides, t, grain / 1024)
    order = np.argsort(high)
    low, high, old, new = low[order], high[order], old[order], new[order]
    # A zero that is met exactly is a side of its own: two changes, and one instant.
    apart = np.diff(high) > CLEARANCE * grain
    first, last = np.append(True, apart)[: high.size], np.append(apart, True)[: high.size]
    times, width, old, new = high[first], high[last] - high[first], old[first], new[last]
    passed = old != new
    times, width, old, new = times[passed], width[passed], old[passed], new[passed]
    return list(zip(times.tolist(), (width + _reach(sides, t, times, old, new, grain)).tolist(), strict=True))


def _bisected(sides: Sides, t: Array, grain: float) -> tuple[Array, Array, Index, Index]:
    """Every change of side between the times (k,): the last time before it, the first after it, and the two sides."""
    at = sides(t)
    changed = np.flatnonzero(np.diff(at))
    low, high, old, new = t[changed], t[changed + 1], at[changed], at[changed + 1]
    while True:
        middle = low + (high - low) / 2
        done = (high - low <= grain) | (middle <= low) | (middle >= high)
        if done.all():
            return low, high, old, new
        here = sides(middle)
        left, right = ~done & (old != here), ~done & (here != new)
        low = np.concatenate([low[done], low[left], middle[right]])
        high = np.concatenate([high[done], middle[left], high[right]])
        old, new = (
            np.concatenate([old[done], old[left], here[right]]),
            np.concatenate([new[done], here[left], new[right]]),
        )


def _reach(sides: Sides, t: Array, times: Array, old: Index, new: Index, grain: float) -> Array:
    """How far from the times (k,) of changes the sides are the old and the new ones, whatever the rounding, in s."""
    gaps = np.diff(times, prepend=-np.inf, append=np.inf)
    farthest = np.minimum(SEARCH.farthest * (t[-1] - t[0]), np.minimum(gaps[:-1], gaps[1:]) / SEARCH.resolved)
    reach = np.full(times.shape, CLEARANCE / 2 * grain)
    while True:
        offsets = reach[:, None] * PROBES
        early, late = np.maximum(times[:, None] - offsets, t[0]), np.minimum(times[:, None] + offsets, t[-1])
        keeps = (sides(early.ravel()).reshape(early.shape) == old[:, None]) | (early == t[0])
        keeps &= (sides(late.ravel()).reshape(late.shape) == new[:, None]) | (late == t[-1])
        farther = ~keeps.all(axis=1) & (4 * reach <= farthest)
        if not farther.any():
            return reach
        reach[farther] *= 4


def bumps(function: Callable[[Array], Array], t0: float, t_end: float) -> Array:
    """Times in s, increasing, at which steps end so that none passes a bump unawares.

    Args:
        function: from times (k,) in s to values (k,).
        t0: start of the run, s.
        t_end: its end, s.
    """
    t = irregular(t0, t_end, SEARCH.samples)
    x = function(t)
    if not np.isfinite(x).all() or not np.ptp(x) > 0:
        return np.empty(0)
    straight = x[:-2] + (x[2:] - x[:-2]) * ((t[1:-1] - t[:-2]) / (t[2:] - t[:-2]))
    bent = np.concatenate([[False], np.abs(x[1:-1] - straight) > SEARCH.plain * np.ptp(x), [False]])
    edges = np.flatnonzero(np.diff(bent))
    stretches: list[tuple[float, float]] = []
    for begin, end in zip(t[edges[::2]].tolist(), t[edges[1::2] + 1].tolist(), strict=True):
        # where a flank turns, a bump is straight too
        joined = stretches and begin - stretches[-1][1] < SEARCH.apart * max(end - begin, np.ptp(stretches[-1]))
        stretches.append((stretches.pop()[0] if joined else begin, end))
    begins, ends = np.array(stretches).reshape(-1, 2).T
    plain = np.maximum(begins - np.append(t0, ends[:-1]), np.append(begins[1:], t_end) - ends)
    width = ends - begins
    return np.unique((begins + STOPS[:, None] * width)[:, SEARCH.apart * width < plain])
