"""How long a motor takes from standstill to a share of its highest speed."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from shaftwork.results.course import turning_points
from shaftwork.results.observer import Array
from shaftwork.sizing.motor_shaft import REST, SMALLEST, MotorShaft

SAMPLES, FINE = 4001, 4 * float(np.finfo(float).eps)
"""Times among which a speed is looked for, and how exactly its time is found."""
FLAT = 1e-14
"""A step in which the speed changes by no more than this part of the highest one is part of a plateau."""


def run_up(shaft: MotorShaft, share: float) -> float:
    """Time in s from the last standstill to the first time at a share of the highest speed.

    Args:
        shaft: of a motor that moves.
        share: of the highest speed, up to 1.
    """
    turns = turning_points(lambda times: np.abs(shaft.read(times)[1]), shaft.steps, smallest=SMALLEST).t
    marks = np.unique(np.concatenate([shaft.steps, turns]))
    times = np.unique(np.concatenate([marks, np.linspace(shaft.steps[0], shaft.steps[-1], SAMPLES)]))
    reached = _top(shaft, marks) if share == 1 else _first(shaft, times, share * shaft.omega_top)
    return reached - _start(shaft, times[times <= reached])


def _speed(shaft: MotorShaft, time: float) -> float:
    return float(shaft.read(np.array([time]))[1][0])


def _first(shaft: MotorShaft, times: Array, goal: float) -> float:
    """The first time at a speed in size."""
    after = int(np.argmax(np.abs(shaft.read(times)[1]) >= goal))
    if after == 0:
        return float(times[0])
    bracket = times[after - 1 : after + 1].tolist()
    return float(brentq(lambda time: abs(_speed(shaft, time)) - goal, *bracket, xtol=1e-300, rtol=FINE))


def _top(shaft: MotorShaft, marks: Array) -> float:
    """Where the highest speed begins: the start of a plateau, else its peak, among ends of steps and turning points."""
    speeds = np.abs(shaft.read(marks)[1])
    near = speeds >= shaft.omega_top * (1 - REST)
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
    speeds = shaft.read(times)[1]
    ends = shaft.steps[1:][shaft.resting]
    found: list[float] = [float(times[0]), *ends[ends <= times[-1]].tolist()]
    touches = np.flatnonzero(np.abs(speeds) <= REST * shaft.omega_top)
    if touches.size:
        last = touches[np.flatnonzero(np.diff(touches, prepend=-2) > 1)[-1] :]  # a soft start stays near zero
        sizes = np.abs(speeds[last])
        found.append(float(times[last[np.flatnonzero(sizes == sizes.min())[-1]]]))
    turned = np.flatnonzero(speeds[:-1] * speeds[1:] < 0)
    if turned.size:
        bracket = times[turned[-1] : turned[-1] + 2].tolist()
        found.append(float(brentq(lambda time: _speed(shaft, time), *bracket, xtol=1e-300, rtol=FINE)))
    return max(found)
