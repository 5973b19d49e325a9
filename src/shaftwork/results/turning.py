"""Where a quantity turns: its peaks and valleys, from the solver's dense output instead of the output times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shaftwork.results.observer import Array

Read = Callable[[Array], Array]
"""From ascending times (k,) to the values of a quantity there."""

PANELS = 8
"""Of one integration step, before they are halved."""
HALVINGS = 8
SETTLED = 0.01
"""The panels are halved until as many turning points are found as before and the way up and down is longer by less."""
WITHIN = np.linspace(0.0, 1.0, 5)
ROUNDS = 8
"""The bracket of a turning point becomes a quarter as wide each time, 1e-5 of a panel in the end; its value is good to
the square of this."""


@dataclass(frozen=True, eq=False)
class TurningPoints:
    """The first value, peaks and valleys in turn, and what the end has come to; one value where nothing changes.

    Args:
        t: (k,) times, s.
        values: (k,) in the unit of the quantity.
    """

    t: Array
    values: Array


def turning_points(read: Read, steps: Array, *, smallest: float) -> TurningPoints:
    """Peaks and valleys of a quantity, on both sides of a jump too.

    Args:
        read: the quantity at ascending times.
        steps: (s,) times between which it is smooth.
        smallest: changes up to this fraction of the whole range are no change; it keeps out the solver's noise.
    """
    panels, found, way = PANELS, np.empty(0, dtype=np.intp), 0.0
    for _ in range(HALVINGS):
        t = _sampled(steps, panels)
        values = read(t)
        before, shorter = len(found), way
        found, way = _turns(values, smallest * float(np.ptp(values))), float(np.abs(np.diff(values)).sum())
        if len(found) == before and way <= shorter * (1.0 + SETTLED):
            break
        panels *= 2
    inner = np.flatnonzero((found > 0) & (found < len(t) - 1))
    times, extremes = t[found], values[found]
    if len(inner):
        peaks = np.sign(extremes[inner] - extremes[inner - 1])
        times[inner], extremes[inner] = _refined(read, t, found[inner], peaks)
    return TurningPoints(times, extremes)


def _sampled(steps: Array, panels: int) -> Array:
    """Times in every step, its end just before what may jump there included."""
    first, last = steps[:-1], np.nextafter(steps[1:], steps[:-1])
    inside = first[:, None] + (last - first)[:, None] * np.linspace(0.0, 1.0, panels + 1)
    return np.unique(np.append(inside, steps[-1]))


def _turns(values: Array, smallest: float) -> NDArray[np.intp]:
    """Indices of the first value and of all that follow it as peak or valley by more than `smallest`, the end included."""
    slopes = np.sign(np.diff(values))
    moving = np.flatnonzero(slopes)
    extremes = moving[1:][slopes[moving[1:]] != slopes[moving[:-1]]]
    turns = [0]
    reached = 0  # the furthest since the last turn; it is a turn once the way back from it is long enough
    for k in [*extremes.tolist(), len(values) - 1]:
        onwards = (values[k] - values[reached]) * (values[reached] - values[turns[-1]])
        if reached != turns[-1] and onwards >= 0:
            reached = k
        elif abs(values[k] - values[reached]) > smallest:
            if reached:
                turns.append(reached)
            reached = k
    return np.array([*turns, reached] if reached else turns)


def _refined(read: Read, t: Array, found: NDArray[np.intp], peaks: Array) -> tuple[Array, Array]:
    """Times and values of the extremes near samples, for peaks 1 and valleys -1; never lower than the sample itself."""
    rows, middle = np.arange(len(found)), t[found]
    low, high = t[found - 1], t[found + 1]
    for _ in range(ROUNDS):
        sides = middle - low, high - middle
        times = np.hstack([low[:, None] + sides[0][:, None] * WITHIN, middle[:, None] + sides[1][:, None] * WITHIN[1:]])
        values = _read_all(read, times)
        best = np.argmax(peaks[:, None] * values, axis=1)
        low, high = times[rows, np.maximum(best - 1, 0)], times[rows, np.minimum(best + 1, times.shape[1] - 1)]
        middle = times[rows, best]
    return middle, values[rows, best]


def _read_all(read: Read, times: Array) -> Array:
    """A quantity at times in any order: brackets of neighbours overlap."""
    order = np.argsort(times, axis=None, kind="stable")
    values = np.empty(times.size)
    values[order] = read(times.ravel()[order])
    return values.reshape(times.shape)
