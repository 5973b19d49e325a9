"""Estimation of unknowns by weighted least squares: values, covariance, and what the data cannot tell.

Law: the unknowns minimise sum rho(r^2), r = (computed - measured) / deviation, with rho(z) = z or a robust loss. With
the Jacobian J of r their covariance is (J^T J)^-1. Of a robust loss with psi = rho'(r^2) r it is
B^-1 (J^T psi psi^T J) B^-1,
with B = J^T J times the mean of the derivative of psi. Source: Huber and Ronchetti, Robust Statistics, 2009.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from shaftwork.codegen.array_form.elements import Array
from shaftwork.core.errors import ParameterError, SimulationError
from shaftwork.numerics.tolerances import EQUAL, TYPED

LOSSES: dict[str, Callable[[Array], tuple[Array, Array, Array]]] = {
    "linear": lambda z: (z, np.ones_like(z), np.zeros_like(z)),
    "soft_l1": lambda z: (2 * (np.sqrt(1 + z) - 1), (1 + z) ** -0.5, -0.5 * (1 + z) ** -1.5),
    "huber": lambda z: (
        np.where(z <= 1, z, 2 * np.sqrt(z) - 1),
        np.where(z <= 1, 1.0, np.maximum(z, 1.0) ** -0.5),
        np.where(z <= 1, 0.0, -0.5 * np.maximum(z, 1.0) ** -1.5),
    ),
    "cauchy": lambda z: (np.log1p(z), 1 / (1 + z), -1 / (1 + z) ** 2),
}
"""By name, rho, rho' and rho'' of z = r^2."""


class Curves(Protocol):
    """What is computed for unknowns, beside what is measured."""

    def values(self, unknowns: Array) -> Array:
        """(N,) computed."""
        ...

    def slopes(self, unknowns: Array) -> Array:
        """(N, m) derivatives of these by the unknowns."""
        ...


@dataclass(frozen=True, eq=False)
class Data:
    """What is measured.

    Args:
        measured: (N,) values.
        series: (N,) the number of the series that each belongs to.
        deviations: (series,) standard deviations of the noise; None to estimate them.
        priors: (m,) values expected of the unknowns; NaN where nothing is.
        prior_deviations: (m,) their standard deviations.
        loss: a name of `LOSSES`.
    """

    measured: Array
    series: NDArray[np.intp]
    deviations: Array | None
    priors: Array
    prior_deviations: Array
    loss: str

    @property
    def counts(self) -> Array:
        """(series,) values of each."""
        return np.bincount(self.series).astype(float)


@dataclass(frozen=True, eq=False)
class Estimate:
    """Unknowns that fit.

    Args:
        unknowns: (m,) values.
        covariance: (m, m); infinite where the data tell nothing.
        deviations: (series,) standard deviations of the noise.
        residuals: (N,) computed less measured.
        directions: (m, m) combinations of the unknowns, each a row of length one, the best known first.
        spreads: (m,) standard deviation of each combination.
        at_bounds: (m,) which unknowns ended at a bound.
        evaluations: motions computed.
        message: why it is no minimum yet; empty where it is one.
    """

    unknowns: Array
    covariance: Array
    deviations: Array
    residuals: Array
    directions: Array
    spreads: Array
    at_bounds: NDArray[np.bool_]
    evaluations: int
    message: str


def estimate(curves: Curves, data: Data, start: Array, bounds: tuple[Array, Array]) -> Estimate:
    """Fit the unknowns, and the deviations of the noise in turn with them where these are not given.

    Raises:
        ParameterError: there are fewer values than unknowns.
        SimulationError: the motion at the start cannot be computed.
    """
    if data.measured.size < start.size:
        raise ParameterError(
            f"The record has {data.measured.size} values for {start.size} unknowns. Give more, or fewer unknowns."
        )
    unknowns, evaluations, message = start, 0, ""
    deviations = data.deviations
    residuals = curves.values(start) - data.measured
    if not np.isfinite(residuals).all():
        raise SimulationError("At the start values the motion has no finite values. Start from other values.")
    weights = _noise(residuals, data, 0) if deviations is None else deviations
    rounds = 30  # deviations and unknowns settle in some five
    for _ in range(rounds):
        result = _fitted(curves, data, weights, unknowns, bounds)
        evaluations += int(result.nfev)
        message = "" if result.status > 0 else str(result.message).rstrip(".")
        unknowns, residuals = result.x, curves.values(result.x) - data.measured
        if deviations is not None:
            break
        before, weights = weights, _noise(residuals, data, unknowns.size)
        alone = weights.size == 1 and data.loss == "linear" and np.isnan(data.priors).all()
        if alone or (np.abs(weights - before) <= 1e-3 * weights).all():
            break
    else:
        message = message or f"the noise has not settled in {rounds} rounds"
    at_bounds = result.active_mask != 0
    covariance, directions, spreads = _spread(curves.slopes(unknowns), residuals, data, weights, at_bounds)
    return Estimate(unknowns, covariance, weights, residuals, directions, spreads, at_bounds, evaluations, message)


