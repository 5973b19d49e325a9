"""Torque and speed of a motor at its own shaft, along a motion."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shaftwork.components.base import Component
from shaftwork.components.sources import SpeedSource
from shaftwork.core.errors import ParameterError, SignalError
from shaftwork.core.parameters import in_si
from shaftwork.network.wording import at_nodes, listed
from shaftwork.results.course import turning_points
from shaftwork.results.observer import Array
from shaftwork.results.quadrature import LobattoPanels
from shaftwork.results.solution import Solution

BLOCK = 50_000
"""Times that are read at once."""
SMALLEST = 1e-9
"""Ups and downs of less than this part of the range make no peak."""
REST = 1e-12
"""A speed that stays within this part of the highest one may be standstill, such a torque none: see `is_nothing`."""
CONSTANT = 4 * float(np.finfo(float).eps)
"""What changes by no more than this part of itself is constant."""
RPM = 30 / math.pi
"""1/min for a rad/s."""
GEARED = ("ratio", "efficiency")
"""Parameters of a motor that has a gear of its own."""


@dataclass(frozen=True, eq=False)
class MotorShaft:
    """Where torque and speed of a motor are read, and the gear between that place and the motor's shaft.

    Law: omega_motor = ratio omega. A motor with a gear of its own has tau_motor = tau / (ratio efficiency), as its law
    says, in both directions. With a gear that is given besides, the motor also brakes through it: tau efficiency /
    ratio where tau omega < 0.

    Args:
        solution: the motion.
        torque: quantity that is the torque at the gear's output, positive where it drives.
        speed: quantity that is the speed there.
        part: the motor with its parameters in this motion, its gear taken off; None where quantities were named.
        ratio: motor speed over the speed there.
        efficiency: of the gear.
        own_gear: the gear is the motor's own.
        released: at standstill a brake holds, and the motor gives no torque.
    """

    solution: Solution
    torque: str
    speed: str
    part: Component | None = None
    ratio: float = 1.0
    efficiency: float = 1.0
    own_gear: bool = False
    released: bool = False

    @cached_property
    def omega_top(self) -> float:
        """Highest speed of the motor in size, rad/s."""
        speeds = turning_points(self._speeds, self.steps, smallest=SMALLEST).values
        return float(np.abs(speeds).max()) * abs(self.ratio)

    @property
    def omega_prescribed(self) -> float:
        """Speed of the motor at the start if every state were at rest, rad/s; zero where no source prescribes one."""
        made, start = self.solution, self.steps[:1]
        owners = dict.fromkeys(name.rpartition(".")[0] for name in made.names if name.endswith(".tau"))
        if not any(isinstance(made.observer.part(owner), SpeedSource) for owner in owners):
            return 0.0
        still = np.zeros_like(made.dense(start))
        return self.ratio * float(made.observer.signal(self.speed, start, still, made.dense)[0])

    @property
    def steps(self) -> Array:
        """(s,) times between which the motion is smooth, s."""
        return self.solution.steps

    @cached_property
    def within(self) -> LobattoPanels:
        """Every step as a panel."""
        return LobattoPanels(self.steps[:-1], self.steps[1:])

    @cached_property
    def speeds_within(self) -> Array:
        """(s - 1, 8) speed of the motor at the nodes of every step, rad/s."""
        times = self.within.times
        return np.asarray(self.ratio * self._speeds(times.ravel()).reshape(times.shape))

    @cached_property
    def resting(self) -> NDArray[np.bool_]:
        """(s - 1,) whether the motor is at standstill from one end of a step to the other."""
        return is_nothing(self.speeds_within, REST * self.omega_top)

    @cached_property
    def unloaded(self) -> NDArray[np.bool_]:
        """(s - 1,) whether the motor has no torque from one end of a step to the other."""
        times = self.within.times
        tau = self.read(times.ravel())[0].reshape(times.shape)
        return is_nothing(tau, REST * float(np.abs(tau).max()))

    def step_at(self, times: Array) -> NDArray[np.intp]:
        """(k,) the step in which each time is; the end of one is the start of the next."""
        return np.clip(np.searchsorted(self.steps, times, side="right") - 1, 0, len(self.steps) - 2)

    def read(self, times: Array) -> tuple[Array, Array]:
        """Torque in N m and speed in rad/s of the motor at ascending times (k,)."""
        tau, omega = np.concatenate([[here[self.torque], here[self.speed]] for here in self._blocks(times)], axis=1)
        drives = self.own_gear | (tau * omega >= 0)
        made, turns = tau / self.ratio * np.where(drives, 1 / self.efficiency, self.efficiency), self.ratio * omega
        return (np.where(self.resting[self.step_at(times)], 0.0, made) if self.released else made), turns

    def _speeds(self, times: Array) -> Array:
        return np.concatenate([here[self.speed] for here in self._blocks(times)])

    def _blocks(self, times: Array) -> Iterator[Solution]:
        return (self.solution.at(times[first : first + BLOCK]) for first in range(0, len(times), BLOCK))


def is_nothing(values: Array, rounding: float) -> NDArray[np.bool_]:
    """(p,) whether a quantity is zero throughout a step, to rounding.

    A soft start is below any threshold for a while and no rest. What rests does not change; or it is the rounding of
    something that balances, which goes to and fro.

    Args:
        values: (p, 8) at the nodes of the steps.
        rounding: size up to which it may be zero.
    """
    size = np.abs(values).max(axis=1)
    swings = (values.min(axis=1) < 0) & (values.max(axis=1) > 0)
    return np.asarray((size <= rounding) & (swings | (np.ptp(values, axis=1) <= CONSTANT * size)))


def motor_shaft(
    solution: Any, part: str | None, named: tuple[str | None, str | None], gear: tuple[Any, Any], *, released: bool
) -> MotorShaft:
    """Where the torque of a motor is read.

    Args:
        solution: the motion.
        part: name of the motor; None where quantities are named.
        named: torque and speed.
        gear: ratio and efficiency of a gear besides; None where there is none.
        released: at standstill a brake holds.

    Raises:
        ParameterError: the arguments do not go together.
        SignalError: there is no such part or quantity.
    """
    if not isinstance(solution, Solution):
        raise ParameterError(
            f"{reprlib.repr(solution)} is no motion. Give what simulate returns: duty(net.simulate(10.0), 'motor')."
        )
    torque, speed = named
    if (part is None) == (torque is None) or (torque is None) != (speed is None):
        raise ParameterError(
            "Name a motor, duty(solution, 'motor'), or a torque and a speed, duty(solution, torque='gear.tau_a', "
            f"speed='rotor.omega'). {_motors(solution)}"
        )
    if part is not None:
        return _of_part(solution, part, gear, released=released)
    assert torque is not None and speed is not None  # noqa: S101, PT018 (then both are named)
    units = _unit(solution, torque), _unit(solution, speed)
    if units != ("N*m", "rad/s"):
        raise SignalError(
            f"'{torque}' is in {units[0]}, '{speed}' in {units[1]}. Name a torque in N*m, a speed in rad/s."
        )
    _refuse_other_shaft(solution, torque, speed)
    return MotorShaft(solution, torque, speed, None, *_besides(gear), released=released)


def _refuse_other_shaft(solution: Solution, torque: str, speed: str) -> None:
    """A torque times the speed of a node on which it does not act is no power."""
    nodes_of, units = solution.observer.nodes_of, solution.observer.units
    acts, turns = nodes_of(torque), nodes_of(speed)
    if not turns or not set(turns) <= set(acts):
        fitting = [name for name in units if units[name] == "rad/s" and set(nodes_of(name) or ("",)) <= set(acts)]
        raise ParameterError(
            f"'{torque}' acts at {at_nodes(acts)}, and '{speed}' is the speed of {at_nodes(turns)}. Name a speed "
            f"there: {listed(fitting)}; ratio= is the gear between that place and the motor."
        )


def _of_part(solution: Solution, name: str, gear: tuple[Any, Any], *, released: bool) -> MotorShaft:
    """The shaft of a motor, before the gear that its parameters say it has, or before one that is given."""
    motor, torque, speed = _source(solution, name)
    if not all(known in motor.declared for known in GEARED):
        return MotorShaft(solution, torque, speed, motor, *_besides(gear), released=released)
    ratio, efficiency = (float(motor.values[known]) for known in GEARED)
    if gear != (None, None):
        raise ParameterError(
            f"'{name}' has a gear of its own, ratio {ratio:g}, efficiency {efficiency:g}, and its figures are those at "
            "the motor's shaft. Leave out ratio and efficiency; for another gear name torque and speed at the node: "
            f"duty(solution, torque='{torque}', speed='{speed}', ratio=...)."
        )
    bare = motor.changed(**dict.fromkeys(GEARED, 1.0))
    return MotorShaft(solution, torque, speed, bare, ratio, efficiency, own_gear=True, released=released)


def _besides(gear: tuple[Any, Any]) -> tuple[float, float]:
    """Ratio and efficiency of a gear that is not in the network; both 1 where there is none."""
    ratio, efficiency = gear
    return (
        1.0 if ratio is None else in_si("ratio", ratio, nonzero=True),
        1.0 if efficiency is None else in_si("efficiency", efficiency, above=0, at_most=1),
    )


def _source(solution: Solution, name: Any) -> tuple[Component, str, str]:
    """A motor and the names of its torque and its speed."""
    if not isinstance(name, str) or f"{name}.tau" not in solution or not (found := _speed(solution, name)):
        raise SignalError(f"{name!r} is no motor: it has no torque on a shaft of one speed. {_motors(solution)}")
    return solution.observer.part(name), f"{name}.tau", found


def _speed(solution: Solution, name: str) -> str:
    """The speed that belongs to the torque of a part that drives; empty where it does not drive."""
    try:
        role = solution.observer.part(name).role
    except SignalError:  # a node
        return ""
    names = (f"{name}.omega_rel", f"{name}.omega") if role in ("source", "coupling") else ()
    return next((made for made in names if made in solution), "")


def _motors(solution: Solution) -> str:
    parts = dict.fromkeys(name.rpartition(".")[0] for name in solution if name.endswith(".tau"))
    found = [f"'{part}'" for part in parts if _speed(solution, part)]
    return f"In '{solution.name}' these drive: {', '.join(found)}." if found else f"Nothing drives '{solution.name}'."


def _unit(solution: Solution, name: str) -> str:
    solution[name]  # refuses a name that does not exist, and says which do
    return solution.observer.units.get(name, "")
