"""The interference diagram: where excitation orders of a turning shaft meet natural frequencies."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from shaftwork.core.errors import MissingExtraError, ParameterError
from shaftwork.core.parameters import in_si, numbers_in_si
from shaftwork.core.screen import counted
from shaftwork.results.modes import Modes
from shaftwork.results.observer import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REFINED = 1e-12
ITERATIONS = 50
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
        modes: names of the modes that swing at some speed.
        frequencies: (k, modes) natural frequencies, Hz; 0 where a mode does not swing.
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
        for made in self.crossings:
            turns = made.speed * 30 / np.pi
            lines.append(f"{made.speed:>12.6g}  {turns:>12.6g}  {made.order:>6g}  {made.frequency:>12.6g}  {made.mode}")
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
    modes_at: Callable[[float, float], Modes],
    speeds: Any,
    orders: Any,
    f_max: float | None,
    *,
    constant: bool,
) -> Campbell:
    """The interference diagram of a network.

    Law: a crossing is a speed n with f(n) = order n / 2 pi, found between two of the speeds and refined until it no
    longer changes.

    Args:
        title: of the network, with which those of the modes begin.
        modes_at: the modes at a speed in rad/s, those up to a frequency in Hz at least.
        speeds: (k,) rad/s, ascending.
        orders: excitations per turn, each above 0.
        f_max: highest frequency of interest, Hz; by default the highest order at the highest speed.
        constant: whether the modes are the same at all speeds.

    Raises:
        ParameterError: speeds or orders are not what they must be.
    """
    n, lines = _ascending(speeds), _orders(orders)
    top = float(max(lines) * n[-1] / (2 * np.pi)) if f_max is None else in_si("f_max", f_max, "Hz", above=0)

    def modes(speed: float) -> Modes:
        return modes_at(speed, top)

    found = [modes(float(n[0]))] * len(n) if constant else [modes(float(speed)) for speed in n]
    rates, names = _tracked(found)
    table = np.where(rates.imag > 0, np.abs(rates), 0.0) / (2 * np.pi)
    shown = np.array(((table > 0) & (table <= top)).any(axis=0))
    table, kept = table[:, shown], tuple(name for name, show in zip(names, shown, strict=True) if show)
    crossings = [
        Crossing(speed, order, kept[mode], float(order * speed / (2 * np.pi)))
        for mode in range(len(kept))
        for order in lines
        for speed in _meeting(modes, n, table[:, mode], order, constant=constant)
    ]
    inside = sorted(
        (made for made in crossings if made.frequency <= top), key=lambda made: (made.speed, made.order, made.frequency)
    )
    return Campbell(title, _about(title, found), n, lines, kept, table, tuple(inside), top)


def _about(title: str, found: Sequence[Modes]) -> str:
    """The point of all modes, or those of the first and the last."""
    first, last = (modes.title.removeprefix(title).strip() for modes in (found[0], found[-1]))
    if first == last:
        return first
    point, _, time = first.partition(LAWS)
    first = point if time and last.endswith(LAWS + time) else first
    return f"at points from {first.removeprefix('at ')} to {last.removeprefix('at ')}"


def _ascending(speeds: Any) -> Array:
    plain = numbers_in_si("speeds", speeds, "rad/s")
    try:
        given = np.atleast_1d(np.asarray(plain, dtype=float))
    except (TypeError, ValueError):
        given = np.empty(0)
    if (
        given.ndim != 1
        or len(given) < 2
        or not (np.isfinite(given).all() and given[0] >= 0 and (np.diff(given) > 0).all())
    ):
        raise ParameterError(
            f"speeds = {reprlib.repr(speeds)} must be two or more speeds in rad/s, ascending from 0 or above, such as "
            f"numpy.linspace(0, 300, 61)."
        )
    return given


def _orders(orders: Any) -> tuple[float, ...]:
    listed = orders if isinstance(orders, Sequence | np.ndarray) and not isinstance(orders, str) else (orders,)
    if not len(listed):
        raise ParameterError("orders = () must name one or more excitations per turn, such as (1, 2, 3).")
    return tuple(in_si("orders", order, above=0) for order in listed)


def _tracked(found: Sequence[Modes]) -> tuple[Any, tuple[str, ...]]:
    """(k, modes) rates, each column one mode followed from speed to speed by its nearest rate; 0 where it is absent.

    The distance of two rates counts as a fraction of both, so that a mode that leaves at an end of the diagram moves no
    other.
    """
    size = max(len(modes) for modes in found)
    tracks = [np.pad(modes.rates, (0, size - len(modes))) for modes in found]
    for k, (before, after) in enumerate(pairwise(tracks)):
        if before is not after:
            sizes = np.abs(before)[:, None] + np.abs(after)[None, :]
            distances = np.abs(before[:, None] - after[None, :]) / np.where(sizes > 0, sizes, 1.0)
            _, order = linear_sum_assignment(distances)
            tracks[k + 1] = after[order]
    names = next(modes for modes in found if len(modes) == size).names
    return np.array(tracks), names


def _meeting(
    modes_at: Callable[[float], Modes], n: Array, frequency: Array, order: float, *, constant: bool
) -> list[float]:
    """The speeds at which an order meets one natural frequency."""
    if constant:
        speed = 2 * np.pi * float(frequency[0]) / order
        return [speed] if n[0] <= speed <= n[-1] else []
    gap = frequency - order * n / (2 * np.pi)
    swings = frequency > 0
    met: list[float] = []
    for k in range(len(n) - 1):
        if not (swings[k] and swings[k + 1]) or gap[k] * gap[k + 1] > 0 or gap[k + 1] == 0:
            continue
        start = float(n[k] - gap[k] * (n[k + 1] - n[k]) / (gap[k + 1] - gap[k]))
        met.append(_refined(modes_at, start, order, (float(n[k]), float(n[k + 1]))))
    if swings[-1] and gap[-1] == 0:
        met.append(float(n[-1]))
    return met


def _refined(modes_at: Callable[[float], Modes], start: float, order: float, between: tuple[float, float]) -> float:
    """The meeting of an order with the natural frequency nearest to it, from a start that interpolation gave."""
    speed = start
    for _ in range(ITERATIONS):
        found = modes_at(speed).frequencies
        line = order * speed / (2 * np.pi)
        new = 2 * np.pi * float(found[np.abs(found - line).argmin()]) / order
        if not between[0] <= new <= between[1]:
            return start
        if abs(new - speed) <= REFINED * abs(speed):
            return new
        speed = new
    return start


def _diagram(diagram: Campbell) -> Figure:
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingExtraError("matplotlib", "plot", "Campbell.plot()") from None
    figure = Figure(figsize=(9, 5.5), layout="constrained")
    axis = figure.subplots()
    turns = 30 / np.pi
    for name, column in zip(diagram.modes, diagram.frequencies.T, strict=True):
        axis.plot(diagram.speeds * turns, np.where(column > 0, column, np.nan), linewidth=1.4, label=name)
    for order in diagram.orders:
        end = min(float(diagram.speeds[-1]), 2 * np.pi * diagram.f_max / order)
        axis.plot([0, end * turns], [0, order * end / (2 * np.pi)], color="0.5", linewidth=0.8)
        axis.annotate(
            f"{order:g}",
            (end * turns, order * end / (2 * np.pi)),
            color="0.3",
            fontsize=8,
            xytext=(3, 1),
            textcoords="offset points",
        )
    axis.plot(
        [made.speed * turns for made in diagram.crossings], [made.frequency for made in diagram.crossings], "k.", ms=6
    )
    axis.set_xlim(float(diagram.speeds[0]) * turns, float(diagram.speeds[-1]) * turns)
    axis.set_ylim(0, diagram.f_max)
    axis.set_xlabel("speed in 1/min")
    axis.set_ylabel("f in Hz")
    axis.grid(alpha=0.3)
    if diagram.modes:
        axis.legend(loc="upper left", frameon=False, fontsize=8)
    figure.suptitle(f"{diagram.title}: natural frequencies and orders")
    if diagram.about:
        axis.set_title(f"linearised {diagram.about}", fontsize=9)
    return figure
