"""Slopes of laws that jump: the derivative between the jumps, without an impulse at them."""

from __future__ import annotations

from functools import lru_cache

from sympy import (
    Abs,
    Basic,
    Dummy,
    Expr,
    Heaviside,
    Max,
    Min,
    Mul,
    Pow,
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

from shaftwork.components import roots
from shaftwork.components.clips import replaced
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


@lru_cache(maxsize=1024)
def slope(expression: Expr, symbol: Symbol) -> Expr:
    """Partial derivative of a law where it is smooth.

    Law: d sign(x) / dx = d Heaviside(x) / dx = d floor(x) / dx = 0, d |x| / dx = sign(x); sympy's `diff` has DiracDelta
    for the first and, where it does not know x as real, derivatives of its real part for the last. A jump has no slope:
    in time it is a breakpoint, in a state the law jumps there and the derivative says nothing about it. At a corner,
    that of asin(sin x) or of the root of a square, sympy's is 0/0, and this one is finite.

    Args:
        expression: a law.
        symbol: what to differentiate by.
    """
    expression = roots.unrooted(expression)
    kinks = expression.atoms(sign, Heaviside, Abs, floor) | {
        node for node in expression.atoms(asin, acos) if roots.folded(node)
    }
    # whether one is real sympy finds out by expanding an argument of which it does not know it: for ever, of a power
    doubtful = {node for node in expression.atoms(sinh, cosh, tanh) if not node.args[0].is_extended_real}
    if not kinks | doubtful:
        return expression.diff(symbol)
    held = {node: Dummy(real=True) for node in kinks | doubtful}
    smooth = replaced(expression, held)  # from the outside in: what is inside a kink is not seen
    total = smooth.diff(symbol)
    for node in (one for one in held if isinstance(one, Abs | asin | acos)):
        if (outer := smooth.diff(held[node])) != 0:
            total += outer * _slope_of_kink(node, symbol)
    for node in doubtful:
        if (inner := slope(node.args[0], symbol)) != 0 and (outer := smooth.diff(held[node])) != 0:
            total += outer * node.fdiff(1) * inner
    made: Expr = replaced(total, {dummy: node for node, dummy in held.items()})
    return made.replace(_is_at_rest, _together) if made.has(Abs) else made


def _slope_of_kink(node: Expr, symbol: Symbol) -> Expr:
    inner = node.args[0]
    if isinstance(node, Abs):
        return sign(inner) * slope(inner, symbol)
    by = roots.complement(node)
    assert by is not None  # noqa: S101 (only such nodes are asked for)
    return sign(by) * roots.turning(node, by, slope(inner, symbol), slope(by, symbol))


def _is_at_rest(node: Expr) -> bool:
    """Whether a product is 0 times infinity where a speed is zero: u sign(u) |u|^-0.5, as the slope of u |u|^0.5 is."""
    return isinstance(node, Mul) and any(isinstance(f, Pow) and isinstance(f.base, Abs) for f in node.args)


def _together(product: Expr) -> Expr:
    """The same with u sign(u) as |u|, which shares its power with that of the speed."""
    factors = list(product.args)
    for turned in [factor for factor in factors if isinstance(factor, sign)]:
        inner = turned.args[0]
        for factor, way in ((inner, 1), (-inner, -1)):
            if factor in factors and turned in factors:
                factors.remove(factor)
                factors.remove(turned)
                factors += [way, Abs(inner)]
    return Mul(*factors)


def jumps(expression: Expr, *symbols: Symbol) -> bool:
    """Whether a law may jump in one of the symbols, so that it is not linear in it even where its slope is constant."""
    found = (node for node in preorder_traversal(expression) if isinstance(node, STEPS) or wraps(node))
    return any(not node.free_symbols.isdisjoint(symbols) for node in found)
