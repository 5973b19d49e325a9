"""The largest value of a quantity in every lane, between the samples too."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from shaftwork.codegen.elements import Array
from shaftwork.integrate.lanes import Lanes, run_lanes

if TYPE_CHECKING:
    from shaftwork.pipeline.ensemble_equations import Equations

NEARLY = 0.02
"""Peaks that seem lower than the highest by less than this part of the range may yet be higher."""
SURELY = 2e-3
"""The same where they are better known."""
QUARTIC = 33
"""Places at which a quartic is looked at."""
MOST = 4
"""Peaks of a lane that are looked at closely."""
NODES, FINE = 9, 129
"""Of the polynomial through a peak, and places at which it is looked at."""


def largest(
    equations: Equations, lanes: Lanes, p: Array, row: int, sign: float, samples: Array, before: Array, rtol: float
) -> Array:
    """(k,) the largest value of a quantity, times a sign.

    Args:
        equations: of the stretch.
        lanes: the stretch.
        p: (parameters, k).
        row: of the quantity among those that are shown.
        sign: 1 or -1.
        samples: (m, k) its values.
        before: (k,) what was found earlier: a lower peak need not be known better.
        rtol: relative tolerance.
    """
    values = sign * samples
    best = values.max(axis=0)
    places, owners = _candidates(values, np.maximum(best, before))
    first, last = np.maximum(places - 1, 0), np.minimum(places + 1, len(values) - 1)
    start, end = lanes.t[first, owners], lanes.t[last, owners]
    lasts = end > start
    if not lasts.any():
        return np.asarray(best)
    owners, first, start, end = owners[lasts], first[lasts], start[lasts], end[lasts]
    nodes = 0.5 * (1.0 - np.cos(np.pi * np.arange(NODES) / (NODES - 1)))
    times = start + nodes[:, None] * (end - start)
    size = len(equations.model.states)
    x = lanes.x[first, :size, owners].T
    sides = equations.sides
    near = run_lanes(equations.program, x, p[:, owners], 0 * sides, np.zeros((len(sides), owners.size)), times, rtol)
    shown = sign * equations.shown(near.t, near.x[:, :size].swapaxes(0, 1), p[:, owners])[row]
    np.maximum.at(best, owners[near.good], _top(shown)[near.good])
    return np.asarray(best)


def _candidates(values: Array, best: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Samples near which a peak may be the highest one, and their lanes.

    How high a peak is, the parabola through three samples tells nearly, and the quartic through five nearly enough.
    """
    at, own = np.nonzero((values[1:-1] >= values[:-2]) & (values[1:-1] > values[2:]))
    at += 1
    ends = [np.flatnonzero(values[edge] > values[beside]) for edge, beside in ((0, 1), (-1, -2))]
    at = np.concatenate([at, *(np.full(end.size, k) for end, k in zip(ends, (0, len(values) - 1), strict=True))])
    own = np.concatenate([own, *ends])
    size = values.max(axis=0) - values.min(axis=0)
    for order, margin in ((1, NEARLY), (2, SURELY)):
        height = _height(values, at, own, order)
        highest = best.copy()
        np.maximum.at(highest, own, height)
        kept = height >= (highest - margin * size)[own]
        at, own, height = at[kept], own[kept], height[kept]
    sorting = np.lexsort((-height, own))
    at, own = at[sorting], own[sorting]
    rank = np.arange(own.size) - np.searchsorted(own, own)
    return at[rank < MOST], own[rank < MOST]


def _height(values: Array, at: NDArray[np.intp], own: NDArray[np.intp], order: int) -> Array:
    """The largest value about samples of the polynomials through as many samples to both sides; -inf at an end."""
    middle = np.clip(at, order, len(values) - 1 - order)
    near = np.array([values[middle + k, own] for k in range(-order, order + 1)])
    if order == 1:
        bend = near[0] + near[2] - 2 * near[1]
        with np.errstate(divide="ignore", invalid="ignore"):
            vertex = (near[0] - near[2]) / (2 * bend)
        return np.where((bend < 0) & (np.abs(vertex) <= 1), near[1] - (near[0] - near[2]) * vertex / 4, -np.inf)
    return np.asarray((_onto(np.arange(-order, order + 1.0), np.linspace(-order, order, QUARTIC)) @ near).max(axis=0))


def _onto(points: Array, fine: Array) -> Array:
    """(fine, points) from values at points to values between them, by the polynomial through all of them."""
    half, degree = points[-1], len(points) - 1
    return np.asarray(
        chebyshev.chebvander(fine / half, degree) @ np.linalg.inv(chebyshev.chebvander(points / half, degree))
    )


def _top(values: Array) -> Array:
    """(k,) maxima of the polynomials through values (nodes, k) at the extremes of Chebyshev's polynomial."""
    shown = _onto(-np.cos(np.pi * np.arange(NODES) / (NODES - 1)), np.linspace(-1.0, 1.0, FINE)) @ values
    middle, owners = np.clip(shown.argmax(axis=0), 1, FINE - 2), np.arange(values.shape[1])
    y0, y1, y2 = (shown[middle + k, owners] for k in (-1, 0, 1))
    bend = 2 * y1 - y0 - y2
    with np.errstate(divide="ignore", invalid="ignore"):
        rise = np.where((bend > 0) & (y1 >= y0) & (y1 >= y2), (y2 - y0) ** 2 / (8 * bend), 0.0)
    return np.asarray(shown.max(axis=0) + rise)
