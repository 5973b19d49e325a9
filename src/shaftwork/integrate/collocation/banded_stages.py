"""The stage equations of one collocation step: at once for a linear system, by Newton's method for any other."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from scipy import sparse

from shaftwork.integrate.collocation.banded_matrix import ShiftedMatrix, Solver
from shaftwork.integrate.collocation.banded_method import ShiftedCollocation
from shaftwork.integrate.problem import Array, LinearInputs, Problem
from shaftwork.integrate.smooth_intervals import GuardedFunctions, SmoothInterval

MOST_ITERATIONS = 10
# Newton's method ends at this part of the tolerance: the error estimate, a difference of slopes, amplifies the rest.
NEWTON_SHARE = 1e-3
# Above this contraction a new Jacobian costs less than the iterations that it saves.
SLOW = 0.05
# A polynomial is not continued further than this part of its step.
REACH = 3.0


@dataclass(frozen=True)
class StepStart:
    """Where a step starts.

    Args:
        t: s.
        x: (n,) state.
        rate: (n,) its derivative.
        scale: (n,) the tolerance of each state.
    """

    t: float
    x: Array
    rate: Array
    scale: Array


class BandedStages(Protocol):
    """Solves the stage equations of one step after another."""

    @property
    def counts(self) -> dict[str, int]:
        """What was done so far."""

    @property
    def noisy(self) -> bool:
        """Whether `rate` multiplies what is left of an iteration by the fastest decay; Radau's own slope does not."""

    def open(self, piece: SmoothInterval) -> None:
        """Begin a piece."""

    def rate(self, t: float, x: Array) -> Array:
        """x' (n,)."""

    def modes(self, start: StepStart, step: float, expected: Array | None = None, /) -> Array | None:
        """The modes (s, n) of a step, or None where a shorter one is needed.

        Args:
            start: where it starts.
            step: its length in s.
            expected: (s, n) stage increments that are expected, or None.

        Raises:
            LinAlgError: a matrix is singular.
        """

    def quieted(self, defect: Array, step: float, scale: Array) -> Array:
        """The defect (n,) of the last step, without its stiff parts where these exceed the tolerance (n,)."""

    def reason(self, reason: str) -> str:
        """The reason of a failure, with what is known more of it."""


def shifted(linear: LinearInputs) -> ShiftedMatrix:
    """The matrix of a linear system, arranged once for all runs."""
    return linear.cached("banded", lambda: ShiftedMatrix(linear.A))


class _Factors:
    """The factorisations of pole / h - J for one step length."""

    def __init__(self, method: ShiftedCollocation, matrix: ShiftedMatrix) -> None:
        self._method, self._poles = method, method.poles
        self._matrix = matrix
        self._step = 0.0
        self._solvers: list[Solver] = []
        self.count = 0

    def load(self, matrix: Any) -> None:
        """Take another Jacobian."""
        self._matrix.load(matrix)
        self._step = 0.0

    def solve(self, step: float, right: Array) -> Array:
        """The modes (s, n) for right sides (s, n), real parts above imaginary parts as they are."""
        if step != self._step:
            self._solvers = [self._matrix.factor(pole / step) for pole in self._poles]
            self._step, self.count = step, self.count + 1
        modes, vector = np.empty_like(right), np.empty(right.shape[1], dtype=complex)
        for number, solver in enumerate(self._solvers):
            vector.real, vector.imag = right[number], right[len(self._poles) + number]
            solution = solver(vector)
            modes[number], modes[len(self._poles) + number] = solution.real, solution.imag
        return modes

    def quieted(self, defect: Array, step: float, scale: Array, jacobian: Any) -> Array:
        """F(h J) of a defect (n,), see `ShiftedCollocation.quieting`, by the factors of the last step."""
        if (step * np.abs(jacobian @ defect) <= scale).all():
            return defect
        right = np.asarray(self._method.quieting / step * defect, dtype=np.complex128)
        return np.asarray(self._solvers[0](right).real)


class LinearStages(BandedStages):
    """The stages of x' = A x + u(t), u a straight line in each piece: one solution for each pole.

    Args:
        linear: the system.
        method: the collocation method.
    """

    def __init__(self, linear: LinearInputs, method: ShiftedCollocation) -> None:
        self._matrix = sparse.csr_array(linear.A)
        self._forcing, self._method = linear.forcing, method
        self._factors = _Factors(method, shifted(linear))
        # What a forcing of 1, and of the part of the step that has passed, give to each pole.
        self._of_level = method.to_modes.sum(axis=1)
        self._of_slope = method.to_modes @ method.nodes
        self._piece: tuple[float, Array, Array]

    @property
    def counts(self) -> dict[str, int]:
        return {"factorisations": self._factors.count}

    @property
    def noisy(self) -> bool:
        return False

    def open(self, piece: SmoothInterval) -> None:
        length = piece.high - piece.low  # inside the piece, clear of what jumps at its ends
        early, late = (np.asarray(self._forcing(piece.low + part * length)) for part in (0.25, 0.75))
        slope = (late - early) / (0.5 * length)
        slope[np.abs(slope) * length <= 8 * np.finfo(float).eps * np.abs(early)] = 0.0
        self._piece = piece.low, early - 0.25 * length * slope, slope

    def rate(self, t: float, x: Array) -> Array:
        start, level, slope = self._piece
        return np.asarray(self._matrix @ x + level + (t - start) * slope)

    def modes(self, start: StepStart, step: float, _expected: Array | None = None, /) -> Array | None:
        slope = self._piece[2]
        right = np.multiply.outer(self._of_level, start.rate)
        if slope.any():
            right += np.multiply.outer(self._of_slope, step * slope)
        return self._factors.solve(step, right)

    def quieted(self, defect: Array, step: float, scale: Array) -> Array:
        return self._factors.quieted(defect, step, scale, self._matrix)

    def reason(self, reason: str) -> str:
        return reason


