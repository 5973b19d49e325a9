"""The quintic through a value and its first two derivatives at two times, of arrays or heyoka's expressions."""

from __future__ import annotations

from typing import Any

JET = 3
"""What is known of a quantity at a time: its value and its first two derivatives by time."""
BEYOND = 0.2
"""Of the difference between the cubic and the quintic in the middle of an interval: so far the motion may be from the
quintic. Of a sine, whose samples are less than half a period apart, it is at most half of that."""


def inner(length: Any, left: Any, right: Any) -> tuple[Any, Any, Any, Any]:
    """Its Bernstein coefficients between the two values; it is no higher than the highest, no lower than the lowest.

    Args:
        length: time between the two, s.
        left: the value and its derivatives at the earlier time.
        right: those at the later one.
    """
    fifth, twentieth = length * (1 / 5), length * length * (1 / 20)
    (y0, v0, a0), (y1, v1, a1) = ((y, v * fifth, a * twentieth) for y, v, a in (left, right))
    return y0 + v0, y0 + 2.0 * v0 + a0, y1 - v1, y1 - 2.0 * v1 + a1


def apart(length: Any, left: Any, right: Any) -> Any:
    """So much it is above the cubic through the values and the first derivatives, in the middle; for `BEYOND`."""
    return (left[1] - right[1]) * (length * (1 / 32)) + (left[2] + right[2]) * (length * length * (1 / 64))


def quintic(length: Any, left: Any, right: Any) -> tuple[Any, ...]:
    """Its coefficients, the highest power first, of the share of the interval; arguments as for `inner`."""
    (y0, v0, a0), (y1, v1, a1) = ((y, v * length, a * length**2) for y, v, a in (left, right))
    rise = y1 - y0
    return (
        6 * rise - 3 * (v0 + v1) - (a0 - a1) / 2,
        -15 * rise + 8 * v0 + 7 * v1 + (3 * a0 - 2 * a1) / 2,
        10 * rise - 6 * v0 - 4 * v1 - (3 * a0 - a1) / 2,
        a0 / 2,
        v0,
        y0,
    )
