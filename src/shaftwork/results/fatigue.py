"""Load cycles of a quantity by rainflow counting, and what they take from a part by an S-N line and Miner's rule."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from shaftwork.core.errors import ParameterError, SignalError, imported
from shaftwork.core.parameters import in_si, whole, without_unit
from shaftwork.numerics.tolerances import EQUAL
from shaftwork.results.course import TurningPoints, turning_points
from shaftwork.results.observer import Array, Read, Reader
from shaftwork.results.plotting import new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BINS = 24


@dataclass(frozen=True, eq=False)
class Rainflow:
    """The load cycles of a quantity, in the order in which they start.

    Law: rainflow counting of ASTM E1049, 5.4.4. A cycle that closes counts 1, one that stays open to the end counts
    1/2. Analogue: a closed loop in the stress-strain diagram of the material. Source: package `rainflow`.

    Args:
        title: of the network.
        name: of the quantity.
        unit: of the quantity.
        duration: of the motion, s.
        turning: the peaks and valleys that were counted.
        range: (n,) peak minus valley of each cycle.
        mean: (n,) middle of peak and valley.
        count: (n,) 1 or 1/2.
        start: (n,) time of the cycle's first turning point, s.
        end: (n,) time of its second turning point, s.
    """

    title: str
    name: str
    unit: str
    duration: float
    turning: TurningPoints
    range: Array
    mean: Array
    count: Array
    start: Array
    end: Array

    @property
    def amplitude(self) -> Array:
        """(n,) half the range."""
        return 0.5 * self.range

    def __len__(self) -> int:
        return len(self.range)

    def matrix(self, bins: int | tuple[int, int] = BINS) -> tuple[Array, Array, Array]:
        """Cycles by range and mean: counts (ranges, means), edges of the ranges from 0 on, edges of the means.

        Args:
            bins: of both, or of ranges and means.

        Raises:
            ParameterError: no whole numbers above 0.
        """
        pair = bins if isinstance(bins, tuple) else (bins, bins)
        numbers = [count for count in map(whole, pair) if count is not None]
        if len(pair) != 2 or len(numbers) != 2:
            raise ParameterError(f"bins = {bins!r} must be a whole number above 0, or two: of ranges and of means.")
        low, high = (float(self.mean.min()), float(self.mean.max())) if len(self) else (0.0, 0.0)
        if high <= low:
            low, high = low - 0.5 * max(1.0, abs(low)), low + 0.5 * max(1.0, abs(low))
        limits = [(0.0, float(self.range.max(initial=0.0)) or 1.0), (low, high)]
        counts, ranges, means = np.histogram2d(self.range, self.mean, numbers, limits, weights=self.count)
        return counts, ranges, means

    def spectrum(self) -> tuple[Array, Array]:
        """Ranges in descending order, and how many cycles have at least this range."""
        order = np.argsort(-self.range, kind="stable")
        return self.range[order], np.cumsum(self.count[order])

    def equivalent(self, slope: float, cycles: float = 1.0) -> float:
        """The amplitude that, in so many equal cycles, does the damage of all of them.

        Law: (sum count amplitude^m / cycles)^(1/m).

        Args:
            slope: m of the S-N line.
            cycles: number of equal cycles.

        Raises:
            ParameterError: a number that is not above 0.
        """
        m, n = in_si("slope", slope, above=0), in_si("cycles", cycles, above=0)
        largest = float(self.amplitude.max(initial=0.0))
        if not largest:
            return 0.0
        return float(largest * (self.count @ (self.amplitude / largest) ** m / n) ** (1.0 / m))

    def plot(self, bins: int | tuple[int, int] = BINS) -> Figure:
        """The matrix of ranges and means beside the spectrum (extra `plot`).

        Args:
            bins: as in `matrix`.

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        return _picture(self, bins)

    def __str__(self) -> str:
        cycles = float(self.count.sum())
        head = f"{self.name} in '{self.title}': {cycles:g} cycles in {self.duration:g} s"
        if not len(self):
            return head
        most = 12  # cycles in the table
        lines = [f"{'range in ' + self.unit:>14}  {'mean':>12}  {'count':>5}  {'from s':>10}  {'to s':>10}"]
        for k in np.argsort(-self.range, kind="stable")[:most].tolist():
            row = f"{self.range[k]:>14.6g}  {self.mean[k]:>z12.6g}  {self.count[k]:>5g}"
            lines.append(f"{row}  {self.start[k]:>10.6g}  {self.end[k]:>10.6g}")
        more = len(self) - most
        return "\n".join([f"{head}, the largest of them:", *lines, *([f"and {more} smaller"] if more > 0 else [])])


