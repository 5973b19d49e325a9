"""The curve of torque over speed that a motor itself has, at any instant."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from shaftwork.codegen.observer import ModelObserver
from shaftwork.components.base import Component
from shaftwork.components.rotation import Inertia
from shaftwork.core.errors import NetworkWarning, ShaftworkError
from shaftwork.core.notices import muted
from shaftwork.pipeline.network import Network
from shaftwork.results.observer import Array

Curve = Callable[[Array, Array], Array]
"""Torque in N m at times (k,) in s and speeds (k,) in rad/s."""
SPEEDS, ROUNDS, FINER = 129, 5, 17
"""Speeds among which the largest torque is looked for; how often, and among how many, between those beside it."""
BEYOND = 1.5
"""The search goes to this many times the highest speed, both ways."""


def own_curve(motor: Component | None, steps: Array) -> Curve | None:
    """Torque of a motor by time and speed; None for one whose torque depends on more, or is not its own.

    Args:
        motor: the component, with a shaft at its first port.
        steps: (s,) of the motion, s.
    """
    if motor is None or motor.role != "source" or sum(not port.optional for port in motor.ports) != 1:
        return None
    net = Network("bench")
    try:
        with muted(NetworkWarning):  # of its curve the motor has been warned about when made
            net.add(motor, "shaft")
            net.add(Inertia("inertia", J=1.0), "shaft")
            model = net.compile()
    except ShaftworkError:
        return None
    if model.states != ("inertia.omega",) or any(part.modes for part in model.form.graph.parts):
        return None
    prepared = model.prepare(model.defaults)
    observer = ModelObserver(
        model.form, lambda: prepared.bound, model.switching.timeline(prepared.p, steps[0], steps[-1])
    )
    return lambda t, omega: observer.signal(f"{motor.name}.tau", t, omega[:, None])


def pull_out(curve: Curve, times: Array, top: float) -> Array:
    """(k,) the largest torque in size, N m, that a curve has at each time, at any speed.

    Args:
        curve: of the motor.
        times: (k,) s.
        top: a speed in rad/s that is not far below those of the curve.
    """
    rows = np.arange(len(times))
    low, high = np.full(len(times), -BEYOND * top), np.full(len(times), BEYOND * top)
    best = np.zeros(len(times))
    for number in (SPEEDS, *([FINER] * ROUNDS)):
        omega = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, number)
        tau = np.abs(curve(np.repeat(times, number), omega.ravel())).reshape(omega.shape)
        at = tau.argmax(axis=1)
        best = np.maximum(best, tau[rows, at])
        low, high = omega[rows, np.maximum(at - 1, 0)], omega[rows, np.minimum(at + 1, number - 1)]
    return best


def fastest(motor: Component, top: float) -> float:
    """The highest speed in rad/s that a motor's curve is about: of the motion, or synchronous."""
    value = motor.declared["n_sync"].magnitude(motor.values["n_sync"])[0] if "n_sync" in motor.declared else 0.0
    return max(top, float(value) * math.pi / 30)
