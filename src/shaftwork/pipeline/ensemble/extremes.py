"""The largest value of a quantity in every lane, between the samples too.

Where its slope falls through zero between two samples, or does so and rises again, the polynomial through its values
and its first two derivatives at both says about when. From the first of these samples the motion is followed to that
time, and Newton's step on the slope gives the height: right to the tolerance of the motion, whatever the distance of
the samples.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from shaftwork.codegen.elements import Array

DATA = 3
"""What is known of a quantity: its value and its first two derivatives by time."""
NEARLY, SURELY = 0.01, 2e-3
"""Peaks that seem lower than the highest by less than these parts of the range may yet be higher: seen by a tangent,
and by the polynomial."""
SHORT = 1e-9
"""Of the time: between samples that are closer the larger one is the peak."""
PLACES, NEWTON = 7, 3
"""Places at which a polynomial is looked at, and steps from the highest of them to its peak."""
INSIDE = 1e-4
"""Of an interval: a peak is looked for so far from its ends."""
NEAR = 1e-9
"""Of the range: a peak is known where Newton's step rises by less."""
MOST_ROUNDS = 10

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
    found, size = np.maximum(best, top), top - bottom
    at, own = _likely(t, jets, found - NEARLY * size)
    left, right = (np.array([t[k, own], *jets[:, k, own]]) for k in (at, at + 1))
    times, height = _peak(left, right)
    highest = found.copy()
    np.maximum.at(highest, own, height)
    kept = (height >= (highest - SURELY * size)[own]) & _holds_a_peak(left, right, height)
    at, own, left, right, times = at[kept], own[kept], left[:, kept], right[:, kept], times[kept]
    for _ in range(MOST_ROUNDS):
        if not own.size:
            break
        jet = there(at, own, times)
        rise = _rise(jet)
        near = rise < NEAR * size[own]
        np.maximum.at(found, own, jet[0] + np.where(near, rise, 0.0))
        left, right = _narrowed(left, np.array([times, *jet]), right)
        times, height = _peak(left, right)
        on = ~near & _holds_a_peak(left, right, height)
        at, own, left, right, times = at[on], own[on], left[:, on], right[:, on], times[on]
    found[own] = np.nan
    return np.asarray(found)


def _likely(t: Array, jets: Array, least: Array) -> tuple[Index, Index]:
    """Samples (c,) of lanes (c,) after which there may be a peak of at least so much (k,)."""
    values, slopes, bends = jets
    at, own = np.nonzero((slopes[:-1] > 0) & (slopes[1:] < 0))
    length = t[at + 1, own] - t[at, own]
    # a curve that bends down is no higher than where its two tangents meet
    (y0, d0), (y1, d1) = ((values[k, own], slopes[k, own]) for k in (at, at + 1))
    bound = y0 + d0 * (y1 - y0 - d1 * length) / (d0 - d1)
    kept = (length > SHORT * np.abs(t[at, own])) & (bound >= least[own])
    # a peak and a dip between the same two samples leave the sign of the slope as it was
    high, whose = np.nonzero(np.maximum(values[:-1], values[1:]) >= least)
    (d0, b0), (d1, b1) = ((slopes[k, whose], bends[k, whose]) for k in (high, high + 1))
    length = t[high + 1, whose] - t[high, whose]
    turns = np.minimum(np.abs(d0), np.abs(d1)) < length * np.maximum(np.abs(b0), np.abs(b1))
    both = (d0 * d1 > 0) & turns & (length > SHORT * np.abs(t[high, whose]))
    return np.concatenate([at[kept], high[both]]), np.concatenate([own[kept], whose[both]])


def _holds_a_peak(left: Array, right: Array, height: Array) -> Mask:
    """(c,) whether there is a peak between two times, of which a height is known about."""
    return np.asarray(((left[2] > 0) & (right[2] < 0)) | (height > np.maximum(left[1], right[1])))


def _narrowed(left: Array, middle: Array, right: Array) -> tuple[Array, Array]:
    """The part of an interval that holds its peak, by the slope and the bend in the middle."""
    rising, dips = middle[2] > 0, middle[3] > 0
    later = np.where(rising, ~(dips & (right[2] > 0)), dips & (left[2] < 0))
    return np.where(later, middle, left), np.where(later, right, middle)


def _rise(jet: Array) -> Array:
    """(c,) how much higher a peak is than a value (3, c) near it; infinite where the curve does not bend down."""
    _, slope, bend = jet
    down = bend < 0
    return np.where(down, slope**2 / np.where(down, -2.0 * bend, 1.0), np.inf)


def _peak(left: Array, right: Array) -> tuple[Array, Array]:
    """Times and heights (c,) of the largest values of the quintics through what is known at two times.

    Args:
        left: (4, c) time in s, value, and first and second derivative.
        right: likewise, later.
    """
    length = right[0] - left[0]
    y0, y1 = left[1], right[1]
    v0, v1 = left[2] * length, right[2] * length
    a0, a1 = left[3] * length**2, right[3] * length**2
    rise = y1 - y0
    quintic = (
        6 * rise - 3 * (v0 + v1) - (a0 - a1) / 2,
        -15 * rise + 8 * v0 + 7 * v1 + (3 * a0 - 2 * a1) / 2,
        10 * rise - 6 * v0 - 4 * v1 - (3 * a0 - a1) / 2,
        a0 / 2,
        v0,
        y0,
    )
    places = np.linspace(INSIDE, 1.0 - INSIDE, PLACES)
    u = places[_horner(quintic, places[:, None]).argmax(axis=0)]
    slope = [power * c for power, c in zip(range(5, 0, -1), quintic, strict=False)]
    bend = [power * c for power, c in zip(range(4, 0, -1), slope, strict=False)]
    for _ in range(NEWTON):
        bends = _horner(bend, u)
        step = _horner(slope, u) / np.where(bends < 0, bends, -np.inf)
        u = np.clip(u - step, INSIDE, 1.0 - INSIDE)
    return left[0] + u * length, _horner(quintic, u)


def _horner(coefficients: tuple[Array, ...] | list[Array], u: Array) -> Array:
    """A polynomial, its highest power first."""
    value = coefficients[0]
    for coefficient in coefficients[1:]:
        value = value * u + coefficient
    return value
