"""The smooth pieces of a problem, and the trajectory that is put together from them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from shaftwork.core.errors import SimulationError
from shaftwork.integrate.problem import Array, DaeProblem, Problem, TimedProblem

# Where a run has failed its further course is looked at for laws without a value, over this part of the whole time.
AHEAD = 1e-6 * 0.5 ** np.arange(30, -1, -1)
T = TypeVar("T")


@dataclass(frozen=True)
class SmoothInterval:
    """A span of time in which the right-hand side is smooth.

    Args:
        start: s.
        end: s.
        low: the earliest time in s at which inputs are read, after whatever jumps at the start.
        high: the latest, before whatever jumps at the end.
    """

    start: float
    end: float
    low: float
    high: float

    def inside(self, time: float) -> float:
        """The time in s, moved by some rounding units where it touches an end: there another piece's input is met."""
        # A method's last stage lies exactly on the end of its step, and a step function is one-sided at its jump.
        return min(max(time, self.low), self.high)


class GuardedFunctions:
    """Right-hand side and Jacobian of one piece: never evaluated outside it; remembers where one was not finite."""

    def __init__(self, problem: Problem, piece: SmoothInterval) -> None:
        self._problem = problem
        self._jacobian: Callable[[float, Array], Any] = problem.jacobian or _no_jacobian
        self._low, self._high = piece.low, piece.high
        self.not_finite: tuple[float, Array, Array] | None = None
        """Time, state and derivative where it was last not finite."""

    def rhs(self, t: float, x: Array) -> Array:
        """The right-hand side, asked inside the piece."""
        derivative = self._problem.rhs(min(max(t, self._low), self._high), x)
        # The sum is a cheap test that cannot miss a NaN or an infinity. A trial stage that is too bold may meet one
        # and recover with a smaller step, so it is only remembered here.
        if not np.isfinite(derivative.sum()):
            self.not_finite = (t, x.copy(), derivative)
        return derivative

    def jacobian(self, t: float, x: Array) -> Any:
        """The sparse Jacobian, asked inside the piece; zero where a slope is not finite (a square root at rest)."""
        matrix = self._jacobian(min(max(t, self._low), self._high), x)
        # It only steers Newton's method, which a NaN would end and an infinite slope would stop where it is.
        matrix.data[~np.isfinite(matrix.data)] = 0.0
        return matrix

    def dense_jacobian(self, t: float, x: Array) -> Any:
        """The Jacobian as a full array."""
        return self.jacobian(t, x).toarray()

    def reason(self, reason: str) -> str:
        """The solver's reason, with the first equation that was not finite when there was one."""
        if self.not_finite is None:
            return reason
        t, _, derivative = self.not_finite
        bad = np.flatnonzero(~np.isfinite(derivative))
        if bad.size == 0:
            return reason
        name = self._problem.names[int(bad[0])]
        return f"{reason.rstrip('.')}; the derivative of {name!r} was {derivative[bad[0]]} at t = {t:.9g} s"


def pieces(problem: TimedProblem) -> tuple[SmoothInterval, ...]:
    """The pieces between the start, the breakpoints and the end of a problem, in order."""
    ends = (problem.t0, *problem.breakpoints, problem.t_end)
    sides = [problem.sides(end) for end in ends]
    return tuple(
        SmoothInterval(start, end, after, before)
        for (start, (_, after)), (end, (before, _)) in pairwise(zip(ends, sides, strict=True))
    )


def start_of_piece(problem: TimedProblem, piece: SmoothInterval, x: Array) -> Array:
    """State (n,) with which a piece starts, from the state at the end of the piece before (or the start state)."""
    if problem.jump is None or piece.start == problem.t0:
        return x
    return np.asarray(problem.jump(piece.start, x), dtype=float)


@dataclass(frozen=True)
class PiecewiseDense:
    """Dense output put together from spans of time; where two spans meet, the later one is asked.

    Args:
        starts: (m,) start times of the spans in s.
        parts: dense output of each span, times (k,) to states (k, n).
        steps: (s,) ends of the steps in s, t0 first.
        size: number of states n.
    """

    starts: Array
    parts: tuple[Callable[[Array], Array], ...]
    steps: Array
    size: int

    def __call__(self, times: Array) -> Array:
        return piecewise(self.starts, self.parts, self.size, times)


