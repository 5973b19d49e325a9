"""How a law goes between its breakpoints: along straight pieces, or not.

A formula of coupled equations has the same parts in many places: a thousand of them may be a million when written out.
What goes through formulas looks at each part once.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import sympy
from sympy.core.relational import Relational

from shaftwork.components.laws import between_steps, line, switches_of, t
from shaftwork.components.tables import Interpolation, InterpolationSlope


def parts(expressions: Iterable[sympy.Basic]) -> Iterator[sympy.Basic]:
    """Every distinct part of expressions once, the expressions as well."""
    left = list(dict.fromkeys(expressions))
    known = set(left)
    while left:
        node = left.pop()
        yield node
        found = [part for part in dict.fromkeys(node.args) if part not in known]
        known.update(found)
        left += found


def pieces_degree(expression: sympy.Expr) -> int | None:
    """Degree in `t` of an expression between its breakpoints: 0 constant, 1 linear, None anything else.

    Every symbol other than `t` counts as a constant.
    """
    degree = _Degrees(expression).of(expression)
    return int(degree) if degree <= 1 else None


class _Degrees:
    """Degrees in t between breakpoints of the parts of an expression; infinite where one is no polynomial there."""

    def __init__(self, expression: sympy.Expr) -> None:
        self._steps = any(isinstance(part, sympy.floor) for part in parts((expression,)))
        self._moving: dict[sympy.Basic, bool] = {t: True}
        self._found: dict[sympy.Basic, float] = {}

    def of(self, expression: sympy.Expr) -> float:
        """Degree of a part."""
        if expression not in self._found:
            self._found[expression] = self._degree(expression)
        return self._found[expression]

    def _moves(self, expression: sympy.Basic) -> bool:
        if expression not in self._moving:
            self._moving[expression] = any(self._moves(part) for part in expression.args)
        return self._moving[expression]

    def _located(self, argument: sympy.Expr) -> bool:
        return not self._moves(argument) or line(argument) is not None

    def _degree(self, expression: sympy.Expr) -> float:
        if not self._moves(expression):
            return 0
        if self._steps and t not in between_steps(expression):
            return 0 if all(self._located(step.args[0]) for step in expression.atoms(sympy.floor)) else math.inf
        if not all(self._located(argument) for argument, _ in switches_of(expression)):
            return math.inf
        match expression:
            case sympy.Symbol():
                return 1
            case sympy.Add() | sympy.Max() | sympy.Min():
                return max(self.of(argument) for argument in expression.args)
            case sympy.Mul():
                return sum(self.of(factor) for factor in expression.args)
            case sympy.Pow(exp=sympy.Integer(is_positive=True) as exponent):
                return self.of(expression.base) * int(exponent)
            case sympy.Piecewise():
                relations = [relation for _, condition in expression.args for relation in condition.atoms(Relational)]
                located = all(self._located(relation.lhs - relation.rhs) for relation in relations)
                return max(self.of(value) for value, _ in expression.args) if located else math.inf
            case sympy.Heaviside() | sympy.sign() | InterpolationSlope():
                return 0
            case sympy.Abs() | Interpolation():
                return 1
        return math.inf
