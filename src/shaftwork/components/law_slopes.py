"""Slopes of laws that jump: the derivative between the jumps, without an impulse at them.

Square roots and inverse sines at corners are written so that their slopes have no 0/0 where the root is zero.
"""

from __future__ import annotations

from functools import lru_cache

from sympy import (
    Abs,
    Add,
    Basic,
    Dummy,
    Expr,
    Float,
    Heaviside,
    Integer,
    Max,
    Min,
    Mul,
    Poly,
    Pow,
    Rational,
    Symbol,
    acos,
    asin,
    atan,
    atan2,
    cos,
    cosh,
    expand_trig,
    floor,
    preorder_traversal,
    sign,
    sin,
    sinh,
    sqrt,
    tan,
    tanh,
)
from sympy.core.relational import Relational
from sympy.polys.polyerrors import BasePolynomialError
from sympy.simplify.fu import TR8

from shaftwork.components.laws import replaced
from shaftwork.components.tables import InterpolationSlope

STEPS = (sign, Heaviside, Relational, InterpolationSlope, floor)
"""What is constant but for jumps."""
MOST_SYMBOLS, MOST_DEGREE = 4, 8
"""Of more symbols, or of a higher degree, squares and pulses are not looked for: it would take longer than the run."""


def wraps(node: Basic) -> bool:
    """Whether a function brings an angle back into one turn, with a jump or a kink where the next turn begins.

    The inverse function of what is clipped on both sides, max(-a, min(a, sin x)), keeps away from the next turn.
    """
    if isinstance(node, asin | acos) and isinstance(inner := node.args[0], Max | Min):
        return not any(isinstance(part, Max | Min) and part.func is not inner.func for part in inner.args)
    return isinstance(node, atan2) or (isinstance(node, atan | asin | acos) and node.has(sin, cos, tan))


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
    expression = _unrooted(expression)
    kinks = expression.atoms(sign, Heaviside, Abs, floor) | {
        node for node in expression.atoms(asin, acos) if complement(node) is not None
    }
    # whether one is real sympy finds out by expanding an argument of which it does not know it: for ever, of a power
    doubtful = {node for node in expression.atoms(sinh, cosh, tanh) if not node.args[0].is_extended_real}
    if not kinks | doubtful:
        return expression.diff(symbol)
    constants = {node: Dummy(real=True) for node in kinks | doubtful}
    smooth = replaced(expression, constants)  # from the outside in: what is inside a kink is not seen
    total = smooth.diff(symbol)
    for node in (one for one in constants if isinstance(one, Abs | asin | acos)):
        if (outer := smooth.diff(constants[node])) != 0:
            total += outer * _slope_of_kink(node, symbol)
    for node in doubtful:
        if (inner := slope(node.args[0], symbol)) != 0 and (outer := smooth.diff(constants[node])) != 0:
            total += outer * node.fdiff(1) * inner
    derivative: Expr = replaced(total, {dummy: node for node, dummy in constants.items()})
    return derivative.replace(_is_at_rest, _together) if derivative.has(Abs) else derivative


def _slope_of_kink(node: Expr, symbol: Symbol) -> Expr:
    """The derivative of |g|, asin(g) or acos(g), of the last two without a division.

    Law: d asin(g) = sign(w) (w dg - g dw) = -d acos(g), that of the angle whose sine is g and whose cosine is w.
    """
    g = node.args[0]
    if isinstance(node, Abs):
        return sign(g) * slope(g, symbol)
    w = complement(node)
    assert w is not None  # noqa: S101 (only such nodes are asked for)
    turning = TR8((w * slope(g, symbol) - g * slope(w, symbol)).expand()).expand()
    return sign(w) * (-turning if isinstance(node, acos) else turning)


def _is_at_rest(node: Expr) -> bool:
    """Whether a product is 0 times infinity where a speed is zero: u sign(u) |u|^-0.5, as the slope of u |u|^0.5 is."""
    return isinstance(node, Mul) and any(isinstance(f, Pow) and isinstance(f.base, Abs) for f in node.args)


def _together(product: Expr) -> Expr:
    """The same with u sign(u) as |u|, which shares its power with that of the speed."""
    factors = list(product.args)
    for turned in [factor for factor in factors if isinstance(factor, sign)]:
        inner = turned.args[0]
        for factor, number in ((inner, 1), (-inner, -1)):
            if factor in factors and turned in factors:
                factors.remove(factor)
                factors.remove(turned)
                factors += [number, Abs(inner)]
    return Mul(*factors)


