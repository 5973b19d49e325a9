"""The lattice of a linear network whose delays have a common measure: every period has the same panels and maps."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from shaftwork.core.errors import SimulationError
from shaftwork.integrate.problem import Array
from shaftwork.integrate.smooth_intervals import SmoothInterval, failure, pieces, start_of_piece
from shaftwork.numerics.tolerances import SAME
from shaftwork.waves.delay_engine.collocation import (
    GAUSS,
    POWERS,
    RESOLVED,
    STAGES,
    STATE_POWERS,
    WEIGHTS,
    Scales,
    left_out,
    values_at,
)
from shaftwork.waves.delay_engine.lines import DelayProblem, DelayTrajectory, Past, past_of
from shaftwork.waves.delay_engine.waveforms import WavePanels, trajectory

# Numbers of panels.
Numbers = NDArray[np.intp]


@dataclass(frozen=True)
class Matrices:
    """A linear network between its delays: x' = A x + B h + u(t), v = C x + D h + e(t).

    Args:
        A: (n, n).
        B: (n, q).
        C: (q, n).
        D: (q, q).
    """

    A: Array
    B: Array
    C: Array
    D: Array

    @classmethod
    def of(cls, problem: DelayProblem) -> Matrices:
        """The matrices of a linear problem."""
        n, q = problem.x0.size, 2 * problem.delays.size
        piece = pieces(problem)[0]
        probe = 2.0**40  # so large that the slopes show without the rounding of the constants
        # early in the first piece: later a law may have lost its value
        t = np.full(2 * (n + q), piece.low + (piece.high - piece.low) / 1024)
        both = probe * np.hstack([np.eye(n + q), -np.eye(n + q)])
        slopes, speeds = (np.asarray(f(t, both[:n], both[n:])) for f in (problem.rhs, problem.speeds))
        slopes, speeds = ((f[:, : n + q] - f[:, n + q :]) / (2 * probe) for f in (slopes, speeds))
        return cls(slopes[:, :n], slopes[:, n:], speeds[:, :n], speeds[:, n:])


@dataclass(frozen=True)
class PanelMap:
    """One panel: from start state and arriving waves, and from inputs at the nodes, to what they change.

    Args:
        step: (n + q s, n + q s) to the increment of the state over the panel and to 2 Z v at the nodes.
        drive: (n + q s, (n + q) s) the same from u and e at the nodes.
        inner: (n s, n + q s) to the increments of the state at the nodes.
        inner_drive: (n s, (n + q) s).
    """

    step: Array
    drive: Array
    inner: Array
    inner_drive: Array


def panel_map(matrices: Matrices, twice: Array, length: float) -> PanelMap:
    """The map of panels of a length in s, for ends of 2 Z = `twice` (q,) in N m s."""
    n, q = len(matrices.A), len(twice)
    a, stages = length * GAUSS.matrix, np.eye(STAGES)
    inverse = np.linalg.inv(np.eye(n * STAGES) - np.kron(matrices.A, a))
    from_state = np.kron(matrices.A, a.sum(axis=1)[:, None])
    states = inverse @ np.hstack([from_state, np.kron(matrices.B, a)])
    drives = inverse @ np.hstack([np.kron(np.eye(n), a), np.zeros((n * STAGES, q * STAGES))])
    close = np.kron(np.eye(n), GAUSS.close[None, :])
    to_speed = np.kron(matrices.C, stages)
    doubled = np.repeat(twice, STAGES)[:, None]
    direct = np.hstack([np.kron(matrices.C, np.ones((STAGES, 1))), np.kron(matrices.D, stages)])
    direct_drive = np.hstack([np.zeros((q * STAGES, n * STAGES)), np.eye(q * STAGES)])
    return PanelMap(
        step=np.vstack([close @ states, doubled * (to_speed @ states + direct)]),
        drive=np.vstack([close @ drives, doubled * (to_speed @ drives + direct_drive)]),
        inner=states,
        inner_drive=drives,
    )


@dataclass(frozen=True)
class LatticeRun:
    """Some panels, solved.

    Args:
        numbers: (m,) of the panels, rising.
        starts: (m, n) states at the panels' starts, after a jump.
        states: (m, n, s) at the Gauss points.
        waves: (m, q, s) that leave the ends.
        arrived: (m, q, s) history torques.
        ends: state before each breakpoint and at the end of the last panel.
        squares: (m, q) integrals of the squared wave that leaves each end, over the delay before a panel's start; only
            where they were asked for.
    """

    numbers: Numbers
    starts: Array
    states: Array
    waves: Array
    arrived: Array
    ends: list[Array]
    squares: Array = field(default_factory=lambda: np.empty((0, 0)))


class Lattice:
    """The panels of all periods, numbered 0, 1, ... from t0, with the map of each.

    Args:
        problem: what is to be solved.
        panel_map: the map of panels of a length in parts of the period.
        period: in s.
        multiples: how many periods the delay of each line lasts.
        pattern: starts of the panels of every period in parts of it, rising from 0.
    """

    def __init__(
        self,
        problem: DelayProblem,
        panel_map: Callable[[float], PanelMap],
        period: float,
        multiples: tuple[int, ...],
        pattern: tuple[float, ...],
    ) -> None:
        self.problem = problem
        lengths = [after - before for before, after in pairwise((*pattern, 1.0))]
        self._offsets, self.lengths = np.array(pattern) * period, np.array(lengths) * period
        self._period, self.size = period, len(pattern)
        self._n, self._q = problem.x0.size, 2 * problem.delays.size
        self._maps = [panel_map(length) for length in lengths]
        self.lags = np.repeat(np.array(multiples) * self.size, 2)
        self.reach = int(self.lags.max())
        self.partners = np.arange(self._q) ^ 1
        self._before = self._waves_before(past_of(problem))
        ends = self.panels(np.array([*problem.breakpoints, problem.t_end])).tolist()
        if self.time(ends[-1]) < problem.t_end - self.near:
            ends[-1] += 1
        self.edges = [0, *ends]
        self.count = ends[-1]

    def _waves_before(self, past: Past) -> Array:
        """What left the ends before t0, told by one panel: (reach, q, s) at the Gauss points of the lattice."""
        panels = np.arange(-self.reach, 0)
        nodes = self.times(panels)[:, None] + self.lengths[panels % self.size, None] * GAUSS.nodes
        places = 2 * (nodes - past.starts[0]) / past.lengths[0] - 1
        values = values_at(past.waves[0] @ POWERS, places.ravel())
        return np.asarray(values.reshape(self._q, self.reach, STAGES).swapaxes(0, 1))

    @property
    def near(self) -> float:
        """Times nearer than this, in s, are the same."""
        return 16 * math.ulp(max(abs(self.problem.t0), abs(self.problem.t_end))) + SAME * self._period

    def time(self, panel: int) -> float:
        """Start time of a panel in s."""
        return float(self.times(np.array([panel]))[0])

    def times(self, panels: Numbers) -> Array:
        """Start times of panels in s."""
        periods, places = np.divmod(panels, self.size)
        return np.asarray(self.problem.t0 + (periods * self._period + self._offsets[places]), dtype=float)

    def weights(self, panels: Numbers) -> Array:
        """Weights (..., s) in s of the values at the Gauss points in an integral over each panel."""
        return np.asarray(self.lengths[panels % self.size, None] / 2 * WEIGHTS)

    def panels(self, times: Array) -> Numbers:
        """The panels in which times (k,) in s lie, the later ones where two meet."""
        elapsed = times - self.problem.t0 + self.near
        periods = np.floor(elapsed / self._period)
        places = np.searchsorted(self._offsets, elapsed - periods * self._period, side="right") - 1
        return np.asarray(periods.astype(np.intp) * self.size + np.maximum(places, 0))

    def run(self, count: int) -> LatticeRun:
        """Solve the first panels."""
        waves = np.empty((self.reach + count, self._q, STAGES))
        waves[: self.reach] = self._before
        starts, ends = np.empty((count, self._n)), []
        x = np.asarray(self.problem.x0, dtype=float)
        inputs = np.empty((count, (self._n + self._q) * STAGES))
        edges = pairwise(min(edge, count) for edge in self.edges)
        for piece, (low, high) in zip(pieces(self.problem), edges, strict=True):
            if low == count:
                break
            x = start_of_piece(self.problem, piece, x)
            inputs[low:high] = self.inputs(piece, low, high)
            drive = self.applied(inputs[low:high], np.arange(low, high), "drive")
            solved, left = self._blocks(low, x, waves[low : low + self.reach], drive)
            starts[low:high], x = solved[:-1], solved[-1]
            waves[low + self.reach : high + self.reach] = left
            ends.append(x)
        arrived = -waves[np.arange(count)[:, None] + self.reach - self.lags, self.partners]
        numbers = np.arange(count)
        states = self.inside(numbers, starts, arrived, inputs)
        return LatticeRun(numbers, starts, states, waves[self.reach :], arrived, ends)

    def inputs(self, piece: SmoothInterval, low: int, high: int) -> Array:
        """Inputs u, then e (high - low, (n + q) s) of the panels of a piece."""
        if self.problem.steady:
            values = self._constants(np.array([(piece.low + piece.high) / 2]))
            return np.broadcast_to(np.repeat(values[:, 0], STAGES), (high - low, values.size * STAGES))
        panels = np.arange(low, high)
        nodes = self.times(panels)[:, None] + self.lengths[panels % self.size, None] * GAUSS.nodes
        values = self._constants(np.clip(nodes.ravel(), piece.low, piece.high))
        return np.asarray(values.reshape(-1, high - low, STAGES).transpose(1, 0, 2).reshape(high - low, -1))

    def _constants(self, times: Array) -> Array:
        rest = np.zeros((self._n, times.size)), np.zeros((self._q, times.size))
        return np.concatenate([self.problem.rhs(times, *rest), self.problem.speeds(times, *rest)])

    def applied(self, rows: Array, panels: Numbers, name: str) -> Array:
        """A matrix of each panel's map times the panel's row (m, ...)."""
        result = np.empty((len(rows), getattr(self._maps[0], name).shape[0]))
        places = panels % self.size
        for place, chosen in enumerate(self._maps):
            mine = places == place
            result[mine] = rows[mine] @ getattr(chosen, name).T
        return result

    def inside(self, panels: Numbers, starts: Array, arrived: Array, inputs: Array) -> Array:
        """States (m, n, s) at the Gauss points of some panels, from start states, history torques and inputs."""
        incoming = np.hstack([starts, arrived.reshape(len(panels), -1)])
        inner = self.applied(incoming, panels, "inner") + self.applied(inputs, panels, "inner_drive")
        return np.asarray(starts[:, :, None] + inner.reshape(len(panels), -1, STAGES))

    def _blocks(self, first: int, x: Array, window: Array, drive: Array) -> tuple[Array, Array]:
        """States (m + 1, n) and waves (m, q, s) of panels from the `first` on, m rows of `drive`."""
        count = len(drive)
        length = self.size * max(1, round(math.sqrt(count / self.size)))
        # Blocks are marched side by side where at most 300 numbers describe the past of one.
        blocks = count // length if self._n + self.reach * self._q * STAGES <= 300 else 0
        states, waves = [], []
        if blocks:
            driven = drive[: blocks * length].reshape(blocks, length, -1).transpose(1, 2, 0)
            starts = self._block_starts(first, x, window, driven)
            n, tail = self._n, starts.shape[1]
            bundle = self.march(first, starts[:n], starts[n:].reshape(*window.shape, tail), driven)
            states.append(bundle[0][:-1].transpose(2, 0, 1).reshape(blocks * length, n))
            waves.append(bundle[1].transpose(3, 0, 1, 2).reshape(-1, self._q, STAGES))
            x = bundle[0][-1][:, -1]
            window = np.concatenate([window, waves[0]])[-self.reach :]
        rest = self.march(first, x[:, None], window[..., None], drive[blocks * length :, :, None])
        return np.concatenate([*states, rest[0][..., 0]]), np.concatenate([*waves, rest[1][..., 0]])

    def _block_starts(self, first: int, x: Array, window: Array, driven: Array) -> Array:
        """State and window (n + reach q s, blocks) with which each block starts."""
        blocks = driven.shape[2]
        power, forced = self.power(first, driven)
        starts = np.empty((len(power), blocks))
        starts[:, 0] = np.concatenate([x, window.ravel()])
        for block in range(1, blocks):
            starts[:, block] = power @ starts[:, block - 1] + forced[:, block - 1]
        return starts

    def power(self, first: int, driven: Array) -> tuple[Array, Array]:
        """What a block makes of unit vectors (z, z) and of its inputs alone (z, blocks), z = n + reach q s."""
        length, _, blocks = driven.shape
        size = self._n + self.reach * self._q * STAGES
        units = np.hstack([np.eye(size), np.zeros((size, blocks))])
        inputs = np.zeros((length, driven.shape[1], size + blocks))
        inputs[:, :, size:] = driven
        shape = (self.reach, self._q, STAGES, size + blocks)
        states, waves = self.march(first, units[: self._n], units[self._n :].reshape(shape), inputs)
        window = np.concatenate([units[self._n :].reshape(shape), waves])[-self.reach :]
        after = np.concatenate([states[-1], window.reshape(-1, size + blocks)])
        return after[:, :size], after[:, size:]

    def march(self, first: int, x: Array, window: Array, drive: Array) -> tuple[Array, Array]:
        """States (m + 1, n, c) and waves (m, q, s, c) of c motions side by side, from x (n, c) and their windows."""
        count, columns = len(drive), x.shape[1]
        states = np.empty((count + 1, self._n, columns))
        waves = np.concatenate([window, np.empty((count, *window.shape[1:]))])
        states[0] = x
        lags = self.reach - self.lags
        incoming = np.empty((self._n + self._q * STAGES, columns))
        for panel in range(count):
            arrived = waves[panel + lags, self.partners]
            incoming[: self._n] = x
            np.negative(arrived.reshape(-1, columns), out=incoming[self._n :])
            change = self._maps[(first + panel) % self.size].step @ incoming
            change += drive[panel]
            change += incoming
            # The wave that arrived leaves again but for what the end's motion adds, so little is rounded.
            x = states[panel + 1] = change[: self._n]
            waves[panel + self.reach] = change[self._n :].reshape(arrived.shape)
        return states, waves[self.reach :]

    def unresolved(self, run: LatticeRun, rtol: float) -> list[bool]:
        """Whether each panel of the period must be finer."""
        problem = self.problem
        rows = np.concatenate([run.waves, run.states], axis=1)
        largest = np.maximum.accumulate(np.abs(rows).max(axis=2), axis=0)
        largest = np.maximum(largest, np.concatenate([np.abs(self._before).max(axis=(0, 2)), np.abs(problem.x0)]))
        scales = Scales(problem.impedances, problem.atol_waves, problem.atol, rtol)
        with np.errstate(invalid="ignore"):
            fits = np.all(left_out(rows, run.starts) <= RESOLVED * scales.tolerances(largest), axis=1)
        finite = np.isfinite(rows).all(axis=(1, 2))
        if not finite.all():
            if problem.explain is not None:
                error = problem.explain(self.times(run.numbers), np.zeros_like(run.starts))
                if error is not None:
                    raise error
            panel = int(np.argmin(finite))
            raise self.failure(panel, run.starts[panel], "a wave or a state is not finite")
        return [not fits[run.numbers % self.size == place].all() for place in range(self.size)]

    def wrinkles(self, run: LatticeRun) -> float:
        """The part of the largest wave that panels leave out, about."""
        rows = np.concatenate([run.waves, run.states], axis=1)
        return float(left_out(rows, run.starts)[:, : self._q].max() / np.abs(run.waves).max())

    def trajectory(self, run: LatticeRun, times: Array | None) -> DelayTrajectory:
        """What was found in the first panels, or in all, at times (k,) in s or at the ends of the panels."""
        problem, count = replace(self.problem, t_eval=times), len(run.numbers)
        starts, lengths = self.times(run.numbers), self.lengths[run.numbers % self.size]
        states = np.concatenate([run.starts[:, :, None], run.states], axis=2)
        # The last panel may end after the run.
        place = 2 * (problem.t_end - starts[-1]) / lengths[-1] - 1
        end = states[-1] @ STATE_POWERS @ place ** np.arange(STAGES + 1)
        passed = tuple(zip(self.edges[1:], [*run.ends[:-1], end], strict=True))
        panels = WavePanels(starts, lengths, states, run.waves, passed, self.near)
        return trajectory(problem, panels, {"steps": count})

    def failure(self, panel: int, x: Array, reason: str) -> SimulationError:
        """The error of a run that failed in a panel with a state (n,) at its start."""
        return failure(self.problem, "delay", self.time(panel), x, reason)
