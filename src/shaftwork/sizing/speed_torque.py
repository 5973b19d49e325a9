"""A motion in the plane of speed and torque, with what a motor can give."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from shaftwork.results.observer import RPM, Array
from shaftwork.results.plotting import new_figure
from shaftwork.sizing.catalogue import CatalogueMotor
from shaftwork.sizing.motor_shaft import MotorShaft
from shaftwork.sizing.reserve import Limit, limits, own_curve

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

POINTS, CURVE = 4000, 400
"""Points of the motion and of a curve."""
CURVES = 4
"""Curves of a motor that changes its own with time, at equal steps of time."""


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
    speeds = np.linspace(-top if n.min() < -1e-6 * top else 0.0, top, CURVE)
    _own(axes, shaft, speeds)
    if limit is not None:
        _limited(axes, shaft, limit, speeds)
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
    times = np.unique(
        np.concatenate([np.linspace(steps[0], steps[-1], POINTS), steps, np.nextafter(steps[1:], -np.inf)])
    )
    tau, omega = shaft.read(times)
    return times, tau, omega * RPM


def _own(axes: Axes, shaft: MotorShaft, speeds: Array) -> None:
    """The motor's own curve; several where it changes with time."""
    curve = own_curve(shaft.part, shaft.steps)
    if curve is None:
        return
    instants = np.linspace(shaft.steps[0], shaft.steps[-1], CURVES + 2)[1:-1]
    curves = [curve(np.full(CURVE, time), speeds / RPM) for time in instants.tolist()]
    steady = all(np.array_equal(curves[0], torques) for torques in curves)
    for time, torques in list(zip(instants.tolist(), curves, strict=True))[: 1 if steady else CURVES]:
        label = f"curve of {shaft.name}" if steady else f"curve of {shaft.name} at {time:.3g} s"
        axes.plot(speeds, torques, linewidth=1.2, alpha=0.8, label=label)


def _limited(axes: Axes, shaft: MotorShaft, limit: Limit | CatalogueMotor, speeds: Array) -> None:
    """The limit, motoring and braking, and the rated torque of a motor of a catalogue."""
    name = "limit"
    if isinstance(limit, CatalogueMotor):
        axes.axhline(limit.tau_n, color="tab:green", linestyle="--", linewidth=1, label="rated torque")
        name, limit = f"limit of {limit.name}", limit.limit
    most = limits(shaft, limit)(np.full(CURVE, shaft.steps[-1]), np.abs(speeds))
    axes.plot(speeds, most, color="tab:red", linewidth=1.2, label=name)
    axes.plot(speeds, -most, color="tab:red", linewidth=1.2)
