"""The two sides of an instant at which something jumps."""

from __future__ import annotations

import math

# A jump that is written as Heaviside(3 t - 1) is met some rounding units beside the time that is computed for it.
ROUNDINGS = 4


def just_before(time: float) -> float:
    """The time in s, less a few rounding units: an input that jumps there still has its value before the jump."""
    return time - ROUNDINGS * math.ulp(time)


def just_after(time: float) -> float:
    """The time in s and a few rounding units more: an input that jumps there has its value after the jump."""
    return time + ROUNDINGS * math.ulp(time)


def around(time: float) -> tuple[float, float]:
    """`just_before` and `just_after`."""
    return just_before(time), just_after(time)
