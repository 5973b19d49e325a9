"""An independent reference: two shafts as travelling waves, joined by a gear, between a motor and a gap.

Nothing is shared with the library. The waves that leave the ends are Chebyshev series between break points. A break
point is the start, an instant at which the gap opens or closes, and whatever is one delay later than a break point.
Between two of them everything is smooth; the states there are found by Picard's iteration of the integral equation on
Chebyshev points. A change of the contact inside a span is found as a root of the series and ends it.
"""

from __future__ import annotations

import heapq
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray
from scipy.optimize import brentq

Array = NDArray[np.float64]

POINTS = 20
_NODES = -np.cos(np.pi * np.arange(POINTS) / (POINTS - 1))
_TO_SERIES = np.linalg.inv(chebyshev.chebvander(_NODES, POINTS - 1))
_INTEGRATE = (
    np.column_stack([chebyshev.chebval(_NODES, chebyshev.chebint(row, lbnd=-1)) for row in np.eye(POINTS)]) @ _TO_SERIES
)
_LOOK = np.linspace(-1, 1, 101)


@dataclass(frozen=True)
class Drive:
    """Motor and J1 - first shaft - disc and gear - second shaft - J2 - gap - J3 with a viscous load.

    Args:
        motor: torque over speed.
        inertias: of J1, of the disc at the gear's fast side, of J2 and of J3.
        ratio: of the gear, fast speed over slow speed.
        impedances, delays: of the two shafts.
        gap, c, d: whole free twist, stiffness and damping of the contact.
        load: torque per speed at J3.
    """

    motor: Callable[[Array], Array]
    inertias: tuple[float, float, float, float]
    ratio: float
    impedances: tuple[float, float]
    delays: tuple[float, float]
    gap: float
    c: float
    d: float
    load: float

    def speeds_of_ends(self, y: Array) -> Array:
        """Of first shaft a, b, second shaft a, b."""
        return np.array([y[0], y[1], y[1] / self.ratio, y[2]])

    def rates(self, y: Array, h: Array, sides: tuple[bool, ...]) -> Array:
        """Of the speeds of J1, disc, J2, J3 and of the twist in the gap."""
        taken = np.repeat(self.impedances, 2)[:, None] * self.speeds_of_ends(y) + h
        contact = self.contact(y, sides)
        torques = (
            self.motor(y[0]) - taken[0],
            -taken[1] - taken[2] / self.ratio,
            -taken[3] - contact,
            contact - self.load * y[3],
        )
        return np.array([*(torque / J for torque, J in zip(torques, self.inertias, strict=True)), y[2] - y[3]])

    def contact(self, y: Array, sides: tuple[bool, ...]) -> Array:
        """The torque of the contact for known signs of `switches`."""
        forward, backward = self.switches(y)[1], -self.switches(y)[3]
        return forward * (sides[0] and sides[1]) + backward * (sides[2] and sides[3])

    def switches(self, y: Array) -> Array:
        """Beyond the gap and pressing, on the one flank and on the other."""
        forward, backward, slip = y[4] - self.gap / 2, -y[4] - self.gap / 2, y[2] - y[3]
        return np.array([forward, self.c * forward + self.d * slip, backward, self.c * backward - self.d * slip])


def motion(drive: Drive, t_end: float, times: Array) -> Array:
    """Speeds and twist (5, k) at times (k,) of a drive that starts at rest in the middle of its gap."""
    starts, spans = [0.0], []
    y, sides = np.zeros(5), tuple(bool(value > 0) for value in drive.switches(np.zeros(5)))
    breaks, t = list(drive.delays), 0.0
    while t < t_end - 1e-14:
        while breaks and breaks[0] <= t + 1e-13:
            heapq.heappop(breaks)
        end = min(breaks[0], t + min(drive.delays), t_end)
        series, waves, sides, end = _span(drive, t, end, y, sides, starts, spans)
        spans.append((t, end, series, waves))
        t, y = end, chebyshev.chebval(1.0, series)
        starts.append(t)
        for delay in drive.delays:
            heapq.heappush(breaks, t + delay)
    found = np.empty((5, len(times)))
    for k, time in enumerate(times):
        low, high, series, _ = spans[min(bisect_right(starts, time), len(spans)) - 1]
        found[:, k] = chebyshev.chebval((2 * time - low - high) / (high - low), series)
    return found


def _span(drive, t, end, y, sides, starts, spans):
    """Chebyshev series of states and waves up to `end` or to where the contact changes; then the signs after it."""
    for _ in range(3):
        series, waves = _solved(drive, t, end, y, sides, starts, spans)
        first = _first_change(drive, series, sides)
        if first is None:
            return series, waves, sides, end
        place, numbers = first
        end = t + (place + 1) / 2 * (end - t)
        series, waves = _solved(drive, t, end, y, sides, starts, spans)
        after = tuple(side != (k in numbers) for k, side in enumerate(sides))
        if _first_change(drive, series, sides, last=1 - 1e-9) is None:
            return series, waves, after, end
    raise RuntimeError(f"two changes of the contact at {t}")


def _solved(drive, t, end, y, sides, starts, spans):
    half = (end - t) / 2
    times = t + half * (_NODES + 1)
    h = -np.array([_left(spans, starts, times - drive.delays[k // 2], k ^ 1) for k in range(4)])
    values = np.repeat(y[:, None], POINTS, axis=1)
    for _ in range(200):
        new = y[:, None] + half * drive.rates(values, h, sides) @ _INTEGRATE.T
        change = np.abs(new - values).max()
        values = new
        if change <= 1e-15 * np.abs(values).max():
            break
    waves = 2 * np.repeat(drive.impedances, 2)[:, None] * drive.speeds_of_ends(values) + h
    return _TO_SERIES @ values.T, _TO_SERIES @ waves.T


def _left(spans, starts, times, end):
    """The wave that left an end at times that all lie in one span; nothing before the start."""
    middle = times[POINTS // 2]
    if middle < 0:
        return np.zeros(POINTS)
    low, high, _, waves = spans[bisect_right(starts, middle) - 1]
    return chebyshev.chebval((2 * times - low - high) / (high - low), waves[:, end])


def _first_change(drive, series, sides, last=1.0):
    """Place in a span and numbers of the first switches that leave their sides, together where nothing damps."""
    found = []
    places = _LOOK * last if last < 1 else _LOOK
    values = drive.switches(chebyshev.chebval(places, series))
    for number, (row, side) in enumerate(zip(values, sides, strict=True)):
        wrong = np.flatnonzero((row[1:] > 0) != side)
        if wrong.size:
            k = int(wrong[0]) + 1
            low, high = places[k - 1], places[k]

            def value(place: float, number: int = number) -> float:
                return float(drive.switches(chebyshev.chebval(place, series))[number])

            if (value(low) > 0) != side:  # it has just left this side and rounding says otherwise
                continue
            found.append((brentq(value, low, high, xtol=1e-15), number))
    if not found:
        return None
    first = min(found)[0]
    return first, [number for place, number in found if place - first < 1e-7]
