"""Products of one matrix with many vectors, one after another: as a full array where that is quicker than sparse.

BLAS fuses multiplication and addition, so that the difference of two equal terms is the rounding of one of them, and no
zero. Hence only who bears that takes full arrays, and what is read at many times stays sparse.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isfinite
from typing import Any

import numpy as np
from scipy import sparse
from sympy import Add, Expr, Symbol

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.code import vectorised_list
from shaftwork.components.laws import t as TIME

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


class ManyExpressions:
    """Expressions of quantities, parameters and time; a sum with fixed factors is a row of a sparse matrix.

    Args:
        expressions: n of them.
        quantities: m symbols.
        parameters: the symbols of a parameter vector.
        sums: whether there are so many that a matrix of the sums among them is worth its making.
    """

    def __init__(
        self, expressions: Sequence[Expr], quantities: Sequence[Symbol], parameters: Sequence[Symbol], *, sums: bool
    ) -> None:
        places, self._size = {symbol: k for k, symbol in enumerate(quantities)}, len(quantities)
        factors: list[tuple[int, int, Expr]] = []
        constants: list[tuple[int, Expr]] = []
        self._others: list[int] = [] if sums else [*range(len(expressions))]
        for row, expression in enumerate(expressions if sums else ()):
            terms = [term.as_independent(*quantities, as_Add=False) for term in Add.make_args(expression)]
            if not expression.has(TIME) and all(rest == 1 or rest in places for _, rest in terms):
                factors += [(row, places[rest], factor) for factor, rest in terms if rest != 1]
                constants += [(row, factor) for factor, rest in terms if rest == 1]
            else:
                self._others.append(row)
        self._rows, self._columns = [row for row, _, _ in factors], [column for _, column, _ in factors]
        self._constant_rows, self._count = [row for row, _ in constants], len(expressions)
        numbers = [number for *_, number in (*factors, *constants)]
        self._numbers = vectorised_list(parameters, numbers)
        others = [expressions[row] for row in self._others]
        self._function = vectorised_list((TIME, *quantities, *parameters), others)

    def bind(self, p: Array) -> Callable[[Array, Array], Array]:
        """From times (k,) and quantities (m, k) to expressions (k, n), with a parameter vector."""
        sums, others, function, parameters = self._sums(p), self._others, self._function, p.tolist()
        if not others:
            return lambda _, quantities: sums(quantities).T

        def values(times: Array, quantities: Array) -> Array:
            rows = sums(quantities)
            with np.errstate(all="ignore"):
                for row, value in zip(others, function(times, *quantities, *parameters), strict=True):
                    rows[row] = value
            return rows.T

        return values

    def _sums(self, p: Array) -> Callable[[Array], Array]:
        """From quantities (m, k) to (n, k) the sums among the expressions, with a parameter vector."""
        if not (self._rows or self._constant_rows):
            return lambda quantities: np.zeros((self._count, quantities.shape[1]))
        numbers = np.array(self._numbers(*p.tolist()), dtype=float)
        entries = numbers[: len(self._rows)], (self._rows, self._columns)
        matrix, constants = sparse.csr_array(entries, shape=(self._count, self._size)), np.zeros((self._count, 1))
        np.add.at(constants[:, 0], self._constant_rows, numbers[len(self._rows) :])
        factor = Factor(matrix)
        return lambda quantities: factor @ quantities + constants
