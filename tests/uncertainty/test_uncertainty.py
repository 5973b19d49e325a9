"""Uncertain parameters: distributions and indices that are known in closed form come back within their errors."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

import shaftwork as sw
from shaftwork.studies import uncertainty

Columns = Mapping[str, NDArray[np.float64]]
PI = float(np.pi)


def ishigami(columns: Columns) -> Columns:
    a, b, c = columns.values()
    return {"y": np.sin(a) + 7.0 * np.sin(b) ** 2 + 0.1 * c**4 * np.sin(a)}


def two_motors() -> sw.Network:
    """Its speed after 1 s is (tau_1 + tau_2) / J."""
    net = sw.Network("two motors")
    net.add(sw.TorqueSource("one", tau=0.5), "shaft")
    net.add(sw.TorqueSource("two", tau=1.0), "shaft")
    net.add(sw.Inertia("J", J=2.0), "shaft")
    return net


def test_the_indices_of_ishigamis_function_are_the_known_ones() -> None:
    found = uncertainty(ishigami, dict.fromkeys("abc", (-PI, PI)), method="sobol", samples=4096).indices("y")
    part = 0.1 * PI**4
    by_a, by_b, by_both = 0.5 * (1 + part / 5) ** 2, 49 / 8, 0.01 * PI**8 * (1 / 18 - 1 / 50)
    total = by_a + by_b + by_both
    exact = {
        "S1": {"a": by_a / total, "b": by_b / total, "c": 0.0},
        "ST": {"a": (by_a + by_both) / total, "b": by_b / total, "c": by_both / total},
    }
    for index, by in exact.items():
        for name, value in by.items():
            estimate, half = found[index][name]
            assert abs(estimate - value) < 1.5 * half  # 95 % of six intervals, with one seed
            assert half < 0.06


def test_the_indices_of_a_network_are_the_known_ones() -> None:
    # of a sum of uniform numbers up to 1 and 2, a fifth and four fifths of the variance
    made = uncertainty(
        two_motors(),
        {"one.tau": (0.0, 1.0), "two.tau": (0.0, 2.0)},
        measures=["end J.omega"],
        t_end=1.0,
        method="sobol",
        samples=512,
    )
    for index in ("S1", "ST"):
        for name, value in (("one.tau", 0.2), ("two.tau", 0.8)):
            estimate, half = made.indices("end J.omega")[index][name]
            assert abs(estimate - value) < half
    assert len(made) == 512 * 4
    assert made.values("end J.omega").size == 512 * 2


def test_mean_deviation_and_quantiles_are_those_of_a_normal_distribution() -> None:
    made = uncertainty(
        two_motors(),
        {"one.tau": stats.norm(3.0, 0.3), "two.tau": stats.norm(5.0, 0.4)},
        measures=["end J.omega"],
        t_end=1.0,
        samples=4000,
    )
    mean, error = made.mean("end J.omega")
    assert abs(mean - 4.0) < 3 * error
    assert error == pytest.approx(0.25 / 4000**0.5, rel=0.05)
    # a normal distribution of deviation 0.25; quantiles of 4000 samples to some 0.01
    assert made.quantiles("end J.omega") == pytest.approx([4.0 - 0.49, 4.0, 4.0 + 0.49], abs=0.03)
    exact = stats.norm(4.0, 0.25).sf(4.4)
    value, low, high = made.probability("end J.omega", above=4.4)
    assert low < exact < high
    assert low < value < high
    assert high - low < 0.02


def test_morris_finds_what_matters_and_what_acts_alone() -> None:
    made = uncertainty(ishigami, dict.fromkeys("abc", (-PI, PI)), method="morris", samples=200)
    found = made.indices("y")
    linear = uncertainty(
        two_motors(),
        {"one.tau": (0.0, 1.0), "two.tau": (0.0, 2.0)},
        measures=["end J.omega"],
        t_end=1.0,
        method="morris",
        samples=10,
    ).indices("end J.omega")
    # the change over the whole range, without any spread
    assert [value for value, _ in linear["mu*"].values()] == pytest.approx([0.5, 1.0], rel=1e-7)
    assert [value for value, _ in linear["sigma"].values()] == pytest.approx([0.0, 0.0], abs=1e-6)
    assert found["sigma"]["c"][0] > 1.0  # c acts with a alone
    with pytest.raises(sw.ParameterError, match="tell no distribution"):
        made.mean("y")


def test_the_same_seed_gives_the_same_samples() -> None:
    first, again, other = (
        uncertainty(ishigami, dict.fromkeys("abc", (-PI, PI)), samples=50, seed=seed).values("y") for seed in (1, 1, 2)
    )
    assert (first == again).all()
    assert not (first == other).any()


def test_a_failed_sample_counts_as_passing_a_limit() -> None:
    def broken(columns: Columns) -> Columns:
        return {"y": np.where(columns["a"] > 0.5, np.nan, 0.0)}

    made = uncertainty(broken, {"a": (0.0, 1.0)}, samples=400)
    assert made.probability("y", above=1.0).value == made.sweep.failed.mean() > 0.4
    assert made.probability("y", above=1.0).low == 0.0  # nothing is known of them
    assert made.values("y").size == 400 - made.sweep.failed.sum()
    with pytest.raises(sw.ParameterError, match="indices need all of them"):
        uncertainty(broken, {"a": (0.0, 1.0)}, samples=64, method="sobol").indices("y")


@pytest.mark.parametrize("side", ["above", "below"])
@pytest.mark.parametrize("limit", [np.nan, np.inf, "1"])
def test_a_limit_that_is_no_finite_number_is_refused(side: str, limit: object) -> None:
    samples = uncertainty(lambda columns: {"y": columns["a"]}, {"a": (0.0, 1.0)}, samples=8)
    with pytest.raises(sw.ParameterError, match=f"{side} = .* must be a"):
        samples.probability("y", **{side: limit})  # type: ignore[arg-type]


@pytest.mark.parametrize(("method", "names"), [("sobol", "S1 and ST"), ("morris", r"mu\* and sigma")])
def test_what_is_shown_says_why_there_are_no_indices(method: str, names: str) -> None:
    def broken(columns: Columns) -> Columns:
        return {"y": np.where(columns["a"] > 0.5, np.nan, 0.0)}

    found = uncertainty(broken, {"a": (0.0, 1.0)}, samples=16, method=method)
    said = rf"No {names}: \d+ samples of {len(found)} failed, and indices need all of them"
    assert re.search(said, str(found).splitlines()[-1])
    assert re.search(said, found._repr_html_())
    assert "failed, and" not in str(uncertainty(broken, {"a": (0.0, 1.0)}, samples=16))  # random: there are none anyway


def test_bands_hold_the_courses_and_the_mean() -> None:
    t = np.linspace(0.0, 1.0, 21)
    made = sw.studies.bands(
        two_motors(), "J.omega", t, {"one.tau": stats.norm(3.0, 0.3), "two.tau": stats.norm(5.0, 0.4)}, samples=400
    )
    low, high = made.of_mean
    assert (low[1:] < 4.0 * t[1:]).all()
    assert (4.0 * t[1:] < high[1:]).all()
    assert high[-1] - low[-1] == pytest.approx(2 * 1.96 * 0.25 / 20, rel=0.1)
    low, high = made.of_courses
    assert high[-1] - low[-1] == pytest.approx(2 * 1.96 * 0.25, rel=0.15)  # a quantile of 400 samples


def test_a_sample_that_is_not_admissible_is_named() -> None:
    for values, words in (([27.0, -1.0], "'J1': J = -1.0 must be"), (stats.norm(-27.0, 1.0), "The sample .*J1.*-2")):
        with pytest.raises(sw.ParameterError, match=words):
            sw.studies.bands(sw.scenes.crane_start(), "shaft.tau", [0.0, 0.1], {"J1.J": values}, samples=None)
    with pytest.raises(sw.ParameterError, match=r"'one': tau = .* in row \d+ of 'one\.tau' must be a finite number"):
        uncertainty(
            two_motors(), {"one.tau": stats.cauchy(0.0, np.inf)}, measures=["end J.omega"], t_end=1.0, samples=8
        )


@pytest.mark.parametrize("ends", [("a", 1.0), (0.0, "b"), (None, 1.0), (0.0, np.nan)])
def test_what_a_function_is_given_are_numbers(ends: tuple[object, object]) -> None:
    with pytest.raises(sw.ParameterError, match=r"'a' = .* must be a"):
        uncertainty(lambda columns: {"y": columns["a"]}, {"a": ends}, samples=8)


def test_bands_over_seeds_take_each_seed_once() -> None:
    net = sw.Network("noise")
    net.add(sw.TorqueSource("motor", tau=20.0), "wheel")
    net.add(sw.RandomLoad("soil", mean=10.0, std=2.0, interval=0.05, seed=1), "wheel")
    net.add(sw.Inertia("J", J=2.0), "wheel")
    made = sw.studies.bands(net, "J.omega", [0.0, 1.0], {"soil.seed": np.arange(5.0)})
    assert made.parameters["soil.seed"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert len({*made.courses[:, 1].tolist()}) == 5


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"distributions": {}}, "Nothing is uncertain"),
        ({"distributions": {"one.tau": 3.0}}, "is no distribution"),
        ({"distributions": {"one.tau": (2.0, 1.0)}}, "is no distribution"),
        ({"distributions": {"one.tua": (1.0, 2.0)}}, "no parameter 'one.tua'"),
        ({"distributions": {"J.J": (-1.0, 1.0)}}, "J = -"),
        ({"method": "fast"}, "no method 'fast'"),
        ({"samples": 1}, "2 or more"),
        ({"method": "sobol", "samples": 100}, "power of two"),
        ({"level": 95}, "between 0 and 1"),
        ({"measures": None}, "Name what is measured"),
    ],
)
def test_what_is_wrong_is_said(change: dict[str, object], words: str) -> None:
    arguments: dict[str, object] = {
        "distributions": {"one.tau": (0.0, 1.0)},
        "measures": ["end J.omega"],
        "t_end": 1.0,
        "samples": 8,
        **change,
    }
    with pytest.raises(sw.ParameterError, match=words):
        uncertainty(two_motors(), **arguments)  # type: ignore[arg-type]


def test_pictures_and_tables_show_all_measures() -> None:
    made = uncertainty(
        two_motors(),
        {"one.tau": (0.0, 1.0), "two.tau": (0.0, 2.0)},
        measures=["end J.omega", "mean J.omega"],
        t_end=1.0,
        method="sobol",
        samples=32,
    )
    assert len(made.plot().axes) == 4
    text = str(made)
    assert text.startswith("two motors: 128 samples, 0 failed")
    assert "two.tau" in text


def test_discrete_distributions_stay_within_their_values() -> None:
    for distribution in (stats.randint(1, 5), stats.binom(5, 0.5)):
        made = uncertainty(lambda columns: {"y": columns["a"]}, {"a": distribution}, method="morris", samples=20)
        assert set(made.sweep.parameters["a"]) <= {float(k) for k in range(6)} - (
            {0.0} if distribution.support()[0] else set()
        )


def test_where_all_samples_fail_the_table_says_why() -> None:
    def broken(columns: Columns) -> Columns:
        return {"y": np.full(columns["a"].size, np.nan)}

    assert (
        str(uncertainty(broken, {"a": (0.0, 1.0)}, samples=8))
        == "broken: 8 samples, 8 failed, the first: no finite value"
    )
