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
same: ratios are typed to some ten digits (1.2 * 1.5 is 1.8)."""
CLEARANCE = 32
"""Two times nearer than so many rounding units of a run's times are one: no solver takes shorter steps."""
GOLDEN = (5**0.5 - 1) / 2
"""The golden ratio: a minimum is enclosed in sections of it, and its multiples, less whole numbers, fill an interval
evenly without repeating."""
