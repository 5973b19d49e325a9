"""Stores that change: inertias, masses and capacitors, springs and inductors that depend on their angle and on time.

Law: an inertia C(s, t) whose speed is v = ds/dt, with T = C v^2 / 2, takes in d(C v)/dt - C_s v^2 / 2, which is
C_0 dv/dt for a constant C_0, and beyond it

    (C - C_0) dv/dt + (C_s v / 2 + C_t) v.

A spring K(s, t) lets through K s, and stores the integral of K s over s at a time. Source: Lagrange's equation.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import sympy
from sympy import Expr
from sympy.core.relational import Relational

from shaftwork.components.branches import ACROSS, INTEGRAL, RATE, readings_in
from shaftwork.components.laws import breakpoints, line
from shaftwork.components.laws import t as TIME
from shaftwork.components.slopes import slope
from shaftwork.core.errors import ShaftworkError

JUMP = 1e-9
"""Part of the largest inertia beside it by which one differs on both sides of a jump; less is rounding."""
CHANGE = "change"
"""The label of what there is beyond a constant."""
ENDLESS = (sympy.floor, sympy.ceiling)
JUMPING = (*ENDLESS, sympy.sign, sympy.Heaviside)


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

    The constant is arbitrary; it is that of the angle and the time zero where this is one.

    Raises:
        StoreFaultError: it jumps, so that the speed would.
    """
    constant = capacity.subs({INTEGRAL: 0, TIME: 0})
    if constant.is_number and not (constant.is_finite and constant > 0):
        constant = sympy.Integer(1)
    if (jump := next(_jumps(capacity), None)) is not None:
        raise StoreFaultError(
            f"jumps at {jump}, where the speed would",
            "Let it rise in a short while, as Ramp does, or write it with Max, Min or Abs.",
        )
    rest = capacity - constant
    rises = slope(capacity, INTEGRAL) * ACROSS / 2 + slope(capacity, TIME)
    return constant, rest * RATE + rises * ACROSS, rest * ACROSS**2 / 2


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
    """Where a capacity jumps over time or angle, the other being zero."""
    for symbol, other, unit in ((TIME, INTEGRAL, "t = {:.6g} s"), (INTEGRAL, TIME, "the angle {:.6g}")):
        course = capacity.subs(other, 0).xreplace({symbol: TIME})
        for node in sorted(course.atoms(*JUMPING, Relational), key=str):
            inside = node.lhs - node.rhs if isinstance(node, Relational) else node.args[0]
            if inside.has(TIME) and (isinstance(node, ENDLESS) or line(inside) is None):  # no breakpoints tell where
                yield f"what {str(node)[:60]} decides"
        for place in breakpoints(course):
            sides = [course.subs(TIME, math.nextafter(place, way)) for way in (-math.inf, math.inf)]
            if all(side.is_number for side in sides) and abs(sides[1] - sides[0]) > JUMP * max(map(abs, sides)):
                yield unit.format(place)
