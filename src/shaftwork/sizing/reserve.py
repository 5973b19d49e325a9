"""What torque a motor can give, by a limit or its own curve, and a motion beside it: its reserve and its picture."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize.elementwise import find_minimum

from shaftwork.codegen.model_observer import ModelObserver
from shaftwork.components.base import Component
from shaftwork.components.mechanics import Inertia
from shaftwork.components.tables import Table, interpolate
from shaftwork.core.errors import NetworkWarning, ParameterError, ShaftworkError
from shaftwork.core.notices import muted
from shaftwork.core.parameters import in_si
from shaftwork.numerics.tolerances import TYPED
from shaftwork.pipeline.network import Network
from shaftwork.results.course import turning_points
from shaftwork.results.observer import RPM, Array
from shaftwork.results.plotting import new_figure
from shaftwork.sizing.catalogue import CatalogueMotor
from shaftwork.sizing.motor_shaft import MotorShaft

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Limit = float | Table | Callable[[Array], Array] | None
"""Largest torque in size, N m, over the motor's speed without sign in 1/min; None for the motor's own."""
Curve = Callable[[Array, Array], Array]
"""A torque in N m at times (k,) in s and speeds (k,): of a motor in rad/s, largest ones without sign in 1/min."""
NO_LIMIT = 1 / TYPED
"""Torque over its limit where there is none left of it."""
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

    worst = turning_points(used, shaft.steps, smallest=TYPED)
    place = int((worst.values >= (1 - TYPED) * worst.values.max()).argmax())
    time = worst.t[place : place + 1]
    (tau,), (omega,) = shaft.read(time)
    (most,) = limited(time, np.abs([omega]) * RPM)
    load = float(worst.values[place])
    ratio = math.inf if load == 0 else 0.0 if load == NO_LIMIT else 1 / load
    return Reserve(ratio, float(time[0]), float(omega) * RPM, float(tau), float(most))


def limits(shaft: MotorShaft, limit: Limit) -> Curve:
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
        torques = np.asarray(limit(n), dtype=float)
    except (TypeError, ValueError) as error:
        raise ParameterError(f"limit fails for an array of speeds: {error}. {AS_ARRAY}") from error
    if torques.ndim > 1 or torques.size not in (1, n.size):
        raise ParameterError(f"limit gives {torques.size} torques for {n.size} speeds. {AS_ARRAY}")
    torques = np.broadcast_to(torques, n.shape)
    if np.isnan(torques).any() or torques.min() < 0:
        raise ParameterError(
            "limit gives torques that are below zero or no numbers. Give the size in N m at any speed."
        )
    return torques


def _own(shaft: MotorShaft) -> Curve:
    curve = own_curve(shaft.part, shaft.steps)
    if curve is None or shaft.part is None:
        what = f"'{shaft.part.name}' ({type(shaft.part).__name__})" if shaft.part else f"'{shaft.torque}'"
        raise ParameterError(
            f"{what} has no curve of torque over speed of its own. Give limit=, the largest torque in N m over the "
            "motor's speed in 1/min: a number, Table([0, 1500, 3000], [20, 20, 10]), or the limit of a motor of a "
            "catalogue."
        )
    count = 257  # between them a pull-out torque that changes with time is a straight line
    instants = np.linspace(shaft.steps[0], shaft.steps[-1], count)
    ends = shaft.steps if len(shaft.steps) <= count else shaft.steps[:0]
    times = np.unique(np.concatenate([instants, ends, np.nextafter(ends[1:], -np.inf)]))
    most = _pull_out(curve, times, _fastest(shaft.part, shaft.omega_top))
    return lambda t, _: np.interp(t, times, most)


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


def _pull_out(curve: Curve, times: Array, top: float) -> Array:
    """(k,) the largest torque in size, N m, that a curve has at each time, at any speed.

    Args:
        curve: of the motor.
        times: (k,) s.
        top: a speed in rad/s that is not far below those of the curve.
    """
    omega = np.linspace(-1.5 * top, 1.5 * top, 129)  # both ways, and beyond the highest speed
    tau = np.abs(curve(np.repeat(times, omega.size), np.tile(omega, len(times)))).reshape(len(times), omega.size)
    near = np.clip(tau.argmax(axis=1), 1, omega.size - 2)
    bracket = omega[near - 1], omega[near], omega[near + 1]
    peak = find_minimum(lambda w, t: -np.abs(curve(t, w)), bracket, args=(times,))
    return np.asarray(np.where(peak.success, -peak.f_x, tau.max(axis=1)))


def _fastest(motor: Component, top: float) -> float:
    """The highest speed in rad/s that a motor's curve is about: of the motion, or synchronous."""
    value = motor.declared["n_sync"].magnitude(motor.values["n_sync"])[0] if "n_sync" in motor.declared else 0.0
    return max(top, float(value) / RPM)


