"""The engine for long chains: implicit collocation of high order whose linear systems are banded.

Radau IIA with six stages (order 11, dense output of order 7) damps what is stiff and unresolved, as it should be; of a
motion that is resolved it loses far less energy than the tolerance. An undamped linear system gets Gauss' nodes (order
12), which keep its energy to rounding, whatever the step.
"""

from __future__ import annotations

from dataclasses import dataclass
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
from shaftwork.integrate.crossings import Crossings
from shaftwork.integrate.engines import ENGINES
from shaftwork.integrate.problem import Array, Problem, Trajectory
from shaftwork.integrate.smooth_intervals import (
    Pace,
    SmoothInterval,
    both_sides,
    check_finite,
    failure,
    pieces,
    start_of_piece,
    used_up,
)
from shaftwork.numerics.tolerances import SAME

STAGES = 6
# A step grows at least by the first factor, because its factors are made anew, and at most by the second.
WORTH, GROW = 1.5, 8.0
SAFETY, SHRINK, NEWTON_SHRINK = 0.9, 0.1, 0.25
# A chain of damped springs has four entries a state at most; matrices of more may fill up.
FEW_ENTRIES = 8


@dataclass(frozen=True)
class _BandedStep:
    """What makes a step again.

    Args:
        piece: number of its piece.
        t: its start, s.
        length: s.
        x: (n,) state at the start.
        rate: (n,) its derivative, or None where it follows from the state without noise.
    """

    piece: int
    t: float
    length: float
    x: Array
    rate: Array | None


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
    run = _BandedMarch(problem)
    with np.errstate(all="ignore"):
        for number, piece in enumerate(run.pieces):
            run.march(number, piece)
    statistics = {"steps": len(run.steps), "rejected": run.rejected, **run.stages.counts}
    if problem.t_eval is not None:
        return Trajectory(np.asarray(problem.t_eval, dtype=float), run.outputs.x, _BandedDense(run), statistics)
    times, states = [], []
    for number, piece in enumerate(run.pieces):
        steps = [step for step in run.steps if step.piece == number]
        times.append(np.array([*(step.t for step in steps), piece.end]))
        states.append(np.array([*(step.x for step in steps), run.ends[number]]))
    return Trajectory(*both_sides(problem, times, states), _BandedDense(run), statistics)


def is_chain(problem: Problem) -> bool:
    """Whether each state is joined to few others, as in chains and trees, so that factors of matrices stay sparse."""
    if problem.straight is None and problem.jacobian is None:
        return False
    matrix = _matrix(problem)
    return bool(matrix.nnz <= FEW_ENTRIES * matrix.shape[0])


def is_undamped(problem: Problem) -> bool:
    """Whether all motions of a passive system keep their energy, by its Jacobian at the start.

    The real parts of its eigenvalues are then zero. None of them is positive where nothing drives, so it is enough that
    their sum, the trace, is zero.
    """
    diagonal = _matrix(problem).diagonal()
    return bool(abs(diagonal.sum()) <= SAME * np.abs(diagonal).sum())


class _Arc:
    """The polynomial of one step."""

    def __init__(self, run: _BandedMarch, start: StepStart, length: float, modes: Array) -> None:
        method = self._method = run.method
        self._stages, self._start, self._length, self._modes = run.stages, start, length, modes
        # The slope that the system has at the start, where the polynomial need not meet it, less the polynomial's own.
        self.defect = length * start.rate - method.at_start @ modes

    @cached_property
    def end(self) -> Array:
        """State (n,) at the end of the step."""
        return np.asarray(self._start.x + self._method.at_end[0] @ self._modes)

    @cached_property
    def _correction(self) -> Array:
        """The defect of what the step resolves.

        That of a stiff motion is its decay times the error of the state at the start. The polynomial forgets this
        error, and the bump of the defect would spread it over the step: at a damping ratio of 1e6 the torque would be
        off by 2e-5 of its largest value, where it is by 5e-10.
        """
        return self._stages.quieted(self.defect, self._length, self._start.scale)

    @property
    def rate(self) -> Array:
        """Slope (n,) at the end of the step."""
        return np.asarray(self._method.at_end[1] @ self._modes) / self._length

    def at(self, times: Array) -> Array:
        """States (k, n) at times (k,) of the step, before the next one is tried."""
        theta = (times - self._start.t) / self._length
        states = self._method.increments(theta) @ self._modes
        states += np.multiply.outer(self._method.bump(theta), self._correction)
        states += self._start.x
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


