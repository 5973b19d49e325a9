"""The engine for lossless lines: a network of ordinary differential equations whose lines are delays."""

from __future__ import annotations

import heapq
import math

import numpy as np

from shaftwork.core.errors import SimulationError
from shaftwork.integrate.engines import WAVE
from shaftwork.integrate.lossless import commensurate
from shaftwork.integrate.lossless.collocation import GAUSS, LEFT, RADAU, RIGHT, Scheme
from shaftwork.integrate.lossless.lines import DelayProblem, DelayTrajectory, Lines, past_of
from shaftwork.integrate.lossless.panels import History
from shaftwork.integrate.lossless.scales import RESOLVED, Scales
from shaftwork.integrate.lossless.stages import Stages
from shaftwork.integrate.lossless.waveforms import Panels, trajectory
from shaftwork.integrate.pieces import failure, pieces, start_of_piece
from shaftwork.integrate.problem import Array

# The shortest panel takes this part of rtol times the shortest delay.
SHORTEST = 1e-2


def solve(problem: DelayProblem) -> DelayTrajectory:
    """Integrate by Gauss collocation of order 16 on panels between the kinks, none longer than the shortest delay.

    Law: on such a panel all h are known, so only the states are solved for. A jump or kink of a wave, born at t0, at
    a breakpoint or in a law, ends a panel, and ends one again a delay later at the far end of its line, for as long
    as it moves a wave by more than the tolerance. Delays without a common measure so make ever more panels, in
    proportion to the square of the time for two of them; kinks nearer than a part 1e-4 rtol of a delay are one, and
    weak ones stay inside a panel, which is then halved at the kink if it does not resolve them: the error follows
    rtol, and `max_steps` is the bound. Where the panels of a line repeat with its delay the nodes coincide, h is
    taken from them, and Gauss quadrature of the exchanged power is exact: energy is kept to rounding. Elsewhere h is
    the polynomial of its panel, one-sided at the panel's ends, checked between the nodes.

    A panel is halved until the Legendre coefficients that states and waves leave out are below a tenth of the
    tolerance, so the panels are graded towards the boundary layer of a light end. A layer that is narrower than the
    hundredth part of rtol times the shortest delay is stepped over by Radau IIA, which leaves no ringing; in it the
    output is that of a straightened layer. Linear networks whose delays have a common measure are solved by one
    constant map a panel, and long ones with constant inputs and few outputs by its powers
    (`shaftwork.integrate.lossless.commensurate`).

    Raises:
        SimulationError: a value is not finite, Newton's method fails, a layer cannot be resolved, or too many panels.

    Source: Bergeron, Du coup de belier en hydraulique au coup de foudre en electricite, 1949; Bellen and Zennaro,
    Numerical Methods for Delay Differential Equations, 2003; Hairer, Lubich, Wanner, Geometric Numerical Integration,
    IV.2.
    """
    with np.errstate(all="ignore"):
        if problem.linear and problem.past is None and (found := commensurate.solve(problem)) is not None:
            return found
        march = _March(problem)
        march.run()
    return march.trajectory()


