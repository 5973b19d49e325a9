"""Of what kind a branch is: a store, a conductance, a law or a rigid joint, by what its law is made of."""

from __future__ import annotations

import reprlib
from collections.abc import Iterator
from enum import IntEnum
from typing import Any

from sympy import Expr, I, Integer, nan, oo, zoo

from shaftwork.components.branches import (
    ACROSS,
    INTEGRAL,
    AcrossStore,
    Branch,
    ThroughLaw,
    ThroughStore,
    readings_in,
)
from shaftwork.components.law_slopes import jumps, slope
from shaftwork.components.laws import as_expression
from shaftwork.components.laws import t as TIME
from shaftwork.components.modes import has_mode
from shaftwork.core.errors import ParameterError, ShaftworkError


class Kind(IntEnum):
    """The kinds of branches, in the order in which the normal tree prefers them."""

    COUPLING = 0
    ACROSS_SOURCE = 1
    ACROSS_STORE = 2
    CONDUCTANCE = 3
    LAW = 4
    THROUGH_STORE = 5
    THROUGH_SOURCE = 6


Resolved = tuple[Kind, Expr]
"""A kind and the law of a branch of that kind."""


def law_of(law: Any, branch: Branch, number: int) -> Expr:
    """A law or coefficient of a branch as an expression; infinity stands for a rigid joint, where one is possible.

    Raises:
        ShaftworkError: it is no number or expression, or has no finite real value.
    """
    try:
        expression = as_expression(law)
    except ParameterError:
        objection = "not a number or an expression of p.name, ACROSS, INTEGRAL and t"
    else:
        if not expression.has(nan, I, -oo) and (not expression.has(oo, zoo) or _is_rigid(branch, expression)):
            return expression
        objection = "which has no finite real value: look for a division by zero"
    label = f" {branch.label!r}" if branch.label else ""
    raise ShaftworkError(f"branch {number} ({type(branch).__name__}{label}) has {reprlib.repr(law)}, {objection}.")


def _is_rigid(branch: Branch, law: Expr) -> bool:
    """Whether an infinite law stands for a rigid joint: an infinite store, or a conductance such as 1/R with R = 0."""
    if isinstance(branch, ThroughLaw):
        conductance = slope(law, ACROSS)
        return bool(conductance.has(oo, zoo)) and not conductance.has(ACROSS, INTEGRAL, TIME) and not readings_in(law)
    return isinstance(branch, AcrossStore | ThroughStore)


def resolved(branch: Branch, law: Expr) -> Iterator[Resolved]:
    """A store or law as kinds and laws: none when it vanishes, a coupling if it is infinite, two if it is affine."""
    match branch:
        case AcrossStore():
            yield from _linear(Kind.ACROSS_STORE, law)
        case ThroughStore():
            yield from _linear(Kind.THROUGH_STORE, law)
        case ThroughLaw():
            yield from _through_law(law)


def _linear(kind: Kind, coefficient: Expr) -> Iterator[Resolved]:
    if coefficient.has(zoo, oo, nan):
        yield Kind.COUPLING, Integer(0)
    elif coefficient != 0:
        yield kind, coefficient


def _through_law(through: Expr) -> Iterator[Resolved]:
    conductance = slope(through, ACROSS)
    varies = conductance.has(ACROSS, INTEGRAL, TIME) or has_mode(conductance) or readings_in(conductance)
    if varies or jumps(through, ACROSS):
        yield Kind.LAW, through
        return
    yield from _linear(Kind.CONDUCTANCE, conductance)
    rest = through.subs(ACROSS, 0)
    if rest != 0 and not rest.has(nan):
        yield Kind.LAW if rest.has(INTEGRAL) or readings_in(rest) else Kind.THROUGH_SOURCE, rest
