"""The engine for stiff systems and for implicit equations: CVODE and IDA of SUNDIALS."""

from __future__ import annotations

import importlib.util
import warnings
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.interpolate import BarycentricInterpolator

from shaftwork.core.errors import MissingExtraError
from shaftwork.integrate.crossings import Crossings
from shaftwork.integrate.guards import LEAST, SHORTER, GuardWatch
from shaftwork.integrate.pieces import (
    GuardedFunctions,
    Pace,
    Piece,
    PiecewiseDense,
    both_sides,
    check_finite,
    failure,
    pieces,
    start_of_piece,
)
from shaftwork.integrate.problem import Array, DaeProblem, Problem, Trajectory

Method = Literal["BDF", "Adams"]

# SUNDIALS interpolates inside a step by a polynomial of at most this degree.
DEGREES = {"BDF": 5, "Adams": 12}
# Up to here a dense factorisation beats SuperLU. A band solver is not used: the binding passes its Jacobian as a full
# matrix, which costs more than the factorisation saves.
LARGEST_DENSE = 100


@dataclass(frozen=True)
class _Opened:
    """A SUNDIALS solver at the start of a piece.

    Args:
        solver: CVODE or IDA, with its first step still to take.
        start: (n,) consistent start state.
        explain: text of a failure from SUNDIALS' reason.
        outgrown: whether the solver must be opened anew, because its pattern misses entries of the Jacobian.
    """

    solver: Any
    start: Array
    explain: Callable[[str], str] = str
    outgrown: Callable[[], bool] = lambda: False

    def inside(self, times: Array) -> Array:
        """States (k, n) at times (k,) inside the last step."""
        return np.array([self.solver.step(time).y.copy() for time in times]).reshape(times.size, self.start.size)


Opener = Callable[[Piece, Array], _Opened]


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

    def opener() -> Opener:
        pattern = _Pattern(len(problem.x0))
        return lambda piece, x: _open_cvode(problem, piece, x, method, pattern)

    return _trajectory(problem, opener, DEGREES[method])


def solve_dae(problem: DaeProblem) -> Trajectory:
    """Integrate an implicit problem with IDA, from consistent initial values that IDA finds at every piece's start.

    Raises:
        MissingExtraError: scikit-sundae is not installed.
        SimulationError: SUNDIALS gave up, with its reason.

    Source: as `solve`.
    """
    _require("A nonlinear algebraic loop")
    return _trajectory(problem, lambda: lambda piece, x: _open_ida(problem, piece, x), DEGREES["BDF"])


def _require(purpose: str) -> None:
    if importlib.util.find_spec("sksundae") is None:
        raise MissingExtraError("scikit-sundae", "stiff", purpose)


def _open_cvode(problem: Problem, piece: Piece, x: Array, method: Method, pattern: _Pattern) -> _Opened:
    from sksundae.cvode import CVODE

    guard = GuardedFunctions(problem, piece)

    def rhs(t: float, y: Array, derivative: Array) -> None:
        derivative[:] = guard.rhs(t, y)

    options: dict[str, Any] = {"method": method, "rtol": problem.rtol, "atol": problem.atol}
    if problem.jacobian is not None:
        options |= _linear_solver(guard, piece, x, pattern)
    with warnings.catch_warnings():
        # It says that the pattern is only used as a pattern, since the Jacobian is given.
        warnings.filterwarnings("ignore", message="Custom sparse Jacobian")
        solver = CVODE(rhs, **options)
    solver.init_step(piece.start, x)
    return _Opened(solver, x, guard.reason, lambda: pattern.grown)


def _linear_solver(guard: GuardedFunctions, piece: Piece, x: Array, pattern: _Pattern) -> dict[str, Any]:
    if x.size <= LARGEST_DENSE:

        def fill_dense(t: float, y: Array, _: Array, full: Array) -> None:
            full[:] = guard.dense_jacobian(t, y)

        return {"linsolver": "dense", "jacfn": fill_dense}
    pattern.add(guard.jacobian(piece.start, x))
    order = pattern.freeze()

    def fill_sparse(t: float, y: Array, _: Array, data: Array) -> None:
        data[:] = pattern.values(guard.jacobian(t, y))

    return {"linsolver": "sparse", "sparsity": order, "jacfn": fill_sparse}


