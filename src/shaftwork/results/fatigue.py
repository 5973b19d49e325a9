"""Fatigue life: what the cycles of a load take from a part, by an S-N line and Miner's rule."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from shaftwork.core.errors import ParameterError, SignalError
from shaftwork.core.parameters import in_si, without_unit
from shaftwork.results.observer import Array
from shaftwork.results.rainflow import Rainflow, load_cycles
from shaftwork.results.reader import Reader


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
    lines = dict(sn) if isinstance(sn, Mapping) else dict.fromkeys(_twisted(reader), sn)
    if not lines:
        raise SignalError(
            f"There is no shaft or spring in '{reader.title}'. Name a quantity: damage('part.tau', sn=...)."
        )
    return {name: damage_of(reader, name, line, smallest) for name, line in lines.items()}


def _twisted(reader: Reader) -> tuple[str, ...]:
    """The torques of all that is twisted: springs and gaps have a twist, long shafts a torque along them."""
    units = reader.observer.units
    parts = dict.fromkeys(name.rpartition(".")[0] for name in units)
    twisted = (
        part for part in parts if f"{part}.phi_rel" in units or {f"{part}.phi", f"{part}.omega_rel"} <= units.keys()
    )
    along = (name for name in reader.observer.profiles if name.endswith(".tau"))
    return (*(f"{part}.tau" for part in twisted if f"{part}.tau" in units), *along)