def rainflow(read: Read, steps: Array, *, title: str, name: str, unit: str, smallest: float = EQUAL) -> Rainflow:
    """Count the cycles of a quantity.

    Args:
        read: the quantity at ascending times.
        steps: (s,) times between which it is smooth.
        title: of the network.
        name: of the quantity.
        unit: of the quantity.
        smallest: cycles up to this fraction of the whole range are left out.

    Raises:
        MissingExtraError: the package rainflow is not installed.
        ParameterError: `smallest` is no fraction.
    """
    extract_cycles = imported("rainflow", "life", "Solution.rainflow()").extract_cycles
    fraction = in_si("smallest", smallest, at_least=0, at_most=1)
    turning = turning_points(read, steps, smallest=fraction)
    values = turning.values
    gate = fraction * float(np.ptp(values))
    # which cycle closes which is decided on values without noise: a torque that returns to zero returns to the same one
    series = (np.round(values / gate) if gate else values).tolist()
    # the package knows an end by a value that follows: without one a single ramp would be no cycle
    cycles = sorted((first, second, count) for _, _, count, first, second in extract_cycles([*series, series[-1]]))
    table = np.array(cycles, dtype=float).reshape(-1, 3)
    first, second = np.minimum(table[:, :2].astype(np.intp), len(values) - 1).T
    ranges, means = np.abs(values[second] - values[first]), 0.5 * (values[first] + values[second])
    counted = ranges > gate
    start, end = turning.t[first][counted], turning.t[second][counted]
    duration = float(steps[-1] - steps[0])
    return Rainflow(
        title, name, unit, duration, turning, ranges[counted], means[counted], table[counted, 2], start, end
    )


def load_cycles(reader: Reader, name: str, place: int | None, smallest: float) -> Rainflow:
    """The load cycles of a quantity of a motion; see `Solution.rainflow`."""
    unit, places = reader.unit(name), reader.places(name)
    if place not in reader.numbers(name):
        if not places:
            raise SignalError(f"'{name}' is not read along a part. Leave out place={place!r}.")
        raise SignalError(
            f"'{name}' is read at {len(places)} places along the part; say which by place=0 to {len(places) - 1}. "
            f"places['{name}'] has them in m."
        )
    shown = name if place is None else f"{name} at {places[place]:g} m"
    read = reader.quantity(name, place)
    return rainflow(read, reader.steps, title=reader.title, name=shown, unit=unit, smallest=smallest)


def _picture(cycles: Rainflow, bins: int | tuple[int, int]) -> Figure:
    counts, ranges, means = cycles.matrix(bins)
    figure = new_figure("Rainflow.plot()", 11.0, 4.5, f"{cycles.title}: {cycles.name}")
    from matplotlib.colors import LogNorm

    left, right = figure.subplots(1, 2, width_ratios=(3, 2))
    unit = cycles.unit.replace("*", " ")
    shown = np.ma.masked_equal(counts, 0.0)
    colours = LogNorm(0.5, max(1.0, float(counts.max())))
    mesh = left.pcolormesh(means, ranges, shown, norm=colours, cmap="viridis")
    figure.colorbar(mesh, ax=left, label="cycles")
    left.set_xlabel(f"mean in {unit}")
    left.set_ylabel(f"range in {unit}")
    right.set_title("cycles of at least this range", fontsize="medium")
    size, number = cycles.spectrum()
    right.step(number, size, where="pre", linewidth=1.2)
    right.set_xscale("log")
    right.set_ylim(bottom=0.0)
    right.set_xlabel("cycles")
    right.grid(alpha=0.3)
    return figure


