"""Modes over the speed of a shaft: which mode is the same at two speeds, and where an excitation order meets one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy.optimize import linear_sum_assignment

from shaftwork.results.modes import Modes
from shaftwork.results.observer import Array
from shaftwork.results.slopes import Complex

REFINED, ITERATIONS = 1e-12, 60
"""A speed that is sought is found when it changes by less than this fraction, and in so many steps at most."""
MET = 1e-6
"""An order meets a frequency that is as near as this fraction; at a jump of the frequencies it passes between two."""
HALVINGS, NARROW = 40, 1e-6
"""An interval in which the phase changes is halved so often at most, and down to this fraction of its width."""
BEYOND = 1.2
"""Modes are followed up to so many times the end of a diagram, so that none is lost at its edge."""
BETWEEN = ", "
"""Between the modes of the parts in the words of a phase."""

ModesAt = Callable[[float], tuple[Modes, str]]
"""From a speed in rad/s to the modes there and the phase that they belong to."""


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
        return np.asarray(np.abs(self.rates) / (2 * np.pi), dtype=float)

    def above(self, order: float) -> Array:
        """(k,) how far each frequency lies above an order, Hz."""
        return self.frequencies - order * self.speed / (2 * np.pi)


def swinging(speed: float, modes: Modes, phase: str, f_max: float) -> Swinging:
    """The modes at a speed that swing, up to a frequency in Hz."""
    kept = np.flatnonzero((modes.rates.imag > 0) & (modes.frequencies <= f_max))
    vectors = modes.vectors[:, kept] * modes.slopes.weights[:, None]
    return Swinging(speed, phase, modes.rates[kept], _of_length_one(vectors), modes.title)


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
        modes_at: from a speed to the modes there.
        f_max: highest frequency of interest, Hz.
    """

    modes_at: ModesAt
    f_max: float
    points: dict[float, Swinging] = field(default_factory=dict)

    def at(self, speed: float) -> Swinging:
        """The modes at a speed in rad/s."""
        if speed not in self.points:
            self.points[speed] = swinging(speed, *self.modes_at(speed), BEYOND * self.f_max)
        return self.points[speed]

    def meetings(self, speeds: Array, orders: Sequence[float]) -> list[Meeting]:
        """Where orders meet natural frequencies.

        Args:
            speeds: (k,) rad/s, ascending; one meeting of a mode and an order is found between two of them.
            orders: excitations per turn.
        """
        points = [self.at(float(speed)) for speed in speeds]
        found = [made for first, last in pairwise(points) for made in self._between(first, last, orders)]
        last = points[-1]
        ends = [
            Meeting(last.speed, last, order, int(k)) for order in orders for k in np.flatnonzero(last.above(order) == 0)
        ]
        return [*found, *ends]

    def _between(self, first: Swinging, last: Swinging, orders: Sequence[float]) -> list[Meeting]:
        """Those of an interval. Where the phase changes within it, it is halved until its parts have one phase each."""
        waiting, found = [(first, last)], list[Meeting]()
        halvings, narrow = HALVINGS, NARROW * (last.speed - first.speed)
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
                found += met
        return found

    def _alike(self, left: Swinging, right: Swinging) -> bool:
        """Whether two points have one phase and the same modes, but for some beyond the highest of interest."""
        if left.phase != right.phase:
            return False
        pairs = same_modes((left.rates, left.shapes), (right.rates, right.shapes))
        kept = ({i for i, _ in pairs}, {j for _, j in pairs})
        return all(
            place in same or frequency > self.f_max
            for point, same in zip((left, right), kept, strict=True)
            for place, frequency in enumerate(point.frequencies)
        )

    def _in_one_phase(
        self, left: Swinging, right: Swinging, orders: Sequence[float]
    ) -> tuple[list[Meeting], Swinging | None]:
        """The meetings of an interval, and a point within it where the modes are others after all."""
        found, stranger = list[Meeting](), None
        count = min(len(left.rates), len(right.rates))
        for order in orders:
            low, high = left.above(order)[:count], right.above(order)[:count]
            found += [Meeting(left.speed, left, order, int(rank)) for rank in np.flatnonzero(low == 0)]
            for rank in np.flatnonzero(low * high < 0).tolist():
                at = self._refined(left, right, order, rank)
                if not _goes_on(left, at, rank):
                    stranger = at
                elif abs(at.above(order)[rank]) <= MET * at.frequencies[rank]:
                    found.append(Meeting(at.speed, at, order, rank))
        return found, stranger

    def _refined(self, left: Swinging, right: Swinging, order: float, rank: int) -> Swinging:
        """Where the mode of a rank meets an order, by the Illinois algorithm; sooner where the modes are others.

        By their rank all modes are continuous within a phase, also where two cross.
        """
        first, low, high = left, left.above(order)[rank], right.above(order)[rank]
        for _ in range(ITERATIONS):
            step = high * (right.speed - left.speed) / (high - low)
            before, at = right, self.at(float(right.speed - step))
            if not _goes_on(first, at, rank) or abs(at.speed - before.speed) <= REFINED * at.speed:
                break
            gap = at.above(order)[rank]
            if gap == 0:
                break
            left, low = (right, high) if gap * high < 0 else (left, low / 2)
            right, high = at, gap
        return at


def _goes_on(left: Swinging, at: Swinging, rank: int) -> bool:
    """Whether the mode of a rank is there at another point, in the same phase."""
    return at.phase == left.phase and rank < len(at.rates)


@dataclass
class Followed:
    """The modes of one phase, each followed from speed to speed.

    Args:
        phase: in words.
        rates: of each mode where it was seen last, 1/s.
        shapes: of each mode where it was seen last.
    """

    phase: str
    rates: list[complex] = field(default_factory=list)
    shapes: list[Complex] = field(default_factory=list)

    def places(self, point: Swinging) -> list[int]:
        """The number of each mode of a further point; what was not there before is a new one."""
        places = [-1] * len(point.rates)
        if self.rates:
            seen = np.array(self.rates), np.stack(self.shapes, axis=1)
            for i, j in same_modes(seen, (point.rates, point.shapes)):
                places[j] = i
        for j, place in enumerate(places):
            if place < 0:
                places[j] = len(self.rates)
                self.rates.append(0j)
                self.shapes.append(point.shapes[:, j])
            self.rates[places[j]], self.shapes[places[j]] = complex(point.rates[j]), point.shapes[:, j]
        return places


def numbered(points: Iterable[Swinging]) -> dict[float, list[int]]:
    """The number of each mode within its phase, counted from 0, by speed; points by ascending speed."""
    followed: dict[str, Followed] = {}
    return {point.speed: followed.setdefault(point.phase, Followed(point.phase)).places(point) for point in points}


def differing(phases: Sequence[str]) -> dict[str, str]:
    """What tells each of several phases from the others, in words: the parts that have one mode in all are left out."""
    split = [phase.split(BETWEEN) for phase in phases]
    if len({len(words) for words in split}) != 1:
        return dict(zip(phases, phases, strict=True))
    kept = [k for k, words in enumerate(zip(*split, strict=True)) if len(set(words)) > 1]
    return {phase: BETWEEN.join(words[k] for k in kept) for phase, words in zip(phases, split, strict=True)}


def _of_length_one(vectors: Complex) -> Complex:
    lengths = np.linalg.norm(vectors, axis=0)
    return np.asarray(vectors / np.where(lengths > 0, lengths, 1.0))
