"""A motion in the plane of speed and torque, with what a motor can give."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from shaftwork.core.errors import MissingExtraError
from shaftwork.results.observer import Array
from shaftwork.sizing.catalogue import CatalogueMotor
from shaftwork.sizing.motor_shaft import RPM
from shaftwork.sizing.own_curve import own_curve
from shaftwork.sizing.reserve import Limit, limits

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from shaftwork.sizing.duty_cycle import Duty

POINTS, CURVE = 4000, 400
"""Points of the motion and of a curve."""
CURVES = 4
"""Curves of a motor that changes its own with time, at equal steps of time."""


def speed_torque_plane(duty: Duty, limit: Limit | CatalogueMotor) -> Figure:
    """The trajectory, the effective torque, the motor's own curve and, where there is one, a limit in all quadrants.

    Args:
        duty: of the motion.
        limit: as of `Duty.reserve`, or a motor of a catalogue.

    Raises:
        MissingExtraError: matplotlib is not installed.
        ParameterError: the limit is none.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingExtraError("matplotlib", "plot", "Duty.plot()") from None
    figure = Figure(figsize=(8, 5.5), layout="constrained")
    axes = figure.subplots()
    times, tau, n = _trajectory(duty)
    points = axes.scatter(n, tau, c=times, s=4, cmap="viridis", zorder=3)
    figure.colorbar(points, ax=axes, label="t in s")
    axes.plot(n, tau, color="0.6", linewidth=0.6, zorder=2)
    top = 1.15 * max(duty.n_top, limit.fastest if isinstance(limit, CatalogueMotor) else 0.0)
    speeds = np.linspace(-top if n.min() < -1e-6 * top else 0.0, top, CURVE)
    _own(axes, duty, speeds)
    if limit is not None:
        _limited(axes, duty, limit, speeds)
    axes.axhline(duty.thermal("S1"), color="tab:orange", linestyle="--", linewidth=1, label="thermal torque, S1")
    axes.axhline(0.0, color="0.3", linewidth=0.8)
    axes.axvline(0.0, color="0.3", linewidth=0.8)
    axes.set_xlabel("speed in 1/min")
    axes.set_ylabel("torque in N m")
    axes.grid(alpha=0.3)
    axes.legend(loc="best", frameon=False, fontsize="small")
    axes.set_title(f"{duty.title}: {duty.motor} at its own shaft", fontsize="medium")
    return figure


def _trajectory(duty: Duty) -> tuple[Array, Array, Array]:
    """Times, torques and speeds, both sides of every step's end among them."""
    steps = duty.shaft.steps
    times = np.unique(
        np.concatenate([np.linspace(steps[0], steps[-1], POINTS), steps, np.nextafter(steps[1:], -np.inf)])
    )
    tau, omega = duty.shaft.read(times)
    return times, tau, omega * RPM


def _own(axes: Axes, duty: Duty, speeds: Array) -> None:
    """The motor's own curve; several where it changes with time."""
    shaft = duty.shaft
    curve = own_curve(shaft.part, shaft.steps)
    if curve is None:
        return
    instants = np.linspace(shaft.steps[0], shaft.steps[-1], CURVES + 2)[1:-1]
    made = [curve(np.full(CURVE, time), speeds / RPM) for time in instants.tolist()]
    steady = all(np.array_equal(made[0], one) for one in made)
    for time, torques in list(zip(instants.tolist(), made, strict=True))[: 1 if steady else CURVES]:
        label = f"curve of {duty.motor}" if steady else f"curve of {duty.motor} at {time:.3g} s"
        axes.plot(speeds, torques, linewidth=1.2, alpha=0.8, label=label)


def _limited(axes: Axes, duty: Duty, limit: Limit | CatalogueMotor, speeds: Array) -> None:
    """The limit, motoring and braking, and the rated torque of a motor of a catalogue."""
    name = "limit"
    if isinstance(limit, CatalogueMotor):
        axes.axhline(limit.tau_n, color="tab:green", linestyle="--", linewidth=1, label="rated torque")
        name, limit = f"limit of {limit.name}", limit.limit
    most = limits(duty.shaft, limit)(np.full(CURVE, duty.shaft.steps[-1]), np.abs(speeds))
    axes.plot(speeds, most, color="tab:red", linewidth=1.2, label=name)
    axes.plot(speeds, -most, color="tab:red", linewidth=1.2)
