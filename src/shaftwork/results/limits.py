"""Quantities at times at which they are 0/0 or beyond all bounds: what they go to inside the run, on one side."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from shaftwork.results.observer import Array

ASIDE = (1e-13, 1e-11, 1e-9, 1e-7, 1e-6)
"""How far aside a value is looked for, of the time or of 1 s, and of a shorter run of that."""
ALIKE = 1e-4
"""A value that is the same but for this fraction of it at twice the distance is what the quantity goes to, to so many
digits; one that falls as a power of the distance goes to zero where what that power leaves is below this fraction."""
SLOWEST = 0.95
"""Of a difference is left at half the distance, at most, where a power of the distance falls: the 13th root leaves so
much, and what falls more slowly cannot be told from a pole of the logarithm."""


def beside(read: Callable[[Array], Array], times: Array, steps: Array) -> tuple[Array, Array]:
    """What a quantity goes to on the side of its step at times at which it has no finite value.

    Args:
        read: from ascending times (k,) to values (k, ...).
        times: (k,) ascending, s.
        steps: (s,) times between which the motion is smooth, s.

    Returns:
        (k, ...) the limits, not a number where there is none, and finite values next to the times.
    """
    scale = min(float(steps[-1] - steps[0]), 1.0) * np.maximum(np.abs(times), 1.0)
    before = np.append(times[1:] == times[:-1], False)  # of a time listed twice the first is before what jumps there
    following = np.append(steps, np.inf)[np.searchsorted(steps, times, side="right")]
    way = np.where(before | (following - times <= 2 * ASIDE[0] * scale) | (times >= steps[-1]), -1.0, 1.0)
    limit: Array = np.full_like(read(times), np.nan)
    near = limit.copy()
    for distance in ASIDE:
        places = [np.clip(times + way * part * distance * scale, steps[0], steps[-1]) for part in (1, 2, 4)]
        order = [np.argsort(place, kind="stable") for place in places]
        values = [np.empty_like(limit) for _ in places]
        for found, place, ranks in zip(values, places, order, strict=True):
            found[ranks] = read(place[ranks])
        with np.errstate(invalid="ignore", divide="ignore"):
            left = (values[1] - values[0]) / (values[2] - values[1])  # of each difference at half the distance
            falls = (left > 0) & (left < SLOWEST)
            goes_to = np.where(falls, values[0] - (values[1] - values[0]) * left / (1 - left), values[0])
            settles = np.isnan(limit) & (np.abs(values[0] - values[1]) <= ALIKE * np.abs(values[0]))
            vanishes = np.isnan(limit) & falls & (np.abs(goes_to) <= ALIKE * np.abs(values[0]))
        limit[settles] = goes_to[settles]
        limit[vanishes] = 0.0
        empty = np.isnan(near) & np.isfinite(values[0])
        near[empty] = values[0][empty]
    return limit, near
