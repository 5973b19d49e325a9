"""What a motion asks of its motor: torque, power and speed at the motor's shaft, and the heat they stand for."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from shaftwork.core.errors import MissingExtraError, ParameterError
from shaftwork.core.parameters import in_si
from shaftwork.results.observer import Array
from shaftwork.results.quadrature import LobattoPanels
from shaftwork.sizing.motor_shaft import MotorShaft
from shaftwork.sizing.reserve import Limit, Reserve, reserve_of
from shaftwork.sizing.run_up import run_up

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

TYPES = ("S1", "S3")
LONG_CYCLE = 600.0
"""Duration of a duty cycle in s that IEC 60034-1, 4.2.3, takes where none is agreed on."""
BRIEF = 1e-9
"""Part of a cycle that is no time: at the ends of standstill a torque may be read that jumps there."""


@dataclass(frozen=True)
class Flow:
    """Power in one direction.

    Args:
        duration: time with power in this direction, s.
        energy: J, positive.
        peak: largest power, W, positive.
        rms: effective value during `duration`, W.
    """

    duration: float
    energy: float
    peak: float
    rms: float

    @property
    def mean(self) -> float:
        """Mean during `duration`, W."""
        return self.energy / self.duration if self.duration else 0.0


@dataclass(frozen=True, eq=False)
class Duty:
    """A duty cycle of a motor, at the motor's own shaft.

    Integrals are those of the motion, split where torque jumps or power changes its sign, not sums over output times.

    Args:
        title: of the network.
        motor: name of the motor, or of the torque.
        duration: of the cycle, rest after the motion included, s.
        tau_rms: effective torque over the cycle, sqrt(integral of tau^2 / duration), N m.
        tau_mean: mean torque over the cycle, with sign, N m.
        tau_max: largest torque, N m.
        tau_min: smallest torque, N m; below zero where the motor brakes, or turns backwards.
        power_rms: effective power over the cycle, W.
        power_mean: mean power over the cycle, braking counted negative, W.
        motoring: power from the motor into the train.
        braking: power from the train into the motor.
        n_top: highest speed in size, 1/min.
        n_mean: mean size of the speed over the cycle, 1/min.
        loaded: time with torque or speed, s; starting and braking are in it.
        held: time at standstill with torque, s; it is part of `loaded`.
        cooled: the cycle in time of full cooling, integral of the cooling over the time, s.
        cooling: heat given off at standstill over that at full cooling.
        n_cooling: speed from which cooling is full, 1/min; 0 for the highest one of a motor that never turns.
        shaft: where torque and speed are read.
        panels: of the motion, torque and power smooth in each.
    """

    title: str
    motor: str
    duration: float
    tau_rms: float
    tau_mean: float
    tau_max: float
    tau_min: float
    power_rms: float
    power_mean: float
    motoring: Flow
    braking: Flow
    n_top: float
    n_mean: float
    loaded: float
    held: float
    cooled: float
    cooling: float
    n_cooling: float
    shaft: MotorShaft = field(repr=False)
    panels: LobattoPanels = field(repr=False)

    @property
    def tau_peak(self) -> float:
        """Largest torque in size, N m."""
        return max(abs(self.tau_max), abs(self.tau_min))

    @property
    def power_peak(self) -> float:
        """Largest power in size, W."""
        return max(self.motoring.peak, self.braking.peak)

    @property
    def rest(self) -> float:
        """Time at standstill without torque, s."""
        return max(self.duration - self.loaded, 0.0)

    @property
    def cyclic_duration_factor(self) -> float:
        """Time of load, starting and braking included, over duration of the cycle: IEC 60034-1, 3.2 and 4.2.3."""
        return self.loaded / self.duration

    def thermal(self, duty_type: str = "S1", factor: Any = None) -> float:
        """The constant torque in N m that heats the motor as the cycle does; not more than its rating may be.

        Law: equal copper losses, proportional to the square of the torque. S1: sqrt(integral of tau^2 / t_c), where t_c
        is the duration of the cycle, or the time of full cooling (`cooled`) for a motor that cools itself. S3:
        sqrt(integral of tau^2 / (factor duration)), for a motor rated for S3 at this cyclic duration factor; at the
        factor of the cycle that is the effective torque of its time under load. Source: IEC 60034-1, 4.2.1 and 4.2.3,
        defines S1, S3 and the factor; the equivalent torque is practice and no formula of the standard. It holds for
        cycles much shorter than the thermal time constant (the standard has 10 min for S3) and constant flux.

        Args:
            duty_type: "S1" or "S3".
            factor: of an S3 rating, such as 0.25; by default that of the cycle.

        Raises:
            ParameterError: there is no such type, or no such factor.
        """
        if duty_type not in TYPES:
            raise ParameterError(f"There is no duty type {duty_type!r} here. There are: {', '.join(TYPES)}.")
        if duty_type == "S1":
            if factor is not None:
                raise ParameterError(f"factor = {factor!r}: S1 is continuous and has none. Leave it out, or take 'S3'.")
            return self.tau_rms * math.sqrt(self.duration / self.cooled)
        share = self.cyclic_duration_factor if factor is None else in_si("factor", factor, above=0, at_most=1)
        return self.tau_rms / math.sqrt(share) if share else 0.0

    def acceleration_time(self, share: Any = 1.0) -> float:
        """Time in s from standstill until the speed first has a share of its highest value in size.

        It counts from the last standstill before, or from the start of the motion. The highest speed is reached where
        it peaks, or where it begins to stay as it is. A motor that settles asymptotically
        comes to its highest speed late: ask for a share such as 0.95.

        Args:
            share: of the highest speed.

        Raises:
            ParameterError: it is no share, or nothing moves.
        """
        part = in_si("share", share, above=0, at_most=1)
        if not self.n_top:
            raise ParameterError(f"'{self.motor}' does not move in '{self.title}'; there is no acceleration.")
        return run_up(self.shaft, part)

    def reserve(self, limit: Limit = None) -> Reserve:
        """How far the torque stays below a limit, at the worst instant of the motion.

        Args:
            limit: largest torque in size in N m over the motor's speed in 1/min: a number, a `Table`, or a function of
                an array of speeds, all without sign. By default the pull-out torque of the motor's own curve at each
                instant: a motor that starts on the mains goes through it, and has no reserve there.

        Raises:
            ParameterError: the motor has no curve of torque over speed, or the limit is no such thing.
        """
        return reserve_of(self.shaft, limit)

    def plot(self, limit: Limit = None) -> Figure:
        """The motion in the plane of speed and torque, with the motor's own curve and a limit (extra `plot`).

        Args:
            limit: as in `reserve`.

        Raises:
            MissingExtraError: matplotlib is not installed.
            ParameterError: the limit is no limit.
        """
        from shaftwork.sizing.picture import speed_torque_plane

        return speed_torque_plane(self, limit)

    @property
    def figures(self) -> Mapping[str, tuple[float, str]]:
        """All figures with their units."""
        return {
            "cycle": (self.duration, "s"),
            "time under load": (self.loaded, "s"),
            "cyclic duration factor": (100 * self.cyclic_duration_factor, "%"),
            "torque, effective": (self.tau_rms, "N*m"),
            "torque, mean": (self.tau_mean, "N*m"),
            "torque, largest": (self.tau_max, "N*m"),
            "torque, smallest": (self.tau_min, "N*m"),
            "thermal torque, S1": (self.thermal("S1"), "N*m"),
            "thermal torque, S3 at the factor": (self.thermal("S3"), "N*m"),
            "power, effective": (self.power_rms, "W"),
            "power, mean": (self.power_mean, "W"),
            "motoring, peak": (self.motoring.peak, "W"),
            "motoring, mean": (self.motoring.mean, "W"),
            "motoring, energy": (self.motoring.energy, "J"),
            "braking, peak": (self.braking.peak, "W"),
            "braking, mean": (self.braking.mean, "W"),
            "braking, energy": (self.braking.energy, "J"),
            "speed, highest": (self.n_top, "1/min"),
            "speed, mean": (self.n_mean, "1/min"),
            **(
                {
                    "to 95 % of the highest speed": (self.acceleration_time(0.95), "s"),
                    "to the highest speed": (self.acceleration_time(), "s"),
                }
                if self.n_top
                else {}
            ),
        }

    def to_pandas(self) -> pd.DataFrame:
        """The figures as a data frame (extra `data`).

        Raises:
            MissingExtraError: pandas is not installed.
        """
        try:
            import pandas as pd
        except ImportError:
            raise MissingExtraError("pandas", "data", "Duty.to_pandas()") from None
        return pd.DataFrame.from_dict(self.figures, orient="index", columns=["value", "unit"])

    @cached_property
    def jumps(self) -> Array:
        """Times in s at which the speed jumps, the start of the motion among them where it jumps from rest."""
        return _jumps(self.shaft)

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader of the figures must know."""
        shaft, made = self.shaft, list[str]()
        if shaft.ratio != 1 or shaft.efficiency != 1:
            whose = "the motor's own gear" if shaft.own_gear else "the gear that was given"
            made.append(f"at the motor's shaft, before {whose}: ratio {shaft.ratio:g}, efficiency {shaft.efficiency:g}")
        if self.held > BRIEF * self.duration:
            made.append(f"torque is held at standstill for {self.held:.6g} s; at_rest='released' if a brake does that")
        start, last = shaft.steps[0], "what an inertia rigidly there takes at once is in no figure"
        if start in self.jumps:
            made.append(f"from rest the speed jumps at {start:.6g} s; {last}")
        if (later := self.jumps[self.jumps > start]).size:
            made.append(f"the speed jumps at {later[0]:.6g} s; {last}")
        if self.cooling < 1:
            full = f"full from {self.n_cooling:.6g} 1/min on" if self.n_cooling else "where it is all the time"
            made.append(f"cooling {self.cooling:g} at standstill, {full}")
        if self.duration > LONG_CYCLE:
            made.append("the cycle is longer than 10 min; the motor may come to its limits before an average tells")
        return tuple(made)

    def __str__(self) -> str:
        rows = [f"{name:34}{value:>z12.6g} {unit}" for name, (value, unit) in self.figures.items()]
        return "\n".join((f"duty of {self.motor} in '{self.title}'", *rows, *(f"- {note}" for note in self.notes)))


def cooling_at(n: Array, cooling: float, n_cooling: Any) -> Array:
    """Cooling over full cooling at speeds in 1/min: a straight line from standstill on."""
    share = np.minimum(n / n_cooling, 1.0) if np.all(n_cooling) else np.zeros_like(n)  # it never turns
    return np.asarray(cooling + (1.0 - cooling) * share)


def _jumps(shaft: MotorShaft) -> Array:
    """Times in s at which the speed of the motor jumps."""
    start, ends = shaft.steps[:1], shaft.steps[1:]
    (_, before), (_, after) = shaft.read(np.nextafter(ends, -np.inf)), shaft.read(ends)
    least, prescribed = BRIEF * shaft.omega_top, abs(shaft.omega_prescribed)
    return np.concatenate([start[[prescribed > least]], ends[np.abs(after - before) > least]])
