"""How well unknowns are told by data: covariance, degrees of freedom, and combinations that cannot be told.

Law: with the Jacobian J of r = (computed - measured) / deviation the covariance is (J^T J)^-1. Of a robust loss with
psi = rho'(r^2) r it is B^-1 (J^T psi psi^T J) B^-1 n / (n - p), with B = J^T J times the mean of the derivative of psi.
A series of n values has n - p degrees of freedom, p the sum of its leverages; those of an unknown that several series
tell are Satterthwaite's. Source: Huber and Ronchetti, Robust Statistics, 2009; Satterthwaite, Biometrics Bulletin 2
(1946) 110.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shaftwork.codegen.array_form.elements import Array
from shaftwork.numerics.tolerances import EQUAL

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
WITHIN_ONE = 1 - (2 / np.pi) ** 0.5 * np.exp(-0.5)
"""The mean of min(r^2, 1) of a normal distribution of deviation one."""


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

    def pull(self, unknowns: Array) -> Array:
        """(m,) how far unknowns are from their priors, in deviations of these; zero where there is none."""
        return np.where(np.isnan(self.priors), 0.0, (unknowns - self.priors) / self.prior_deviations)

    @property
    def apart(self) -> Array:
        """(m,) derivatives of that."""
        return np.where(np.isnan(self.priors), 0.0, 1 / self.prior_deviations)


class Spreads(NamedTuple):
    """How well unknowns are told.

    Args:
        covariance: (m, m); infinite where the data tell nothing.
        freedom: (m,) degrees of freedom of that; infinite where deviations are given, zero where as many unknowns as
            values leave nothing to tell the noise by.
        directions: (m, m) combinations of the unknowns, each a row of length one, the best known first.
        spreads: (m,) standard deviation of each combination.
        step: (m,) to the minimum, as far as derivatives tell, whatever the bounds.
    """

    covariance: Array
    freedom: Array
    directions: Array
    spreads: Array
    step: Array


def spreads(slopes: Array, residuals: Array, data: Data, deviations: Array, unknowns: Array, stretch: Array) -> Spreads:
    """How well unknowns are told at a minimum.

    Args:
        slopes: (N, m) derivatives of what is computed by the unknowns.
        residuals: (N,) computed less measured.
        data: what is measured.
        deviations: (series,) of the noise.
        unknowns: (m,) at the minimum.
        stretch: (m,) derivatives of the unknowns by those coordinates in which errors are spread evenly on both sides;
            all that is returned is in these.
    """
    J, away = slopes * (stretch / deviations[data.series, None]), residuals / deviations[data.series]
    _, weight, bend = LOSSES[data.loss](away**2)
    steepness = np.bincount(data.series, weight + 2 * away**2 * bend) / data.counts
    apart = np.diag(data.apart * stretch)
    rows = np.vstack([J * np.sqrt(np.maximum(steepness, 0.0))[data.series, None], apart])
    inverse, hidden, directions, sizes = _inverted(rows)
    step = -inverse @ (J.T @ (weight * away) + apart @ data.pull(unknowns))
    free, robust = degrees(slopes, data, deviations), data.loss != "linear"
    with np.errstate(divide="ignore", invalid="ignore"):
        share = weight * away * np.sqrt(data.counts / free)[data.series] if robust else np.ones_like(away)
        gains = inverse @ (J * share[:, None]).T
        parts = np.array([np.bincount(data.series, row) for row in gains**2])
        covariance = gains @ gains.T + inverse @ apart.T @ apart @ inverse
        whole = np.diag(covariance) ** 2
        freedom = whole / np.where(parts > 0, parts**2 / free, 0.0).sum(axis=1)
    if data.deviations is not None:
        freedom[:] = np.inf
    covariance[hidden, hidden] = np.inf
    return Spreads(covariance, np.where(freedom > EQUAL, freedom, 0.0), directions, sizes, step)


def degrees(slopes: Array, data: Data, deviations: Array) -> Array:
    """(series,) degrees of freedom: its values less the sum of their leverages."""
    rows = np.vstack([slopes / deviations[data.series, None], np.diag(data.apart)])
    scaled, _ = _scaled(rows)
    left, sizes, _ = np.linalg.svd(scaled, full_matrices=False)
    leverages = (left[: data.series.size, sizes > EQUAL] ** 2).sum(axis=1)
    return np.maximum(data.counts - np.bincount(data.series, leverages), 0.0)


def robust_size(residuals: Array, freedom: float) -> float:
    """The deviation of noise from residuals (k,) with so many degrees of freedom, of which some may be outliers.

    Law: the sum of min((r / s)^2, 1) is what it is on average without outliers (Huber's proposal 2, of constant one).
    """
    squares = np.sort(residuals**2)
    shares = WITHIN_ONE * freedom - np.arange(squares.size - 1, -1, -1)
    sizes = np.cumsum(squares) / np.where(shares > 0, shares, np.nan)
    fits = sizes <= np.append(squares[1:], np.inf)
    return float(np.sqrt(sizes[np.argmax(fits)])) if fits.any() else 0.0


def _scaled(rows: Array) -> tuple[Array, Array]:
    """Rows (k, m) with columns of length one, and the lengths (m,) that they had."""
    sizes = np.linalg.norm(rows, axis=0)
    sizes = np.where(sizes > 0, sizes, 1.0)
    return rows / sizes, sizes


def _inverted(rows: Array) -> tuple[Array, NDArray[np.bool_], Array, Array]:
    """The inverse (m, m) of rows^T rows in what it tells, (m,) of what it does not, directions and their spreads."""
    scaled, lengths = _scaled(rows)
    _, sizes, V = np.linalg.svd(scaled, full_matrices=False)
    seen = sizes > EQUAL  # below, it is an error of the derivatives
    factor = V[seen].T / sizes[seen] / lengths[:, None]
    basis, _ = np.linalg.qr(np.hstack([(V[~seen] / lengths).T, np.eye(len(lengths))]))
    count = int((~seen).sum())
    unseen, rest = basis[:, :count].T, basis[:, count:]
    _, told, W = np.linalg.svd(rows @ rest, full_matrices=False)
    hidden = (np.abs(unseen) > EQUAL).any(axis=0)
    directions = np.vstack([W @ rest.T, unseen])
    return factor @ factor.T, hidden, directions, np.append(1 / told, np.full(count, np.inf))
