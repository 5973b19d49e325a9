"""A quantity of a motion at any times, from the solver's dense output."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from shaftwork.core.errors import AccuracyWarning
from shaftwork.core.notices import muted
from shaftwork.results.course import Read
from shaftwork.results.limits import beside
from shaftwork.results.observer import Array, blocks

if TYPE_CHECKING:
    from shaftwork.results.solution import Solution


class Reader:
    """Reads quantities of a motion; what many of them are read at, the first look at each, is solved for once.

    Args:
        solution: the motion.
    """

    def __init__(self, solution: Solution) -> None:
        self._solution = solution
        self._last: Solution | None = None
        self._along: tuple[Solution, str, Array] | None = None
        self.unbounded: dict[tuple[str, int | None], dict[float, float]] = {}
        """Values that are not finite, by the name of the quantity and its place, and by time in s."""

    def quantity(self, name: str, place: int | None = None) -> Read:
        """A quantity by its name, of one that is read along a part that at a place, by its number.

        Where it has no finite value, a value next to it stands for that; what it was is in `unbounded`.
        """

        def plain(times: Array) -> Array:
            parts = blocks(len(times), len(self._solution.states))
            with muted(*((AccuracyWarning,) if (name, place) in self.unbounded else ())):  # it has been said
                return np.concatenate([self._values(self._at(times[block]), name, place) for block in parts])

        def read(times: Array) -> Array:
            values = plain(times)
            if (rows := np.flatnonzero(~np.isfinite(values))).size:
                known = self.unbounded.setdefault((name, place), {})
                known.update(zip(times[rows].tolist(), values[rows].tolist(), strict=True))
                with muted(AccuracyWarning):
                    values[rows] = beside(plain, times[rows], self._solution.steps)[1]
            return values

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
