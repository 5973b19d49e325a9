"""The duty cycle of a motor, measured along a motion."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import in_si
from shaftwork.results.course import turning_points
from shaftwork.results.observer import Array
from shaftwork.results.quadrature import LobattoPanels, integrate
from shaftwork.sizing.duty_cycle import Duty, Flow, cooling_at
from shaftwork.sizing.motor_shaft import RPM, SMALLEST, MotorShaft, motor_shaft

ROUNDING = 1e-12
"""Part of a motion by which a cycle of its length may seem shorter: it starts and ends at times of any size."""


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
    if whole < motion * (1 - ROUNDING):
        raise ParameterError(f"cycle = {whole:g} s is shorter than the motion of {motion:g} s. Simulate less of it.")
    cold = in_si("cooling", cooling, above=0, at_most=1)
    n_full = shaft.omega_top * RPM if n_cooling is None else in_si("n_cooling", n_cooling, "1/min", above=0)
    return _measured(shaft, motion, max(whole, motion), cold, n_full)


def _measured(shaft: MotorShaft, motion: float, whole: float, cold: float, n_full: float) -> Duty:
    """The figures of a motion in a longer or equal cycle; durations in s, the speed of full cooling in 1/min."""
    tau = turning_points(lambda t: shaft.read(t)[0], shaft.steps, smallest=SMALLEST).values
    power = turning_points(lambda t: np.multiply(*shaft.read(t)), shaft.steps, smallest=SMALLEST).values
    total, panels = integrate(_Integrand(shaft, cold, n_full), shaft.steps)
    way, heat, power_square, turned, loaded, held, cooled, *flows = total.tolist()
    return Duty(
        title=shaft.solution.name,
        motor=shaft.part.name if shaft.part else shaft.torque,
        duration=whole,
        tau_rms=math.sqrt(heat / whole),
        tau_mean=way / whole,
        tau_max=float(tau.max()),
        tau_min=float(tau.min()),
        power_rms=math.sqrt(power_square / whole),
        power_mean=(flows[0] - flows[3]) / whole,
        motoring=_flow(flows[:3], float(power.max())),
        braking=_flow(flows[3:], -float(power.min())),
        n_top=shaft.omega_top * RPM,
        n_mean=turned / whole * RPM,
        loaded=loaded,
        held=held,
        cooled=cooled + (whole - motion) * cold,
        cooling=cold,
        n_cooling=n_full,
        shaft=shaft,
        panels=panels,
    )


@dataclass(frozen=True, eq=False)
class _Integrand:
    """What is integrated over a motion, in panels.

    Args:
        shaft: where torque and speed are read.
        cooling: at standstill.
        n_cooling: speed of full cooling, 1/min.
    """

    shaft: MotorShaft
    cooling: float
    n_cooling: float

    def __call__(self, panels: LobattoPanels) -> Array:
        """(13, p, 8) rows in the order in which `_measured` takes them."""
        times = panels.times.ravel()
        (tau, omega), step = self.shaft.read(times), self.shaft.step_at(times)
        power, still, loads = tau * omega, self.shaft.resting[step], ~self.shaft.unloaded[step]
        cools = cooling_at(np.abs(omega) * RPM, self.cooling, self.n_cooling)
        rows = [tau, tau**2, power**2, np.abs(omega), ~still | loads, still & loads, cools]
        for one_way in (np.maximum(power, 0.0), np.maximum(-power, 0.0)):
            rows += [one_way, one_way**2, (one_way > 0) & loads & ~still]
        return np.array(rows, dtype=float).reshape(-1, *panels.times.shape)


def _flow(integrals: list[float], peak: float) -> Flow:
    energy, square, duration = integrals
    return Flow(duration, energy, max(0.0, peak), math.sqrt(square / duration) if duration else 0.0)
