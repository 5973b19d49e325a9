"""Laws as text: a small closed grammar, read into sympy and written back exactly.

Nothing here hands a text to Python or to sympy's own readers, so a file from a stranger runs no code. Every number is
bounded before it is made, so no text builds a huge one. The grammar is Python's for

    numbers, names of symbols, pi, + - * / **, parentheses, the functions of `FUNCTIONS`,
    comparisons, and, or, not, True, False      as conditions of Piecewise((value, condition), ...)
    Table([x0, x1, ...], [y0, y1, ...])(argument)       without the argument a law of time
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import sympy
from sympy.core.relational import Relational
from sympy.logic.boolalg import BooleanAtom, BooleanFunction

from shaftwork.components.laws import SYMBOLS, Interpolation, Table
from shaftwork.core.errors import ModelFileError, ParameterError

MAXIMUM_LENGTH = 200_000
"""Characters of an expression; long tables take most of them."""
MAXIMUM_TOKENS = 1000
"""Numbers, names and signs of an expression; a list of a table counts as one."""
MAXIMUM_DEPTH = 30
"""Parentheses, functions and exponents inside each other."""
MAXIMUM_INTEGER = 10**40
"""Largest integer, numerator and denominator."""
MAXIMUM_EXPONENT = 1000
"""Largest exponent that is a number."""
MAXIMUM_EXTREMA = 16
"""Arguments of all Max and Min of an expression together: sympy compares each with each."""

Boolean = Relational | BooleanFunction | BooleanAtom


@dataclass(frozen=True)
class _Function:
    """A function of the grammar: its sympy class, its numbers of arguments and its value for numbers."""

    make: Callable[..., sympy.Expr]
    fewest: int
    most: int
    value: Callable[..., float]


def _sign(x: float) -> float:
    return math.copysign(1.0, x) if x else 0.0


def _heaviside(x: float, at_zero: float = 0.5) -> float:
    return at_zero if x == 0 else float(x > 0)


FUNCTIONS: dict[str, _Function] = {
    **{
        name: _Function(getattr(sympy, name), 1, 1, getattr(math, name))
        for name in ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "sqrt")
    },
    "atan2": _Function(sympy.atan2, 2, 2, math.atan2),
    "Abs": _Function(sympy.Abs, 1, 1, abs),
    "sign": _Function(sympy.sign, 1, 1, _sign),
    "Heaviside": _Function(sympy.Heaviside, 1, 2, _heaviside),
    "Max": _Function(sympy.Max, 1, MAXIMUM_EXTREMA, lambda *values: max(values)),
    "Min": _Function(sympy.Min, 1, MAXIMUM_EXTREMA, lambda *values: min(values)),
}
"""The functions of one or more values; Piecewise and Table have forms of their own."""

_FUNCTION_NAMES = ", ".join([*FUNCTIONS, "Piecewise", "Table"])
_COMPARISONS = {"<": sympy.Lt, "<=": sympy.Le, ">": sympy.Gt, ">=": sympy.Ge, "==": sympy.Eq, "!=": sympy.Ne}
_NUMBER = r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_TOKEN = re.compile(
    rf"\s*(?:(?P<number>{_NUMBER})|(?P<name>[A-Za-z_][A-Za-z_0-9]*)|(?P<list>\[[^\[\]]*\])"
    r"|(?P<sign>\*\*|<=|>=|==|!=|[-+*/<>(),])|(?P<end>$))"
)
_SIGNED = re.compile(rf"\s*([+-]?{_NUMBER})\s*")
_HINTS = {
    "^": "Write a power as x**2.",
    "=": "Compare with == inside Piecewise.",
    "&": "Join conditions with 'and'.",
    "|": "Join conditions with 'or'.",
    "~": "Negate a condition with 'not'.",
    "!": "Write != or 'not'.",
    "%": "There is no remainder; write it with a Table or Piecewise.",
}


@dataclass(frozen=True)
class _Token:
    kind: str
    text: str
    position: int


@dataclass(frozen=True)
class _Node:
    """What has been read: the expression, and its value where it contains no symbols."""

    expression: Any
    value: float | None = None


def parse(text: str, symbols: Iterable[sympy.Symbol] = SYMBOLS) -> sympy.Expr:
    """The sympy expression that a text of the grammar means.

    Args:
        text: one expression, for example "-22.4*tanh(omega/0.01)".
        symbols: the symbols that it may contain.

    Raises:
        ModelFileError: the text is not of the grammar or exceeds a limit of this module; the message has the place,
            what is allowed there, and the next step.
    """
    if len(text) > MAXIMUM_LENGTH:
        raise ModelFileError(
            f"an expression of {len(text)} characters is longer than {MAXIMUM_LENGTH}. Use a Table with fewer points."
        )
    return _Parser(text, {symbol.name: symbol for symbol in symbols}).read()


class _Parser:
    """Recursive descent over the tokens of one text; sums and products are made at once, as sympy keeps them."""

    def __init__(self, text: str, symbols: dict[str, sympy.Symbol]) -> None:
        self.text = text
        self.symbols = symbols
        self.tokens = self.split()
        self.index = 0
        self.depth = 0
        self.extrema = 0

    def read(self) -> sympy.Expr:
        if self.now.kind == "end":
            self.fail(self.now, "is empty", "Write a number or an expression.")
        first, node = self.now, self.condition()
        if self.now.kind != "end":
            self.fail(self.now, f"does not go on with {self.now.text!r}", "Write an operator between two values, as 2*t.")
        return self.number(first, node).expression

    # --- tokens ------------------------------------------------------------------------------------------------

    def split(self) -> list[_Token]:
        tokens: list[_Token] = []
        position = 0
        while not tokens or tokens[-1].kind != "end":
            match = _TOKEN.match(self.text, position)
            if match is None:
                place = position + len(self.text[position:]) - len(self.text[position:].lstrip())
                character = self.text[place]
                hint = _HINTS.get(character, "Numbers, names, + - * / ** ( ) , comparisons and [...] of Table are.")
                self.fail(_Token("", character, place), f"contains {character!r}, which is not allowed", hint)
            kind = str(match.lastgroup)
            tokens.append(_Token(kind, match[kind], match.start(kind)))
            position = match.end()
            if len(tokens) > MAXIMUM_TOKENS:
                self.fail(tokens[-1], f"has more than {MAXIMUM_TOKENS} numbers, names and signs", "Use a Table.")
        return tokens

    @property
    def now(self) -> _Token:
        return self.tokens[self.index]

    def take(self, *texts: str) -> _Token | None:
        """The token, and one step on, if it is one of the given signs or words."""
        token = self.now
        if token.text not in texts or token.kind not in ("sign", "name"):
            return None
        self.index += 1
        return token

    def need(self, text: str, where: str) -> None:
        if self.take(text) is None:
            found = f"not {self.now.text!r}" if self.now.text else "but the expression ends"
            self.fail(self.now, f"needs {text!r} {where}, {found}", "Check the parentheses and commas.")

    def fail(self, token: _Token, what: str, hint: str) -> NoReturn:
        start = max(0, token.position - 60)
        line = re.sub(r"\s", " ", self.text[start : token.position + 30])
        raise ModelFileError(
            f"the expression {what}, at character {token.position + 1}:\n"
            f"    {line}\n    {' ' * (token.position - start)}^\n{hint}"
        )

    # --- grammar, from the weakest binding to the strongest -------------------------------------------------------

    def condition(self) -> _Node:
        return self.joined("or", sympy.Or, lambda: self.joined("and", sympy.And, self.negation))

    def joined(self, word: str, make: Callable[..., Any], part: Callable[[], _Node]) -> _Node:
        first, node = self.now, part()
        if self.now.text != word:
            return node
        parts = [self.boolean(first, node)]
        while self.take(word):
            first = self.now
            parts.append(self.boolean(first, part()))
        return self.made(first, make, [_Node(part) for part in parts])

    def negation(self) -> _Node:
        word = self.take("not")
        if word is None:
            return self.comparison()
        with _Depth(self, word):
            operand = self.boolean(self.now, self.negation())
        return self.made(word, sympy.Not, [_Node(operand)])

    def comparison(self) -> _Node:
        first, left = self.now, self.sum()
        sign = self.take(*_COMPARISONS)
        if sign is None:
            return left
        right = self.number(self.now, self.sum())
        if self.now.text in _COMPARISONS:
            self.fail(self.now, "compares twice", "Write (0 < t) and (t < 1).")
        return self.made(sign, _COMPARISONS[sign.text], [self.number(first, left), right])

    def sum(self) -> _Node:
        first, node = self.now, self.product()
        terms = [node]
        while sign := self.take("+", "-"):
            self.number(first, node)
            first = self.now
            terms.append(self.number(first, self.product(negative=sign.text == "-")))
        return node if len(terms) == 1 else self.made(first, sympy.Add, terms, lambda *values: math.fsum(values))

    def product(self, *, negative: bool = False) -> _Node:
        first = self.now
        factors = [_Node(sympy.S.NegativeOne, -1.0)] if negative else []
        divides = False
        while True:
            while sign := self.take("+", "-"):
                if sign.text == "-":
                    factors.append(_Node(sympy.S.NegativeOne, -1.0))
            token, node = self.now, self.power()
            factors.append(self.power_of(token, node, _Node(sympy.S.NegativeOne, -1.0)) if divides else node)
            operator = self.take("*", "/")
            if operator is None:
                break
            divides = operator.text == "/"
        if len(factors) == 1:
            return factors[0]
        return self.made(first, sympy.Mul, [self.number(first, factor) for factor in factors], _product)

    def power(self) -> _Node:
        first, base = self.now, self.atom()
        sign = self.take("**")
        if sign is None:
            return base
        with _Depth(self, sign):
            negative = False
            while minus := self.take("+", "-"):
                negative ^= minus.text == "-"
            exponent = self.number(self.now, self.power())
        if negative:
            exponent = self.made(sign, sympy.Mul, [_Node(sympy.S.NegativeOne, -1.0), exponent], _product)
        return self.power_of(sign, self.number(first, base), exponent)

    def power_of(self, token: _Token, base: _Node, exponent: _Node) -> _Node:
        self.number(token, base)
        if exponent.value is not None:
            size = abs(exponent.value)
            bits = _bits(base.expression.as_coeff_Mul()[0])
            if size > MAXIMUM_EXPONENT or bits * size > 8 * MAXIMUM_INTEGER.bit_length():
                self.fail(token, "has a power that is too large", f"Exponents reach {MAXIMUM_EXPONENT}; write 1e6 as such.")
        return self.made(token, sympy.Pow, [base, exponent], math.pow)

    def atom(self) -> _Node:
        token = self.now
        self.index += token.kind != "end"
        if token.kind == "number":
            return self.literal(token)
        if token.kind == "name":
            return self.call(token) if self.now.text == "(" and token.text not in ("and", "or") else self.name(token)
        if token.text == "(":
            with _Depth(self, token):
                node = self.condition()
            self.need(")", "to close a parenthesis")
            return node
        found = f"not {token.text[:20]!r}" if token.text else "but the expression ends"
        return self.fail(token, f"needs a value here, {found}", "Write a number, a name, a function or a parenthesis.")

    def literal(self, token: _Token) -> _Node:
        value = float(token.text)
        exact = token.text.isdigit()
        if not math.isfinite(value) or (exact and value >= MAXIMUM_INTEGER):
            self.fail(token, "has a number that is too large", "Integers reach 1e40, others 1.7e308.")
        return _Node(sympy.Integer(int(token.text)) if exact else sympy.Float(value), value)

    def name(self, token: _Token) -> _Node:
        if token.text in self.symbols:
            return _Node(self.symbols[token.text])
        if token.text == "pi":
            return _Node(sympy.pi, math.pi)
        if token.text in ("True", "False"):
            return _Node(sympy.true if token.text == "True" else sympy.false)
        if token.text in FUNCTIONS or token.text in ("Piecewise", "Table"):
            self.fail(token, f"uses the function {token.text} without arguments", f"Write {token.text}(...).")
        known = ", ".join([*self.symbols, "pi"])
        return self.fail(token, f"contains the unknown name {token.text[:40]!r}", f"Names here: {known}.")

    def call(self, name: _Token) -> _Node:
        if name.text in self.symbols or name.text == "pi":
            self.fail(name, f"calls {name.text}, which is no function", f"Multiply with {name.text}*(...).")
        read = {"Piecewise": self.piecewise, "Table": self.table}.get(name.text)
        if read is None and name.text not in FUNCTIONS:
            self.fail(name, f"contains the unknown function {name.text[:40]!r}", f"Functions: {_FUNCTION_NAMES}.")
        self.need("(", f"after {name.text}")
        with _Depth(self, name):
            return read(name) if read else self.function(name, FUNCTIONS[name.text])

    def function(self, name: _Token, function: _Function) -> _Node:
        arguments = self.arguments(lambda: self.number(self.now, self.condition()))
        if not function.fewest <= len(arguments) <= function.most:
            numbers = " to ".join(str(number) for number in dict.fromkeys((function.fewest, function.most)))
            self.fail(name, f"gives {name.text} {len(arguments)} arguments", f"It takes {numbers}.")
        if name.text in ("Max", "Min"):
            self.extrema += len(arguments)
            if self.extrema > MAXIMUM_EXTREMA:
                self.fail(name, f"gives Max and Min more than {MAXIMUM_EXTREMA} arguments", "Use a Table or Piecewise.")
        return self.made(name, function.make, arguments, function.value)

    def arguments(self, read: Callable[[], Any]) -> list[Any]:
        found = [read()]
        while self.take(","):
            found.append(read())
        self.need(")", "after the last argument")
        return found

    def piecewise(self, name: _Token) -> _Node:
        pairs = self.arguments(self.pair)
        node = self.made(name, lambda *pairs: sympy.Piecewise(*pairs), [_Node((v.expression, c)) for v, c in pairs])
        values = (value.value for value, _ in pairs if value.expression == node.expression)
        return _Node(node.expression, next(values, node.value))

    def pair(self) -> tuple[_Node, Any]:
        self.need("(", "to open a pair (value, condition) of Piecewise")
        value = self.number(self.now, self.condition())
        self.need(",", "between value and condition of Piecewise")
        condition = self.boolean(self.now, self.condition())
        self.need(")", "to close a pair (value, condition) of Piecewise")
        return value, condition

    def table(self, name: _Token) -> _Node:
        columns = self.arguments(self.column)
        if len(columns) != 2:
            self.fail(name, f"gives Table {len(columns)} lists", "Write Table([x0, x1], [y0, y1]).")
        try:
            table = Table(*columns)
        except ParameterError as error:
            self.fail(name, f"has a wrong table: {error}", "Correct its lists.")
        if not self.take("("):
            return self.made(name, table, [_Node(self.symbols.get("t", sympy.S.Zero))])
        argument = self.number(self.now, self.condition())
        self.need(")", "after the argument of Table")
        return self.made(name, table, [argument])

    def column(self) -> list[float]:
        token = self.now
        if token.kind != "list":
            self.fail(token, "needs a list of numbers in Table", "Write Table([x0, x1], [y0, y1]).")
        self.index += 1
        matches = [_SIGNED.fullmatch(item) for item in token.text[1:-1].split(",")]
        if None in matches:
            self.fail(token, f"has a wrong number {matches.index(None) + 1} in a list", "Lists hold numbers alone.")
        return [float(match[1]) for match in matches if match]

    # --- checks --------------------------------------------------------------------------------------------------

    def number(self, token: _Token, node: _Node) -> _Node:
        if isinstance(node.expression, Boolean):
            self.fail(token, "has a condition where a value is needed", "Write Piecewise((1, condition), (0, True)).")
        return node

    def boolean(self, token: _Token, node: _Node) -> Any:
        if not isinstance(node.expression, Boolean):
            self.fail(token, "has a value where a condition is needed", "Compare it, as omega > 0.")
        return node.expression

    def made(
        self, token: _Token, make: Callable[..., Any], parts: Sequence[_Node], value: Callable[..., float] | None = None
    ) -> _Node:
        """The expression of its parts; computed with plain floats first, so that nothing huge or imaginary is built."""
        numbers = [part.value for part in parts if part.value is not None]
        number: float | None = None
        try:
            if value is not None and len(numbers) == len(parts):
                number = value(*numbers)
            if number is not None and not math.isfinite(number):
                raise OverflowError
            expression = make(*(part.expression for part in parts))
            fault = _fault(expression)
        except (ArithmeticError, ValueError, TypeError):
            fault = "has a part without a finite real value"
        if fault:
            self.fail(token, fault, "Change that part; nothing may divide by zero or overflow.")
        if expression.is_Number:
            return _Node(expression, float(expression))
        if number is None and isinstance(expression, sympy.Expr) and not expression.free_symbols:
            number = next((part.value for part in parts if part.expression == expression), None)
            if number is None and not isinstance(parts[0].expression, tuple):
                self.fail(token, "has symbols that cancel", f"Write {str(expression)[:40]} in their place.")
        return _Node(expression, number)


class _Depth:
    """One level of nesting, while a part is read."""

    def __init__(self, parser: _Parser, token: _Token) -> None:
        self.parser, self.token = parser, token

    def __enter__(self) -> None:
        self.parser.depth += 1
        if self.parser.depth > MAXIMUM_DEPTH:
            self.parser.fail(self.token, f"is nested deeper than {MAXIMUM_DEPTH}", "Use fewer parentheses.")

    def __exit__(self, *_: object) -> None:
        self.parser.depth -= 1
