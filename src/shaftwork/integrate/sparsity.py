"""The places of a Jacobian's entries, for a solver that has to know them before it starts."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from shaftwork.integrate.problem import Array


class Pattern:
    """The places of the Jacobian's entries in one run: they grow when a law starts to act, a stop that is hit.

    Args:
        size: number of states.
    """

    def __init__(self, size: int) -> None:
        self._size = size
        # An entry is known by its place along the columns. The diagonal belongs to the matrices that SUNDIALS makes.
        self._places = np.arange(size, dtype=np.int64) * (size + 1)
        self._frozen = self._places
        self._last: tuple[Any, Any, NDArray[np.intp], NDArray[np.bool_]] | None = None

    @property
    def grown(self) -> bool:
        """Whether entries were met that the frozen pattern has not."""
        return self._frozen.size != self._places.size

    def add(self, matrix: Any) -> NDArray[np.int64]:
        """Add the places of a matrix, a scipy.sparse.csc_array (n, n); they are returned."""
        columns = np.repeat(np.arange(self._size, dtype=np.int64), np.diff(matrix.indptr))
        places: NDArray[np.int64] = columns * self._size + matrix.indices
        self._places = np.union1d(self._places, places)
        return places

    def freeze(self) -> Any:
        """Fix the pattern for a solver: a scipy.sparse.csc_array (n, n) of ones."""
        self._frozen, self._last = self._places, None
        columns, rows = np.divmod(self._frozen, self._size)
        # SUNDIALS is built with int indices and reads these arrays as they lie in memory.
        starts = np.searchsorted(columns, np.arange(self._size + 1)).astype(np.int32)
        return sparse.csc_array((np.ones(rows.size), rows.astype(np.int32), starts), shape=(self._size, self._size))

    def values(self, matrix: Any) -> Array:
        """The entries of a matrix in the order of the frozen pattern; those that it has elsewhere are left out."""
        last = self._last
        if last is None or not (np.array_equal(last[0], matrix.indptr) and np.array_equal(last[1], matrix.indices)):
            places = self.add(matrix)
            found = np.minimum(np.searchsorted(self._frozen, places), self._frozen.size - 1)
            last = self._last = matrix.indptr, matrix.indices, found, self._frozen[found] == places
        data = np.zeros(self._frozen.size)
        data[last[2][last[3]]] = matrix.data[last[3]]
        return data
