"""What a motion asks of its motor: torque, power and speed at the motor's shaft, and the heat they stand for."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from shaftwork.core.errors import ParameterError, imported
from shaftwork.core.parameters import in_si
from shaftwork.numerics.tolerances import SAME, TYPED
from shaftwork.results.course import LobattoPanels, integrate, turning_points
from shaftwork.results.observer import RPM, Array
from shaftwork.sizing.motor_shaft import MotorShaft, motor_shaft, run_up
from shaftwork.sizing.reserve import Limit, Reserve, reserve_of, speed_torque_plane

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

TYPES = ("S1", "S3")


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
        return speed_torque_plane(self.shaft, self.thermal("S1"), limit)

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
        frames: type[pd.DataFrame] = imported("pandas", "data", "Duty.to_pandas()").DataFrame
        return frames.from_dict(self.figures, orient="index", columns=["value", "unit"])

    @cached_property
    def jumps(self) -> Array:
        """Times in s at which the speed jumps, the start of the motion among them where it jumps from rest."""
        shaft, start, ends = self.shaft, self.shaft.steps[:1], self.shaft.steps[1:]
        before, after = shaft.omega(np.nextafter(ends, -np.inf)), shaft.omega(ends)
        least, prescribed = TYPED * shaft.omega_top, abs(shaft.omega_prescribed)
        return np.concatenate([start[[prescribed > least]], ends[np.abs(after - before) > least]])

    @property
    def notes(self) -> tuple[str, ...]:
        """What a reader of the figures must know."""
        shaft, notes = self.shaft, list[str]()
        if shaft.ratio != 1 or shaft.efficiency != 1:
            whose = "the motor's own gear" if shaft.own_gear else "the gear that was given"
            notes.append(
                f"at the motor's shaft, before {whose}: ratio {shaft.ratio:g}, efficiency {shaft.efficiency:g}"
            )
        if self.held > TYPED * self.duration:
            notes.append(f"torque is held at standstill for {self.held:.6g} s; at_rest='released' if a brake does that")
        start, last = shaft.steps[0], "what an inertia rigidly there takes at once is in no figure"
        if start in self.jumps:
            notes.append(f"from rest the speed jumps at {start:.6g} s; {last}")
        if (later := self.jumps[self.jumps > start]).size:
            notes.append(f"the speed jumps at {later[0]:.6g} s; {last}")
        if self.cooling < 1:
            full = f"full from {self.n_cooling:.6g} 1/min on" if self.n_cooling else "where it is all the time"
            notes.append(f"cooling {self.cooling:g} at standstill, {full}")
        # IEC 60034-1, 4.2.3, takes 600 s where no duration is agreed on
        if self.duration > 600.0:
            notes.append("the cycle is longer than 10 min; the motor may come to its limits before an average tells")
        return tuple(notes)

    def __str__(self) -> str:
        rows = [f"{name:34}{value:>z12.6g} {unit}" for name, (value, unit) in self.figures.items()]
        return "\n".join((f"duty of {self.motor} in '{self.title}'", *rows, *(f"- {note}" for note in self.notes)))


def cooling_at(n: Array, cooling: float, n_cooling: Any) -> Array:
    """Cooling over full cooling at speeds in 1/min: a straight line from standstill on."""
    share = np.minimum(n / n_cooling, 1.0) if np.all(n_cooling) else np.zeros_like(n)  # it never turns
    return np.asarray(cooling + (1.0 - cooling) * share)


def duty(
    solution: Any,
    motor: str | None = None,
    *,
    torque: str | None = None,
    speed: str | None = None,
    ratio: Any = None,
    efficiency: Any = None,
    cycle: Any = None,
    at_rest: str = "holds",
    cooling: Any = 1.0,
    n_cooling: Any = None,
) -> Duty:
    """What a motion asks of a motor, taken as one cycle that is repeated without end.

    Args:
        solution: the motion.
        motor: name of a part that gives torque to a shaft; a motor with ratio and efficiency is seen at its own shaft.
        torque: instead of `motor`, name of a torque that drives, such as "gear.tau_a".
        speed: and of a speed of a node on which it acts, such as "rotor.omega".
        ratio: motor speed over this speed, of a gear that is not in the network.
        efficiency: of this gear, in the direction of power flow.
        cycle: duration of the cycle in s; after the motion the motor rests without torque. By default the motion's.
        at_rest: "holds": torque at standstill counts; "released": a brake holds there, and the motor has none.
        cooling: heat that the motor gives off at standstill over that at full speed; it rises with the speed along a
            straight line. 1 for a fan of its own.
        n_cooling: speed in 1/min from which cooling is full, the rated one; by default the highest of the motion. A
            motor that never turns is cooled as at standstill.

    Raises:
        ParameterError: the arguments do not go together, the torque does not act where the speed is, or one is out of
            its range.
        SignalError: there is no such part or quantity.
    """
    if at_rest not in ("holds", "released"):
        raise ParameterError(
            f"at_rest = {at_rest!r} is neither 'holds' (torque at standstill counts) nor 'released' (a brake holds)."
        )
    shaft = motor_shaft(solution, motor, (torque, speed), (ratio, efficiency), released=at_rest == "released")
    motion = float(shaft.steps[-1] - shaft.steps[0])
    whole = motion if cycle is None else in_si("cycle", cycle, "s", above=0)
    if whole < motion * (1 - SAME):
        raise ParameterError(f"cycle = {whole:g} s is shorter than the motion of {motion:g} s. Simulate less of it.")
    cold = in_si("cooling", cooling, above=0, at_most=1)
    n_full = shaft.omega_top * RPM if n_cooling is None else in_si("n_cooling", n_cooling, "1/min", above=0)
    return _measured(shaft, motion, max(whole, motion), cold, n_full)


def _measured(shaft: MotorShaft, motion: float, whole: float, cold: float, n_full: float) -> Duty:
    """The figures of a motion in a longer or equal cycle; durations in s, the speed of full cooling in 1/min."""

    def integrand(panels: LobattoPanels) -> Array:
        times = panels.times.ravel()
        (tau, omega), step = shaft.read(times), shaft.step_at(times)
        power, still, loads = tau * omega, shaft.resting[step], ~shaft.unloaded[step]
        cools = cooling_at(np.abs(omega) * RPM, cold, n_full)
        rows = [tau, tau**2, power**2, np.abs(omega), ~still | loads, still & loads, cools]
        for flow in (np.maximum(power, 0.0), np.maximum(-power, 0.0)):
            rows += [flow, flow**2, (flow > 0) & loads & ~still]
        return np.array(rows, dtype=float).reshape(-1, *panels.times.shape)

    tau = turning_points(lambda t: shaft.read(t)[0], shaft.steps, smallest=TYPED).values
    power = turning_points(lambda t: np.multiply(*shaft.read(t)), shaft.steps, smallest=TYPED).values
    integrals = integrate(integrand, shaft.steps)
    total, panels = integrals.totals, integrals.panels
    impulse, heat, power_square, turned, loaded, holding, cooled, *flows = total.tolist()
    return Duty(
        title=shaft.solution.name,
        motor=shaft.name,
        duration=whole,
        tau_rms=math.sqrt(heat / whole),
        tau_mean=impulse / whole,
        tau_max=float(tau.max()),
        tau_min=float(tau.min()),
        power_rms=math.sqrt(power_square / whole),
        power_mean=(flows[0] - flows[3]) / whole,
        motoring=_flow(flows[:3], float(power.max())),
        braking=_flow(flows[3:], -float(power.min())),
        n_top=shaft.omega_top * RPM,
        n_mean=turned / whole * RPM,
        loaded=loaded,
        held=holding,
        cooled=cooled + (whole - motion) * cold,
        cooling=cold,
        n_cooling=n_full,
        shaft=shaft,
        panels=panels,
    )


def _flow(integrals: list[float], peak: float) -> Flow:
    energy, square, duration = integrals
    return Flow(duration, energy, max(0.0, peak), math.sqrt(square / duration) if duration else 0.0)
