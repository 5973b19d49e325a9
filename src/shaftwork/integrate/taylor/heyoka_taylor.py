"""The fast engine: Taylor series of adaptive step and order, compiled by heyoka."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from shaftwork.core.errors import SimulationError
from shaftwork.integrate.engines import ENGINES
from shaftwork.integrate.problem import Array, Problem, Trajectory
from shaftwork.integrate.smooth_intervals import PiecewiseDense, both_sides, pieces, reached
from shaftwork.integrate.taylor.heyoka_run import GUARD, TaylorRun, series_failure
from shaftwork.integrate.taylor.heyoka_switches import SwitchWatch

# Steps times states, some 50 ms, after which Python notices Ctrl-C and tells how far the run is.
UNINTERRUPTED = 250_000


def solve(problem: Problem) -> Trajectory:
    """Integrate the heyoka program of a problem.

    With `t_eval` the run only fills the output grid; dense output and step ends are made by a second, identical run
    when they are first asked for. Where a law has a root or a pole, there is one run, and its series are compared with
    the equations in every step.

    Raises:
        SimulationError: the problem has no heyoka program, or the integration failed; a `SeriesError` where another
            engine may go on.

    Source: Biscani, Izzo, Revisiting high-order Taylor methods for astrodynamics and celestial mechanics, MNRAS 2021.
    """
    if problem.program is None:
        raise SimulationError(
            f"heyoka compiles small networks whose laws have Taylor series. This one, of {problem.x0.size} states, is "
            "too large or has another law. Take engine='auto', 'sundials' or 'scipy'."
        )
    if problem.t_eval is not None and not problem.program.program.singular:
        return _on_grid(problem, np.asarray(problem.t_eval, dtype=float))
    dense = _TaylorReplay(problem)
    t, x = both_sides(problem, *dense.step_ends)
    end = float(t[-1]), x[-1]
    if problem.t_eval is not None:
        t = reached(np.asarray(problem.t_eval, dtype=float), end[0])
        x = dense(t)
    return Trajectory(t, x, dense, {"steps": dense.steps.size - 1}, met=dense.met, end=end)


def tolerance(problem: Problem) -> float:
    """heyoka's one tolerance, a part of the largest state, which torques are.

    Speeds keep some five digits more than that, in measured motions with gaps and clutches; where torques are larger
    beside them, it is tightened by so much.
    """
    ordinary = min(problem.rtol, ENGINES["heyoka"].loosest)
    finest, coarsest = problem.atol.min(initial=np.inf), problem.atol.max(initial=0.0)
    tightened = problem.rtol * 1e5 * finest / coarsest if 0.0 < finest < coarsest else ordinary
    # in powers of ten, as each value compiles an integrator of its own
    return problem.overall * (ordinary if ordinary <= tightened else 10.0 ** math.floor(math.log10(tightened)))


def _on_grid(problem: Problem, times: Array) -> Trajectory:
    with problem.program.program.lent(tolerance(problem)) as lent:
        return _filled(TaylorRun(problem, lent), times)


def _filled(run: TaylorRun, times: Array) -> Trajectory:
    problem, stops = run.problem, list[float]()
    states = np.empty((times.size, run.state.size))
    # where a guard is likely to be met before the last of them, not all times are given to heyoka at once
    done, chunk = 0, times.size + 1 if problem.guards is None else 32
    for piece in pieces(problem):
        # An output at a breakpoint belongs to the next piece: it is the state after the jump.
        stop = times.size if piece.end == problem.t_end else int(np.searchsorted(times, piece.end, side="left"))
        recorder = _GridRecorder(problem, states[done:stop], times[done:stop], piece.end, chunk, stops)
        run.piece(piece, recorder)
        if run.met is not None:
            done += recorder.filled
            break
        done = stop
    # the integrator's own time may be a rounding away from where it was sent
    end = None if problem.guards is None else (problem.t_end if run.met is None else run.integrator.time, run.state)
    dense = _TaylorReplay(problem, stops, run.integrator.time)
    return Trajectory(times[:done], states[:done], dense, {"steps": run.steps}, met=run.met, end=end)


class _TaylorReplay:
    """Dense output that runs the problem when it is first asked, in the steps of the run before, if there was one.

    Args:
        problem: what to solve.
        stops: times in s at which that run has stopped on its way.
        end: of that run, s.
    """

    def __init__(self, problem: Problem, stops: Sequence[float] = (), end: float | None = None) -> None:
        self._problem, self._stops, self._end = problem, stops, end

    @cached_property
    def _replayed(self) -> tuple[tuple[tuple[Any, ...], ...], int | None]:
        problem, recorders = self._problem, list[_SegmentRecorder]()
        with problem.program.program.lent(tolerance(problem)) as lent:
            run = TaylorRun(problem, lent)
            for piece in pieces(problem):
                recorders.append(_SegmentRecorder(problem, piece.end, [s for s in self._stops if s < piece.end]))
                run.piece(piece, recorders[-1])
                if run.program.singular:
                    run.verify(piece, recorders[-1].segments)
                if run.met is not None:
                    break
            if self._end is not None and abs(run.integrator.time - self._end) > 1e-6 * (problem.t_end - problem.t0):
                reason = f"the same run made again for its dense output ends there, not at t = {self._end:.9g} s"
                raise series_failure(problem, run.integrator.time, run.state, reason)
        return tuple(tuple(recorder.segments) for recorder in recorders), run.met

    @property
    def _segments(self) -> tuple[tuple[Any, ...], ...]:
        return self._replayed[0]

    @property
    def met(self) -> int | None:
        """The guard that ended the run."""
        return self._replayed[1]

    @cached_property
    def _dense(self) -> PiecewiseDense:
        segments = [segment for piece in self._segments for segment in piece]
        starts = np.array([segment.bounds[0] for segment in segments])
        steps = np.unique(np.concatenate([segment.times for segment in segments]))
        # heyoka's output lives in a buffer that the next call writes again.
        parts = tuple(lambda at, segment=segment: segment(at).copy() for segment in segments)
        return PiecewiseDense(starts, parts, steps, self._problem.x0.size)

    @property
    def step_ends(self) -> tuple[list[Array], list[Array]]:
        """Times and states at the step ends of each piece."""
        times = [np.unique(np.concatenate([segment.times for segment in piece])) for piece in self._segments]
        states = []
        for piece, at in zip(self._segments, times, strict=True):
            starts = np.array([segment.bounds[0] for segment in piece])
            states.append(PiecewiseDense(starts, piece, at, self._problem.x0.size)(at))
        return times, states

    @property
    def steps(self) -> Array:
        return self._dense.steps

    def __call__(self, times: Array) -> Array:
        return self._dense(times)


class _Breaks:
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


class _GridRecorder:
    """Fills rows of output while the integrator passes their times; `stops` are those at which it stops in between."""

    def __init__(self, problem: Problem, rows: Array, times: Array, end: float, chunk: int, stops: list[float]) -> None:
        self._breaks = _Breaks(problem)
        self._rows, self._chunk, self._stops = rows, chunk, stops
        # The grid always ends with the piece, because the next piece starts from there.
        self._grid = times if times.size and times[-1] == end else np.append(times, end)
        self._filled = 0

    @property
    def filled(self) -> int:
        """Rows of output that are filled."""
        return min(self._filled, len(self._rows))

    def __call__(self, integrator: Any, watch: SwitchWatch | None, limit: int, longest: float) -> tuple[Any, str, int]:
        taken = 0
        while True:
            pending, now = self._grid[self._filled : self._filled + self._chunk], integrator.time
            extra = int(pending[0] != now)  # heyoka's grid starts at the present time
            outcome, _, _, steps, _, rows = integrator.propagate_grid(
                np.append(now, pending) if extra else pending,
                max_steps=self._breaks.limit(limit - taken),
                max_delta_t=longest,
                callback=watch,
            )
            rows, taken = rows[extra:], taken + steps
            wanted = rows[: len(self._rows) - self._filled]
            self._rows[self._filled : self._filled + len(wanted)] = wanted
            self._filled += len(rows)
            arrived = self._filled == self._grid.size
            if len(rows) < len(pending) and self._breaks.goes_on(integrator, outcome, steps, limit - taken):
                continue
            if arrived or len(rows) < len(pending) or taken >= limit:
                return outcome, _outcome(outcome, watch, arrived=arrived), taken
            self._stops.append(integrator.time)


class _SegmentRecorder:
    """Keeps heyoka's continuous output of the spans that it passes, with the stops of an earlier run in between."""

    def __init__(self, problem: Problem, end: float, stops: Sequence[float] = ()) -> None:
        self._breaks = _Breaks(problem)
        self._end, self._stops = end, stops
        self.segments: list[Any] = []

    def __call__(self, integrator: Any, watch: SwitchWatch | None, limit: int, longest: float) -> tuple[Any, str, int]:
        taken = 0
        while True:
            stop = min((stop for stop in self._stops if stop > integrator.time), default=self._end)
            outcome, _, _, steps, segment, _ = integrator.propagate_until(
                stop, max_steps=self._breaks.limit(limit - taken), max_delta_t=longest, callback=watch, c_output=True
            )
            taken += steps
            if outcome.name == "time_limit":  # heyoka counts time in two numbers, and may end a rounding beside it
                integrator.time = stop
            if segment is not None:
                self.segments.append(segment)
            arrived = integrator.time == self._end
            if integrator.time != stop and self._breaks.goes_on(integrator, outcome, steps, limit - taken):
                continue
            if arrived or integrator.time != stop or taken >= limit:
                return outcome, _outcome(outcome, watch, arrived=arrived), taken


def _outcome(outcome: Any, watch: SwitchWatch | None, *, arrived: bool) -> str:
    """Name of heyoka's outcome; a watch that stops the very last step has stopped the run only if it has a reason.

    A run that has come to a stop on its way with its last step has met the limit of its steps, not its end.
    """
    failed = watch is not None and watch.reason is not None
    if int(outcome) > -(2**32) and not failed:  # heyoka's outcomes proper are below; these are events that end a run
        return GUARD
    if arrived and not failed:
        return "time_limit"
    return "step_limit" if outcome.name == "time_limit" else str(outcome.name)