@dataclass(frozen=True, kw_only=True)
class SNLine:
    """The number of cycles that a part bears, over their amplitude: a straight line on logarithmic scales.

    Law: N = cycles (amplitude / a)^m with m = `slope`, or `slope_below` where a < `amplitude`; no damage up to `limit`.
    With `ultimate` a cycle about the mean b counts as the amplitude a / (1 - |b| / ultimate) (Goodman); where a + |b|
    reaches `ultimate` the part breaks at once: N = 0, and the damage is infinite. The sign of a mean torque makes no
    difference to a shaft. Amplitudes are those of the quantity that is counted: for a stress S at
    the surface of a round solid shaft the torque is S pi diameter^3 / 16. Source: ASTM E739, DIN 743-4.

    Args:
        amplitude: a point of the line, half of peak minus valley, in the unit of the quantity.
        cycles: that are borne there.
        slope: m.
        slope_below: second slope under this point; the same by default.
        limit: endurance limit, an amplitude.
        ultimate: what breaks the part at once; no influence of the mean by default.

    Raises:
        ParameterError: a number out of its bounds.
    """

    amplitude: float
    cycles: float
    slope: float
    slope_below: float | None = None
    limit: float = 0.0
    ultimate: float = math.inf

    def __post_init__(self) -> None:
        for item in fields(self):
            value = without_unit(item.name, getattr(self, item.name), "of the quantity that is counted, as N m")
            if item.name == "limit":
                in_si("limit", value, at_least=0)
            elif not (value is None and item.name == "slope_below") and value != math.inf:
                in_si(item.name, value, above=0)
        if not self.limit <= self.ultimate:
            raise ParameterError(f"limit = {self.limit:g} must not be above ultimate = {self.ultimate:g}.")

    def borne(self, amplitude: Array | float, mean: Array | float = 0.0) -> Array:
        """Cycles to failure; infinite at and below the limit, 0 where the mean or the peak alone breaks the part.

        Args:
            amplitude: any shape, in the unit of the quantity.
            mean: the same shape.
        """
        whose = "of the quantity that is counted, as N m"
        a = np.asarray(without_unit("amplitude", amplitude, whose), dtype=float)
        b = np.abs(np.asarray(without_unit("mean", mean, whose), dtype=float))
        share = 1.0 - b / self.ultimate
        with np.errstate(divide="ignore", over="ignore"):
            counted = np.where(share > 0.0, a / np.maximum(share, np.finfo(float).tiny), np.inf)
            below = self.slope if self.slope_below is None else self.slope_below
            relative = self.amplitude / counted
            cycles = self.cycles * relative ** np.where(relative > 1.0, below, self.slope)
        return np.where(counted <= self.limit, np.inf, np.where(counted >= self.ultimate, 0.0, cycles))


@dataclass(frozen=True, eq=False)
class Damage:
    """What one motion takes from the life of a part.

    Law: Palmgren and Miner, damage = sum count / N; the part fails at 1.

    Args:
        cycles: that were counted.
        sn: the S-N line.
        shares: (n,) damage of each cycle.
    """

    cycles: Rainflow
    sn: SNLine
    shares: Array

    @property
    def damage(self) -> float:
        """Fraction of the life that the motion takes."""
        return float(self.shares.sum())

    @property
    def repetitions(self) -> float:
        """How often the motion can be repeated."""
        return 1.0 / self.damage if self.damage else math.inf

    @property
    def hours(self) -> float:
        """Life in h of a machine that does nothing else."""
        return self.repetitions * self.cycles.duration / 3600.0

    def __str__(self) -> str:
        life = "endless" if math.isinf(self.repetitions) else f"{self.repetitions:.4g} repetitions, {self.hours:.4g} h"
        return f"{self.cycles.name} in '{self.cycles.title}': damage {self.damage:.4g}, life {life}"


def damage(cycles: Rainflow, sn: SNLine) -> Damage:
    """The damage of counted cycles by Miner's rule.

    Args:
        cycles: of a quantity.
        sn: the S-N line, in the unit of this quantity.
    """
    with np.errstate(divide="ignore"):
        return Damage(cycles, sn, cycles.count / sn.borne(cycles.amplitude, cycles.mean))


def damage_of(reader: Reader, name: str, sn: object, smallest: float) -> Damage:
    """The damage of a quantity of a motion; at the worst place, where it is read along a part."""
    if not isinstance(sn, SNLine):
        raise ParameterError(f"sn = {sn!r} must be an S-N line, such as SNLine(amplitude=300.0, cycles=1e6, slope=5).")
    by_place = [damage(load_cycles(reader, name, place, smallest), sn) for place in reader.numbers(name)]
    return max(by_place, key=lambda one: one.damage)


def damages(reader: Reader, sn: SNLine | Mapping[str, SNLine], smallest: float) -> dict[str, Damage]:
    """The damage of every shaft and spring, or of the quantities that S-N lines are given for."""
    lines = dict(sn) if isinstance(sn, Mapping) else dict.fromkeys(twisted(reader), sn)
    if not lines:
        raise SignalError(
            f"There is no shaft or spring in '{reader.title}'. Name a quantity: damage('part.tau', sn=...)."
        )
    return {name: damage_of(reader, name, line, smallest) for name, line in lines.items()}


def twisted(reader: Reader) -> tuple[str, ...]:
    """The torques of all that is twisted: springs and gaps have a twist, long shafts a torque along them.

    What turns with one node, as the torque of an engine does, has a speed of its own and is not twisted.
    """
    units = reader.observer.units
    parts = dict.fromkeys(name.rpartition(".")[0] for name in units)
    twisted = (
        part
        for part in parts
        if f"{part}.phi_rel" in units
        or ({f"{part}.phi", f"{part}.omega_rel"} <= units.keys() and f"{part}.omega" not in units)
    )
    along = (name for name in reader.observer.profiles if name.endswith(".tau"))
    return (*(f"{part}.tau" for part in twisted if f"{part}.tau" in units), *along)
