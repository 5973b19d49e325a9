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
from shaftwork.numerics.tolerances import EPS, EQUAL, TYPED

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
        evaluations: motions computed over the whole record.
        message: why it is no minimum yet; empty where it is one.
        misfit: minus twice the logarithm of the likelihood, but for a constant; a difference counts like one of chi^2.
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
    misfit: float

    def alike(self, other: Estimate) -> bool:
        """Whether another is in the same minimum: no unknown differs by more than its standard deviation here."""
        reach = np.fmax(np.sqrt(np.diag(self.covariance)), EQUAL)
        return bool((np.abs(self.unknowns - other.unknowns) <= reach).all())


def estimate(
    curves: Curves,
    data: Data,
    start: Array,
    bounds: tuple[Array, Array],
    beginning: tuple[Curves, NDArray[np.bool_]] | None = None,
    effort: tuple[int, int] = (30, 200),
) -> Estimate:
    """Fit the unknowns, and the deviations of the noise in turn with them where these are not given.

    Args:
        curves: what is computed.
        data: what is measured.
        start: (m,) unknowns to start from.
        bounds: (m,) and (m,) of the unknowns.
        beginning: a part of the curves that is fitted first, and (N,) which values it holds.
        effort: at most so many rounds, and motions in each; deviations and unknowns settle in some five rounds.

    Raises:
        ParameterError: there are fewer values than unknowns.
        SimulationError: the motion at the start cannot be computed.
    """
    unknowns, weights = _begun(curves, data, start, bounds, beginning)
    result, weights, evaluations, message = _settled(curves, data, unknowns, weights, bounds, effort)
    unknowns, residuals = result.x, curves.values(result.x) - data.measured
    at_bounds, slopes = result.active_mask != 0, curves.slopes(unknowns)
    covariance, directions, spreads = _spread(slopes, residuals, data, weights, at_bounds)
    if data.loss == "linear" and np.isfinite(covariance).all():
        step = _last_step(slopes, residuals, data, weights, covariance, unknowns)
        unknowns, residuals = np.clip(unknowns + step, *bounds), residuals + slopes @ step
    fit = _misfit(residuals, data, weights, unknowns)
    return Estimate(unknowns, covariance, weights, residuals, directions, spreads, at_bounds, evaluations, message, fit)


def _misfit(residuals: Array, data: Data, deviations: Array, unknowns: Array) -> float:
    rho, _, _ = LOSSES[data.loss]((residuals / deviations[data.series]) ** 2)
    beside = np.nansum(((unknowns - data.priors) / data.prior_deviations) ** 2)
    return float(rho.sum() + 2 * data.counts @ np.log(deviations) + beside)


def _begun(
    curves: Curves,
    data: Data,
    start: Array,
    bounds: tuple[Array, Array],
    beginning: tuple[Curves, NDArray[np.bool_]] | None,
) -> tuple[Array, Array]:
    """The unknowns (m,) with which the whole is fitted first, and deviations (series,) of the noise there."""
    if data.measured.size < start.size:
        raise ParameterError(
            f"The record has {data.measured.size} values for {start.size} unknowns. Give more, or fewer unknowns."
        )
    residuals = curves.values(start) - data.measured
    if not np.isfinite(residuals).all():
        raise SimulationError("At the start values the motion has no finite values. Start from other values.")
    weights = _noise(residuals, data, 0) if data.deviations is None else data.deviations
    if beginning is None or not beginning[1].any():
        return start, weights
    unknowns = _led(curves, data, weights, start, bounds, *beginning)
    return unknowns, _noise(curves.values(unknowns) - data.measured, data, 0) if data.deviations is None else weights


