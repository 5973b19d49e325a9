"""Fits from several starts, of which the best is taken."""

from __future__ import annotations

import math
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shaftwork.codegen.array_form.elements import Array
from shaftwork.core.errors import AccuracyWarning, ShaftworkError
from shaftwork.core.notices import muted
from shaftwork.fitting.estimation import Curves, Data, Estimate, estimate
from shaftwork.numerics.even_points import even_points


def estimates(
    curves: Curves,
    data: Data,
    starts: Array,
    bounds: tuple[Array, Array],
    beginning: tuple[Curves, NDArray[np.bool_]] | None,
) -> tuple[Estimate, ...]:
    """Fits to the end from the first of starts (k, m) and from the best quarter of the others, best first.

    Raises:
        SimulationError: the motion at the first start cannot be computed; others without one are left out.
    """
    ends = [estimate(curves, data, starts[0], bounds, beginning)]
    with muted(AccuracyWarning):  # most are passed over
        glances = [end for point in starts[1:] for end in _ends(curves, data, point, bounds, beginning, (2, 10))]
    best = sorted(glances, key=attrgetter("misfit"))[: math.ceil(len(starts[1:]) / 4)]
    ends += [end for one in best for end in _ends(curves, data, one.unknowns, bounds)]
    return tuple(sorted(ends, key=attrgetter("misfit")))


def _ends(*arguments: Any) -> list[Estimate]:
    """What `estimate` gives, or nothing where there is no motion."""
    try:
        return [estimate(*arguments)]
    except ShaftworkError:
        return []


def starts_from(start: Array, bounds: tuple[Array, Array], count: int, seed: int) -> Array:
    """(count, m) the start, and others: between bounds where both are there, else within a factor of two of it."""
    closed, reach = np.isfinite(bounds[0]) & np.isfinite(bounds[1]), math.log(2.0)
    low = np.where(closed, bounds[0], np.maximum(start - reach, bounds[0]))
    high = np.where(closed, bounds[1], np.minimum(start + reach, bounds[1]))
    return np.vstack([start, even_points(low, high, count - 1, seed)])
