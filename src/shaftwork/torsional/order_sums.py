"""Sums of orders: how far a quantity swings over a whole cycle when each order is a complex amplitude."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from shaftwork.numerics.tolerances import TYPED
from shaftwork.results.observer import Array, Complex, blocks

POINTS = 64
"""Samples of a waveform over a swing of its highest order: between them it leaves its chords by (pi / 64)^2 / 2 of that
swing, 0.12 %, less than a line in a picture is wide, and Newton's method finds a peak from the nearest of them."""


def cycle_of(orders: Sequence[float], most: int = 120) -> int | None:
    """The turns after which orders begin again together; None where they have no such cycle of `most` turns or fewer.

    Teeth of 20 and 24 with half orders need 120. Orders that need more come into nearly every phase within a run.
    """
    turns = 1
    for order in orders:
        fraction = Fraction(order).limit_denominator(most)
        if abs(float(fraction) - order) > TYPED * order:
            return None
        turns = math.lcm(turns, fraction.denominator)
        if turns > most:
            return None
    return turns


def half_range(parts: Complex, orders: Sequence[float]) -> Array:
    """Half of peak to peak of sum_k Re(parts_k exp(i k phi)) over a cycle, for each row.

    Orders without a common cycle, as behind gears whose teeth have no common factor, come into every phase in the long
    run: the half ranges of groups that have a cycle each then add up.

    Args:
        parts: (n, k) complex amplitudes; a row with an infinite one has no bound.
        orders: (k,) per turn.

    Returns:
        (n,).
    """
    finite = np.isfinite(parts).all(axis=1)
    total = np.where(finite, 0.0, np.inf)
    for base, members in _groups(orders):
        total[finite] += _half_range(parts[finite][:, members], [orders[k] / base for k in members])
    return total


def waveform(parts: Complex, orders: Sequence[float], phi: Array) -> Array:
    """The sum over the orders at angles (m,) of the reference shaft: of rows (n, k) of amplitudes (n, m)."""
    return np.asarray((parts @ np.exp(1j * np.multiply.outer(np.asarray(orders), phi))).real)


def _groups(orders: Sequence[float]) -> list[tuple[float, list[int]]]:
    """Orders that have a common cycle, by their places, with the order whose turns it is counted in."""
    groups: list[tuple[float, list[int]]] = []
    for place, order in enumerate(orders):
        for base, members in groups:
            if cycle_of([orders[k] / base for k in (*members, place)]) is not None:
                members.append(place)
                break
        else:
            groups.append((1.0 if cycle_of([order]) is not None else order, [place]))
    return groups


def _half_range(parts: Complex, orders: Sequence[float]) -> Array:
    """The same for orders that have a common cycle: from samples of it, refined by Newton's method."""
    turns = cycle_of(orders) or 1
    harmonics = np.rint(np.asarray(orders) * turns).astype(np.intp)
    count = POINTS * int(harmonics.max())
    halves = np.empty(len(parts))
    for here in blocks(len(parts), 4 * count):
        spectrum = np.zeros((len(parts[here]), count // 2 + 1), dtype=complex)
        spectrum[:, harmonics] = parts[here] * (count / 2)
        samples = np.fft.irfft(spectrum, count, axis=1)
        halves[here] = (_highest(samples, parts[here], harmonics) + _highest(-samples, -parts[here], harmonics)) / 2
    return halves


def _highest(samples: Array, parts: Complex, harmonics: NDArray[np.intp]) -> Array:
    """(n,) the highest value of each row, of which equidistant samples (n, m) over a cycle are given."""
    most, steps = 4, 5  # nearly equal peaks of which each may be the highest; five steps double the digits to all
    rising = (samples >= np.roll(samples, 1, axis=1)) & (samples >= np.roll(samples, -1, axis=1))
    places = np.argsort(np.where(rising, -samples, np.inf), axis=1)[:, :most]
    step = 2 * np.pi / samples.shape[1]
    angle = start = places * step
    for _ in range(steps):
        turning = parts[:, None, :] * np.exp(1j * angle[:, :, None] * harmonics)
        slope, bend = (turning @ (1j * harmonics)).real, -(turning @ harmonics.astype(float) ** 2).real
        angle = np.clip(
            angle - np.where(bend < 0, slope / np.where(bend < 0, bend, 1.0), 0.0), start - step, start + step
        )
    refined = (parts[:, None, :] * np.exp(1j * angle[:, :, None] * harmonics)).real.sum(axis=2)
    return np.asarray(np.maximum(samples.max(axis=1), refined.max(axis=1)))
