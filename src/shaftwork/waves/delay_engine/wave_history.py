"""The waves that have left the ends of the lines, panel by panel."""

from __future__ import annotations

from bisect import bisect_left, bisect_right

import numpy as np
from numpy.typing import NDArray

from shaftwork.integrate.problem import Array
from shaftwork.waves.delay_engine.collocation import POINTS, POWERS, STAGES, values_at
from shaftwork.waves.delay_engine.lines import Lines, Past


class WaveHistory:
    """The waves w = 2 Z v + h (N m) that have left the ends of the lines, panel by panel.

    Args:
        lines: which end receives what from where.
        past: what left them before t0.
        merge: times nearer than this, in s, are the same.
    """

    def __init__(self, lines: Lines, past: Past, merge: float) -> None:
        self._lines, self._merge = lines, merge
        self.starts: list[float] = past.starts.tolist()
        self.lengths: list[float] = past.lengths.tolist()
        self.waves = list(past.waves)

    def append(self, start: float, length: float, waves: Array) -> None:
        """Add the panel behind the last one: its start and length in s, its waves (q, s)."""
        self.starts.append(start)
        self.lengths.append(length)
        self.waves.append(waves)

    def at(self, t: float) -> tuple[Array, Array]:
        """History torques h (q,) and their rates (q,) just after a time in s, up to which all that left is known."""
        count = sum(len(ends) for ends in self._lines.ends)
        arrived, rates = np.empty(count), np.empty(count)
        for delay, ends, partners in zip(self._lines.delays, self._lines.ends, self._lines.partners, strict=True):
            number = max(bisect_right(self.starts, t - delay + self._merge) - 1, 0)
            place = 2 * (t - delay - self.starts[number]) / self.lengths[number] - 1
            powers = self.waves[number][partners] @ POWERS
            arrived[ends] = -powers @ place ** np.arange(STAGES)
            slopes = np.arange(1, STAGES) * place ** np.arange(STAGES - 1)
            rates[ends] = -powers[:, 1:] @ slopes * (2 / self.lengths[number])
        return arrived, rates

    def arriving(self, start: float, length: float, tolerance: Array) -> tuple[Array, float | None]:
        """History torques h (q, s) at the Gauss points of a panel, and where to divide it if they are not resolved.

        Args:
            start: of the panel in s; what left the ends a delay before is known.
            length: of the panel in s.
            tolerance: (q,) that the polynomial through the points may miss the history by.
        """
        arrived = np.empty((tolerance.size, STAGES))
        cut: float | None = None
        for delay, ends, partners in zip(self._lines.delays, self._lines.ends, self._lines.partners, strict=True):
            low = start - delay
            high = low + length
            first = bisect_right(self.starts, low + self._merge) - 1
            last = max(bisect_left(self.starts, high - self._merge) - 1, first)
            if first < last:
                arrived[ends], missed = self._several(low, high, (first, last), partners)
                if cut is None and (missed > tolerance[ends, None]).any():
                    cut = self._divide(low, high, (first, last)) + delay
                continue
            shift, stretch = low - self.starts[first], length / self.lengths[first]
            if abs(shift) <= self._merge and abs(shift + length - self.lengths[first]) <= self._merge:
                arrived[ends] = -self.waves[first][partners]
            else:
                points = 2 * shift / self.lengths[first] - 1 + (1 + POINTS) * stretch
                arrived[ends] = -values_at(self.waves[first][partners] @ POWERS, points)
        return arrived, cut

    def _several(self, low: float, high: float, span: tuple[int, int], rows: NDArray[np.intp]) -> tuple[Array, Array]:
        """Values at the points of [low, high], and by how much their polynomial misses what is between the points."""
        panels = range(span[0], span[1] + 1)
        starts, lengths = self.starts[span[0] : span[1] + 1], self.lengths[span[0] : span[1] + 1]
        times = low + (high - low) * (1 + POINTS) / 2
        index = np.clip(np.searchsorted(starts, times, side="right") - 1, 0, None)
        arrived = np.empty((rows.size, STAGES))
        for number in dict.fromkeys(index.tolist()):
            chosen = index == number
            points = 2 * (times[chosen] - starts[number]) / lengths[number] - 1
            arrived[:, chosen] = -values_at(self.waves[panels[number]][rows] @ POWERS, points)
        nodes = (np.array(starts)[:, None] + np.multiply.outer(lengths, (1 + POINTS) / 2)).ravel()
        values = np.concatenate([self.waves[k][rows] for k in panels], axis=1)
        inside = (nodes >= low) & (nodes <= high)
        points = 2 * (nodes[inside] - low) / (high - low) - 1
        return arrived, np.abs(values_at(arrived @ POWERS, points) + values[:, inside])

    def _divide(self, low: float, high: float, span: tuple[int, int]) -> float:
        # What a polynomial cannot follow lies where two panels meet.
        meetings = np.array(self.starts[span[0] + 1 : span[1] + 1])
        return float(meetings[np.argmin(np.abs(meetings - (low + high) / 2))])
