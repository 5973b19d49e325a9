"""A quantity over a motion on parted panels of time: polynomials with their extremes and turning points, and integrals.

Law: a panel's polynomial, of degree 7, goes through the values at Lobatto's eight points. Where it follows the quantity
its Chebyshev coefficients fall, and the last of them say what it misses. Integrals are those of Lobatto's rule, to
rounding, in panels that are parted where that still changes something. Source: Trefethen, Approximation Theory and
Approximation Practice, chapters 3 and 8.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray

from shaftwork.numerics.polynomials import chebyshev_nodes, lobatto_rule, to_chebyshev, to_powers, to_slopes
from shaftwork.numerics.tolerances import CLEARANCE
from shaftwork.numerics.zeros import Chosen, zeros
from shaftwork.results.observer import Array, Read, blocks

NODES, WEIGHTS = lobatto_rule(7)
"""Of Lobatto's rule, which reads both ends: there peaks are, and a jump close to an end is not overlooked."""
SHARE = 0.41
"""Of a panel is the first of its two parts: of a jump in the middle, halves and the whole would say the same."""
CLOSE, SHAKES = 1e-6 * np.arange(6), 20.0
"""Of a panel: times so close that only rounding bends what is read there; misses up to so many times this are noise."""
ROUNDINGS = 100 * float(np.finfo(float).eps)
"""Of the largest value: what rounding alone makes a polynomial miss."""
LOOKS = chebyshev_nodes(32)
"""Where in a panel, from -1 to 1, its polynomial is looked at."""

Mask = NDArray[np.bool_]
_RATES = to_slopes(NODES, NODES)
_DEGREE = len(NODES) - 1
_TAILS = to_chebyshev(NODES)[-3:]
_POWERS = to_powers(NODES)
_SLOPES = _POWERS[1:] * np.arange(1, _DEGREE + 1)[:, None]
_BENDS = _SLOPES[1:] * np.arange(1, _DEGREE)[:, None]
_VALUES_THERE = np.vander(LOOKS, _DEGREE + 1, increasing=True) @ _POWERS
_SLOPES_THERE = np.vander(LOOKS, _DEGREE, increasing=True) @ _SLOPES
_BETWEEN = 1.0 / np.cos(0.5 * np.pi * _DEGREE / (len(LOOKS) - 1))
"""No polynomial of this degree is larger between the looks by more than this factor (Ehlich and Zeller, 1964)."""


@dataclass(frozen=True, eq=False)
class LobattoPanels:
    """Parts of a span of time, each with the nodes of Lobatto's rule.

    Args:
        start: (p,) ascending, s.
        end: (p,) s.
    """

    start: Array
    end: Array
    nodes: ClassVar[Array] = NODES
    weights: ClassVar[Array] = WEIGHTS

    @classmethod
    def between(cls, edges: Array) -> Self:
        """Panels from each time to the next, s."""
        return cls(edges[:-1], edges[1:])

    @classmethod
    def joined(cls, parts: Sequence[LobattoPanels]) -> tuple[Self, NDArray[np.intp]]:
        """The panels of all parts, ascending, and their order."""
        start, end = (np.concatenate([getattr(part, side) for part in parts]) for side in ("start", "end"))
        order = np.argsort(start, kind="stable")
        return cls(start[order], end[order]), order

    @property
    def length(self) -> Array:
        """(p,) s."""
        return self.end - self.start

    @property
    def times(self) -> Array:
        """(p, 8) nodes, ascending, s; the last a rounding before the end, where another panel may begin with a jump."""
        times: Array = self.start[:, None] + self.length[:, None] * (NODES + 1) / 2
        times[:, -1] = np.nextafter(self.end, self.start)
        return times

    def parted(self) -> Self:
        """Two panels for each."""
        middle = self.start + SHARE * self.length
        start, end = np.stack([self.start, middle], axis=1), np.stack([middle, self.end], axis=1)
        return type(self)(start.ravel(), end.ravel())

    def split(self, times: Array) -> LobattoPanels:
        """Panels that also end at times (k,) inside the span, which they fill without gaps."""
        start = np.unique(np.append(self.start, times))
        return LobattoPanels(start, np.append(start[1:], self.end[-1]))

    def integrals(self, values: Array) -> Array:
        """(..., p) integrals over each panel of values (..., p, 8) at the nodes."""
        return np.asarray(values @ self.weights * self.length / 2)

    def slopes(self, values: Array) -> Array:
        """(p, 8) derivatives by time of the polynomials through values (p, 8)."""
        return np.asarray(values @ _RATES.T * 2 / self.length[:, None])

    def taken(self, which: NDArray[Any] | slice) -> Self:
        """Some of them, marked or numbered."""
        return type(self)(self.start[which], self.end[which])


