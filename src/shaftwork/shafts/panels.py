"""Panels of a common step in time, and collocation on them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import legendre

from shaftwork.numerics.polynomials import radau_nodes, to_integrals, to_legendre
from shaftwork.shafts.line import Array


@dataclass(frozen=True)
class Basis:
    """Collocation at the Radau points of [0, 1], the end included.

    Args:
        nodes: the points, shape (q,).
        integrals: from 0 to each node, of the polynomial with given values at the nodes, shape (q, q).
        derivatives: the inverse of `integrals`, for polynomials that are 0 at the start.
        coefficients: values at the nodes to Legendre coefficients, shape (q, q).
        halves: values at the nodes to values at the nodes of the first and the second half, shape (q, q) each.
    """

    nodes: Array
    integrals: Array
    derivatives: Array
    coefficients: Array
    halves: tuple[Array, Array]


@cache
def radau_basis(order: int) -> Basis:
    """Collocation at so many Radau points."""
    points = radau_nodes(order)
    coefficients, integrals = to_legendre(points), to_integrals(points) / 2
    first, second = (legendre.legvander((points + shift) / 2, order - 1) @ coefficients for shift in (-1, 1))
    return Basis((points + 1) / 2, integrals, np.asarray(np.linalg.inv(integrals)), coefficients, (first, second))


@dataclass(frozen=True)
class Period:
    """One common step: values at the nodes of its P panels.

    Args:
        edges: ends of the panels within the period in s, shape (P + 1,).
        rightward: waves that leave the left ends of the sections, shape (P, n, q).
        leftward: waves that leave the right ends, shape (P, n, q).
        speeds: of the junctions, shape (P, n + 1, q).
    """

    edges: Array
    rightward: Array
    leftward: Array
    speeds: Array

    def halved(self, chosen: Array, halves: tuple[Array, Array]) -> Period:
        """The same period with the chosen panels cut into two, its polynomials unchanged."""
        middles = (self.edges[:-1] + np.diff(self.edges) / 2)[chosen]
        count = np.where(chosen, 2, 1)
        first = np.cumsum(count) - count

        def cut(values: Array) -> Array:
            new = np.repeat(values, count, axis=0)
            for half, matrix in enumerate(halves):
                new[first[chosen] + half] = values[chosen] @ matrix.T
            return new

        edges = np.sort(np.concatenate([self.edges, middles]))
        return Period(edges, cut(self.rightward), cut(self.leftward), cut(self.speeds))