class _March:
    """One run, panel after panel."""

    def __init__(self, problem: DelayProblem) -> None:
        self._problem = problem
        self._lines = Lines.of(problem.delays)
        self._rtol = max(problem.rtol, WAVE.finest)
        self._shortest = min(self._lines.delays)
        grain = math.ulp(max(abs(problem.t0), abs(problem.t_end)))
        self._merge = max(8 * grain, 1e-4 * self._rtol * self._shortest)
        self._floor = max(SHORTEST * self._rtol * self._shortest, 20 * self._merge)
        self._ends = 2 * problem.delays.size
        self._twice = 2 * np.repeat(problem.impedances, 2)[:, None]
        past = past_of(problem)
        self._history = History(self._lines, past, self._merge)
        self._past = past.starts.size
        self._kinks: list[float] = []
        self._x = np.asarray(problem.x0, dtype=float)
        self._scales = Scales(problem.impedances, problem.atol_waves, problem.atol, self._rtol)
        self._scales.see(np.concatenate([np.abs(past.waves).max(axis=(0, 2)), self._x])[:, None])
        for number in range(1, self._past):
            self._follow(number)
        self._states: list[Array] = []
        self._passed: list[tuple[int, Array]] = []
        self._stages = Stages(problem, self._rtol)
        self._layers = 0

    def run(self) -> None:
        """Cover all pieces."""
        for piece in pieces(self._problem):
            self._x = start_of_piece(self._problem, piece, self._x)
            self._stages.enter(piece.low, piece.high)
            t = piece.start
            while piece.end - t > self._merge:
                end = min(self._next_kink(t), t + self._shortest)
                end = piece.end if end > piece.end - self._merge else end
                self._cover(t, end)
                t = end
            self._passed.append((len(self._states), self._x))

    def _next_kink(self, t: float) -> float:
        while self._kinks and self._kinks[0] <= t + self._merge:
            heapq.heappop(self._kinks)
        return self._kinks[0] if self._kinks else math.inf

    def _cover(self, start: float, end: float) -> None:
        spans = [(start, end)]
        while spans:
            low, high = spans.pop()
            cut = self._advance(low, high - low)
            if cut is not None:
                spans += [(cut, high), (low, cut)]

    def _advance(self, start: float, length: float) -> float | None:
        """Solve a panel, or say where to divide it."""
        short = length <= 2 * self._floor
        arrived, cut = self._history.arriving(start, length, RESOLVED * self._scales.tolerance[: self._ends])
        if cut is not None and not short:
            return cut
        found = self._solve(GAUSS, start, length, arrived)
        if found is None or not self._resolves(start, length, arrived, *found):
            if not short:
                return start + length / 2
            if self._floor > self._rtol * self._shortest:
                raise self._failure(start, "a layer is too narrow to be resolved so late in so long a run")
            found = self._solve(RADAU, start, length, arrived)
            self._layers += 1
        if found is None:
            raise self._failure(start, self._stages.reason)
        self._accept(start, length, *found)
        return None

    def _resolves(self, start: float, length: float, arrived: Array, rows: Array, end: Array) -> bool:
        """Whether a panel leaves out less than the tolerance, between the Gauss points and before the first one."""
        if not self._scales.resolved(rows, self._x):
            return False
        if self._problem.linear or not self._x.size:
            return True
        unseen = self._stages.unseen(start, length, self._x, end, rows[self._ends :], arrived)
        return bool((unseen <= RESOLVED * self._scales.tolerance[self._ends :]).all())

    def _solve(self, scheme: Scheme, start: float, length: float, arrived: Array) -> tuple[Array, Array] | None:
        """Waves, then states (q + n, s) at the Gauss points, and the state (n,) at the end."""
        h = arrived if scheme is GAUSS else arrived @ scheme.bring
        stages = self._stages.solve(scheme, start, length, self._x, self._scales.states, h)
        if stages is None:
            return None
        x, v = stages
        rows = np.concatenate([self._twice * v + h, x])
        if not math.isfinite(rows.sum()):
            self._stages.reason = "the speed of a line's end is not finite"
            return None
        end = self._x + (x - self._x[:, None]) @ scheme.close
        return rows if scheme is GAUSS else rows @ scheme.give, end

    def _accept(self, start: float, length: float, rows: Array, end: Array) -> None:
        if len(self._states) >= self._problem.max_steps:
            raise self._failure(start, f"{self._problem.max_steps} steps were not enough")
        waves, x = rows[: self._ends], rows[self._ends :]
        self._scales.see(rows)
        self._history.append(start, length, waves)
        self._follow(-1)
        self._states.append(np.column_stack([self._x, x]))
        self._x = end
        if self._problem.progress is not None:
            self._problem.progress(start + length)

    def _follow(self, number: int) -> None:
        """Note when the kinks at the start of a panel arrive."""
        history = self._history
        start, length, waves = history.starts[number], history.lengths[number], history.waves[number]
        last, before = history.lengths[number - 1], history.waves[number - 1]
        reach, near = min(max(length, last), self._shortest), min(length, last)
        ahead = waves @ (LEFT * [1.0, reach / 8 / length, (near / length) ** 2 / 32])
        behind = before @ (RIGHT * [1.0, reach / 8 / last, (near / last) ** 2 / 32])
        marked = np.abs(ahead - behind).max(axis=1) > self._scales.tolerance[: self._ends]
        if marked.any():
            for delay, ends in zip(self._lines.delays, self._lines.ends, strict=True):
                if marked[ends].any():
                    heapq.heappush(self._kinks, start + delay)

    def _failure(self, t: float, reason: str) -> SimulationError:
        return failure(self._problem, "delay", t, self._x, reason)

    def trajectory(self) -> DelayTrajectory:
        """What was found."""
        history = self._history
        panels = Panels(
            np.array(history.starts[self._past :]),
            np.array(history.lengths[self._past :]),
            np.array(self._states),
            np.array(history.waves[self._past :]),
            tuple(self._passed),
            self._merge,
        )
        statistics = {"steps": len(self._states), **self._stages.counts, "layers": self._layers}
        return trajectory(self._problem, panels, statistics)
