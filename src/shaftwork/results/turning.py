"""Where a quantity turns: its peaks and valleys, from the solver's dense output instead of the output times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shaftwork.results.observer import Array

Read = Callable[[Array], Array]
"""From ascending times (k,) to the values of a quantity there."""

PANELS, SAMPLES = 4, 2000
"""Of a step and of the whole run at least, before the panels are halved: an exact engine needs few steps."""
HALVINGS = 9
ROUNDING = 1e-3
"""A peak that is higher by this fraction of what counts as a change is no later one."""
SETTLED = 0.01
"""The panels are halved until as many turning points are found as before and the way up and down is longer by less."""
ROUNDS = 4
"""Of parabolas through three values about an extreme; the bracket of a smooth one gets an eighth as wide each time."""


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
    panels = max(PANELS, SAMPLES // len(steps))
    found, way = np.empty(0, dtype=np.intp), 0.0
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
    inside[:, -1] = last  # which the sum may miss by a rounding
    return np.unique(np.append(inside, steps[-1]))


def _turns(values: Array, smallest: float) -> NDArray[np.intp]:
    """Indices of the first value and of every peak and valley after it that differ by more than `smallest`."""
    slopes = np.sign(np.diff(values))
    moving = np.flatnonzero(slopes)
    extremes = moving[:-1][slopes[moving[1:]] != slopes[moving[:-1]]] + 1  # of a rest at the top its begin
    turns = [0]
    reached = 0  # the furthest since the last turn; it is a turn once the way back from it is long enough
    for k in [*extremes.tolist(), len(values) - 1]:
        step = values[k] - values[reached]
        if reached != turns[-1] and step * (values[reached] - values[turns[-1]]) >= 0:
            reached = k if abs(step) > ROUNDING * smallest else reached
        elif abs(step) > smallest:
            if reached:
                turns.append(reached)
            reached = k
    return np.array([*turns, reached] if reached else turns)


def _refined(read: Read, t: Array, found: NDArray[np.intp], peaks: Array) -> tuple[Array, Array]:
    """Times and values of the extremes near samples, for peaks 1 and valleys -1; never lower than the sample itself."""
    rows, sign = np.arange(len(found))[:, None], peaks[:, None]
    beside = 2.0 * np.spacing(t[found])  # the two sides of a step's end are one instant
    low = np.where(t[found] - t[found - 1] > beside, found - 1, found - 2)
    high = np.where(t[found + 1] - t[found] > beside, found + 1, found + 2)
    x = t[np.stack([np.maximum(low, 0), found, np.minimum(high, len(t) - 1)], axis=1)]
    y = sign * _read_all(read, x)
    for _ in range(ROUNDS):
        new = _closer(x, y)
        x, y = np.hstack([x, new]), np.hstack([y, sign * _read_all(read, new)])
        order = np.argsort(x, axis=1, kind="stable")
        x, y = x[rows, order], y[rows, order]
        near = np.clip(np.argmax(y, axis=1), 1, x.shape[1] - 2)[:, None] + np.array([-1, 0, 1])
        x, y = x[rows, near], y[rows, near]
    best = np.argmax(y, axis=1)[:, None]
    return x[rows, best][:, 0], peaks * y[rows, best][:, 0]


def _closer(x: Array, y: Array) -> Array:
    """(k, 3) times to look at next: the vertex of the parabola, or the middle of the wider side, and about it."""
    (left, right), (up, down) = np.diff(x).T, np.diff(y).T
    bend = right * up - left * down
    with np.errstate(divide="ignore", invalid="ignore"):
        vertex = x[:, 1] + 0.5 * (right**2 * up + left**2 * down) / bend
    inside = (bend > 0.0) & (vertex > x[:, 0]) & (vertex < x[:, 2])
    wider = np.where(left > right, x[:, 1] - 0.5 * left, x[:, 1] + 0.5 * right)
    centre = np.where(inside, vertex, wider)[:, None]
    around = np.maximum(left, right)[:, None] * np.array([-0.125, 0.0, 0.125])
    return np.asarray(np.clip(centre + around, x[:, :1], x[:, 2:]))


def _read_all(read: Read, times: Array) -> Array:
    """A quantity at times in any order: brackets of neighbours overlap."""
    order = np.argsort(times, axis=None, kind="stable")
    values = np.empty(times.size)
    values[order] = read(times.ravel()[order])
    return values.reshape(times.shape)
