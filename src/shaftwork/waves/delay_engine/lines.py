"""A network whose lossless lines are delays: what the engine is given and returns, and the waves that have left."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shaftwork.integrate.problem import Array, TimedProblem, Trajectory
from shaftwork.waves.delay_engine.collocation import POINTS, POWERS, STAGES, values_at


@dataclass(frozen=True)
class Past:
    """Waves that left the ends of the lines before a run, for the longest delay or more.

    Args:
        starts: (m,) of panels that follow each other up to t0, in s.
        lengths: (m,) in s.
        waves: (m, q, s) 2 Z v + h in N m, at the Gauss points (`shaftwork.waves.delay_engine.collocation.POINTS`).
    """

    starts: Array
    lengths: Array
    waves: Array


@dataclass(frozen=True, kw_only=True)
class DelayProblem(TimedProblem):
    """A network x' = rhs(t, x, h), v = speeds(t, x, h) whose lossless lines join the ends of speeds v by delays.

    Law: an end of a line of impedance Z and delay T takes the torque Z v + h from its node, and what leaves the one end
    arrives at the other: h_b(t) = -(2 Z v_a + h_a)(t - T), h_a(t) = -(2 Z v_b + h_b)(t - T). There may be no states; a
    step is a panel; guards are of the states with the history torques behind them (k, n + q), see `March`.

    Args:
        rhs: (times (k,), states (n, k), history torques (q, k)) to a new (n, k) array.
        speeds: (times (k,), states (n, k), history torques (q, k)) to the speeds (q, k) of the ends, in rad/s.
        jacobian: (time, state (n,), history torques (q,)) to d rhs / d x, an array or a scipy.sparse array (n, n).
        delays: (q / 2,) delays in s; the ends are numbered a and b of the first line, a and b of the second, ...
        impedances: (q / 2,) impedances in N m s.
        timed: guards that change with time by themselves, so that panels must be short enough to see them.
        linear: whether rhs and speeds are affine in x and h, with constant matrices.
        steady: whether, between breakpoints, rhs and speeds do not depend on the time.
        speeds0: (q,) speed of each end at t0 in rad/s, along a line straight from the one to the other; None for rest.
        torque0: (q / 2,) torque along each line at t0 in N m, that which its node gives to it; None for none.
        past: what left the ends before t0, in place of speeds0 and torque0: a run goes on where another one ended.
        atol_waves: absolute tolerance of 2 Z v + h in N m; rtol is relative to the largest of each line so far.
    """

    rhs: Callable[[Array, Array, Array], Array]
    speeds: Callable[[Array, Array, Array], Array]
    jacobian: Callable[[float, Array, Array], Any]
    delays: Array
    impedances: Array
    timed: tuple[int, ...] = ()
    linear: bool = False
    steady: bool = False
    speeds0: Array | None = None
    torque0: Array | None = None
    atol_waves: float = 0.0
    past: Past | None = None


@dataclass(frozen=True)
class DelayTrajectory(Trajectory):
    """A trajectory with what the ends of its lines do: the torque that a node gives to an end is Z v + h.

    Args:
        h: (k, q) history torques in N m at the times t.
        v: (k, q) speeds of the ends in rad/s at the times t.
        waves: both at any times (k,) in s; at a kink those after it.
        squares: from times (k,) in s to integrals (k, q) over the last delay, in (N m)^2 s, of the squared wave that
            leaves an end.
        past: from a time in s to the past of a run that goes on from there; None after a run in leaps.
    """

    h: Array = field(default_factory=lambda: np.empty((0, 0)))
    v: Array = field(default_factory=lambda: np.empty((0, 0)))
    waves: Callable[[Array], tuple[Array, Array]] = field(kw_only=True)
    squares: Callable[[Array], Array] = field(kw_only=True)
    past: Callable[[float], Past] | None = field(kw_only=True)


@dataclass(frozen=True)
class Lines:
    """The lines of a network, grouped by equal delay.

    Args:
        delays: (g,) distinct delays in s.
        ends: for each of them the numbers of the ends whose history has it.
        partners: the other end of each of those.
    """

    delays: tuple[float, ...]
    ends: tuple[NDArray[np.intp], ...]
    partners: tuple[NDArray[np.intp], ...]

    @classmethod
    def of(cls, delays: Array) -> Lines:
        """Group lines of delays (l,) in s; line number k has the ends 2 k and 2 k + 1."""
        distinct = tuple(dict.fromkeys(float(delay) for delay in delays))
        ends = tuple(np.flatnonzero(np.repeat(delays, 2) == delay) for delay in distinct)
        return cls(distinct, ends, tuple(group ^ 1 for group in ends))


def past_of(problem: DelayProblem) -> Past:
    """What left the ends before t0: Z v + tau at a and Z v - tau at b, with v where the wave has come by t0."""
    if problem.past is not None:
        return problem.past
    size = problem.impedances.size
    speeds = np.zeros(2 * size) if problem.speeds0 is None else problem.speeds0
    torque = np.zeros(size) if problem.torque0 is None else problem.torque0
    reach = 2 * float(problem.delays.max())
    ago = reach * (1 - POINTS) / 2
    change = speeds[np.arange(2 * size) ^ 1] - speeds
    along = speeds[:, None] + change[:, None] * ago / np.repeat(problem.delays, 2)[:, None]
    torques = np.column_stack([torque, -torque]).ravel()
    waves = np.repeat(problem.impedances, 2)[:, None] * along + torques[:, None]
    return Past(np.array([problem.t0 - reach]), np.array([reach]), waves[None])


class WaveHistory:
    """The waves w = 2 Z v + h (N m) that have left the ends of the lines, panel by panel.

    Args:
        lines: which end receives what from where.
        past: what left them before t0.
        merge: times nearer than this, in s, are the same.
    """

    def __init__(self, lines: Lines, past: Past, merge: float) -> None:
        self._lines, self._merge = lines, merge
        self.starts: list[float] = past.starts.tolist()
        self.lengths: list[float] = past.lengths.tolist()
        self.waves = list(past.waves)

    def append(self, start: float, length: float, waves: Array) -> None:
        """Add the panel behind the last one: its start and length in s, its waves (q, s)."""
        self.starts.append(start)
        self.lengths.append(length)
        self.waves.append(waves)

    def at(self, t: float) -> tuple[Array, Array]:
        """History torques h (q,) and their rates (q,) just after a time in s, up to which all that left is known."""
        count = sum(len(ends) for ends in self._lines.ends)
        arrived, rates = np.empty(count), np.empty(count)
        for delay, ends, partners in zip(self._lines.delays, self._lines.ends, self._lines.partners, strict=True):
            number = max(bisect_right(self.starts, t - delay + self._merge) - 1, 0)
            place = 2 * (t - delay - self.starts[number]) / self.lengths[number] - 1
            powers = self.waves[number][partners] @ POWERS
            arrived[ends] = -powers @ place ** np.arange(STAGES)
            slopes = np.arange(1, STAGES) * place ** np.arange(STAGES - 1)
            rates[ends] = -powers[:, 1:] @ slopes * (2 / self.lengths[number])
        return arrived, rates

    def arriving(self, start: float, length: float, tolerance: Array) -> tuple[Array, float | None]:
        """History torques h (q, s) at the Gauss points of a panel, and where to divide it if they are not resolved.

        Args:
            start: of the panel in s; what left the ends a delay before is known.
            length: of the panel in s.
            tolerance: (q,) that the polynomial through the points may miss the history by.
        """
        arrived = np.empty((tolerance.size, STAGES))
        cut: float | None = None
        for delay, ends, partners in zip(self._lines.delays, self._lines.ends, self._lines.partners, strict=True):
            low = start - delay
            high = low + length
            first = bisect_right(self.starts, low + self._merge) - 1
            last = max(bisect_left(self.starts, high - self._merge) - 1, first)
            if first < last:
                arrived[ends], missed = self._several(low, high, (first, last), partners)
                if cut is None and (missed > tolerance[ends, None]).any():
                    cut = self._divide(low, high, (first, last)) + delay
                continue
            shift, stretch = low - self.starts[first], length / self.lengths[first]
            if abs(shift) <= self._merge and abs(shift + length - self.lengths[first]) <= self._merge:
                arrived[ends] = -self.waves[first][partners]
            else:
                points = 2 * shift / self.lengths[first] - 1 + (1 + POINTS) * stretch
                arrived[ends] = -values_at(self.waves[first][partners] @ POWERS, points)
        return arrived, cut

    def _several(self, low: float, high: float, span: tuple[int, int], rows: NDArray[np.intp]) -> tuple[Array, Array]:
        """Values at the points of [low, high], and by how much their polynomial misses what is between the points."""
        panels = range(span[0], span[1] + 1)
        starts, lengths = self.starts[span[0] : span[1] + 1], self.lengths[span[0] : span[1] + 1]
        times = low + (high - low) * (1 + POINTS) / 2
        index = np.clip(np.searchsorted(starts, times, side="right") - 1, 0, None)
        arrived = np.empty((rows.size, STAGES))
        for number in dict.fromkeys(index.tolist()):
            chosen = index == number
            points = 2 * (times[chosen] - starts[number]) / lengths[number] - 1
            arrived[:, chosen] = -values_at(self.waves[panels[number]][rows] @ POWERS, points)
        nodes = (np.array(starts)[:, None] + np.multiply.outer(lengths, (1 + POINTS) / 2)).ravel()
        values = np.concatenate([self.waves[k][rows] for k in panels], axis=1)
        inside = (nodes >= low) & (nodes <= high)
        points = 2 * (nodes[inside] - low) / (high - low) - 1
        return arrived, np.abs(values_at(arrived @ POWERS, points) + values[:, inside])

    def _divide(self, low: float, high: float, span: tuple[int, int]) -> float:
        # What a polynomial cannot follow lies where two panels meet.
        meetings = np.array(self.starts[span[0] + 1 : span[1] + 1])
        return float(meetings[np.argmin(np.abs(meetings - (low + high) / 2))])