def jumps(expression: Expr, *symbols: Symbol) -> bool:
    """Whether a law may jump in one of the symbols, so that it is not linear in it even where its slope is constant."""
    steps = (node for node in preorder_traversal(expression) if isinstance(node, STEPS) or wraps(node))
    return any(not node.free_symbols.isdisjoint(symbols) for node in steps)


def is_root(node: Expr) -> bool:
    """Whether a node is a square root, or an odd power of one, of a sum."""
    return isinstance(node, Pow) and isinstance(node.exp, Rational) and node.exp.q == 2 and node.base.has(Add)


def _unrooted(expression: Expr) -> Expr:
    """The same where roots of perfect squares are sizes: sqrt(2 - 2 cos x) is 2 |sin(x/2)|, whose slope is known."""
    if not any(is_root(node) for node in expression.atoms(Pow)):
        return expression
    without: Expr = expression.replace(is_root, lambda node: _size(node, square_root(node.base)))
    return without


def complement(node: Expr) -> Expr | None:
    """What is zero where an inverse sine or cosine has a corner: w with w^2 = 1 - g^2; None where there is no such w.

    Args:
        node: asin(g) or acos(g).
    """
    inner = node.args[0]
    if not inner.free_symbols:
        return None
    if isinstance(inner, sin):
        return cos(inner.args[0])
    return sin(inner.args[0]) if isinstance(inner, cos) else square_root(1 - inner**2)


@lru_cache(maxsize=4096)
def square_root(square: Expr) -> Expr | None:
    """An expression without roots whose square this is, or None.

    Law: with s = sin(a/2) and c = cos(a/2) every polynomial of sin(a) and cos(a) is a homogeneous one of s and c, where
    1 = s^2 + c^2; its factors, but for those that are 1, say whether it is a square.
    """
    numbers = {number: Rational(str(number)) for number in square.atoms(Float)}
    plain = square.xreplace(numbers)
    if len({wave.args[0] for wave in plain.atoms(sin, cos)}) > 1:
        plain = expand_trig(plain)
    angles = dict.fromkeys(wave.args[0] for wave in sorted(plain.atoms(sin, cos), key=str))
    halves = {angle: (Dummy("s"), Dummy("c")) for angle in angles}
    if len(square.free_symbols) > MOST_SYMBOLS or any(angle.has(sin, cos) for angle in angles):
        return None
    try:
        root = _root_of_factors(_homogeneous(plain, halves), [s**2 + c**2 for s, c in halves.values()])
    except BasePolynomialError:
        return None
    if root is None or not angles:
        return root
    back = {half: f(angle / 2) for angle, pair in halves.items() for half, f in zip(pair, (sin, cos), strict=True)}
    in_angles: Expr = TR8(root.xreplace(back).expand())
    return in_angles


def _homogeneous(square: Expr, halves: dict[Expr, tuple[Dummy, Dummy]]) -> Expr:
    """A polynomial of sines and cosines in those of half their angles, with all terms of one degree."""
    for angle, (s, c) in halves.items():
        waves = Poly(square, sin(angle), cos(angle))
        degree = waves.total_degree()
        if degree > MOST_DEGREE:
            raise BasePolynomialError
        square = Add(
            *(
                factor * (2 * s * c) ** i * (c**2 - s**2) ** j * (s**2 + c**2) ** (degree - i - j)
                for (i, j), factor in waves.terms()
            )
        )
    return square


def _root_of_factors(square: Expr, ones: list[Expr]) -> Expr | None:
    polynomial = Poly(square)
    if len(polynomial.gens) > MOST_SYMBOLS + 2 * len(ones) or polynomial.total_degree() > 2 * MOST_DEGREE + 2:
        return None
    for one in ones:
        while True:
            quotient, rest = polynomial.div(Poly(one, *polynomial.gens))
            if not rest.is_zero or polynomial.is_zero:
                break
            polynomial = quotient
    number, factors = polynomial.sqf_list()
    if not number.is_positive or any(power % 2 for _, power in factors):
        return None
    root: Expr = sqrt(number)
    for factor, power in factors:
        root *= factor.as_expr() ** (power // 2)
    return root


def _size(node: Pow, root: Expr | None) -> Expr:
    return node if root is None else Abs(root) ** Integer(2 * node.exp)
