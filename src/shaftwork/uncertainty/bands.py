"""Courses of quantities over time for many samples of uncertain parameters, and the bands in which they lie."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import stats

from shaftwork.codegen.model_observer import ModelObserver
from shaftwork.core.errors import AccuracyWarning, NetworkWarning, ParameterError, SimulationError, no_quantity
from shaftwork.core.notebook import html_table
from shaftwork.core.notices import muted, warn
from shaftwork.core.screen import counted, in_columns
from shaftwork.pipeline.arguments import inner_share, seed_number
from shaftwork.pipeline.network import Network, network_of
from shaftwork.results.observer import Array, array_in_si
from shaftwork.results.plotting import label, new_figure
from shaftwork.results.solution import Solution
from shaftwork.sweep.sweep import sweep
from shaftwork.sweep.sweep_result import Sweep
from shaftwork.uncertainty.draws import Design, Distribution, distributions_in_si, refuse_samples

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Bands:
    """Courses of one quantity.

    Args:
        name: of the network.
        quantity: what is shown.
        unit: of it.
        t: (k,) times, s.
        courses: (samples, k), of those that did not fail.
        parameters: (samples,) values by parameter, of these.
        level: the share of courses, and of confidence, at each time by itself.
    """

    name: str
    quantity: str
    unit: str
    t: Array
    courses: Array
    parameters: Mapping[str, Array]
    level: float

    @property
    def mean(self) -> Array:
        """(k,) over the samples."""
        return np.asarray(self.courses.mean(axis=0))

    @property
    def of_courses(self) -> tuple[Array, Array]:
        """(k,) and (k,) between which a share `level` of the courses is at each time."""
        low, high = np.quantile(self.courses, [(1 - self.level) / 2, (1 + self.level) / 2], axis=0)
        return low, high

    @property
    def of_mean(self) -> tuple[Array, Array]:
        """(k,) and (k,) the confidence interval of the mean at each time, by Student's t."""
        count = len(self.courses)
        half = stats.t.ppf((1 + self.level) / 2, count - 1) * self.courses.std(axis=0, ddof=1) / np.sqrt(count)
        return self.mean - half, self.mean + half

    def _rows(self) -> tuple[str, list[str], list[list[str]]]:
        """Title, headings, and rows at eleven of the times, or all where they are fewer."""
        unit = f" in {self.unit}" if self.unit != "1" else ""
        title = (
            f"{self.name}: {self.quantity}{unit} of {counted(len(self.courses), 'course')}, to {100 * self.level:g} %"
        )
        columns = [self.t, self.mean, *self.of_mean, *self.of_courses]
        shown = np.unique(np.linspace(0, self.t.size - 1, min(self.t.size, 11)).round().astype(int))
        rows = [[f"{column[k]:.6g}" for column in columns] for k in shown.tolist()]
        return title, ["t in s", "mean", "from", "to", "courses from", "to"], rows

    def __str__(self) -> str:
        title, header, rows = self._rows()
        return "\n".join([title, *in_columns([header, *rows], range(len(header)))])

    def _repr_html_(self) -> str:
        return html_table(*self._rows())

    def plot(self) -> Figure:
        """The mean, its confidence band and the band of the courses (extra `plot`).

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        figure = new_figure("Bands.plot()", 9.0, 3.6, self.name)
        axes = figure.subplots()
        percent = f"{100 * self.level:g} %"
        axes.fill_between(self.t, *self.of_courses, color="tab:blue", alpha=0.2, label=f"{percent} of the courses")
        axes.fill_between(self.t, *self.of_mean, color="tab:blue", alpha=0.5, label=f"mean, to {percent}")
        axes.plot(self.t, self.mean, color="tab:blue", linewidth=1)
        axes.set_xlabel("t in s")
        axes.set_ylabel(label(self.quantity, self.unit))
        axes.legend(fontsize=8)
        return figure


def bands(
    net: Network,
    quantity: str,
    t: Sequence[float] | Array,
    distributions: Mapping[str, Distribution],
    *,
    samples: int | None = None,
    level: float = 0.95,
    seed: int = 0,
    **options: Any,
) -> Bands:
    """Simulate samples of uncertain parameters, or all seeds of a noise, and show in which band a quantity stays.

    The bands hold at each time by itself: more courses than the share leave the band at some time. Parameters are taken
    as independent of each other.

    Args:
        net: the network.
        quantity: "shaft.tau".
        t: times in s, ascending.
        distributions: as in `uncertainty`; of one list, such as {"soil.seed": range(50)}, each value is taken once
            where `samples` is left out.
        samples: how many; by default 100.
        level: the share of courses within the band, and the confidence of the mean.
        seed: of the random numbers.
        **options: of `sweep`: rtol, engine, initial, steady, processes, store and so on.

    Raises:
        ParameterError: an argument is out of its range, or a sample is not admissible; says which.
        SignalError: there is no such quantity.
        SimulationError: fewer than two samples could be simulated; says why.

    Warns:
        AccuracyWarning: some samples failed and are missing in the bands; says how many and why the first one did.
    """
    units, times = _units(net, quantity), array_in_si("t", t, "s")
    ascends = bool(times.size and np.isfinite(times).all() and (np.diff(times) > 0.0).all())
    if not (ascends and times[0] >= 0.0 and times[-1]):
        raise ParameterError("t must be times in s that ascend from zero or later, such as np.linspace(0.0, 1.0, 101).")
    if taken := [name for name in ("t_end", "t_eval", "measures") if name in options]:
        raise ParameterError(f"bands has no {taken[0]}: it shows the quantity at the times t. Leave it out.")
    level = inner_share("level", level)
    columns = _columns(net, distributions_in_si(net, distributions), samples, seed_number(seed))
    if len(next(iter(columns.values()))) < 2:
        raise ParameterError("A band needs two samples or more.")
    course = _Course()
    measures = {f"{quantity} at {time!r} s": partial(course.at, quantity, k) for k, time in enumerate(times.tolist())}
    found = sweep(net, samples=columns, t_end=float(times[-1]), t_eval=times, measures=measures, **options)
    good = _good(found)
    return Bands(
        net.name, quantity, units[quantity], times, np.column_stack([*good.measures.values()]), good.parameters, level
    )


def _units(net: Network, quantity: str) -> Mapping[str, str]:
    """By quantity.

    Raises:
        SignalError: that one is not among them.
    """
    with muted(NetworkWarning):  # the sweep compiles it as well, and warns
        model = network_of(net).compile()
    units = ModelObserver(model.form, model.bind).units
    if quantity not in units:
        raise no_quantity(quantity, model.name, units)
    return units


class _Course:
    """A quantity over time, whose values a sweep measures one after the other."""

    def __init__(self) -> None:
        self._last: tuple[Solution, Array] | None = None

    def at(self, quantity: str, k: int, motion: Solution) -> float:
        """The value at output time k."""
        if self._last is None or self._last[0] is not motion:
            self._last = motion, motion[quantity]
        return float(self._last[1][k])


def _good(found: Sweep) -> Sweep:
    """The samples that did not fail.

    Raises:
        SimulationError: fewer than two are left.
    """
    if not found.failed.any():
        return found
    first, failed = int(np.argmax(found.failed)), int(found.failed.sum())
    values = {name: float(column[first]) for name, column in found.parameters.items()}
    told = f"{failed} of {counted(len(found), 'sample')} failed, the first, {values}: {found.reasons[first]}"
    if len(found) - failed < 2:
        raise SimulationError(f"'{found.name}': no bands, which need two samples or more: {told}")
    warn(f"'{found.name}': the bands are those of the other samples: {told}", AccuracyWarning)
    return found.rows(~found.failed)


def _columns(
    net: Network, distributions: Mapping[str, Distribution], samples: int | None, seed: int
) -> Mapping[str, Array]:
    """Samples by parameter; of one list alone each value once."""
    ((name, values), *others) = distributions.items()
    if samples is None and not others and isinstance(values, np.ndarray):
        return {name: values}
    design = Design(distributions, "random", 100 if samples is None else samples, seed)
    refuse_samples(net, design)
    return design.columns
