"""Where a function of time passes through zero: one or many side by side; the sides of a jump."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from shaftwork.numerics.polynomials import Array
from shaftwork.numerics.tolerances import EPS, ROUNDINGS

LOOKS = np.array([0.004, 0.07, 0.19, 0.31, 0.42, 0.53, 0.61, 0.74, 0.83, 0.91, 0.996])
"""Shares of a step at which its inside is looked at: at no regular places, which a motion might share. The outermost
tell where a function goes from the ends."""
Chosen = slice | NDArray[np.bool_]
"""Some of many functions."""


def zero(
    function: Callable[[Array], Array],
    low: float,
    high: float,
    *,
    ends: Sequence[float] = (),
    xtol: float | None = None,
) -> float:
    """A zero between two places at which a function has different signs.

    Args:
        function: from places (1,) to values (1,).
        low: one place.
        high: the other.
        ends: the values there, where they are known.
        xtol: how exactly the zero is wanted; by default to four roundings of itself.

    Raises:
        ValueError: the signs are alike.
    """
    from scipy.optimize import brentq

    values = dict(zip((low, high), ends, strict=False))

    def value(place: float) -> float:
        return values[place] if place in values else float(function(np.array([place]))[0])

    if xtol is None:
        return float(brentq(value, low, high, xtol=np.finfo(float).tiny, rtol=4 * EPS))
    return float(brentq(value, low, high, xtol=xtol))


def zeros(
    function: Callable[[Chosen, Array], tuple[Array, Array]],
    low: Array,
    high: Array,
    *,
    rising: NDArray[np.bool_] | bool = True,
    iterations: int,
    xtol: Array | float = 0.0,
) -> Array:
    """(k,) zeros of k functions between two places each: Newton's steps, halves where they leave the interval.

    Args:
        function: from some of them and a place for each of these to their values and slopes there.
        low: (k,) lower places.
        high: (k,) upper places.
        rising: (k,) or for all: whether values go from below zero to above.
        iterations: at most.
        xtol: (k,) or for all: a zero that moves by no more, or lies between places no farther apart, is not improved.
    """
    low, high = low.copy(), high.copy()
    place, active = low + (high - low) / 2, np.ones(low.shape, dtype=bool)
    rising, xtol = np.broadcast_to(rising, low.shape), np.broadcast_to(xtol, low.shape)
    for _ in range(iterations):
        chosen: Chosen = slice(None) if active.all() else active
        here = place[chosen]
        value, slope = function(chosen, here)
        ahead = (value > 0) != rising[chosen]
        bottom, top = np.where(ahead, here, low[chosen]), np.where(ahead, high[chosen], here)
        with np.errstate(divide="ignore", invalid="ignore"):
            new = here - value / slope
        new = np.where((new >= bottom) & (new <= top), new, bottom + (top - bottom) / 2)
        moves = np.minimum(np.abs(new - here), top - bottom) > xtol[chosen]
        low[chosen], high[chosen], place[chosen] = bottom, top, new
        active[chosen] = moves
        if not moves.any():
            break
    return place


def just_before(time: float) -> float:
    """The time in s, less a few rounding units: an input that jumps there still has its value before the jump."""
    return time - ROUNDINGS * math.ulp(time)


def just_after(time: float) -> float:
    """The time in s and a few rounding units more: an input that jumps there has its value after the jump."""
    return time + ROUNDINGS * math.ulp(time)


def around(time: float) -> tuple[float, float]:
    """`just_before` and `just_after`."""
    return just_before(time), just_after(time)
