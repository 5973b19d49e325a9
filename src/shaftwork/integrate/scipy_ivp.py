"""The engine that is always there: scipy's adaptive methods, stepped piece by piece."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy.integrate import BDF, DOP853, LSODA, OdeSolution, Radau

from shaftwork.core.errors import SimulationError
from shaftwork.integrate.pieces import (
    GuardedFunctions,
    Pace,
    Piece,
    PiecewiseDense,
    both_sides,
    failure,
    pieces,
    start_of_piece,
)
from shaftwork.integrate.problem import Array, Problem, Trajectory

Method = Literal["DOP853", "Radau", "BDF", "LSODA"]

METHODS: dict[str, Any] = {"DOP853": DOP853, "Radau": Radau, "BDF": BDF, "LSODA": LSODA}

# Below this relative tolerance scipy's methods only warn and clip, so it is clipped here without the warning.
TIGHTEST_RTOL = 100 * np.finfo(float).eps


@dataclass(frozen=True)
class _Run:
    """One piece, solved: step ends (s,), states there (s, n), dense output and counts."""

    times: Array
    states: Array
    dense: Callable[[Array], Array]
    counts: dict[str, int]


def solve(problem: Problem, method: Method = "DOP853") -> Trajectory:
    """Integrate with one of scipy's methods.

    Args:
        problem: what to solve.
        method: "DOP853" (explicit, order 8) for smooth motion, "Radau" or "BDF" for stiff systems, "LSODA" switches.

    Raises:
        SimulationError: the step became too small, a value was not finite, or `max_steps` were not enough.

    Source: scipy.integrate; Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I (DOP853) and II (Radau).
    """
    x, pace = np.asarray(problem.x0, dtype=float), Pace(problem)
    runs: list[_Run] = []
    parts = pieces(problem)
    with np.errstate(all="ignore"):
        for piece in parts:
            taken = sum(run.counts["steps"] for run in runs)
            run = _piece(problem, piece, start_of_piece(problem, piece, x), method, problem.max_steps - taken, pace)
            runs.append(run)
            x = run.states[-1]
    starts = np.array([piece.start for piece in parts])
    steps = np.concatenate([runs[0].times, *(run.times[1:] for run in runs[1:])])
    dense = PiecewiseDense(starts, tuple(run.dense for run in runs), steps, x.size)
    if problem.t_eval is None:
        t, states = both_sides(problem, [run.times for run in runs], [run.states for run in runs])
    else:
        t = np.asarray(problem.t_eval, dtype=float)
        states = dense(t)
    statistics = {name: sum(run.counts[name] for run in runs) for name in runs[0].counts}
    return Trajectory(t, states, dense, statistics)


def _piece(problem: Problem, piece: Piece, x: Array, method: Method, max_steps: int, pace: Pace) -> _Run:
    guard = GuardedFunctions(problem, piece)
    times, states = [piece.start], [x]
    interpolants: list[Any] = []
    try:
        solver = _solver(problem, piece, x, method, guard)
        while solver.status == "running":
            if len(interpolants) >= max_steps:
                raise failure(problem, "scipy", solver.t, solver.y, f"{problem.max_steps} steps were not enough")
            reason = _step(solver, method)
            if solver.status == "failed":
                reached = states[-1] if np.isfinite(states[-1]).all() else solver.y
                raise failure(problem, "scipy", times[-1], reached, guard.reason(f"{method}: {reason}"))
            if not np.isfinite(solver.y.sum()):
                raise failure(problem, "scipy", solver.t, solver.y, guard.reason(f"{method}: the state is not finite"))
            if solver.t <= times[-1]:  # LSODA goes on with steps below the spacing of numbers
                raise failure(problem, "scipy", solver.t, solver.y, f"{method}: the step became too small")
            if (objection := pace.objection(solver.t)) is not None:
                raise failure(problem, "scipy", solver.t, solver.y, f"{method}: {objection}")
            interpolants.append(solver.dense_output())
            times.append(solver.t)
            states.append(solver.y)
    except SimulationError:
        raise
    except (ValueError, RuntimeError) as error:  # a factorisation that met a NaN, or a singular one
        raise failure(problem, "scipy", times[-1], states[-1], guard.reason(f"{method}: {error}")) from error
    solution = OdeSolution(times, interpolants)
    counts = {"steps": len(interpolants), "rhs": solver.nfev, "jacobians": int(solver.njev)}
    return _Run(np.array(times), np.array(states), lambda at: np.asarray(solution(at)).T, counts)


def _solver(problem: Problem, piece: Piece, x: Array, method: Method, guard: GuardedFunctions) -> Any:
    options: dict[str, Any] = {"rtol": max(problem.rtol, TIGHTEST_RTOL), "atol": problem.atol}
    if method != "DOP853" and problem.jacobian is not None:
        options["jac"] = guard.dense_jacobian if method == "LSODA" else guard.jacobian
    return METHODS[method](guard.rhs, piece.start, x, piece.end, **options)


def _step(solver: Any, method: Method) -> str:
    """Take one step; the solver's message, which LSODA gives as a warning."""
    if method != "LSODA":
        return str(solver.step() or "")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        message = solver.step()
    return "; ".join([*(str(warning.message) for warning in caught), str(message or "")])
