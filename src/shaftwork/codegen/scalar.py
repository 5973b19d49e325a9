"""The right-hand side as scalar code with common subexpressions: the fastest plain Python form of a small model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
from sympy import Symbol, count_ops, cse

from shaftwork.codegen.code import branchwise, scalar
from shaftwork.codegen.elements import Array
from shaftwork.components.laws import t as TIME
from shaftwork.reduction.explicit_rows import Rows


class ScalarProgram:
    """`rhs(t, x, p)` of explicit rows.

    Args:
        rows: the explicit state equations.
    """

    def __init__(self, rows: Rows) -> None:
        self._rows, self._rates = rows, rows.rates

    @cached_property
    def function(self) -> Callable[..., list[float]]:
        """(t, states, parameters) to the list of rates, in Python floats."""
        return scalar(self._arguments, self._rates)

    @cached_property
    def _slow(self) -> Callable[..., list[float]]:
        return branchwise(self._arguments, self._rates)

    @property
    def _arguments(self) -> dict[str, Symbol | Sequence[Symbol]]:
        return {"t": TIME, "x": self._rows.states, "p": self._rows.parameters}

    @property
    def source(self) -> str:
        """The generated code."""
        return str(self.function.__doc__)

    def bind(self, p: Array) -> Callable[[float, Array], Array]:
        """The right-hand side for one parameter vector; NaN where a law cannot be evaluated."""
        function, values = self.function, p.tolist()

        def rhs(t: float, x: Array) -> Array:
            try:
                return np.array(function(t, x.tolist(), values))
            except (ArithmeticError, ValueError):
                return np.array(self._slow(t, x, p))

        return rhs

    @cached_property
    def operations(self) -> dict[str, int]:
        """Operations of one evaluation after common subexpressions are taken out, by name; signs cost nothing."""
        shared, reduced = cse(self._rates)
        total = sum((count_ops(term, visual=True) for term in (*(e for _, e in shared), *reduced)), start=0)
        counts = total.as_coefficients_dict() if total else {}
        return {str(name).lower(): int(count) for name, count in sorted(counts.items(), key=str) if str(name) != "NEG"}