def _open_ida(problem: DaeProblem, piece: Piece, x: Array) -> _Opened:
    from sksundae.ida import IDA

    def residual(t: float, y: Array, derivative: Array, found: Array) -> None:
        found[:] = problem.residual(piece.inside(t), y, derivative)

    solver = IDA(
        residual,
        rtol=problem.rtol,
        atol=problem.atol,
        algebraic_idx=list(problem.algebraic),
        calc_initcond="yp0",
        calc_init_dt=1e-3 * (piece.end - piece.start),
    )
    try:
        with redirect_stdout(None):
            start = solver.init_step(piece.start, x, problem.derivative0)
    except RuntimeError as error:
        reason = f"IDA found no consistent initial values ({error})"
        raise failure(problem, "sundials", piece.start, x, reason) from error
    return _Opened(solver, start.y.copy())


class _Pattern:
    """The places of the Jacobian's entries in one run: they grow when a law starts to act, a stop that is hit.

    Args:
        size: number of states.
    """

    def __init__(self, size: int) -> None:
        self._size = size
        # An entry is known by its place along the columns. The diagonal belongs to the matrices that SUNDIALS makes.
        self._places = np.arange(size, dtype=np.int64) * (size + 1)
        self._frozen = self._places
        self._last: tuple[Any, Any, NDArray[np.intp], NDArray[np.bool_]] | None = None

    @property
    def grown(self) -> bool:
        """Whether entries were met that the frozen pattern has not."""
        return self._frozen.size != self._places.size

    def add(self, matrix: Any) -> NDArray[np.int64]:
        """Add the places of a matrix, a scipy.sparse.csc_array (n, n); they are returned."""
        columns = np.repeat(np.arange(self._size, dtype=np.int64), np.diff(matrix.indptr))
        places: NDArray[np.int64] = columns * self._size + matrix.indices
        self._places = np.union1d(self._places, places)
        return places

    def freeze(self) -> Any:
        """Fix the pattern for a solver: a scipy.sparse.csc_array (n, n) of ones."""
        self._frozen, self._last = self._places, None
        columns, rows = np.divmod(self._frozen, self._size)
        # SUNDIALS is built with int indices and reads these arrays as they lie in memory.
        starts = np.searchsorted(columns, np.arange(self._size + 1)).astype(np.int32)
        return sparse.csc_array((np.ones(rows.size), rows.astype(np.int32), starts), shape=(self._size, self._size))

    def values(self, matrix: Any) -> Array:
        """The entries of a matrix in the order of the frozen pattern; those that it has elsewhere are left out."""
        last = self._last
        if last is None or not (np.array_equal(last[0], matrix.indptr) and np.array_equal(last[1], matrix.indices)):
            places = self.add(matrix)
            found = np.minimum(np.searchsorted(self._frozen, places), self._frozen.size - 1)
            last = self._last = matrix.indptr, matrix.indices, found, self._frozen[found] == places
        data = np.zeros(self._frozen.size)
        data[last[2][last[3]]] = matrix.data[last[3]]
        return data


@dataclass(frozen=True)
class _Step:
    """One step: its ends in s, the state (n,) at its end, the states (k, n) at the times asked for inside it."""

    start: float
    end: float
    state: Array
    inside: Array


def _march(
    problem: Problem | DaeProblem, open_solver: Opener, ask: Callable[[float, float], Array]
) -> tuple[list[tuple[Array, list[_Step]]], int | None]:
    """All steps of each piece, behind the piece's start state, and the guard that ended the run.

    `ask` gives the times wanted in a step.
    """
    x = np.asarray(problem.x0, dtype=float)
    found: list[tuple[Array, list[_Step]]] = []
    left, pace = problem.max_steps, Pace(problem)
    for piece in pieces(problem):
        opened, crossings = open_solver(piece, start_of_piece(problem, piece, x)), Crossings(problem, piece)
        watch = GuardWatch(problem, piece.low, piece.high)
        x, t, longest = opened.start, piece.start, np.inf
        found.append((x, []))
        while t < piece.end:
            if left <= 0:
                raise failure(problem, "sundials", t, x, f"{problem.max_steps} steps were not enough")
            end, state = _step(problem, piece, opened, t, x, longest)
            # Its formulas meet a law at the ends of steps alone, so that a step may be cut off at a switch.
            stop = watch.cut(t, x, end, state, opened.inside)
            cut = crossings.cut(t, x, end, state, opened.inside, again=False)
            stops = stop is not None and (cut is None or stop <= cut)
            shortest = LEAST * (problem.t_end - problem.t0)
            if stop is not None and stops and end - t > shortest and not watch.follows(t, x, stop, opened.inside):
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
            states = np.vstack([opened.inside(within), np.repeat(x[None, :], asked.size - within.size, axis=0)])
            found[-1][1].append(_Step(t, end, x, states))
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
    problem: Problem | DaeProblem, piece: Piece, opened: _Opened, t: float, x: Array, longest: float
) -> tuple[float, Array]:
    """End in s and state (n,) there of the next step from a time and state, which is `longest` s long at most."""
    stop = min(piece.end, t + longest)
    # SUNDIALS prints what its result says as well.
    with np.errstate(all="ignore"), redirect_stdout(None):
        result = opened.solver.step(stop, method="onestep", tstop=stop)
    if not result.success:
        raise failure(problem, "sundials", t, x, opened.explain(str(result.message)))
    end, state = float(result.t), result.y.copy()
    check_finite(problem, "sundials", end, state)
    if end <= t:
        raise failure(problem, "sundials", t, x, opened.explain("the step became too small"))
    return end, state


