"""Breaks in a compiled run, in which Python has the word."""

from __future__ import annotations

import math
from typing import Any

from shaftwork.integrate.problem import Problem

# Steps times states, some 50 ms, after which Python notices Ctrl-C and tells how far the run is.
UNINTERRUPTED = 250_000


class Breaks:
    """How many steps heyoka takes at once, and what happens in between: Ctrl-C is seen, and progress told."""

    def __init__(self, problem: Problem) -> None:
        self._progress = problem.progress
        self._last = -math.inf
        self._most = max(1, UNINTERRUPTED // max(1, problem.x0.size))

    def limit(self, left: int) -> int:
        """Steps to take at once where so many are left."""
        return min(max(left, 1), self._most)

    def goes_on(self, integrator: Any, outcome: Any, steps: int, left: int) -> bool:
        """Whether a run has stopped for a break alone, and comes on.

        It stands still where an event has no value, and beside a pole of a law. heyoka counts time in two numbers and
        would go through the pole, in steps shorter than the spacing of times, and then tell of something else.
        """
        now, last = integrator.time, self._last
        self._last = now
        if self._progress is not None:
            self._progress(now)
        if now - last <= steps * math.ulp(now):
            return False
        return steps > 0 and left > 0 and outcome.name == "step_limit"
