"""Samples of uncertain parameters: independent ones, and those from which sensitivity indices are estimated."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from shaftwork.core.errors import ParameterError, imported
from shaftwork.core.parameters import in_si, whole
from shaftwork.core.screen import counted
from shaftwork.pipeline.arguments import checked_parameter, seed_number
from shaftwork.pipeline.columns import Checked, column_in_si, has_many
from shaftwork.pipeline.network import Network, network_of
from shaftwork.results.observer import Array

METHODS = ("random", "sobol", "morris")
FINEST_SHARE = 2.0**-31
"""Half the step of Sobol' points of 30 bits."""
RANGE = (0.01, 0.99)
"""Of every distribution, between which quantiles of it "morris" steps: an endless one has no others."""
Distribution = Any
"""A frozen distribution of scipy.stats, (low, high) for a uniform one, or a list of values that are equally likely.

Values of pairs and lists may have units.
"""


def distributions_in_si(net: Network | None, distributions: Mapping[str, Distribution]) -> dict[str, Distribution]:
    """Distributions as a user gave them: pairs and lists become numbers in SI, lists arrays.

    Args:
        net: whose parameters they are; None where the names are those of a function's columns, which have no units.
        distributions: by parameter. Those of scipy.stats are in SI.

    Raises:
        ParameterError: there is none, one is no distribution, there is no such parameter, or a value of a pair or list
            is not admissible.
    """
    if not (isinstance(distributions, Mapping) and distributions):
        raise ParameterError("Nothing is uncertain. Give distributions, such as {'shaft.c': (20e3, 28e3)}.")
    netlist = None if net is None else network_of(net).netlist()

    def checked(name: str) -> Checked:
        return partial(_of_function, name) if netlist is None else partial(checked_parameter, netlist, name)

    return {str(name): _in_si(str(name), given, checked(str(name))) for name, given in distributions.items()}


def _of_function(name: str, value: Any, _: str) -> float:
    return in_si(f"'{name}'", value)


def _in_si(name: str, given: Any, checked: Checked) -> Distribution:
    if hasattr(given, "ppf") or hasattr(given, "icdf"):
        return _of_scipy(name, given)
    if isinstance(given, tuple):
        ends = [checked(end, "") for end in given]
        if len(ends) == 2 and ends[0] < ends[1]:
            return tuple(ends)
    elif has_many(given) and (values := column_in_si(name, given, checked)).size:
        return values
    raise ParameterError(
        f"'{name}': {given!r} is no distribution. Give one of scipy.stats, such as norm(24e3, 500), (low, high) "
        "for values that are all as likely, or a list of values."
    )


def _of_scipy(name: str, given: Any) -> Any:
    """A distribution of scipy.stats.

    Raises:
        ParameterError: its parameters are not given, or not admissible.
    """
    if isinstance(given, stats.rv_continuous | stats.rv_discrete):
        raise ParameterError(f"'{name}': {given.name} has no parameters yet. Give them, such as norm(24e3, 500).")
    with np.errstate(invalid="ignore"):  # of a scale without end
        middle = _quantiles(given, np.array([0.5]))
    if middle.shape != (1,):
        raise ParameterError(f"'{name}': {_told(given)} are {middle.size} distributions. Give one.")
    if not np.isfinite(middle).all():
        raise ParameterError(
            f"'{name}': {_told(given)} has no values. Deviations and scales are finite and larger than zero."
        )
    return given


def _told(distribution: Distribution) -> str:
    """A distribution in words."""
    if isinstance(distribution, tuple):
        return f"{distribution[0]:.6g} to {distribution[1]:.6g}"
    if isinstance(distribution, np.ndarray):
        return counted(distribution.size, "value")
    if hasattr(distribution, "dist"):
        named = (f"{name}={value}" for name, value in distribution.kwds.items())
        return f"{distribution.dist.name}({', '.join([*map(str, distribution.args), *named])})"
    return str(distribution)


def refuse_samples(net: Network, design: Design) -> None:
    """Refuse a distribution of which a sample is no value of its parameter.

    Raises:
        ParameterError: there is one; says which value.
    """
    netlist = network_of(net).netlist()
    for name, column in design.columns.items():
        try:
            column_in_si(name, column, partial(checked_parameter, netlist, name), rows=True)
        except ParameterError as error:
            raise ParameterError(
                f"{error} It was drawn from {design.told[name]}. Give a distribution without such values, as lognorm "
                "or truncnorm."
            ) from None


def _quantiles(distribution: Any, shares: Array) -> Array:
    """Of a distribution of scipy.stats, which calls them `ppf`, or `icdf` since 1.15."""
    of = distribution.icdf if hasattr(distribution, "icdf") else distribution.ppf
    return np.asarray(of(shares), dtype=float)


