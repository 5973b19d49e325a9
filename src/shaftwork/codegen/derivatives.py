"""Exact derivatives of state equations and quantities by states and parameters, from their expressions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from sympy import Expr, Symbol

from shaftwork.codegen.code import vectorised_list
from shaftwork.codegen.elements import Array
from shaftwork.components.laws import t as TIME
from shaftwork.components.slopes import slope
from shaftwork.reduction.explicit_rows import Rows


class Values:
    """Expressions as a function of times, states and parameters.

    Args:
        rows: whose states and parameters are the arguments.
        expressions: k of them.
    """

    def __init__(self, rows: Rows, expressions: Sequence[Expr]) -> None:
        self._expressions, self._arguments = tuple(expressions), (TIME, *rows.states, *rows.parameters)

    @cached_property
    def _function(self) -> Callable[..., Any]:
        return vectorised_list(self._arguments, self._expressions)

    def __call__(self, times: Array, states: Array, p: Array) -> Array:
        """(s, k) at times (s,) in s, states (s, n), parameters (p,)."""
        made = np.empty((len(times), len(self._expressions)))
        with np.errstate(all="ignore"):  # the pieces of a law that do not hold may have no value
            for k, values in enumerate(self._function(times, *states.T, *p.tolist()) if self._expressions else ()):
                made[:, k] = values
        return made


class SlopeMatrix:
    """Derivatives of expressions by symbols, as a function of time, states and parameters.

    Args:
        rows: whose states and parameters are the arguments.
        expressions: k of them.
        symbols: m of them.
    """

    def __init__(self, rows: Rows, expressions: Sequence[Expr], symbols: Sequence[Symbol]) -> None:
        self.shape = len(expressions), len(symbols)
        self.entries = {
            (k, m): made
            for k, expression in enumerate(expressions)
            for free in (expression.free_symbols,)
            for m, symbol in enumerate(symbols)
            if symbol in free and (made := slope(expression, symbol)) != 0
        }
        self._values = Values(rows, tuple(self.entries.values()))

    def __call__(self, t: float, x: Array, p: Array) -> Array:
        """(k, m) at a time in s, states (n,), parameters (p,)."""
        return np.asarray(self.along(np.array([t]), x[None, :], p)[0])

    def along(self, times: Array, states: Array, p: Array) -> Array:
        """(s, k, m) at times (s,) in s, states (s, n), parameters (p,)."""
        made = np.zeros((len(times), *self.shape))
        if self.entries:
            rows, columns = np.array(list(self.entries)).T
            made[:, rows, columns] = self._values(times, states, p)
        return made


class Derivatives:
    """The Jacobian of state equations, and what parameters do to it and to the rates.

    Args:
        rows: the state equations.
        parameters: symbols by which to differentiate.
    """

    def __init__(self, rows: Rows, parameters: Sequence[Symbol]) -> None:
        self._rows, self.parameters = rows, tuple(parameters)
        self.by_states = SlopeMatrix(rows, rows.rates, rows.states)
        self.by_parameters = SlopeMatrix(rows, rows.rates, self.parameters)

    @cached_property
    def _of_jacobian(self) -> SlopeMatrix:
        return SlopeMatrix(self._rows, tuple(self.by_states.entries.values()), self.parameters)

    def jacobian_slopes(self, t: float, x: Array, p: Array) -> Array:
        """(parameters, n, n) derivative of the Jacobian by each parameter, the states held."""
        size = len(self._rows.states)
        made = np.zeros((len(self.parameters), size, size))
        for entry, (row, column) in zip(self._of_jacobian(t, x, p), self.by_states.entries, strict=True):
            made[:, row, column] = entry
        return made
