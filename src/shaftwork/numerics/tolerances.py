"""Tolerances that several stages share, each with its reason."""

from __future__ import annotations

import sys

EPS = sys.float_info.epsilon
"""The rounding of a number of size 1."""
SAME = 1e-12
"""Numbers that ought to be the same differ by no more: each of some thousand operations behind them rounds."""
CLEARANCE = 32
"""Two times nearer than so many rounding units of a run's times are one: no solver takes shorter steps."""
