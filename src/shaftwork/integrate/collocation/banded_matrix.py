"""Linear systems with gamma - J for complex gamma and a sparse J, in about linear time where J is a chain."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import lapack
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import splu

from shaftwork.integrate.collocation.banded_method import Complex
from shaftwork.integrate.problem import Array

Indices = NDArray[np.intp]
Places = NDArray[np.int64]
Solver = Callable[[Complex], Complex]

# LAPACK's band solver up to this sum of the bandwidths, SuperLU beyond. For 10000 unknowns SuperLU takes 5 ms whatever
# the bandwidth of a sparse matrix, the band solver 0.8 ms at 2, 2.7 ms at 16 and 4.2 ms at 32.
WIDEST_BAND = 32
# Elimination joins the neighbours of a state to each other; a hub of many arms is left in.
MOST_NEIGHBOURS = 4


class ShiftedMatrix:
    """gamma - J for one sparse J after another and any shifts gamma.

    States that only integrate others (the torque of a spring, an angle) are eliminated: with J = [[A, B], [C, 0]] what
    is left is gamma - A - B C / gamma, for a chain of springs a tridiagonal matrix of the speeds alone. It is ordered
    for a small bandwidth.

    Source: Cuthill and McKee, Reducing the bandwidth of sparse symmetric matrices, 1969.

    Args:
        matrix: J, scipy.sparse (n, n).
    """

    def __init__(self, matrix: Any) -> None:
        matrix = sparse.csc_array(matrix)
        self._size = matrix.shape[0]
        self._places: Places = np.empty(0, dtype=np.int64)
        self._learn(matrix)
        self.load(matrix)

    @property
    def bandwidth(self) -> int:
        """Sum of the lower and upper bandwidth of what is factorised."""
        return self._lower + self._upper

    @property
    def is_narrow(self) -> bool:
        """Whether LAPACK's band solver is used: the system is a chain, or a few of them beside each other."""
        return self.bandwidth <= WIDEST_BAND

    def load(self, matrix: Any) -> None:
        """Take another J (n, n) for the shifts to come. Places that were occupied once are kept."""
        matrix = sparse.csc_array(matrix)
        indices, starts = self._pattern
        if not (np.array_equal(indices, matrix.indices) and np.array_equal(starts, matrix.indptr)):
            self._learn(matrix)
        entries = matrix.tocoo()
        parts = self._split(entries.row, entries.col, entries.data)
        self._direct, self._through = (self._stored(part) for part in parts)

    def _learn(self, matrix: Any) -> None:
        """Make room for the places of a matrix."""
        self._pattern = matrix.indices.copy(), matrix.indptr.copy()
        entries = matrix.tocoo()
        places = np.union1d(self._places, _flat(entries.row, entries.col, self._size))
        if self._places.size == 0 or places.size > self._places.size:
            self._places = places
            self._arrange()

    def factor(self, shift: complex) -> Solver:
        """Factorise shift - J; the solver takes and gives complex (n,).

        Raises:
            LinAlgError: the matrix is singular.
        """
        inverse = 1 / shift
        values = self._through * -inverse
        values -= self._direct
        values[self._diagonal] += shift
        inner = self._inner(values)
        rest, gone, B, C = self._rest, self._gone, self._B, self._C

        def solve(right: Complex) -> Complex:
            second = right[gone]
            solution = np.empty_like(right)
            remaining = inner(right[rest] + inverse * _times(B, second))
            solution[rest] = remaining
            solution[gone] = inverse * (second + _times(C, remaining))
            return solution

        return solve

    def _arrange(self) -> None:
        """Choose what is eliminated, the order of the rest, and where its entries are stored."""
        columns, rows = np.divmod(self._places, self._size)
        pattern = sparse.csr_array((np.ones(rows.size), (rows, columns)), shape=(self._size, self._size))
        gone = _integrators(pattern)
        self._order(np.flatnonzero(~gone), np.flatnonzero(gone))
        self._order(np.flatnonzero(~gone)[_narrow(self._left(rows, columns))], np.flatnonzero(gone))
        left = sparse.coo_array(self._left(rows, columns))
        self._lower = int((left.row - left.col).max(initial=0))
        self._upper = int((left.col - left.row).max(initial=0))
        self._cells = np.sort(_flat(left.row, left.col, self._count))
        diagonal = np.arange(self._count)
        self._diagonal = self._place(diagonal, diagonal)

    def _order(self, rest: Indices, gone: Indices) -> None:
        order = np.concatenate([rest, gone])
        self._count, self._rank = rest.size, np.argsort(order)
        in_order = np.array_equal(order, np.arange(order.size))
        # A slice is read without a copy.
        self._rest: Any = slice(0, rest.size) if in_order else rest
        self._gone: Any = slice(rest.size, None) if in_order else gone

    def _split(self, rows: Indices, columns: Indices, values: Array) -> tuple[Any, Any]:
        """A and B C of the entries of J; B and C are kept."""
        k, shape = self._count, (self._size, self._size)
        matrix = sparse.csr_array((values, (self._rank[rows], self._rank[columns])), shape=shape)
        self._B, self._C = matrix[:k, k:], matrix[k:, :k]
        return matrix[:k, :k], self._B @ self._C

    def _left(self, rows: Indices, columns: Indices) -> Any:
        """The pattern of what is left when states are eliminated."""
        return sum(self._split(rows, columns, np.ones(rows.size)), sparse.eye_array(self._count, format="csr"))

    def _place(self, rows: Indices, columns: Indices) -> Places:
        """Where entries are stored: in LAPACK's band, which has room for the fill, or column after column."""
        if self.is_narrow:
            return _flat(self._lower + self._upper + rows - columns, columns, 2 * self._lower + self._upper + 1)
        return np.searchsorted(self._cells, _flat(rows, columns, self._count))

    def _stored(self, part: Any) -> Array:
        entries = sparse.coo_array(part)
        room = (2 * self._lower + self._upper + 1) * self._count if self.is_narrow else self._cells.size
        values = np.zeros(room)
        values[self._place(entries.row, entries.col)] = entries.data
        return values

    def _inner(self, values: Any) -> Solver:
        size, lower, upper = self._count, self._lower, self._upper
        if not self.is_narrow:
            return _sparse(values, *np.divmod(self._cells, size), size)
        band = values.reshape(-1, size, order="F")
        if lower == upper == 1 and size > 2:  # scipy's wrapper wants a second diagonal above
            *tridiagonal, info = lapack.zgttrf(band[3, :-1], band[2], band[1, 1:])
            _check(info)
            return lambda right: np.asarray(lapack.zgttrs(*tridiagonal, right)[0])
        factors, pivots, info = lapack.zgbtrf(band, lower, upper, overwrite_ab=True)
        _check(info)
        return lambda right: np.asarray(lapack.zgbtrs(factors, lower, upper, right, pivots)[0])