def _settled(
    curves: Curves, data: Data, unknowns: Array, weights: Array, bounds: tuple[Array, Array], effort: tuple[int, int]
) -> tuple[Any, Array, int, str]:
    """Scipy's last result, deviations (series,), motions computed, and why it is no minimum, if it is none."""
    alone = weights.size == 1 and data.loss == "linear" and np.isnan(data.priors).all()
    settled, evaluations, message = data.deviations is not None or alone, 0, ""
    # A ten-thousandth of its deviation is the last step, which derivatives tell to more than that.
    last_gain = 1e-8 / data.measured.size
    rounds, motions = effort
    for _ in range(rounds):
        # While the deviations change, the minimum moves with them.
        gain = last_gain if settled else 1e-5
        last, result = settled, _fitted(curves, data, weights, unknowns, bounds, gain, motions)
        evaluations += int(result.nfev)
        message = "" if result.status > 0 else str(result.message).rstrip(".")
        unknowns = result.x
        if data.deviations is None:
            residuals = result.fun[: data.measured.size] * weights[data.series]
            before, weights = weights, _noise(residuals, data, unknowns.size)
            settled = alone or bool((np.abs(weights - before) <= 1e-4 * weights).all())
        if settled and last:
            return result, weights, evaluations, message
    return result, weights, evaluations, message or f"the noise has not settled in {rounds} rounds"


def _last_step(
    slopes: Array, residuals: Array, data: Data, deviations: Array, covariance: Array, unknowns: Array
) -> Array:
    """(m,) to the minimum, as far as derivatives that are there already tell; zero where it is no small step."""
    pull = np.where(np.isnan(data.priors), 0.0, (unknowns - data.priors) / data.prior_deviations**2)
    step = -covariance @ (slopes.T @ (residuals / deviations[data.series] ** 2) + pull)
    return step * (np.abs(step) <= 1e-4 * np.sqrt(np.diag(covariance))).all()


def _led(
    curves: Curves,
    data: Data,
    deviations: Array,
    start: Array,
    bounds: tuple[Array, Array],
    part: Curves,
    rows: NDArray[np.bool_],
) -> Array:
    """(m,) the unknowns that fit a part of the record, if they fit the whole better than the start does.

    What the part does not tell stays near the start, within some 30 percent, or near its prior.
    """
    expected = np.where(np.isnan(data.priors), start, data.priors)
    spreads = np.where(np.isnan(data.priors), 0.3, data.prior_deviations)
    measured, series = data.measured[rows], data.series[rows]
    within = Data(measured, series, deviations, expected, spreads, data.loss)
    nearer = np.asarray(_fitted(part, within, deviations, start, bounds, 1e-2).x)
    far, near = (((curves.values(at) - data.measured) / deviations[data.series]) ** 2 for at in (start, nearer))
    return nearer if near.sum() < far.sum() else start


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


def _fitted(
    curves: Curves,
    data: Data,
    deviations: Array,
    start: Array,
    bounds: tuple[Array, Array],
    gain: float,
    motions: int = 200,
) -> Any:
    """Scipy's result; its cost counts priors without a loss.

    It ends where one more step would lower the cost by less than a part `gain`, or after so many motions.
    """
    scale, expected = 1 / deviations[data.series], ~np.isnan(data.priors)
    apart = np.eye(start.size)[expected] / data.prior_deviations[expected, None]

    def away(unknowns: Array) -> Array:
        beside = (unknowns - data.priors)[expected] / data.prior_deviations[expected]
        return np.concatenate([(curves.values(unknowns) - data.measured) * scale, beside])

    def slopes(unknowns: Array) -> Array:
        J, r = np.vstack([curves.slopes(unknowns) * scale[:, None], apart]), away(unknowns)
        Q, R = np.linalg.qr(J)
        lower = Q.T @ r
        if data.loss == "linear" and lower @ lower <= gain * (r @ r) and np.linalg.cond(R) < 1 / EQUAL:
            end = unknowns - np.linalg.solve(R, lower)
            if (bounds[0] < end).all() and (end < bounds[1]).all():
                return np.zeros_like(J)  # which tells scipy that this is the minimum
        return J

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
        ftol=max(gain, TYPED),
        gtol=EPS,
        max_nfev=motions,
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
