"""A six-step brushless motor by hand: equations of each state of the inverter, events located one after another.

It shares nothing with the library. The currents of conducting phases have the sum zero, so the star point has the mean
of what is left of their voltages, and every phase its own equation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]
LAG = 2 * np.pi / 3 * np.array([0.0, 1.0, -1.0])
AHEAD = 1e-9
"""Electrical angle by which one looks beyond an event to know what follows."""


@dataclass(frozen=True)
class Motor:
    """Data in SI; `load` is the torque against the motion as a function of speed."""

    U: float
    R: float
    L: float
    k: float
    pole_pairs: float
    J: float
    load: Callable[[float], float]
    flat: float = 2 * np.pi / 3
    dead_time: float = 0.0

    def shapes(self, angle: float) -> Array:
        """Back EMF of the phases over k omega: a trapezoid by its corners."""
        ramp = (np.pi - self.flat) / 2
        turned = np.mod(angle - LAG, 2 * np.pi)
        corners = [0, ramp, np.pi - ramp, np.pi + ramp, 2 * np.pi - ramp, 2 * np.pi]
        return np.asarray(np.interp(turned, corners, [0, 1, 1, -1, -1, 0]))

    def window(self, angle: float, omega: float) -> Array:
        """1 where the upper switch of a leg is closed, -1 where the lower one is, else 0."""
        seen = [np.sin(np.array(at) - LAG) for at in (angle, angle - self.pole_pairs * omega * self.dead_time)]
        return np.where(np.minimum(*seen) > 0.5, 1.0, np.where(np.maximum(*seen) < -0.5, -1.0, 0.0))


@dataclass
class _Legs:
    """For each leg the side to which it is joined, 1 or -1; 0 where it is open."""

    motor: Motor
    sides: Array

    def star(self, x: Array) -> float:
        """Voltage of the star point against the middle of the direct voltage."""
        left = self.sides * self.motor.U / 2 - self.emf(x)
        joined = self.sides != 0
        return float(left[joined].mean()) if joined.any() else 0.0

    def emf(self, x: Array) -> Array:
        return np.asarray(self.motor.k * x[3] * self.motor.shapes(self.motor.pole_pairs * x[4]))

    def rates(self, _: float, x: Array) -> Array:
        motor, joined = self.motor, self.sides != 0
        left = self.sides * motor.U / 2 - self.emf(x) - self.star(x) - motor.R * x[:3]
        currents = np.where(joined, left, 0.0) / motor.L if joined.sum() > 1 else np.zeros(3)
        torque = motor.k * motor.shapes(motor.pole_pairs * x[4]) @ x[:3]
        return np.array([*currents, (torque - motor.load(x[3])) / motor.J, x[3]])

    def open_voltages(self, x: Array) -> Array:
        """How far the terminal of each open leg is inside the rails, against the upper and the lower one."""
        terminal = self.star(x) + self.emf(x)
        return np.concatenate([self.motor.U / 2 - terminal, self.motor.U / 2 + terminal])


def _next(legs: _Legs, x: Array) -> Array:
    """The sides of the legs from here on: switches, diodes that carry a current, diodes that begin to."""
    motor = legs.motor
    window = motor.window(motor.pole_pairs * x[4] + np.sign(x[3]) * AHEAD, x[3])
    sides = np.where(window != 0, window, -np.sign(x[:3]))
    made = _Legs(motor, sides)
    for phase in np.flatnonzero(sides == 0):
        terminal = made.star(x) + made.emf(x)[phase]
        if abs(terminal) > motor.U / 2 * (1 + 1e-12):
            sides[phase] = np.sign(terminal)
    return sides


def simulate(motor: Motor, t: Array, omega: float = 0.0) -> tuple[Array, Array]:
    """States (times, 5), currents, speed and angle, at times (k,) from rest of the currents; and all event times."""
    x, now = np.array([0.0, 0.0, 0.0, omega, 0.0]), float(t[0])
    legs = _Legs(motor, np.zeros(3))
    legs.sides = _next(legs, x)
    states, events = np.empty((t.size, 5)), []
    while now < t[-1]:
        sol = solve_ivp(
            legs.rates, (now, t[-1]), x, "DOP853", dense_output=True, rtol=1e-12, atol=1e-13, max_step=2e-4,
            events=_events(legs, x),
        )  # fmt: skip
        inside = (t >= now) & (t <= sol.t[-1])
        if inside.any():
            states[inside] = sol.sol(t[inside]).T
        now, x = float(sol.t[-1]), sol.y[:, -1].copy()
        met = [k for k, found in enumerate(sol.t_events) if found.size]
        events += [now] * bool(met)
        for phase in range(3):
            if abs(x[phase]) < 1e-9:
                x[phase] = 0.0
        x[:3] -= np.where(x[:3] != 0, x[:3].sum() / max(1, np.count_nonzero(x[:3])), 0.0)
        legs = _Legs(motor, _next(legs, x))
    return states, np.array(events)


def _events(legs: _Legs, start: Array) -> list[Callable[[float, Array], float]]:
    """What ends the state: a leg's window or the corner of a back EMF, a diode's current, a diode's voltage."""
    motor = legs.motor
    window = motor.window(motor.pole_pairs * start[4] + np.sign(start[3]) * AHEAD, start[3])
    levels = [side * edge for edge in sorted({0.5, np.cos(motor.flat / 2)}) for side in (1, -1)]
    made: list[Callable[[float, Array], float]] = []
    for phase in range(3):
        for delay in sorted({0.0, motor.dead_time}):
            for level in levels:

                def angle(_: float, x: Array, phase: int = phase, delay: float = delay, level: float = level) -> float:
                    return float(np.sin(motor.pole_pairs * (x[4] - x[3] * delay) - LAG[phase]) - level)

                if abs(angle(0.0, start)) > 1e-7:  # not where it has just been; others come before it does again
                    made.append(angle)
        if legs.sides[phase] == 0:
            made += [lambda _, x, rail=rail: legs.open_voltages(x)[rail] for rail in (phase, phase + 3)]
        elif window[phase] == 0:
            made.append(lambda _, x, phase=phase: x[phase] * -legs.sides[phase] - 1e-15)
    for event in made:
        event.terminal = True  # type: ignore[attr-defined]
        event.direction = 0.0 if event.__name__ == "angle" else -1.0  # type: ignore[attr-defined]
    return made
