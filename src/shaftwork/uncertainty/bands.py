"""Courses of quantities over time for many samples of uncertain parameters, and the bands in which they lie."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import stats

from shaftwork.core.errors import ParameterError, SimulationError
from shaftwork.core.screen import progress
from shaftwork.pipeline.network import Network, network_of
from shaftwork.results.observer import Array, array_in_si
from shaftwork.results.plotting import new_figure, plain
from shaftwork.uncertainty.draws import Design, Distribution, distributions_in_si

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
        courses: (samples, k).
        parameters: (samples,) values by parameter.
        level: the share of courses, and of confidence.
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
        axes.set_ylabel(plain(f"{self.quantity} in {self.unit}"))
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

    Args:
        net: the network.
        quantity: "shaft.tau".
        t: times in s, ascending.
        distributions: as in `uncertainty`; of one list, such as {"soil.seed": range(50)}, each value is taken once
            where `samples` is left out.
        samples: how many.
        level: the share of courses within the band, and the confidence of the mean.
        seed: of the random numbers.
        **options: of `Model.simulate`.

    Raises:
        ParameterError: an argument is out of its range, or a sample is not admissible; says which.
        SignalError: there is no such quantity.
        SimulationError: a sample could not be simulated; says which.
    """
    model, times = network_of(net).compile(), array_in_si("t", t, "s")
    if not (times.size and np.isfinite(times).all() and (np.diff(times) >= 0.0).all()):
        raise ParameterError("t must be times in s that ascend, such as np.linspace(0.0, 1.0, 101).")
    if not 0.0 < level < 1.0:
        raise ParameterError(f"level = {level!r} must lie between 0 and 1.")
    columns = _columns(distributions_in_si(net, distributions), samples, seed)
    count = len(next(iter(columns.values())))
    if count < 2:
        raise ParameterError("A band needs two samples or more.")
    courses, unit = np.empty((count, times.size)), ""
    with progress(count, "samples", "compiling") as show:
        for k in range(count):
            values = {name: float(column[k]) for name, column in columns.items()}
            try:
                motion = model.simulate(float(times[-1]), parameters=values, t_eval=times, **options)
            except (ParameterError, SimulationError) as error:
                raise type(error)(f"The sample {values} could not be simulated: {error}") from error
            courses[k], unit = motion[quantity], motion.observer.units[quantity]
            show(k + 1, "bands")
    return Bands(model.name, quantity, unit, times, courses, columns, level)


def _columns(distributions: Mapping[str, Distribution], samples: int | None, seed: int) -> Mapping[str, Array]:
    """Samples by parameter; of one list alone each value once."""
    ((name, values), *others) = distributions.items()
    if samples is None and not others and isinstance(values, np.ndarray):
        return {name: values}
    return Design(distributions, "random", 100 if samples is None else samples, seed).columns
