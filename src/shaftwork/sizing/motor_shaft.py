"""Torque and speed of a motor at its own shaft, along a motion, and how long it takes to come to a speed."""

from __future__ import annotations

import reprlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize.elementwise import find_root

from shaftwork.components.base import Component
from shaftwork.components.sources import SpeedSource
from shaftwork.core.errors import ParameterError, SignalError
from shaftwork.core.parameters import in_si
from shaftwork.network.netlist import at_nodes, listed
from shaftwork.numerics.tolerances import EPS, SAME, TYPED
from shaftwork.results.course import LobattoPanels, turning_points
from shaftwork.results.observer import Array, Read, blocks
from shaftwork.results.solution import Solution

CONSTANT, FLAT = 4 * EPS, 45 * EPS
"""What changes by no more than this part of itself is constant; a step in which the speed changes by no more than this
part of the highest one is part of a plateau."""
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

    @property
    def name(self) -> str:
        """Of the motor, or of the torque."""
        return self.part.name if self.part else self.torque

    @property
    def _tau(self) -> Read:
        return self.solution.reader.quantity(self.torque)

    @property
    def _omega(self) -> Read:
        return self.solution.reader.quantity(self.speed)

    @cached_property
    def even(self) -> Array:
        """Even times over the motion, s, among which a speed is looked for and at which its curves are drawn."""
        return np.linspace(self.steps[0], self.steps[-1], 4001)

    @cached_property
    def omega_top(self) -> float:
        """Highest speed of the motor in size, rad/s."""
        speeds = turning_points(self._omega, self.steps, smallest=TYPED).values
        return float(np.abs(speeds).max()) * abs(self.ratio)

    @property
    def omega_prescribed(self) -> float:
        """Speed of the motor at the start if every state were at rest, rad/s; zero where no source prescribes one."""
        observer, dense, start = self.solution.observer, self.solution.dense, self.steps[:1]
        owners = dict.fromkeys(name.rpartition(".")[0] for name in observer.units if name.endswith(".tau"))
        if not any(isinstance(observer.part(owner), SpeedSource) for owner in owners):
            return 0.0
        return self.ratio * float(observer.signal(self.speed, start, np.zeros_like(dense(start)), dense)[0])

    @cached_property
    def steps(self) -> Array:
        """(s,) times between which the motion is smooth, s."""
        return self.solution.steps

    @cached_property
    def within(self) -> LobattoPanels:
        """Every step as a panel."""
        return LobattoPanels.between(self.steps)

    @cached_property
    def speeds_within(self) -> Array:
        """(s - 1, 8) speed of the motor at the nodes of every step, rad/s."""
        times = self.within.times
        return np.asarray(self.ratio * self._omega(times.ravel()).reshape(times.shape))

    @cached_property
    def resting(self) -> NDArray[np.bool_]:
        """(s - 1,) whether the motor is at standstill from one end of a step to the other."""
        return is_nothing(self.speeds_within, SAME * self.omega_top)

    @cached_property
    def unloaded(self) -> NDArray[np.bool_]:
        """(s - 1,) whether the motor has no torque from one end of a step to the other."""
        times = self.within.times
        tau = self.read(times.ravel())[0].reshape(times.shape)
        return is_nothing(tau, SAME * float(np.abs(tau).max()))

    def step_at(self, times: Array) -> NDArray[np.intp]:
        """(k,) the step in which each time is; the end of one is the start of the next."""
        return np.clip(np.searchsorted(self.steps, times, side="right") - 1, 0, len(self.steps) - 2)

    def read(self, times: Array) -> tuple[Array, Array]:
        """Torque in N m and speed in rad/s of the motor at ascending times (k,)."""
        parts = (times[block] for block in blocks(len(times), len(self.solution.states)))
        tau, omega = np.concatenate([[self._tau(part), self._omega(part)] for part in parts], axis=1)
        drives = self.own_gear | (tau * omega >= 0)
        tau = tau / self.ratio * np.where(drives, 1 / self.efficiency, self.efficiency)
        return np.where(self.resting[self.step_at(times)], 0.0, tau) if self.released else tau, self.ratio * omega

    def omega(self, times: Array) -> Array:
        """(k,) speed in rad/s of the motor at ascending times (k,)."""
        return self.ratio * self._omega(times)


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
    units = solution.reader.unit(torque), solution.reader.unit(speed)
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
    if not all(parameter in motor.declared for parameter in GEARED):
        return MotorShaft(solution, torque, speed, motor, *_besides(gear), released=released)
    ratio, efficiency = (float(motor.values[parameter]) for parameter in GEARED)
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
    if not isinstance(name, str) or f"{name}.tau" not in solution or not (speed := _speed(solution, name)):
        raise SignalError(f"{name!r} is no motor: it has no torque on a shaft of one speed. {_motors(solution)}")
    return solution.observer.part(name), f"{name}.tau", speed


