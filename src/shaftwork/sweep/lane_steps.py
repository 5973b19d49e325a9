"""Variants side by side, each with steps of its own, and the largest values and first rises of quantities in these.

Where its slope falls through zero between two samples, or does so and rises again, the polynomial through its values
and its first two derivatives at both says about when. From the first of these samples the motion is followed to that
time, and the polynomial from there gives the height, or Newton's step on the slope where it is hardly away: right to
the tolerance of the motion, whatever the distance of the samples.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shaftwork.codegen.array_form.elements import Array
from shaftwork.numerics.hermite import BEYOND, apart, inner, quintic
from shaftwork.numerics.tolerances import TYPED
from shaftwork.numerics.zeros import Chosen, zeros

OF_A_STEP, LOOSEST_TOLERANCE, TIGHTEST_TOLERANCE = 0.1, 1e-7, 1e-13
"""The tolerance of a step as a part of that of the motion, and its bounds."""
WITHOUT_LIMIT = 1e300
STILL = 8 * float(np.finfo(float).eps)
"""A step that is shorter than this part of the time leads nowhere."""

Index = NDArray[np.intp]
Mask = NDArray[np.bool_]
ROUNDING, ROUNDINGS = 2 * float(np.finfo(float).eps), 16
"""A time is known to rounding, and to so many roundings of the step."""
There = Callable[[Index, Index, Array], Array]
"""Jets (3, c) at times (c,) in s, from samples (c,) of lanes (c,)."""


class Room:
    """Memory for steps, the same each time: fresh memory costs as much as the arithmetic."""

    def __init__(self) -> None:
        self._values = np.empty(0)

    def __call__(self, *shape: int) -> Array:
        """An array of a shape, of whatever values; that of the last call is gone."""
        size = math.prod(shape)
        if self._values.size < size:
            self._values = np.empty(size)
        return self._values[:size].reshape(shape)


class Steps:
    """Some steps of lanes.

    Args:
        step: a `lane_step.LaneStep`.
        taken: (used, k) what it takes of the parameters.
        columns: (m + 1, height, k) at the start, and what each of m steps has written.
    """

    def __init__(self, step: Any, taken: Array, columns: Array) -> None:
        self._step, self._taken, self._columns = step, taken, columns
        self.t: Array = columns[:-1, step.rows - 2]
        """(m, k) times in s at the start of each step; a lane that is at its end stays there."""
        self.jets: Array = columns[1:, step.jets].swapaxes(0, 1)
        """(jets, m, k) what the step shows there."""

    @property
    def columns(self) -> Array:
        """(height, k) at the start of the last step."""
        return np.asarray(self._columns[-2])

    @property
    def last(self) -> Array:
        """(rows, k) of them."""
        return self.columns[: self._step.rows]

    def reach(self, number: int, sign: float) -> Array:
        """(k,) how far a quantity can have come in these steps, times a sign."""
        return np.asarray(self._columns[-1, self._step.reach(number, sign)])

    def at(self, start: Index, lanes: Index, t: Array) -> tuple[Array, Array]:
        """Rows (rows, c) and jets (jets, c) at times (c,) in s, from the starts (c,) of steps of lanes (c,)."""
        step, count = self._step, lanes.size
        every = _padded(count)
        start, lanes, t = start[every], lanes[every], t[every]
        columns = np.ascontiguousarray(self._columns[start, :, lanes].T)
        columns[step.rows - 1] = WITHOUT_LIMIT
        taken = np.ascontiguousarray(self._taken[:, lanes])
        step.limit(taken, WITHOUT_LIMIT, t, WITHOUT_LIMIT)
        there, here = np.empty((2, step.height, lanes.size))
        step(columns, taken, there)
        step(there, taken, here)
        return there[: step.rows, :count], here[step.jets, :count]

    def cut(self, start: Index, t: Array, jets: Array) -> None:
        """Let lanes stay at times (k,) in s with jets (jets, k), from behind the starts (k,) of steps on."""
        later = np.arange(len(self.t))[:, None] > start
        np.copyto(self.t, t, where=later)
        for row, jet in zip(self.jets, jets, strict=True):
            np.copyto(row, jet, where=later)


class LaneRun:
    """Lanes on their way.

    Args:
        step: a `lane_step.LaneStep`.
        room: for its steps.
        x: (n, k) states.
        rates: (n, k) theirs.
        t: (k,) s.
        p: (parameters, k).
        sizes: (n,) nominal, of the states.
        limits: end of the motion and the longest step, s.
        rtol: relative tolerance.
    """

    def __init__(
        self,
        step: Any,
        room: Room,
        x: Array,
        rates: Array,
        t: Array,
        p: Array,
        sizes: Array,
        limits: tuple[float, float],
        rtol: float,
    ) -> None:
        self._step, self._room, self._end = step, room, limits[0]
        with np.errstate(divide="ignore"):
            # The first step changes no state by more than a hundredth of its size.
            first = 0.01 * ((sizes[:, None] + np.abs(x)) / np.abs(rates)).min(axis=0)
        columns, taken = np.zeros((step.height, t.size)), step.taken(p, sizes)
        columns[: len(x)], columns[step.rows - 2], columns[step.rows - 1] = x, t, np.minimum(first, limits[1])
        step.limit(taken, min(max(OF_A_STEP * rtol, TIGHTEST_TOLERANCE), LOOSEST_TOLERANCE), *limits)
        self._count = 0
        self._take(np.arange(t.size), columns, taken)
        first_columns = np.empty_like(self._columns)
        step(self._columns, self._taken, first_columns)
        self._columns[step.jets] = first_columns[step.jets]

    def _take(self, lanes: Index, columns: Array, taken: Array) -> None:
        """Go on with some lanes (k,) from columns (height, k), with what is `taken` (used, k) of their parameters."""
        self.lanes = lanes
        """(k,) numbers of the lanes that are on their way."""
        every = _padded(lanes.size)
        self._columns, self._taken = (np.ascontiguousarray(values[:, every]) for values in (columns, taken))

    def go(self) -> tuple[Steps, Mask]:
        """Some steps of the lanes that are on their way, and (k,) whether each of them goes well.

        The steps are gone with the next ones.
        """
        step, count = self._step, self.lanes.size
        look = 8  # steps after which it is looked whether all lanes have come to the end
        most = min(max(512 // step.height, look), 32)  # more rows than 512 leave the cache
        columns = self._room(most + 1, *self._columns.shape)
        columns[0] = self._columns
        step.forget(columns[0])
        for k in range(most):
            step(columns[k], self._taken, columns[k + 1])
            if k % look == look - 1 and (columns[k, step.rows - 2] >= self._end).all():
                columns = columns[: k + 2]
                break
        self._count += len(columns) - 1
        steps = Steps(step, self._taken[:, :count], columns[:, :, :count])
        t, size = steps.last[-2:]
        good = np.isfinite(steps.last).all(axis=0) & ((t >= self._end) | (size > STILL * np.abs(t)))
        # After four looks it is foreseen how many steps a lane will take up to the next change of mode: one of more
        # than 100 000 is stiff, or swings so often that it is better off alone.
        if self._count > 4 * most:
            good &= self._count * (t - steps.t[0]) + (self._end - t) * len(steps.t) < 100_000 * (t - steps.t[0])
        return steps, good

    def keep(self, on: Mask, steps: Steps) -> None:
        """Go on with some of the lanes (k,), from where steps have led them."""
        if on.any():
            self._take(self.lanes[on], steps.columns[:, on], self._taken[:, : on.size][:, on])
        else:
            self.lanes = self.lanes[on]


def _padded(count: int) -> Index:
    """Numbers of lanes, and the last one again up to a multiple of eight.

    A compiled function takes eight at once, and rounds what is left differently.
    """
    return np.minimum(np.arange(-(-count // 8) * 8), count - 1)


def largest(t: Array, jets: Array, best: Array, there: There) -> Array:
    """(k,) the largest values; NaN where a peak has not been found.

    Args:
        t: (m, k) times in s of the samples; a lane that has ended stays at its last time.
        jets: (3, m, k) values and their first and second derivative by time.
        best: (k,) what was found before: a lower peak need not be known better.
        there: follows the motion from a sample.
    """
    top, bottom = jets[0].max(axis=0), jets[0].min(axis=0)
    tops, size = np.maximum(best, top), top - bottom
    at, lanes = likely(t, jets, tops, tops, size)
    left, right = (np.array([t[k, lanes], *jets[:, k, lanes]]) for k in (at, at + 1))
    times, height = peak(left, right)
    missed, surely = beyond(left, right), tops.copy()
    np.maximum.at(surely, lanes, height - missed)
    on = np.isfinite(height) & (height + missed >= surely[lanes])
    for _ in range(20):
        at, lanes, left, right, times, height = at[on], lanes[on], left[:, on], right[:, on], times[on], height[on]
        if not lanes.size:
            return np.asarray(tops)
        middle = np.array([times, *there(at, lanes, times)])
        np.maximum.at(tops, lanes, middle[1])
        missed, room = np.abs(height - middle[1]), np.minimum(times - left[0], right[0] - times)
        # on either side of what is known now
        at, lanes, missed, room, before = (np.tile(values, 2) for values in (at, lanes, missed, room, times))
        left, right = np.concatenate([left, middle], axis=1), np.concatenate([middle, right], axis=1)
        times, height = peak(left, right)
        near = TYPED * size[lanes]
        # what a polynomial misses grows with the cube of the distance from a point that it goes through
        part = np.abs(times - before) / room
        sure = (part < 0.01) & (missed * part**3 < near)
        np.maximum.at(tops, lanes[sure], height[sure])
        on = ~sure & (height + beyond(left, right) > tops[lanes] + near)
    tops[lanes[on]] = np.nan
    return np.asarray(tops)


def likely(t: Array, jets: Array, least: Array, top: Array, size: Array) -> tuple[Index, Index]:
    """Samples (c,) of lanes (c,) after which there may be a peak of at least so much (k,).

    The slope falls through zero, or, where one of the samples is within a tenth of the range (k,) of the top (k,), does
    so and rises again. A polynomial is no higher than the highest of its Bernstein coefficients.
    """
    up, high = jets[1] > 0, jets[0] >= top - 0.1 * size
    at, lanes = np.divmod(np.flatnonzero((up[:-1] & ~up[1:]) | high[:-1] | high[1:]), t.shape[1])
    left, right = (np.array([t[k, lanes], *jets[:, k, lanes]]) for k in (at, at + 1))
    length = right[0] - left[0]
    highest = reduce(np.maximum, inner(length, left[1:], right[1:]))
    chosen = (length > TYPED * np.abs(left[0])) & (highest > np.maximum(left[1], right[1]))
    chosen &= highest + beyond(left, right) >= least[lanes]
    return at[chosen], lanes[chosen]


def beyond(left: Array, right: Array) -> Array:
    """(c,) how far the motion may be from the quintic through what is known at two times; see `peak`."""
    return np.asarray(BEYOND * np.abs(apart(right[0] - left[0], left[1:], right[1:])))


def peak(left: Array, right: Array) -> tuple[Array, Array]:
    """Times and heights (c,) of the highest peaks of the quintics through what is known at two times; -inf where none.

    Args:
        left: (4, c) time in s, value, and first and second derivative.
        right: likewise, later.
    """
    length = right[0] - left[0]
    powers = np.array(quintic(length, left[1:], right[1:]))
    slope = np.arange(5, 0, -1)[:, None] * powers[:-1]
    bend = np.arange(4, 0, -1)[:, None] * slope[:-1]
    places = np.linspace(0.0, 1.0, 7)[:, None]
    heights, slopes = np.polyval(powers, places), np.polyval(slope, places)
    turns = (slopes[:-1] > 0) & (slopes[1:] < 0)
    first = np.where(turns, np.maximum(heights[:-1], heights[1:]), -np.inf).argmax(axis=0)

    def slopes_at(chosen: Chosen, u: Array) -> tuple[Array, Array]:
        return np.polyval(slope[:, chosen], u), np.polyval(bend[:, chosen], u)

    u = zeros(slopes_at, places[first, 0], places[first + 1, 0], rising=False, iterations=5)
    height = np.where(turns.any(axis=0), np.polyval(powers, u), -np.inf)
    # the motion is followed up to there, and not to the ends of the interval themselves
    return left[0] + np.clip(u, 1e-4, 1.0 - 1e-4) * length, height


@dataclass(frozen=True, eq=False)
class Rises:
    """The first rises through zero.

    Args:
        at: (k,) samples before; behind the last one where there is none.
        t: (k,) times, s; infinite where there is none.
    """

    at: Index
    t: Array


def first_rises(t: Array, jets: Array, there: There) -> Rises:
    """Where a quantity first is above zero.

    Args:
        t: (m, k) times of the samples, s.
        jets: (3, m, k) values, below zero at the first sample, and their first two derivatives by time.
        there: follows the motion from a sample.
    """
    above = jets[0] > 0.0
    seen = above.any(axis=0)
    at = np.where(seen, above.argmax(axis=0) - 1, len(t) - 1)
    upper = np.where(seen, np.take_along_axis(t, np.minimum(at + 1, len(t) - 1)[None], axis=0)[0], np.inf)
    for sample, lane, time in zip(*_hidden(t, jets, at, there), strict=True):
        if time < upper[lane]:
            at[lane], upper[lane] = sample, time
    lanes = np.flatnonzero(np.isfinite(upper))
    times = np.full(t.shape[1], np.inf)
    if lanes.size:
        times[lanes] = _rise(t[at[lanes], lanes], upper[lanes], at[lanes], lanes, there)
    return Rises(at, times)


def _hidden(t: Array, jets: Array, until: Index, there: There) -> tuple[list[int], list[int], list[float]]:
    """Samples, lanes and times of values above zero between samples that are not, up to samples (k,)."""
    top, bottom = jets[0].max(axis=0), jets[0].min(axis=0)
    size = top - bottom
    at, lanes = likely(t, jets, np.zeros_like(top), top, size)
    early = at < until[lanes]
    at, lanes = at[early], lanes[early]
    left, right = (np.array([t[k, lanes], *jets[:, k, lanes]]) for k in (at, at + 1))
    rises: tuple[list[int], list[int], list[float]] = [], [], []
    for _ in range(20):
        if not lanes.size:
            break
        times, height = peak(left, right)
        on = height + beyond(left, right) > TYPED * size[lanes]
        at, lanes, left, right, times = at[on], lanes[on], left[:, on], right[:, on], times[on]
        if not lanes.size:
            break
        middle = np.array([times, *there(at, lanes, times)])
        rose = middle[1] > 0.0
        for place, more in enumerate((at, lanes, times)):
            rises[place].extend(more[rose].tolist())
        at, lanes = (np.tile(values[~rose], 2) for values in (at, lanes))
        left = np.concatenate([left[:, ~rose], middle[:, ~rose]], axis=1)
        right = np.concatenate([middle[:, ~rose], right[:, ~rose]], axis=1)
    return rises


def _rise(low: Array, high: Array, at: Index, lanes: Index, there: There) -> Array:
    """Times (c,) of a rise between two times (c,)."""

    def course(chosen: Chosen, times: Array) -> tuple[Array, Array]:
        value, slope, _ = there(at[chosen], lanes[chosen], times)
        return value, slope

    nothing = ROUNDING * (np.abs(high) + ROUNDINGS * (high - low))
    return zeros(course, low, high, iterations=100, xtol=nothing)
