"""The stage equations of one collocation step: at once for a linear system, by Newton's method for any other."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from shaftwork.integrate.collocation.banded_method import Complex, ShiftedCollocation
from shaftwork.integrate.problem import Array, LinearInputs, Problem
from shaftwork.integrate.smooth_intervals import GuardedFunctions, SmoothInterval

MOST_ITERATIONS = 10
# Newton's method ends at this part of the tolerance: the error estimate, a difference of slopes, amplifies the rest.
NEWTON_SHARE = 1e-3
# Above this contraction a new Jacobian costs less than the iterations that it saves.
SLOW = 0.05
# A polynomial is not continued further than this part of its step.
REACH = 3.0
# Elimination joins the neighbours of a state to each other; a hub of many arms is left in.
MOST_NEIGHBOURS = 4

Solver = Callable[[Complex], Complex]


class ShiftedMatrix:
    """gamma - J for one sparse J after another and any shifts gamma.

    States that only integrate others (the torque of a spring, an angle) are eliminated: with J = [[A, B], [C, 0]] what
    is left is gamma - A - B C / gamma, for a chain of springs a tridiagonal matrix of the speeds alone. That halves the
    time of a long chain, which SuperLU factorises without fill.

    Args:
        matrix: J, scipy.sparse (n, n).
    """

    def __init__(self, matrix: Any) -> None:
        self._pattern: tuple[Any, Any] | None = None
        self.load(matrix)

    def load(self, matrix: Any) -> None:
        """Take another J (n, n) for the shifts to come."""
        matrix = sparse.csr_array(matrix)
        pattern = matrix.indptr, matrix.indices
        if self._pattern is None or not all(map(np.array_equal, self._pattern, pattern)):
            gone = _integrators(matrix)
            self._pattern, self._rest, self._gone = pattern, np.flatnonzero(~gone), np.flatnonzero(gone)
        upper, lower = matrix[self._rest], matrix[self._gone]
        B, C, diagonal = upper[:, self._gone], lower[:, self._rest], np.arange(self._rest.size)
        A, through = sparse.coo_array(upper[:, self._rest]), sparse.coo_array(B @ C)
        # Real parts of A, imaginary parts of B C, and room for the shift: one pattern for all shifts.
        values = np.concatenate([A.data, 1j * through.data, np.zeros(diagonal.size)])
        rows, columns = (np.concatenate([*pair, diagonal]) for pair in ((A.row, through.row), (A.col, through.col)))
        self._left = sparse.csc_matrix((values, (rows, columns)), shape=A.shape)
        self._diagonal = self._left.indices == np.repeat(diagonal, np.diff(self._left.indptr))
        # products with complex vectors would convert them each time
        self._B, self._C = B.astype(complex), C.astype(complex)

    def factor(self, shift: complex) -> Solver:
        """Factorise shift - J; the solver takes and gives complex (n,).

        Raises:
            LinAlgError: the matrix is singular.
        """
        inverse, rest, gone, B, C = 1 / shift, self._rest, self._gone, self._B, self._C
        left, both = self._left.copy(), self._left.data
        left.data = -both.real - inverse * both.imag
        left.data[self._diagonal] += shift
        try:
            inner = splu(left).solve
        except RuntimeError as error:
            raise np.linalg.LinAlgError(str(error)) from error

        def solve(right: Complex) -> Complex:
            second = right[gone]
            solution = np.empty_like(right)
            remaining = solution[rest] = inner(right[rest] + inverse * (B @ second))
            solution[gone] = inverse * (second + C @ remaining)
            return solution

        return solve


def _integrators(matrix: Any) -> Any:
    """States (n,) without an entry of their own that do not read each other, those of few neighbours first."""
    pattern = sparse.csr_array((np.ones(matrix.nnz), matrix.indices, matrix.indptr), shape=matrix.shape)
    both = sparse.csr_array(pattern + pattern.T)
    neighbours = np.diff(both.indptr)
    candidates = np.flatnonzero((both.diagonal() == 0) & (neighbours > 0) & (neighbours <= MOST_NEIGHBOURS))
    starts, indices = both.indptr.tolist(), both.indices.tolist()
    chosen = [False] * both.shape[0]
    for state in candidates[np.argsort(neighbours[candidates], kind="stable")].tolist():
        chosen[state] = not any(chosen[other] for other in indices[starts[state] : starts[state + 1]])
    return np.array(chosen, dtype=bool)


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


class BandedStages:
    """Solves the stage equations of x' = f(t, x), one step after another.

    A linear system x' = A x + u(t) takes one solution for each pole. Any other takes simplified Newton iterations;
    Jacobian and factors are kept while they serve.

    Args:
        problem: with a Jacobian, or linear.
        matrix: the Jacobian (n, n) at the start.
        method: the collocation method; of Radau's family, where the system is not linear.
    """

    def __init__(self, problem: Problem, matrix: Any, method: ShiftedCollocation) -> None:
        self._problem, self._method, self._linear = problem, method, problem.straight
        self._at_nodes = method.increments(method.nodes)
        # What a forcing of 1, and of the part of the step that has passed, give to each pole.
        self._of_level, self._of_slope = method.to_modes.sum(axis=1), method.to_modes @ method.nodes
        self._matrix = _shifted(self._linear) if self._linear is not None else ShiftedMatrix(matrix)
        self._jacobian, self._wanted = sparse.csr_array(matrix), False
        self._factored, self._solvers = 0.0, list[Solver]()
        self._guard: GuardedFunctions
        self._last: tuple[float, float, Array] | None = None
        self._contraction = 1.0
        self.counts = {"rhs": 0, "jacobians": 0, "factorisations": 0}
        """What was done so far."""

    @property
    def noisy(self) -> bool:
        """Whether `rate` multiplies what is left of an iteration by the fastest decay; Radau's own slope does not."""
        return self._linear is None

    def open(self, piece: SmoothInterval) -> None:
        """Begin a piece."""
        self._guard = GuardedFunctions(self._problem, piece)
        self._wanted, self._last = self._linear is None, None
        if self._linear is not None:
            self._since, self._level = piece.low, np.asarray(self._linear.forcing(piece.low))
            self._slope = (np.asarray(self._linear.forcing(piece.high)) - self._level) / (piece.high - piece.low)

    def rate(self, t: float, x: Array) -> Array:
        """x' (n,)."""
        if self._linear is not None:
            return np.asarray(self._jacobian @ x + self._level + (t - self._since) * self._slope)
        self.counts["rhs"] += 1
        return self._guard.rhs(t, x)

    def modes(self, start: StepStart, step: float, expected: Array | None = None) -> Array | None:
        """The modes (s, n) of a step, or None where a shorter one is needed.

        Args:
            start: where it starts.
            step: its length in s.
            expected: (s, n) stage increments that are expected, or None.

        Raises:
            LinAlgError: a matrix is singular.
        """
        if self._linear is not None:  # from the rates at the nodes, were the state there that at the start
            right = np.multiply.outer(self._of_level, start.rate)
            if self._slope.any():
                right += np.multiply.outer(self._of_slope, step * self._slope)
            return self._solve(step, right)
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
        """The defect (n,) of the last step, without its stiff parts where these exceed the tolerance (n,).

        F(h J) of it, see `ShiftedCollocation.quieting`, by the factors of the last step.
        """
        if (step * np.abs(self._jacobian @ defect) <= scale).all():
            return defect
        right = np.asarray(self._method.quieting / step * defect, dtype=np.complex128)
        return np.asarray(self._solvers[0](right).real)

    def reason(self, reason: str) -> str:
        """The reason of a failure, with what is known more of it."""
        return self._guard.reason(reason)

    def _solve(self, step: float, right: Array) -> Array:
        """The modes (s, n) for right sides (s, n), real parts above imaginary parts as they are."""
        poles = self._method.poles
        if step != self._factored:
            self._solvers = [self._matrix.factor(pole / step) for pole in poles]
            self._factored = step
            self.counts["factorisations"] += 1
        modes, vector = np.empty_like(right), np.empty(right.shape[1], dtype=complex)
        for number, solver in enumerate(self._solvers):
            vector.real, vector.imag = right[number], right[len(poles) + number]
            solution = solver(vector)
            modes[number], modes[len(poles) + number] = solution.real, solution.imag
        return modes

    def _load(self, start: StepStart) -> None:
        self._jacobian = self._guard.jacobian(start.t, start.x)
        self._matrix.load(self._jacobian)
        self._factored = 0.0
        self.counts["jacobians"] += 1
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
            change = self._solve(step, self._method.to_modes @ rates - self._method.turn @ modes / step)
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
        self.counts["rhs"] += len(increments)
        for node, row in zip(self._method.nodes, increments, strict=True):
            row[:] = self._guard.rhs(start.t + node * step, start.x + row)
        return increments


def _shifted(linear: LinearInputs) -> ShiftedMatrix:
    """The matrix of a linear system, arranged once for all runs."""
    return linear.cached("banded", lambda: ShiftedMatrix(linear.A))
