"""Estimation of unknowns by weighted least squares.

Law: the unknowns minimise sum rho(r^2), r = (computed - measured) / deviation, with rho(z) = z or a robust loss.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.optimize import least_squares

from shaftwork.codegen.array_form.elements import Array
from shaftwork.core.errors import ParameterError, SimulationError
from shaftwork.fitting.spreads import LOSSES, Data, degrees, robust_size, spreads
from shaftwork.numerics.tolerances import EPS, EQUAL, TYPED


class Curves(Protocol):
    """What is computed for unknowns, beside what is measured."""

    def values(self, unknowns: Array) -> Array:
        """(N,) computed."""
        ...

    def slopes(self, unknowns: Array) -> Array:
        """(N, m) derivatives of these by the unknowns."""
        ...


@dataclass(frozen=True, eq=False)
class Estimate:
    """Unknowns that fit.

    Covariance, directions, their spreads and the step are in coordinates in which errors are spread evenly on both
    sides: see `spreads`.

    Args:
        unknowns: (m,) values.
        covariance: (m, m); infinite where the data tell nothing.
        freedom: (m,) degrees of freedom of the t-distribution of each; see `Spreads`.
        deviations: (series,) standard deviations of the noise.
        residuals: (N,) computed less measured.
        directions: (m, m) combinations of the unknowns, each a row of length one, the best known first.
        spreads: (m,) standard deviation of each combination.
        step: (m,) from here to where the minimum were without bounds, as far as derivatives tell.
        bounds: (m,) and (m,) of the unknowns.
        at_bounds: (m,) which unknowns ended at one.
        message: why it is no minimum yet; empty where it is one.
        deviance: minus twice the logarithm of the likelihood, but for a constant; a difference counts like one of
            chi^2.
    """

    unknowns: Array
    covariance: Array
    freedom: Array
    deviations: Array
    residuals: Array
    directions: Array
    spreads: Array
    step: Array
    bounds: tuple[Array, Array]
    at_bounds: NDArray[np.bool_]
    message: str
    deviance: float

    def reach(self, level: float) -> Array:
        """(m,) how far an interval of a level goes to either side; infinite where the data tell nothing."""
        known = self.freedom > 0
        quantiles = np.where(known, stats.t.ppf((1 + level) / 2, np.where(known, self.freedom, 1.0)), np.inf)
        return np.asarray(quantiles * self.sizes)

    @property
    def sizes(self) -> Array:
        """(m,) standard deviations."""
        return np.where(self.freedom > 0, np.sqrt(np.diag(self.covariance)), np.inf)

    def alike(self, other: Estimate) -> bool:
        """Whether another is in the same minimum: as deep, and no unknown differs by more than its deviation here."""
        reach = np.fmax(self.sizes, EQUAL)
        near = bool((np.abs(self.unknowns - other.unknowns) <= reach).all())
        return near and abs(self.deviance - other.deviance) < 1


def estimate(
    curves: Curves,
    data: Data,
    start: Array,
    bounds: tuple[Array, Array],
    beginning: tuple[Curves, NDArray[np.bool_]] | None = None,
    effort: tuple[int, int] = (30, 200),
    stretch: Callable[[Array], Array] = np.ones_like,
) -> Estimate:
    """Fit the unknowns, and the deviations of the noise in turn with them where these are not given.

    Args:
        curves: what is computed.
        data: what is measured.
        start: (m,) unknowns to start from.
        bounds: (m,) and (m,) of the unknowns.
        beginning: a part of the curves that is fitted first, and (N,) which values it holds.
        effort: at most so many rounds, and motions in each; deviations and unknowns settle in some five rounds.
        stretch: (m,) derivatives of the unknowns by those coordinates in which errors are spread evenly, see `spreads`.

    Raises:
        ParameterError: there are fewer values than unknowns.
        SimulationError: the motion at the start cannot be computed.
    """
    unknowns, deviations = _begun(curves, data, start, bounds, beginning)
    result, deviations, message = _settled(curves, data, unknowns, deviations, bounds, effort)
    unknowns, at_bounds = result.x, result.active_mask != 0
    residuals, slopes, wide = curves.values(unknowns) - data.measured, curves.slopes(unknowns), stretch(unknowns)
    found = spreads(slopes, residuals, data, deviations, unknowns, wide)
    if data.loss == "linear" and _is_last(found.step, wide, found.covariance) and not at_bounds.any():
        step = found.step * wide
        unknowns, residuals = np.clip(unknowns + step, *bounds), residuals + slopes @ step
    deviance = _deviance(residuals, data, deviations, unknowns)
    told = (found.directions, found.spreads, found.step, bounds, at_bounds)
    return Estimate(unknowns, found.covariance, found.freedom, deviations, residuals, *told, message, deviance)


def _is_last(step: Array, stretch: Array, covariance: Array) -> bool:
    """Whether derivatives that are there already tell a small step to the minimum."""
    return bool((np.abs(step) <= 1e-4 * np.sqrt(np.diag(covariance))).all() and (np.abs(step * stretch) < 0.01).all())


def _deviance(residuals: Array, data: Data, deviations: Array, unknowns: Array) -> float:
    rho, _, _ = LOSSES[data.loss]((residuals / deviations[data.series]) ** 2)
    return float(rho.sum() + 2 * data.counts @ np.log(deviations) + (data.pull(unknowns) ** 2).sum())


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
    deviations = _noise(residuals, data, data.counts) if data.deviations is None else data.deviations
    if beginning is None or not beginning[1].any():
        return start, deviations
    unknowns = _led(curves, data, deviations, start, bounds, *beginning)
    if data.deviations is None:
        deviations = _noise(curves.values(unknowns) - data.measured, data, data.counts)
    return unknowns, deviations


def _settled(
    curves: Curves, data: Data, unknowns: Array, deviations: Array, bounds: tuple[Array, Array], effort: tuple[int, int]
) -> tuple[Any, Array, str]:
    """Scipy's last result, deviations (series,), and why it is no minimum, if it is none."""
    alone = deviations.size == 1 and data.loss == "linear" and np.isnan(data.priors).all()
    settled, message = data.deviations is not None or alone, ""
    # A ten-thousandth of its deviation is the last step, which derivatives tell to more than that.
    last_gain = 1e-8 / data.measured.size
    rounds, motions = effort
    for _ in range(rounds):
        # While the deviations change, the minimum moves with them.
        gain = last_gain if settled else 1e-5
        last, result = settled, _fitted(curves, data, deviations, unknowns, bounds, gain, motions)
        message = "" if result.status > 0 else str(result.message).rstrip(".")
        unknowns = result.x
        if data.deviations is None:
            residuals, before = result.fun[: data.measured.size] * deviations[data.series], deviations
            deviations = _noise(residuals, data, degrees(curves.slopes(unknowns), data, before))
            settled = alone or bool((np.abs(deviations - before) <= 1e-4 * deviations).all())
        if settled and last:
            return result, deviations, message
    return result, deviations, message or f"the noise has not settled in {rounds} rounds"


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


def _noise(residuals: Array, data: Data, freedom: Array) -> Array:
    """(series,) standard deviations of the noise from what is left, with degrees of freedom (series,).

    Where these are none it is the size of what is left.
    """
    count = len(data.counts)
    if data.loss != "linear":
        sizes = np.array([robust_size(residuals[data.series == k], freedom[k]) for k in range(count)])
    else:
        sizes = np.sqrt(np.bincount(data.series, residuals**2) / np.where(freedom > EQUAL, freedom, data.counts))
    heights = np.array([np.abs(data.measured[data.series == k]).max() for k in range(count)])
    # A record without noise is fitted to rounding; one of zeros has no size.
    return np.asarray(np.maximum(sizes, 1e-12 * np.where(heights > 0, heights, 1.0)))


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
