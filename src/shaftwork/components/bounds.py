"""Laws that cannot fall below what they stand for."""

from __future__ import annotations

from typing import Any

from sympy import Expr, Piecewise, Symbol

from shaftwork.components.clips import larger
from shaftwork.components.tables import Interpolation


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
