"""Collocation with complex shifts, and its stage equations: at once where linear, else by Newton's method."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, Literal

import numpy as np
from numpy.polynomial import legendre
from scipy import sparse

from shaftwork.integrate.collocation.shifted_matrix import Complex, ShiftedMatrix, Solver
from shaftwork.integrate.problem import Array, LinearInputs, Problem
from shaftwork.integrate.smooth_intervals import GuardedFunctions, SmoothInterval
from shaftwork.numerics.polynomials import legendre_integrals, radau_nodes, to_integrals, to_legendre

Family = Literal["radau", "gauss"]


@dataclass(frozen=True, eq=False)
class ShiftedCollocation:
    """A polynomial u of degree s whose slope meets x' = f(t, x) at s nodes of the step.

    Law: the stage increments Z of one step h solve (1/h) A^-1 Z = f(x + Z). With the eigenvectors T of A^-1 and Z = T W
    this falls apart, for the linear part J of f, into (pole / h - J) W = T^-1 (f - J Z), one equation for each pole.
    The poles are conjugate pairs, so p = s / 2 of them do. The "modes" (s, n) are the real parts of these W above
    their imaginary parts.

    Args:
        nodes: (s,) inside [0, 1].
        poles: (p,) eigenvalues of A^-1 with positive imaginary part.
        to_modes: (s, s) the modes of values at the nodes, by the rows of T^-1.
        turn: (s, s) the modes, each times its pole.
        spread: (s, s) Legendre coefficients of h u' from the modes.
        nodal: (s + 1,) Legendre coefficients of the polynomial that vanishes at the nodes and is 1 at the start.

    Source: Hairer and Wanner, Solving Ordinary Differential Equations II, 1996, sections IV.5 and IV.8.
    """

    nodes: Array
    poles: Complex
    to_modes: Array
    turn: Array
    spread: Array
    nodal: Array

    @property
    def order(self) -> int:
        """Order of u inside the step; the ends of the steps are of about twice that."""
        return self.nodes.size

    def increments(self, theta: Any) -> Array:
        """(k, s) what the modes add to the state at parts theta (k,) of the step."""
        return legendre_integrals(self.spread, _centred(theta)) / 2

    def slopes(self, theta: Any) -> Array:
        """(k, s) the slope h u' from the modes at parts theta (k,) of the step."""
        return np.asarray(legendre.legvander(_centred(theta), self.order - 1) @ self.spread)

    def bump(self, theta: Any) -> Array:
        """(k,) the shape of the leading error of u for a defect of 1 in h u' at the start of the step.

        Added to u it gives one order more and, with Radau's nodes, a slope without jumps between the steps.
        """
        return legendre_integrals(self.nodal[:, None], _centred(theta))[:, 0] / 2

    @cached_property
    def quieting(self) -> complex:
        """The weight w for which F(z) = Re(w / (pole - z)), of the first pole and a real z, is 1 + O(z^2), and O(1/z).

        F(h J) takes stiff parts out of a vector and leaves what a step resolves.
        """
        pole = complex(self.poles[0])
        first, second = 1 / pole, 1 / pole**2
        return complex(*np.linalg.solve([[first.real, -first.imag], [second.real, -second.imag]], [1.0, 0.0]))

    @cached_property
    def peak(self) -> float:
        """Largest value of `bump`, whose slope is zero at the nodes alone."""
        return float(np.abs(self.bump(np.append(self.nodes, 1.0))).max())

    @cached_property
    def at_start(self) -> Array:
        """(s,) the slope h u' from the modes at the start of the step."""
        return np.asarray(self.slopes(0.0)[0])

    @cached_property
    def at_end(self) -> Array:
        """(2, s) what the modes add to the state over the whole step, and the slope h u' at its end."""
        return np.vstack([self.increments(1.0), self.slopes(1.0)])


@lru_cache
def shifted_collocation(family: Family, stages: int) -> ShiftedCollocation:
    """The method of a family with an even number of stages.

    Args:
        family: "radau" (Radau IIA, order 2 s - 1): stiff motions are damped as they should be. "gauss" (order 2 s):
            keeps the energy of an undamped linear motion, and damps nothing.
        stages: s, even.
    """
    nodal = np.zeros(stages + 1)
    nodal[stages] = 1.0
    if family == "radau":
        points, nodal[stages - 1] = radau_nodes(stages), -1.0
    else:
        points = legendre.leggauss(stages)[0]
    poles, vectors = np.linalg.eig(np.linalg.inv(to_integrals(points) / 2))
    upper = np.flatnonzero(poles.imag > 0)
    rows, pole = np.linalg.inv(vectors)[upper], np.diag(poles[upper])
    shapes = to_legendre(points) @ (vectors * poles)[:, upper]
    return ShiftedCollocation(
        nodes=(points + 1) / 2,
        poles=poles[upper],
        to_modes=np.vstack([rows.real, rows.imag]),
        turn=np.block([[pole.real, -pole.imag], [pole.imag, pole.real]]),
        spread=np.hstack([2 * shapes.real, -2 * shapes.imag]),
        nodal=nodal / legendre.legval(-1.0, nodal),
    )


def _centred(theta: Any) -> Array:
    return 2 * np.atleast_1d(np.asarray(theta, dtype=float)) - 1


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
        if step > 3 * length:  # so far a polynomial is continued beyond its step, and no further
            return np.zeros((self._method.order, start.x.size))
        begin = (start.t - t) / length
        weights = self._method.increments(begin + step / length * self._method.nodes) - self._method.increments(begin)
        return np.asarray(weights @ modes)

    def _iterate(self, start: StepStart, step: float, increments: Array) -> Array | None:
        modes = self._method.to_modes @ increments
        # What is known of the contraction from the step before, trusted less and less.
        before, contraction = math.inf, self._contraction**0.8
        for iteration in range(10):
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
            # What is left is below 1e-3 of the tolerance: the error estimate, a difference of slopes, amplifies it.
            if size == 0.0 or (sure and contraction / (1 - contraction) * size < 1e-3):
                self._contraction = max(contraction, float(np.finfo(float).eps))
                # Above this contraction a new Jacobian costs less than the iterations that it saves.
                self._wanted = iteration > 0 and contraction > 0.05
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
