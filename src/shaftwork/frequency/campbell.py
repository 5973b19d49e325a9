"""The interference diagram: where excitation orders of a turning shaft meet natural frequencies."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import in_si
from shaftwork.core.screen import counted, in_lines
from shaftwork.frequency.modes_over_speed import Meeting, OverSpeed, Swinging, differing, numbered
from shaftwork.frequency.natural_modes import NaturalModes
from shaftwork.results.observer import RPM, Array, array_in_si
from shaftwork.results.plotting import new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LAWS = ", laws at t = "
"""Before the time at which laws are read, in what a title says of the point."""


@dataclass(frozen=True)
class Crossing:
    """An order meets a natural frequency.

    Args:
        speed: of the exciting shaft, rad/s.
        order: excitations per turn.
        mode: name of the mode.
        frequency: Hz.
    """

    speed: float
    order: float
    mode: str
    frequency: float


@dataclass(frozen=True, eq=False)
class Campbell:
    """Natural frequencies over the speed of a shaft, with the lines f = order speed / 2 pi of its excitations.

    Args:
        title: of the network.
        about: what it is linearised about, in words; empty where it is linear.
        speeds: (k,) rad/s, ascending.
        orders: excitations per turn.
        modes: names of the modes that swing at some speed; where the network has several phases, each has its modes,
            "mode 1 (pump stuck)".
        frequencies: (k, modes) natural frequencies, Hz; 0 where a mode does not swing, or belongs to another phase.
        crossings: by ascending speed.
        f_max: end of the frequency axis, Hz.
    """

    title: str
    about: str
    speeds: Array
    orders: tuple[float, ...]
    modes: tuple[str, ...]
    frequencies: Array
    crossings: tuple[Crossing, ...]
    f_max: float

    def __str__(self) -> str:
        crossings = counted(len(self.crossings), "crossing")
        head = f"{self.heading}: {crossings} from {self.speeds[0]:g} to {self.speeds[-1]:g} rad/s"
        lines = [f"{'rad/s':>12}  {'1/min':>12}  {'order':>6}  {'Hz':>12}  mode"]
        lines += [
            f"{met.speed:>12.6g}  {met.speed * RPM:>12.6g}  {met.order:>6g}  {met.frequency:>12.6g}  {met.mode}"
            for met in self.crossings
        ]
        return "\n".join([head, *lines])

    @property
    def heading(self) -> str:
        """The network, and what it is linearised about."""
        return f"{self.title} {self.about}".strip()

    def plot(self) -> Figure:
        """The diagram, speeds in 1/min (extra `plot`).

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        return _diagram(self)


def campbell(
    title: str,
    modes_at: Callable[[float, float], tuple[NaturalModes, str]],
    speeds: Any,
    orders: Any,
    f_max: float | None,
    *,
    constant: bool,
) -> Campbell:
    """The interference diagram of a network; see `Network.campbell`.

    Law: a crossing is a speed n with f(n) = order n / 2 pi, f a natural frequency at n itself. It is sought between
    two of the speeds, in each phase of the network for itself, and refined until it no longer changes.

    Args:
        title: of the network, with which those of the modes begin.
        modes_at: from a speed in rad/s and a frequency in Hz to the modes there, up to that frequency at least, and
            the phase that they belong to.
        speeds: (k,) rad/s, ascending.
        orders: excitations per turn, each above 0.
        f_max: highest frequency of interest, Hz; without one the axis ends above the highest mode.
        constant: whether the modes are the same at all speeds.

    Raises:
        ParameterError: speeds or orders are not what they must be.
    """
    n, lines = _ascending(speeds), _orders(orders)
    top = float(max(lines) * n[-1] / (2 * np.pi)) if f_max is None else in_si("f_max", f_max, "Hz", above=0)
    network = OverSpeed(modes_at, top)
    points = [network.at(float(n[0]))] * len(n) if constant else [network.at(float(speed)) for speed in n]
    meetings = _constant(points[0], n, lines) if constant else network.meetings(n, lines)
    names = _names(network, [*points, *(met.at for met in meetings)])
    crossings = (
        Crossing(met.speed, met.order, names[met.at.speed][met.rank], float(met.order * met.speed / (2 * np.pi)))
        for met in meetings
    )
    inside = [crossing for crossing in crossings if crossing.frequency <= top]
    inside.sort(key=attrgetter("speed", "order", "frequency"))
    rows = [dict(zip(names[point.speed], point.frequencies.tolist(), strict=True)) for point in points]
    shown = tuple(dict.fromkeys(name for row in rows for name, frequency in row.items() if frequency <= top))
    table = np.array([[row.get(name, 0.0) for name in shown] for row in rows]).reshape(len(n), len(shown))
    # some room above the highest mode
    end = min(top, 1.15 * float(table.max())) if f_max is None and table.any() else top
    return Campbell(title, _about(title, points), n, lines, shown, table, tuple(inside), end)


