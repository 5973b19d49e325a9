"""What uncertain parameters do to measures: distribution, indices, probability of passing a limit."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import stats

from shaftwork.core.errors import AccuracyWarning, ParameterError, SimulationError
from shaftwork.core.notebook import html_table
from shaftwork.core.notices import warn
from shaftwork.core.parameters import in_si
from shaftwork.core.screen import counted, in_columns, named
from shaftwork.pipeline.arguments import inner_share
from shaftwork.pipeline.measured_units import limits_in_si
from shaftwork.results.observer import Array
from shaftwork.results.plotting import label, new_figure, plain
from shaftwork.sweep.sweep_result import Sweep
from shaftwork.uncertainty.draws import Design

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Probability(NamedTuple):
    """An estimated probability.

    Args:
        value: share of the samples that did not fail.
        low: of its confidence interval.
        high: of it.
    """

    value: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Samples of uncertain parameters and their measures.

    Args:
        sweep: all samples that were simulated.
        design: how they were drawn.
        level: of confidence.
    """

    sweep: Sweep
    design: Design
    level: float

    def __len__(self) -> int:
        return len(self.sweep)

    @property
    def measures(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(self.sweep.measures)

    def values(self, measure: str) -> Array:
        """(k,) a measure of the samples of the distribution that did not fail; of those of "sobol" two of each set.

        Raises:
            ParameterError: there is no such measure, or the samples of "morris" tell no distribution.
            SimulationError: all samples failed.
        """
        values = self._known(measure)
        if not values.size:
            raise SimulationError(f"'{measure}' has no values: {self._title}.")
        return values

    def _known(self, measure: str) -> Array:
        values = self._drawn(measure)
        return values[np.isfinite(values)]

    def _drawn(self, measure: str) -> Array:
        """(k,) a measure of the samples of the distribution, not finite where it is not known."""
        if not self.design.of_distribution.size:
            raise ParameterError("Samples of 'morris' tell no distribution. Take method='random' or 'sobol'.")
        return self._column(measure)[self.design.of_distribution]

    def _column(self, measure: str) -> Array:
        if measure not in self.sweep.measures:
            raise ParameterError(f"There is no measure '{measure}'. There are: {', '.join(self.measures)}.")
        return self.sweep.measures[measure]

    def mean(self, measure: str) -> tuple[float, float]:
        """The mean of a measure and the standard error of it; NaN for Sobol' points.

        These fill the space evenly: the error is less than that of independent points, often by far, and their scatter
        does not tell it.
        """
        values = self.values(measure)
        return float(values.mean()), float(stats.sem(values)) if self.design.method == "random" else np.nan

    def quantiles(self, measure: str, shares: tuple[float, ...] = (0.025, 0.5, 0.975)) -> Array:
        """The values that are not passed by certain shares of the samples.

        Raises:
            ParameterError: there is no such measure, or a share does not lie between 0 and 1.
        """
        return np.asarray(np.quantile(self.values(measure), [inner_share("a share", share) for share in shares]))

    def probability(self, measure: str, *, above: float | None = None, below: float | None = None) -> Probability:
        """How probable it is that a measure passes a limit.

        Law: the share of the samples that do, with the interval of Clopper and Pearson for independent ones; of Sobol'
        points it is as a rule too wide. Nothing is known of samples that failed: the value leaves them out, the lower
        end counts them as not passing, the upper end as passing.

        Args:
            measure: its name.
            above: upper limit, in the SI unit of the measure or with units.
            below: lower limit; with both, that it passes either.

        Raises:
            ParameterError: there is no such measure or no limit, or a limit is no finite number or has the wrong
                unit.

        Warns:
            AccuracyWarning: some samples failed; says how many.
        """
        if above is None and below is None:
            raise ParameterError("Give a limit, above=... or below=....")
        values, unit = self._drawn(measure), self.sweep.units.get(measure)
        given = {name: limit for name, limit in (("above", above), ("below", below)) if limit is not None}
        limits = {name: in_si(name, limits_in_si(name, limit, unit)) for name, limit in given.items()}
        high, low = limits.get("above", np.inf), limits.get("below", -np.inf)
        if high < low:
            raise ParameterError(
                f"Every value is above {high:g} or below {low:g}. Give above > below: what is between them is left out."
            )
        known = np.isfinite(values)
        passing = known & ((values > high) | (values < low))
        least, failed = int(passing.sum()), int((~known).sum())
        if failed:
            warn(
                f"'{measure}' is not known of {counted(failed, 'sample')} of {values.size}, which failed: the "
                "probability is that of the others, and its interval holds whether or not these pass the limit; see "
                "sweep.reasons.",
                AccuracyWarning,
            )
        fewest, most = (stats.binomtest(k, values.size).proportion_ci(self.level) for k in (least, least + failed))
        share = least / (values.size - failed) if known.any() else np.nan
        return Probability(share, float(fewest.low), float(most.high))

    def indices(self, measure: str) -> dict[str, dict[str, tuple[float, float]]]:
        """Where the uncertainty of a measure comes from: by index and parameter, the value and half its interval.

        S1 and ST of "sobol", mu* and sigma of "morris", as `uncertainty` explains them. Sigma has no interval: NaN.

        Raises:
            ParameterError: the samples are random ones, or some of them failed.
        """
        column = self._column(measure)
        if self.design.method == "random":
            raise ParameterError("Independent samples tell no indices. Take method='sobol' or 'morris'.")
        if self._unranked:
            raise ParameterError(self._unranked)
        indices = self.design.indices(column, self.level)
        return {
            index: dict(zip(self.design.names, zip(value.tolist(), half.tolist(), strict=True), strict=True))
            for index, (value, half) in indices.items()
        }

    @property
    def _unranked(self) -> str:
        """Why there are no indices that were to be had; empty where there are or were not."""
        failed = int(self.sweep.failed.sum())
        if self.design.method == "random" or not failed:
            return ""
        names, some = "mu* and sigma" if self.design.method == "morris" else "S1 and ST", counted(failed, "sample")
        return f"No {names}: {some} of {len(self)} failed, and indices need all of them; see sweep.reasons."

    def _rows(self) -> list[list[str]]:
        """Cells of the table of distributions."""
        shown = [] if self.design.method == "morris" else [name for name in self.measures if self._known(name).size > 1]
        if not shown:
            return []
        errors, units = self.design.method == "random", self.sweep.units
        optional = [*(["unit"] if units else []), "mean", *(["std. error"] if errors else [])]
        rows = [["", *optional, "deviation", "2.5 %", "50 %", "97.5 %"]]
        for measure in shown:
            mean, error = self.mean(measure)
            unit = [units.get(measure, "")] if units else []
            numbers = f"{mean:.6g}", *([f"{error:.2g}"] if errors else []), f"{self.values(measure).std(ddof=1):.4g}"
            rows.append([measure, *unit, *numbers, *(f"{value:.6g}" for value in self.quantiles(measure))])
        return rows

    def _shares(self) -> list[list[str]]:
        """Cells of the table of indices, the strongest parameter first."""
        if self.design.method == "random" or self.sweep.failed.any():
            return []
        rows = list[list[str]]()
        for measure in self.measures:
            indices = self.indices(measure)
            leading = indices["ST"] if "ST" in indices else indices["mu*"]
            spread = f"+- ({100 * self.level:g} %)"
            headings = [(index, "" if index == "sigma" else spread) for index in indices]  # sigma has no interval
            rows.append([measure, *chain.from_iterable(headings)])
            for name in sorted(leading, key=lambda name: -leading[name][0]):
                cells = (value for by in indices.values() for value in by[name])
                rows.append([name, *("" if np.isnan(value) else f"{value:z.3g}" for value in cells)])
        return rows

    @property
    def _title(self) -> str:
        failed = int(self.sweep.failed.sum())
        first = next((f", the first: {reason}" for reason in self.sweep.reasons if reason), "")
        return f"{self.sweep.name}: {counted(len(self), 'sample')}, {failed} failed{first}"

    @property
    def _drawn_from(self) -> list[str]:
        return named("drawn from", [f"{name} {told}" for name, told in self.design.told.items()])

    def __str__(self) -> str:
        tables = [
            in_columns(rows, range(first, len(rows[0])))
            for rows, first in ((self._rows(), 2 if self.sweep.units else 1), (self._shares(), 1))
            if rows
        ]
        note = [self._unranked] if self._unranked else []
        return "\n".join([self._title, *chain.from_iterable(tables), *self._drawn_from, *note])

    def _repr_html_(self) -> str:
        note, tables = (
            " ".join([*self._drawn_from, self._unranked]),
            [rows for rows in (self._rows(), self._shares()) if rows] or [[[]]],
        )
        return "".join(html_table(self._title, rows[0], rows[1:], note) for rows in tables)

    def plot(self) -> Figure:
        """Histograms of the measures, and their indices where there are any (extra `plot`).

        Raises:
            ParameterError: there is neither, as samples failed.
            MissingExtraError: matplotlib is not installed.
        """
        has_values, has_indices = bool(self._rows()), self.design.method != "random" and not self._unranked
        columns = has_values + has_indices
        if not columns:
            raise ParameterError(f"There is nothing to draw. {self._unranked or self._title}")
        title = ": ".join(filter(None, [self.sweep.name, self._unranked]))
        figure = new_figure("Uncertainty.plot()", 4.6 * columns, 0.6 + 2.8 * len(self.measures), title)
        grid = figure.subplots(len(self.measures), columns, squeeze=False)
        for measure, axes in zip(self.measures, grid, strict=True):
            if has_values:
                axes[0].hist(self.values(measure), bins="auto", color="tab:blue")
                axes[0].set_xlabel(label(measure, self.sweep.units.get(measure, "")))
                axes[0].set_ylabel("samples")
            if has_indices:
                indices = self.indices(measure)
                for shift, (index, by) in enumerate(indices.items()):
                    values, halves = zip(*by.values(), strict=True)
                    places = np.arange(len(by)) + 0.4 * shift - 0.2
                    axes[-1].barh(places, values, 0.4, xerr=halves, label=index)
                axes[-1].set_yticks(range(len(self.design.names)), [plain(name) for name in self.design.names])
                axes[-1].set_xlabel(plain(measure))
                axes[-1].legend(fontsize=8)
        return figure
