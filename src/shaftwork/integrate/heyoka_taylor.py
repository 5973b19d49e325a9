"""The fast engine: Taylor series of adaptive step and order, compiled by heyoka."""

from __future__ import annotations

import importlib.util
import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from shaftwork.core.errors import MissingExtraError, SimulationError
from shaftwork.integrate.engines import ENGINES
from shaftwork.integrate.heyoka_recorders import GUARD, GridRecorder, SegmentRecorder
from shaftwork.integrate.heyoka_series import Rates, satisfied
from shaftwork.integrate.pieces import (
    PiecewiseDense,
    SmoothInterval,
    both_sides,
    failure,
    pieces,
    reached,
    start_of_piece,
    used_up,
)
from shaftwork.integrate.problem import Array, Problem, SeriesError, StickingError, Trajectory
from shaftwork.integrate.switches import SOMEWHERE, SwitchWatch, keeps_sides, settle

# The cost grows only with the logarithm of the tolerance, and a loose one loses events.
LOOSEST_TOLERANCE = 1e-10

# Its one tolerance is a part of the largest state, which torques are. Speeds keep some five digits more than that, in
# measured motions with gaps and clutches; where torques are larger beside them, it is tightened by so much.
MORE_DIGITS = 1e5

FIRST_TRIALS, SHORTER = 30, 0.25  # trials of a first step whose series does not satisfy the equations, each so shorter

# Where in a step a series is compared with the equations, as parts of the step: not at its end, where a law may jump.
INSIDE = (0.5, 0.9)

# From (integrator, step callback, step limit, longest step) to (outcome, its name, steps taken); called again after an
# interruption. It returns to Python after some steps each, which changes them by rounding alone.
Advance = Callable[[Any, SwitchWatch | None, int, float], tuple[Any, str, int]]
# Output times that heyoka is given at once where a guard is likely to be met before the last of them.
CHUNK = 32
# Two runs of one problem end at times that differ by less of its span.
ALIKE = 1e-6
# What is the least that rounding moves a guard of size 1.
ROUNDING = 8 * float(np.finfo(float).eps)


def solve(problem: Problem) -> Trajectory:
    """Integrate the heyoka program of a problem.

    With `t_eval` the run only fills the output grid; dense output and step ends are made by a second, identical run
    when they are first asked for. Where a law has a root or a pole, there is one run, and its series are compared with
    the equations in every step.

    Raises:
        MissingExtraError: heyoka is not installed.
        SimulationError: the problem has no heyoka program, or the integration failed; a `SeriesError` where another
            engine may go on.

    Source: Biscani, Izzo, Revisiting high-order Taylor methods for astrodynamics and celestial mechanics, MNRAS 2021.
    """
    if importlib.util.find_spec("heyoka") is None:
        raise MissingExtraError("heyoka", "fast", "engine='heyoka'")
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


def _tolerance(problem: Problem) -> float:
    ordinary = min(max(problem.rtol, ENGINES["heyoka"].finest), LOOSEST_TOLERANCE)
    finest, coarsest = problem.atol.min(initial=np.inf), problem.atol.max(initial=0.0)
    tightened = problem.rtol * MORE_DIGITS * finest / coarsest if 0.0 < finest < coarsest else ordinary
    # in powers of ten, as each value compiles an integrator of its own
    return problem.overall * (ordinary if ordinary <= tightened else 10.0 ** math.floor(math.log10(tightened)))


NEAR = 1e-12
"""Part of its size by which a guard at the instant of a switch may be below its limit and be met by rounding."""


