"""States and waves as polynomials in each panel: dense output, and the part of a panel before a guard."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from shaftwork.integrate.problem import Array
from shaftwork.integrate.smooth_intervals import both_sides
from shaftwork.waves.delay_engine.collocation import POINTS, POWERS, STATE_POWERS, squared, values_at
from shaftwork.waves.delay_engine.lines import DelayProblem, DelayTrajectory, Lines, Past, past_of


@dataclass(frozen=True)
class Polynomials:
    """Functions that are polynomials in each panel, at any times.

    Args:
        starts: (m,) starts of the panels in s.
        lengths: (m,) their lengths in s.
        powers: (m, r, p) coefficients of the powers of xi, -1 at a panel's start and 1 at its end.
        merge: times nearer than this, in s, are the same.
    """

    starts: Array
    lengths: Array
    powers: Array
    merge: float

    def __call__(self, times: Array, *, left: bool = False) -> Array:
        """Values (k, r) at times (k,) in s; where panels meet those of the later one, or of the `left` one."""
        index, places = self.located(times, left=left)
        powers = np.vander(places, self.powers.shape[2], increasing=True)
        return np.asarray(np.einsum("krp,kp->kr", self.powers[index], powers))

    def located(self, times: Array, *, left: bool = False) -> tuple[NDArray[np.intp], Array]:
        """The panels (k,) in which times (k,) lie, and the places in these from -1 to 1."""
        side = -self.merge if left else self.merge
        index = np.clip(np.searchsorted(self.starts, times + side, side="right") - 1, 0, None)
        return index, np.asarray(2 * (times - self.starts[index]) / self.lengths[index] - 1)


class Restriction:
    """States, and behind them what arrives, in one panel: times (k,) in s to (k, n + q).

    Args:
        start: of the panel in s.
        length: of the panel in s.
        x: (n,) state at its start.
        rows: (q + n, s) waves that leave, then states at the Gauss points.
        arrived: (q, s) history torques there.
    """

    def __init__(self, start: float, length: float, x: Array, rows: Array, arrived: Array) -> None:
        self._start, self._length, ends = start, length, len(arrived)
        self._waves, self._arrived = rows[:ends] @ POWERS, arrived @ POWERS
        self._states = np.column_stack([x, rows[ends:]]) @ STATE_POWERS

    def __call__(self, times: Array) -> Array:
        places = 2 * (np.atleast_1d(times) - self._start) / self._length - 1
        return np.vstack([values_at(self._states, places), values_at(self._arrived, places)]).T

    def at(self, time: float) -> Array:
        """(n + q,) at one time in s."""
        return np.asarray(self(np.array([time]))[0])

    def arriving(self, place: float) -> Array:
        """(q,) what arrives at a place of [-1, 1]."""
        return values_at(self._arrived, np.array([place]))[:, 0]

    def up_to(self, length: float) -> tuple[Array, Array, Array]:
        """The part of the panel of a length in s: the state (n,) at its end, rows and what arrives as in the panel."""
        share = length / self._length
        points = (1 + POINTS) * share - 1
        waves, states, arrived = (values_at(each, points) for each in (self._waves, self._states, self._arrived))
        return values_at(self._states, np.array([2 * share - 1]))[:, 0], np.concatenate([waves, states]), arrived


@dataclass(frozen=True)
class StatesDense:
    """Dense output of the states.

    Args:
        states: (n,) polynomials of the states.
        steps: (s,) ends of the panels in s, t0 first.
    """

    states: Polynomials
    steps: Array

    def __call__(self, times: Array) -> Array:
        return self.states(np.atleast_1d(np.asarray(times, dtype=float)))


@dataclass(frozen=True)
class Left:
    """The waves that have left the ends of the lines, at any time and over the last delay.

    Args:
        lines: which end receives what from where.
        waves: (q,) polynomials of the waves.
    """

    lines: Lines
    waves: Polynomials

    def squares(self, times: Array) -> Array:
        """Integrals (k, q) over the last delay, up to times (k,), of the squared wave that leaves each end.

        The panels in it are summed for each time anew: a difference of running sums would lose digits in a long run.
        """
        waves = self.waves
        whole = squared(waves.powers, np.ones(len(waves.starts))) * waves.lengths[:, None] / 2
        integrals = np.empty((times.size, waves.powers.shape[1]))
        last, late = self._begun(times)
        for delay, ends in zip(self.lines.delays, self.lines.ends, strict=True):
            first, early = self._begun(times - delay)
            rows = np.array([whole[low:high, ends].sum(axis=0) for low, high in zip(first, last, strict=True)])
            integrals[:, ends] = rows + (late - early)[:, ends]
        return integrals

    def _begun(self, times: Array) -> tuple[NDArray[np.intp], Array]:
        """The panels (k,) in which times lie, and the integrals (k, q) of squares from their starts up to the times."""
        waves = self.waves
        index, places = waves.located(times)
        return index, squared(waves.powers[index], places) * waves.lengths[index, None] / 2

    def past(self, time: float) -> Past:
        """What left the ends before a time in s, for a run that goes on from there."""
        waves = self.waves
        first = int(np.searchsorted(waves.starts, time - 2 * max(self.lines.delays), side="right")) - 1
        last = int(np.searchsorted(waves.starts, time - waves.merge))
        chosen = slice(max(first, 0), last)
        starts, lengths = waves.starts[chosen], waves.lengths[chosen].copy()
        values = values_at(waves.powers[chosen], POINTS)
        part = (time - starts[-1]) / lengths[-1]
        lengths[-1] *= part
        values[-1] = values_at(waves.powers[last - 1], (1 + POINTS) * part - 1)
        return Past(starts, lengths, values)


@dataclass(frozen=True)
class Ends:
    """What the ends of the lines do at any time.

    Args:
        problem: which gives their speeds.
        lines: which end receives what from where.
        states: (n,) polynomials of the states.
        waves: (q,) polynomials of the waves that leave the ends.
    """

    problem: DelayProblem
    lines: Lines
    states: Polynomials
    waves: Polynomials

    def __call__(self, times: Array, *, left: bool = False) -> tuple[Array, Array]:
        """History torques (k, q) in N m and speeds (k, q) in rad/s at times (k,); at a kink after or `left` of it."""
        times = np.atleast_1d(np.asarray(times, dtype=float))
        h = np.empty((times.size, self.waves.powers.shape[1]))
        # What arrives at the very end of the run is not of the run.
        arriving = np.minimum(times, self.problem.t_end - 2 * self.waves.merge)
        for delay, ends, partners in zip(self.lines.delays, self.lines.ends, self.lines.partners, strict=True):
            h[:, ends] = -self.waves(arriving - delay, left=left)[:, partners]
        inside = one_sided(self.problem, times, left=left)
        return h, np.asarray(self.problem.speeds(inside, self.states(times, left=left).T, h.T)).T

    @property
    def left(self) -> Left:
        """The waves over the last delay."""
        return Left(self.lines, self.waves)


def one_sided(problem: DelayProblem, times: Array, *, left: bool = False) -> Array:
    """Times (k,) in s, moved to the side of a breakpoint on which inputs are to be read."""
    marks = np.array([problem.t0, *problem.breakpoints, problem.t_end])
    before, after = np.array([problem.sides(mark) for mark in marks]).T
    index = np.minimum(np.searchsorted(np.maximum(marks, after), times), marks.size - 1)
    near = (np.minimum(marks, before)[index] <= times) & (times <= np.maximum(marks, after)[index])
    early = (times < marks[index]) | left | (index == marks.size - 1)
    return np.where(near, np.where(early, before[index], after[index]), times)


@dataclass(frozen=True)
class WavePanels:
    """All panels of a run.

    Args:
        starts: (m,) in s.
        lengths: (m,) in s.
        states: (m, n, s + 1) at their starts and at the Gauss points.
        waves: (m, q, s) that leave the ends, at the Gauss points.
        pieces: of each smooth piece the number of panels up to its end, and the state (n,) there, before a jump.
        merge: times nearer than this, in s, are the same.
    """

    starts: Array
    lengths: Array
    states: Array
    waves: Array
    pieces: tuple[tuple[int, Array], ...]
    merge: float


def trajectory(problem: DelayProblem, panels: WavePanels, statistics: Mapping[str, int]) -> DelayTrajectory:
    """The panels of a run at the output times, and their dense output."""
    past = past_of(problem)
    waves = Polynomials(
        np.concatenate([past.starts, panels.starts]),
        np.concatenate([past.lengths, panels.lengths]),
        np.concatenate([past.waves, panels.waves]) @ POWERS,
        panels.merge,
    )
    steps = np.append(panels.starts, problem.t_end)
    dense = StatesDense(Polynomials(panels.starts, panels.lengths, panels.states @ STATE_POWERS, panels.merge), steps)
    ends = Ends(problem, Lines.of(problem.delays), dense.states, waves)
    left_ends = ends.left
    if problem.t_eval is not None:
        t = np.asarray(problem.t_eval, dtype=float)
        return DelayTrajectory(
            t, dense(t), dense, statistics, *ends(t), waves=ends, squares=left_ends.squares, past=left_ends.past
        )
    edges = pairwise([0, *(count for count, _ in panels.pieces)])
    spans = [(slice(low, high), end) for (low, high), (_, end) in zip(edges, panels.pieces, strict=True)]
    times = [steps[span.start : span.stop + 1] for span, _ in spans]
    t, x = both_sides(problem, times, [np.vstack([panels.states[span, :, 0], end]) for span, end in spans])
    left = np.append(np.diff(t) == 0, True)
    h, v = ends(t)
    h[left], v[left] = ends(t[left], left=True)
    return DelayTrajectory(t, x, dense, statistics, h, v, waves=ends, squares=left_ends.squares, past=left_ends.past)
