"""Limits in laws: Max and Min of long expressions, of which sympy is not asked which is the larger one.

It compares the arguments of every Max and Min that it makes, by factoring their difference: 20 ms for a controller's
limit, at each of the hundreds of times that an expression around it is made anew.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sympy import Basic, Expr, Max, Min, Piecewise, Symbol

from shaftwork.components.tables import Interpolation


def larger(*args: Any) -> Expr:
    """The largest of numbers and expressions."""
    return _limit(Max, args)


def smaller(*args: Any) -> Expr:
    """The smallest of numbers and expressions."""
    return _limit(Min, args)


def replaced(expression: Basic, replacements: Mapping[Any, Any]) -> Any:
    """The same as `expression.xreplace(replacements)`, at once where limits are in it."""
    if not expression.has(Max, Min):
        return expression.xreplace(replacements)
    results: dict[Basic, Basic] = {}

    def anew(node: Basic) -> Basic:
        if node in replacements:
            return replacements[node]
        if not node.args:
            return node
        if node not in results:
            args = [anew(one) for one in node.args]
            if all(new is old for new, old in zip(args, node.args, strict=True)):
                results[node] = node
            else:
                results[node] = _limit(node.func, args) if isinstance(node, Max | Min) else node.func(*args)
        return results[node]

    return anew(expression)


def _limit(function: type[Basic], args: Any) -> Any:
    """A limit of the arguments, which are compared where all of them are numbers."""
    compared = all(getattr(one, "is_number", True) for one in args)
    return function(*args) if compared else function(*args, evaluate=False)


def no_less(p: Any, name: str, least: int) -> Expr:
    """The law of a parameter, and `least` where that falls below; a number is checked against its declared bound.

    Args:
        p: what `Component.branches` is given.
        name: of the parameter.
        least: the lowest value that makes sense.
    """
    law: Expr = getattr(p, name)
    if law == Symbol(name, real=True):
        return law
    if isinstance(law, Piecewise):  # the times of a ramp stay as they are given
        return Piecewise(*((_no_less(value, least), condition) for value, condition in law.args))
    return _no_less(law, least)


def _no_less(law: Expr, least: int) -> Expr:
    if isinstance(law, Interpolation) and min(law.ys) >= least:
        return law
    return larger(least, law)
