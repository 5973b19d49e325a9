"""Switches of the laws that depend on the motion: where a step meets one, and where it has to end for that."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from shaftwork.integrate.problem import Array, DaeProblem, Problem
from shaftwork.integrate.smooth_intervals import SmoothInterval
from shaftwork.numerics.tolerances import CLEARANCE
from shaftwork.numerics.zeros import LOOKS, zero

Dense = Callable[[Array], Array]

# Where in a step the switches are looked at before `LOOKS`.
FIRST = np.array([0.47])
RESTING, LEFT = 50, 10.0
"""A motion that passes the same switch so many times in a row within its tolerance rests there, until it leaves it by
so many tolerances."""


def tolerance(problem: Problem | DaeProblem, x: Array) -> Array:
    """How far the tolerance moves states (..., n): to both sides, and not alike."""
    return np.asarray((problem.atol + problem.rtol * np.abs(x)) * uneven(x.shape[-1]))


def uneven(size: int) -> Array:
    """(n,) parts of a tolerance, of different sizes and signs, lest those of two ends cancel in the twist between."""
    places = np.arange(size) * np.sqrt(2.0) % 1.0
    return np.asarray((0.5 + places) * np.where(places * 16 % 2 < 1, 1.0, -1.0))


class Crossings:
    """Tells where the steps of a piece have to end because a law switches with the motion.

    A method of any order errs where a step crosses a switch, and its error estimate sees nothing of a contact that is
    closed between its stages alone. So each step is looked at, inside as well, by its dense output.

    Args:
        problem: what is being solved.
        piece: the piece.
    """

    def __init__(self, problem: Problem | DaeProblem, piece: SmoothInterval) -> None:
        self._problem, self._piece = problem, piece
        self._clearance = CLEARANCE * float(np.spacing(max(abs(problem.t0), abs(problem.t_end))))
        self._start, self._attempts = np.nan, 0
        self._rests, self._within = np.zeros(0, dtype=np.intp), 0

    @property
    def rests(self) -> bool:
        """Whether the motion has passed switches again and again, and never left one by some tolerances."""
        return self._within >= RESTING

    def cut(self, start: float, x: Array, end: float, y: Array, dense: Dense, *, again: bool = True) -> float | None:
        """The time in s at which a step has to end and the method has to start anew, or None where it meets no switch.

        That is just past the switch. Where it is the end of the step itself, the step stands.

        Args:
            start: of the step, s.
            x: (n,) state there.
            end: of the step, s.
            y: (n,) state there.
            dense: its dense output, times (k,) strictly inside the step to states (k, n).
            again: whether the step is made again up to the time found, as it must be where stages lie past the switch,
                and not cut off there.
        """
        if self._problem.switches is None:
            return None
        look = Look(self._values, np.array([start, end]), np.vstack([x, y]), dense)
        look.add(start + FIRST * (end - start))
        if look.is_far():
            return None
        look.add(start + LOOKS * (end - start))
        if not look.follow():
            return None
        band = self._band(start, x, look.values[0])
        met = look.first(band, self._watched(look.values[0], band))
        if met is None:
            self._within += 1
            return None
        row, columns = met
        # It ends past its switch, by so much that no state moves there by more than a hundredth of its tolerance.
        past = min(0.01 * self._longest(look, row), end - start)
        time, column = min((look.root(row, column, past / 8), column) for column in columns)
        stands = end - time <= max(4 * past, self._clearance)
        target = end if stands else time + max(past, self._clearance / 2)
        if again and not stands:
            # what breaks away begins without acceleration: for many such steps rounding keeps it where it starts
            self._rests[column] += look.values[0, column] == 0
            return self._settled(start, end, target)
        near = abs(look.values[0, column]) <= LEFT * band[column]
        self._rests[column], self._within = (self._rests[column] + 1, self._within + 1) if near else (0, 0)
        return target

    def _values(self, times: Array, states: Array) -> Array:
        assert self._problem.switches is not None  # noqa: S101 (asked only then)
        return self._problem.switches(np.clip(times, self._piece.low, self._piece.high), states)

    def _scale(self, x: Array) -> Array:
        return self._problem.atol + self._problem.rtol * np.abs(x)

    def _band(self, t: float, x: Array, values: Array) -> Array:
        """How far (m,) the tolerance of the states moves the switches: nearer to zero they have no side."""
        moved = tolerance(self._problem, x)
        return np.asarray(np.abs(self._values(np.array([t]), (x + moved)[None, :])[0] - values))

    def _longest(self, look: Look, row: int) -> float:
        """The time in s in which no state moves by more than its tolerance, near a row of a look."""
        first = max(row - 2, 0)
        times, rows = np.unique(look.times[first : row + 2], return_index=True)  # of a tiny step some are equal
        rates = np.abs(np.diff(look.states[first + rows], axis=0) / np.diff(times)[:, None]).max(axis=0, initial=0.0)
        with np.errstate(divide="ignore"):
            return float(np.min(self._scale(look.states[row]) / rates, initial=np.inf))

    def _settled(self, start: float, end: float, time: float) -> float:
        """The time at which a step is to end, halved where four attempts to find it do not converge."""
        self._attempts = self._attempts + 1 if start == self._start else 1
        self._start = start
        return time if self._attempts <= 4 else min(time, start + (end - start) / 2)

    def _watched(self, values: Array, band: Array) -> NDArray[np.bool_]:
        """The switches (m,) at which the motion does not rest; step control alone sees the others."""
        if not self._rests.size:
            self._rests = np.zeros(values.size, dtype=np.intp)
        self._rests[np.abs(values) > LEFT * band] = 0
        return self._rests < RESTING


class Look:
    """A step at some of its times (k,), increasing: its states (k, n) and switches (k, m).

    Args:
        switches: from times and states to the switches.
        times: the first of the times.
        states: the states there.
        dense: dense output of the step.
        sides: (m,) on which the switches start, by default those that they have at the first time.
    """

    def __init__(
        self,
        switches: Callable[[Array, Array], Array],
        times: Array,
        states: Array,
        dense: Dense,
        sides: Array | None = None,
    ) -> None:
        self._switches, self._dense = switches, dense
        self.times, self.states, self.values = times, states, switches(times, states)
        self._sides = np.sign(self.values[0]) if sides is None else sides

    def add(self, times: Array) -> None:
        """Look at more times (k,)."""
        states = self._dense(times)
        order = np.argsort(np.concatenate([self.times, times]))
        self.times = np.concatenate([self.times, times])[order]
        self.states = np.concatenate([self.states, states])[order]
        self.values = np.concatenate([self.values, self._switches(times, states)])[order]

    def at(self, times: Array) -> Array:
        """The switches (k, m) at times (k,)."""
        return self._switches(times, self._dense(times))

    def is_far(self) -> bool:
        """Whether all switches are twice as far from zero as they move in the step: then one look is enough."""
        low, high = self.values.min(axis=0), self.values.max(axis=0)
        return bool((np.minimum(np.abs(low), np.abs(high)) > 2 * (high - low)).all())

    def follow(self, *, every: bool = False) -> bool:
        """Whether a switch leaves its side; where one comes near to zero between the times, three more are looked at.

        Args:
            every: follow the others too where one has left: they may have left before.
        """
        for _ in range(3):
            if self._left().any() and not every:
                return True
            if not self._denser():
                break
        return bool(self._left().any())

    def _left(self) -> NDArray[np.bool_]:
        return np.asarray((self.values * self._sides < 0) | ((self._sides == 0) & (np.abs(self.values) > 0)))

    def _denser(self) -> bool:
        """Add the vertices of parabolas through three points of each switch that may reach zero there."""
        at, near = vertices(self.times, self.values * self._sides)
        new = np.setdiff1d(at[near], self.times) if near.any() else np.empty(0)
        if new.size:
            self.add(new)
        return bool(new.size)

    def first(self, band: Array, watched: NDArray[np.bool_]) -> tuple[int, list[int]] | None:
        """The first row at which watched switches are on another side by more than a band (m,), and these switches."""
        away = self._left() & (np.abs(self.values) > band) & watched
        rows = np.flatnonzero(away.any(axis=1))
        return (int(rows[0]), np.flatnonzero(away[rows[0]]).tolist()) if rows.size else None

    def root(self, row: int, column: int, near: float) -> float:
        """The time in s at which a switch leaves its side for good before a row."""
        side = self._sides[column]
        if side == 0:
            return float(self.times[0])
        before = int(np.flatnonzero(self.values[:row, column] * side >= 0)[-1])
        low, high = float(self.times[before]), float(self.times[row])
        tolerance = max(near, float(np.spacing(self.times[-1])))
        ends = self.values[[before, row], column].tolist()
        return zero(lambda times: self.at(times)[:, column], low, high, ends=ends, xtol=tolerance)


def vertices(times: Array, heights: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Where functions may come to zero between the times at which they are looked at, by parabolas through three.

    Args:
        times: (..., k) increasing.
        heights: (..., k, m) of the functions above zero.

    Returns:
        (..., k - 2, m) the vertices, and whether one is so low.
    """
    ta, tb, tc = times[..., :-2, None], times[..., 1:-1, None], times[..., 2:, None]
    a, b, c = heights[..., :-2, :], heights[..., 1:-1, :], heights[..., 2:, :]
    with np.errstate(all="ignore"):
        before, after = (b - a) / (tb - ta), (c - b) / (tc - tb)
        bend = (after - before) / (tc - ta)
        # slope of the parabola at the middle point
        slope = (before * (tc - tb) + after * (tb - ta)) / (tc - ta)
        at, least = tb - slope / (2 * bend), b - slope**2 / (4 * bend)
        return at, (b > 0) & (b <= a) & (b <= c) & (bend > 0) & (ta < at) & (at < tc) & (least < b / 2)
