"""Laws as text: words, functions and limits of the grammar, and the message that points at a fault."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, NoReturn

import sympy
from sympy.core.relational import Relational
from sympy.logic.boolalg import BooleanAtom, BooleanFunction

from shaftwork.components import noise
from shaftwork.core.errors import ModelFileError


class Limits(NamedTuple):
    """What laws as text may ask for: without them a short text could take hours or all memory to read.

    Args:
        length: characters of an expression; long tables take most of them.
        words: numbers, names and signs of an expression; a list of a table counts as one.
        depth: parentheses, functions and exponents inside each other.
        digits: characters of a number as it is written.
        integer: largest integer, numerator and denominator, also of intermediate results.
        exponent: largest exponent that is a number.
        tower: powers in an exponent without symbols: sympy takes four times as long for each to find how large it is.
        extrema: arguments of all Max and Min of an expression together: sympy compares each with each.
        file_words: words of all laws of a file together, some 400 laws.
    """

    length: int = 200_000
    words: int = 1000
    depth: int = 30
    digits: int = 60
    integer: int = 10**40
    exponent: int = 1000
    tower: int = 4
    extrema: int = 16
    file_words: int = 4000


LIMITS = Limits()
NOT_REAL = "has a part without a finite real value"

Boolean = Relational | BooleanFunction | BooleanAtom


@dataclass(frozen=True)
class Function:
    """A function of the grammar: its sympy class, its numbers of arguments and its value for numbers."""

    make: Callable[..., sympy.Expr]
    fewest: int
    most: int
    value: Callable[..., float]


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
    "Max": Function(sympy.Max, 1, LIMITS.extrema, lambda *values: max(values)),
    "Min": Function(sympy.Min, 1, LIMITS.extrema, lambda *values: min(values)),
    "floor": Function(sympy.floor, 1, 1, math.floor),
    "HeldNoise": Function(noise.HeldNoise, 2, 2, noise.held),
    "SmoothNoise": Function(noise.SmoothNoise, 2, 2, noise.smooth),
}
"""The functions of values; Piecewise and Table have forms of their own."""

FUNCTION_NAMES = ", ".join([*FUNCTIONS, "Piecewise", "Table"])
COMPARISONS = {"<": sympy.Lt, "<=": sympy.Le, ">": sympy.Gt, ">=": sympy.Ge, "==": sympy.Eq, "!=": sympy.Ne}

_NUMBER = r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
SIGNED_NUMBER = re.compile(rf"[+-]?{_NUMBER}")
"""An item of a list of a table."""
_WORD = re.compile(
    r"\s*(?:(?P<sign>\*\*|<=|>=|==|!=|[-+*/<>(),]|(?<![0-9.])(?:and|or|not)\b)"
    rf"|(?P<value>{_NUMBER}|[A-Za-z_]\w*|\[[\w\s.,=!<>()*/+-]*\])"
    r"|(?P<end>\Z)|(?P<other>(?s:.)))",
    re.ASCII,
)
_PREFIXES = ("(", "+", "-", "not")
"""Signs that begin a value."""
_HINTS = {
    "^": "Write a power as x**2.",
    "=": "Compare with == inside Piecewise.",
    "&": "Join conditions with 'and'.",
    "|": "Join conditions with 'or'.",
    "~": "Negate a condition with 'not'.",
    "!": "Write != or 'not'.",
}
ALLOWED = "Write numbers, names, + - * / ** ( ) , comparisons and Table([...], [...])."


def tokens_of(text: str) -> list[str]:
    """The numbers, names, lists and signs of a text, in an order that an expression can have.

    Raises:
        ModelFileError: the text is beyond a limit, has a character that the grammar has no use for, or lacks a value, a
            sign or a parenthesis.
    """
    if len(text) > LIMITS.length:
        raise ModelFileError(
            f"the expression of {len(text)} characters is longer than {LIMITS.length}. Use a Table of fewer points."
        )
    matches = list(_WORD.finditer(text))
    if other := next((match for match in matches if match["other"]), None):
        word = other["other"]
        fail(text, other.start("other"), f"contains {word!r}, which is not allowed", _HINTS.get(word, ALLOWED))
    words: list[str] = []
    depth, follows_value = 0, False
    for match in matches:
        kind = str(match.lastgroup)
        word, place, ends = match[kind], match.start(kind), kind == "end"
        shown = "but the expression ends" if ends else f"not {word[:20]!r}"
        if ends and not words:
            fail(text, place, "is empty", "Write a number or an expression.")
        if len(words) == LIMITS.words:
            fail(text, place, f"has more than {LIMITS.words} numbers, names and signs", "Use a Table.")
        if len(word) > LIMITS.digits and word[0] in "0123456789.":
            fail(text, place, f"has a number of more than {LIMITS.digits} characters", "17 digits are enough.")
        if follows_value and (kind == "value" or word == "not" or (word == ")" and not depth)):
            fail(text, place, f"does not go on with {word[:20]!r}", "Write an operator between two values.")
        if not follows_value and kind != "value" and word not in _PREFIXES:
            fail(text, place, f"needs a value here, {shown}", "Write a number, a name, a function or a parenthesis.")
        depth += (word == "(") - (word == ")")
        if depth > LIMITS.depth:
            fail(text, place, f"is nested deeper than {LIMITS.depth}", "Use fewer parentheses.")
        if ends and depth:
            fail(text, place, f"needs ')' to close a parenthesis, {shown}", "Check the parentheses and commas.")
        follows_value = kind == "value" or word == ")"
        words.append(word)
    return words


def fault_of(expression: sympy.Basic) -> str | None:
    """Why an expression is beyond the limits, or None where it is not."""
    for node in sympy.preorder_traversal(expression):
        if node in (sympy.nan, sympy.zoo, sympy.oo, -sympy.oo, sympy.I):
            return NOT_REAL
        if isinstance(node, sympy.Rational) and max(abs(node.p), node.q) > LIMITS.integer:
            return "leads to an integer beyond 1e40"
        if isinstance(node, sympy.Float) and not (math.isfinite(float(node)) and bool(node) == bool(float(node))):
            return NOT_REAL
        if isinstance(node, sympy.Pow) and node.exp.is_Number and abs(node.exp) > LIMITS.exponent:
            return f"has an exponent beyond {LIMITS.exponent}"
    return None


def fail(text: str, place: int, what: str, hint: str) -> NoReturn:
    """Raise the error that shows a place in the text, counted from 0, what is wrong and the next step."""
    start = max(0, place - 60)
    shown = "".join(c if c.isprintable() else " " for c in text[start : place + 30])
    raise ModelFileError(
        f"the expression {what}, at character {place + 1}:\n    {shown}\n    {' ' * (place - start)}^\n{hint}"
    )
