"""Slopes of laws that jump: the derivative between the jumps, without an impulse at them."""

from __future__ import annotations

from sympy import (
    Abs,
    Basic,
    Dummy,
    Expr,
    Heaviside,
    Max,
    Min,
    Symbol,
    acos,
    acot,
    acsc,
    asec,
    asin,
    atan,
    atan2,
    ceiling,
    cos,
    cosh,
    cot,
    csc,
    floor,
    preorder_traversal,
    sec,
    sign,
    sin,
    sinh,
    tan,
    tanh,
)
from sympy.core.relational import Relational

from shaftwork.components.tables import InterpolationSlope

STEPS = (sign, Heaviside, Relational, InterpolationSlope, floor, ceiling)
"""What is constant but for jumps."""
TURNING = (sin, cos, tan, cot, sec, csc)


def wraps(node: Basic) -> bool:
    """Whether a function brings an angle back into one turn, with a jump or a kink where the next turn begins.

    The inverse function of what is clipped on both sides, max(-a, min(a, sin x)), keeps away from the next turn.
    """
    if isinstance(node, asin | acos) and isinstance(inner := node.args[0], Max | Min):
        return not any(isinstance(part, Max | Min) and part.func is not inner.func for part in inner.args)
    return isinstance(node, atan2) or (isinstance(node, atan | asin | acos | acot | asec | acsc) and node.has(*TURNING))


def slope(expression: Expr, symbol: Symbol) -> Expr:
    """Partial derivative of a law where it is smooth.

    Law: d sign(x) / dx = d Heaviside(x) / dx = d floor(x) / dx = 0, d |x| / dx = sign(x); sympy's `diff` has DiracDelta
    for the first and, where it does not know x as real, derivatives of its real part for the last. A jump has no slope:
    in time it is a breakpoint, in a state the law jumps there and the derivative says nothing about it.

    Args:
        expression: a law.
        symbol: what to differentiate by.
    """
    kinks = expression.atoms(sign, Heaviside, Abs, floor)
    # whether one is real sympy finds out by expanding an argument of which it does not know it: for ever, of a power
    doubtful = {node for node in expression.atoms(sinh, cosh, tanh) if not node.args[0].is_extended_real}
    if not kinks | doubtful:
        return expression.diff(symbol)
    held = {node: Dummy(real=True) for node in kinks | doubtful}
    smooth = expression.xreplace(held)  # from the outside in: what is inside a kink is not seen
    total = smooth.diff(symbol)
    for node in expression.atoms(Abs):
        inner = node.args[0]
        total += smooth.diff(held[node]) * sign(inner) * slope(inner, symbol)
    for node in doubtful:
        if (inner := slope(node.args[0], symbol)) != 0 and (outer := smooth.diff(held[node])) != 0:
            total += outer * node.fdiff(1) * inner
    made: Expr = total.xreplace({dummy: node for node, dummy in held.items()})
    return made


def jumps(expression: Expr, *symbols: Symbol) -> bool:
    """Whether a law may jump in one of the symbols, so that it is not linear in it even where its slope is constant."""
    found = (node for node in preorder_traversal(expression) if isinstance(node, STEPS) or wraps(node))
    return any(not node.free_symbols.isdisjoint(symbols) for node in found)
