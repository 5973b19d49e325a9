"""Variants side by side, each with steps of its own, a number of steps at a time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shaftwork.integrate.problem import Array

LOOK = 8
"""After so many steps it is looked whether all lanes have come to the end."""
OF_A_STEP, LOOSEST_TOLERANCE, TIGHTEST_TOLERANCE = 0.1, 1e-7, 1e-13
"""The tolerance of a step as a part of that of the motion, and its bounds."""
MOST_AT_ONCE, ROWS_AT_ONCE = 32, 512
"""Steps of every lane before it is looked at what they have met, and rows of these steps: more leave the cache."""
MOST_STEPS, LOOKS = 100_000, 4
"""Of a lane, between two changes of mode; after so many looks it is foreseen how many there will be. A lane that needs
more is stiff, or swings so often that it is better off alone."""
FIRST_CHANGE = 0.01
"""The first step may change a state by so much of its size."""
WITHOUT_LIMIT = 1e300
STILL = 8 * float(np.finfo(float).eps)
"""A step that is shorter than this part of the time leads nowhere."""
WIDTH = 8
"""Lanes are a multiple of this many: a compiled function takes so many at once, and rounds what is left differently."""

Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


class Room:
    """Memory for steps, the same each time: fresh memory costs as much as the arithmetic."""

    def __init__(self) -> None:
        self._values = np.empty(0)

    def __call__(self, *shape: int) -> Array:
        """An array of a shape, of whatever values; that of the last call is gone."""
        size = math.prod(shape)
        if self._values.size < size:
            self._values = np.empty(size)
        return self._values[:size].reshape(shape)


class Steps:
    """Some steps of lanes.

    Args:
        step: a `codegen.lane_step.LaneStep`.
        taken: (used, k) what it takes of the parameters.
        columns: (m + 1, height, k) at the start, and what each of m steps has written.
    """

    def __init__(self, step: Any, taken: Array, columns: Array) -> None:
        self._step, self._taken, self._columns = step, taken, columns
        self.t: Array = columns[:-1, step.rows - 2]
        """(m, k) times in s at the start of each step; a lane that is at its end stays there."""
        self.jets: Array = columns[1:, step.jets].swapaxes(0, 1)
        """(jets, m, k) what the step shows there."""

    @property
    def columns(self) -> Array:
        """(height, k) at the start of the last step."""
        return np.asarray(self._columns[-2])

    @property
    def last(self) -> Array:
        """(rows, k) of them."""
        return self.columns[: self._step.rows]

    def reach(self, number: int, sign: float) -> Array:
        """(k,) how far a quantity can have come in these steps, times a sign."""
        return np.asarray(self._columns[-1, self._step.reach(number, sign)])

    def at(self, start: Index, lanes: Index, t: Array) -> tuple[Array, Array]:
        """Rows (rows, c) and jets (jets, c) at times (c,) in s, from the starts (c,) of steps of lanes (c,)."""
        step, count = self._step, lanes.size
        every = _padded(count)
        start, lanes, t = start[every], lanes[every], t[every]
        columns = np.ascontiguousarray(self._columns[start, :, lanes].T)
        columns[step.rows - 1] = WITHOUT_LIMIT
        taken = np.ascontiguousarray(self._taken[:, lanes])
        step.limit(taken, WITHOUT_LIMIT, t, WITHOUT_LIMIT)
        there, here = np.empty((2, step.height, lanes.size))
        step(columns, taken, there)
        step(there, taken, here)
        return there[: step.rows, :count], here[step.jets, :count]

    def cut(self, start: Index, t: Array, jets: Array) -> None:
        """Let lanes stay at times (k,) in s with jets (jets, k), from behind the starts (k,) of steps on."""
        later = np.arange(len(self.t))[:, None] > start
        np.copyto(self.t, t, where=later)
        for row, jet in zip(self.jets, jets, strict=True):
            np.copyto(row, jet, where=later)


class LaneRun:
    """Lanes on their way.

    Args:
        step: a `codegen.lane_step.LaneStep`.
        room: for its steps.
        x: (n, k) states.
        rates: (n, k) theirs.
        t: (k,) s.
        p: (parameters, k).
        sizes: (n,) nominal, of the states.
        limits: end of the motion and the longest step, s.
        rtol: relative tolerance.
    """

    def __init__(
        self,
        step: Any,
        room: Room,
        x: Array,
        rates: Array,
        t: Array,
        p: Array,
        sizes: Array,
        limits: tuple[float, float],
        rtol: float,
    ) -> None:
        self._step, self._room, self._end = step, room, limits[0]
        with np.errstate(divide="ignore"):
            first = FIRST_CHANGE * ((sizes[:, None] + np.abs(x)) / np.abs(rates)).min(axis=0)
        columns, taken = np.zeros((step.height, t.size)), step.taken(p, sizes)
        columns[: len(x)], columns[step.rows - 2], columns[step.rows - 1] = x, t, np.minimum(first, limits[1])
        step.limit(taken, min(max(OF_A_STEP * rtol, TIGHTEST_TOLERANCE), LOOSEST_TOLERANCE), *limits)
        self._count = 0
        self._take(np.arange(t.size), columns, taken)
        first_columns = np.empty_like(self._columns)
        step(self._columns, self._taken, first_columns)
        self._columns[step.jets] = first_columns[step.jets]

    def _take(self, lanes: Index, columns: Array, taken: Array) -> None:
        """Go on with some lanes (k,) from columns (height, k), with what is `taken` (used, k) of their parameters."""
        self.lanes = lanes
        """(k,) numbers of the lanes that are on their way."""
        every = _padded(lanes.size)
        self._columns, self._taken = (np.ascontiguousarray(values[:, every]) for values in (columns, taken))

    def go(self) -> tuple[Steps, Mask]:
        """Some steps of the lanes that are on their way, and (k,) whether each of them goes well.

        The steps are gone with the next ones.
        """
        step, count = self._step, self.lanes.size
        most = min(max(ROWS_AT_ONCE // step.height, LOOK), MOST_AT_ONCE)
        columns = self._room(most + 1, *self._columns.shape)
        columns[0] = self._columns
        step.forget(columns[0])
        for k in range(most):
            step(columns[k], self._taken, columns[k + 1])
            if k % LOOK == LOOK - 1 and (columns[k, step.rows - 2] >= self._end).all():
                columns = columns[: k + 2]
                break
        self._count += len(columns) - 1
        steps = Steps(step, self._taken[:, :count], columns[:, :, :count])
        t, size = steps.last[-2:]
        good = np.isfinite(steps.last).all(axis=0) & ((t >= self._end) | (size > STILL * np.abs(t)))
        if self._count > LOOKS * most:
            good &= self._count * (t - steps.t[0]) + (self._end - t) * len(steps.t) < MOST_STEPS * (t - steps.t[0])
        return steps, good

    def keep(self, on: Mask, steps: Steps) -> None:
        """Go on with some of the lanes (k,), from where steps have led them."""
        if on.any():
            self._take(self.lanes[on], steps.columns[:, on], self._taken[:, : on.size][:, on])
        else:
            self.lanes = self.lanes[on]


def _padded(count: int) -> Index:
    """Numbers of lanes, and the last one again up to a multiple of the width."""
    return np.minimum(np.arange(-(-count // WIDTH) * WIDTH), count - 1)
