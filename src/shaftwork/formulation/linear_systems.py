"""Linear equations whose unknowns stand in expressions: exported code computes them by numbers, where they are too many
for a closed form.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Self

from sympy import Basic, Dummy, Expr, Symbol
from sympy.core.expr import AtomicExpr

from shaftwork.components.discontinuities import parts
from shaftwork.components.law_slopes import slope


@dataclass(frozen=True, eq=False)
class LinearSystem:
    """Equations A x = b.

    Args:
        matrix: nonzero entries of A by row and column, from 0.
        right: b.
    """

    matrix: Mapping[tuple[int, int], Expr]
    right: list[Expr]
    _derivatives: dict[Symbol, LinearSystem] = field(default_factory=dict)

    @cached_property
    def unknowns(self) -> tuple[Unknown, ...]:
        """What stands in expressions for each entry of x."""
        return tuple(Unknown(self) for _ in self.right)

    @cached_property
    def free_symbols(self) -> set[Basic]:
        """The symbols on which x depends."""
        return set[Basic]().union(*(entry.free_symbols for entry in (*self.matrix.values(), *self.right)))

    def derivative(self, symbol: Symbol) -> LinearSystem:
        """The equations A x' = b' - A' x of the derivative of x by a symbol."""
        if symbol not in self._derivatives:
            slopes = [slope(side, symbol) for side in self.right]
            moving = ((place, entry) for place, entry in self.matrix.items() if symbol in entry.free_symbols)
            for (row, column), entry in moving:
                slopes[row] -= slope(entry, symbol) * self.unknowns[column]
            self._derivatives[symbol] = LinearSystem(self.matrix, slopes)
        return self._derivatives[symbol]


class Unknown(Dummy):  # type: ignore[misc]
    """An entry of the solution of a system: a symbol that has slopes by those on which the system depends."""

    system: LinearSystem

    def __new__(cls, system: LinearSystem) -> Self:
        unknown: Self = super().__new__(cls, "solved", real=True)  # one name: sympy sorts by it first
        unknown.system = system
        return unknown

    @property
    def free_symbols(self) -> set[Basic]:
        return self.system.free_symbols

    def _eval_derivative(self, symbol: Symbol) -> Expr:
        return self.system.derivative(symbol).unknowns[self.system.unknowns.index(self)]

    def _eval_derivative_n_times(self, symbol: Symbol, n: Any) -> Expr:
        return super(AtomicExpr, self)._eval_derivative_n_times(symbol, n)  # one after the other, as of any function


def systems_in(expressions: Iterable[Expr]) -> tuple[LinearSystem, ...]:
    """The systems whose unknowns stand in expressions, each after those whose unknowns stand in it."""
    systems: dict[LinearSystem, None] = {}
    for node in parts(expressions):
        if isinstance(node, Unknown) and node.system not in systems:
            inner = (*node.system.matrix.values(), *node.system.right)
            systems |= dict.fromkeys((*systems_in(inner), node.system))
    return tuple(systems)
