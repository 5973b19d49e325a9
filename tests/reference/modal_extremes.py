"""The largest value of a sum of damped oscillations: by its modes, bracketed by a bound of its second derivative.

Nothing of the library is used: the chain is assembled from its masses, stiffnesses and dampings, and solved by its
eigenvalues. Between two times h apart no value is larger than the larger of their values plus h^2 / 8 times the largest
second derivative between them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

STATED = 1e-12
"""Of the largest value: so well a maximum is known at the end."""
MOST_INTERVALS = 5_000_000


@dataclass(frozen=True)
class Oscillations:
    """y = level + Re sum of weights * exp(rates * t).

    Args:
        rates: (k,) 1/s.
        weights: (k,).
        level: what does not change.
    """

    rates: Complex
    weights: Complex
    level: float

    def __call__(self, t: Array) -> Array:
        return self.level + self._summed(t, self.rates, self.weights)

    @staticmethod
    def _summed(t: Array, rates: Complex, weights: Complex) -> Array:
        rows = max(1, 4_000_000 // len(rates))
        blocks = (t[first : first + rows] for first in range(0, len(t), rows))
        return np.concatenate([(np.exp(np.multiply.outer(block, rates)) @ weights).real for block in blocks])

    @property
    def rounding(self) -> float:
        """How far rounding may move a value: modes and level are larger than what is left of them at the start.

        Their rates and shapes are rounded too: a speed of 1.6e-8 rad/s ahead of a wave was off by 1e-13 of the sum of
        its modes, where 50 digits agreed with the motion under test to 4e-11 of that speed.
        """
        return 1e-13 * float(abs(self.level) + np.abs(self.weights).sum())

    def bend(self, t: Array) -> Array:
        """A bound of the second derivative from each time (k,) on; no mode grows."""
        return self._summed(t, np.minimum(self.rates.real, 0.0) + 0j, np.abs(self.weights * self.rates**2) + 0j)

    def largest(self, t_end: float) -> tuple[float, float]:
        """Time and value of the maximum over [0, t_end]."""
        fast = float(np.abs(self.rates).max())
        count = int(np.clip(np.ceil(2.0 * fast * t_end), 64, 2_000_000))
        fading = t_end * np.geomspace(1e-12, 1.0, 400)  # what fades fast lies at the start
        edges = np.unique(np.concatenate([np.linspace(0.0, t_end, count + 1), fading]))
        values = self(edges)
        low, high, first, last = edges[:-1], edges[1:], values[:-1], values[1:]
        best, when = float(values.max()), float(edges[values.argmax()])
        size = float(np.ptp(values)) + abs(best)
        while True:
            above = np.maximum(first, last) + (high - low) ** 2 / 8 * self.bend(low)
            alive = (above > best + STATED * size) & (high - low > 4 * np.spacing(t_end))
            if not alive.any():
                return when, best
            low, high, first, last = low[alive], high[alive], first[alive], last[alive]
            middle = (low + high) / 2
            value = self(middle)
            if value.max() > best:
                best, when = float(value.max()), float(middle[value.argmax()])
            low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
            first, last = np.concatenate([first, value]), np.concatenate([value, last])
            if len(low) > MOST_INTERVALS:
                raise ValueError("too many intervals")


@dataclass(frozen=True)
class Chain:
    """Rotors in a row, with springs between neighbours, and dampers to the frame.

    Args:
        J: (n,) kg m^2.
        c: (n - 1,) N m/rad.
        d: (n - 1,) N m s/rad, beside the springs.
        b: (n,) N m s/rad, to the frame.
        torque: (n,) constant, N m.
        speeds: (n,) at the start, rad/s.
    """

    J: Array
    c: Array
    d: Array
    b: Array
    torque: Array
    speeds: Array

    def solution(self) -> tuple[Complex, Complex, Array]:
        """Rates (m,), vectors (2 n - 1, m) times their parts of the start, and levels (2 n - 1,).

        The states are speeds and torques in the springs, in the scale of energy, in which they exchange without loss.
        """
        n = len(self.J)
        apart = np.eye(n - 1, n) - np.eye(n - 1, n, 1)
        masses, springs = np.sqrt(self.J), np.sqrt(self.c)
        exchange = springs[:, None] * apart / masses
        losses = (apart.T * self.d) @ apart + np.diag(self.b)
        matrix = np.zeros((2 * n - 1, 2 * n - 1))
        matrix[:n, :n] = -losses / np.multiply.outer(masses, masses)
        matrix[:n, n:], matrix[n:, :n] = -exchange.T, exchange
        push = np.concatenate([self.torque / masses, np.zeros(n - 1)])
        start = np.concatenate([self.speeds * masses, np.zeros(n - 1)])
        level = np.linalg.solve(matrix, -push)
        rates, vectors = np.linalg.eig(matrix)
        if np.linalg.cond(vectors) > 1e5:
            raise ValueError("too badly conditioned to be a reference")
        parts = np.linalg.solve(vectors, (start - level).astype(complex))
        return rates, vectors * parts, level

    def speed(self, number: int) -> Oscillations:
        """Of a rotor, rad/s."""
        rates, modes, level = self.solution()
        scale = 1.0 / np.sqrt(self.J[number])
        return Oscillations(rates, scale * modes[number], float(scale * level[number]))

    def torque_between(self, number: int) -> Oscillations:
        """Of a spring and the damper beside it, that a rotor gives to the next, N m."""
        rates, modes, level = self.solution()
        n = len(self.J)
        first, second = (1.0 / np.sqrt(self.J[k]) for k in (number, number + 1))
        row = np.zeros(2 * n - 1)
        row[n + number] = np.sqrt(self.c[number])
        row[number], row[number + 1] = self.d[number] * first, -self.d[number] * second
        return Oscillations(rates, row @ modes, float(row @ level))
