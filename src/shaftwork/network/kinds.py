"""Of what kind a branch is: a store, a conductance, a law or a rigid joint, by what its law is made of.

A store may change: an inertia, mass or capacitor, a spring or inductor, that depends on its angle and on time. Law: an
inertia C(s, t) whose speed is v = ds/dt, with T = C v^2 / 2, takes in d(C v)/dt - C_s v^2 / 2, which is C_0 dv/dt for a
constant C_0, and beyond it

    (C - C_0) dv/dt + (C_s v / 2 + C_t) v.

A spring K(s, t) lets through K s, and stores the integral of K s over s at a time. Source: Lagrange's equation.
"""

from __future__ import annotations

import reprlib
from collections.abc import Iterator
from enum import IntEnum
from typing import Any

import sympy
from sympy import AccumBounds, Basic, Expr, I, Integer, Symbol, nan, oo, zoo
from sympy.core.relational import Relational

from shaftwork.components.branches import (
    ACROSS,
    INTEGRAL,
    RATE,
    AcrossStore,
    Branch,
    ThroughLaw,
    ThroughStore,
    readings_in,
)
from shaftwork.components.law_slopes import STEPS, jumps, slope, wraps
from shaftwork.components.laws import as_expression
from shaftwork.components.laws import t as TIME
from shaftwork.components.modes import has_mode
from shaftwork.core.errors import ParameterError, ShaftworkError
from shaftwork.numerics.tolerances import TYPED


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
CHANGE = "change"
"""The label of what there is beyond a constant."""


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


class StoreFaultError(ShaftworkError):
    """A capacity or stiffness cannot change as it is said to; `hint` says what can.

    Args:
        what: the rest of a sentence that begins with the store or its parameter.
        hint: the next step.
    """

    def __init__(self, what: str, hint: str) -> None:
        self.hint = hint
        super().__init__(what)


def changes(coefficient: Expr) -> bool:
    """Whether a capacity or stiffness depends on the angle or on time.

    Raises:
        StoreFaultError: it depends on the speed, or on what others do.
    """
    if coefficient.has(ACROSS) or readings_in(coefficient):
        raise StoreFaultError("depends on its speed or on other branches", "It may depend on its angle and on time t.")
    return bool(coefficient.has(INTEGRAL, TIME))


def beyond_constant(capacity: Expr) -> tuple[Expr, Expr, Expr]:
    """A constant capacity, the law of what there is beyond it, and the energy in that, J.

    The constant is arbitrary: the capacity at the angle and the time zero where this is a positive number, else 1.

    Raises:
        StoreFaultError: it jumps, so that the speed would.
    """
    constant = capacity.subs({INTEGRAL: 0, TIME: 0})
    if not (constant.is_number and constant.is_finite and constant > 0):
        constant = sympy.Integer(1)
    if (jump := next(_jumps(capacity), None)) is not None:
        raise StoreFaultError(
            f"jumps at {jump}, where the speed would",
            "Let it rise in a short while, as Ramp does, or write it with Max, Min or Abs.",
        )
    rest = capacity - constant
    rises = slope(capacity, INTEGRAL) * ACROSS / 2 + slope(capacity, TIME)
    return constant, rest * RATE + rises * ACROSS, rest * ACROSS**2 / 2


def is_bounded(capacity: Expr) -> bool:
    """Whether a capacity is above zero and finite at all angles and times, as far as bounds of its terms tell."""
    anything = AccumBounds(-oo, oo)
    try:
        bounds = capacity.xreplace({INTEGRAL: anything, TIME: anything})
        return bool(isinstance(bounds, AccumBounds) and bounds.min > 0 and bounds.max < oo)
    except (TypeError, ValueError, NotImplementedError):  # a function that knows no bounds
        return False


def spring(stiffness: Expr) -> tuple[Expr, Expr | None]:
    """The law of a stiffness that changes, and what it stores, J; None where that has no closed form."""
    law = stiffness * INTEGRAL
    if not stiffness.has(INTEGRAL):
        return law, law * INTEGRAL / 2
    if not law.is_polynomial(INTEGRAL):
        return law, None
    energy = sympy.integrate(law, INTEGRAL)
    return law, energy - energy.subs(INTEGRAL, 0)


def _jumps(capacity: Expr) -> Iterator[str]:
    """Where a capacity jumps over time or angle."""
    steps = {node for node in sympy.preorder_traversal(capacity) if isinstance(node, STEPS) or wraps(node)}
    for node in sorted((node for node in steps if node.has(INTEGRAL, TIME)), key=str):
        boundary = _boundary(node)
        if boundary is None:
            yield f"what {str(node.xreplace({INTEGRAL: Symbol('angle')}))[:60]} decides"
            continue
        symbol, place = boundary
        others = capacity.free_symbols | place.free_symbols
        # what the other variables are where the two sides of a jump are compared
        for shift in (0.37, 1.9, 2.7):
            at = {one: shift * (1 + number) for number, one in enumerate(sorted(others - {symbol}, key=str))}
            low, high = _sides(capacity.xreplace(at), symbol, float(place.xreplace(at)))
            if low.is_real and high.is_real and abs(high - low) > TYPED * max(abs(low), abs(high)):
                shown = str(place) if place.free_symbols else f"{float(place):.6g}"
                yield f"t = {shown} s" if symbol is TIME else f"the angle {shown}"
                break


def _boundary(node: Basic) -> tuple[Symbol, Expr] | None:
    """The angle or the time at which a condition or a step changes; None where no straight line tells it."""
    if not isinstance(node, Relational | sympy.sign | sympy.Heaviside):
        return None
    inside = node.lhs - node.rhs if isinstance(node, Relational) else node.args[0]
    for symbol in (INTEGRAL, TIME):
        rate = inside.diff(symbol)
        if rate != 0 and not rate.has(INTEGRAL, TIME):
            return symbol, (symbol - inside / rate).expand()
    return None


def _sides(capacity: Expr, symbol: Symbol, place: float) -> tuple[Expr, Expr]:
    """A capacity in one variable just below and just above a boundary: its conditions read there, the rest at it."""
    low, high = (
        capacity.xreplace({node: node.subs(symbol, place + offset) for node in capacity.atoms(*STEPS)}).subs(
            symbol, place
        )
        for offset in (-TYPED * max(1, abs(place)), TYPED * max(1, abs(place)))
    )
    return low, high