class _TaylorRun:
    """One run over a problem, by an integrator that is lent for it."""

    def __init__(self, problem: Problem, lent: Any) -> None:
        self.problem = problem
        self.program = problem.program.program
        self.lent, self.integrator = lent, lent.integrator
        self._x, self._p = lent.integrator.state, lent.integrator.pars  # heyoka's own, which it makes anew at each look
        self.parameters: Array = problem.program.parameters.copy()
        self.state: Array = np.array(problem.x0, dtype=float)
        self.start = self.state
        self.steps = 0
        self.met: int | None = None
        """The guard that ended the run."""
        self._begun: tuple[float, Array] | None = None
        """Time in s and state at the last guard past which it went on."""
        self.reactions: list[tuple[float, Callable[[], Rates]]] = []
        """Times in s of guards past which it went on, and what makes the equations that hold from there on."""

    def piece(self, piece: SmoothInterval, advance: Advance) -> None:
        """Bring the run to the end of a piece; `advance` records what it passes."""
        integrator, self._begun = self.integrator, None
        integrator.time = piece.start
        integrator.state[:] = self.start = start_of_piece(self.problem, piece, self.state)
        # heyoka keeps no parameters behind the last one that the rows contain
        used = min(integrator.pars.size, self.parameters.size)
        if self.program.held is not None:
            inside = piece.low + SOMEWHERE * (piece.high - piece.low)
            self.program.held.start(piece.start, inside, self.start, self.parameters)
        integrator.pars[:used] = self.parameters[:used]
        integrator.reset_cooldowns() if integrator.with_events else None
        if self.problem.guards is not None:
            self._sizes = np.fmax(self.problem.guards.sizes, 1.0).tolist()
            self._sides = integrator.pars[self.program.sides]
            self._offsets = integrator.pars[self.program.offsets]
            self._guard([*enumerate(self.problem.guards.sides.tolist())], self.problem.guards.offsets.tolist())
        self.program.weigh(integrator)
        watch = self._watch(piece)
        self.lent.listeners.clear()
        longest = self._first_step(piece)
        self.lent.listeners[:] = [self._reacts] if watch is None else []
        while True:
            left = self.problem.max_steps - self.steps
            raw, outcome, steps = advance(integrator, watch, left if longest == math.inf else 1, longest)
            self.steps += steps
            if outcome == "step_limit" and longest < math.inf and left > 1:
                longest = math.inf
                continue
            self.met = self._guard_met(raw, outcome, watch)
            if self.met is None and outcome == "cb_stop" and watch is not None and watch.reason is None:
                if watch.leaves:
                    settle(self.program, integrator, piece.end - piece.start)
                continue
            # a switch may be at zero where a guard is met, and settling it takes a step: it is not passed at once
            if self.met is not None and watch is not None and self._reacts(self.met):
                self.met = None
                integrator.reset_cooldowns()
                settle(self.program, integrator, piece.end - integrator.time)
                continue
            break
        if self.met is None and outcome not in ("time_limit", "success"):
            raise self._failure(piece, outcome, watch)
        self.state = integrator.state.copy()
        if not np.isfinite(self.state).all():
            raise self._failure(piece, "err_nf_state", watch)
        if self.problem.react is not None:
            self.problem.react.refuse_missed(self.met, integrator.time, self.state)

    def _guard(self, ends: Sequence[tuple[int, float]], offsets: Sequence[float]) -> None:
        """Watch the guards that end the phase from here on, by their numbers and sides, and no others.

        heyoka's tolerance is relative to the largest of states and events: a torque of 1e6 N m in one would cost six
        digits. So guards count in parts of their size, which their first values tell, and how far rounding moves them.
        """
        self._sides[:] = 0.0
        for number, side in ends:  # a few at each change of mode: plain floats are faster than arrays
            offset = offsets[number]
            size = max(self._sizes[number], offset / ROUNDING)
            self._sides[number], self._offsets[number] = side / size, offset / size

    def _guard_met(self, raw: Any, outcome: str, watch: SwitchWatch | None) -> int | None:
        """The guard at which the run has stopped, by its own event or at that of a switch at the very same instant."""
        if outcome == GUARD:
            met: int | None = self.program.guard_met(raw)
            return met
        if watch is None or self.problem.guards is None or watch.reason is not None:
            return None
        time, state = self.integrator.time, self.integrator.state
        beyond = self._beyond(time, state)
        most = beyond.max(initial=-np.inf)
        # a law that bends where a guard is met, as |i| does where a current ends, may hide it
        if -NEAR < most <= 0.0 and outcome == "cb_stop":
            ahead = NEAR * (self.problem.t_end - self.problem.t0)
            later = self._beyond(time + ahead, state + ahead * self.program.slopes(time, state, self.integrator.pars))
            beyond = np.where((beyond > -NEAR) & (later > beyond), later, -np.inf)
        return int(np.argmax(beyond)) if beyond.max(initial=-np.inf) > 0.0 else None

    def _beyond(self, time: float, state: Array) -> Array:
        """How far the guards that are watched are beyond their limits, in parts of their sizes."""
        values = self.program.guard_values(time, state, self.integrator.pars)
        return np.where(self._sides == 0.0, -np.inf, self._sides * values - self._offsets)

    def _reacts(self, met: int) -> bool:
        """Whether the run goes on past the guard that it has met."""
        if self.problem.react is None:
            return False
        time = self.integrator.time
        reaction = self.problem.react(len(self.reactions), met, time, self._x)
        if reaction is None:
            return False
        self.reactions.append((time, reaction.equations))
        self._p[: reaction.p.size] = reaction.p
        if reaction.x is not None:
            self._x[: reaction.x.size] = reaction.x
        self._begun = time, self._x.copy()
        self._guard(reaction.ends, reaction.offsets)
        self.program.weigh(self.integrator)
        return True

    def _first_step(self, piece: SmoothInterval) -> float:
        """Longest first step in s, infinite where heyoka's own choice is good.

        heyoka takes its step from the last two terms of the series. Where a motion starts as a polynomial, as that of
        J w' = 1 - w^5 from rest does, these are zero although later ones are not, and the step would have no end.
        """
        integrator, longest = self.integrator, math.inf
        start, state, parameters = integrator.time, integrator.state.copy(), integrator.pars.copy()
        for _ in range(FIRST_TRIALS):
            integrator.step(max_delta_t=min(longest, piece.end - piece.start), write_tc=True)
            step = integrator.time - start
            good = not (step > 0.0 and np.isfinite(integrator.state).all()) or (
                self._satisfied(piece, start, INSIDE[-1] * step)
                and keeps_sides(self.program, integrator, parameters, start)
            )
            integrator.time = start
            integrator.state[:], integrator.pars[:] = state, parameters
            integrator.reset_cooldowns() if integrator.with_events else None
            if good:
                break
            longest = SHORTER * step
        return longest

    def _satisfied(self, piece: SmoothInterval, start: float, elapsed: float) -> bool:
        """Whether the series of the last step satisfies the equations at a time inside it."""
        return satisfied(self.problem, self.problem.rhs, piece, self.integrator.tc, start, elapsed, 0.0)

    def verify(self, piece: SmoothInterval, segments: Sequence[Any]) -> None:
        """Refuse series that have passed a root or a pole of a law, and gone on otherwise than the law.

        Raises:
            SeriesError: says where.
        """
        if not segments:
            return
        # near a root of zero slope a series is poor in steps so short that it moves nothing
        sizes = np.max([np.abs(segment.tcs[:, :, 0]).max(axis=0) for segment in segments], axis=0)
        changes, rhs, past = [time for time, _ in self.reactions], self.problem.rhs, 0
        for segment in segments:
            for (start, end), terms in zip(pairwise(segment.times), segment.tcs, strict=True):
                if (now := bisect_right(changes, start)) > past:
                    rhs, past = self.reactions[now - 1][1](), now
                for part in INSIDE:
                    if not satisfied(self.problem, rhs, piece, terms, start, part * (end - start), sizes):
                        reason = f"up to t = {end:.9g} s a law has a root or a pole that a Taylor series does not show"
                        made = failure(self.problem, "heyoka", start, terms[:, 0], reason)
                        raise SeriesError(str(made), reason)

    def _watch(self, piece: SmoothInterval) -> SwitchWatch | None:
        """Set the signs of the switches; what has to look after them, where the motion may change them."""
        program = self.program
        if not program.switches:
            return None
        self.integrator.pars[program.signs] = 0.0
        settle(program, self.integrator, piece.end - piece.start)
        if np.isnan(self.integrator.pars[program.signs]).any():
            raise self._failure(piece, "err_nf_state", None)
        if program.all_timed:
            return None
        integrator = self.integrator
        size = np.abs(program.switch_values(integrator.time, integrator.state, integrator.pars))
        return SwitchWatch(program, piece.start, self.problem.t_end - self.problem.t0, size)

    def _failure(self, piece: SmoothInterval, outcome: str, watch: SwitchWatch | None) -> SimulationError:
        time, state = self._last_good(piece, watch)
        made = failure(self.problem, "heyoka", time, state, self._reason(outcome, watch))
        if watch is not None and watch.reason is not None:
            return StickingError(str(made), watch.reason.partition(", because")[0], held=watch.held)
        found = f"after t = {time:.9g} s a law, or one of its derivatives, is not finite, as a root's at zero"
        return SeriesError(str(made), found) if outcome == "err_nf_state" else made

    def _last_good(self, piece: SmoothInterval, watch: SwitchWatch | None) -> tuple[float, Array]:
        """Time and state at the end of the last good step of a run that has failed in a piece."""
        integrator = self.integrator
        if watch is not None:
            return watch.last_good or (piece.start, self.start)
        if np.isfinite(integrator.time) and np.isfinite(integrator.state).all():
            return integrator.time, integrator.state.copy()
        integrator.time, integrator.state[:] = good = self._begun or (piece.start, self.start)
        while integrator.step(max_delta_t=piece.end - integrator.time)[0].name == "success":
            good = integrator.time, integrator.state.copy()
        return good

    def _reason(self, outcome: str, watch: SwitchWatch | None) -> str:
        if outcome == "step_limit":
            used = self.steps >= self.problem.max_steps
            return used_up(self.problem) if used else "its steps are shorter than the spacing of numbers at this time"
        if outcome == "err_nf_state":
            return "the state or its derivative is not finite"
        if watch is not None and watch.reason is not None:
            return watch.reason
        return f"heyoka stopped with the outcome {outcome!r}"


