"""Linear systems with gamma - J for complex gamma and a sparse J, in linear time where J is a chain."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import lapack
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import splu

Complex = NDArray[np.complex128]
Solver = Callable[[Complex], Complex]


class ShiftedMatrix:
    """gamma - J for one sparse J after another and any shifts gamma.

    States that only integrate others (the torque of a spring, an angle) are eliminated: with J = [[A, B], [C, 0]] what
    is left is gamma - A - B C / gamma. Of a chain of springs this is a tridiagonal matrix of the speeds alone, in the
    order of Cuthill and McKee, and LAPACK takes a third of the time of SuperLU, which has all other matrices.

    Args:
        matrix: J, scipy.sparse (n, n).
    """

    def __init__(self, matrix: Any) -> None:
        self._pattern: tuple[Any, Any] | None = None
        self.load(matrix)

    def load(self, matrix: Any) -> None:
        """Take another J (n, n) for the shifts to come."""
        matrix = sparse.csr_array(matrix)
        pattern = matrix.indptr, matrix.indices
        if self._pattern is None or not all(map(np.array_equal, self._pattern, pattern)):
            gone = _integrators(matrix)
            self._pattern, self._rest, self._gone = pattern, np.flatnonzero(~gone), np.flatnonzero(gone)
            direct, through = self._reduced(abs(matrix))
            self._rest = self._rest[reverse_cuthill_mckee(sparse.csr_array(direct + through), symmetric_mode=False)]
        direct, through = self._reduced(matrix)
        both = sparse.coo_array(abs(direct) + abs(through))
        tridiagonal = both.shape[0] > 2 and bool((abs(both.row - both.col) <= 1).all())  # LAPACK's wrapper wants three
        self._inner = (_tridiagonal if tridiagonal else _sparse)(direct, through)

    def _reduced(self, matrix: Any) -> tuple[Any, Any]:
        """A and B C of a matrix J = [[A, B], [C, 0]]."""
        upper, lower = matrix[self._rest], matrix[self._gone]
        B, C = upper[:, self._gone], lower[:, self._rest]
        # products with complex vectors would convert them each time
        self._B, self._C = B.astype(complex), C.astype(complex)
        return upper[:, self._rest], B @ C

    def factor(self, shift: complex) -> Solver:
        """Factorise shift - J; the solver takes and gives complex (n,).

        Raises:
            LinAlgError: the matrix is singular.
        """
        inverse, rest, gone, B, C = 1 / shift, self._rest, self._gone, self._B, self._C
        inner = self._inner(shift)

        def solve(right: Complex) -> Complex:
            second = right[gone]
            solution = np.empty_like(right)
            remaining = solution[rest] = inner(right[rest] + inverse * (B @ second))
            solution[gone] = inverse * (second + C @ remaining)
            return solution

        return solve


def _integrators(matrix: Any) -> Any:
    """States (n,) without an entry of their own that do not read each other, those of few neighbours first."""
    pattern = sparse.csr_array((np.ones(matrix.nnz), matrix.indices, matrix.indptr), shape=matrix.shape)
    both = sparse.csr_array(pattern + pattern.T)
    neighbours = np.diff(both.indptr)
    few = (neighbours > 0) & (neighbours <= 4)  # elimination joins all of them: a hub of many arms is left in
    candidates = np.flatnonzero((both.diagonal() == 0) & few)
    starts, indices = both.indptr.tolist(), both.indices.tolist()
    chosen = [False] * both.shape[0]
    for state in candidates[np.argsort(neighbours[candidates], kind="stable")].tolist():
        chosen[state] = not any(chosen[other] for other in indices[starts[state] : starts[state + 1]])
    return np.array(chosen, dtype=bool)


def _tridiagonal(direct: Any, through: Any) -> Callable[[complex], Solver]:
    """Solvers of shift - direct - through / shift, where both are tridiagonal."""
    diagonals = [(direct.diagonal(place), through.diagonal(place)) for place in (-1, 0, 1)]

    def solver(shift: complex) -> Solver:
        below, diagonal, above = (-own - other / shift for own, other in diagonals)
        *factors, info = lapack.zgttrf(below, diagonal + shift, above)
        if info:
            raise np.linalg.LinAlgError(f"the shifted matrix is singular in its row {info}")
        return lambda right: np.asarray(lapack.zgttrs(*factors, right)[0])

    return solver


def _sparse(direct: Any, through: Any) -> Callable[[complex], Solver]:
    """Solvers of shift - direct - through / shift."""
    parts, diagonal = (sparse.coo_array(direct), sparse.coo_array(through)), np.arange(direct.shape[0])
    # Real parts of one, imaginary parts of the other, and room for the shift: one pattern for all shifts.
    values = np.concatenate([parts[0].data, 1j * parts[1].data, np.zeros(diagonal.size)])
    rows = np.concatenate([*(part.row for part in parts), diagonal])
    columns = np.concatenate([*(part.col for part in parts), diagonal])
    both = sparse.csc_matrix((values, (rows, columns)), shape=direct.shape)
    on_diagonal = both.indices == np.repeat(diagonal, np.diff(both.indptr))

    def solver(shift: complex) -> Solver:
        left = both.copy()
        left.data = -both.data.real - both.data.imag / shift
        left.data[on_diagonal] += shift
        try:
            solve: Solver = splu(left).solve
        except RuntimeError as error:
            raise np.linalg.LinAlgError(str(error)) from error
        return solve

    return solver
