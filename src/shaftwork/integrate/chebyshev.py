"""Polynomials through their values at Chebyshev points: what a method knows of the inside of its step."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from shaftwork.integrate.problem import Array


@lru_cache(maxsize=16)
def points(degree: int) -> Array:
    """(degree + 1,) Chebyshev points of [0, 1] with both ends: interpolation there is exact and well conditioned."""
    made = (1 - np.cos(np.pi * np.arange(degree + 1) / degree)) / 2
    made.flags.writeable = False
    return made


@dataclass(frozen=True)
class Polynomial:
    """The states of one step by the barycentric formula.

    Args:
        start: of the step, s.
        end: of the step, s.
        nodes: (degree + 1, n) states at its Chebyshev points.

    Source: Berrut and Trefethen, Barycentric Lagrange interpolation, 2004, equations (4.2) and (5.4).
    """

    start: float
    end: float
    nodes: Array

    def __call__(self, times: Array) -> Array:
        """States (k, n) at times (k,)."""
        apart = ((times - self.start) / (self.end - self.start))[:, None] - points(len(self.nodes) - 1)
        shares = (-1.0) ** np.arange(len(self.nodes)) / np.where(apart == 0.0, 1.0, apart)
        shares[:, [0, -1]] /= 2
        rows, columns = np.nonzero(apart == 0.0)
        shares[rows] = 0.0
        shares[rows, columns] = 1.0
        return np.asarray(shares @ self.nodes / shares.sum(axis=1)[:, None])
