"""A motion together with its derivatives by parameters: the forward sensitivity equations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from shaftwork.core.errors import SimulationError
from shaftwork.integrate.problem import Array

TIGHTEST = 1e-13
"""scipy takes no smaller relative tolerance."""


@dataclass(frozen=True, eq=False)
class Forward:
    """A motion and its derivatives.

    Args:
        steps: (s,) ends of the steps, s.
        size: number of states.
        dense: from a time to the states and, behind them, their derivatives by parameters.
    """

    steps: Array
    size: int
    dense: Any

    def states(self, t: float) -> Array:
        """(n,) at a time in s."""
        return np.asarray(self.dense(t)[: self.size])

    def slopes(self, t: float) -> Array:
        """(n, parameters) at a time in s."""
        return np.asarray(self.dense(t)[self.size :].reshape(self.size, -1))


def forward(
    rhs: Callable[[float, Array], Array],
    slopes: Callable[[float, Array], tuple[Array, Array]],
    x0: Array,
    span: tuple[float, float],
    count: int,
    rtol: float,
) -> Forward:
    """Integrate x' = f and S' = (df/dx) S + df/dp with S = 0 at the start.

    The derivatives are held to the same relative tolerance as the states, each column by what it has come to.

    Args:
        rhs: f, from time in s and states (n,).
        slopes: df/dx (n, n) and df/dp (n, count).
        x0: (n,) start states, which do not depend on the parameters.
        span: start and end, s.
        count: number of parameters.
        rtol: relative tolerance.

    Raises:
        SimulationError: the integration failed.
    """
    size = x0.size

    def both(t: float, y: Array) -> Array:
        x, S = y[:size], y[size:].reshape(size, count)
        by_x, by_p = slopes(t, x)
        return np.concatenate([rhs(t, x), (by_x @ S + by_p).ravel()])

    start = np.concatenate([x0, np.zeros(size * count)])
    tolerance = max(rtol, TIGHTEST)
    _, by_p = slopes(span[0], x0)
    # a column that is small in its unit (by a stiffness, say) needs a small absolute tolerance
    sizes = np.abs(by_p).max(axis=0, initial=0.0) * (span[1] - span[0])
    scale = np.where(sizes > 0, sizes, 1.0) * np.ones((size, 1))
    atol = tolerance * 1e-3 * np.concatenate([np.ones(size), np.minimum(scale, 1.0).ravel()])
    found = solve_ivp(both, span, start, method="DOP853", rtol=tolerance, atol=atol, dense_output=True)
    if not found.success:
        raise SimulationError(
            f"The sensitivities could not be integrated beyond t = {found.t[-1]:.9g} s: {found.message}"
        )
    return Forward(found.t, size, found.sol)
