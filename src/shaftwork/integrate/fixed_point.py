"""Exponentials of rational matrices in whole numbers with a fixed point: right to any number of digits.

Rates of a network may lie so far apart that floats cannot hold them in one matrix: of 5e-5 1/s no digit is left beside
1e11 1/s. Python's whole numbers have as many digits as it takes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from shaftwork.integrate.problem import Array

# The exponential of a matrix of this norm has a series of few terms; those of longer times are its squares.
UNIT = 2.0**-24
# Digits after the point besides those that the squares lose, and the largest power of two that a motion may reach.
DIGITS, LARGEST = 192, 1023
# So many of the last digits are rounding: a series ends where its terms have no others.
ROUNDED = 48
Integers = Any
"""An array of Python's whole numbers."""


class FixedPoint:
    """exp(M t) for a matrix M, as products of exp(M u), exp(2 M u), exp(4 M u), ... with a short unit of time u.

    Args:
        matrix: M (m, m), full array of fractions, 1/s.
        length: the longest time, s.

    Source: scaling and squaring, with the squares kept: Moler and Van Loan, Nineteen dubious ways, 2003, section 3.
    """

    def __init__(self, matrix: Any, length: float) -> None:
        self._matrix = matrix
        norm = max((math.fsum(abs(float(entry)) for entry in row if entry) for row in matrix), default=0.0)
        unit = UNIT / norm if norm > 0 else length
        self._unit = Fraction(2) ** math.floor(math.log2(min(unit, length)))
        self.squares = math.ceil(math.log2(length / float(self._unit))) + 1
        self.bits = DIGITS + 2 * self.squares
        self._powers: list[Integers] = []

    def whole(self, values: Any) -> Integers:
        """Floats or fractions as numbers of this point."""
        one = 1 << self.bits
        found = np.empty(np.shape(values), dtype=object)
        found.ravel()[:] = [round(Fraction(value) * one) if value else 0 for value in np.ravel(values).tolist()]
        return found

    def floats(self, block: Integers) -> Array:
        """Numbers of this point as the nearest floats; infinite where one is too large."""
        one = 1 << self.bits
        found = np.empty(block.shape)
        found.ravel()[:] = [_quotient(value, one) for value in block.ravel().tolist()]
        return found

    def advance(self, block: Integers, times: list[Fraction]) -> Integers:
        """The columns (m, k) of a block, each moved by its own time in s.

        Raises:
            OverflowError: the motion is unbounded.
        """
        counts, rests = zip(*(divmod(time, self._unit) for time in times), strict=True)
        block = block.copy()
        for place in range(max(count.bit_length() for count in counts)):
            chosen = [k for k, count in enumerate(counts) if count >> place & 1]
            if chosen:
                block[:, chosen] = self._power(place) @ block[:, chosen] >> self.bits
        return self.nudge(block, rests)

    def is_short(self, time: Fraction) -> bool:
        """Whether the norm of M t is at most 1."""
        return time <= self._unit / Fraction(UNIT)

    def nudge(self, block: Integers, times: Sequence[Fraction]) -> Integers:
        """The columns (m, k) of a block, each moved by its own short time in s, forward or back, by a Taylor series."""
        rate, shares = self.whole(self._matrix * self._unit), self.whole([time / self._unit for time in times])
        total = term = block
        order = 0
        while (abs(term) >> ROUNDED).any():
            order += 1
            term = ((rate @ term >> self.bits) * shares >> self.bits) // order
            total = total + term
        return total

    def _power(self, place: int) -> Integers:
        """exp(2^place M u)."""
        if not self._powers:
            one = self.whole(np.eye(len(self._matrix)))
            self._powers.append(self.nudge(one, [self._unit] * len(one)))
        while len(self._powers) <= place:
            square = self._powers[-1] @ self._powers[-1] >> self.bits
            if max(abs(square.max()), abs(square.min())) >> (self.bits + LARGEST):
                raise OverflowError("the motion is unbounded")
            self._powers.append(square)
        return self._powers[place]


def _quotient(value: int, one: int) -> float:
    try:
        return value / one
    except OverflowError:
        return math.copysign(math.inf, value)