class _BandedMarch:
    """The march over the pieces, and what dense output needs of it."""

    def __init__(self, problem: Problem) -> None:
        self.problem, self.pieces = problem, pieces(problem)
        self.method = _method(problem)
        self.stages = BandedStages(problem, _matrix(problem), self.method)
        self.outputs = _Outputs(problem)
        self.steps: list[_BandedStep] = []
        self.ends: list[Array] = []
        self.rejected = 0
        self._rtol, self._pace = max(problem.rtol, ENGINES["banded"].finest), Pace(problem)

    def scale(self, x: Array) -> Array:
        """The tolerance (n,) of each state."""
        return np.maximum(self.problem.atol + self._rtol * np.abs(x), np.finfo(float).tiny)

    def march(self, number: int, piece: SmoothInterval) -> None:
        """Step through one piece."""
        before = self.ends[-1] if self.ends else np.asarray(self.problem.x0, dtype=float)
        start, step = self._open(piece, piece.start, start_of_piece(self.problem, piece, before))
        crossings = Crossings(self.problem, piece)
        while start.t < piece.end:
            self._check(start, step)
            length, end = _fitted(start.t, step, piece.end)
            arc = self.arc(start, length)
            scale = start.scale if arc is None else self.scale(arc.end)
            factor = NEWTON_SHRINK if arc is None else self._factor(arc, np.maximum(start.scale, scale))
            if arc is None or factor < SAFETY:
                step, self.rejected = factor * length, self.rejected + 1
                continue
            cut = crossings.cut(start.t, start.x, end, arc.end, arc.at)
            if cut is not None and cut < end:
                step, self.rejected = cut - start.t, self.rejected + 1
                continue
            if factor > WORTH:
                step = max(step, factor * length)
            self.steps.append(_BandedStep(number, start.t, length, start.x, start.rate if self.stages.noisy else None))
            self.outputs.fill(start.t, end, arc)
            self._finish(end, arc.end, rests=crossings.rests)
            if cut is not None and end < piece.end:
                start, step = self._open(piece, end, arc.end)
                continue
            rate = arc.rate if self.stages.noisy or end == piece.end else self.stages.rate(end, arc.end)
            start = StepStart(end, arc.end, rate, scale)
        self.ends.append(start.x)

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
        return None if modes is None else _Arc(self, start, length, modes)

    def _open(self, piece: SmoothInterval, t: float, x: Array) -> tuple[StepStart, float]:
        """Start anew: from where, and the length of the first step in s."""
        self.outputs.start(t, x)
        self.stages.open(piece)
        start = StepStart(t, x, self.stages.rate(t, x), self.scale(x))
        # At first no state moves by more than its tolerance, over the peak: that step stands, and soon grows.
        speed = self.method.peak * float((np.abs(start.rate) / start.scale).max())
        return start, 1 / speed if speed > 0 else piece.end - t

    def _factor(self, arc: _Arc, scale: Array) -> float:
        """The factor by which the next step may be longer; below `SAFETY` this one was too long."""
        error = self.method.peak * float((np.abs(arc.defect) / scale).max())
        if not np.isfinite(error):
            return SHRINK
        return float(np.clip(SAFETY * max(error, 1e-300) ** (-1 / (self.method.order + 1)), SHRINK, GROW))

    def _check(self, start: StepStart, step: float) -> None:
        """Raise where a run cannot go on."""
        if len(self.steps) + self.rejected >= self.problem.max_steps:
            raise failure(self.problem, "banded", start.t, start.x, used_up(self.problem))
        if not step > 8 * np.spacing(abs(start.t)):
            reason = self.stages.reason("the step became too small")
            raise failure(self.problem, "banded", start.t, start.x, reason)

    def _finish(self, t: float, x: Array, *, rests: bool) -> None:
        check_finite(self.problem, "banded", t, x)
        if (objection := self._pace.objection(t, rests=rests)) is not None:
            raise failure(self.problem, "banded", t, x, objection)


class _BandedDense:
    """The motion at any time, from steps that are made again: their polynomials would fill the memory."""

    def __init__(self, run: _BandedMarch) -> None:
        self._run = run
        self._starts = np.array([step.t for step in run.steps])

    @property
    def steps(self) -> Array:
        return np.array([*self._starts, self._run.problem.t_end])

    def __call__(self, times: Array) -> Array:
        times = np.atleast_1d(np.asarray(times, dtype=float))
        run, opened = self._run, -1
        index = np.clip(np.searchsorted(self._starts, times, side="right") - 1, 0, self._starts.size - 1)
        states = run.steps[0].x[None, :].repeat(times.size, axis=0)
        with np.errstate(all="ignore"):
            for number in np.unique(index):
                step, chosen = run.steps[number], index == number
                if step.piece != opened:
                    opened = step.piece
                    run.stages.open(run.pieces[opened])
                states[chosen] = step.x if (times[chosen] == step.t).all() else self._arc(number).at(times[chosen])
        return states

    def _arc(self, number: int) -> _Arc:
        run, step = self._run, self._run.steps[number]
        follows = number + 1 < len(run.steps) and run.steps[number + 1].piece == step.piece
        end = run.steps[number + 1].x if follows else run.ends[step.piece]
        rate = run.stages.rate(step.t, step.x) if step.rate is None else step.rate
        start = StepStart(step.t, step.x, rate, run.scale(step.x))
        theta = run.method.nodes[:, None]
        # A parabola through what is known of the step leads Newton's method to the same solution.
        expected = theta * step.length * rate + theta**2 * (end - step.x - step.length * rate)
        arc = run.arc(start, step.length, expected)
        if arc is None:
            raise failure(run.problem, "banded", step.t, step.x, "a step could not be repeated for dense output")
        return arc


def _method(problem: Problem) -> ShiftedCollocation:
    """The method that suits a problem."""
    undamped = problem.straight is not None and is_undamped(problem)
    return shifted_collocation("gauss" if undamped else "radau", STAGES)


def _matrix(problem: Problem) -> Any:
    """The Jacobian (n, n) at the start."""
    if problem.straight is not None:
        return problem.straight.A
    if problem.jacobian is None:
        raise ParameterError("The banded engine needs a Jacobian, and this problem has none. Take 'scipy-radau'.")
    return problem.jacobian(pieces(problem)[0].inside(problem.t0), problem.x0)


def _fitted(t: float, step: float, end: float) -> tuple[float, float]:
    """Length and end of the next step: never one that ends just before the piece and leaves a tiny rest."""
    left = end - t
    if step >= left * (1 - 1e-9):
        return left, end
    # Not the difference of two times, whose rounding would have the factors made anew in each step.
    length = min(step, left / 2)
    return length, t + length
