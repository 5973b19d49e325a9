"""Spectra over the order of a shaft: how often per turn a quantity swings, while the speed changes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import cumulative_simpson
from scipy.interpolate import PchipInterpolator

from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import in_si
from shaftwork.core.screen import ROWS, in_columns
from shaftwork.results.observer import RPM, Array, Reader, span_of
from shaftwork.results.plotting import new_figure, plain
from shaftwork.spectra.spectrum import MOST_SAMPLES, number_of, refined, windowed

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class OrderSpectra:
    """Amplitude spectra over the order, one for each stretch of equally many turns, half of it shared with the next.

    Law: the quantity at equal steps of the angle, Hann window, FFT. So what swings k times per turn stays on the order
    k however the speed changes.

    Args:
        title: of the network.
        name: of the quantity.
        unit: of the amplitudes.
        speed: name of the speed.
        orders: (k,) per turn, evenly spaced.
        speeds: (s,) mean speeds of the stretches, rad/s.
        times: (s,) their middles, s.
        amplitudes: (s, k) half of the peak-to-peak value of a sine.
    """

    title: str
    name: str
    unit: str
    speed: str
    orders: Array
    speeds: Array
    times: Array
    amplitudes: Array

    def order(self, number: float) -> Array:
        """(s,) amplitudes of the line next to an order, over the stretches.

        Raises:
            ParameterError: there is no such order in the spectra.
        """
        if not isinstance(number, int | float) or not 0.0 <= number <= self.orders[-1]:
            raise ParameterError(f"order = {number!r} must be from 0 to {self.orders[-1]:g}, the highest order here.")
        return np.asarray(self.amplitudes[:, int(np.argmin(np.abs(self.orders - number)))])

    def __str__(self) -> str:
        largest = self.amplitudes.max(axis=0)
        rows = [
            [f"{self.orders[k]:.4g}", f"{largest[k]:.5g}", f"{self.speeds[self.amplitudes[:, k].argmax()] * RPM:.5g}"]
            for k in np.argsort(-largest, kind="stable")[:ROWS]
        ]
        title = f"{self.name} in '{self.title}' over {self.speed}: {len(self.times)} order spectra, largest lines"
        return "\n".join([title, *in_columns([["order", self.unit, "at 1/min"], *rows])])

    __repr__ = __str__

    def plot(self) -> Figure:
        """The waterfall: amplitudes in colour over order and speed; over time where the speed comes back."""
        figure = new_figure("OrderSpectra.plot()", 9.0, 5.0, f"{self.name} in {self.title}")
        axes = figure.subplots()
        rising = bool((np.diff(np.abs(self.speeds)) > 0).all() or (np.diff(np.abs(self.speeds)) < 0).all())
        rows = np.abs(self.speeds) * RPM if rising else self.times
        colours = axes.pcolormesh(
            self.orders, rows, self.amplitudes, shading="nearest", cmap="viridis", rasterized=True
        )
        axes.set(xlabel=plain(f"order of {self.speed}"), ylabel="speed in 1/min" if rising else "t in s")
        figure.colorbar(colours, label=f"amplitude in {self.unit}")
        return figure


def order_spectra(
    reader: Reader,
    name: str,
    speed: str,
    place: int | None,
    turns: float,
    order_max: float,
    span: tuple[float | None, float | None],
) -> OrderSpectra:
    """Order spectra of a quantity; arguments as of `Solution.order_spectra`."""
    first, last = span_of(reader, *span)
    if reader.unit(speed) != "rad/s":
        raise ParameterError(
            f"speed = {speed!r}: it is no speed in rad/s, such as 'J1.omega', but in {reader.unit(speed)!r}."
        )
    turning, highest = in_si("turns", turns, "1"), in_si("order_max", order_max, "1")
    if not (turning > 0.0 and highest > 1.0 / turning):
        raise ParameterError(f"turns = {turns!r}, order_max = {order_max!r}: both above 0, order_max above 1 / turns.")
    times = np.linspace(first, last, 20_001)
    speeds = reader.quantity(speed)(times)
    way = np.sign(speeds[len(speeds) // 100])  # shortly after the start, which may be a standstill
    if (wrong := speeds * way <= 0.0).any():
        raise ParameterError(
            f"'{speed}' stands or turns back at t = {times[wrong][0]:.4g} s, where orders mean nothing. Give start= "
            "and end= of a span in which it turns one way."
        )
    angles = np.abs(cumulative_simpson(speeds, x=times, initial=0.0)) / (2.0 * np.pi)
    starts = np.arange(0.0, angles[-1] - turning, turning / 2.0)
    if not starts.size:
        total = f"'{speed}' makes {angles[-1]:.4g} turns from {first:g} to {last:g} s"
        raise ParameterError(f"turns = {turning:g}: {total}. Take fewer turns.")
    when = PchipInterpolator(angles, times)
    read = reader.quantity(name, number_of(reader, name, place))

    def sampled(count: int) -> Array:
        at = when(starts[:, None] + turning / count * np.arange(count))
        return windowed(read(at.ravel()).reshape(at.shape))

    fewest = int(np.ceil(4 * highest * turning))  # twice what the sampling theorem needs
    most = max(fewest, MOST_SAMPLES // len(starts))
    amplitudes = refined(sampled, fewest, most, f"the order spectra of '{name}' over {turning:g} turns")
    orders = np.arange(amplitudes.shape[1]) / turning
    inside = orders <= highest
    ends = when(starts + turning)
    begins = when(starts)
    mean = 2.0 * np.pi * turning / (ends - begins) * np.sign(speeds.sum())
    middle = (ends + begins) / 2.0
    unit = reader.unit(name)
    return OrderSpectra(reader.title, name, unit, speed, orders[inside], mean, middle, amplitudes[:, inside])
