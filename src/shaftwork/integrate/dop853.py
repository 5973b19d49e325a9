"""Dormand and Prince's explicit method of order 8, with the tables of scipy and the same control of its steps.

Steps, errors and the inside of a step are those of `scipy.integrate.DOP853`. Its own loops take some ten times as long
as the right-hand side of a small network, and most phases between two events are a few steps long.

Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, sections II.4, II.5 and II.10.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.integrate import DOP853

from shaftwork.integrate.inner import StepPolynomial
from shaftwork.integrate.problem import Array

SAFETY, SHRINKS, GROWS = 0.9, 0.2, 10.0
"""Of the step that the error allows, and the least and largest factor from one step to the next."""
EXPONENT = -1 / 8
TOO_SMALL = "Required step size is less than spacing between numbers."

Table = tuple[tuple[int, float, Array], ...]
"""Of each stage its number, its part of the step, and what it takes of the stages before it."""


def _table(parts: Array, rows: Array, first: int) -> Table:
    numbers = range(first, first + len(parts))
    return tuple((s, float(c), np.array(row[:s])) for s, c, row in zip(numbers, parts, rows, strict=True))


STAGES = _table(DOP853.C[1:], DOP853.A[1:], 1)
INNER = _table(DOP853.C_EXTRA, DOP853.A_EXTRA, DOP853.n_stages + 1)
LAST = DOP853.n_stages


class Dop853:
    """Steps from a time to another one; `t` and `y` are where it is.

    Args:
        rhs: right-hand side.
        t: start, s.
        y: (n,) state there.
        end: s.
        rtol: relative tolerance.
        atol: (n,) absolute tolerances.
        longest: no step is longer, s.
    """

    njev = 0

    def __init__(
        self,
        rhs: Callable[[float, Array], Array],
        t: float,
        y: Array,
        end: float,
        rtol: float,
        atol: Array,
        longest: float,
    ) -> None:
        self._rhs, self._end, self._rtol, self._atol, self._longest = rhs, end, rtol, atol, longest
        self.t, self.y, self._old = t, y, (t, y)
        self._K = np.empty((LAST + 1 + len(INNER), y.size))
        self._K[LAST] = rhs(t, y)
        self.nfev = 1
        self._length = self._first_step()

    @property
    def finished(self) -> bool:
        """Whether it has come to the end."""
        return self.t >= self._end

    def _first_step(self) -> float:
        """The length of the first step, s; NaN where a value is.

        Source: as above, section II.4.
        """
        t, y, rate, span = self.t, self.y, self._K[LAST], self._end - self.t
        scale = self._atol + np.abs(y) * self._rtol
        d0, d1 = _mean(y / scale), _mean(rate / scale)
        short = min(1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1, span)
        if not short > 0:
            return short
        self.nfev += 1
        d2 = _mean((self._rhs(t + short, y + short * rate) - rate) / scale) / short
        most = max(d1, d2)
        long = max(1e-6, short * 1e-3) if most <= 1e-15 else (0.01 / most) ** -EXPONENT
        return min(100 * short, long, span, self._longest)

    def step(self) -> str:
        """Take one step; says why where there is none."""
        K, rhs, t, y = self._K, self._rhs, self.t, self.y
        K[0] = K[LAST]
        least, rejected = 10 * math.ulp(t), False
        if math.isnan(self._length):
            return "no first step was found"
        self._length = max(min(self._length, self._longest), least)
        while True:
            if not self._length >= least:
                return TOO_SMALL
            end = min(t + self._length, self._end)
            h = end - t
            for s, c, row in STAGES:
                K[s] = rhs(t + c * h, y + h * row.dot(K[:s]))
            new = y + h * DOP853.B.dot(K[:LAST])
            K[LAST] = rhs(end, new)
            self.nfev += LAST
            error = self._error(h, y, new)
            if error < 1:
                factor = min(GROWS, SAFETY * error**EXPONENT) if error else GROWS
                self._old, self.t, self.y = (t, y), end, new
                self._length = h * (min(1.0, factor) if rejected else factor)
                return ""
            self._length = h * max(SHRINKS, SAFETY * error**EXPONENT)
            rejected = True

    def _error(self, h: float, y: Array, new: Array) -> float:
        """The error of a step by its tolerance."""
        scale, K = self._atol + np.maximum(np.abs(y), np.abs(new)) * self._rtol, self._K[: LAST + 1]
        fifth, third = DOP853.E5.dot(K) / scale, DOP853.E3.dot(K) / scale
        square = float(fifth.dot(fifth))
        both = square + 0.01 * float(third.dot(third))
        return h * square / math.sqrt(both * scale.size) if both else 0.0

    def inside(self) -> StepPolynomial:
        """The states inside the last step."""
        (t, y), K, rhs = self._old, self._K, self._rhs
        h, change = self.t - t, self.y - y
        for s, c, row in INNER:
            K[s] = rhs(t + c * h, y + h * row.dot(K[:s]))
        self.nfev += len(INNER)
        terms = np.empty((3 + len(DOP853.D), y.size))
        terms[0], terms[1] = change, h * K[0] - change
        terms[2], terms[3:] = 2 * change - h * (K[LAST] + K[0]), h * DOP853.D.dot(K)
        return StepPolynomial(t, h, y, terms, alternates=True)


def _mean(values: Array) -> float:
    """The root mean square; zero of nothing."""
    return math.sqrt(float(values.dot(values)) / values.size) if values.size else 0.0
