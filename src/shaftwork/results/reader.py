"""A quantity of a motion at any times, from the solver's dense output."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from shaftwork.results.course import Read
from shaftwork.results.observer import Array

if TYPE_CHECKING:
    from shaftwork.results.solution import Solution

AT_ONCE = 4_000_000
"""States by times that are read at once, 32 MB."""


class Reader:
    """Reads quantities of a motion; what many of them are read at, the first look at each, is solved for once.

    Args:
        solution: the motion.
    """

    def __init__(self, solution: Solution) -> None:
        self._solution = solution
        self._rows = max(1, AT_ONCE // max(1, len(solution.states)))
        self._last: Solution | None = None
        self._along: tuple[Solution, str, Array] | None = None

    def quantity(self, name: str, place: int | None = None) -> Read:
        """A quantity by its name, of one that is read along a part that at a place, by its number."""

        def read(times: Array) -> Array:
            blocks = (times[first : first + self._rows] for first in range(0, len(times), self._rows))
            return np.concatenate([self._values(self._at(block), name, place) for block in blocks])

        return read

    def _at(self, times: Array) -> Solution:
        last = self._last
        if last is None or not np.array_equal(last.t, times):
            last = self._last = self._solution.at(times)
        return last

    def _values(self, motion: Solution, name: str, place: int | None) -> Array:
        if place is None:
            return motion[name]
        along = self._along
        if along is None or along[0] is not motion or along[1] != name:
            along = self._along = motion, name, motion[name]
        return along[2][:, place]
