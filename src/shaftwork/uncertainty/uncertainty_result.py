"""What uncertain parameters do to measures: distribution, indices, probability of passing a limit."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import stats

from shaftwork.core.errors import ParameterError
from shaftwork.core.notebook import html_table
from shaftwork.core.parameters import in_si
from shaftwork.core.screen import counted, in_columns
from shaftwork.pipeline.measured_units import limits_in_si
from shaftwork.results.observer import Array
from shaftwork.results.plotting import new_figure, plain
from shaftwork.sweep.sweep_result import Sweep
from shaftwork.uncertainty.draws import Design

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Probability(NamedTuple):
    """An estimated probability.

    Args:
        value: share of the samples.
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
        """(k,) a measure of the independent samples that did not fail.

        Raises:
            ParameterError: there is no such measure, or the samples of "morris" tell no distribution.
        """
        rows = self.design.independent
        if not rows.size:
            raise ParameterError("Samples of 'morris' tell no distribution. Take method='random' or 'sobol'.")
        return self._column(measure)[rows[~self.sweep.failed[rows]]]

    def _column(self, measure: str) -> Array:
        if measure not in self.sweep.measures:
            raise ParameterError(f"There is no measure '{measure}'. There are: {', '.join(self.measures)}.")
        return self.sweep.measures[measure]

    def mean(self, measure: str) -> tuple[float, float]:
        """The mean of a measure and the standard error of it."""
        values = self.values(measure)
        return float(values.mean()), float(stats.sem(values))

    def quantiles(self, measure: str, shares: tuple[float, ...] = (0.025, 0.5, 0.975)) -> Array:
        """The values that are not passed by certain shares of the samples."""
        return np.asarray(np.quantile(self.values(measure), shares))

    def probability(self, measure: str, *, above: float | None = None, below: float | None = None) -> Probability:
        """How probable it is that a measure passes a limit.

        Law: the share of the samples that do, with the interval of Clopper and Pearson for independent ones; of Sobol'
        points it is as a rule too wide. Nothing is known of samples that failed: the value and the upper end count them
        as passing, the lower end as not.

        Args:
            measure: its name.
            above: upper limit, in the SI unit of the measure or with units.
            below: lower limit.

        Raises:
            ParameterError: there is no such measure or no limit, or a limit is no finite number or has the wrong
                unit.
        """
        if above is None and below is None:
            raise ParameterError("Give a limit, above=... or below=....")
        self.values(measure)
        rows = self.design.independent
        values, unit = self._column(measure)[rows], self.sweep.units.get(measure)
        passing = np.zeros(rows.size, dtype=bool)
        for name, limit, passed in (("above", above, np.greater), ("below", below, np.less)):
            if limit is not None:
                passing |= passed(values, in_si(name, limits_in_si(name, limit, unit)))
        most = int((passing | self.sweep.failed[rows]).sum())
        low, high = (
            stats.binomtest(count, rows.size).proportion_ci(self.level) for count in (int(passing.sum()), most)
        )
        return Probability(most / rows.size, float(low.low), float(high.high))

    def indices(self, measure: str) -> dict[str, dict[str, tuple[float, float]]]:
        """Where the uncertainty of a measure comes from: by index and parameter, the value and half its interval.

        S1 and ST of "sobol", mu* and sigma of "morris", as `uncertainty` explains them.

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
        if self.design.method == "morris" or self.sweep.failed.all():
            return []
        rows = [["", "mean", "+-", "deviation", "2.5 %", "50 %", "97.5 %"]]
        for measure in self.measures:
            mean, error = self.mean(measure)
            numbers = f"{mean:.6g}", f"{error:.2g}", f"{self.values(measure).std(ddof=1):.4g}"
            rows.append([measure, *numbers, *(f"{value:.6g}" for value in self.quantiles(measure))])
        return rows

    def _shares(self) -> list[list[str]]:
        """Cells of the table of indices, the strongest parameter first."""
        if self.design.method == "random" or self.sweep.failed.any():
            return []
        rows = list[list[str]]()
        for measure in self.measures:
            indices = self.indices(measure)
            leading = indices["ST"] if "ST" in indices else indices["mu*"]
            rows.append([measure, *(text for index in indices for text in (index, "+-"))])
            for name in sorted(leading, key=lambda name: -leading[name][0]):
                rows.append([name, *(f"{value:z.3g}" for by in indices.values() for value in by[name])])
        return rows

    @property
    def _title(self) -> str:
        failed = int(self.sweep.failed.sum())
        first = next((f", the first: {reason}" for reason in self.sweep.reasons if reason), "")
        return f"{self.sweep.name}: {counted(len(self), 'sample')}, {failed} failed{first}"

    def __str__(self) -> str:
        tables = [in_columns(rows, range(1, len(rows[0]))) for rows in (self._rows(), self._shares()) if rows]
        note = [self._unranked] if self._unranked else []
        return "\n".join([self._title, *chain.from_iterable(tables), *note])

    def _repr_html_(self) -> str:
        note, tables = self._unranked, [rows for rows in (self._rows(), self._shares()) if rows] or [[[]]]
        return "".join(html_table(self._title, rows[0], rows[1:], note) for rows in tables)

    def plot(self) -> Figure:
        """Histograms of the measures, and their indices where there are any (extra `plot`).

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        has_values, has_indices = self.design.method != "morris", self.design.method != "random"
        columns = has_values + has_indices
        figure = new_figure("Uncertainty.plot()", 4.6 * columns, 0.6 + 2.8 * len(self.measures), self.sweep.name)
        grid = figure.subplots(len(self.measures), columns, squeeze=False)
        for measure, axes in zip(self.measures, grid, strict=True):
            if has_values:
                axes[0].hist(self.values(measure), bins="auto", color="tab:blue")
                axes[0].set_xlabel(plain(measure))
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
