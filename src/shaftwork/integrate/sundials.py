"""The engine for stiff systems and for implicit equations: CVODE and IDA of SUNDIALS."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from shaftwork.core.calls import unprinted
from shaftwork.core.errors import MissingExtraError
from shaftwork.integrate.crossings import Crossings
from shaftwork.integrate.guards import LEAST, SHORTER, GuardWatch, share_of_tolerance
from shaftwork.integrate.problem import Array, DaeProblem, Problem, Trajectory, tightened
from shaftwork.integrate.smooth_intervals import (
    Pace,
    PiecewiseDense,
    SmoothInterval,
    both_sides,
    check_finite,
    failure,
    pieces,
    start_of_piece,
    used_up,
)
from shaftwork.integrate.sundials_solvers import (
    DEGREES,
    JacobianPattern,
    Method,
    OpenedSolver,
    StepInside,
    open_cvode,
    open_ida,
)
from shaftwork.numerics.polynomials import Interpolant, interpolation_times

# A run up to a guard is made again where this part of its tolerance would not do, and where it is not as tight already:
# absolute tolerances of small twists may be that tight.
ENOUGH, TIGHTEST_ATOL = 0.5, 1e-17
# Of a run with output times so many numbers at the ends of its steps are kept.
MOST_KEPT = 1_000_000


Opener = Callable[[SmoothInterval, Array], OpenedSolver]
Opening = Callable[[float], Opener]
"""From the part of its tolerance with which a problem is solved."""


def solve(problem: Problem, method: Method = "BDF") -> Trajectory:
    """Integrate with CVODE.

    Dense output is made by a second, identical run when it is first asked for.

    Args:
        problem: what to solve.
        method: "BDF" for stiff systems, "Adams" for smooth motion that is not.

    Raises:
        MissingExtraError: scikit-sundae is not installed.
        SimulationError: SUNDIALS gave up, with its reason.

    Source: Hindmarsh and others, SUNDIALS: suite of nonlinear and differential/algebraic equation solvers, 2005.
    """
    _require("engine='sundials'")

    def opening(share: float) -> Opener:
        tight, pattern = tightened(problem, share), JacobianPattern(len(problem.x0))
        return lambda piece, x: open_cvode(tight, piece, x, method, pattern)

    return _trajectory(problem, opening, DEGREES[method])


def solve_dae(problem: DaeProblem) -> Trajectory:
    """Integrate an implicit problem with IDA, from consistent initial values that IDA finds at every piece's start.

    Raises:
        MissingExtraError: scikit-sundae is not installed.
        SimulationError: SUNDIALS gave up, with its reason.

    Source: as `solve`.
    """
    _require("A nonlinear algebraic loop")

    def opening(share: float) -> Opener:
        tight = tightened(problem, share)
        return lambda piece, x: open_ida(tight, piece, x)

    return _trajectory(problem, opening, DEGREES["BDF"])


def _require(purpose: str) -> None:
    if importlib.util.find_spec("sksundae") is None:
        raise MissingExtraError("scikit-sundae", "stiff", purpose)


@dataclass(frozen=True)
class _CvodeStep:
    """One step: its ends in s, the state (n,) at its end, the states (k, n) at the times asked for inside it."""

    start: float
    end: float
    state: Array
    inside: Array


@dataclass(frozen=True)
class _MarchedPiece:
    """The steps of one smooth piece, and the state (n,) with which it starts."""

    start: Array
    steps: list[_CvodeStep]

    @property
    def times(self) -> Array:
        """(s + 1,) ends of the steps, s."""
        return np.array([self.steps[0].start, *(step.end for step in self.steps)])

    @property
    def states(self) -> Array:
        """(s + 1, n) states there."""
        return np.vstack([self.start, *(step.state for step in self.steps)])


InnerTimes = Callable[[float, float], Array]
"""The times (k,) wanted in a step, from its start and end in s."""
Marched = tuple[list[_MarchedPiece], int | None]
"""All pieces, and the guard that ended the run."""


def _march(problem: Problem | DaeProblem, opening: Opening, inner: InnerTimes) -> Marched:
    """All steps up to a guard; where they are few, they are made again with the tolerance that its course needs.

    Rebounds become ever shorter. After each a method starts with low order, and errs by its tolerance however short
    the flight is: with flights as small as the tolerance a series of rebounds would end early.
    """
    share = 1.0
    while True:
        tight = tightened(problem, share)
        marched, met = _attempt(tight, opening(share), inner)
        if met is None or tight.rtol <= TIGHTEST_ATOL:
            return marched, met
        first, *others = marched
        times = np.concatenate([first.times, *(piece.times[1:] for piece in others)])
        states = np.concatenate([first.states, *(piece.states[1:] for piece in others)])
        if (part := share_of_tolerance(tight, times, states)) > ENOUGH:
            return marched, met
        share = max(part * share, TIGHTEST_ATOL / problem.rtol)


def _attempt(problem: Problem | DaeProblem, open_solver: Opener, inner: InnerTimes) -> Marched:
    x = np.asarray(problem.x0, dtype=float)
    marched: list[_MarchedPiece] = []
    left, pace = problem.max_steps, Pace(problem)
    for piece in pieces(problem):
        opened, crossings = open_solver(piece, start_of_piece(problem, piece, x)), Crossings(problem, piece)
        watch = GuardWatch(problem, piece.low, piece.high)
        x, t, longest = opened.start, piece.start, np.inf
        marched.append(_MarchedPiece(x, []))
        while t < piece.end:
            if left <= 0:
                raise failure(problem, "sundials", t, x, used_up(problem))
            end, state = _step(problem, piece, opened, t, x, longest)
            # Its formulas meet a law at the ends of steps alone, so that a step may be cut off at a switch.
            inside = StepInside(opened, t, x, end, state)
            stop = watch.cut(t, x, end, state, inside)
            cut = crossings.cut(t, x, end, state, inside, again=False)
            stops = stop is not None and (cut is None or stop <= cut)
            shortest = LEAST * (problem.t_end - problem.t0)
            if stop is not None and stops and end - t > shortest and not watch.follows(t, x, stop, inside):
                longest, left = (end - t) / SHORTER, left - 1
                opened = open_solver(replace(piece, start=t), x)
                x = opened.start
                continue
            whole, end = end, stop if stop is not None and stops else end if cut is None else cut
            x = state if end == whole else opened.inside(np.array([end]))[0]
            if (objection := pace.objection(end, rests=crossings.rests)) is not None:
                raise failure(problem, "sundials", end, x, objection)
            times = inner(t, end)
            within = times[times < end]
            states = np.repeat(x[None, :], times.size, axis=0)
            if within.size:
                states[: within.size] = inside(within)
            marched[-1].steps.append(_CvodeStep(t, end, x, states))
            t, left = end, left - 1
            if stops and t < piece.end:
                return marched, watch.met
            if t < piece.end and (cut is not None or opened.outgrown()):
                opened = open_solver(replace(piece, start=t), x)
                x = opened.start
            elif within.size or problem.switches is not None or problem.guards is not None:
                opened.solver.step(end)  # after an interpolation SUNDIALS gives the end of the step once more
    return marched, None


def _step(
    problem: Problem | DaeProblem, piece: SmoothInterval, opened: OpenedSolver, t: float, x: Array, longest: float
) -> tuple[float, Array]:
    """End in s and state (n,) there of the next step from a time and state, which is `longest` s long at most."""
    stop = min(piece.end, t + longest)
    # SUNDIALS prints what its result says as well.
    with np.errstate(all="ignore"), unprinted():
        result = opened.solver.step(stop, method="onestep", tstop=stop)
    if not result.success:
        raise failure(problem, "sundials", t, x, str(result.message), opened.guard)
    end, state = float(result.t), result.y.copy()
    check_finite(problem, "sundials", end, state)
    if end <= t:
        raise failure(problem, "sundials", t, x, "the step became too small", opened.guard)
    return end, state


def _trajectory(problem: Problem | DaeProblem, opening: Opening, degree: int) -> Trajectory:
    dense = _CvodeReplay(problem, opening, degree)
    if problem.t_eval is None:
        t, states = both_sides(problem, *_step_ends(dense.marched[0]))
        end = float(t[-1]), states[-1]
        return Trajectory(t, states, dense, {"steps": dense.steps.size - 1}, met=dense.marched[1], end=end)
    times = np.asarray(problem.t_eval, dtype=float)
    rows: list[Array] = []
    jumps = frozenset(problem.breakpoints)  # only asked for membership

    def inner(start: float, end: float) -> Array:
        # An output at the end of a step is read there, except at a breakpoint: the next piece starts with it.
        side: Literal["left", "right"] = "left" if end in jumps else "right"
        return times[np.searchsorted(times, start, side="right") : np.searchsorted(times, end, side=side)]

    marched, met = _march(problem, opening, inner)
    steps = sum(len(piece.steps) for piece in marched)
    if steps * problem.x0.size <= MOST_KEPT:
        dense.ends = tuple(map(np.concatenate, _step_ends(marched)))
    for piece in marched:
        if piece.steps[0].start in times:
            rows.append(piece.start[None, :])
        rows.extend(step.inside for step in piece.steps)
    last = marched[-1].steps[-1]
    states = np.concatenate([np.empty((0, last.state.size)), *rows])
    return Trajectory(times[: len(states)], states, dense, {"steps": steps}, met=met, end=(last.end, last.state))


class _CvodeReplay:
    """Dense output that runs the problem again when it is first asked, and keeps each step's own polynomial."""

    def __init__(self, problem: Problem | DaeProblem, opening: Opening, degree: int) -> None:
        self._problem = problem
        self._opening = opening
        self._degree = degree
        self.ends: tuple[Array, ...] = ()
        """Times and states at the step ends of an earlier run: who asks for these alone needs no further one."""

    @cached_property
    def marched(self) -> Marched:
        """Its pieces, and the guard that ended it."""
        return _march(self._problem, self._opening, self._inner)

    def _inner(self, start: float, end: float) -> Array:
        return interpolation_times(start, end, self._degree)[1:-1]

    @cached_property
    def _dense(self) -> PiecewiseDense:
        parts = [
            Interpolant(step.start, step.end, np.vstack([before, step.inside, step.state]))
            for piece in self.marched[0]
            for before, step in zip(piece.states, piece.steps, strict=False)
        ]
        starts = np.array([part.start for part in parts])
        return PiecewiseDense(starts, tuple(parts), np.append(starts, parts[-1].end), self._problem.x0.size)

    @property
    def steps(self) -> Array:
        return np.unique(self.ends[0]) if self.ends else self._dense.steps

    def __call__(self, times: Array) -> Array:
        if self.ends:
            last = np.searchsorted(self.ends[0], times, side="right") - 1  # after the jump, where there are two
            if np.array_equal(self.ends[0][last], times):
                return self.ends[1][last]
        return self._dense(times)


def _step_ends(marched: list[_MarchedPiece]) -> tuple[list[Array], list[Array]]:
    """Times and states at the step ends of each piece."""
    return [piece.times for piece in marched], [piece.states for piece in marched]
