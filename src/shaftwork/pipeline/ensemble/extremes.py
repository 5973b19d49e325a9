"""The largest value of a quantity in every lane, between the samples too.

Its value and its first two derivatives at six samples make a polynomial of degree 17. With a sample for every other
step of the engine it is right to 1e-8 of the height of a wave.
"""

from __future__ import annotations

from math import factorial

import numpy as np
from numpy.typing import NDArray

from shaftwork.codegen.elements import Array

NODES, DATA = 6, 3
"""Samples about a peak, and what is known at each of them."""
NEARLY, SURELY = 0.01, 2e-3
"""Peaks that seem lower than the highest by less than these parts of the range may yet be higher: seen by a tangent,
and by the polynomial through the two samples beside them."""
COARSE, FINE = 5, 33
"""Places in an interval at which the polynomial through its ends, and that through six samples, are looked at."""

Index = NDArray[np.intp]


def largest(t: Array, jets: Array, best: Array) -> Array:
    """(k,) the largest values.

    Args:
        t: (m, k) times in s of the samples; a lane that has ended stays at its last time.
        jets: (3, m, k) values and their first and second derivative by time.
        best: (k,) what was found before: a lower peak need not be known better.
    """
    values, slopes = jets[0], jets[1]
    top, bottom = values.max(axis=0), values.min(axis=0)
    found, size = np.maximum(best, top), top - bottom
    at, own = np.nonzero((slopes[:-1] > 0) & (slopes[1:] < 0))
    length = t[at + 1, own] - t[at, own]
    # a curve that bends down is no higher than where its two tangents meet
    (y0, d0), (y1, d1) = ((values[k, own], slopes[k, own]) for k in (at, at + 1))
    bound = y0 + d0 * (y1 - y0 - d1 * length) / (d0 - d1)
    kept = (length > 0) & (bound >= (found - NEARLY * size)[own])
    at, own = at[kept], own[kept]
    height = _highest(t, jets, at, own, at + np.arange(2)[:, None], COARSE)
    highest = found.copy()
    np.maximum.at(highest, own, height)
    kept = height >= (highest - SURELY * size)[own]
    at, own, height = at[kept], own[kept], height[kept]
    samples = (1 + np.count_nonzero(t[1:] > t[:-1], axis=0))[own]
    few = samples < NODES  # in a phase that is over at once its two ends are enough
    np.maximum.at(found, own[few], height[few])
    at, own, samples = at[~few], own[~few], samples[~few]
    first = np.clip(at - NODES // 2 + 1, 0, samples - NODES)
    np.maximum.at(found, own, _highest(t, jets, at, own, first + np.arange(NODES)[:, None], FINE))
    return np.asarray(found)


def _highest(t: Array, jets: Array, at: Index, own: Index, rows: Index, places: int) -> Array:
    """The largest values in intervals of Newton's polynomials through all that is known at some samples.

    Args:
        t: (m, k) s.
        jets: (3, m, k).
        at: (c,) samples at which the intervals begin.
        own: (c,) lanes.
        rows: (nodes, c) samples through which each polynomial goes.
        places: in each interval.
    """
    scale = t[rows[-1], own] - t[rows[0], own]
    z = np.repeat((t[rows, own] - t[at, own]) / scale, DATA, axis=0)
    known = [np.repeat(jets[k][rows, own] * (scale**k / factorial(k)), DATA, axis=0) for k in range(DATA)]
    column, coefficients = known[0], [known[0][0]]
    for order in range(1, len(z)):
        rise, run = column[1:] - column[:-1], z[order:] - z[:-order]
        column = rise / np.where(run > 0, run, 1.0)
        if order < DATA:  # equal nodes have the derivative between them
            column = np.where(run > 0, column, known[order][: len(run)])
        coefficients.append(column[0])
    x = np.linspace(0.0, 1.0, places)[:, None] * (t[at + 1, own] - t[at, own]) / scale
    shown = np.zeros_like(x)
    for coefficient, node in zip(reversed(coefficients), z[::-1], strict=True):
        shown = shown * (x - node) + coefficient
    return _vertex(shown)


def _vertex(shown: Array) -> Array:
    """(k,) maxima of smooth curves (places, k) between equally spaced places."""
    middle, lanes = np.clip(shown.argmax(axis=0), 1, len(shown) - 2), np.arange(shown.shape[1])
    y0, y1, y2 = (shown[middle + k, lanes] for k in (-1, 0, 1))
    bend = 2 * y1 - y0 - y2
    with np.errstate(divide="ignore", invalid="ignore"):
        rise = np.where((bend > 0) & (np.abs(y2 - y0) <= 2 * bend), (y2 - y0) ** 2 / (8 * bend), 0.0)
    return np.asarray(np.maximum(shown.max(axis=0), y1 + rise))