def _constant(point: Swinging, n: Array, orders: Sequence[float]) -> list[Meeting]:
    """Where orders meet modes that are the same at all speeds."""
    meetings = (
        Meeting(2 * np.pi * frequency / order, point, order, rank)
        for order in orders
        for rank, frequency in enumerate(point.frequencies.tolist())
    )
    return [met for met in meetings if n[0] <= met.speed <= n[-1]]


def _names(network: OverSpeed, shown: Sequence[Swinging]) -> dict[float, list[str]]:
    """The name of each mode by speed: its number, with its phase in words where several phases are shown."""
    words = differing(tuple(dict.fromkeys(point.phase for point in shown)))
    numbers = numbered(sorted(network.points.values(), key=lambda point: point.speed))
    return {
        point.speed: [
            f"mode {number + 1}" + (f" ({words[point.phase]})" if len(words) > 1 else "")
            for number in numbers[point.speed]
        ]
        for point in shown
    }


def _about(title: str, points: Sequence[Swinging]) -> str:
    """The point of all modes, or those of the first and the last."""
    first, last = (point.title.removeprefix(title).strip() for point in (points[0], points[-1]))
    if first == last:
        return first
    point, _, time = first.partition(LAWS)
    first = point if time and last.endswith(LAWS + time) else first
    return f"at points from {first.removeprefix('at ')} to {last.removeprefix('at ')}"


def _ascending(speeds: Any) -> Array:
    n = array_in_si("speeds", speeds, "rad/s")
    if len(n) < 2 or not (np.isfinite(n).all() and n[0] >= 0 and (np.diff(n) > 0).all()):
        raise ParameterError(
            f"speeds = {reprlib.repr(speeds)} must be two or more speeds in rad/s, ascending from 0 or above, such as "
            f"numpy.linspace(0, 300, 61)."
        )
    return n


def _orders(orders: Any) -> tuple[float, ...]:
    listed = orders if isinstance(orders, Sequence | np.ndarray) and not isinstance(orders, str) else (orders,)
    if not len(listed):
        raise ParameterError("orders = () must name one or more excitations per turn, such as (1, 2, 3).")
    return tuple(in_si("orders", order, above=0) for order in listed)


def _diagram(diagram: Campbell) -> Figure:
    figure = new_figure("Campbell.plot()", 9.0, 5.5, f"{diagram.title}: natural frequencies and orders")
    axis = figure.subplots()
    for name, column in zip(diagram.modes, diagram.frequencies.T, strict=True):
        swings = column > 0
        beside = np.append(swings[1:], False) | np.append(False, swings[:-1])
        shown, alone = np.where(swings, column, np.nan), np.flatnonzero(swings & ~beside).tolist()
        axis.plot(diagram.speeds * RPM, shown, linewidth=1.4, label=name, marker="o", ms=3, markevery=alone)
    for order in diagram.orders:
        end = min(float(diagram.speeds[-1]), 2 * np.pi * diagram.f_max / order)
        tip = end * RPM, order * end / (2 * np.pi)
        axis.plot([0, tip[0]], [0, tip[1]], color="0.5", linewidth=0.8)
        axis.annotate(f"{order:g}", tip, color="0.3", fontsize=8, xytext=(3, -10), textcoords="offset points")
    crossings = diagram.crossings
    axis.plot([met.speed * RPM for met in crossings], [met.frequency for met in crossings], "k.", ms=6)
    axis.set_xlim(float(diagram.speeds[0]) * RPM, float(diagram.speeds[-1]) * RPM)
    axis.set_ylim(0, diagram.f_max)
    axis.set_xlabel("speed in 1/min")
    axis.set_ylabel("f in Hz")
    axis.grid(alpha=0.3)
    if diagram.modes:
        axis.legend(loc="best", framealpha=0.8, edgecolor="none", fontsize=8)
    if diagram.about:
        axis.set_title(in_lines(f"linearised {diagram.about}", 8.0, size=9.0), fontsize=9)
    return figure