def _values(distribution: Distribution, shares: Array) -> Array:
    """(k,) values at shares (k,) of a distribution, from 0 up to less than 1."""
    if isinstance(distribution, tuple):
        low, high = distribution
        return np.asarray(low + shares * (high - low))
    if isinstance(distribution, np.ndarray):
        return np.asarray(distribution[np.minimum((shares * distribution.size).astype(int), distribution.size - 1)])
    # a share of exactly 0 may be drawn, where an endless distribution is infinite and a discrete one below its least
    return _quantiles(distribution, np.maximum(shares, FINEST_SHARE))


def _levels(name: str, distribution: Distribution, shares: Array) -> Array:
    """(k,) values that divide the range of a distribution, from its 1 % to its 99 % quantile, as shares (k,) divide 1.

    Steps that are equal in value, not in probability: only then does the change of a measure over a step, as SALib
    scales it, say the same of every distribution.

    Raises:
        ParameterError: the distribution has single values, between which there are no equal steps.
    """
    if isinstance(distribution, np.ndarray) or hasattr(distribution, "pmf"):
        raise ParameterError(
            f"'{name}' has single values, which need not lie in equal steps, as method='morris' takes them. "
            f"Give '{name}' a range, (low, high), or a continuous distribution, or take method='sobol'."
        )
    low, high = _values(distribution, np.array(RANGE))
    return np.asarray(low + shares * (high - low))


class Design:
    """The samples of a study.

    Args:
        distributions: by parameter, as of `distributions_in_si`.
        method: one of `METHODS`.
        samples: independent ones; of "sobol" points with so many more for each parameter, of "morris" trajectories.
        seed: of the random numbers.

    Raises:
        ParameterError: an argument is out of its range, or "morris" can take no steps in a distribution.
        MissingExtraError: SALib is not installed, which "sobol" and "morris" need.
    """

    def __init__(self, distributions: Mapping[str, Distribution], method: str, samples: int, seed: int) -> None:
        if method not in METHODS:
            raise ParameterError(f"There is no method {method!r}. Take one of: {', '.join(METHODS)}.")
        if whole(samples) is None or samples < 2:
            raise ParameterError(f"samples = {samples!r} must be a whole number, 2 or more.")
        self.names, self.method, self.count, self.seed = tuple(distributions), method, int(samples), seed_number(seed)
        if method == "sobol" and self.count & (self.count - 1):
            raise ParameterError(f"samples = {samples} must be a power of two for Sobol' indices, such as 1024.")
        shares = self._shares()
        self.columns = {
            name: _levels(name, distribution, column) if method == "morris" else _values(distribution, column)
            for (name, distribution), column in zip(distributions.items(), shares.T, strict=True)
        }
        """(rows,) values by parameter."""
        self.shares = shares
        self.told = {name: _told(distribution) for name, distribution in distributions.items()}
        """By parameter, the distribution in words."""

    @property
    def problem(self) -> dict[str, Any]:
        """As SALib wants it, in shares of the distributions, of "morris" in shares of their ranges."""
        return {"num_vars": len(self.names), "names": list(self.names), "bounds": [[0.0, 1.0]] * len(self.names)}

    def _shares(self) -> Array:
        """(rows, parameters) shares of the distributions, of "morris" of their ranges."""
        if self.method == "random":
            return np.random.default_rng(self.seed).random((self.count, len(self.names)))
        sampler = imported(f"SALib.sample.{self.method}", "uncertainty", f"uncertainty(method='{self.method}')")
        options = {"calc_second_order": False} if self.method == "sobol" else {}
        # SALib takes a seed of 0 for none
        return np.asarray(sampler.sample(self.problem, self.count, seed=1 + self.seed, **options))

    @property
    def of_distribution(self) -> NDArray[np.intp]:
        """The rows that are spread as the distributions are: of "sobol" Sobol' points; of "morris" none."""
        size = len(self.names) + 2  # of Saltelli's scheme: one sample, one change of each parameter, another sample
        if self.method == "sobol":
            return np.sort(
                np.concatenate([np.arange(0, self.count * size, size), np.arange(size - 1, self.count * size, size)])
            )
        return np.arange(self.count if self.method == "random" else 0)

    def indices(self, values: Array, level: float) -> dict[str, tuple[Array, Array]]:
        """SALib's analysis of a measure (rows,): each index with half of its interval, NaN where it has none."""
        analysis = imported(f"SALib.analyze.{self.method}", "uncertainty", "Uncertainty.indices()")
        if self.method == "sobol":
            results = analysis.analyze(
                self.problem, values, calc_second_order=False, conf_level=level, seed=1 + self.seed
            )
            return {name: (np.asarray(results[name]), np.asarray(results[f"{name}_conf"])) for name in ("S1", "ST")}
        results = analysis.analyze(self.problem, self.shares, values, conf_level=level, seed=1 + self.seed)
        size, spread = np.asarray(results["mu_star"], dtype=float), np.asarray(results["sigma"], dtype=float)
        return {
            "mu*": (size, np.asarray(results["mu_star_conf"], dtype=float)),
            "sigma": (spread, np.full_like(spread, np.nan)),
        }
