"""Laws as text: `parse` reads the grammar of `expression_reader`, `write` is its exact inverse."""

from __future__ import annotations

import sympy
from sympy.core.relational import Relational

from shaftwork.components.laws import SYMBOLS
from shaftwork.components.tables import Interpolation
from shaftwork.core.errors import ModelFileError
from shaftwork.network.expression_reader import parse
from shaftwork.network.grammar import COMPARISONS, FUNCTION_NAMES, FUNCTIONS

__all__ = ["parse", "write"]

OR, AND, NOT, COMPARISON, SUM, PRODUCT, POWER, ATOM = range(8)
"""How strongly a text binds: a part that binds less than its place asks for stands in parentheses."""

_NAMES = {function.make: name for name, function in FUNCTIONS.items() if name != "sqrt"}
_SIGNS = {relation: sign for sign, relation in COMPARISONS.items()}
_CONSTANTS = {sympy.pi: "pi", sympy.E: "exp(1)", sympy.true: "True", sympy.false: "False"}


def write(expression: sympy.Expr) -> str:
    """The text of an expression: `parse` of it is the same expression, floats to the last bit.

    Args:
        expression: a law of the package's symbols.

    Raises:
        ModelFileError: a part is not in the grammar, or sympy builds the expression differently when it is read again.
    """
    try:
        text, _ = _written(expression)
    except RecursionError:
        raise ModelFileError("the expression is nested too deeply for text. Split it or use a Table.") from None
    if (again := parse(text)) != expression:
        raise ModelFileError(
            f"the expression {text[:200]} reads back as {str(again)[:200]}, because sympy rewrites it whenever it is "
            "built. Save the rewritten form: expression.func(*expression.args), or sympy.expand(expression)."
        )
    return text


def _written(node: sympy.Basic) -> tuple[str, int]:
    """Text of a node and how strongly it binds."""
    if node in _CONSTANTS:
        return _CONSTANTS[node], ATOM
    match node:
        case sympy.Symbol() if node in SYMBOLS:
            return node.name, ATOM
        case sympy.Float():
            return _float(node), ATOM if node >= 0 else PRODUCT
        case sympy.Rational():
            return str(node), ATOM if node.is_Integer and node >= 0 else PRODUCT
        case sympy.Add():
            return _sum(node), SUM
        case sympy.Mul():
            return _product(node), PRODUCT
        case sympy.Pow():
            return _power(node)
        case Relational() if type(node) in _SIGNS:
            return f"{_at(SUM, node.lhs)} {_SIGNS[type(node)]} {_at(SUM, node.rhs)}", COMPARISON
        case sympy.Or():
            return " or ".join(_at(AND, part) for part in sympy.ordered(node.args)), OR
        case sympy.And():
            return " and ".join(_at(NOT, part) for part in sympy.ordered(node.args)), AND
        case sympy.Not():
            return f"not {_at(NOT, node.args[0])}", NOT
    return _call(node), ATOM


def _at(binding: int, node: sympy.Basic) -> str:
    """Text of a node for a place that asks for a binding at least so strong."""
    text, strength = _written(node)
    return text if strength >= binding else f"({text})"


def _float(number: sympy.Float) -> str:
    value = float(number)
    if sympy.Float(value) != number:
        raise ModelFileError(
            f"the number {number} has more digits than a float. Round it with sympy.Float(number, 15)."
        )
    return repr(value)


def _sum(node: sympy.Add) -> str:
    first, *others = (_at(PRODUCT, term) for term in node.as_ordered_terms())
    return first + "".join(f" - {term[1:]}" if term.startswith("-") else f" + {term}" for term in others)


def _product(node: sympy.Mul) -> str:
    factors = node.as_ordered_factors()
    coefficient, factors = (factors[0], factors[1:]) if factors[0].is_Number else (sympy.S.One, factors)
    sign = "-" if coefficient < 0 else ""
    top = [_at(POWER, factor) for factor in factors if not _is_inverse(factor)]
    bottom = [_at(POWER, factor.base) for factor in factors if _is_inverse(factor)]
    numerator, denominator = abs(coefficient).as_numer_denom()
    if numerator != 1 or not top:
        top.insert(0, _at(POWER, numerator))
    if denominator != 1:
        bottom.insert(0, _at(POWER, denominator))
    return sign + "*".join(top) + "".join(f"/{factor}" for factor in bottom)


def _is_inverse(factor: sympy.Expr) -> bool:
    return isinstance(factor, sympy.Pow) and factor.exp == -1


def _power(node: sympy.Pow) -> tuple[str, int]:
    if _is_inverse(node):
        return f"1/{_at(POWER, node.base)}", PRODUCT
    if node.exp == sympy.S.Half:
        return f"sqrt({_at(OR, node.base)})", ATOM
    return f"{_at(ATOM, node.base)}**{_at(ATOM, node.exp)}", POWER


def _call(node: sympy.Basic) -> str:
    match node:
        case Interpolation():
            return f"Table({list(node.xs)}, {list(node.ys)})({_at(OR, node.argument)})"
        case sympy.Piecewise():
            pairs = (f"({_at(OR, value)}, {_at(OR, condition)})" for value, condition in node.args)
            return f"Piecewise({', '.join(pairs)})"
        case sympy.Heaviside() if node.args[1] == sympy.S.Half:
            return f"Heaviside({_at(OR, node.args[0])})"
        case sympy.Max() | sympy.Min():
            return f"{_NAMES[node.func]}({', '.join(_at(OR, argument) for argument in sympy.ordered(node.args))})"
    if node.func in _NAMES:
        return f"{_NAMES[node.func]}({', '.join(_at(OR, argument) for argument in node.args)})"
    names = ", ".join(symbol.name for symbol in SYMBOLS)
    raise ModelFileError(
        f"{str(node)[:80]} ({node.func.__name__}) is not in the grammar of model files. "
        f"Symbols: {names} of this package, pi. Functions: {FUNCTION_NAMES}. Tabulate it, or keep this law in a script."
    )
