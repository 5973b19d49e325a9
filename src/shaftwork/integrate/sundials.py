"""The engine for stiff systems and for implicit equations: CVODE and IDA of SUNDIALS."""

from __future__ import annotations

import importlib.util
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from shaftwork.core.calls import unprinted
from shaftwork.core.errors import MissingExtraError
from shaftwork.core.notices import FILTERS
from shaftwork.integrate.chebyshev import Polynomial, points
from shaftwork.integrate.crossings import Crossings
from shaftwork.integrate.engines import ENGINES
from shaftwork.integrate.guards import CLEARANCE, LEAST, SHORTER, GuardWatch, share_of_tolerance
from shaftwork.integrate.pieces import (
    GuardedFunctions,
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
from shaftwork.integrate.problem import Array, DaeProblem, Problem, Trajectory, tightened
from shaftwork.integrate.sparsity import Pattern

Method = Literal["BDF", "Adams"]

# SUNDIALS interpolates inside a step by a polynomial of at most this degree.
DEGREES = {"BDF": 5, "Adams": 12}
# Up to here a dense factorisation beats SuperLU. A band solver is not used: the binding passes its Jacobian as a full
# matrix, which costs more than the factorisation saves.
LARGEST_DENSE = 100
# A run up to a guard is made again where this part of its tolerance would not do, and where it is not as tight already:
# absolute tolerances of small twists may be that tight.
ENOUGH, TIGHTEST_ATOL = 0.5, 1e-17
# Of a run with output times so many numbers at the ends of its steps are kept.
MOST_KEPT = 1_000_000
FINEST = ENGINES["sundials"].finest


@dataclass(frozen=True)
class _Opened:
    """A SUNDIALS solver at the start of a piece.

    Args:
        solver: CVODE or IDA, with its first step still to take.
        start: (n,) consistent start state.
        guard: what CVODE calls.
        outgrown: whether the solver must be opened anew, because its pattern misses entries of the Jacobian.
        degree: of its polynomials inside a step, at most.
    """

    solver: Any
    start: Array
    guard: GuardedFunctions | None = None
    outgrown: Callable[[], bool] = lambda: False
    degree: int = DEGREES["BDF"]

    def inside(self, times: Array) -> Array:
        """States (k, n) at times (k,) inside the last step."""
        return np.array([self.solver.step(time).y.copy() for time in times]).reshape(times.size, self.start.size)


class _Inside:
    """The states inside the last step: for many times from a polynomial, as each costs a call of SUNDIALS.

    Args:
        opened: the solver.
        start: of the step, s.
        x: (n,) state there.
        end: of the step, s.
        y: (n,) state there.
    """

    def __init__(self, opened: _Opened, start: float, x: Array, end: float, y: Array) -> None:
        self._opened, self._ends, self._states = opened, (start, end), (x, y)
        self._made: Polynomial | None = None

    def __call__(self, times: Array) -> Array:
        if self._made is None:
            if times.size < self._opened.degree - 1:
                return self._opened.inside(times)
            (start, end), (x, y) = self._ends, self._states
            inner = self._opened.inside(start + (end - start) * points(self._opened.degree)[1:-1])
            self._made = Polynomial(start, end, np.vstack([x, inner, y]))
        return self._made(times)


Opener = Callable[[SmoothInterval, Array], _Opened]
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
        tight, pattern = tightened(problem, share), Pattern(len(problem.x0))
        return lambda piece, x: _open_cvode(tight, piece, x, method, pattern)

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
        return lambda piece, x: _open_ida(tight, piece, x)

    return _trajectory(problem, opening, DEGREES["BDF"])


def _require(purpose: str) -> None:
    if importlib.util.find_spec("sksundae") is None:
        raise MissingExtraError("scikit-sundae", "stiff", purpose)


def _open_cvode(problem: Problem, piece: SmoothInterval, x: Array, method: Method, pattern: Pattern) -> _Opened:
    from sksundae.cvode import CVODE

    guard = GuardedFunctions(problem, piece)

    def rhs(t: float, y: Array, derivative: Array) -> None:
        derivative[:] = guard.rhs(t, y)

    options: dict[str, Any] = {"method": method, "rtol": max(problem.rtol, FINEST), "atol": problem.atol}
    if problem.jacobian is not None:
        options |= _linear_solver(guard, piece, x, pattern)
    least = CLEARANCE * float(np.spacing(abs(piece.start)))
    if _first_change(problem, x, guard.rhs(piece.start, x)) < least:
        options["first_step"] = least
    with FILTERS, warnings.catch_warnings():
        # It says that the pattern is only used as a pattern, since the Jacobian is given.
        warnings.filterwarnings("ignore", message="Custom sparse Jacobian")
        solver = CVODE(rhs, **options)
    solver.init_step(piece.start, x)
    return _Opened(solver, x, guard, lambda: pattern.grown, DEGREES[method])


def _first_change(problem: Problem, x: Array, rates: Array) -> float:
    """The time in s in which a state (n,) moves by its tolerance or a tenth of itself.

    SUNDIALS takes no longer first step, and the time would stand still where a light wheel at rest is hit.
    """
    with np.errstate(all="ignore"):
        return float(np.min((problem.atol + 0.1 * np.abs(x)) / np.abs(rates), initial=np.inf))


def _linear_solver(guard: GuardedFunctions, piece: SmoothInterval, x: Array, pattern: Pattern) -> dict[str, Any]:
    if x.size <= LARGEST_DENSE:

        def fill_dense(t: float, y: Array, _: Array, full: Array) -> None:
            full[:] = guard.dense_jacobian(t, y)

        return {"linsolver": "dense", "jacfn": fill_dense}
    pattern.add(guard.jacobian(piece.start, x))
    order = pattern.freeze()

    def fill_sparse(t: float, y: Array, _: Array, data: Array) -> None:
        data[:] = pattern.values(guard.jacobian(t, y))

    return {"linsolver": "sparse", "sparsity": order, "jacfn": fill_sparse}


def _open_ida(problem: DaeProblem, piece: SmoothInterval, x: Array) -> _Opened:
    from sksundae.ida import IDA

    def residual(t: float, y: Array, derivative: Array, found: Array) -> None:
        found[:] = problem.residual(piece.inside(t), y, derivative)

    solver = IDA(
        residual,
        rtol=max(problem.rtol, FINEST),
        atol=problem.atol,
        algebraic_idx=list(problem.algebraic),
        calc_initcond="yp0",
        calc_init_dt=1e-3 * (piece.end - piece.start),
    )
    try:
        with unprinted():
            start = solver.init_step(piece.start, x, problem.derivative0)
    except RuntimeError as error:
        reason = f"IDA found no consistent initial values ({error})"
        raise failure(problem, "sundials", piece.start, x, reason) from error
    return _Opened(solver, start.y.copy())


@dataclass(frozen=True)
class _CvodeStep:
    """One step: its ends in s, the state (n,) at its end, the states (k, n) at the times asked for inside it."""

    start: float
    end: float
    state: Array
    inside: Array


Ask = Callable[[float, float], Array]
"""The times (k,) wanted in a step, from its start and end in s."""
Marched = tuple[list[tuple[Array, list[_CvodeStep]]], int | None]
"""All steps of each piece, behind the piece's start state, and the guard that ended the run."""


def _march(problem: Problem | DaeProblem, opening: Opening, ask: Ask) -> Marched:
    """All steps up to a guard; where they are few, they are made again with the tolerance that its course needs.

    Rebounds become ever shorter. After each a method starts with low order, and errs by its tolerance however short
    the flight is: with flights as small as the tolerance a series of rebounds would end early.
    """
    share = 1.0
    while True:
        tight = tightened(problem, share)
        found, met = _attempt(tight, opening(share), ask)
        if met is None or tight.rtol <= TIGHTEST_ATOL:
            return found, met
        steps = [step for _, steps in found for step in steps]
        times = np.array([found[0][1][0].start, *(step.end for step in steps)])
        states = np.vstack([found[0][0], *(step.state for step in steps)])
        if (part := share_of_tolerance(tight, times, states)) > ENOUGH:
            return found, met
        share = max(part * share, TIGHTEST_ATOL / problem.rtol)


def _attempt(problem: Problem | DaeProblem, open_solver: Opener, ask: Ask) -> Marched:
    x = np.asarray(problem.x0, dtype=float)
    found: list[tuple[Array, list[_CvodeStep]]] = []
    left, pace = problem.max_steps, Pace(problem)
    for piece in pieces(problem):
        opened, crossings = open_solver(piece, start_of_piece(problem, piece, x)), Crossings(problem, piece)
        watch = GuardWatch(problem, piece.low, piece.high)
        x, t, longest = opened.start, piece.start, np.inf
        found.append((x, []))
        while t < piece.end:
            if left <= 0:
                raise failure(problem, "sundials", t, x, used_up(problem))
            end, state = _step(problem, piece, opened, t, x, longest)
            # Its formulas meet a law at the ends of steps alone, so that a step may be cut off at a switch.
            inside = _Inside(opened, t, x, end, state)
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
            asked = ask(t, end)
            within = asked[asked < end]
            states = np.repeat(x[None, :], asked.size, axis=0)
            if within.size:
                states[: within.size] = inside(within)
            found[-1][1].append(_CvodeStep(t, end, x, states))
            t, left = end, left - 1
            if stops and t < piece.end:
                return found, watch.met
            if t < piece.end and (cut is not None or opened.outgrown()):
                opened = open_solver(replace(piece, start=t), x)
                x = opened.start
            elif within.size or problem.switches is not None or problem.guards is not None:
                opened.solver.step(end)  # after an interpolation SUNDIALS gives the end of the step once more
    return found, None


def _step(
    problem: Problem | DaeProblem, piece: SmoothInterval, opened: _Opened, t: float, x: Array, longest: float
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
        t, states = both_sides(problem, *dense.step_ends)
        end = float(t[-1]), states[-1]
        return Trajectory(t, states, dense, {"steps": dense.steps.size - 1}, met=dense.met, end=end)
    times = np.asarray(problem.t_eval, dtype=float)
    rows: list[Array] = []
    jumps = frozenset(problem.breakpoints)  # only asked for membership

    def ask(start: float, end: float) -> Array:
        # An output at the end of a step is read there, except at a breakpoint: the next piece starts with it.
        side: Literal["left", "right"] = "left" if end in jumps else "right"
        return times[np.searchsorted(times, start, side="right") : np.searchsorted(times, end, side=side)]

    found, met = _march(problem, opening, ask)
    steps = sum(len(marched) for _, marched in found)
    if steps * problem.x0.size <= MOST_KEPT:
        dense.ends = tuple(map(np.concatenate, _step_ends(found)))
    for piece, (start, marched) in zip(pieces(problem), found, strict=False):  # a guard may end it early
        if piece.start in times:
            rows.append(start[None, :])
        rows.extend(step.inside for step in marched)
    last = found[-1][1][-1]
    states = np.concatenate([np.empty((0, last.state.size)), *rows])
    return Trajectory(times[: len(states)], states, dense, {"steps": steps}, met=met, end=(last.end, last.state))


class _CvodeReplay:
    """Dense output that runs the problem again when it is first asked, and keeps each step's own polynomial."""

    def __init__(self, problem: Problem | DaeProblem, opening: Opening, degree: int) -> None:
        self._problem = problem
        self._opening = opening
        self._shares = points(degree)[1:-1]
        self.ends: tuple[Array, ...] = ()
        """Times and states at the step ends of an earlier run: who asks for these alone needs no further one."""

    @cached_property
    def _marched(self) -> Marched:
        return _march(self._problem, self._opening, lambda start, end: start + (end - start) * self._shares)

    @property
    def _found(self) -> list[tuple[Array, list[_CvodeStep]]]:
        return self._marched[0]

    @property
    def met(self) -> int | None:
        """The guard that ended the run."""
        return self._marched[1]

    @cached_property
    def _dense(self) -> PiecewiseDense:
        parts = [
            Polynomial(step.start, step.end, np.vstack([before, step.inside, step.state]))
            for (_, steps), states in zip(self._found, self.step_ends[1], strict=True)
            for before, step in zip(states, steps, strict=False)
        ]
        starts = np.array([part.start for part in parts])
        return PiecewiseDense(starts, tuple(parts), np.append(starts, parts[-1].end), self._problem.x0.size)

    @property
    def step_ends(self) -> tuple[list[Array], list[Array]]:
        """Times and states at the step ends of each piece."""
        return _step_ends(self._found)

    @property
    def steps(self) -> Array:
        return np.unique(self.ends[0]) if self.ends else self._dense.steps

    def __call__(self, times: Array) -> Array:
        if self.ends:
            last = np.searchsorted(self.ends[0], times, side="right") - 1  # after the jump, where there are two
            if np.array_equal(self.ends[0][last], times):
                return self.ends[1][last]
        return self._dense(times)


def _step_ends(found: list[tuple[Array, list[_CvodeStep]]]) -> tuple[list[Array], list[Array]]:
    times = [np.array([steps[0].start, *(step.end for step in steps)]) for _, steps in found]
    return times, [np.vstack([start, *(step.state for step in steps)]) for start, steps in found]
