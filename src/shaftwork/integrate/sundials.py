"""The engine for stiff systems and for implicit equations: CVODE and IDA of SUNDIALS."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice, pairwise
from typing import Literal

import numpy as np

from shaftwork.core.calls import unprinted
from shaftwork.integrate.guards import share_of_tolerance
from shaftwork.integrate.problem import Array, DaeProblem, Problem, Trajectory, tightened
from shaftwork.integrate.smooth_intervals import PiecewiseDense, SmoothInterval, check_finite, failure
from shaftwork.integrate.stepping import Step, SteppedRun, march
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
        SimulationError: SUNDIALS gave up, with its reason.

    Source: Hindmarsh and others, SUNDIALS: suite of nonlinear and differential/algebraic equation solvers, 2005.
    """

    def opening(share: float) -> Opener:
        tight, pattern = tightened(problem, share), JacobianPattern(len(problem.x0))
        return lambda piece, x: open_cvode(tight, piece, x, method, pattern)

    return _trajectory(problem, opening, DEGREES[method])


def solve_dae(problem: DaeProblem) -> Trajectory:
    """Integrate an implicit problem with IDA, from consistent initial values that IDA finds at every piece's start.

    Raises:
        SimulationError: SUNDIALS gave up, with its reason.

    Source: as `solve`.
    """

    def opening(share: float) -> Opener:
        tight = tightened(problem, share)
        return lambda piece, x: open_ida(tight, piece, x)

    return _trajectory(problem, opening, DEGREES["BDF"])


InnerTimes = Callable[[float, float], Array]
"""The times (k,) wanted in a step after its start, from its start and end in s."""


@dataclass(frozen=True)
class _Marched:
    """A run: its steps, and of each the states (k, n) that were wanted in it."""

    march: SteppedRun
    inside: list[Array]


def _run(problem: Problem | DaeProblem, opening: Opening, inner: InnerTimes, tightest: float = 1e-17) -> _Marched:
    """All steps up to a guard; where they are few, they are made again with the tolerance that its course needs.

    Rebounds become ever shorter. After each a method starts with low order, and errs by its tolerance however short
    the flight is: with flights as small as the tolerance a series of rebounds would end early.

    Args:
        problem: what to solve.
        opening: of its solvers.
        inner: the times wanted in each step.
        tightest: no tolerance is made tighter; absolute ones of small twists may be that tight.
    """
    share = 1.0
    while True:
        tight = tightened(problem, share)
        stepper = _SundialsStepper(tight, opening(share), inner)
        marched = _Marched(march(tight, stepper), stepper.inside)
        if marched.march.met is None or tight.rtol <= tightest:
            return marched
        if (part := share_of_tolerance(tight, marched.march.steps, marched.march.states)) > 0.5:
            return marched
        share = max(part * share, tightest / problem.rtol)


class _SundialsStepper:
    """CVODE or IDA.

    Args:
        problem: what is being solved.
        opener: makes the solver at the start of a piece.
        inner: the times wanted in each step.
    """

    engine = "sundials"
    cuts_off = True  # its formulas meet a law at the ends of steps alone

    def __init__(self, problem: Problem | DaeProblem, opener: Opener, inner: InnerTimes) -> None:
        self._problem, self._opener, self._inner = problem, opener, inner
        self.inside: list[Array] = []

    def open(self, piece: SmoothInterval, t: float, x: Array) -> Array:
        if t == piece.start:
            self._piece, self._longest = piece, np.inf
        self._opened, self._read = self._opener(replace(self._piece, start=t), x), False
        return self._opened.start

    def step(self, t: float, x: Array) -> Step:
        if self._opened.outgrown():
            self.open(self._piece, t, x)
        if self._read:
            self._opened.solver.step(t)  # after an interpolation SUNDIALS gives the end of the step once more
            self._read = False
        stop = min(self._piece.end, t + self._longest)
        with unprinted():  # SUNDIALS prints what its result says as well
            result = self._opened.solver.step(stop, method="onestep", tstop=stop)
        if not result.success:
            raise failure(self._problem, "sundials", t, x, str(result.message), self._opened.guard)
        end, state = float(result.t), result.y.copy()
        check_finite(self._problem, "sundials", end, state)
        if end <= t:
            raise failure(self._problem, "sundials", t, x, "the step became too small", self._opened.guard)
        self._dense = StepInside(self._opened, t, x, end, state)
        return Step(end, state, self._states)

    def _states(self, times: Array) -> Array:
        self._read = True
        return self._dense(times)

    def again(self, t: float, x: Array, end: float, longest: float) -> None:  # noqa: ARG002 (it is cut off at switches)
        self.open(self._piece, t, x)
        self._longest = longest

    def take(self, t: float, end: float, state: Array) -> None:
        times = self._inner(t, end)
        within = times[times < end]
        states = np.repeat(state[None, :], times.size, axis=0)
        if within.size:
            states[: within.size] = self._states(within)
        self.inside.append(states)


