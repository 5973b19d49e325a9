"""Polynomials through their values at nodes of [-1, 1], and what these values make of their slopes and integrals."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial import chebyshev, legendre
from numpy.polynomial.legendre import Legendre
from numpy.typing import NDArray

Array = NDArray[np.float64]


@lru_cache
def lobatto_rule(degree: int) -> tuple[Array, Array]:
    """Nodes and weights (degree + 1,) of the quadrature of Gauss and Lobatto, which reads both ends."""
    polynomial = Legendre.basis(degree)
    nodes = np.concatenate([[-1.0], _roots(polynomial.deriv()), [1.0]])
    nodes = (nodes - nodes[::-1]) / 2
    return nodes, 2 / (degree * (degree + 1) * polynomial(nodes) ** 2)


@lru_cache
def radau_nodes(count: int) -> Array:
    """(count,) nodes of Radau IIA, the last of them 1."""
    return np.append(_roots(Legendre.basis(count) - Legendre.basis(count - 1))[:-1], 1.0)


@lru_cache
def chebyshev_nodes(degree: int) -> Array:
    """(degree + 1,) Chebyshev points with both ends: interpolation there is exact and well conditioned."""
    return np.asarray(-np.cos(np.pi * np.arange(degree + 1) / degree))


def _roots(series: Legendre) -> Array:
    """Real roots, ascending: those of a series are good to some ten digits, Newton's method does the rest."""
    roots = series.roots().real
    for _ in range(2):
        roots = roots - series(roots) / series.deriv()(roots)
    return np.sort(roots)


def to_powers(nodes: Array) -> Array:
    """(s, s) coefficients of the powers, the lowest first, from values at nodes (s,)."""
    return np.asarray(np.linalg.inv(np.vander(nodes, increasing=True)), dtype=float)


def to_legendre(nodes: Array) -> Array:
    """(s, s) Legendre coefficients from values at nodes (s,)."""
    return np.asarray(np.linalg.inv(legendre.legvander(nodes, len(nodes) - 1)))


def to_chebyshev(nodes: Array) -> Array:
    """(s, s) Chebyshev coefficients from values at nodes (s,)."""
    return np.asarray(np.linalg.inv(chebyshev.chebvander(nodes, len(nodes) - 1)))


def legendre_integrals(coefficients: Array, ends: Array) -> Array:
    """(k, m) integrals from -1 to each of k ends, of m polynomials whose Legendre coefficients are columns."""
    primitive = legendre.legint(coefficients, lbnd=-1, axis=0)
    return np.asarray(legendre.legvander(ends, len(primitive) - 1) @ primitive)


def to_integrals(nodes: Array) -> Array:
    """(s, s) integrals from -1 to each node, from values at nodes (s,); half of it is the matrix of a collocation."""
    return legendre_integrals(np.eye(len(nodes)), nodes) @ to_legendre(nodes)


def to_slopes(nodes: Array, places: Array) -> Array:
    """(k, s) slopes at places (k,) from values at nodes (s,); those of a constant are zero to the last bit."""
    degree = len(nodes) - 1
    slopes = np.stack([Legendre.basis(k).deriv()(places) for k in range(degree + 1)], axis=1)
    matrix = np.linalg.solve(legendre.legvander(nodes, degree).T, slopes.T).T
    return np.asarray(matrix - matrix.sum(axis=1, keepdims=True) / (degree + 1))


def interpolation_times(start: float, end: float, degree: int) -> Array:
    """(degree + 1,) times in s of a span at which the values of an `Interpolant` are wanted."""
    return np.asarray(start + (end - start) * (1 + chebyshev_nodes(degree)) / 2)


@dataclass(frozen=True)
class Interpolant:
    """Functions of time by their values at the Chebyshev points of a span, with the barycentric formula.

    Args:
        start: of the span, s.
        end: of the span, s.
        values: (degree + 1, n) at its `interpolation_times`.

    Source: Berrut and Trefethen, Barycentric Lagrange interpolation, 2004, equations (4.2) and (5.4).
    """

    start: float
    end: float
    values: Array

    def __call__(self, times: Array) -> Array:
        """Values (k, n) at times (k,)."""
        shares = (1 + chebyshev_nodes(len(self.values) - 1)) / 2
        distances = ((times - self.start) / (self.end - self.start))[:, None] - shares
        weights = (-1.0) ** np.arange(len(self.values)) / np.where(distances == 0.0, 1.0, distances)
        weights[:, [0, -1]] /= 2
        rows, columns = np.nonzero(distances == 0.0)
        weights[rows] = 0.0
        weights[rows, columns] = 1.0
        return np.asarray(weights @ self.values / weights.sum(axis=1)[:, None])
