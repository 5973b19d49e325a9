"""When modes are consistent with the motion in them: one rule for every guard, of one motion or of many side by side.

A guard has an excess e, which is negative within its limit, and rounding moves it by a band b. It is

    within its limit where e < -b,    on it where |e| <= b,    beyond it where e > b.

Modes are consistent where every guard is within its limit, or on it and about to fall. A guard beyond its limit, or on
it and about to rise, ends its mode. What it is about to do shows a short step ahead, where it changes by more than
rounding tells (`drift`); where nothing moves yet, a second step shows what accelerations do.

All functions are arithmetic alone. They take floats, or arrays whose last axis are lanes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from shaftwork.codegen.code import Moves
from shaftwork.numerics.tolerances import EPS, GOLDEN
from shaftwork.pipeline.arguments import NOMINAL

ROUNDINGS = 64.0
"""States and times are moved by so many rounding units to see how far rounding moves a guard, its band."""
CLEAR = 8
"""A phase that starts at a limit or beyond meets it again where it is farther beyond by so many bands."""
NOTHING = 1e-200
"""What is as good as zero, and is not."""

Values = Any
"""A float, or an array whose last axis are lanes."""


def side_of_limit(excess: Values, band: Values) -> Values:
    """-1 for a guard within its limit, 0 on it, 1 beyond it; what has no value is on it.

    Args:
        excess: how far it is beyond zero, on the side on which it is met.
        band: how far rounding moves it.
    """
    return 1 * (excess > band) - (excess < -band)


def drift(gain: Values, beside: Values, band: Values) -> Values:
    """1 for a guard that is about to rise, -1 to fall, and 0 where rounding hides what it does.

    Args:
        gain: what it gains a step ahead.
        beside: what it gains from states that rounding has moved.
        band: how far rounding moves it.
    """
    size = abs(gain)
    least = 4 / ROUNDINGS * band  # four rounding units: of these few operations no more is rounding
    return ((size > abs(gain - beside)) & (size > least)) * (2 * (gain > 0) - 1)


def clear_of_limit(excess: Values, band: Values) -> Values:
    """How far beyond zero a guard is met: more where it is near its limit or beyond, for a phase that starts there has
    not met it.

    It is not zero: where a value is exactly zero at the start of a step, heyoka finds none of its later zeros in it.

    Args:
        excess: how far it is beyond now; negative within its limit.
        band: how far rounding moves it.
    """
    wide = CLEAR * band
    near = 2 * excess > -wide
    return near * (excess * (excess > 0) + wide) + (1 - near) * (band / CLEAR) + NOTHING


def time_scales(span: tuple[float, float]) -> tuple[float, float]:
    """How far in s rounding moves the time of a run, and how far ahead the further course is looked at, at most.

    Args:
        span: start and end of the run, s.
    """
    return ROUNDINGS * math.ulp(max(map(abs, span))), 1e-7 * (span[1] - span[0])


def rounding_moves(sizes: Sequence[float]) -> Moves:
    """Of each state a part of it and the least that rounding moves it, to both sides and not alike; the side; and how
    far a look ahead takes it.

    Args:
        sizes: the nominal size of each state.
    """
    parts = [(-1) ** k * (0.5 + k * GOLDEN % 1) * ROUNDINGS * EPS for k in range(len(sizes))]
    pairs = zip(parts, sizes, strict=True)
    # ahead a state moves by no more than a thousandth of its size, so that the course is straight there
    return [(part, part * size / NOMINAL, math.copysign(1.0, part), 1e-3 * size) for part, size in pairs]


def moved_by_rounding(x: Values, rate: Values, move: Values, tick: float, side: float = 1.0) -> Values:
    """A state as far away as rounding may move it, with the time by a tick; `codegen.code.around` compiles the same.

    Args:
        x: the state.
        rate: of it.
        move: of it, from `rounding_moves`.
        tick: how far rounding moves the time, s.
        side: -1 for the other side.
    """
    part, least, sign, _ = move
    # all of it to the same side: what a tick moves must not make up for the rest
    return x + side * (part * abs(x) + least + sign * tick * abs(rate))
