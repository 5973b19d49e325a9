"""Many expressions of many quantities at once: what is a sum of them with fixed factors is a row of a sparse matrix."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy import sparse
from sympy import Add, Expr, Symbol

from shaftwork.codegen.code import vectorised_list
from shaftwork.codegen.elements import Array
from shaftwork.codegen.products import Factor
from shaftwork.components.laws import t as TIME

Values = Callable[[Array, Array], Array]
"""From times (k,) and quantities (m, k) to expressions (k, n)."""


class ManyExpressions:
    """Expressions of quantities, parameters and time.

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
        numbers = [made for *_, made in (*factors, *constants)]
        self._numbers = vectorised_list(parameters, numbers)
        others = [expressions[row] for row in self._others]
        self._function = vectorised_list((TIME, *quantities, *parameters), others)

    def bind(self, p: Array) -> Values:
        """The expressions with a parameter vector."""
        sums, others, function, parameters = self._sums(p), self._others, self._function, p.tolist()
        if not others:
            return lambda _, quantities: sums(quantities).T

        def values(times: Array, quantities: Array) -> Array:
            made = sums(quantities)
            with np.errstate(all="ignore"):
                found = function(times, *quantities, *parameters)
                for row, value in zip(others, found, strict=True):
                    made[row] = value
            return made.T

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
