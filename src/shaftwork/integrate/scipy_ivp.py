"""The engine that is always there: scipy's adaptive methods, stepped piece by piece."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy.integrate import DOP853, Radau

from shaftwork.core.errors import SimulationError
from shaftwork.integrate.crossings import Dense
from shaftwork.integrate.engines import ENGINES
from shaftwork.integrate.guards import BRIEF
from shaftwork.integrate.linear.rounding_errors import cancellation
from shaftwork.integrate.problem import Array, Problem, Trajectory, tightened
from shaftwork.integrate.smooth_intervals import GuardedFunctions, SmoothInterval, failure
from shaftwork.integrate.stepping import Step, SteppedRun, march, trajectory
from shaftwork.integrate.stiffness import STABLE, bound_of_decay, jacobians, rates

Method = Literal["DOP853", "Radau"]

METHODS: dict[str, Any] = {"DOP853": DOP853, "Radau": Radau}

# A run is made again where the torques of dampers may be off by more than this factor times the tolerance.
BEARABLE = 2.0


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
    run = _run(problem, method)
    if method == "DOP853" and (problem.guards is None or _on_edge(problem, run.march.steps)):
        # On the edge of its stability it leaves errors of the tolerance in what an implicit method damps.
        times, states = _starts(run.march)
        few = slice(None) if problem.guards is None else [0, -1]  # of many short runs, each tells a little
        factor = cancellation(problem, times[few], states[few])
        if BEARABLE < factor < 1 / np.finfo(float).eps:  # it is beyond all bounds where nothing has moved yet
            # On the edge of stability errors are some 50 times as large as the tolerance that is asked for.
            share = max(1 / (50 * factor), ENGINES["scipy"].finest / problem.rtol)
            decay = rates(jacobians(problem)).decay
            # A longer step than is stable may well end right, because what is left of the fast motion is tiny at its
            # start, and yet be off inside by much more than the torque of a damper bears.
            again = _run(tightened(problem, share), method, longest=STABLE / decay if decay > 0 else np.inf)
            run = _Run(again.march, again.parts, {name: run.counts[name] + again.counts[name] for name in run.counts})
    return trajectory(problem, run.march, run.parts, run.counts)


class _Run(NamedTuple):
    """All steps, dense output of each, and counts by name."""

    march: SteppedRun
    parts: list[Dense]
    counts: dict[str, int]


def _run(problem: Problem, method: Method, longest: float = np.inf) -> _Run:
    """A run in steps of at most `longest` s."""
    stepper = _ScipyStepper(problem, method, longest)
    whole = march(problem, stepper)
    counts = {"steps": whole.steps.size - 1, **dict(zip(("rhs", "jacobians"), stepper.calls, strict=True))}
    return _Run(whole, stepper.parts, counts)


def _on_edge(problem: Problem, steps: Array) -> bool:
    """Whether one of the steps, by their ends (s,), is so long that it may be stability which bounds it.

    With a product of length and decay rate below 1 it is far from that, and every fast motion has steps of its own. The
    decay is looked at once for many brief phases in the same modes, and anew for a long one.
    """
    longest, estimates = float(np.diff(steps).max()), problem.estimates
    long = steps.size - 1 > BRIEF
    if long or "decay" not in estimates:
        if long or "bound" not in estimates:
            estimates["bound"] = bound_of_decay(jacobians(problem))
        if longest * estimates["bound"] <= 1:
            return False
        estimates["decay"] = rates(jacobians(problem)).decay
    return bool(longest * estimates["decay"] > 1)


def _starts(whole: SteppedRun) -> tuple[Array, Array]:
    """Times and states at the starts of all steps: there no input is in the midst of a jump."""
    times = [time for piece in whole.pieces for time in piece.times[:-1]]
    return np.array(times), np.array([state for piece in whole.pieces for state in piece.states[:-1]])


class _ScipyStepper:
    """One of scipy's methods.

    Args:
        problem: what is being solved.
        method: its name.
        longest: a step at most, s.
    """

    engine = "scipy"
    cuts_off = False

    def __init__(self, problem: Problem, method: Method, longest: float) -> None:
        self._problem, self._method, self._longest = problem, method, longest
        self._solver: Any = None
        self._calls = (0, 0)
        self.parts: list[Dense] = []
        """Dense output of the steps that were taken."""

    @property
    def calls(self) -> tuple[int, int]:
        """How often right-hand side and Jacobian were evaluated."""
        return self._calls[0] + self._solver.nfev, self._calls[1] + self._solver.njev

    def open(self, piece: SmoothInterval, t: float, x: Array) -> Array:
        if t == piece.start:
            self._piece, self._functions = piece, GuardedFunctions(self._problem, piece)
        self._begin(t, x, piece.end, self._longest)
        return x

    def step(self, t: float, x: Array) -> Step:
        if self._solver.status == "finished":  # up to a switch
            self._begin(t, x, self._piece.end, self._longest)
        solver = self._solver
        if np.isnan(getattr(solver, "h_abs", 0.0)):  # scipy would look for a first step without end
            raise self._failure(t, x, "no first step was found")
        with self._told(t, x):
            reason = str(solver.step() or "")
        if solver.status == "failed":
            raise self._failure(t, x if np.isfinite(x).all() else solver.y, reason)
        if not np.isfinite(solver.y.sum()):
            raise self._failure(solver.t, solver.y, "the state is not finite")
        self._dense = _rows(solver.dense_output())
        return Step(solver.t, solver.y, self._dense)

    def again(self, t: float, x: Array, end: float, longest: float) -> None:
        self._begin(t, x, end, min(longest, self._longest))

    def take(self, t: float, end: float, state: Array) -> None:  # noqa: ARG002 (its dense output has all)
        self.parts.append(self._dense)

    def _begin(self, t: float, x: Array, end: float, longest: float) -> None:
        if self._solver is not None:
            self._calls = self.calls
        problem, functions = self._problem, self._functions
        options: dict[str, Any] = {"rtol": problem.rtol, "atol": problem.atol, "max_step": longest}
        if self._method != "DOP853" and problem.jacobian is not None:
            options["jac"] = functions.jacobian
        with self._told(t, x):
            self._solver = METHODS[self._method](functions.rhs, t, x, end, **options)

    @contextmanager
    def _told(self, t: float, x: Array) -> Iterator[None]:
        """Tell of a factorisation that met a NaN, or of a singular one, where and when it was."""
        try:
            yield
        except SimulationError:
            raise
        except (ValueError, RuntimeError) as error:
            raise self._failure(t, x, str(error)) from error

    def _failure(self, t: float, x: Array, reason: str) -> SimulationError:
        return failure(self._problem, "scipy", t, x, f"{self._method}: {reason}", self._functions)


def _rows(dense: Callable[[Array], Array]) -> Dense:
    """Dense output with a row for each time, where scipy's has a column."""
    return lambda times: np.asarray(dense(times)).T