def speed_torque_plane(shaft: MotorShaft, thermal: float, limit: Limit | CatalogueMotor) -> Figure:
    """The trajectory, the effective torque, the motor's own curve and, where there is one, a limit in all quadrants.

    Args:
        shaft: of the motor, in the motion.
        thermal: torque that heats the motor as the motion does, N m.
        limit: as of `Duty.reserve`, or a motor of a catalogue.

    Raises:
        MissingExtraError: matplotlib is not installed.
        ParameterError: the limit is none.
    """
    figure = new_figure("Duty.plot()", 8.0, 5.5)
    axes = figure.subplots()
    times, tau, n = _trajectory(shaft)
    points = axes.scatter(n, tau, c=times, s=4, cmap="viridis", zorder=3)
    figure.colorbar(points, ax=axes, label="t in s")
    axes.plot(n, tau, color="0.6", linewidth=0.6, zorder=2)
    top = 1.15 * max(shaft.omega_top * RPM, limit.fastest if isinstance(limit, CatalogueMotor) else 0.0)
    speeds = np.linspace(-top if n.min() < -1e-6 * top else 0.0, top, 400)
    _draw_own(axes, shaft, speeds)
    if limit is not None:
        _draw_limit(axes, shaft, limit, speeds)
    axes.axhline(thermal, color="tab:orange", linestyle="--", linewidth=1, label="thermal torque, S1")
    axes.axhline(0.0, color="0.3", linewidth=0.8)
    axes.axvline(0.0, color="0.3", linewidth=0.8)
    axes.set_xlabel("speed in 1/min")
    axes.set_ylabel("torque in N m")
    axes.grid(alpha=0.3)
    axes.legend(loc="best", frameon=False, fontsize="small")
    axes.set_title(f"{shaft.solution.name}: {shaft.name} at its own shaft", fontsize="medium")
    return figure


def _trajectory(shaft: MotorShaft) -> tuple[Array, Array, Array]:
    """Times, torques and speeds, both sides of every step's end among them."""
    steps = shaft.steps
    times = np.unique(np.concatenate([shaft.even, steps, np.nextafter(steps[1:], -np.inf)]))
    tau, omega = shaft.read(times)
    return times, tau, omega * RPM


def _draw_own(axes: Axes, shaft: MotorShaft, speeds: Array) -> None:
    """The motor's own curve; several where it changes with time."""
    curve = own_curve(shaft.part, shaft.steps)
    if curve is None:
        return
    instants = np.linspace(shaft.steps[0], shaft.steps[-1], 6)[1:-1]  # four curves at even times can be told apart
    curves = [curve(np.full(speeds.size, time), speeds / RPM) for time in instants.tolist()]
    steady = all(np.array_equal(curves[0], torques) for torques in curves)
    for time, torques in list(zip(instants.tolist(), curves, strict=True))[: 1 if steady else None]:
        label = f"curve of {shaft.name}" if steady else f"curve of {shaft.name} at {time:.3g} s"
        axes.plot(speeds, torques, linewidth=1.2, alpha=0.8, label=label)


def _draw_limit(axes: Axes, shaft: MotorShaft, limit: Limit | CatalogueMotor, speeds: Array) -> None:
    """The limit, motoring and braking, and the rated torque of a motor of a catalogue."""
    name = "limit"
    if isinstance(limit, CatalogueMotor):
        axes.axhline(limit.tau_n, color="tab:green", linestyle="--", linewidth=1, label="rated torque")
        name, limit = f"limit of {limit.name}", limit.limit
    most = limits(shaft, limit)(np.full(speeds.size, shaft.steps[-1]), np.abs(speeds))
    axes.plot(speeds, most, color="tab:red", linewidth=1.2, label=name)
    axes.plot(speeds, -most, color="tab:red", linewidth=1.2)