def _trajectory(problem: Problem | DaeProblem, opening: Opening, degree: int) -> Trajectory:
    dense = _CvodeReplay(problem, opening, degree)
    if problem.t_eval is None:
        whole = dense.marched.march
        t, states = whole.both_sides(problem)
        return Trajectory(t, states, dense, {"steps": dense.steps.size - 1}, met=whole.met, end=whole.end)
    times = np.asarray(problem.t_eval, dtype=float)
    jumps = frozenset(problem.breakpoints)  # only asked for membership

    def inner(start: float, end: float) -> Array:
        # An output at the end of a step is read there, except at a breakpoint: the next piece starts with it.
        side: Literal["left", "right"] = "left" if end in jumps else "right"
        return times[np.searchsorted(times, start, side="right") : np.searchsorted(times, end, side=side)]

    marched = _run(problem, opening, inner)
    whole, inside = marched.march, iter(marched.inside)
    steps = sum(len(piece.times) - 1 for piece in whole.pieces)
    if steps * problem.x0.size <= 1_000_000:  # more numbers than these are not kept
        dense.ends = whole.both_sides(problem)
    rows = [np.empty((0, whole.end[1].size))]
    for piece in whole.pieces:
        if piece.times[0] in times:
            rows.append(piece.states[0][None, :])
        rows.extend(islice(inside, len(piece.times) - 1))
    states = np.concatenate(rows)
    return Trajectory(times[: len(states)], states, dense, {"steps": steps}, met=whole.met, end=whole.end)


class _CvodeReplay:
    """Dense output that runs the problem again when it is first asked, and keeps each step's own polynomial."""

    def __init__(self, problem: Problem | DaeProblem, opening: Opening, degree: int) -> None:
        self._problem, self._opening, self._degree = problem, opening, degree
        self.ends: tuple[Array, ...] = ()
        """Times and states at the step ends of an earlier run: who asks for these alone needs no further one."""

    @cached_property
    def marched(self) -> _Marched:
        """The run, with the inner nodes of the polynomial of each step."""
        return _run(self._problem, self._opening, self._inner)

    def _inner(self, start: float, end: float) -> Array:
        return interpolation_times(start, end, self._degree)[1:-1]

    @cached_property
    def _dense(self) -> PiecewiseDense:
        inside = iter(self.marched.inside)
        parts = [
            Interpolant(*span, np.vstack([before, next(inside), after]))
            for piece in self.marched.march.pieces
            for span, (before, after) in zip(pairwise(piece.times), pairwise(piece.states), strict=True)
        ]
        steps = self.marched.march.steps
        return PiecewiseDense(steps[:-1], tuple(parts), steps, self._problem.x0.size)

    @property
    def steps(self) -> Array:
        return np.unique(self.ends[0]) if self.ends else self._dense.steps

    def __call__(self, times: Array) -> Array:
        if self.ends:
            last = np.searchsorted(self.ends[0], times, side="right") - 1  # after the jump, where there are two
            if np.array_equal(self.ends[0][last], times):
                return self.ends[1][last]
        return self._dense(times)
