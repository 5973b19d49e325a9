"""Tolerances that several stages share, each with its reason."""

from __future__ import annotations

import sys

EPS = sys.float_info.epsilon
"""The rounding of a number of size 1."""
SAME = 1e-12
"""Numbers that ought to be the same differ by no more: each of some thousand operations behind them rounds. So what an
elimination leaves is nothing below this part of the largest value."""
TYPED = 1e-9
"""Numbers that a user types, and those at which an iteration ends, differ by no more where they are meant to be the
same: ratios are typed to some ten digits (1.2 * 1.5 is 1.8). Less than this part of the largest is nothing."""
EQUAL = 1e-6
"""Sizes that differ by less than this fraction are one where something is named by them: levels of a law, rates of
modes. Of several largest amplitudes the first is the reference of a shape, and smaller ups and downs make no peak."""
ROUNDINGS = 4
"""Rounding units by which a computed time may be off: a jump that is written as Heaviside(3 t - 1) is met some beside
the time that is computed for it, and k T / T is not k. So what jumps is read so many before and after."""
CLEARANCE = 32
"""Two times nearer than so many rounding units of a run's times are one: no solver takes shorter steps."""
GOLDEN = (5**0.5 - 1) / 2
"""The golden ratio: a minimum is enclosed in sections of it, and its multiples, less whole numbers, fill an interval
evenly without repeating."""
