"""The loop of steps that scipy, SUNDIALS and the banded engine share: pieces, guards, switches and limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from shaftwork.integrate.crossings import Crossings, Dense
from shaftwork.integrate.guards import GuardWatch
from shaftwork.integrate.problem import Array, DaeProblem, DenseOutput, Problem, TimedProblem, Trajectory
from shaftwork.integrate.smooth_intervals import (
    PiecewiseDense,
    SmoothInterval,
    both_sides,
    failure,
    pieces,
    reached,
    start_of_piece,
    used_up,
)


class Step(NamedTuple):
    """A step that a method has made.

    Args:
        end: s.
        state: (n,) there.
        dense: times (k,) inside the step to states (k, n), until the next step is made.
        before: steps that were made first, in which nothing is met: their ends (k,) in s and the states (k, n) there.
        clear: whether nothing is met in this one either.
        met: the time in s at which it meets its first guard, and this guard, where the method knows.
        rests: whether the motion rests at a switch, where the method passes switches by itself.
    """

    end: float
    state: Array
    dense: Dense
    before: tuple[Array, Array] | None = None
    clear: bool = False
    met: tuple[float, int] | None = None
    rests: bool = False


class Stepper(Protocol):
    """A method as the loop uses it: what it makes is looked at by `march`, and then taken or made again.

    Its right-hand side and Jacobian are those of `smooth_intervals.GuardedFunctions`, which asks nothing outside the
    piece and remembers what was not finite, and `smooth_intervals.failure` makes its errors.
    """

    engine: str
    """Its name in messages."""
    cuts_off: bool
    """Whether a step may be cut off at a switch of a law, as no stage of it lies beyond; else it is made again."""

    def open(self, piece: SmoothInterval, t: float, x: Array) -> Array:
        """Begin anew in a state (n,): at the start of a piece, or at a time in s inside it, just past a switch.

        Returns:
            The state (n,) with which it begins, that of the argument unless equations bind the states.
        """
        ...

    def step(self, t: float, x: Array) -> Step | None:
        """Make a step from a time in s and a state (n,), up to the end of the piece at most.

        Returns:
            The step; None where its error was too large, and a shorter one is to follow.

        Raises:
            SimulationError: it cannot, or a value is not finite.
        """
        ...

    def again(self, t: float, x: Array, end: float, longest: float) -> None:
        """Forget the last step; the next ones start there once more, and none ends beyond a switch.

        Called before a switch and after a guard. Each call replaces what the one before has set.

        Args:
            t: where it started, s.
            x: (n,) state there.
            end: up to which they go at most, s; from there on the piece goes on to its own end.
            longest: a step at most up to `end`, s.
        """
        ...

    def take(self, t: float, end: float, state: Array) -> None:
        """Keep the last step: dense output is asked for later.

        Args:
            t: where it started, s.
            end: its own end in s, or one before it where a guard or a switch cuts it off.
            state: (n,) there.
        """
        ...


@dataclass(frozen=True)
class SteppedPiece:
    """The steps of one smooth piece.

    Args:
        times: (s + 1,) their ends, s.
        states: (s + 1, n) then.
    """

    times: list[float]
    states: list[Array]

    def extended(self, ends: Array, states: Array) -> tuple[float, Array]:
        """Add steps by their ends (k,) in s and the states (k, n) there; the last of these."""
        self.times.extend(ends.tolist())
        self.states.extend(states)
        return self.times[-1], self.states[-1]


class SteppedRun(NamedTuple):
    """All steps of a run.

    Args:
        pieces: in order.
        met: the guard that ended it, or None.
    """

    pieces: Sequence[SteppedPiece]
    met: int | None

    @property
    def end(self) -> tuple[float, Array]:
        """Time in s and state (n,) where it ended."""
        last = self.pieces[-1]
        return last.times[-1], last.states[-1]

    @property
    def steps(self) -> Array:
        """(s,) every time at which a step ended, the start first."""
        first, *others = self.pieces
        return np.array([*first.times, *(time for piece in others for time in piece.times[1:])])

    @property
    def states(self) -> Array:
        """(s, n) states then, before any jump."""
        first, *others = self.pieces
        return np.array([*first.states, *(state for piece in others for state in piece.states[1:])])

    def both_sides(self, problem: TimedProblem) -> tuple[Array, Array]:
        """Times (k,) and states (k, n) at the ends of the steps, on both sides of jumps."""
        times = [np.array(piece.times) for piece in self.pieces]
        return both_sides(problem, times, [np.array(piece.states) for piece in self.pieces])


@np.errstate(all="ignore")
def march(problem: Problem | DaeProblem, stepper: Stepper) -> SteppedRun:
    """Step through all pieces of a problem, up to the first guard that is met.

    Raises:
        SimulationError: the method failed, the run has stalled, or `max_steps` were not enough.
    """
    x, pace, done = np.asarray(problem.x0, dtype=float), Pace(problem), list[SteppedPiece]()
    left, shortest = problem.max_steps, 1e-9 * (problem.t_end - problem.t0)
    for piece in pieces(problem):
        watch, crossings = GuardWatch(problem, piece.low, piece.high), Crossings(problem, piece)
        t, x = piece.start, stepper.open(piece, piece.start, start_of_piece(problem, piece, x))
        done.append(SteppedPiece([t], [x]))
        while t < piece.end:
            if left <= 0:
                raise failure(problem, stepper.engine, t, x, used_up(problem))
            left -= 1
            step = stepper.step(t, x)
            if step is None:
                continue
            if step.before is not None:
                left -= step.before[0].size
                t, x = done[-1].extended(*step.before)
                pace.passed(step.before[0].size)
            looks = t, x, step.end, step.state, step.dense
            guard = None if step.clear else watch.cut(*looks, met=step.met)
            switch = None if step.clear else crossings.cut(*looks, again=not stepper.cuts_off)
            if guard is not None and (switch is None or guard <= switch):
                if step.end - t > shortest and not watch.follows(t, x, guard, step.dense):
                    stepper.again(t, x, piece.end, (step.end - t) / 8)
                    continue
                end, switch = guard, None
            else:
                guard, end = None, step.end if switch is None else switch
                if end < step.end and not stepper.cuts_off:
                    stepper.again(t, x, end, np.inf)
                    continue
            state = step.state if end == step.end else step.dense(np.array([end]))[0]
            stepper.take(t, end, state)
            if (objection := pace.objection(end, rests=crossings.rests or step.rests)) is not None:
                raise failure(problem, stepper.engine, end, state, objection)
            done[-1].times.append(end)
            done[-1].states.append(state)
            t, x = end, state
            if guard is not None and t < piece.end:
                return SteppedRun(done, watch.met)
            if switch is not None and t < piece.end:
                x = stepper.open(piece, t, x)
    return SteppedRun(done, None)


def trajectory(
    problem: Problem, run: SteppedRun, parts: Sequence[Dense], statistics: Mapping[str, int] | None = None
) -> Trajectory:
    """What an engine returns of a run whose steps have dense output that lasts.

    Args:
        problem: what was solved.
        run: from `march`.
        parts: dense output of each step that was taken, in order.
        statistics: counts by name beside that of the steps.
    """
    dense = PiecewiseDense(run.steps[:-1], tuple(parts), run.steps, problem.x0.size)
    return with_outputs(problem, run, dense, statistics)


def with_outputs(
    problem: Problem, run: SteppedRun, dense: DenseOutput, statistics: Mapping[str, int] | None = None
) -> Trajectory:
    """The same where dense output of the whole run is one; arguments as for `trajectory`."""
    if problem.t_eval is None:
        t, x = run.both_sides(problem)
    else:
        t = reached(problem.t_eval, run.end[0])
        x = dense(t)
    counts = {"steps": dense.steps.size - 1, **(statistics or {})}
    return Trajectory(t, x, dense, counts, met=run.met, end=run.end)


class Pace:
    """Tells a run that goes on, in ever shorter steps, from one that has stalled; and whoever asks, how far it is.

    Args:
        problem: what is being solved.
        every: after so many steps it is looked whether the run has stalled.
        least: a run has where these steps were on average shorter than this part of the whole time.
    """

    def __init__(self, problem: TimedProblem, *, every: int = 2000, least: float = 1e-10) -> None:
        self._every, self._least = every, least
        self._progress, self._duration = problem.progress, problem.t_end - problem.t0
        self._since, self._steps = problem.t0, 0

    def passed(self, steps: int) -> None:
        """Count steps that were made before one that is looked at."""
        self._steps += steps

    def objection(self, t: float, *, rests: bool = False) -> str | None:
        """After each step to a time t in s: the reason to give up, or None.

        Args:
            t: end of the step, s.
            rests: whether the motion rests at a switch of a law.
        """
        if self._progress is not None:
            self._progress(t)
        self._steps += 1
        if self._steps < self._every:
            return None
        advance, self._since = (t - self._since) * self._every / self._steps, t
        self._steps = 0
        # Where it rests, ten million such steps would make a run. Where a law is as the square root of the speed, such
        # a run would not end otherwise.
        if advance >= self._every * (1e-7 if rests else self._least) * self._duration:
            return None
        return (
            f"the last {self._every} steps advanced by {advance:.2g} s only, as where the laws on both sides of a jump "
            "drive the motion back to it. Give such a law a smooth transition, tanh(omega / 0.01) in place of "
            "sign(omega)"
        )