def _trajectory(problem: Problem | DaeProblem, opener: Callable[[], Opener], degree: int) -> Trajectory:
    dense = _Replay(problem, opener, degree)
    if problem.t_eval is None:
        t, states = both_sides(problem, *dense.step_ends)
        return Trajectory(
            t, states, dense, {"steps": dense.steps.size - 1}, met=dense.met, end=(float(t[-1]), states[-1])
        )
    times = np.asarray(problem.t_eval, dtype=float)
    rows: list[Array] = []
    steps = 0

    def ask(start: float, end: float) -> Array:
        # An output at the end of a step is read there, except at a breakpoint: the next piece starts with it.
        side: Literal["left", "right"] = "left" if end in problem.breakpoints else "right"
        return times[np.searchsorted(times, start, side="right") : np.searchsorted(times, end, side=side)]

    found, met = _march(problem, opener(), ask)
    for piece, (start, marched) in zip(pieces(problem), found, strict=False):  # a guard may end it early
        if piece.start in times:
            rows.append(start[None, :])
        rows.extend(step.inside for step in marched)
        steps += len(marched)
    last = found[-1][1][-1]
    none = np.empty((0, last.state.size))
    states = np.concatenate([none, *rows])
    return Trajectory(times[: len(states)], states, dense, {"steps": steps}, met=met, end=(last.end, last.state))


class _Replay:
    """Dense output that runs the problem again when it is first asked, and keeps each step's own polynomial."""

    def __init__(self, problem: Problem | DaeProblem, opener: Callable[[], Opener], degree: int) -> None:
        self._problem = problem
        self._opener = opener
        # Chebyshev points of [0, 1] with both ends: the interpolation inside a step is exact and well conditioned.
        self._points = (1 - np.cos(np.pi * np.arange(degree + 1) / degree)) / 2

    @cached_property
    def _marched(self) -> tuple[list[tuple[Array, list[_Step]]], int | None]:
        return _march(self._problem, self._opener(), lambda start, end: start + (end - start) * self._points[1:-1])

    @property
    def _found(self) -> list[tuple[Array, list[_Step]]]:
        return self._marched[0]

    @property
    def met(self) -> int | None:
        """The guard that ended the run."""
        return self._marched[1]

    @cached_property
    def _dense(self) -> PiecewiseDense:
        parts, starts = [], []
        for state, steps in self._found:
            before = state
            for step in steps:
                nodes = np.vstack([before, step.inside, step.state])
                parts.append(_polynomial(step.start, step.end, self._points, nodes))
                starts.append(step.start)
                before = step.state
        ends = np.array([*starts, self._found[-1][1][-1].end])
        return PiecewiseDense(np.array(starts), tuple(parts), ends, self._problem.x0.size)

    @property
    def step_ends(self) -> tuple[list[Array], list[Array]]:
        """Times and states at the step ends of each piece."""
        times = [np.array([steps[0].start, *(step.end for step in steps)]) for _, steps in self._found]
        states = [np.vstack([start, *(step.state for step in steps)]) for start, steps in self._found]
        return times, states

    @property
    def steps(self) -> Array:
        return self._dense.steps

    def __call__(self, times: Array) -> Array:
        return self._dense(times)


def _polynomial(start: float, end: float, points: Array, nodes: Array) -> Callable[[Array], Array]:
    weights = (-1.0) ** np.arange(points.size)
    weights[[0, -1]] /= 2

    def evaluate(times: Array) -> Array:
        # With its weights given, scipy does not draw a random order of the points.
        return np.asarray(BarycentricInterpolator(points, nodes, wi=weights)((times - start) / (end - start)))

    return evaluate