def _sparse(values: Complex, columns: Places, rows: Places, size: int) -> Solver:
    try:
        solve: Solver = splu(sparse.csc_matrix((values, (rows, columns)), shape=(size, size))).solve
    except RuntimeError as error:
        raise np.linalg.LinAlgError(str(error)) from error
    return solve


def _check(info: int) -> None:
    if info:
        raise np.linalg.LinAlgError(f"the shifted matrix is singular in its row {info}")


def _flat(rows: Indices, columns: Indices, height: int) -> Places:
    """Places of entries column after column."""
    return columns.astype(np.int64) * height + rows


def _times(matrix: Any, vector: Complex) -> Complex:
    """A real sparse matrix times a complex vector, as two real columns."""
    return np.asarray(matrix @ vector.view(float).reshape(-1, 2)).view(complex)[:, 0]


def _integrators(pattern: Any) -> NDArray[np.bool_]:
    """States (n,) without an entry of their own that do not read each other, those of few neighbours first."""
    both = sparse.csr_array(pattern + pattern.T)
    neighbours = np.diff(both.indptr)
    candidates = np.flatnonzero((both.diagonal() == 0) & (neighbours > 0) & (neighbours <= MOST_NEIGHBOURS))
    starts, indices = both.indptr.tolist(), both.indices.tolist()
    chosen = [False] * both.shape[0]
    for state in candidates[np.argsort(neighbours[candidates], kind="stable")].tolist():
        chosen[state] = not any(chosen[other] for other in indices[starts[state] : starts[state + 1]])
    return np.array(chosen, dtype=bool)


def _narrow(pattern: Any) -> Indices:
    """The order (n,) that gives a small bandwidth: that of Cuthill and McKee, or the order as it is."""
    order = np.asarray(reverse_cuthill_mckee(sparse.csr_array(pattern), symmetric_mode=False), dtype=np.intp)
    rank = np.argsort(order)
    entries = sparse.coo_array(pattern)
    ordered = np.abs(rank[entries.row] - rank[entries.col]).max(initial=0)
    return order if ordered < np.abs(entries.row - entries.col).max(initial=0) else np.arange(order.size)