def _speed(solution: Solution, name: str) -> str:
    """The speed that belongs to the torque of a part that drives; empty where it does not drive."""
    try:
        role = solution.observer.part(name).role
    except SignalError:  # a node
        return ""
    names = (f"{name}.omega_rel", f"{name}.omega") if role in ("source", "coupling") else ()
    return next((speed for speed in names if speed in solution), "")


def _motors(solution: Solution) -> str:
    parts = dict.fromkeys(name.rpartition(".")[0] for name in solution if name.endswith(".tau"))
    drives = [f"'{part}'" for part in parts if _speed(solution, part)]
    return f"In '{solution.name}' these drive: {', '.join(drives)}." if drives else f"Nothing drives '{solution.name}'."


def zeros(value: Callable[..., Array], low: Array, high: Array, *args: Array) -> Array:
    """(k,) times at which a function of the time passes through zero, or jumps over it, to rounding.

    Args:
        value: from times (k,) and arguments (k,) to values (k,), which have different signs at both ends.
        low: (k,) s.
        high: (k,) s.
        *args: (k,) arguments.
    """
    if not len(low):
        return low
    root = find_root(value, (low, high), args=args)
    return np.where(root.success, root.x, high)  # rounding may take the difference of the signs away


def run_up(shaft: MotorShaft, share: float) -> float:
    """Time in s from the last standstill to the first time at a share of the highest speed.

    Args:
        shaft: of a motor that moves.
        share: of the highest speed, up to 1.
    """
    turns = turning_points(lambda times: np.abs(shaft.omega(times)), shaft.steps, smallest=TYPED).t
    marks = np.unique(np.concatenate([shaft.steps, turns]))
    times = np.unique(np.concatenate([marks, shaft.even]))
    reached = _top(shaft, marks) if share == 1 else _first(shaft, times, share * shaft.omega_top)
    return reached - _start(shaft, times[times <= reached])


def _first(shaft: MotorShaft, times: Array, goal: float) -> float:
    """The first time at a speed in size."""
    after = int(np.argmax(np.abs(shaft.omega(times)) >= goal))
    if after == 0:
        return float(times[0])
    bracket = times[after - 1 : after], times[after : after + 1]
    return float(zeros(lambda t: np.abs(shaft.omega(t)) - goal, *bracket)[0])


def _top(shaft: MotorShaft, marks: Array) -> float:
    """Where the highest speed begins: the start of a plateau, else its peak, among ends of steps and turning points."""
    speeds = np.abs(shaft.omega(marks))
    near = speeds >= shaft.omega_top * (1 - SAME)
    first = int(np.argmax(near))
    beyond = np.flatnonzero(~near[first:])
    here = slice(first, first + int(beyond[0]) if beyond.size else None)
    plateaus = shaft.steps[:-1][np.ptp(shaft.speeds_within, axis=1) <= FLAT * shaft.omega_top]
    begun = marks[here][np.isin(marks[here], plateaus)]
    if begun.size:
        return float(begun[0])
    highest = np.flatnonzero(speeds[here] == speeds[here].max())  # a soft end comes to rounding of the top too early
    return float(marks[here][highest[-1]])


def _start(shaft: MotorShaft, times: Array) -> float:
    """The last standstill: the end of a rest, a touch of zero, or a reversal; else the start of the motion."""
    speeds = shaft.omega(times)
    ends = shaft.steps[1:][shaft.resting]
    standstills: list[float] = [float(times[0]), *ends[ends <= times[-1]].tolist()]
    touches = np.flatnonzero(np.abs(speeds) <= SAME * shaft.omega_top)
    if touches.size:
        last = touches[np.flatnonzero(np.diff(touches, prepend=-2) > 1)[-1] :]  # a soft start stays near zero
        sizes = np.abs(speeds[last])
        standstills.append(float(times[last[np.flatnonzero(sizes == sizes.min())[-1]]]))
    turned = np.flatnonzero(speeds[:-1] * speeds[1:] < 0)[-1:]
    standstills += zeros(shaft.omega, times[turned], times[turned + 1]).tolist()
    return max(standstills)
