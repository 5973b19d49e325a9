"""How far the torque of a motion stays below what a motor can give."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from shaftwork.components.tables import Table, interpolate
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import in_si
from shaftwork.results.course import turning_points
from shaftwork.results.observer import Array
from shaftwork.sizing.motor_shaft import RPM, SMALLEST, MotorShaft
from shaftwork.sizing.own_curve import fastest, own_curve, pull_out

Limit = float | Table | Callable[[Array], Array] | None
"""Largest torque in size, N m, over the motor's speed without sign in 1/min; None for the motor's own."""
Limited = Callable[[Array, Array], Array]
"""The largest torque in N m at times (k,) in s and speeds (k,) in 1/min."""
INSTANTS = 257
"""At which the pull-out torque of a motor is looked for that changes with time; between them it is a straight line."""
NO_LIMIT = 1e9
"""Torque over its limit where there is none left of it."""
EQUAL = 1e-9
"""Reserves that differ by less, as a part of themselves, are equal; it is the first instant that counts."""
AS_ARRAY = (
    "Let it take an array of speeds in 1/min and give as many torques in N m: lambda n: np.where(n < 1500, 20.0, 10.0)."
)
"""How a function is a limit."""


@dataclass(frozen=True)
class Reserve:
    """The instant of a motion at which its torque comes nearest to a limit.

    Args:
        ratio: limit over torque there; above 1 the limit is kept. Infinite where there is no torque.
        time: s.
        n: speed of the motor, 1/min.
        tau: its torque, N m.
        limit: of the torque, N m.
    """

    ratio: float
    time: float
    n: float
    tau: float
    limit: float

    def __str__(self) -> str:
        return (
            f"{self.ratio:.4g} times: {self.tau:z.6g} of {self.limit:.6g} N*m at {self.n:.6g} 1/min, {self.time:.6g} s"
        )


def reserve_of(shaft: MotorShaft, limit: Limit) -> Reserve:
    """The least reserve of a motion; see `Duty.reserve`."""
    limited = limits(shaft, limit)

    def used(times: Array) -> Array:
        tau, omega = shaft.read(times)
        most = limited(times, np.abs(omega) * RPM)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(tau == 0, 0.0, np.minimum(np.abs(tau) / most, NO_LIMIT))

    worst = turning_points(used, shaft.steps, smallest=SMALLEST)
    place = int((worst.values >= (1 - EQUAL) * worst.values.max()).argmax())
    time = worst.t[place : place + 1]
    (tau,), (omega,) = shaft.read(time)
    (most,) = limited(time, np.abs([omega]) * RPM)
    load = float(worst.values[place])
    ratio = math.inf if load == 0 else 0.0 if load == NO_LIMIT else 1 / load
    return Reserve(ratio, float(time[0]), float(omega) * RPM, float(tau), float(most))


def limits(shaft: MotorShaft, limit: Limit) -> Limited:
    """The limit as a function of time and speed.

    Raises:
        ParameterError: it is none, or the motor has none.
    """
    if limit is None:
        return _own(shaft)
    if isinstance(limit, Table):
        points = limit.xs, limit.ys
        if min(limit.xs) < 0 or min(limit.ys) < 0:
            raise ParameterError(
                f"limit = {limit} has speeds or torques below zero. Give sizes: Table(speeds in 1/min, torques in N m)."
            )
        return lambda _, n: np.asarray(interpolate(n, points))
    if callable(limit):
        return lambda _, n: _checked(limit, n)
    most = in_si("limit", limit, "N*m", above=0)
    return lambda _, n: np.full_like(n, most)


def _checked(limit: Callable[[Array], Any], n: Array) -> Array:
    try:
        given = np.asarray(limit(n), dtype=float)
    except (TypeError, ValueError) as error:
        raise ParameterError(f"limit fails for an array of speeds: {error}. {AS_ARRAY}") from error
    if given.ndim > 1 or given.size not in (1, n.size):
        raise ParameterError(f"limit gives {given.size} torques for {n.size} speeds. {AS_ARRAY}")
    made = np.broadcast_to(given, n.shape)
    if np.isnan(made).any() or made.min() < 0:
        raise ParameterError(
            "limit gives torques that are below zero or no numbers. Give the size in N m at any speed."
        )
    return made


def _own(shaft: MotorShaft) -> Limited:
    curve = own_curve(shaft.part, shaft.steps)
    if curve is None or shaft.part is None:
        what = f"'{shaft.part.name}' ({type(shaft.part).__name__})" if shaft.part else f"'{shaft.torque}'"
        raise ParameterError(
            f"{what} has no curve of torque over speed of its own. Give limit=, the largest torque in N m over the "
            "motor's speed in 1/min: a number, Table([0, 1500, 3000], [20, 20, 10]), or the limit of a motor of a "
            "catalogue."
        )
    instants = np.linspace(shaft.steps[0], shaft.steps[-1], INSTANTS)
    ends = shaft.steps if len(shaft.steps) <= INSTANTS else shaft.steps[:0]
    times = np.unique(np.concatenate([instants, ends, np.nextafter(ends[1:], -np.inf)]))
    most = pull_out(curve, times, fastest(shaft.part, shaft.omega_top))
    return lambda t, _: np.interp(t, times, most)
