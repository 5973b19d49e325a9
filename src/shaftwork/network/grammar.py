"""The words of laws as text: tokens, functions, limits, and the message that points at a fault."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import NoReturn

import sympy
from sympy.core.relational import Relational
from sympy.logic.boolalg import BooleanAtom, BooleanFunction

from shaftwork.components import noise
from shaftwork.core.errors import ModelFileError

MAXIMUM_LENGTH = 200_000
"""Characters of an expression; long tables take most of them."""
MAXIMUM_TOKENS = 1000
"""Numbers, names and signs of an expression; a list of a table counts as one."""
MAXIMUM_DEPTH = 30
"""Parentheses, functions and exponents inside each other."""
MAXIMUM_DIGITS = 60
"""Characters of a number as it is written."""
MAXIMUM_INTEGER = 10**40
"""Largest integer, numerator and denominator, also of intermediate results."""
MAXIMUM_EXPONENT = 1000
"""Largest exponent that is a number."""
MAXIMUM_TOWER = 4
"""Powers in an exponent without symbols: sympy takes four times as long for each to find how large it is."""
MAXIMUM_EXTREMA = 16
"""Arguments of all Max and Min of an expression together: sympy compares each with each."""

NOT_REAL = "has a part without a finite real value"

Boolean = Relational | BooleanFunction | BooleanAtom


@dataclass(frozen=True)
class Function:
    """A function of the grammar: its sympy class, its numbers of arguments and its value for numbers."""

    make: Callable[..., sympy.Expr]
    fewest: int
    most: int
    value: Callable[..., float]


@dataclass(frozen=True)
class Token:
    """A word of a text: "number", "name", "list", "sign" or "end", and its place counted from 0."""

    kind: str
    text: str
    position: int


def _sign(x: float) -> float:
    return math.copysign(1.0, x) if x else 0.0


def _heaviside(x: float, at_zero: float = 0.5) -> float:
    return at_zero if x == 0 else float(x > 0)


FUNCTIONS: dict[str, Function] = {
    **{
        name: Function(getattr(sympy, name), 1, 1, getattr(math, name))
        for name in ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "sqrt")
    },
    "atan2": Function(sympy.atan2, 2, 2, math.atan2),
    "Abs": Function(sympy.Abs, 1, 1, abs),
    "sign": Function(sympy.sign, 1, 1, _sign),
    "Heaviside": Function(sympy.Heaviside, 1, 2, _heaviside),
    "Max": Function(sympy.Max, 1, MAXIMUM_EXTREMA, lambda *values: max(values)),
    "Min": Function(sympy.Min, 1, MAXIMUM_EXTREMA, lambda *values: min(values)),
    "floor": Function(sympy.floor, 1, 1, math.floor),
    "HeldNoise": Function(noise.HeldNoise, 2, 2, noise.held),
    "SmoothNoise": Function(noise.SmoothNoise, 2, 2, noise.smooth),
}
"""The functions of values; Piecewise and Table have forms of their own."""

FUNCTION_NAMES = ", ".join([*FUNCTIONS, "Piecewise", "Table"])
COMPARISONS = {"<": sympy.Lt, "<=": sympy.Le, ">": sympy.Gt, ">=": sympy.Ge, "==": sympy.Eq, "!=": sympy.Ne}

_NUMBER = r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_TOKEN = re.compile(
    rf"[ \t\r\n]*(?:(?P<number>{_NUMBER})|(?P<name>[A-Za-z_][A-Za-z_0-9]*)|(?P<list>\[[^\[\]]*\])"
    r"|(?P<sign>\*\*|<=|>=|==|!=|[-+*/<>(),])|(?P<end>\Z)|(?P<other>(?s:.)))"
)
_LISTED = re.compile(rf"[ \t\r\n]*([+-]?{_NUMBER})[ \t\r\n]*")
_HINTS = {
    "^": "Write a power as x**2.",
    "=": "Compare with == inside Piecewise.",
    "&": "Join conditions with 'and'.",
    "|": "Join conditions with 'or'.",
    "~": "Negate a condition with 'not'.",
    "!": "Write != or 'not'.",
}


def tokens_of(text: str) -> list[Token]:
    """The words of a text, the last of kind "end".

    Raises:
        ModelFileError: the text is too long, or has a character that the grammar has no use for.
    """
    if len(text) > MAXIMUM_LENGTH:
        raise ModelFileError(
            f"the expression of {len(text)} characters is longer than {MAXIMUM_LENGTH}. Use a Table of fewer points."
        )
    tokens: list[Token] = []
    for match in _TOKEN.finditer(text):
        kind = str(match.lastgroup)
        token = Token(kind, match[kind], match.start(kind))
        if kind == "other":
            hint = _HINTS.get(token.text, "Write numbers, names, + - * / ** ( ) , comparisons and Table([...], [...]).")
            fail(text, token, f"contains {token.text!r}, which is not allowed", hint)
        if len(tokens) == MAXIMUM_TOKENS:
            fail(text, token, f"has more than {MAXIMUM_TOKENS} numbers, names and signs", "Use a Table.")
        tokens.append(token)
    return tokens


def listed_numbers(text: str, token: Token) -> list[float]:
    """The numbers of a token of kind "list"."""
    matches = [_LISTED.fullmatch(item) for item in token.text[1:-1].split(",")]
    if None in matches:
        fail(text, token, f"has a list whose item {matches.index(None) + 1} is no number", "Lists hold numbers alone.")
    return [float(match[1]) for match in matches if match]


def finite(number: float) -> float:
    """The number itself; an OverflowError where it is infinite or NaN."""
    if not math.isfinite(number):
        raise OverflowError(number)
    return number


def fault_of(expression: sympy.Basic) -> str | None:
    """Why an expression is beyond the limits, or None where it is not."""
    for node in sympy.preorder_traversal(expression):
        if node in (sympy.nan, sympy.zoo, sympy.oo, -sympy.oo, sympy.I):
            return NOT_REAL
        if isinstance(node, sympy.Rational) and max(abs(node.p), node.q) > MAXIMUM_INTEGER:
            return "leads to an integer beyond 1e40"
        if isinstance(node, sympy.Float) and not (math.isfinite(float(node)) and bool(node) == bool(float(node))):
            return NOT_REAL
        if isinstance(node, sympy.Pow) and node.exp.is_Number and abs(node.exp) > MAXIMUM_EXPONENT:
            return f"has an exponent beyond {MAXIMUM_EXPONENT}"
    return None


def fail(text: str, token: Token, what: str, hint: str) -> NoReturn:
    """Raise the error that shows the place in the text, what is wrong and the next step."""
    start = max(0, token.position - 60)
    shown = "".join(c if c.isprintable() else " " for c in text[start : token.position + 30])
    raise ModelFileError(
        f"the expression {what}, at character {token.position + 1}:\n"
        f"    {shown}\n    {' ' * (token.position - start)}^\n{hint}"
    )
