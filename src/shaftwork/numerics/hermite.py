"""The quintic through a value and its first two derivatives at two times, for functions that numba compiles.

A jet is a value with its first two derivatives by time.
"""

from __future__ import annotations

import numpy as np

from shaftwork.numerics.machine_code import inner

JET = 3
"""What is known of a quantity at a time: its value and its first two derivatives by time."""
EDGE = 1e-4
"""A peak is told no nearer to the ends of an interval than by this share of it: both parts of it are to be shorter."""
BEYOND = 0.2
"""Of the difference between the cubic and the quintic in the middle of an interval: so far the motion may be from the
quintic. Of a sine, whose samples are less than half a period apart, it is at most half of that."""


@inner
def reach(length, left, right):  # type: ignore[no-untyped-def]
    """How high the quintic may come between two times, and how far the motion may be from it.

    It is no higher than the highest of its Bernstein coefficients; `BEYOND` says how far it may be off.
    """
    a, b = length / 5, length * length / 20
    inside = max(
        left[0] + a * left[1], left[0] + 2 * a * left[1] + b * left[2],
        right[0] - a * right[1], right[0] - 2 * a * right[1] + b * right[2],
    )  # fmt: skip
    apart = (left[1] - right[1]) * (length / 32) + (left[2] + right[2]) * (length * length / 64)
    return inside, BEYOND * abs(apart)


@inner
def powers(length, left, right):  # type: ignore[no-untyped-def]
    """Coefficients of the quintic, the highest first, in the share of the length."""
    v0, v1, a0, a1 = length * left[1], length * right[1], length * length * left[2], length * length * right[2]
    rise = right[0] - left[0]
    c5, c4 = 6 * rise - 3 * (v0 + v1) - (a0 - a1) / 2, -15 * rise + 8 * v0 + 7 * v1 + (3 * a0 - 2 * a1) / 2
    return c5, c4, 10 * rise - 6 * v0 - 4 * v1 - (3 * a0 - a1) / 2, a0 / 2, v0, left[0]


@inner
def root(powers, low, high, rising):  # type: ignore[no-untyped-def]
    """A zero of a polynomial of degree 5 between two places: Newton's steps, halves where they leave the interval.

    Args:
        powers: its coefficients, the highest first.
        low: one place.
        high: the other.
        rising: 1 where its values rise there, -1 where they fall.
    """
    c5, c4, c3, c2, c1, c0 = powers
    u = (low + high) / 2
    for _ in range(6):
        value = ((((c5 * u + c4) * u + c3) * u + c2) * u + c1) * u + c0
        slope = (((5 * c5 * u + 4 * c4) * u + 3 * c3) * u + 2 * c2) * u + c1
        low, high = (low, u) if value * rising > 0 else (u, high)
        new = u - value / slope
        u = new if low <= new <= high else (low + high) / 2
    return u


@inner
def peak(length, left, right):  # type: ignore[no-untyped-def]
    """Share of the length and height of the highest peak of the quintic; -inf where there is none."""
    c5, c4, c3, c2, c1, c0 = powers(length, left, right)
    slopes = (0.0, 5 * c5, 4 * c4, 3 * c3, 2 * c2, c1)
    top, place, pieces, low, low_slope = -np.inf, 0.0, 6, 0.0, c1
    for k in range(1, pieces + 1):
        high = k / pieces
        high_slope = (((5 * c5 * high + 4 * c4) * high + 3 * c3) * high + 2 * c2) * high + c1
        if low_slope > 0 and high_slope < 0:
            u = root(slopes, low, high, -1.0)
            height = ((((c5 * u + c4) * u + c3) * u + c2) * u + c1) * u + c0
            if height > top:
                top, place = height, u
        low, low_slope = high, high_slope
    return min(max(place, EDGE), 1 - EDGE), top