def piecewise(starts: Array, parts: Sequence[Callable[[Array], Array]], size: int, times: Array) -> Array:
    """States (k, n) at times (k,), each from the last span that has started; arguments as for `PiecewiseDense`."""
    times = np.atleast_1d(np.asarray(times, dtype=float))
    index = np.clip(np.searchsorted(starts, times, side="right") - 1, 0, len(parts) - 1)
    states = np.empty((times.size, size))
    order = np.argsort(index, kind="stable")
    for chosen in np.split(order, np.flatnonzero(np.diff(index[order])) + 1):
        if chosen.size:
            states[chosen] = parts[index[chosen[0]]](times[chosen])
    return states


def _no_jacobian(t: float, x: Array) -> Any:
    raise NotImplementedError(f"a problem without Jacobian was asked for it at t = {t}, with {x.size} states")


def both_sides(problem: TimedProblem, times: Sequence[Array], states: Sequence[Array]) -> tuple[Array, Array]:
    """Join the step ends of all pieces: (k,) times and (k, n) states.

    Where the state is continuous a breakpoint is listed once, where it may jump twice: before and after.
    """
    first = 0 if problem.jump is not None else 1
    t = np.concatenate([times[0], *(part[first:] for part in times[1:])])
    x = np.concatenate([states[0], *(part[first:] for part in states[1:])])
    return t, x


def reached(times: Array, end: float) -> Array:
    """The output times (k,) up to the end of a run in s, which a guard may have cut short."""
    return np.asarray(times, dtype=float)[: int(np.searchsorted(times, end, side="right"))]


def failure(
    problem: TimedProblem, engine: str, t: float, x: Array, reason: str, guard: GuardedFunctions | None = None
) -> SimulationError:
    """The error of a failed run: when, in which state, why, and what to try; or the law that has no value there.

    Args:
        problem: what was to be solved.
        engine: name of the engine for the message.
        t: last time reached, in s.
        x: (n,) state there.
        reason: the solver's own reason.
        guard: what the solver has called.
    """
    if (error := _without_value(problem, t, x, guard)) is not None:
        return error
    reason = reason if guard is None else guard.reason(reason)
    if problem.names:
        bad = np.flatnonzero(~np.isfinite(x))
        worst = int(bad[0]) if bad.size else int(np.argmax(np.abs(x) / np.maximum(problem.atol, np.finfo(float).tiny)))
        kind = "not finite" if bad.size else "the largest against its tolerance"
        state = f" State {problem.names[worst]!r} = {float(x[worst]):.6g} is {kind}."
    else:
        state = ""
    return SimulationError(
        f"The {engine} engine failed at t = {t:.9g} s (asked: {problem.t0:.6g} to {problem.t_end:.6g} s): "
        f"{reason.strip().rstrip('.')}.{state} "
        "Check the parameters and laws that act on this state, or try another engine or a looser rtol."
    )


def _without_value(problem: TimedProblem, t: float, x: Array, guard: GuardedFunctions | None) -> SimulationError | None:
    """The error of what has no value where a run has failed, or just after."""
    error = near(problem, problem.explain, t, x)
    if problem.explain is None or error is not None or guard is None or guard.not_finite is None:
        return error
    at, state, _ = guard.not_finite
    return problem.explain(np.array([at]), state[None, :]) if np.isfinite(at) and np.isfinite(state).all() else None


def near(problem: TimedProblem, explain: Callable[[Array, Array], T] | None, t: float, x: Array) -> T | None:
    """What explains the failure of a run where it has come to, or just after.

    Args:
        problem: what was to be solved.
        explain: from times (k,) and states (k, n) to an explanation, such as `problem.explain`; None where there is
            none.
        t: last time reached, s.
        x: (n,) state there.
    """
    if explain is None:
        return None
    rates = problem.rhs(t, x) if isinstance(problem, Problem) else np.zeros_like(x)
    steps = np.append(0.0, AHEAD * (problem.t_end - problem.t0))[:, None]
    return explain(t + steps[:, 0], x + steps * np.where(np.isfinite(rates), rates, 0.0))


def used_up(problem: Problem | DaeProblem) -> str:
    """Why a run is given up that needs more steps than are allowed."""
    return f"{problem.earlier_steps + problem.max_steps} steps were not enough"


def check_finite(problem: TimedProblem, engine: str, t: float, x: Array) -> None:
    """Raise `SimulationError` when a state (n,) at time t in s is not finite."""
    if not np.isfinite(x).all():
        raise failure(problem, engine, t, x, "the state is not finite")
