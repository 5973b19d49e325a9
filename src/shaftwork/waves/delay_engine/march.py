"""Panel after panel through a motion whose lines are delays, in one set of equations after another."""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass, field

import numpy as np

from shaftwork.core.errors import SimulationError
from shaftwork.integrate.engines import ENGINES
from shaftwork.integrate.guards import GuardWatch
from shaftwork.integrate.problem import Array, Trajectory
from shaftwork.integrate.smooth_intervals import PiecewiseDense, failure, pieces, reached, start_of_piece
from shaftwork.waves.delay_engine.collocation import (
    GAUSS,
    LEFT,
    POWERS,
    RADAU,
    RESOLVED,
    RIGHT,
    STATE_POWERS,
    Scales,
    Scheme,
    left_out,
)
from shaftwork.waves.delay_engine.lines import DelayProblem, Lines, WaveHistory, past_of
from shaftwork.waves.delay_engine.stages import CollocationStages
from shaftwork.waves.delay_engine.waveforms import Polynomials, Restriction, StatesDense, WavePanels


@dataclass
class MarchEquations:
    """What a march keeps of a set of equations that it may come back to.

    Args:
        stages: solver of a panel, with its factors.
        scales: sizes of waves and states.
    """

    stages: CollocationStages
    scales: Scales


@dataclass(frozen=True)
class _Panel:
    """A solved panel: waves, then states (q + n, s) at the Gauss points; the state (n,) at its end; what arrives."""

    start: float
    length: float
    rows: Array
    end: Array
    arrived: Array


@dataclass
class _MarchSpan:
    """What a march has done in one set of equations: its first panel, smooth pieces, and the guard that ended it."""

    first: int
    t: float
    passed: list[tuple[int, Array]] = field(default_factory=list)
    met: int | None = None


