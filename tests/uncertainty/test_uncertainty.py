"""Uncertain parameters: distributions and indices that are known in closed form come back within their errors."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

import shaftwork as sw
from shaftwork.studies import uncertainty
from shaftwork.uncertainty.draws import _values

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
    # the change from the 1 % to the 99 % quantile, without any spread
    assert [value for value, _ in linear["mu*"].values()] == pytest.approx([0.49, 0.98], rel=1e-7)
    assert [value for value, _ in linear["sigma"].values()] == pytest.approx([0.0, 0.0], abs=1e-6)
    assert found["sigma"]["c"][0] > 1.0  # c acts with a alone
    with pytest.raises(sw.ParameterError, match="tell no distribution"):
        made.mean("y")


def test_morris_ranks_all_distributions_by_the_change_over_the_same_range() -> None:
    given = {
        "pair": (0.0, 1.0),
        "uniform": stats.uniform(2.0, 1.0),
        "normal": stats.norm(1.0, 2.0),
        "skew": stats.expon(),
    }
    found = uncertainty(lambda columns: {"y": sum(columns.values())}, given, method="morris", samples=10).indices("y")
    for name, distribution in {**given, "pair": stats.uniform()}.items():
        low, high = distribution.ppf([0.01, 0.99])  # type: ignore[union-attr]
        assert found["mu*"][name][0] == pytest.approx(high - low, rel=1e-9)  # of a sum, but for rounding
        assert found["sigma"][name][0] == pytest.approx(0.0, abs=1e-9)
        assert np.isnan(found["sigma"][name][1])  # nobody estimates an interval of it


@pytest.mark.parametrize("single", [[0.0, 1.0], stats.randint(1, 5), stats.binom(5, 0.5)])
def test_morris_refuses_single_values_which_need_not_lie_in_equal_steps(single: object) -> None:
    with pytest.raises(sw.ParameterError, match=r"'b' has single values.*or take method='sobol'"):
        uncertainty(ishigami, {"a": (0.0, 1.0), "b": single, "c": (0.0, 1.0)}, method="morris", samples=4)


def test_no_error_of_the_mean_is_told_of_sobol_points() -> None:
    made = uncertainty(lambda columns: {"y": columns["a"]}, {"a": (0.0, 1.0)}, method="sobol", samples=128)
    mean, error = made.mean("y")
    # the scatter of independent points would promise an error of 0.018
    assert abs(mean - 0.5) < 1e-3
    assert np.isnan(error)
    assert "error" not in str(made)
    assert "nan" not in str(made)


def test_the_interval_of_a_probability_is_conservative_for_sobol_points() -> None:
    found = [
        uncertainty(
            lambda columns: {"y": columns["a"] + columns["b"]},
            dict.fromkeys("ab", (0.0, 1.0)),
            method="sobol",
            samples=64,
            seed=seed,
        ).probability("y", above=1.5)
        for seed in range(40)
    ]
    assert all(
        low < 0.125 < high for _, low, high in found
    )  # the area of a triangle; of 95 % intervals 2 might miss it
    # less than half the scatter of 128 independent points
    assert np.std([value for value, _, _ in found]) < 0.5 * (0.125 * 0.875 / 128) ** 0.5


@pytest.mark.parametrize("method", ["sobol", "morris"])
def test_the_level_sets_the_width_of_the_intervals_of_indices(method: str) -> None:
    def halves(level: float) -> list[float]:
        made = uncertainty(ishigami, dict.fromkeys("abc", (-PI, PI)), method=method, samples=64, level=level)
        assert f"+- ({100 * level:g} %)" in str(made)
        leading = next(iter(made.indices("y").values()))
        return [half for _, half in leading.values()]

    # the same seed draws the same resamples, whose deviation is multiplied by the quantile of a normal distribution
    factor = stats.norm.ppf(0.995) / stats.norm.ppf(0.75)
    assert halves(0.99) == pytest.approx([factor * half for half in halves(0.5)], rel=1e-9)


def test_the_level_sets_the_width_of_the_interval_of_a_probability() -> None:
    for level in (0.5, 0.99):
        made = uncertainty(lambda columns: {"y": columns["a"]}, {"a": (0.0, 1.0)}, samples=400, level=level)
        value, low, high = made.probability("y", above=0.7)
        # 400 samples are enough for the normal distribution to be right to some percent
        width = 2 * stats.norm.ppf((1 + level) / 2) * (value * (1 - value) / 400) ** 0.5
        assert high - low == pytest.approx(width, rel=0.1)


@pytest.mark.parametrize("seed", [-1, 1.5, "1", True, None])
def test_a_seed_that_is_no_whole_number_is_refused(seed: Any) -> None:
    words = r"seed = .* must be a whole number, 0 or more"
    with pytest.raises(sw.ParameterError, match=words):
        uncertainty(ishigami, dict.fromkeys("abc", (0.0, 1.0)), samples=4, seed=seed)
    for values in ((1.0, 2.0), [1.0, 2.0]):
        with pytest.raises(sw.ParameterError, match=words):
            sw.studies.bands(two_motors(), "J.omega", [0.0, 1.0], {"one.tau": values}, seed=seed)


def test_the_same_seed_gives_the_same_samples() -> None:
    first, again, other = (
        uncertainty(ishigami, dict.fromkeys("abc", (-PI, PI)), samples=50, seed=seed).values("y") for seed in (1, 1, 2)
    )
    assert (first == again).all()
    assert not (first == other).any()


def test_a_probability_leaves_out_samples_that_failed_and_its_interval_holds_both_ways() -> None:
    def broken(columns: Columns) -> Columns:
        a = columns["a"]
        return {"y": np.where(a > 0.5, np.nan, a), "whole": a}

    made = uncertainty(broken, {"a": (0.0, 1.0)}, samples=400)
    failed, a = int(made.sweep.failed.sum()), made.sweep.parameters["a"]
    assert failed > 150
    with pytest.warns(sw.AccuracyWarning, match=f"not known of {failed} samples of 400"):
        found = made.probability("y", above=0.25)
    passing = int(((a > 0.25) & (a <= 0.5)).sum())
    assert found.value == passing / (400 - failed)
    assert found.low == stats.binomtest(passing, 400).proportion_ci(0.95).low
    assert found.high == stats.binomtest(passing + failed, 400).proportion_ci(0.95).high
    assert made.values("y").size == 400 - failed
    # another measure of the same samples is known of all
    assert made.probability("whole", above=0.25).value == (a > 0.25).mean()
    assert made.values("whole").size == 400
    with pytest.raises(sw.ParameterError, match="indices need all of them"):
        uncertainty(broken, {"a": (0.0, 1.0)}, samples=64, method="sobol").indices("y")


def test_of_samples_that_all_failed_no_probability_is_told() -> None:
    made = uncertainty(lambda columns: {"y": np.full(columns["a"].size, np.nan)}, {"a": (0.0, 1.0)}, samples=8)
    with pytest.warns(sw.AccuracyWarning, match="8 samples of 8"):
        value, low, high = made.probability("y", above=1.0)
    assert np.isnan(value)
    assert (low, high) == (0.0, 1.0)


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
    if method == "sobol":  # the histograms alone
        figure = found.plot()
        assert len(figure.axes) == 1
        assert "indices need all of them" in " ".join(figure.get_suptitle().split())
    else:
        with pytest.raises(sw.ParameterError, match=f"nothing to draw. {said}"):
            found.plot()
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
    title, _, *rows = str(made).splitlines()
    assert title == "two motors: J.omega in rad/s of 400 courses, to 95 %"
    assert [float(row.split()[0]) for row in rows] == pytest.approx(np.linspace(0.0, 1.0, 11))


def test_a_sample_that_is_not_admissible_is_named() -> None:
    for values, words in (
        ([27.0, -1.0], "'J1': J = -1.0 must be"),
        (stats.norm(-27.0, 1.0), r"'J1': J = -2.* in row \d+ of 'J1\.J'.* It was drawn from norm\(-27\.0, 1\.0\)"),
    ):
        with pytest.raises(sw.ParameterError, match=words):
            sw.studies.bands(sw.scenes.crane_start(), "shaft.tau", [0.0, 0.1], {"J1.J": values}, samples=None)
    with pytest.raises(sw.ParameterError, match=r"'one\.tau': cauchy.* inf.* has no values\. Deviations and scales"):
        uncertainty(
            two_motors(), {"one.tau": stats.cauchy(0.0, np.inf)}, measures=["end J.omega"], t_end=1.0, samples=8
        )


@pytest.mark.parametrize("ends", [("a", 1.0), (0.0, "b"), (None, 1.0), (0.0, np.nan)])
def test_what_a_function_is_given_are_numbers(ends: tuple[object, object]) -> None:
    with pytest.raises(sw.ParameterError, match=r"'a' = .* must be a"):
        uncertainty(lambda columns: {"y": columns["a"]}, {"a": ends}, samples=8)


def late_motor() -> sw.Network:
    """It goes off at 1 s: a motor that comes on later is none."""
    net = sw.Network("late")
    net.add(sw.KlossMotor("late", tau_k=1.0, s_k=0.2, n_sync=1500, t_on=0.1, t_off=1.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    return net


def test_bands_leave_out_samples_that_fail_and_say_how_many() -> None:
    net, t = late_motor(), np.linspace(0.0, 0.9, 4)
    with pytest.warns(sw.AccuracyWarning, match=r"2 of 4 samples failed, the first, {'late.t_on': 2.0}: .*t_off"):
        made = sw.studies.bands(net, "late.tau", t, {"late.t_on": [0.1, 2.0, 3.0, 0.2]})
    assert made.parameters["late.t_on"].tolist() == [0.1, 0.2]
    alone = sw.studies.bands(net, "late.tau", t, {"late.t_on": [0.1, 0.2]})
    assert (made.courses == alone.courses).all()
    assert made.plot().axes


@pytest.mark.parametrize("values", [[2.0, 3.0], [0.1, 2.0, 3.0]])
def test_bands_of_fewer_than_two_samples_are_an_error_that_says_why(values: list[float]) -> None:
    with pytest.raises(
        sw.SimulationError, match=rf"need two samples or more: 2 of {len(values)} samples failed.*t_off"
    ):
        sw.studies.bands(late_motor(), "J.omega", [0.0, 0.5], {"late.t_on": values})


def test_courses_are_those_of_single_runs_with_the_options_of_a_sweep() -> None:
    net, t = sw.scenes.crane_start(), np.linspace(0.0, 0.5, 6)
    made = sw.studies.bands(net, "shaft.tau", t, {"shaft.c": [2e4, 3e4]}, engine="scipy")
    for c, course in zip(made.parameters["shaft.c"], made.courses, strict=True):
        single = net.compile().simulate(0.5, parameters={"shaft.c": c}, t_eval=t, engine="scipy")
        assert (course == single["shaft.tau"]).all()
    assert made.unit == "N*m"
    with pytest.raises(sw.SignalError, match=r"shaft\.tua"):
        sw.studies.bands(net, "shaft.tua", t, {"shaft.c": [2e4, 3e4]})
    with pytest.raises(sw.ParameterError, match="t must be times in s that ascend"):
        sw.studies.bands(net, "shaft.tau", [0.0, 0.1, 0.1], {"shaft.c": [2e4, 3e4]})


def test_the_level_sets_the_width_of_bands() -> None:
    t, uncertain = [0.0, 1.0], {"one.tau": stats.norm(3.0, 0.3)}
    narrow, wide = (sw.studies.bands(two_motors(), "J.omega", t, uncertain, level=level) for level in (0.5, 0.99))
    factor = stats.t.ppf(0.995, 99) / stats.t.ppf(0.75, 99)
    assert np.ptp([band[-1] for band in wide.of_mean]) == pytest.approx(
        factor * np.ptp([band[-1] for band in narrow.of_mean]), rel=1e-9
    )
    for made, level in ((narrow, 0.5), (wide, 0.99)):
        low, high = made.of_courses
        within = (low[-1] <= made.courses[:, -1]) & (made.courses[:, -1] <= high[-1])
        assert within.mean() == pytest.approx(level, abs=0.011)  # one course of 100


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
        ({"distributions": {"one.tau": stats.norm}}, "'one.tau': norm has no parameters yet"),
        ({"distributions": {"one.tau": stats.norm(1.0, -0.1)}}, r"'one.tau': norm\(1\.0, -0\.1\) has no values"),
        ({"distributions": {"J.J": (-1.0, 1.0)}}, "J = -"),
        ({"distributions": {"one.tau": stats.norm([1.0, 2.0], 0.1)}}, "are 2 distributions. Give one"),
        (
            {"distributions": {"J.J": stats.norm(1.0, 2.0)}},
            r"It was drawn from norm\(1\.0, 2\.0\). Give a distribution",
        ),
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


@pytest.mark.parametrize(
    ("function", "options", "words"),
    [
        (lambda _: {}, {}, r"gives \{\}\. It must give columns"),
        (lambda columns: columns["a"], {}, "It must give columns of results by measure"),
        (ishigami, {"measures": ["max y"]}, "measures is for a network"),
        (ishigami, {"t_end": 3.0}, "t_end is for a network"),
    ],
)
def test_what_is_wrong_about_a_function_is_said(function: Any, options: dict[str, Any], words: str) -> None:
    with pytest.raises(sw.ParameterError, match=words):
        uncertainty(function, dict.fromkeys("abc", (-PI, PI)), samples=4, **options)


def test_samples_that_all_failed_have_no_mean_and_no_quantiles() -> None:
    made = uncertainty(lambda columns: {"y": np.full(columns["a"].size, np.nan)}, {"a": (0.0, 1.0)}, samples=4)
    for read in (made.mean, made.quantiles, made.values):
        with pytest.raises(
            sw.SimulationError, match=r"'y' has no values: .* 4 samples, 4 failed, the first: no finite"
        ):
            read("y")


def test_a_table_says_what_was_drawn_from() -> None:
    distributions = {"one.tau": [0.5, 0.7], "two.tau": (0.5, 0.7), "J.J": stats.lognorm(0.1, scale=2.0)}
    made = uncertainty(two_motors(), distributions, measures=["end J.omega"], t_end=1.0, samples=8)
    told = "drawn from: one.tau 2 values, two.tau 0.5 to 0.7, J.J lognorm(0.1, scale=2.0)"
    assert told in str(made)
    assert told in made._repr_html_()


def test_a_probability_of_either_side_needs_a_range_between_them() -> None:
    made = uncertainty(two_motors(), {"one.tau": (0.0, 1.0)}, measures=["end J.omega"], t_end=1.0, samples=64)
    values = made.values("end J.omega")
    either = made.probability("end J.omega", above=0.9, below=0.6).value
    assert either == np.mean((values > 0.9) | (values < 0.6))
    with pytest.raises(sw.ParameterError, match=r"Every value is above 0\.6 or below 0\.9"):
        made.probability("end J.omega", above=0.6, below=0.9)


def test_both_kinds_of_distributions_of_scipy_are_taken() -> None:
    old = uncertainty(ishigami, dict.fromkeys("abc", stats.norm(0.1, 0.2)), samples=8)
    new = uncertainty(ishigami, dict.fromkeys("abc", stats.Normal(mu=0.1, sigma=0.2)), samples=8)
    assert new.values("y") == pytest.approx(old.values("y"), rel=1e-12)  # two formulas of one quantile


def test_tables_and_bands_have_units_and_bands_no_options_of_their_own_times() -> None:
    made = uncertainty(two_motors(), {"one.tau": (0.0, 1.0)}, measures=["end J.omega"], t_end=1.0, samples=4)
    assert str(made).splitlines()[1].split()[:2] == ["unit", "mean"]
    assert str(made).splitlines()[2].split()[2] == "rad/s"
    for option in ({"t_end": 2.0}, {"measures": ["end J.omega"]}, {"t_eval": 3}):
        with pytest.raises(sw.ParameterError, match=f"bands has no {next(iter(option))}"):
            sw.studies.bands(two_motors(), "J.omega", [0.0, 1.0], {"one.tau": (0.0, 1.0)}, **option)
    for times in ([-1.0, 0.1], [0.0]):
        with pytest.raises(sw.ParameterError, match="ascend from zero or later"):
            sw.studies.bands(two_motors(), "J.omega", times, {"one.tau": (0.0, 1.0)})


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


def test_the_least_share_of_a_distribution_has_a_value_of_it() -> None:
    # a generator may draw 0 itself, where scipy's ppf gives one below the least value, or no finite one
    zero = np.zeros(1)
    assert _values(stats.randint(1, 5), zero) == 1.0
    assert _values(stats.binom(5, 0.5), zero) == 0.0
    assert np.isfinite(_values(stats.norm(), zero))


def test_where_all_samples_fail_the_table_says_why() -> None:
    def broken(columns: Columns) -> Columns:
        return {"y": np.full(columns["a"].size, np.nan)}

    lines = str(uncertainty(broken, {"a": (0.0, 1.0)}, samples=8)).splitlines()
    assert lines == ["broken: 8 samples, 8 failed, the first: no finite value", "  drawn from: a 0 to 1"]
