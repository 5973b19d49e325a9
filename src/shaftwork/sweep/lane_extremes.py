"""The largest value of a quantity in every lane, and its first rise through zero, between the samples too.

Where its slope falls through zero between two samples, or does so and rises again, the polynomial through its values
and its first two derivatives at both says about when. From the first of these samples the motion is followed to that
time, and the polynomial from there gives the height, or Newton's step on the slope where it is hardly away: right to
the tolerance of the motion, whatever the distance of the samples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from shaftwork.codegen.array_form.elements import Array
from shaftwork.numerics.hermite import BEYOND, apart, inner, quintic
from shaftwork.numerics.zeros import Chosen, zeros

NEARLY = 0.1
"""Of the range: so near to the top a peak and a dip between the same two samples are looked for."""
SHORT = 1e-9
"""Of the time: between samples that are closer the larger one is the peak."""
PLACES, NEWTON = 7, 5
"""Places at which a polynomial is looked at, and steps to a peak between two of them."""
INSIDE = 1e-4
"""Of an interval: the motion is followed to so far from its ends."""
NEAR = 1e-9
"""Of the range: a peak is known where Newton's step rises by less, or a polynomial misses it by less; one that is so
near zero need not be found."""
CLOSE = 0.01
"""Of an interval: a polynomial is trusted so far from where it has been put right."""
MOST_ROUNDS, MOST_ITERATIONS = 20, 100
ROUNDING, ROUNDINGS = 2 * float(np.finfo(float).eps), 16
"""A time is known to rounding, and to so many roundings of the step."""

Index = NDArray[np.intp]
Mask = NDArray[np.bool_]
There = Callable[[Index, Index, Array], Array]
"""Jets (3, c) at times (c,) in s, from samples (c,) of lanes (c,)."""


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
    at, lanes = likely(t, jets, tops, tops - NEARLY * size)
    left, right = (np.array([t[k, lanes], *jets[:, k, lanes]]) for k in (at, at + 1))
    times, height = peak(left, right)
    missed, surely = beyond(left, right), tops.copy()
    np.maximum.at(surely, lanes, height - missed)
    on = np.isfinite(height) & (height + missed >= surely[lanes])
    for _ in range(MOST_ROUNDS):
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
        near = NEAR * size[lanes]
        # what a polynomial misses grows with the cube of the distance from a point that it goes through
        part = np.abs(times - before) / room
        sure = (part < CLOSE) & (missed * part**3 < near)
        np.maximum.at(tops, lanes[sure], height[sure])
        on = ~sure & (height + beyond(left, right) > tops[lanes] + near)
    tops[lanes[on]] = np.nan
    return np.asarray(tops)


def likely(t: Array, jets: Array, least: Array, near: Array) -> tuple[Index, Index]:
    """Samples (c,) of lanes (c,) after which there may be a peak of at least so much (k,).

    The slope falls through zero, or, where one of the samples is near (k,) the top, does so and rises again. A
    polynomial is no higher than the highest of its Bernstein coefficients.
    """
    up, high = jets[1] > 0, jets[0] >= near
    at, lanes = np.divmod(np.flatnonzero((up[:-1] & ~up[1:]) | high[:-1] | high[1:]), t.shape[1])
    left, right = (np.array([t[k, lanes], *jets[:, k, lanes]]) for k in (at, at + 1))
    length = right[0] - left[0]
    highest = reduce(np.maximum, inner(length, left[1:], right[1:]))
    chosen = (length > SHORT * np.abs(left[0])) & (highest > np.maximum(left[1], right[1]))
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
    powers = quintic(length, left[1:], right[1:])
    slope = [power * c for power, c in zip(range(5, 0, -1), powers, strict=False)]
    bend = [power * c for power, c in zip(range(4, 0, -1), slope, strict=False)]
    places = np.linspace(0.0, 1.0, PLACES)[:, None]
    heights, slopes = _horner(powers, places), _horner(slope, places)
    turns = (slopes[:-1] > 0) & (slopes[1:] < 0)
    first = np.where(turns, np.maximum(heights[:-1], heights[1:]), -np.inf).argmax(axis=0)

    def slopes_at(chosen: Chosen, u: Array) -> tuple[Array, Array]:
        return _horner([c[chosen] for c in slope], u), _horner([c[chosen] for c in bend], u)

    u = zeros(slopes_at, places[first, 0], places[first + 1, 0], rising=False, iterations=NEWTON)
    height = np.where(turns.any(axis=0), _horner(powers, u), -np.inf)
    return left[0] + np.clip(u, INSIDE, 1.0 - INSIDE) * length, height


def _horner(coefficients: tuple[Array, ...] | list[Array], u: Array) -> Array:
    """A polynomial, its highest power first."""
    value = coefficients[0]
    for coefficient in coefficients[1:]:
        value = value * u + coefficient
    return value


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
    at, lanes = likely(t, jets, np.zeros_like(top), top - NEARLY * size)
    early = at < until[lanes]
    at, lanes = at[early], lanes[early]
    left, right = (np.array([t[k, lanes], *jets[:, k, lanes]]) for k in (at, at + 1))
    rises: tuple[list[int], list[int], list[float]] = [], [], []
    for _ in range(MOST_ROUNDS):
        if not lanes.size:
            break
        times, height = peak(left, right)
        on = height + beyond(left, right) > NEAR * size[lanes]
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
    return zeros(course, low, high, iterations=MOST_ITERATIONS, xtol=nothing)
