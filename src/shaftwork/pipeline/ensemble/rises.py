"""Where a quantity first rises through zero in every lane, between the samples too."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shaftwork.codegen.elements import Array
from shaftwork.numerics.zeros import Chosen, zeros
from shaftwork.pipeline.ensemble.extremes import NEARLY, Index, There, beyond, likely, peak

NEAR = 1e-9
"""Of the range: a top that is so near zero need not be found."""
MOST_ROUNDS, MOST_ITERATIONS = 12, 100
ROUNDING, ROUNDINGS = 2 * float(np.finfo(float).eps), 16
"""A time is known to rounding, and to so many roundings of the step."""


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
    own = np.flatnonzero(np.isfinite(upper))
    times = np.full(t.shape[1], np.inf)
    if own.size:
        times[own] = _rise(t[at[own], own], upper[own], at[own], own, there)
    return Rises(at, times)


def _hidden(t: Array, jets: Array, until: Index, there: There) -> tuple[list[int], list[int], list[float]]:
    """Samples, lanes and times of values above zero between samples that are not, up to samples (k,)."""
    top, bottom = jets[0].max(axis=0), jets[0].min(axis=0)
    size = top - bottom
    at, own = likely(t, jets, np.zeros_like(top), top - NEARLY * size)
    early = at < until[own]
    at, own = at[early], own[early]
    left, right = (np.array([t[k, own], *jets[:, k, own]]) for k in (at, at + 1))
    found: tuple[list[int], list[int], list[float]] = [], [], []
    for _ in range(MOST_ROUNDS):
        if not own.size:
            break
        times, height = peak(left, right)
        on = height + beyond(left, right) > NEAR * size[own]
        at, own, left, right, times = at[on], own[on], left[:, on], right[:, on], times[on]
        if not own.size:
            break
        middle = np.array([times, *there(at, own, times)])
        rose = middle[1] > 0.0
        for place, more in enumerate((at, own, times)):
            found[place].extend(more[rose].tolist())
        at, own = (np.tile(values[~rose], 2) for values in (at, own))
        left = np.concatenate([left[:, ~rose], middle[:, ~rose]], axis=1)
        right = np.concatenate([middle[:, ~rose], right[:, ~rose]], axis=1)
    return found


def _rise(low: Array, high: Array, at: Index, own: Index, there: There) -> Array:
    """Times (c,) of a rise between two times (c,)."""

    def course(chosen: Chosen, times: Array) -> tuple[Array, Array]:
        value, slope, _ = there(at[chosen], own[chosen], times)
        return value, slope

    nothing = ROUNDING * (np.abs(high) + ROUNDINGS * (high - low))
    return zeros(course, low, high, iterations=MOST_ITERATIONS, xtol=nothing)
