"""The engine that is always there: scipy's adaptive methods, stepped piece by piece."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from scipy.integrate import DOP853, OdeSolution, Radau

from shaftwork.core.errors import SimulationError
from shaftwork.integrate.crossings import Crossings
from shaftwork.integrate.engines import ENGINES
from shaftwork.integrate.guards import LEAST, SHORTER, GuardWatch
from shaftwork.integrate.linear.rounding_errors import cancellation
from shaftwork.integrate.problem import Array, Problem, Trajectory, tightened
from shaftwork.integrate.smooth_intervals import (
    GuardedFunctions,
    Pace,
    PiecewiseDense,
    SmoothInterval,
    both_sides,
    failure,
    pieces,
    reached,
    start_of_piece,
    used_up,
)
from shaftwork.integrate.stiffness import STABLE, bound_of_decay, jacobians, rates

Method = Literal["DOP853", "Radau"]

METHODS: dict[str, Any] = {"DOP853": DOP853, "Radau": Radau}

FINEST = ENGINES["scipy"].finest

# A run is made again where the torques of dampers may be off by more than the first factor times the tolerance. On the
# edge of stability errors are some 50 times as large as the tolerance that is asked for, hence the second.
BEARABLE, EDGE = 2.0, 50.0
# With steps of a smaller product of length and decay rate it is far from that edge, and every fast motion has steps of
# its own.
INSIDE, BRIEF = 1.0, 100


@dataclass(frozen=True)
class _SolvedInterval:
    """One piece, solved: step ends (s,), states there (s, n), dense output, counts, and the guard that ended it."""

    times: Array
    states: Array
    dense: Callable[[Array], Array]
    counts: dict[str, int]
    met: int | None = None


def solve(problem: Problem, method: Method = "DOP853") -> Trajectory:
    """Integrate with one of scipy's methods.

    An explicit run in which dampers carry small differences of large parts is made again, with a tolerance that is
    smaller by what cancels (`cancellation`): its steps are bound by stability and hardly become shorter.

    Args:
        problem: what to solve.
        method: "DOP853" (explicit, order 8) for smooth motion, "Radau" (implicit, order 5) for stiff systems.

    Raises:
        SimulationError: the step became too small, a value was not finite, or `max_steps` were not enough.

    Source: scipy.integrate; Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I (DOP853) and II (Radau).
    """
    runs = _march(problem, method)
    if method == "DOP853" and (problem.guards is None or _on_edge(problem, runs)):
        # On the edge of its stability it leaves errors of the tolerance in what an implicit method damps.
        times, states = _samples(runs)
        few = slice(None) if problem.guards is None else [0, -1]  # of many short runs, each tells a little
        factor = cancellation(problem, times[few], states[few])
        if BEARABLE < factor < 1 / np.finfo(float).eps:  # it is beyond all bounds where nothing has moved yet
            share = max(1 / (EDGE * factor), FINEST / problem.rtol)
            tight = tightened(problem, share)
            decay = rates(jacobians(problem)).decay
            # A longer step than is stable may well end right, because what is left of the fast motion is tiny at its
            # start, and yet be off inside by much more than the torque of a damper bears.
            again = _march(tight, method, longest=STABLE / decay if decay > 0 else np.inf)
            runs = [replace(new, counts=_sums([new, old])) for new, old in zip(again, runs, strict=True)]
    starts = np.array([run.times[0] for run in runs])
    steps = np.concatenate([runs[0].times, *(run.times[1:] for run in runs[1:])])
    dense = PiecewiseDense(starts, tuple(run.dense for run in runs), steps, problem.x0.size)
    if problem.t_eval is None:
        t, states = both_sides(problem, [run.times for run in runs], [run.states for run in runs])
    else:
        t = reached(problem.t_eval, steps[-1])
        states = dense(t)
    return Trajectory(t, states, dense, _sums(runs), met=runs[-1].met, end=(float(steps[-1]), runs[-1].states[-1]))


def _march(problem: Problem, method: Method, longest: float = np.inf) -> list[_SolvedInterval]:
    """All pieces, one after another."""
    x, pace, taken = np.asarray(problem.x0, dtype=float), Pace(problem), 0
    runs: list[_SolvedInterval] = []
    with np.errstate(all="ignore"):
        for piece in pieces(problem):
            start = start_of_piece(problem, piece, x)
            run = _piece(problem, piece, start, method, problem.max_steps - taken, pace, longest)
            runs.append(run)
            x, taken = run.states[-1], taken + run.counts["steps"]
            if run.met is not None:
                break
    return runs


def _on_edge(problem: Problem, runs: list[_SolvedInterval]) -> bool:
    """Whether a step is so long that it may be stability which bounds it.

    The decay is looked at once for many brief phases in the same modes, and anew for a long one.
    """
    longest, estimates = max(float(np.diff(run.times).max()) for run in runs), problem.estimates
    long = sum(run.counts["steps"] for run in runs) > BRIEF
    if long or "decay" not in estimates:
        if long or "bound" not in estimates:
            estimates["bound"] = bound_of_decay(jacobians(problem))
        if longest * estimates["bound"] <= INSIDE:
            return False
        estimates["decay"] = rates(jacobians(problem)).decay
    return bool(longest * estimates["decay"] > INSIDE)


def _samples(runs: list[_SolvedInterval]) -> tuple[Array, Array]:
    """Times and states at the starts of all steps: there no input is in the midst of a jump."""
    return np.concatenate([run.times[:-1] for run in runs]), np.concatenate([run.states[:-1] for run in runs])


def _sums(runs: list[_SolvedInterval]) -> dict[str, int]:
    return {name: sum(run.counts[name] for run in runs) for name in runs[0].counts}


def _piece(
    problem: Problem, piece: SmoothInterval, x: Array, method: Method, max_steps: int, pace: Pace, longest: float
) -> _SolvedInterval:
    guard, crossings = GuardedFunctions(problem, piece), Crossings(problem, piece)
    watch = GuardWatch(problem, piece.low, piece.high)
    times, states = [piece.start], [x]
    interpolants: list[Any] = []
    retired, shortest = np.zeros(2, dtype=int), LEAST * (problem.t_end - problem.t0)
    try:
        solver = _solver(problem, piece, x, method, guard, longest)
        while times[-1] < piece.end:
            if len(interpolants) >= max_steps:
                raise failure(problem, "scipy", solver.t, solver.y, used_up(problem))
            _advance(problem, solver, method, guard, times[-1], states[-1])
            if (objection := pace.objection(solver.t, rests=crossings.rests)) is not None:
                raise failure(problem, "scipy", solver.t, solver.y, f"{method}: {objection}")
            dense = solver.dense_output()
            end = watch.cut(times[-1], states[-1], solver.t, solver.y, _rows(dense))
            cut = crossings.cut(times[-1], states[-1], solver.t, solver.y, _rows(dense))
            if end is not None and (cut is None or end <= cut):
                if not watch.follows(times[-1], states[-1], end, _rows(dense)) and solver.t - times[-1] > shortest:
                    retired += solver.nfev, solver.njev
                    rest, brief = replace(piece, start=times[-1]), (solver.t - times[-1]) / SHORTER
                    solver = _solver(problem, rest, states[-1], method, guard, brief)
                    continue
                interpolants.append(dense)
                times.append(end)
                states.append(np.asarray(dense(end)))
                break
            if cut is None or cut == solver.t:
                interpolants.append(dense)
                times.append(solver.t)
                states.append(solver.y)
            if cut is not None or solver.status == "finished":
                retired += solver.nfev, solver.njev
            if times[-1] < piece.end and (cut is not None or solver.status == "finished"):
                end = piece.end if cut is None or cut == solver.t else cut
                solver = _solver(problem, replace(piece, start=times[-1], end=end), states[-1], method, guard, longest)
    except SimulationError:
        raise
    except (ValueError, RuntimeError) as error:  # a factorisation that met a NaN, or a singular one
        raise failure(problem, "scipy", times[-1], states[-1], f"{method}: {error}", guard) from error
    solution = OdeSolution(times, interpolants)
    calls, jacobians = retired.tolist()
    counts = {"steps": len(interpolants), "rhs": calls, "jacobians": jacobians}
    met = watch.met if times[-1] < piece.end else None
    return _SolvedInterval(np.array(times), np.array(states), _rows(solution), counts, met)


def _advance(problem: Problem, solver: Any, method: Method, guard: GuardedFunctions, t: float, x: Array) -> None:
    """Take one step from a time in s and a state (n,).

    Raises:
        SimulationError: it failed; says when and why.
    """
    if np.isnan(getattr(solver, "h_abs", 0.0)):  # scipy would look for a first step without end
        raise failure(problem, "scipy", t, x, f"{method}: no first step was found", guard)
    reason = str(solver.step() or "")
    if solver.status == "failed":
        good = x if np.isfinite(x).all() else solver.y
        raise failure(problem, "scipy", t, good, f"{method}: {reason}", guard)
    if not np.isfinite(solver.y.sum()):
        raise failure(problem, "scipy", solver.t, solver.y, f"{method}: the state is not finite", guard)


def _rows(dense: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """Dense output with a row for each time, where scipy's has a column."""
    return lambda times: np.asarray(dense(times)).T


def _solver(
    problem: Problem, piece: SmoothInterval, x: Array, method: Method, guard: GuardedFunctions, longest: float
) -> Any:
    options: dict[str, Any] = {"rtol": max(problem.rtol, FINEST), "atol": problem.atol, "max_step": longest}
    if method != "DOP853" and problem.jacobian is not None:
        options["jac"] = guard.jacobian
    return METHODS[method](guard.rhs, piece.start, x, piece.end, **options)