class NewtonStages(BandedStages):
    """The stages of x' = f(t, x) by simplified Newton iterations; Jacobian and factors are kept while they serve.

    Args:
        problem: with a Jacobian.
        matrix: arranged for it.
        method: of Radau's family.
    """

    def __init__(self, problem: Problem, matrix: ShiftedMatrix, method: ShiftedCollocation) -> None:
        self._problem, self._method = problem, method
        self._factors = _Factors(method, matrix)
        self._at_nodes = method.increments(method.nodes)
        self._guard: GuardedFunctions
        self._jacobian: Any = None
        self._last: tuple[float, float, Array] | None = None
        self._wanted = True
        self._contraction = 1.0
        self._rhs = self._jacobians = 0

    @property
    def counts(self) -> dict[str, int]:
        return {"rhs": self._rhs, "jacobians": self._jacobians, "factorisations": self._factors.count}

    @property
    def noisy(self) -> bool:
        return True

    def open(self, piece: SmoothInterval) -> None:
        self._guard = GuardedFunctions(self._problem, piece)
        self._wanted, self._last = True, None

    def rate(self, t: float, x: Array) -> Array:
        self._rhs += 1
        return self._guard.rhs(t, x)

    def modes(self, start: StepStart, step: float, expected: Array | None = None, /) -> Array | None:
        first = self._extrapolated(start, step) if expected is None else expected
        outdated = not self._wanted
        if self._wanted:
            self._load(start)
        modes = self._iterate(start, step, first)
        if modes is None and outdated:
            self._load(start)
            modes = self._iterate(start, step, first)
        if modes is not None:
            self._last = start.t, step, modes
        return modes

    def quieted(self, defect: Array, step: float, scale: Array) -> Array:
        return self._factors.quieted(defect, step, scale, self._jacobian)

    def reason(self, reason: str) -> str:
        return self._guard.reason(reason)

    def _load(self, start: StepStart) -> None:
        self._jacobian = self._guard.jacobian(start.t, start.x)
        self._factors.load(self._jacobian)
        self._jacobians += 1
        self._wanted, self._contraction = False, 1.0

    def _extrapolated(self, start: StepStart, step: float) -> Array:
        """Stage increments (s, n) by the polynomial of the step before, or of a longer one from the same start."""
        t, length, modes = self._last or (start.t, 0.0, start.x)
        if step > REACH * length:
            return np.zeros((self._method.order, start.x.size))
        begin = (start.t - t) / length
        weights = self._method.increments(begin + step / length * self._method.nodes) - self._method.increments(begin)
        return np.asarray(weights @ modes)

    def _iterate(self, start: StepStart, step: float, increments: Array) -> Array | None:
        modes = self._method.to_modes @ increments
        # What is known of the contraction from the step before, trusted less and less.
        before, contraction = math.inf, self._contraction**0.8
        for iteration in range(MOST_ITERATIONS):
            rates = self._rates(start, step, self._at_nodes @ modes)
            if not np.isfinite(rates.sum()):
                return None
            change = self._factors.solve(step, self._method.to_modes @ rates - self._method.turn @ modes / step)
            modes += change
            size = float((np.abs(self._at_nodes @ change).max(axis=0) / start.scale).max())
            if not size < before:
                return None
            if iteration:
                contraction = size / before
            # A first change beyond the tolerance may have led across a kink, which only the next iteration shows.
            sure = contraction < 1.0 and (iteration > 0 or size < 1.0)
            if size == 0.0 or (sure and contraction / (1 - contraction) * size < NEWTON_SHARE):
                self._contraction = max(contraction, float(np.finfo(float).eps))
                self._wanted = iteration > 0 and contraction > SLOW
                return modes
            before = size
        return None

    def _rates(self, start: StepStart, step: float, increments: Array) -> Array:
        """The right-hand side (s, n) at the stages, in place of their increments."""
        self._rhs += len(increments)
        for node, row in zip(self._method.nodes, increments, strict=True):
            row[:] = self._guard.rhs(start.t + node * step, start.x + row)
        return increments
