"""Speeds at which a shaft may not stay: where its stress is above the permitted one, and what must be barred."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from shaftwork.numerics.tolerances import TYPED
from shaftwork.results.observer import RPM, Array
from shaftwork.torsional.shaft_sections import MPA, TRANSIENT


@dataclass(frozen=True)
class BarredRange:
    """Speeds at which a shaft may not run for long.

    Law: 16 n_c / (18 - r) to (18 - r) n_c / 16 about each critical speed n_c, r = n_c over the rated speed; and all
    speeds between at which the stress is above the permitted one.

    Args:
        start: rad/s, of the reference shaft.
        end: rad/s.
        exceeded: from and to which speed in rad/s the stress itself is above tau_c; a pair for each such interval.
        critical: the speeds in rad/s of the peaks within, among those of the calculation.
        stress: the largest, Pa.
        share: the largest of stress over tau_t, what is permitted while the range is passed; above 1 it must not be.
        allowed: whether the rules allow to bar it: all below 0.8 of the rated speed, and `share` at most 1.
    """

    start: float
    end: float
    exceeded: tuple[tuple[float, float], ...]
    critical: tuple[float, ...]
    stress: float
    share: float
    allowed: bool

    def __str__(self) -> str:
        about = ", ".join(f"{speed * RPM:.5g}" for speed in self.critical)
        why = "above tau_t" if self.share > 1 else f"up to {TRANSIENT:g} of the rated speed or more"
        verdict = "to be barred and passed quickly" if self.allowed else f"NOT permitted, as it is {why}"
        size = f"{self.stress / MPA:.4g} N/mm^2, {100 * self.share:.4g} % of tau_t"
        return (
            f"{self.start * RPM:.5g} to {self.end * RPM:.5g} 1/min (critical {about}): {verdict}, "
            f"{size if np.isfinite(self.stress) else 'without bound'}"
        )


def barred_ranges(
    speeds: Array, stress: Array, limits: tuple[Array, Array], above: Callable[[float], float], rated: float
) -> tuple[BarredRange, ...]:
    """The ranges of a shaft, from the lowest speed on.

    Args:
        speeds: (n,) rad/s, ascending, close enough that no peak lies between two of them.
        stress: (n,) amplitudes, Pa.
        limits: tau_c and tau_t there, each (n,), Pa.
        above: by how much the stress is above tau_c at any speed, Pa.
        rated: speed, rad/s.
    """
    lasting, passing = limits
    exceeding = stress > lasting
    ranges = []
    for first, last in _runs(exceeding):
        start, end = _crossing(speeds, first - 1, above), _crossing(speeds, last, above)
        inside = np.arange(first, last + 1, dtype=np.intp)
        critical = speeds[inside[_is_peak(stress, inside)]]
        ratio = critical / rated
        low = min([start, *(16 * critical / (18 - ratio)).tolist()])
        high = max([end, *((18 - ratio) * critical / 16).tolist()])
        share = float((stress[inside] / passing[inside]).max())
        ranges.append(
            BarredRange(
                low, high, ((start, end),), tuple(critical.tolist()), float(stress[inside].max()), share, allowed=True
            )
        )
    return tuple(_judged(one, rated) for one in _merged(ranges))


def exceeded_spans(
    speeds: Array, values: Array, limits: Array, above: Callable[[float], float]
) -> tuple[tuple[float, float], ...]:
    """From and to which speed in rad/s values are above their limits; arguments as of `barred_ranges`."""
    return tuple(
        (_crossing(speeds, first - 1, above), _crossing(speeds, last, above)) for first, last in _runs(values > limits)
    )


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last place of each row of places that are true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return [(int(first), int(end) - 1) for first, end in zip(edges[::2], edges[1::2], strict=True)]


def _crossing(speeds: Array, place: int, above: Callable[[float], float]) -> float:
    """Where the stress passes its limit between a place and the next; the end of the speeds where it does not."""
    if place < 0:
        return float(speeds[0])
    if place + 1 >= len(speeds):
        return float(speeds[-1])
    low, high = float(speeds[place]), float(speeds[place + 1])
    ends = above(low), above(high)
    if not np.isfinite(ends).all() or ends[0] * ends[1] >= 0:  # a limit that jumps, or a stress without bound
        return low if ends[0] > 0 else high
    return float(brentq(above, low, high, rtol=TYPED))


def _is_peak(stress: Array, places: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Which places are no lower than both neighbours."""
    padded = np.concatenate([[-np.inf], stress, [-np.inf]])
    return np.asarray((padded[places + 1] >= padded[places]) & (padded[places + 1] >= padded[places + 2]))


def _merged(ranges: Sequence[BarredRange]) -> list[BarredRange]:
    """Ranges that overlap, as one."""
    merged: list[BarredRange] = []
    for one in sorted(ranges, key=lambda each: each.start):
        while merged and one.start <= merged[-1].end:
            last = merged.pop()
            one = BarredRange(  # noqa: PLW2901 (the joined range)
                min(last.start, one.start),
                max(last.end, one.end),
                (*last.exceeded, *one.exceeded),
                (*last.critical, *one.critical),
                max(last.stress, one.stress),
                max(last.share, one.share),
                allowed=True,
            )
        merged.append(one)
    return merged


def _judged(one: BarredRange, rated: float) -> BarredRange:
    allowed = one.end < TRANSIENT * rated and one.share <= 1
    return BarredRange(one.start, one.end, one.exceeded, one.critical, one.stress, one.share, allowed)


def overlapping(ranges: Sequence[BarredRange]) -> tuple[tuple[float, float], ...]:
    """The speeds that ranges of several shafts bar together: (start, end) in rad/s, ascending."""
    joined: list[tuple[float, float]] = []
    for start, end in sorted((one.start, one.end) for one in ranges):
        if joined and start <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(joined[-1][1], end))
        else:
            joined.append((start, end))
    return tuple(joined)
