"""Modes over the speed of a shaft: which mode is the same at two speeds, and where an excitation order meets one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq, linear_sum_assignment

from shaftwork.frequency.natural_modes import NaturalModes, natural_frequencies
from shaftwork.numerics.tolerances import EQUAL
from shaftwork.results.observer import Array, Complex

BETWEEN = ", "
"""Between the modes of the parts in the words of a phase."""

ModesAt = Callable[[float, float], tuple[NaturalModes, str]]
"""From a speed in rad/s and a frequency in Hz to the modes there, up to it at least, and the phase they belong to."""


@dataclass(frozen=True, eq=False)
class Swinging:
    """The modes that swing at one speed, by ascending frequency.

    Args:
        speed: rad/s.
        phase: the modes of all parts, in words; only within one phase are natural frequencies continuous.
        rates: (k,) 1/s.
        shapes: (n, k), each of length 1, in units of equal energy.
        title: of the modes.
    """

    speed: float
    phase: str
    rates: Complex
    shapes: Complex
    title: str

    @property
    def frequencies(self) -> Array:
        """(k,) Hz."""
        return natural_frequencies(self.rates)

    def above(self, order: float) -> Array:
        """(k,) how far each frequency lies above an order, Hz."""
        return self.frequencies - order * self.speed / (2 * np.pi)


def swinging(speed: float, modes: NaturalModes, phase: str, f_max: float) -> Swinging:
    """The modes at a speed that swing, up to a frequency in Hz."""
    swings = (modes.rates.imag > 0) & (modes.frequencies <= f_max)
    vectors = modes.vectors[:, swings] * modes.slopes.weights[:, None]
    lengths = np.linalg.norm(vectors, axis=0)
    return Swinging(speed, phase, modes.rates[swings], vectors / np.where(lengths > 0, lengths, 1.0), modes.title)


def same_modes(before: tuple[Complex, Complex], after: tuple[Complex, Complex]) -> list[tuple[int, int]]:
    """Which modes are the same at two points of one phase: the likest in shape and rate, each of them at most once.

    Shapes are compared by their modal assurance criterion, rates by their distance over their sum. Modes that are
    farther apart in rate than they are alike in shape are two.

    Args:
        before: rates (k,) and shapes (n, k) at one point.
        after: those at the other.
    """
    (rates, shapes), (others, other_shapes) = before, after
    sizes = np.abs(rates)[:, None] + np.abs(others)[None, :]
    apart = np.abs(rates[:, None] - others[None, :]) / np.where(sizes > 0, sizes, 1.0)
    alike = np.abs(shapes.conj().T @ other_shapes) ** 2
    rows, columns = linear_sum_assignment(apart - alike)
    return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if alike[i, j] >= apart[i, j]]


@dataclass(frozen=True)
class Meeting:
    """An order meets a natural frequency.

    Args:
        speed: rad/s.
        at: the modes there.
        order: excitations per turn.
        rank: which of the modes, from 0.
    """

    speed: float
    at: Swinging
    order: float
    rank: int


@dataclass
class OverSpeed:
    """The modes of a network over the speed of a shaft, computed where they are asked for and kept.

    Args:
        modes_at: the modes at a speed.
        f_max: highest frequency of interest, Hz.
    """

    modes_at: ModesAt
    f_max: float
    points: dict[float, Swinging] = field(default_factory=dict)

    def at(self, speed: float) -> Swinging:
        """The modes at a speed in rad/s."""
        if speed not in self.points:
            limit = 1.2 * self.f_max  # so far beyond the end of a diagram that none is lost at its edge
            self.points[speed] = swinging(speed, *self.modes_at(speed, limit), limit)
        return self.points[speed]

    def meetings(self, speeds: Array, orders: Sequence[float]) -> list[Meeting]:
        """Where orders meet natural frequencies.

        Args:
            speeds: (k,) rad/s, ascending; one meeting of a mode and an order is found between two of them.
            orders: excitations per turn.
        """
        points = [self.at(float(speed)) for speed in speeds]
        meetings = [met for first, last in pairwise(points) for met in self._between(first, last, orders)]
        return [*meetings, *_at(points[-1], orders)]

    def _between(self, first: Swinging, last: Swinging, orders: Sequence[float]) -> list[Meeting]:
        """Those of an interval. Where the phase changes within it, it is halved until its parts have one phase each."""
        waiting, meetings = [(first, last)], list[Meeting]()
        # an interval in which the phase changes is halved so often at most, and down to this part of the whole
        halvings, narrow = 40, 1e-6 * (last.speed - first.speed)
        while waiting:
            left, right = waiting.pop(0)
            alike, is_wide = self._alike(left, right), right.speed - left.speed > narrow
            met: list[Meeting] = []
            if alike or not halvings:
                met, between = self._in_one_phase(left, right, orders)
            else:
                between = self.at((left.speed + right.speed) / 2) if is_wide else None
            if between is not None and is_wide and halvings:
                halvings -= 1
                waiting += [(left, between), (between, right)]
            else:
                meetings += met
        return meetings

    def _alike(self, left: Swinging, right: Swinging) -> bool:
        """Whether two points have one phase and the same modes, but for some beyond the highest of interest."""
        if left.phase != right.phase:
            return False
        pairs = same_modes((left.rates, left.shapes), (right.rates, right.shapes))
        in_both = ({i for i, _ in pairs}, {j for _, j in pairs})
        return all(
            place in same or frequency > self.f_max
            for point, same in zip((left, right), in_both, strict=True)
            for place, frequency in enumerate(point.frequencies)
        )

    def _in_one_phase(
        self, left: Swinging, right: Swinging, orders: Sequence[float]
    ) -> tuple[list[Meeting], Swinging | None]:
        """The meetings of an interval, and a point within it where the modes are others after all."""
        meetings, stranger = list[Meeting](), None
        count = min(len(left.rates), len(right.rates))
        for order in orders:
            low, high = left.above(order)[:count], right.above(order)[:count]
            meetings += [met for met in _at(left, (order,)) if met.rank < count]
            for rank in np.flatnonzero(low * high < 0).tolist():
                at = self._refined(left, right, order, rank)
                if not _goes_on(left, at, rank):
                    stranger = at
                elif abs(at.above(order)[rank]) <= EQUAL * at.frequencies[rank]:  # it jumps past an order between two
                    meetings.append(Meeting(at.speed, at, order, rank))
        return meetings, stranger

    def _refined(self, left: Swinging, right: Swinging, order: float, rank: int) -> Swinging:
        """Where the mode of a rank meets an order, by Brent's method; sooner where the modes are others.

        By their rank all modes are continuous within a phase, also where two cross.
        """

        def gap(speed: float) -> float:
            at = self.at(speed)
            return float(at.above(order)[rank]) if _goes_on(left, at, rank) else 0.0  # which ends the search

        return self.at(brentq(gap, left.speed, right.speed, xtol=np.finfo(float).tiny, rtol=1e-12, disp=False))


def _at(point: Swinging, orders: Iterable[float]) -> list[Meeting]:
    """Where orders meet frequencies exactly at a point."""
    return [
        Meeting(point.speed, point, order, int(k)) for order in orders for k in np.flatnonzero(point.above(order) == 0)
    ]


def _goes_on(left: Swinging, at: Swinging, rank: int) -> bool:
    """Whether the mode of a rank is there at another point, in the same phase."""
    return at.phase == left.phase and rank < len(at.rates)


def numbered(points: Iterable[Swinging]) -> dict[float, list[int]]:
    """The number of each mode within its phase, counted from 0, by speed; points by ascending speed."""
    seen: dict[str, list[tuple[complex, Complex]]] = {}
    return {point.speed: _numbers(seen.setdefault(point.phase, []), point) for point in points}


def _numbers(seen: list[tuple[complex, Complex]], point: Swinging) -> list[int]:
    """The number of each mode of a further point; what was not there before is a new one.

    Args:
        seen: of each mode of the phase rate and shape where it was seen last, which this brings up to date.
        point: at a higher speed.
    """
    numbers = [-1] * len(point.rates)
    if seen:
        before = np.array([rate for rate, _ in seen]), np.stack([shape for _, shape in seen], axis=1)
        for i, j in same_modes(before, (point.rates, point.shapes)):
            numbers[j] = i
    for j, mode in enumerate(zip(point.rates.tolist(), point.shapes.T, strict=True)):
        if numbers[j] < 0:
            numbers[j] = len(seen)
            seen.append(mode)
        seen[numbers[j]] = mode
    return numbers


def differing(phases: Sequence[str]) -> dict[str, str]:
    """What tells each of several phases from the others, in words: the parts that have one mode in all are left out."""
    split = [phase.split(BETWEEN) for phase in phases]
    if len({len(words) for words in split}) != 1:
        return dict(zip(phases, phases, strict=True))
    differ = [k for k, words in enumerate(zip(*split, strict=True)) if len(set(words)) > 1]
    return {phase: BETWEEN.join(words[k] for k in differ) for phase, words in zip(phases, split, strict=True)}