def _noise(residuals: Array, data: Data, unknowns: int) -> Array:
    """(series,) standard deviations of the noise from what is left."""
    count = len(data.counts)
    if data.loss != "linear":  # the median of a normal distribution's sizes is 0.6745 of its deviation
        sizes = [np.median(np.abs(residuals[data.series == k])) / 0.6745 for k in range(count)]
    else:
        freedom = np.maximum(data.counts * (1 - unknowns / data.measured.size), 1.0)
        sizes = np.sqrt(np.bincount(data.series, residuals**2) / freedom).tolist()
    heights = [np.abs(data.measured[data.series == k]).max() for k in range(count)]
    # A record without noise is fitted to rounding.
    return np.maximum(sizes, 1e-12 * np.maximum(heights, np.finfo(float).tiny))


def _fitted(curves: Curves, data: Data, deviations: Array, start: Array, bounds: tuple[Array, Array]) -> Any:
    """Scipy's result; its cost counts priors without a loss."""
    scale, expected = 1 / deviations[data.series], ~np.isnan(data.priors)
    apart = np.eye(start.size)[expected] / data.prior_deviations[expected, None]

    def away(unknowns: Array) -> Array:
        beside = (unknowns - data.priors)[expected] / data.prior_deviations[expected]
        return np.concatenate([(curves.values(unknowns) - data.measured) * scale, beside])

    def slopes(unknowns: Array) -> Array:
        return np.vstack([curves.slopes(unknowns) * scale[:, None], apart])

    def loss(z: Array) -> Array:
        rho = np.array(LOSSES["linear"](z))
        rho[:, : scale.size] = LOSSES[data.loss](z[: scale.size])
        return rho

    return least_squares(
        away,
        start,
        slopes,
        bounds,
        loss="linear" if data.loss == "linear" else loss,
        x_scale="jac",
        xtol=EQUAL,
        ftol=TYPED,
        gtol=None,
        max_nfev=200,
    )


def _spread(
    slopes: Array, residuals: Array, data: Data, deviations: Array, fixed: NDArray[np.bool_]
) -> tuple[Array, Array, Array]:
    """Covariance, and combinations of the unknowns with their standard deviations; what is at a bound stays there."""
    free = np.flatnonzero(~fixed)
    J, away = slopes[:, free] / deviations[data.series, None], residuals / deviations[data.series]
    _, weight, bend = LOSSES[data.loss](away**2)
    steepness = np.bincount(data.series, weight + 2 * away**2 * bend) / data.counts
    expected = np.where(np.isnan(data.priors), 0.0, 1 / data.prior_deviations)
    apart = np.diag(expected)[:, free]
    _, sizes, rows = np.linalg.svd(
        np.vstack([J * np.sqrt(steepness[data.series])[:, None], apart]), full_matrices=False
    )
    seen = sizes > EQUAL * sizes.max(initial=0.0)  # below, it is an error of the derivatives
    spreads = np.where(seen, 1 / np.where(seen, sizes, 1.0), np.inf)
    inverse = (rows[seen].T * spreads[seen] ** 2) @ rows[seen]
    within = inverse
    if data.loss != "linear":
        pull = J * (weight * away)[:, None]
        within = inverse @ (pull.T @ pull + apart.T @ apart) @ inverse
    hidden = np.flatnonzero((np.abs(rows[~seen]) > EQUAL).any(axis=0))
    within[hidden, hidden] = np.inf
    covariance = np.full((fixed.size, fixed.size), np.nan)
    covariance[np.ix_(free, free)] = within
    directions = np.zeros((free.size, fixed.size))
    directions[:, free] = rows
    return covariance, directions, spreads
