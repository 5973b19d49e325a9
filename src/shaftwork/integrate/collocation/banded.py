"""The engine for long chains: implicit collocation of high order whose linear systems are banded.

Radau IIA with six stages (order 11, dense output of order 7) damps what is stiff and unresolved, as it should be; of a
motion that is resolved it loses far less energy than the tolerance. An undamped linear system gets Gauss' nodes (order
12), which keep its energy to rounding, whatever the step.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from shaftwork.core.errors import ParameterError
from shaftwork.integrate.collocation.banded_stages import (
    BandedStages,
    ShiftedCollocation,
    StepStart,
    shifted_collocation,
)
from shaftwork.integrate.engines import ENGINES
from shaftwork.integrate.linear.propagation import cost
from shaftwork.integrate.problem import Array, Problem, Trajectory
from shaftwork.integrate.smooth_intervals import SmoothInterval, check_finite, failure
from shaftwork.integrate.stepping import Step, SteppedRun, march
from shaftwork.integrate.stiffness import STABLE, first_jacobian, is_chain, is_undamped, jacobians, rates

# `auto` takes the engine for damped chains that are not linear where an explicit method needs more steps than these: it
# takes some hundred steps, even on chains of 10000 elements, each as long as some explicit ones.
FEWEST_STEPS = 1e4


def solve(problem: Problem) -> Trajectory:
    """Integrate a system with a sparse Jacobian, in time linear in its size where that is a chain.

    Law: collocation with six stages. The complex shifts of its stage equations are factorised by SuperLU
    (`ShiftedMatrix`) and kept while step and Jacobian serve. A linear system with straight inputs takes
    one solution for each shift and step; any other takes Newton iterations. The step follows from the defect of the
    polynomial at its start, which bounds the error everywhere in the step; the worst state counts, not a mean.

    Raises:
        ParameterError: the problem has no Jacobian.
        SimulationError: the step became too small, a value was not finite, or `max_steps` were not enough.

    Source: Hairer and Wanner, Solving Ordinary Differential Equations II, 1996, chapter IV.
    """
    stepper = _BandedStepper(problem)
    whole = march(problem, stepper)
    taken = sum(len(piece.times) - 1 for piece in whole.pieces)
    statistics = {"steps": taken, "rejected": stepper.tried - taken, **stepper.stages.counts}
    dense = _BandedDense(whole, stepper)
    if problem.t_eval is None:
        return Trajectory(*whole.both_sides(problem), dense, statistics)
    return Trajectory(np.asarray(problem.t_eval, dtype=float), stepper.outputs.x, dense, statistics)


def suits(problem: Problem) -> str:
    """Why `auto` takes this engine for a chain that the exact one leaves to others; empty where it does not."""
    if problem.straight is not None:
        if not is_chain(problem):
            return ""
        seconds = cost(problem, problem.straight)
        return f"The system is a long linear chain: exact propagation would take about {seconds:.2g} s."
    small = problem.x0.size <= ENGINES["banded"].asked_beyond
    if small or not is_chain(problem) or is_undamped(problem):
        return ""
    fastest = rates(jacobians(problem))
    explicit_steps = max(fastest.decay, fastest.oscillation) * (problem.t_end - problem.t0) / STABLE
    if explicit_steps <= FEWEST_STEPS:
        return ""
    return (
        f"The system is a long damped chain: an explicit method would need about {explicit_steps:.2g} steps, "
        "and the equations of an implicit one are banded."
    )


class _Arc:
    """The polynomial of one step."""

    def __init__(
        self, stages: BandedStages, method: ShiftedCollocation, start: StepStart, length: float, modes: Array
    ) -> None:
        self._stages, self._method = stages, method
        self.start, self.length, self._modes = start, length, modes
        # The slope that the system has at the start, where the polynomial need not meet it, less the polynomial's own.
        self.defect = length * start.rate - method.at_start @ modes

    @cached_property
    def end(self) -> Array:
        """State (n,) at the end of the step."""
        return np.asarray(self.start.x + self._method.at_end[0] @ self._modes)

    @cached_property
    def _correction(self) -> Array:
        """The defect of what the step resolves.

        That of a stiff motion is its decay times the error of the state at the start. The polynomial forgets this
        error, and the bump of the defect would spread it over the step: at a damping ratio of 1e6 the torque would be
        off by 2e-5 of its largest value, where it is by 5e-10.
        """
        return self._stages.quieted(self.defect, self.length, self.start.scale)

    @property
    def rate(self) -> Array:
        """Slope (n,) at the end of the step."""
        return np.asarray(self._method.at_end[1] @ self._modes) / self.length

    def at(self, times: Array) -> Array:
        """States (k, n) at times (k,) of the step, before the next one is tried."""
        theta = (times - self.start.t) / self.length
        states = self._method.increments(theta) @ self._modes
        states += np.multiply.outer(self._method.bump(theta), self._correction)
        states += self.start.x
        return np.asarray(states)


class _Outputs:
    """The states at the output times, filled step by step."""

    def __init__(self, problem: Problem) -> None:
        self._times = np.empty(0) if problem.t_eval is None else np.asarray(problem.t_eval, dtype=float)
        self._breakpoints = problem.breakpoints
        self.x = np.empty((self._times.size, problem.x0.size))

    def start(self, t: float, x: Array) -> None:
        """Keep the state with which a piece starts, where it is an output."""
        self.x[self._times == t] = x

    def fill(self, t: float, end: float, arc: _Arc) -> None:
        """Keep the outputs inside a step and at its end; at a breakpoint the next piece has it."""
        side: Any = "left" if end in self._breakpoints else "right"
        first, last = np.searchsorted(self._times, t, side="right"), np.searchsorted(self._times, end, side=side)
        if first < last:
            self.x[first:last] = arc.at(self._times[first:last])


class _BandedStepper:
    """The method, and what dense output needs of its steps.

    Args:
        problem: what is being solved.
        safety: a step is so much shorter than the error of the last one would let it be.
    """

    engine = "banded"
    cuts_off = False

    def __init__(self, problem: Problem, safety: float = 0.9) -> None:
        matrix = first_jacobian(problem)
        if matrix is None:
            raise ParameterError("The banded engine needs a Jacobian, and this problem has none. Take 'scipy-radau'.")
        self.problem, self._safety = problem, safety
        self.method = _method(problem)
        self.stages = BandedStages(problem, matrix, self.method)
        self.outputs = _Outputs(problem)
        self.pieces: list[SmoothInterval] = []
        self.taken: list[list[tuple[float, Array | None]]] = []
        """Of each piece, the lengths in s of its steps and the slopes (n,) at their starts, None where these follow
        without noise."""
        self.tried = 0
        self._arc: _Arc | None = None

    def scale(self, x: Array) -> Array:
        """The tolerance (n,) of each state."""
        return np.maximum(self.problem.atol + self.problem.rtol * np.abs(x), np.finfo(float).tiny)

    def open(self, piece: SmoothInterval, t: float, x: Array) -> Array:
        if t == piece.start:
            self.pieces.append(piece)
            self.taken.append([])
        self.outputs.start(t, x)
        self.stages.open(piece)
        self._start = start = StepStart(t, x, self.stages.rate(t, x), self.scale(x))
        # At first no state moves by more than its tolerance, over the peak: that step stands, and soon grows.
        speed = self.method.peak * float((np.abs(start.rate) / start.scale).max())
        self._step = 1 / speed if speed > 0 else piece.end - t
        return x

    def step(self, t: float, x: Array) -> Step | None:
        self.tried, piece = self.tried + 1, self.pieces[-1]
        if self._arc is not None and self._start.t != t:
            rate = self._arc.rate if self.stages.noisy else self.stages.rate(t, x)
            self._start = StepStart(t, x, rate, self.scale(x))
        start = self._start
        if not self._step > 8 * np.spacing(abs(t)):
            reason = self.stages.reason("the step became too small")
            raise failure(self.problem, "banded", t, x, reason)
        length, end = _fitted(t, self._step, piece.end)
        arc = self.arc(start, length)
        factor = 0.25 if arc is None else self._factor(arc, np.maximum(start.scale, self.scale(arc.end)))
        if arc is None or factor < self._safety:
            self._step = factor * length
            return None
        check_finite(self.problem, "banded", end, arc.end)
        # a longer step has to be worth the factors that are made anew for it
        self._arc, self._longer = arc, factor * length if factor > 1.5 else 0.0
        return Step(end, arc.end, arc.at)

    def again(self, t: float, x: Array, end: float, longest: float) -> None:  # noqa: ARG002 (it starts as it did)
        self._step = min(end - t, longest)

    def take(self, t: float, end: float, state: Array) -> None:  # noqa: ARG002 (the step has it)
        assert self._arc is not None  # noqa: S101 (a step is taken once it is made)
        self._step = max(self._step, self._longer)
        self.taken[-1].append((self._arc.length, self._start.rate if self.stages.noisy else None))
        self.outputs.fill(t, end, self._arc)

    def arc(self, start: StepStart, length: float, expected: Array | None = None) -> _Arc | None:
        """A step, or None where its equations have no solution that is found.

        Args:
            start: where it starts.
            length: s.
            expected: (s, n) stage increments that are expected, or None.
        """
        try:
            modes = self.stages.modes(start, length, expected)
        except np.linalg.LinAlgError:
            return None
        return None if modes is None else _Arc(self.stages, self.method, start, length, modes)

    def _factor(self, arc: _Arc, scale: Array) -> float:
        """The factor by which the next step may be longer; below the safety this one was too long."""
        error, least, most = self.method.peak * float((np.abs(arc.defect) / scale).max()), 0.1, 8.0
        if not np.isfinite(error):
            return least
        return float(np.clip(self._safety * max(error, 1e-300) ** (-1 / (self.method.order + 1)), least, most))


class _BandedDense:
    """The motion at any time, from steps that are made again: their polynomials would fill the memory."""

    def __init__(self, whole: SteppedRun, stepper: _BandedStepper) -> None:
        self._pieces, self._stepper, self.steps = whole.pieces, stepper, whole.steps
        self._places = [(k, step) for k, piece in enumerate(whole.pieces) for step in range(len(piece.times) - 1)]

    def __call__(self, times: Array) -> Array:
        times = np.atleast_1d(np.asarray(times, dtype=float))
        stages, opened = self._stepper.stages, -1
        index = np.clip(np.searchsorted(self.steps, times, side="right") - 1, 0, len(self._places) - 1)
        states = np.empty((times.size, self._pieces[0].states[0].size))
        with np.errstate(all="ignore"):
            for number in np.unique(index):
                (piece, step), chosen = self._places[number], index == number
                if piece != opened:
                    opened = piece
                    stages.open(self._stepper.pieces[piece])
                start, x = self._pieces[piece].times[step], self._pieces[piece].states[step]
                states[chosen] = x if (times[chosen] == start).all() else self._arc(piece, step).at(times[chosen])
        return states

    def _arc(self, number: int, step: int) -> _Arc:
        stepper, piece, (length, rate) = self._stepper, self._pieces[number], self._stepper.taken[number][step]
        t, (x, state) = piece.times[step], piece.states[step : step + 2]
        start = StepStart(t, x, stepper.stages.rate(t, x) if rate is None else rate, stepper.scale(x))
        theta = stepper.method.nodes[:, None]
        # A parabola through what is known of the step leads Newton's method to the same solution.
        expected = theta * length * start.rate + theta**2 * (state - x - length * start.rate)
        arc = stepper.arc(start, length, expected)
        if arc is None:
            raise failure(stepper.problem, "banded", t, x, "a step could not be repeated for dense output")
        return arc


def _method(problem: Problem) -> ShiftedCollocation:
    """The method that suits a problem."""
    undamped = problem.straight is not None and is_undamped(problem)
    return shifted_collocation("gauss" if undamped else "radau", 6)


def _fitted(t: float, step: float, end: float) -> tuple[float, float]:
    """Length and end of the next step: never one that ends just before the piece and leaves a tiny rest."""
    left = end - t
    if step >= left * (1 - 1e-9):
        return left, end
    # Not the difference of two times, whose rounding would have the factors made anew in each step.
    length = min(step, left / 2)
    return length, t + length
