"""Laws from text: a small closed grammar, read into sympy.

Nothing here hands a text to Python or to sympy's own readers, so a file from a stranger runs no code. Every number is
bounded before it is made, so no text builds a huge one. The grammar is Python's for

    numbers, names of symbols, pi, + - * / **, parentheses, the functions of `grammar.FUNCTIONS`,
    comparisons, and, or, not, True, False      as conditions of Piecewise((value, condition), ...)
    Table([x0, x1, ...], [y0, y1, ...])(argument)       without the argument a law of time
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, NoReturn

import sympy

from shaftwork.components.laws import SYMBOLS, as_expression
from shaftwork.components.tables import Table
from shaftwork.core.errors import ParameterError
from shaftwork.network.grammar import (
    COMPARISONS,
    FUNCTION_NAMES,
    FUNCTIONS,
    MAXIMUM_DEPTH,
    MAXIMUM_DIGITS,
    MAXIMUM_EXTREMA,
    MAXIMUM_INTEGER,
    MAXIMUM_TOWER,
    NOT_REAL,
    Boolean,
    Function,
    Token,
    fail,
    fault_of,
    finite,
    listed_numbers,
    tokens_of,
)


@dataclass(frozen=True)
class _Node:
    """What has been read: the expression, and its value where it contains no symbols."""

    expression: Any
    value: float | None = None


_MINUS_ONE = _Node(sympy.S.NegativeOne, -1.0)


def parse(text: str, symbols: Iterable[sympy.Symbol] = SYMBOLS) -> sympy.Expr:
    """The sympy expression that a text of the grammar means.

    Args:
        text: one expression, for example "-22.4*tanh(omega/0.01)".
        symbols: the symbols that it may contain.

    Raises:
        ModelFileError: the text is not of the grammar, or exceeds a limit of `grammar`; the message has the place,
            what is allowed there, and the next step.
    """
    return _Parser(text, symbols).read()


class _Parser:
    """Recursive descent over the tokens of one text; sums and products are made at once, as sympy keeps them."""

    def __init__(self, text: str, symbols: Iterable[sympy.Symbol]) -> None:
        self.text = text
        self.symbols = {symbol.name: symbol for symbol in symbols}
        self.tokens = tokens_of(text)
        self.index = 0
        self.depth = 0
        self.extrema = 0

    def read(self) -> sympy.Expr:
        if self.now.kind == "end":
            self.fail(self.now, "is empty", "Write a number or an expression.")
        node = self.value()
        if self.now.kind != "end":
            self.fail(self.now, f"does not go on with {self.now.text[:20]!r}", "Write an operator between two values.")
        expression = _settled(node.expression)
        if fault := fault_of(expression):
            self.fail(self.tokens[0], fault, "Simplify the expression.")
        return expression

    # --- tokens ---------------------------------------------------------------------------------------------------

    @property
    def now(self) -> Token:
        return self.tokens[self.index]

    def take(self, *texts: str) -> Token | None:
        """The token, and one step on, if it is one of the given signs or words."""
        token = self.now
        if token.text not in texts:
            return None
        self.index += 1
        return token

    def need(self, text: str, where: str) -> None:
        if self.take(text) is None:
            found = f"not {self.now.text[:20]!r}" if self.now.text else "but the expression ends"
            self.fail(self.now, f"needs {text!r} {where}, {found}", "Check the parentheses and commas.")

    def fail(self, token: Token, what: str, hint: str) -> NoReturn:
        fail(self.text, token, what, hint)

    @contextmanager
    def deeper(self, token: Token) -> Iterator[None]:
        self.depth += 1
        if self.depth > MAXIMUM_DEPTH:
            self.fail(token, f"is nested deeper than {MAXIMUM_DEPTH}", "Use fewer parentheses.")
        yield
        self.depth -= 1

    # --- grammar, from the weakest binding to the strongest -------------------------------------------------------

    def value(self) -> _Node:
        token = self.now
        return self.number(token, self.any())

    def condition(self) -> Any:
        token = self.now
        return self.boolean(token, self.any())

    def any(self) -> _Node:
        return self.joined("or", sympy.Or, lambda: self.joined("and", sympy.And, self.negation))

    def joined(self, word: str, make: Callable[..., Any], part: Callable[[], _Node]) -> _Node:
        first, node = self.now, part()
        if self.now.text != word:
            return node
        parts = [self.boolean(first, node)]
        while self.take(word):
            token = self.now
            parts.append(self.boolean(token, part()))
        return self.made(first, make, [_Node(part) for part in parts])

    def negation(self) -> _Node:
        word = self.take("not")
        if word is None:
            return self.comparison()
        with self.deeper(word):
            token = self.now
            operand = self.boolean(token, self.negation())
        return self.made(word, sympy.Not, [_Node(operand)])

    def comparison(self) -> _Node:
        first, left = self.now, self.sum()
        sign = self.take(*COMPARISONS)
        if sign is None:
            return left
        token = self.now
        right = self.number(token, self.sum())
        if self.now.text in COMPARISONS:
            self.fail(self.now, "compares twice", "Write (0 < t) and (t < 1).")
        if left.expression.has(sympy.Piecewise) or right.expression.has(sympy.Piecewise):
            self.fail(sign, "compares a Piecewise", "Write its cases as conditions joined by 'and' and 'or'.")
        return self.made(sign, COMPARISONS[sign.text], [self.number(first, left), right])

    def sum(self) -> _Node:
        first, node = self.now, self.product()
        terms = [node]
        while sign := self.take("+", "-"):
            token = self.now
            terms.append(self.number(token, self.product(negative=sign.text == "-")))
        if len(terms) == 1:
            return node
        self.number(first, node)
        return self.made(first, sympy.Add, terms, lambda *values: math.fsum(values))

    def product(self, *, negative: bool = False) -> _Node:
        first = self.now
        factors = [_MINUS_ONE] if negative else []
        divides = False
        while True:
            while sign := self.take("+", "-"):
                factors += [_MINUS_ONE] if sign.text == "-" else []
            token, node = self.now, self.power()
            factors.append(self.raised(token, node, _MINUS_ONE) if divides else node)
            operator = self.take("*", "/")
            if operator is None:
                break
            divides = operator.text == "/"
        if len(factors) == 1:
            return factors[0]
        numbers = [self.number(first, factor) for factor in factors]
        return self.made(first, sympy.Mul, numbers, lambda *values: math.prod(values))

    def power(self) -> _Node:
        first, base = self.now, self.atom()
        sign = self.take("**")
        if sign is None:
            return base
        with self.deeper(sign):
            negative = False
            while minus := self.take("+", "-"):
                negative ^= minus.text == "-"
            token = self.now
            exponent = self.number(token, self.power())
        if negative:
            exponent = self.made(sign, sympy.Mul, [_MINUS_ONE, exponent], lambda *values: math.prod(values))
        return self.raised(sign, self.number(first, base), exponent)

    def raised(self, token: Token, base: _Node, exponent: _Node) -> _Node:
        if exponent.value is not None and exponent.expression.count(sympy.Pow) > MAXIMUM_TOWER:
            self.fail(token, f"has more than {MAXIMUM_TOWER} powers of numbers in an exponent", "Write its number.")
        coefficient = self.number(token, base).expression.as_coeff_Mul()[0]
        if exponent.value is not None and coefficient.is_Rational:
            size = (max(abs(coefficient.p), coefficient.q) - 1).bit_length() * abs(exponent.value)
            if size > 4 * MAXIMUM_INTEGER.bit_length():
                self.fail(token, "has a power that is too large", "Integers reach 1e40; write 10.0**50 as 1e50.")
        return self.made(token, sympy.Pow, [base, exponent], math.pow)

    def atom(self) -> _Node:
        token = self.now
        self.index += token.kind != "end"
        if token.kind == "number":
            return self.literal(token)
        if token.kind == "name":
            return self.call(token) if self.take("(") else self.name(token)
        if token.text == "(":
            with self.deeper(token):
                node = self.any()
            self.need(")", "to close a parenthesis")
            return node
        found = f"not {token.text[:20]!r}" if token.text else "but the expression ends"
        return self.fail(token, f"needs a value here, {found}", "Write a number, a name, a function or a parenthesis.")

    def literal(self, token: Token) -> _Node:
        if len(token.text) > MAXIMUM_DIGITS:
            self.fail(token, f"has a number of more than {MAXIMUM_DIGITS} characters", "17 digits are enough.")
        value, exact = float(token.text), token.text.isdigit()
        if not math.isfinite(value) or (exact and int(token.text) > MAXIMUM_INTEGER):
            self.fail(token, "has a number that is too large", "Integers reach 1e40, numbers with a point 1.7e308.")
        return _Node(sympy.Integer(int(token.text)) if exact else sympy.Float(value), value)

    def name(self, token: Token) -> _Node:
        if token.text in self.symbols:
            return _Node(self.symbols[token.text])
        if token.text == "pi":
            return _Node(sympy.pi, math.pi)
        if token.text in ("True", "False"):
            return _Node(sympy.true if token.text == "True" else sympy.false)
        if token.text in (*FUNCTIONS, "Piecewise", "Table"):
            self.fail(token, f"uses the function {token.text} without arguments", f"Write {token.text}(...).")
        known = ", ".join([*self.symbols, "pi"])
        return self.fail(token, f"contains the unknown name {token.text[:40]!r}", f"Names here: {known}.")

    def call(self, name: Token) -> _Node:
        if name.text in (*self.symbols, "pi"):
            self.fail(name, f"calls {name.text}, which is no function", f"Multiply: {name.text}*(...).")
        if name.text not in (*FUNCTIONS, "Piecewise", "Table"):
            self.fail(name, f"contains the unknown function {name.text[:40]!r}", f"Functions: {FUNCTION_NAMES}.")
        with self.deeper(name):
            match name.text:
                case "Piecewise":
                    return self.piecewise(name)
                case "Table":
                    return self.table(name)
            return self.function(name, FUNCTIONS[name.text])

    def arguments(self, read: Callable[[], Any]) -> list[Any]:
        found = [read()]
        while self.take(","):
            found.append(read())
        self.need(")", "after the last argument")
        return found

    def function(self, name: Token, function: Function) -> _Node:
        arguments = self.arguments(self.value)
        if not function.fewest <= len(arguments) <= function.most:
            numbers = " to ".join(str(number) for number in dict.fromkeys((function.fewest, function.most)))
            self.fail(name, f"gives {name.text} {len(arguments)} arguments", f"It takes {numbers}.")
        self.extrema += len(arguments) if name.text in ("Max", "Min") else 0
        if self.extrema > MAXIMUM_EXTREMA:
            self.fail(name, f"gives Max and Min more than {MAXIMUM_EXTREMA} arguments", "Use a Table or Piecewise.")
        return self.made(name, function.make, arguments, function.value)

    def piecewise(self, name: Token) -> _Node:
        pairs = self.arguments(self.pair)
        conditions = [condition for _, condition in pairs]
        return self.made(
            name,
            lambda *values: sympy.Piecewise(*zip(values, conditions, strict=True)),
            [value for value, _ in pairs],
        )

    def pair(self) -> tuple[_Node, Any]:
        self.need("(", "to open a pair (value, condition) of Piecewise")
        value = self.value()
        self.need(",", "between value and condition of Piecewise")
        condition = self.condition()
        self.need(")", "to close a pair (value, condition) of Piecewise")
        return value, condition

    def table(self, name: Token) -> _Node:
        columns = self.arguments(self.column)
        try:
            table = Table(*columns)
        except (ParameterError, TypeError) as error:
            self.fail(name, f"has a wrong table ({error})", "Write Table([x0, x1, ...], [y0, y1, ...]).")
        if not self.take("("):
            return _Node(as_expression(table))
        argument = self.value()
        self.need(")", "after the argument of Table")
        return self.made(name, table, [argument])

    def column(self) -> list[float]:
        token = self.now
        if token.kind != "list":
            self.fail(token, "needs a list of numbers in Table", "Write Table([x0, x1, ...], [y0, y1, ...]).")
        self.index += 1
        return listed_numbers(self.text, token)

    # --- checks ---------------------------------------------------------------------------------------------------

    def number(self, token: Token, node: _Node) -> _Node:
        if isinstance(node.expression, Boolean):
            self.fail(token, "has a condition where a value is needed", "Write Piecewise((1, condition), (0, True)).")
        return node

    def boolean(self, token: Token, node: _Node) -> Any:
        if not isinstance(node.expression, Boolean):
            self.fail(token, "has a value where a condition is needed", "Compare it, as omega > 0.")
        return node.expression

    def made(
        self, token: Token, make: Callable[..., Any], parts: Sequence[_Node], value: Callable[..., float] | None = None
    ) -> _Node:
        """The expression of its parts; computed with plain floats first, so that nothing huge or imaginary is built."""
        number: float | None = None
        try:
            if value is not None and (numbers := [part.value for part in parts if part.value is not None]):
                number = finite(value(*numbers)) if len(numbers) == len(parts) else None
            expression = make(*(part.expression for part in parts))
            fault = fault_of(expression)
        except (ArithmeticError, ValueError, TypeError):
            fault = NOT_REAL
        if fault is not None:
            self.fail(token, fault, "Change that part; it may not overflow, divide by zero or be imaginary.")
        if expression.is_Number:
            return _Node(expression, float(expression))
        if number is None and isinstance(expression, sympy.Expr) and not expression.free_symbols:
            number = next((part.value for part in parts if part.expression == expression), None)
            if number is None:
                self.fail(token, "has symbols that cancel", "Write the number that remains.")
        return _Node(expression, number)


def _settled(expression: sympy.Basic) -> sympy.Expr:
    """The form that no longer changes when it is built again, as it will be when it is written and read."""
    for _ in range(4):
        again = _rebuilt(expression)
        if again == expression:
            break
        expression = again
    return expression


def _rebuilt(expression: sympy.Basic) -> sympy.Basic:
    return expression.func(*map(_rebuilt, expression.args)) if expression.args else expression
