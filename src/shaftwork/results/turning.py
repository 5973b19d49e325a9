"""Where a quantity turns: its peaks and valleys, from the solver's dense output instead of the output times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shaftwork.results.course import Read, course
from shaftwork.results.observer import Array

ROUNDING = 1e-3
"""A peak that is higher by this fraction of what counts as a change is no later one."""


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
    times, values = course(read, steps, even=True).points()
    turns = _turns(values, smallest * float(np.ptp(values)))
    return TurningPoints(times[turns], values[turns])


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