def _on_grid(problem: Problem, times: Array) -> Trajectory:
    with problem.program.program.lent(_tolerance(problem)) as lent:
        return _filled(_TaylorRun(problem, lent), times)


def _filled(run: _TaylorRun, times: Array) -> Trajectory:
    problem, stops = run.problem, list[float]()
    states = np.empty((times.size, run.state.size))
    done, chunk = 0, times.size + 1 if problem.guards is None else CHUNK
    for piece in pieces(problem):
        # An output at a breakpoint belongs to the next piece: it is the state after the jump.
        stop = times.size if piece.end == problem.t_end else int(np.searchsorted(times, piece.end, side="left"))
        recorder = GridRecorder(problem, states[done:stop], times[done:stop], piece.end, chunk, stops)
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
    def _made(self) -> tuple[tuple[tuple[Any, ...], ...], int | None]:
        problem, recorders = self._problem, list[SegmentRecorder]()
        with problem.program.program.lent(_tolerance(problem)) as lent:
            run = _TaylorRun(problem, lent)
            for piece in pieces(problem):
                recorders.append(SegmentRecorder(problem, piece.end, [s for s in self._stops if s < piece.end]))
                run.piece(piece, recorders[-1])
                if run.program.singular:
                    run.verify(piece, recorders[-1].segments)
                if run.met is not None:
                    break
            if self._end is not None and abs(run.integrator.time - self._end) > ALIKE * (problem.t_end - problem.t0):
                reason = f"the same run made again for its dense output ends there, not at t = {self._end:.9g} s"
                raise failure(problem, "heyoka", run.integrator.time, run.state, reason)
        return tuple(tuple(recorder.segments) for recorder in recorders), run.met

    @property
    def _segments(self) -> tuple[tuple[Any, ...], ...]:
        return self._made[0]

    @property
    def met(self) -> int | None:
        """The guard that ended the run."""
        return self._made[1]

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
