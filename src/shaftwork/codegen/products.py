"""Products of one matrix with many vectors, one after another: as a full array where that is quicker than sparse.

BLAS fuses multiplication and addition, so that the difference of two equal terms is the rounding of one of them, and no
zero. Hence only who bears that takes full arrays, and what is read at many times stays sparse.
"""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np
from scipy import sparse

from shaftwork.codegen.elements import Array

FULL = 16_000
"""Multiplications up to which a full array is quicker: a product of scipy.sparse takes 5 us before it begins."""
FEW, MOST = 3, 32
"""The diagonals may hold so many times the entries of a matrix, and be so many; beyond that its rows are quicker."""


class Diagonals:
    """A matrix (n, n) whose entries stand in a few diagonals, as those of a long shaft do, that multiplies states.

    Args:
        matrix: of scipy.sparse.
    """

    def __init__(self, matrix: Any) -> None:
        self._rows, self._diagonals = matrix, sparse.dia_array(matrix)

    def __matmul__(self, other: Array) -> Array:
        """Its product with (n,) or (n, k)."""
        # beside an infinite state the zeros in the diagonals are not zero
        quick = other.ndim == 1 and isfinite(other.dot(other))
        return np.asarray((self._diagonals if quick else self._rows) @ other)


def by_diagonals(matrix: Any) -> Any:
    """A matrix of scipy.sparse, or its few diagonals."""
    entries = matrix.tocoo()
    count = len(np.unique(entries.coords[1] - entries.coords[0])) if matrix.nnz else 0
    return Diagonals(matrix) if 0 < count <= MOST and count * matrix.shape[0] <= FEW * matrix.nnz else matrix


class Factor:
    """A matrix (n, m) that multiplies states or inputs again and again.

    Args:
        matrix: as an array or one of scipy.sparse.
    """

    def __init__(self, matrix: Any) -> None:
        self.sparse = sparse.csr_array(matrix)
        self.full: Array | None = self.sparse.toarray() if np.prod(self.sparse.shape) <= FULL else None
        """The full array, where it is small enough."""
        self.is_zero = not self.sparse.nnz
        """Whether it has no entry."""

    def __matmul__(self, other: Array) -> Array:
        """Its product with (m,) or (m, k)."""
        # zeros times an infinite torque would make all speeds NaN, and not those alone on which it acts
        if self.full is None or other.ndim > 1 or not isfinite(other.dot(other)):
            return np.asarray(self.sparse @ other)
        return np.asarray(self.full.dot(other))

    def __reduce__(self) -> tuple[Any, ...]:
        return Factor, (self.sparse,)
