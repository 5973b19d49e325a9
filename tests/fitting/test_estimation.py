"""Least squares of straight lines, for which everything is known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from shaftwork.fitting.estimation import estimate
from shaftwork.fitting.spreads import LOSSES, Data

Array = NDArray[np.float64]
ANYWHERE = (np.full(2, -np.inf), np.full(2, np.inf))


class Line:
    """y = a + b x."""

    def __init__(self, x: Array) -> None:
        self._columns = np.column_stack([np.ones_like(x), x])

    def values(self, unknowns: Array) -> Array:
        return np.asarray(self._columns @ unknowns)

    def slopes(self, _: Array) -> Array:
        return self._columns


def data(measured: Array, deviations: Array | None = None, loss: str = "linear", prior: float = np.nan) -> Data:
    return Data(
        measured,
        np.zeros(measured.size, dtype=np.intp),
        deviations,
        np.array([np.nan, prior]),
        np.array([np.nan, 0.5]),
        loss,
    )


def test_a_line_and_its_covariance_are_those_of_linear_regression() -> None:
    x = np.linspace(0.0, 1.0, 40)
    y = 1.0 + 2.0 * x + np.random.default_rng(0).normal(0.0, 0.1, x.size)
    found = estimate(Line(x), data(y), np.zeros(2), ANYWHERE)
    (b, a), covariance = np.polyfit(x, y, 1, cov=True)
    assert found.unknowns == pytest.approx([a, b], rel=1e-8)
    assert found.covariance == pytest.approx(covariance[::-1, ::-1], rel=1e-6)  # polyfit has the slope first


def test_deviations_that_are_given_count_as_they_are() -> None:
    x = np.linspace(0.0, 1.0, 40)
    found = estimate(Line(x), data(1.0 + 2.0 * x, np.array([0.3])), np.zeros(2), ANYWHERE)
    columns = np.column_stack([np.ones_like(x), x])
    assert found.covariance == pytest.approx(0.09 * np.linalg.inv(columns.T @ columns), rel=1e-9)


def test_a_prior_is_one_more_measurement() -> None:
    x = np.linspace(0.0, 1.0, 5)
    y, deviation = 1.0 + 2.0 * x, 0.2
    found = estimate(Line(x), data(y, np.array([deviation]), prior=3.0), np.zeros(2), ANYWHERE)
    rows = np.vstack([np.column_stack([np.ones_like(x), x]) / deviation, [0.0, 1 / 0.5]])
    expected, *_ = np.linalg.lstsq(rows, np.append(y / deviation, 3.0 / 0.5), rcond=None)
    assert found.unknowns == pytest.approx(expected, rel=1e-8)
    assert found.covariance == pytest.approx(np.linalg.inv(rows.T @ rows), rel=1e-8)


@pytest.mark.parametrize("loss", [name for name in LOSSES if name != "linear"])
def test_a_robust_line_does_not_follow_outliers(loss: str) -> None:
    x, rng = np.linspace(0.0, 1.0, 200), np.random.default_rng(1)
    y = 1.0 + 2.0 * x + rng.normal(0.0, 0.05, x.size)
    y[rng.choice(x.size, 20, replace=False)] += 3.0
    found = estimate(Line(x), data(y, loss=loss), np.zeros(2), ANYWHERE)
    plain = estimate(Line(x), data(y), np.zeros(2), ANYWHERE)
    assert np.abs(plain.unknowns - [1.0, 2.0]).max() > 0.2
    assert np.abs(found.unknowns - [1.0, 2.0]).max() < 0.06
    assert found.deviations[0] == pytest.approx(0.05, rel=0.3)


@pytest.mark.parametrize("loss", LOSSES)
def test_a_loss_has_the_derivatives_that_it_says(loss: str) -> None:
    z, step = np.array([1e-3, 0.3, 0.9, 1.4, 7.0]), 1e-6
    rho, first, second = LOSSES[loss](z)
    high, low = LOSSES[loss](z + step * z), LOSSES[loss](z - step * z)
    assert (high[0] - low[0]) / (2 * step * z) == pytest.approx(
        first, rel=1e-6
    )  # cancellation: 1e-16 over a step of 1e-9
    assert (high[1] - low[1]) / (2 * step * z) == pytest.approx(second, rel=1e-6, abs=1e-9)
    assert rho[0] == pytest.approx(z[0], rel=1e-3)  # small ones count as squares do


def test_what_the_data_cannot_tell_is_a_direction_of_infinite_spread() -> None:
    x = np.zeros(10)  # all at one place: only a is seen
    found = estimate(Line(x), data(np.full(10, 4.0), np.array([1.0])), np.zeros(2), ANYWHERE)
    assert found.spreads[0] == pytest.approx(10**-0.5)
    assert np.isinf(found.spreads[1])
    assert np.abs(found.directions[1]) == pytest.approx([0.0, 1.0])
    assert np.isinf(found.covariance[1, 1])
    assert found.covariance[0, 0] == pytest.approx(0.1)


@pytest.mark.parametrize("loss", LOSSES)
def test_intervals_of_every_loss_are_as_wide_as_estimates_spread(loss: str) -> None:
    x, slopes, stated = np.linspace(0.0, 1.0, 100), [], []
    for seed in range(200):
        y = 1.0 + 2.0 * x + np.random.default_rng(seed).normal(0.0, 0.1, x.size)
        found = estimate(Line(x), data(y, loss=loss), np.array([1.0, 2.0]), ANYWHERE)
        slopes.append(found.unknowns[1])
        stated.append(found.covariance[1, 1] ** 0.5)
    # the deviation of 200 values is known to 5 percent
    assert np.mean(stated) == pytest.approx(np.std(slopes), rel=0.12)


def shares_inside(x: Array, loss: str, records: int, deviations: Array | None = None) -> float:
    """The share of records of a line whose 95 percent interval of the slope holds the true one."""
    inside = 0
    for seed in range(records):
        y = 1.0 + 2.0 * x + np.random.default_rng(seed).normal(0.0, 0.1, x.size)
        found = estimate(Line(x), data(y, deviations, loss), np.zeros(2), ANYWHERE)
        inside += abs(found.unknowns[1] - 2.0) <= found.reach(0.95)[1]
    return inside / records


@pytest.mark.parametrize(
    ("count", "loss", "sigma"), [(3, "linear", False), (6, "linear", False), (6, "linear", True), (50, "huber", False)]
)
def test_intervals_hold_the_true_value_in_95_of_100_records(count: int, loss: str, sigma: bool) -> None:  # noqa: FBT001
    share = shares_inside(np.linspace(0.0, 1.0, count), loss, 600, np.array([0.1]) if sigma else None)
    assert 0.92 < share < 0.98  # 600 records tell it to 0.009; normal quantiles of six values are right in 0.88


class TwoLines:
    """Two levels, each of a series of its own."""

    def __init__(self, counts: tuple[int, int]) -> None:
        self._columns = np.repeat(np.eye(2), counts, axis=0)

    def values(self, unknowns: Array) -> Array:
        return np.asarray(self._columns @ unknowns)

    def slopes(self, _: Array) -> Array:
        return self._columns


def test_what_a_short_series_tells_alone_has_the_degrees_of_freedom_of_that() -> None:
    none, y = np.full(2, np.nan), np.random.default_rng(0).normal(0.0, 0.1, 54)
    measured = Data(y, np.repeat([0, 1], [50, 4]), None, none, none, "linear")
    found = estimate(TwoLines((50, 4)), measured, np.zeros(2), ANYWHERE)
    assert found.freedom == pytest.approx([49.0, 3.0], rel=1e-9)
    expected = [stats.t.ppf(0.975, part.size - 1) * part.std(ddof=1) / part.size**0.5 for part in (y[:50], y[50:])]
    assert found.reach(0.95) == pytest.approx(expected, rel=1e-3)  # deviations settle to 1e-4


def test_as_many_values_as_unknowns_tell_no_noise() -> None:
    x = np.array([0.0, 1.0])
    found = estimate(Line(x), data(1.0 + 2.0 * x), np.zeros(2), ANYWHERE)
    assert found.unknowns == pytest.approx([1.0, 2.0], rel=1e-9)
    assert np.isinf(found.reach(0.95)).all()


def test_a_value_that_is_given_nearly_exactly_leaves_the_other_as_well_known_as_it_is() -> None:
    x = np.linspace(0.0, 1.0, 20)
    exact = Data(1.0 + 2.0 * x, np.zeros(20, dtype=np.intp), np.array([0.1]), np.array([1.0, np.nan]),
                 np.array([1e-9, np.nan]), "linear")  # fmt: skip
    found = estimate(Line(x), exact, np.zeros(2), ANYWHERE)
    assert found.sizes[1] == pytest.approx(0.1 / np.linalg.norm(x), rel=1e-6)


class Restless:
    """A mean that scatters anew whenever it is computed."""

    def __init__(self) -> None:
        self._rng = np.random.default_rng(0)

    def values(self, unknowns: Array) -> Array:
        return unknowns[0] + self._rng.normal(0.0, 1.0, 20)

    def slopes(self, _: Array) -> Array:
        return np.ones((20, 1))


def test_a_fit_that_does_not_settle_says_so() -> None:
    none, series = np.full(1, np.nan), np.repeat([0, 1], 10)
    restless = Data(np.zeros(20), series, None, none, none, "linear")
    ended = estimate(Restless(), restless, np.zeros(1), (np.full(1, -np.inf), np.full(1, np.inf)))
    assert "has not settled" in ended.message
