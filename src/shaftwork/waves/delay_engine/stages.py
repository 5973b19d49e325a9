"""The states of a network on one panel, between its delays."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from shaftwork.integrate.problem import Array
from shaftwork.waves.delay_engine.collocation import GAUSS, LEFT, POINTS, RIGHT, STAGES, Scheme
from shaftwork.waves.delay_engine.lines import DelayProblem

# The part of a panel before its first Gauss point, and values at the points to those at both ends.
UNSEEN = (1 + POINTS[0]) / 2
_ENDS = np.column_stack([LEFT[:, 0], RIGHT[:, 0]])
# Increments at the Gauss points to rates there, for a panel of unit length.
_TO_RATES = np.linalg.inv(GAUSS.matrix).T


class CollocationStages:
    """The stage equations X = x0 + length f(X) A^T of one panel, by simplified Newton iteration.

    Args:
        problem: right-hand side, speeds, Jacobian.
        rtol: relative tolerance.
    """

    def __init__(self, problem: DelayProblem, rtol: float) -> None:
        self._problem, self._rtol = problem, rtol
        self._low, self._high = -math.inf, math.inf
        self._jacobian: Any = None
        self._solvers: dict[tuple[int, int, bool], Callable[[Array], Array]] = {}
        self.reason = ""
        self.counts = {"rhs": 0, "jacobians": 0}

    def enter(self, low: float, high: float) -> None:
        """Begin a piece: the system is only evaluated between two times in s."""
        self._low, self._high = low, high

    def solve(
        self, scheme: Scheme, start: float, length: float, x: Array, largest: Array, h: Array, trend: Array
    ) -> tuple[Array, Array] | None:
        """Stages (n, s) of the states and speeds (q, s) of the ends, or None for a `reason`.

        Args:
            scheme: of collocation.
            start: of the panel in s.
            length: of the panel in s.
            x: (n,) state at its start.
            largest: (n,) largest size of the states so far.
            h: (q, s) history torques at the nodes.
            trend: (n,) rates at its start, for a first guess; Newton's method does without.
        """
        times = np.minimum(np.maximum(start + length * scheme.nodes, self._low), self._high)
        stages = self._newton(scheme, times, length, x, largest, h, trend) if x.size else np.empty((0, STAGES))
        return None if stages is None else (stages, self._problem.speeds(times, stages, h))

    def unseen(self, start: float, length: float, x: Array, end: Array, stages: Array, h: Array) -> Array:
        """What may happen to the states (n,) between the ends of a panel and the Gauss points next to them.

        A law may switch there. Then the rates at the end are not those that the Gauss points foretell.

        Args:
            start: of the panel in s.
            length: of the panel in s.
            x: (n,) state at its start.
            end: (n,) state at its end.
            stages: (n, s) states at the Gauss points.
            h: (q, s) history torques there.
        """
        rates = (stages - x[:, None]) @ _TO_RATES / length
        times = np.clip([start, start + length], self._low, self._high)
        slopes = self._problem.rhs(times, np.column_stack([x, end]), h @ _ENDS)
        self.counts["rhs"] += 2
        return np.asarray(np.abs(slopes - rates @ _ENDS).max(axis=1) * length * UNSEEN)

    def _newton(
        self, scheme: Scheme, times: Array, length: float, x: Array, largest: Array, h: Array, trend: Array
    ) -> Array | None:
        problem, start = self._problem, x[:, None]
        stages = start + np.multiply.outer(trend, length * scheme.nodes)
        previous, fresh = math.inf, self._jacobian is None
        for iteration in range(15):
            slopes = problem.rhs(times, stages, h)
            self.counts["rhs"] += STAGES
            residual = stages - start - length * (slopes @ scheme.matrix.T)
            if not math.isfinite(residual.sum()):
                self._name_not_finite(slopes)
                return None
            if self._jacobian is None:
                self._renew(float(times[STAGES // 2]), stages[:, STAGES // 2], h[:, STAGES // 2])
            change = self._solver(scheme, length)(residual.ravel()).reshape(residual.shape)
            stages = stages - change
            if problem.linear:
                return stages
            scale = problem.atol + self._rtol * np.maximum(largest, np.abs(stages).max(axis=1))
            # in parts of what Newton's method may leave, 1e-4 of the tolerance
            size = float((np.abs(change).max(axis=1) / np.maximum(scale, np.finfo(float).tiny)).max()) / 1e-4
            rate = size / previous if previous > 0 else 0.0
            if size <= 1 or (iteration and rate < 0.5 and size * rate <= 1 - rate):
                return stages
            if rate > 0.1 and not fresh:  # a new Jacobian makes steps shrink faster
                self._jacobian, fresh = None, True
            elif rate > 1:
                break
            previous = size
        self._jacobian = None
        self.reason = "Newton's method does not converge"
        return None

    def _name_not_finite(self, slopes: Array) -> None:
        bad = np.flatnonzero(~np.isfinite(slopes).all(axis=1))
        name = self._problem.names[int(bad[0])] if bad.size else "?"
        self.reason = f"the derivative of {name!r} is not finite"

    def _renew(self, time: float, x: Array, h: Array) -> None:
        jacobian = self._problem.jacobian(time, x, h)
        # The inverse of a panel's matrix of 400 rows is cheaper than a sparse factorisation.
        small = x.size * STAGES <= 400
        if sparse.issparse(jacobian):
            jacobian = jacobian.toarray() if small else jacobian
        elif not small:
            jacobian = sparse.csc_array(jacobian)
        self._jacobian = jacobian
        self._solvers.clear()
        self.counts["jacobians"] += 1

    def _solver(self, scheme: Scheme, length: float) -> Callable[[Array], Array]:
        # Lengths that differ by the rounding of the times share their factors.
        fraction, exponent = math.frexp(length)
        key = (round(fraction * 2**36), exponent, scheme is GAUSS)
        solver = self._solvers.get(key)
        if solver is None:
            if len(self._solvers) >= 256:  # panels of as many lengths keep their factors
                self._solvers.clear()
            solver = self._solvers[key] = _factorise(self._jacobian, length * scheme.matrix)
        return solver


def _factorise(jacobian: Any, matrix: Array) -> Callable[[Array], Array]:
    """Solver of (1 - J x matrix) y = r for rows (state, stage) in this order."""
    if sparse.issparse(jacobian):
        whole = sparse.identity(jacobian.shape[0] * STAGES, format="csc") - sparse.kron(jacobian, matrix, format="csc")
        factors = splu(whole)
        return lambda residual: np.asarray(factors.solve(residual))
    inverse = np.linalg.inv(np.eye(len(jacobian) * STAGES) - np.kron(jacobian, matrix))
    return lambda residual: inverse @ residual
