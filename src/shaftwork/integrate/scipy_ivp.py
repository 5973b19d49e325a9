"""The engine that is always there: scipy's adaptive methods, stepped piece by piece."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Literal

import numpy as np
from scipy.integrate import DOP853, Radau

from shaftwork.core.errors import SimulationError
from shaftwork.integrate.crossings import Dense
from shaftwork.integrate.engines import ENGINES
from shaftwork.integrate.explicit.explicit_runs import INSIDE, MarchedRun, least_rates, stable
from shaftwork.integrate.problem import Array, Problem, Trajectory
from shaftwork.integrate.smooth_intervals import GuardedFunctions, PiecewiseDense, SmoothInterval, failure
from shaftwork.integrate.stepping import Step, march, with_outputs

FINEST = ENGINES["scipy"].finest

Method = Literal["DOP853", "Radau"]


class _RateJudged(DOP853):  # type: ignore[misc]
    """Dormand and Prince's method, a step of which is judged by the rates inside it as well.

    Users read rates, as the torque on an inertia and the speed of a twist: small differences of large states. What the
    error changes in them counts against the largest so far, unless the states are as right as rounding lets them be.
    """

    def __init__(self, *arguments: Any, sizes: Array, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._sizes = sizes
        """(n,) of the rates, the largest so far, kept up."""

    def _estimate_error_norm(self, K: Array, h: float, scale: Array) -> float:
        states = float(super()._estimate_error_norm(K, h, scale))
        if not 0 < states < 1:
            return states
        moved = self.y + h * (self.A[INSIDE] @ K[: self.n_stages]) + self._estimate_error(K, h)
        change = self.fun(self.t + h * self.C[INSIDE], moved) - K[INSIDE]
        np.maximum(self._sizes, np.abs(K[[0, INSIDE]]).max(axis=0), out=self._sizes)
        rates = float(np.sqrt(np.mean((change / (self.rtol * self._sizes)) ** 2)))
        return min(rates, states * self.rtol / FINEST) if rates > states else states


METHODS: dict[str, Any] = {"DOP853": _RateJudged, "Radau": Radau}


def solve(problem: Problem, method: Method = "DOP853") -> Trajectory:
    """Integrate with one of scipy's methods.

    Args:
        problem: what to solve.
        method: "DOP853" (explicit, order 8) for smooth motion, "Radau" (implicit, order 5) for stiff systems.

    Raises:
        SimulationError: the step became too small, a value was not finite, or `max_steps` were not enough.

    Source: scipy.integrate; Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I (DOP853) and II (Radau).
    """
    if method == "DOP853":
        whole = stable(problem, lambda problem, longest: _run(problem, method, longest))
    else:
        whole = _run(problem, method)
    return with_outputs(problem, whole.march, whole.dense, whole.counts)


def _run(problem: Problem, method: Method, longest: float = np.inf) -> MarchedRun:
    """A run in steps of at most `longest` s."""
    stepper = _ScipyStepper(problem, method, longest)
    whole = march(problem, stepper)
    dense = PiecewiseDense(whole.steps[:-1], tuple(stepper.parts), whole.steps, problem.x0.size)
    return MarchedRun(whole, dense, dict(zip(("rhs", "jacobians"), stepper.calls, strict=True)))


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
        self._calls, self._sizes = (0, 0), least_rates(problem)
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
        if self._method == "DOP853":
            options["sizes"] = self._sizes
        elif problem.jacobian is not None:
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