class GaussPanels(LobattoPanels):
    """Parts of a span of time with the nodes of Gauss' rule, which reads no ends: there a power may have no value."""

    nodes, weights = np.polynomial.legendre.leggauss(len(NODES))

    @property
    def times(self) -> Array:
        """(p, 8) nodes, ascending, s."""
        return np.asarray(self.start[:, None] + self.length[:, None] * (self.nodes + 1) / 2)


@dataclass(frozen=True, eq=False)
class Integrals:
    """Integrals of m quantities over panels in which all of them are smooth.

    Args:
        panels: p of them, ascending, without gaps.
        values: (m, p) over each panel.
        sizes: (m, p) those of the size of each quantity.
    """

    panels: LobattoPanels
    values: Array
    sizes: Array

    @property
    def totals(self) -> Array:
        """(m,) over the run."""
        return np.asarray(self.values.sum(axis=1))


def integrate(
    integrand: Callable[[LobattoPanels], Array],
    steps: Array,
    *,
    rule: type[LobattoPanels] = LobattoPanels,
    alike: bool = False,
    size: float = 0.0,
    most: int = 100_000,
) -> Integrals:
    """Integrals of several quantities over a run.

    A kink or a jump within a step is closed in by parting; the ends of steps are ends of panels.

    Args:
        integrand: (m, p, 8) the quantities at the nodes of panels.
        steps: (s,) times between which the motion is smooth, s.
        rule: the panels.
        alike: whether the quantities are of one kind: what is little beside the largest need not be known better.
        size: the largest integral of a size over what was before, beside which it need not be known better either.
        most: panels; a motion that asks for more, such as torque of mere noise, is integrated as far as that.
    """
    tight = 1e-13  # of the integral of the integrand's size: a change by parting all panels that is none
    least = max(1, 64 // len(steps))  # panels of a step: an exact engine has few steps
    edges = np.append((steps[:-1, None] + np.diff(steps)[:, None] * np.arange(least) / least).ravel(), steps[-1])
    panels = rule.between(edges)
    shortest = CLEARANCE * np.spacing(np.abs(steps).max())
    whole, first, count, before = panels.integrals(integrand(panels)), len(panels.start), 0, (np.inf, 0)
    scales = np.full(len(whole), max(size, float(np.finfo(float).tiny)))
    settled: list[tuple[LobattoPanels, Array, Array]] = []
    while len(panels.start):
        parts = panels.parted()
        values = integrand(parts)
        fine, sizes = parts.integrals(values), parts.integrals(np.abs(values))
        change = np.abs(fine.reshape(len(fine), -1, 2).sum(axis=2) - whole)
        scale = (scales + sizes.sum(axis=1))[:, None]
        scale = scale.max(axis=0, keepdims=True, initial=0.0) if alike else scale
        rough, open_ = float((change / scale).sum(axis=1).max(initial=0.0)), len(panels.start)
        count += 2 * open_
        # Small changes are noise where parting leaves three quarters of them, in half as many panels again.
        noisy = 0.75 * before[0] < rough <= 1e-9 and open_ > 1.5 * before[1]
        done = (change <= tight * scale / first).all(axis=0) | (panels.length <= shortest)
        if rough <= tight or count > most or noisy:
            done[:] = True
        done = np.repeat(done, 2)
        scales += sizes[:, done].sum(axis=1)
        settled.append((parts.taken(done), fine[:, done], sizes[:, done]))
        panels, whole, before = parts.taken(~done), fine[:, ~done], (rough, open_)
    panels, order = rule.joined([part for part, *_ in settled])
    values, sizes = (np.concatenate([one[k] for one in settled], axis=1)[:, order] for k in (1, 2))
    return Integrals(panels, values, sizes)


@dataclass(frozen=True, eq=False)
class Course:
    """A quantity as polynomials.

    Args:
        read: the quantity itself.
        panels: ascending, without gaps.
        values: (p, 8) at their nodes.
        end: value at the very end.
    """

    read: Read
    panels: LobattoPanels
    values: Array
    end: float

    @property
    def mean(self) -> float:
        """Over time."""
        return float(self.panels.integrals(self.values).sum() / self.panels.length.sum())

    def extremes(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Time and value of the first minimum, and of the first maximum; on either side of a jump too.

        Of several that are equal but for rounding it is the first, on every machine.
        """
        times, values = self.points(_may_hold_extremes(self.values))
        low, high = _first_largest(times, -values), _first_largest(times, values)
        return (float(times[low]), float(values[low])), (float(times[high]), float(values[high]))

    def points(self, chosen: Mask | None = None) -> tuple[Array, Array]:
        """Times and values, ascending: the nodes, and the turns between them in all panels or in those chosen."""
        rows = np.arange(len(self.values)) if chosen is None else np.flatnonzero(chosen)
        slopes = np.sign(self.values[rows] @ _SLOPES_THERE.T)
        which, place = np.nonzero(slopes[:, :-1] * slopes[:, 1:] < 0)
        rows = rows[which]
        at = _turns(self.values[rows], LOOKS[place], LOOKS[place + 1])
        turns = self.panels.start[rows] + self.panels.length[rows] * (at + 1) / 2
        times, values = np.append(self.panels.times, self.panels.end[-1]), np.append(self.values, self.end)
        if len(turns):
            times, values = np.append(times, turns), np.append(values, self.read(turns))
            order = np.argsort(times, kind="stable")
            times, values = times[order], values[order]
        return times, values


def _first_largest(times: Array, values: Array) -> int:
    """Place of the largest value, and of several that are equal but for rounding the first."""
    first = int((values >= values.max() - ROUNDINGS * np.abs(values).max()).argmax())
    there = times <= times[first] + CLEARANCE * np.spacing(np.abs(times).max())
    return int(values[there].argmax())


def first_times(steps: Array) -> Array:
    """(k,) times at which every quantity between these steps is looked at first."""
    return np.asarray(LobattoPanels.between(np.unique(steps)).times.ravel())


def course(read: Read, steps: Array, *, even: bool = False) -> Course:
    """A quantity as polynomials that are fine where it may be largest or smallest, and rough elsewhere.

    Args:
        read: the quantity.
        steps: (s,) times between which it is smooth; kinks and jumps elsewhere are closed in by parting.
        even: whether they are to be as good everywhere.
    """
    edges = np.unique(steps)
    panels = LobattoPanels.between(edges)
    shortest = CLEARANCE * np.spacing(np.abs(edges).max())
    settled: list[tuple[LobattoPanels, Array]] = []
    end_value = float(read(edges[-1:])[0])
    low, high, count = end_value, end_value, 0
    while True:
        values = read(panels.times.ravel()).reshape(-1, len(NODES))
        low, high = min(low, float(values.min())), max(high, float(values.max()))
        count += len(values)
        size, miss = high - low, _missed(values) - ROUNDINGS * max(-low, high)
        # Less may be missed where all turns are wanted, and least where an extreme may be. A turn is read where the
        # polynomial has it, so its height is right to the square of that.
        rough = miss > (1e-6 if even else 1e-3) * size
        if not even:
            rough |= (miss > 1e-9 * size) & _may_hold_extremes(values, low, high)
        # Two million panels take 128 MB; where a motion asks for more, as mere noise does, the rest stays rough.
        parted = np.flatnonzero(rough & (panels.length > shortest) & (count < 2_000_000))
        parted = parted[miss[parted] > SHAKES * _noise(read, panels.taken(parted))]
        settled.append((panels.taken(np.delete(np.arange(len(values)), parted)), np.delete(values, parted, axis=0)))
        if not len(parted):
            break
        panels = panels.taken(parted).parted()
    panels, order = LobattoPanels.joined([part for part, _ in settled])
    return Course(read, panels, np.concatenate([part for _, part in settled])[order], end_value)


def _missed(values: Array) -> Array:
    """(p,) about how far polynomials through values (p, 8) are off."""
    # The last three coefficients say it; eight times, as those of noise are as large as all.
    return np.asarray(8.0 * np.abs(values @ _TAILS.T).sum(axis=1))


def _noise(read: Read, panels: LobattoPanels) -> Array:
    """(p,) how far rounding moves what is read in panels."""
    if not len(panels.start):
        return np.empty(0)
    times = panels.start[:, None] + panels.length[:, None] * (SHARE + CLOSE)
    return np.asarray(np.abs(np.diff(read(times.ravel()).reshape(times.shape), 2)).max(axis=1))


def _may_hold_extremes(values: Array, low: float | None = None, high: float | None = None) -> Mask:
    """(p,) whether a quantity may be lower or higher there than its lowest or highest value known; from (p, 8)."""
    bottom, top = np.empty(len(values)), np.empty(len(values))
    for block in blocks(len(values), len(LOOKS)):
        there = values[block] @ _VALUES_THERE.T
        bottom[block], top[block] = there.min(axis=1), there.max(axis=1)
    room = 0.5 * (top - bottom) * (_BETWEEN - 1.0) + _missed(values)
    least, most = values.min() if low is None else low, values.max() if high is None else high
    return np.asarray((bottom - room <= least) | (top + room >= most))


def _turns(values: Array, low: Array, high: Array) -> Array:
    """Where in their panels polynomials through values (k, 8) turn between two places."""
    slope, bend = values @ _SLOPES.T, values @ _BENDS.T

    def at(powers: Array, places: Array) -> Array:
        return np.asarray(polyval(places, powers.T, tensor=False))

    def slopes(chosen: Chosen, places: Array) -> tuple[Array, Array]:
        return at(slope[chosen], places), at(bend[chosen], places)

    return zeros(slopes, low, high, rising=at(slope, low) <= 0, iterations=5)


@dataclass(frozen=True, eq=False)
class TurningPoints:
    """The first value, peaks and valleys in turn, and what the end has come to; one value where nothing changes.

    Args:
        t: (k,) times, s.
        values: (k,) in the unit of the quantity.
    """

    t: Array
    values: Array


def turning_points(read: Read, steps: Array, *, smallest: float) -> TurningPoints:
    """Peaks and valleys of a quantity, on both sides of a jump too.

    Args:
        read: the quantity at ascending times.
        steps: (s,) times between which it is smooth.
        smallest: changes up to this fraction of the whole range are no change; it keeps out the solver's noise.
    """
    times, values = course(read, steps, even=True).points()
    places = _peaks_and_valleys(values, smallest * float(np.ptp(values)))
    return TurningPoints(times[places], values[places])


def _peaks_and_valleys(values: Array, smallest: float) -> NDArray[np.intp]:
    """Indices of the first value and of every peak and valley after it that differ by more than `smallest`."""
    slopes = np.sign(np.diff(values))
    moving = np.flatnonzero(slopes)
    extremes = moving[:-1][slopes[moving[1:]] != slopes[moving[:-1]]] + 1  # of a rest at the top its begin
    turns = [0]
    reached = 0  # the furthest since the last turn; it is a turn once the way back from it is long enough
    for k in [*extremes.tolist(), len(values) - 1]:
        step = values[k] - values[reached]
        if reached != turns[-1] and step * (values[reached] - values[turns[-1]]) >= 0:
            # a peak that is higher by less than a thousandth of a change is no later one
            reached = k if abs(step) > 1e-3 * smallest else reached
        elif abs(step) > smallest:
            if reached:
                turns.append(reached)
            reached = k
    return np.array([*turns, reached] if reached else turns)
