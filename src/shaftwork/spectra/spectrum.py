"""The amplitude spectrum of a quantity over a span of a motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len, rfft
from scipy.signal import find_peaks
from scipy.signal.windows import hann

from shaftwork.core.errors import AccuracyWarning, ParameterError
from shaftwork.core.notices import warn
from shaftwork.core.parameters import in_si
from shaftwork.core.screen import ROWS, in_columns
from shaftwork.numerics.tolerances import GOLDEN
from shaftwork.results.observer import Array, Reader, span_of
from shaftwork.results.plotting import new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FEWEST_SAMPLES, MOST_SAMPLES = 2**12, 2**20
"""Samples of a span."""


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Amplitudes of the sines of which a quantity is made up over a span, its mean left out.

    Law: |FFT| of evenly spaced values under a Hann window, scaled so that a sine on a line of the spectrum has its own
    amplitude there; between two lines it shows at least 85 % of it.

    Args:
        title: of the network.
        name: of the quantity.
        unit: of the amplitudes.
        frequencies: (k,) Hz, evenly spaced.
        amplitudes: (k,) of a sine, half of its peak-to-peak value.
    """

    title: str
    name: str
    unit: str
    frequencies: Array
    amplitudes: Array

    @property
    def peaks(self) -> tuple[tuple[float, float], ...]:
        """Frequency in Hz and amplitude of the peaks, the largest first."""
        places, _ = find_peaks(self.amplitudes)
        ranked = places[np.argsort(-self.amplitudes[places], kind="stable")]
        return tuple((float(self.frequencies[place]), float(self.amplitudes[place])) for place in ranked)

    def __str__(self) -> str:
        rows = [[f"{f:.6g}", f"{amplitude:.5g}"] for f, amplitude in self.peaks[:ROWS]]
        title = f"{self.name} in '{self.title}': peaks of the spectrum, lines {self.frequencies[1]:.4g} Hz apart"
        return "\n".join([title, *in_columns([["Hz", self.unit], *rows])])

    __repr__ = __str__

    def plot(self) -> Figure:
        """The amplitudes over the frequency (extra `plot`)."""
        figure = new_figure("Spectrum.plot()", 9.0, 4.0, f"{self.name} in {self.title}")
        axes = figure.subplots()
        axes.plot(self.frequencies, self.amplitudes, linewidth=1.0)
        axes.set(xlabel="frequency in Hz", ylabel=f"amplitude in {self.unit}", xlim=(0.0, self.frequencies[-1]))
        axes.grid(alpha=0.3)
        return figure


def spectrum(
    reader: Reader, name: str, place: int | None, start: float | None, end: float | None, f_max: float | None
) -> Spectrum:
    """The spectrum of a quantity; arguments as of `Solution.spectrum`."""
    first, last = span_of(reader, start, end)
    wanted = None if f_max is None else in_si("f_max", f_max, "Hz")
    if wanted is not None and not 2.0 <= wanted * (last - first) < MOST_SAMPLES / 4:  # two lines at least
        lowest, highest = 2.0 / (last - first), MOST_SAMPLES / 4 / (last - first)
        raise ParameterError(f"f_max = {wanted:g} Hz must be {lowest:g} to {highest:g} Hz over {last - first:g} s.")
    read = reader.quantity(name, number_of(reader, name, place))

    def sampled(count: int) -> Array:
        return windowed(read(np.linspace(first, last, count, endpoint=False)))

    fewest = FEWEST_SAMPLES if wanted is None else max(FEWEST_SAMPLES, int(4 * wanted * (last - first)))
    amplitudes = refined(sampled, fewest, MOST_SAMPLES, f"the spectrum of '{name}' over {last - first:g} s")
    frequencies = np.arange(len(amplitudes)) / (last - first)
    inside = slice(None) if wanted is None else frequencies <= wanted
    return Spectrum(reader.title, name, reader.unit(name), frequencies[inside], amplitudes[inside])


def refined(sampled: Callable[[int], Array], fewest: int, most: int, what: str) -> Array:
    """Amplitudes (..., k) that more samples do not change: what swings faster than half the samples appears elsewhere.

    Args:
        sampled: from a number of samples to the amplitudes; more of them give more lines behind the same.
        fewest: samples to begin with.
        most: samples at which it ends.
        what: for the warning.

    Warns:
        AccuracyWarning: even the most samples change the amplitudes.
    """
    amplitudes, count = sampled(fewest), fewest
    while True:
        # by the golden section: twice as many samples would often show the same wrong frequency
        more = next_fast_len(int(count / GOLDEN), real=True)
        finer = sampled(more)
        lines = amplitudes.shape[-1] - 1  # without the last one, where both sides of the half fall together
        off = np.abs(finer[..., :lines] - amplitudes[..., :lines]).max(initial=0.0)
        fewer, amplitudes, count = count, finer, more
        # What swings too fast for the samples appears at a false frequency, and with more of them at another one.
        if off <= 1e-3 * np.abs(finer).max(initial=0.0):
            return amplitudes
        if count >= most:
            warn(
                f"{what[0].upper()}{what[1:]} still changes by {off:.2g} between {fewer} and {count} samples: the "
                "quantity jumps, or swings faster than these can show. Take a shorter span.",
                AccuracyWarning,
            )
            return amplitudes


def windowed(values: Array) -> Array:
    """(..., k / 2 + 1) amplitudes of evenly spaced values (..., k), less their mean, under a Hann window."""
    count = values.shape[-1]
    window = hann(count, sym=False)
    mean = (values * window).sum(axis=-1, keepdims=True) / window.sum()
    lines = np.abs(rfft((values - mean) * window)) * 2.0 / window.sum()
    return np.asarray(lines, dtype=float)


def number_of(reader: Reader, name: str, place: int | None) -> int | None:
    """The place of a quantity along a part; by default the middle one.

    Raises:
        ParameterError: there is no such place.
        SignalError: there is no such quantity.
    """
    reader.unit(name)
    count = len(reader.places(name))
    if place is not None and place not in range(count):
        there = f"0 to {count - 1}" if count else "none: it is read at one place"
        raise ParameterError(f"place = {place!r}: '{name}' of '{reader.title}' has the places {there}.")
    return place if place is not None else count // 2 if count else None
