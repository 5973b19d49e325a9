"""What a sweep has found: a table of variants, which of them meet the requirements, the best, and a picture."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from shaftwork.core.errors import ParameterError, imported
from shaftwork.core.files import replaced
from shaftwork.core.notebook import html_table
from shaftwork.core.parameters import is_quantity, whole
from shaftwork.core.screen import ROWS, counted, in_columns
from shaftwork.pipeline.measured_units import limits_in_si
from shaftwork.results.observer import Array
from shaftwork.results.plotting import label, new_figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

VERDICTS = ("passed", "reason")
"""Columns of the table behind those of parameters and measures."""

Limits = tuple[float | None, float | None]
"""The least and the most that is allowed; None leaves a side open."""


def requirements(require: Any) -> Mapping[str, Any]:
    """What a user requires; nothing of None.

    Raises:
        ParameterError: it is no mapping.
    """
    if not isinstance(require, Mapping | None):
        raise ParameterError(f"require = {require!r} must map measures to limits, {{'max shaft.tau': (None, 350.0)}}.")
    return require or {}


def limits_of(require: Mapping[str, Any], unit_of: Callable[[str], str | None]) -> dict[str, Limits]:
    """Limits that a user gave, by name, in SI.

    Args:
        require: numbers or quantities; what is infinite leaves a side open, as None does.
        unit_of: the SI unit of a name, which is asked for where a limit has units; None where it is not known.

    Raises:
        ParameterError: one is no pair of numbers, has the wrong units, or nothing lies between its sides.
    """
    limits: dict[str, Limits] = {}
    for name, given in require.items():
        sides = given if isinstance(given, tuple | list) else [given]
        for side in sides:
            if isinstance(side, str | bytes):
                raise ParameterError(
                    f"require['{name}'] = {given!r}: {side!r} is a text. Give a number in the SI unit of the measure."
                )
        pair = limits_in_si(f"require['{name}']", given, unit_of(name)) if any(map(is_quantity, sides)) else given
        try:
            low, high = (
                None if side is None or float(side) == beyond else float(side)
                for side, beyond in zip(pair, (-math.inf, math.inf), strict=True)
            )
        except (TypeError, ValueError):
            raise ParameterError(
                f"require['{name}'] = {given!r} must be (low, high); None leaves a side open."
            ) from None
        ends = [end for end in (low, high) if end is not None]
        if not all(map(math.isfinite, ends)) or ends != sorted(ends):
            raise ParameterError(
                f"require['{name}'] = {given!r}: no value is at least {low} and at most {high}. Write (low, high)."
            )
        limits[name] = (low, high)
    return limits


@dataclass(frozen=True, eq=False)
class Sweep:
    """Variants of a network and their measures.

    Args:
        name: of the network.
        parameters: (k,) values in SI by parameter.
        measures: (k,) by measure; NaN where the variant failed.
        require: limits by measure.
        reasons: why each variant failed; empty where it did not.
        why: why variants ran one by one, and how many, where some did; empty where all ran side by side.
        errors: in single precision, by measure, how far 16 variants all over the sweep differ from double precision at
            most, as a part of the largest value of these; else empty.
        units: by parameter and measure, SI; not of functions, whose units are not known.
    """

    name: str
    parameters: Mapping[str, Array]
    measures: Mapping[str, Array]
    require: Mapping[str, Limits]
    reasons: tuple[str, ...]
    why: str = ""
    errors: Mapping[str, float] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.reasons)

    @property
    def failed(self) -> NDArray[np.bool_]:
        """(k,) whether a variant failed."""
        return np.array([bool(reason) for reason in self.reasons], dtype=bool)

    @property
    def passed(self) -> NDArray[np.bool_]:
        """(k,) whether a variant did not fail and meets every requirement."""
        good = ~self.failed
        for _, missed in self._missed():
            good &= ~missed
        return good

    def _missed(self) -> Iterator[tuple[str, NDArray[np.bool_]]]:
        """Each limit in words, and (k,) which variants miss it."""
        for name, (low, high) in self.require.items():
            unit = f" {self.units[name]}" if self.units.get(name, "1") != "1" else ""
            if low is not None:
                yield f"{name} below {low:g}{unit}", ~(self.measures[name] >= low)
            if high is not None:
                yield f"{name} above {high:g}{unit}", ~(self.measures[name] <= high)

    @property
    def _verdicts(self) -> NDArray[np.object_]:
        """(k,) texts: why a variant failed, else the limits that it misses; empty where it passed."""
        texts, failed = np.array(self.reasons, dtype=object), self.failed
        for words, missed in self._missed():
            rows = np.flatnonzero(missed & ~failed)
            texts[rows] = [f"{text}, {words}" if text else words for text in texts[rows]]
        return texts

    @property
    def columns(self) -> dict[str, Any]:
        """Parameters, measures, whether a variant passed, and if not, how it failed or which limits it misses."""
        verdicts = self.passed, self._verdicts
        return {**self.parameters, **self.measures, **dict(zip(VERDICTS, verdicts, strict=True))}

    def table(self) -> pd.DataFrame:
        """The columns as a data frame (extra `data`)."""
        frame: pd.DataFrame = imported("pandas", "data", "Sweep.table()").DataFrame(self.columns)
        return frame

    def best(
        self, measure: str, count: int | None = None, *, largest: bool = False, ignore_require: bool = False
    ) -> Sweep:
        """The variants that meet the requirements, ranked.

        Args:
            measure: by which; the smallest comes first.
            count: how many at most.
            largest: the largest comes first.
            ignore_require: whether variants that miss a requirement are ranked too, all but those that failed.

        Raises:
            ParameterError: there is no such measure, or the count is no number of variants.
        """
        if measure not in self.measures:
            raise ParameterError(f"There is no measure '{measure}'. There are: {', '.join(self.measures)}.")
        if count is not None and whole(count) is None:
            raise ParameterError(f"count = {count!r} must be a number, 1 or more; leave it out for all that pass.")
        rows = np.flatnonzero(~self.failed if ignore_require else self.passed)
        values = self.measures[measure][rows]
        return self.rows(rows[np.argsort(-values if largest else values, kind="stable")][:count])

    def rows(self, rows: Any) -> Sweep:
        """Some of the variants, by their numbers or marked."""
        taken = np.arange(len(self))[rows]
        return Sweep(
            self.name,
            {name: column[taken] for name, column in self.parameters.items()},
            {name: column[taken] for name, column in self.measures.items()},
            self.require,
            tuple(self.reasons[k] for k in taken.tolist()),
            self.why,
            self.errors,
            self.units,
        )

    def to_csv(self, path: str | Path) -> None:
        """Write all columns.

        Raises:
            ParameterError: the file cannot be written.
        """
        columns = self.columns
        try:
            with replaced(path) as file:
                writer = csv.writer(file)
                writer.writerow(columns)
                writer.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
        except OSError as error:
            raise ParameterError(
                f"'{path}' cannot be written: {error.strerror}. Give a file in a folder that exists."
            ) from None

    def plot(self, *names: str) -> Figure:
        """Parallel coordinates: a line for each variant, through its parameters and measures (extra `plot`).

        Of more than 2000 variants some that are spread evenly over all are shown: more lines would hide each other.

        Args:
            *names: of the columns; by default all.

        Raises:
            ParameterError: there is no such column.
            MissingExtraError: matplotlib is not installed.
        """
        return _parallel_coordinates(self, names)

    def _rows(self, count: int) -> tuple[str, list[str], list[list[str]]]:
        """What is said of all variants, headings, and cells: units, and below them the first variants."""
        columns, passed, why = {**self.parameters, **self.measures}, self.passed, self._verdicts
        rows = [
            [
                f"{k}",
                *(f"{values[k]:z.6g}" for values in columns.values()),
                "yes" if passed[k] else "no",
                why[k],
            ]
            for k in range(min(len(self), count))
        ]
        failed = int(self.failed.sum())
        counts = f"{self.name}: {counted(len(self), 'variant')}, {int(passed.sum())} passed, {failed} failed"
        if self.errors:
            parts = ", ".join(f"{name} {error:.0e}" for name, error in self.errors.items())
            counts = f"{counts}; off by single precision: {parts}"
        units = [self.units.get(name, "") for name in columns]
        if any(units):
            rows.insert(0, ["", *units, "", ""])
        return counts, ["", *columns, "passed", "reason" if any(why) else ""], rows

    def __str__(self) -> str:
        counts, header, rows = self._rows(ROWS)
        lines = in_columns([header, *rows], range(len(header) - 1))
        more = [f"and {len(self) - ROWS} more"] if len(self) > ROWS else []
        return "\n".join([counts, *lines, *more])

    def _repr_html_(self) -> str:
        return html_table(*self._rows(len(self)))


def _parallel_coordinates(sweep: Sweep, names: tuple[str, ...]) -> Figure:
    """Each axis from the smallest to the largest value; what does not meet the requirements is grey, limits are red."""
    columns = {**sweep.parameters, **sweep.measures}
    if unknown := [name for name in names if name not in columns]:
        raise ParameterError(f"There is no column '{unknown[0]}'. There are: {', '.join(columns)}.")
    shown = names or tuple(columns)
    figure = new_figure("Sweep.plot()", 2.2 * max(len(shown), 2), 4.8)
    from matplotlib.collections import LineCollection

    good = np.flatnonzero(~sweep.failed)
    rows = good[np.unique(np.linspace(0, good.size - 1, 2000).round().astype(int))] if good.size else good
    low = {name: float(columns[name][good].min()) for name in shown} if good.size else {}
    size = {name: (float(columns[name][good].max()) - low[name]) or 1.0 for name in low}
    axes = figure.subplots()
    shares = [(columns[name][rows] - low[name]) / size[name] for name in low]
    lines = np.array([list(enumerate(heights)) for heights in zip(*shares, strict=True)])
    passed = sweep.passed[rows]
    for chosen, color, order in ((~passed, "0.8", 1), (passed, "tab:blue", 2)):
        if chosen.any():
            axes.add_collection(
                LineCollection(list(lines[chosen]), colors=color, linewidths=0.7, alpha=0.6, zorder=order)
            )
    for k, name in enumerate(shown):
        axes.axvline(k, color="0.3", linewidth=0.8, zorder=3)
        for share in np.linspace(0.0, 1.0, 5) if name in low else ():
            text = f"{low[name] + share * size[name]:.4g}"
            axes.annotate(text, (k, share), (3, 0), textcoords="offset points", fontsize=7, va="center", zorder=4)
        for limit in sweep.require.get(name, ()) if name in low else ():
            if limit is not None:
                axes.plot([k - 0.08, k + 0.08], [(limit - low[name]) / size[name]] * 2, color="tab:red", zorder=4)
    axes.set_xlim(-0.2, len(shown) - 0.5)
    axes.set_ylim(-0.05, 1.05)
    axes.set_xticks(range(len(shown)), [label(name, sweep.units.get(name, ""), "\n") for name in shown], fontsize=8)
    axes.set_yticks([])
    some = f", {rows.size} of them shown" if rows.size < good.size else ""
    title = f"{sweep.name}: {len(sweep)} variants, {int(sweep.passed.sum())} meet the requirements{some}"
    axes.set_title(title, fontsize=10)
    return figure
