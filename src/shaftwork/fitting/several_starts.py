"""Fits from several starts, of which the best is taken."""

from __future__ import annotations

import math
from collections.abc import Callable
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shaftwork.codegen.array_form.elements import Array
from shaftwork.core.errors import AccuracyWarning, ShaftworkError
from shaftwork.core.notices import muted
from shaftwork.fitting.curves import Scaling
from shaftwork.fitting.estimation import Curves, Estimate, estimate
from shaftwork.fitting.spreads import Data
from shaftwork.numerics.even_points import even_points


def estimates(
    curves: Curves,
    data: Data,
    starts: Array,
    bounds: tuple[Array, Array],
    beginning: tuple[Curves, NDArray[np.bool_]] | None,
    stretch: Callable[[Array], Array],
) -> tuple[Estimate, ...]:
    """Fits to the end from the first of starts (k, m) and from the best quarter of the others, best first.

    Raises:
        SimulationError: the motion at the first start cannot be computed; others without one are left out.
    """
    ends = [estimate(curves, data, starts[0], bounds, beginning, stretch=stretch)]
    with muted(AccuracyWarning):  # most are passed over
        glances = [end for point in starts[1:] for end in _ends(curves, data, point, bounds, beginning, (2, 10))]
    best = sorted(glances, key=attrgetter("deviance"))[: math.ceil(len(starts[1:]) / 4)]
    ends += [end for one in best for end in _ends(curves, data, one.unknowns, bounds, stretch=stretch)]
    return tuple(sorted(ends, key=attrgetter("deviance")))


def _ends(*arguments: Any, **options: Any) -> list[Estimate]:
    """What `estimate` gives, or nothing where there is no motion."""
    try:
        return [estimate(*arguments, **options)]
    except ShaftworkError:
        return []


def starts_from(scaling: Scaling, start: Array, bounds: tuple[Array, Array], count: int, seed: int) -> Array:
    """(count, m) the start, and others: between bounds where both are there, else within a factor of two of it.

    Between zero and a bound the values themselves are spread evenly, of which the logarithm has no end.
    """
    values = np.array([scaling.values(bound) for bound in bounds])
    closed, reach = np.isfinite(values).all(axis=0), math.log(2.0)
    from_zero = closed & ~np.isfinite(bounds[0])
    low = np.where(closed, bounds[0], np.maximum(start - reach, bounds[0]))
    high = np.where(closed, bounds[1], np.minimum(start + reach, bounds[1]))
    low, high = np.where(from_zero, 0.0, low), np.where(from_zero, values[1], high)
    points = even_points(low, high, count - 1, seed)
    with np.errstate(divide="ignore"):
        points = np.where(from_zero, scaling.unknowns(np.where(from_zero, points, scaling.first)), points)
    return np.vstack([start, points])