class March:
    """One motion, panel after panel; the waves go on where the equations change.

    A guard ends a span of it at the time at which the polynomials of a panel meet it, and the panel with it. One that
    an arriving jump carries beyond its limit ends it at that instant.

    Args:
        problem: the first one.
        span: start and end of the whole motion in s; by default those of the problem.
    """

    def __init__(self, problem: DelayProblem, span: tuple[float, float] | None = None) -> None:
        low, high = span or (problem.t0, problem.t_end)
        self._lines = Lines.of(problem.delays)
        self._rtol = max(problem.rtol, ENGINES["wave"].finest)
        self._shortest = min(self._lines.delays)
        self._merge = max(8 * math.ulp(max(abs(low), abs(high))), 1e-4 * self._rtol * self._shortest)
        # the shortest panel
        self._floor = max(1e-2 * self._rtol * self._shortest, 20 * self._merge)
        self._ends = 2 * problem.delays.size
        self._twice = 2 * np.repeat(problem.impedances, 2)[:, None]
        past = past_of(problem)
        self._history = WaveHistory(self._lines, past, self._merge)
        self._past = past.starts.size
        self._kinks: list[float] = []
        self._states: list[Array] = []
        self._arrived: list[Array] = []
        self._layers = 0
        self._enter(problem, MarchEquations(CollocationStages(problem, self._rtol), self._scales_of(problem)))
        self._equations.scales.see(np.abs(past.waves).max(axis=(0, 2))[:, None], self._x[:, None])
        for number in range(1, self._past):
            self._follow(number)

    def _scales_of(self, problem: DelayProblem) -> Scales:
        return Scales(problem.impedances, problem.atol_waves, problem.atol, self._rtol)

    def _enter(self, problem: DelayProblem, equations: MarchEquations) -> None:
        self._problem, self._equations = problem, equations
        self._x = np.asarray(problem.x0, dtype=float)
        self._trend = np.zeros(self._x.size)
        self._span = _MarchSpan(len(self._states), problem.t0)

    def go_on(self, problem: DelayProblem, equations: MarchEquations | None) -> MarchEquations:
        """Begin a span in other equations, where the last one has ended.

        Args:
            problem: the equations; its past is not read.
            equations: what the march has kept of these, if it has been in them before.
        """
        waves = self._equations.scales.waves
        if equations is None:
            equations = MarchEquations(CollocationStages(problem, self._rtol), self._scales_of(problem))
        self._enter(problem, equations)
        equations.scales.see(waves[:, None], self._x[:, None])
        return equations

    def arriving(self, t: float) -> Array:
        """(2 q,) history torques just after a time in s, and their rates."""
        return np.concatenate(self._history.at(t))

    def run(self) -> None:
        """Cover all pieces, up to the first guard that is met."""
        for piece in pieces(self._problem):
            self._x, self._trend = start_of_piece(self._problem, piece, self._x), np.zeros(self._x.size)
            self._equations.stages.enter(piece.low, piece.high)
            self._watch = GuardWatch(self._problem, piece.low, piece.high)
            t, ahead = piece.start, False
            while piece.end - t > self._merge and self._span.met is None:
                if ahead and self._jumps_beyond(t):
                    break
                kink, end = self._next_kink(t), t + self._shortest
                end, ahead = min(kink, end), kink <= end
                end = piece.end if end > piece.end - self._merge else end
                self._cover(t, end)
                t = end
            self._span.passed.append((len(self._states), self._x))
            if self._span.met is not None:
                return
        self._span.t = self._problem.t_end

    def _jumps_beyond(self, t: float) -> bool:
        """Whether a jump that arrives at a time in s carries a guard beyond its limit."""
        if self._problem.guards is None or len(self._states) == self._span.first:
            return False
        arrives, before = self._history.at(t)[0], self._arrived[-1] @ RIGHT[:, 0]
        if (np.abs(arrives - before) <= self._equations.scales.tolerance[: self._ends]).all():
            return False
        self._span.met = self._watch.beyond(t, np.concatenate([self._x, arrives]))
        self._span.t = t
        return self._span.met is not None

    def _next_kink(self, t: float) -> float:
        while self._kinks and self._kinks[0] <= t + self._merge:
            heapq.heappop(self._kinks)
        return self._kinks[0] if self._kinks else math.inf

    def _cover(self, start: float, end: float) -> None:
        spans = [(start, end)]
        while spans and self._span.met is None:
            low, high = spans.pop()
            cut = self._advance(low, high - low)
            if cut is not None:
                spans += [(cut, high), (low, cut)]

    def _advance(self, start: float, length: float) -> float | None:
        """Solve a panel, or say where to divide it."""
        short = length <= 2 * self._floor
        tolerance = self._equations.scales.tolerance[: self._ends]
        arrived, cut = self._history.arriving(start, length, RESOLVED * tolerance)
        if cut is not None and not short:
            return cut
        panel = self._solve(GAUSS, start, length, arrived)
        if panel is None or not self._resolves(panel):
            if not short:
                return start + length / 2
            if self._floor > self._rtol * self._shortest:
                raise self._failure(start, "a layer is too narrow to be resolved so late in so long a run")
            panel = self._solve(RADAU, start, length, arrived)
            self._layers += 1
        if panel is None:
            raise self._failure(start, self._equations.stages.reason)
        return self._guarded(panel, short=short)

    def _resolves(self, panel: _Panel) -> bool:
        """Whether a panel leaves out less than the tolerance, between the Gauss points and before the first one."""
        if not self._equations.scales.resolved(panel.rows, self._x):
            return False
        return self._problem.linear or not self._x.size or self._obeys(panel)

    def _obeys(self, panel: _Panel) -> bool:
        """Whether a panel obeys the equations at its ends too."""
        stages, tolerance = self._equations.stages, self._equations.scales.tolerance
        rows = panel.rows[self._ends :]
        unseen = stages.unseen(panel.start, panel.length, self._x, panel.end, rows, panel.arrived)
        return bool((unseen <= RESOLVED * tolerance[self._ends :]).all())

    def _solve(self, scheme: Scheme, start: float, length: float, arrived: Array) -> _Panel | None:
        """A panel; None where there is no solution or it is not finite."""
        h, stages = arrived if scheme is GAUSS else arrived @ scheme.bring, self._equations.stages
        solution = stages.solve(scheme, start, length, self._x, self._equations.scales.states, h, self._trend)
        if solution is None:
            return None
        x, v = solution
        rows = np.concatenate([self._twice * v + h, x])
        if not math.isfinite(rows.sum()):
            stages.reason = "the speed of a line's end is not finite"
            return None
        end = self._x + (x - self._x[:, None]) @ scheme.close
        return _Panel(start, length, rows if scheme is GAUSS else rows @ scheme.give, end, arrived)

    def _guarded(self, panel: _Panel, *, short: bool) -> float | None:
        """Take a panel up to the first guard in it, or say where to divide it before that one."""
        if self._problem.guards is None:
            self._accept(panel)
            return None
        restriction = Restriction(panel.start, panel.length, self._x, panel.rows, panel.arrived)
        if not short and self._problem.timed and not self._sees(panel, restriction):
            return panel.start + panel.length / 2
        start, end = panel.start, panel.start + panel.length
        ahead = np.concatenate([panel.end, restriction.arriving(1.0)])
        cut = self._watch.cut(start, restriction.at(start), end, ahead, restriction)
        if cut is None:
            self._accept(panel)
            return None
        length = min(max(cut - start, 2 * self._merge), panel.length)
        if length < panel.length:
            x, rows, arrived = restriction.up_to(length)
            panel = _Panel(start, length, rows, x, arrived)
            if not (short or self._problem.linear or not self._x.size or self._obeys(panel)):
                return start + length / 2
        self._accept(panel)
        self._span.met, self._span.t = self._watch.met, start + length
        return None

    def _sees(self, panel: _Panel, restriction: Restriction) -> bool:
        """Whether a panel is short enough for the guards that change with time by themselves."""
        assert self._problem.guards is not None  # noqa: S101 (asked only then)
        times = panel.start + panel.length * GAUSS.nodes
        timed = list(self._problem.timed)
        values = self._problem.guards.values(times, restriction(times))[:, timed].T
        least = self._problem.guards.offsets[timed]  # what arrives may hold a guard at its limit, but for rounding
        # a panel may leave out a thousandth of a guard that changes by itself
        return bool((left_out(values, np.empty(0)) <= 1e-3 * np.abs(values).max(axis=1) + least).all())

    def _accept(self, panel: _Panel) -> None:
        if len(self._states) - self._span.first >= self._problem.max_steps:
            most = self._problem.earlier_steps + self._problem.max_steps
            raise self._failure(panel.start, f"{most} steps were not enough")
        waves, x = panel.rows[: self._ends], panel.rows[self._ends :]
        self._equations.scales.see(waves, x)
        self._history.append(panel.start, panel.length, waves)
        self._follow(-1)
        self._states.append(np.column_stack([self._x, x]))
        if self._problem.guards is not None:
            self._arrived.append(panel.arrived)
        self._x, self._trend = panel.end, x @ RIGHT[:, 1] * (2 / panel.length)
        if self._problem.progress is not None:
            self._problem.progress(panel.start + panel.length)

    def _follow(self, number: int) -> None:
        """Note when the kinks at the start of a panel arrive."""
        history, tolerance = self._history, self._equations.scales.tolerance[: self._ends]
        start, length, waves = history.starts[number], history.lengths[number], history.waves[number]
        last, before = history.lengths[number - 1], history.waves[number - 1]
        reach, near = min(max(length, last), self._shortest), min(length, last)
        ahead = waves @ (LEFT * [1.0, reach / 8 / length, (near / length) ** 2 / 32])
        behind = before @ (RIGHT * [1.0, reach / 8 / last, (near / last) ** 2 / 32])
        marked = np.abs(ahead - behind).max(axis=1) > tolerance
        if marked.any():
            for delay, ends in zip(self._lines.delays, self._lines.ends, strict=True):
                if marked[ends].any():
                    heapq.heappush(self._kinks, start + delay)

    def _failure(self, t: float, reason: str) -> SimulationError:
        return failure(self._problem, "delay", t, self._x, reason)

    def panels(self) -> tuple[WavePanels, dict[str, int]]:
        """All panels since the start, and their statistics."""
        history = self._history
        panels = WavePanels(
            np.array(history.starts[self._past :]),
            np.array(history.lengths[self._past :]),
            np.array(self._states),
            np.array(history.waves[self._past :]),
            tuple(self._span.passed),
            self._merge,
        )
        return panels, {"steps": len(self._states), **self._equations.stages.counts, "layers": self._layers}

    def left(self) -> Polynomials:
        """(q,) polynomials of all waves that have left the ends, also before the start."""
        history = self._history
        return Polynomials(
            np.array(history.starts), np.array(history.lengths), np.array(history.waves) @ POWERS, self._merge
        )

    def last(self) -> Trajectory:
        """The span since the equations were last entered: states, and behind them what arrives, (k, n + q)."""
        span, t_eval = self._span, self._problem.t_eval
        end = np.concatenate([self._x, self.arriving(span.t)])
        count, size = len(self._states) - span.first, self._x.size
        if not count:
            instant, row = np.array([span.t]), end[: size + self._ends]
            still = PiecewiseDense(instant, (lambda times: np.tile(row, (times.size, 1)),), instant, row.size)
            return Trajectory(np.empty(0), np.empty((0, size + self._ends)), still, {}, met=span.met, end=(span.t, end))
        first = self._past + span.first
        starts, lengths = (np.array(each[first:]) for each in (self._history.starts, self._history.lengths))
        states = np.array(self._states[span.first :]) @ STATE_POWERS
        arrived = np.array(self._arrived[span.first :]) @ POWERS
        arrived = np.concatenate([arrived, np.zeros((*arrived.shape[:2], 1))], axis=2)
        powers = Polynomials(starts, lengths, np.concatenate([states, arrived], axis=1), self._merge)
        steps = np.append(starts, span.t)
        dense = StatesDense(powers, steps)
        t = steps if t_eval is None else reached(t_eval, span.t)
        x = dense(t)
        if t_eval is None:
            x[-1] = np.concatenate([self._x, powers(t[-1:], left=True)[0, size:]])
        return Trajectory(t, x, dense, {"steps": count}, met=span.met, end=(span.t, end))
