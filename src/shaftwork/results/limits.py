"""Quantities at times at which they are 0/0 or beyond all bounds: what they go to inside the run, on one side."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from shaftwork.results.observer import Array

ASIDE = (1e-13, 1e-11, 1e-9, 1e-7, 1e-6)
"""How far aside a value is looked for, of the time or of 1 s, and of a shorter run of that."""
ALIKE = 1e-4
"""A value that is the same but for this fraction of it at twice the distance is what the quantity goes to."""


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
        places = [np.clip(times + way * part * distance * scale, steps[0], steps[-1]) for part in (1, 2)]
        order = [np.argsort(place, kind="stable") for place in places]
        values = [np.empty_like(limit), np.empty_like(limit)]
        for found, place, ranks in zip(values, places, order, strict=True):
            found[ranks] = read(place[ranks])
        with np.errstate(invalid="ignore"):
            settled = np.isnan(limit) & (np.abs(values[0] - values[1]) <= ALIKE * np.abs(values[0]))
        limit[settled] = values[0][settled]
        empty = np.isnan(near) & np.isfinite(values[0])
        near[empty] = values[0][empty]
    return limit, near
