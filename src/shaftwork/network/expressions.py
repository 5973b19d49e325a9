"""Laws from text: Python's parser makes a tree of the text, and the nodes of the grammar become sympy.

Nothing of a text is run, and sympy's own readers never see it: the tree is plain data, and a node, a name or a function
that is not listed is refused. Every number is bounded before it is made, so no text builds a huge one.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple, NoReturn

import sympy

from shaftwork.components.laws import SYMBOLS, as_expression
from shaftwork.components.tables import Table
from shaftwork.core.errors import ParameterError
from shaftwork.network.grammar import (
    ALLOWED,
    COMPARISONS,
    FUNCTION_NAMES,
    FUNCTIONS,
    LIMITS,
    NOT_REAL,
    SIGNED_NUMBER,
    Boolean,
    fail,
    fault_of,
    tokens_of,
)

_SIGNS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
_LIST = re.compile(r"\[[^]]*\]")
"""The numbers of a list are read from the text: of long tables a tree would take a second."""
_BEFORE_OPERATOR = re.compile(r"[ )]*")


class _Parsed(NamedTuple):
    """An expression, and its value where it contains no symbols."""

    expression: Any
    value: float | None = None


_MINUS_ONE = _Parsed(sympy.S.NegativeOne, -1.0)


def parse(text: str, symbols: Iterable[sympy.Symbol] = SYMBOLS) -> sympy.Expr:
    """The sympy expression that a text of the grammar means.

    Args:
        text: one expression, for example "-22.4*tanh(omega/0.01)".
        symbols: the symbols that it may contain.

    Raises:
        ModelFileError: the text is not of the grammar, or exceeds a limit of `grammar`; the message has the place,
            what is allowed there, and the next step.
    """
    tokens_of(text)  # refuses most that is wrong, in plain words
    reader = _LawReader(re.sub(r"\s", " ", text).strip(), symbols)
    try:
        return reader.read()
    except (RecursionError, MemoryError):
        return reader.fail(0, f"is nested deeper than {LIMITS.depth}", "Use fewer signs in a row.")


class _LawReader:
    """Goes through the tree of one text; all terms of a sum, and all factors of a product, are joined at once."""

    def __init__(self, text: str, symbols: Iterable[sympy.Symbol]) -> None:
        self.text, self.symbols = text, {symbol.name: symbol for symbol in symbols}
        self.towers = self.extrema = 0

    def read(self) -> sympy.Expr:
        try:
            tree = ast.parse(_LIST.sub(lambda match: f"[{' ' * (len(match[0]) - 2)}]", self.text), mode="eval").body
        except SyntaxError as error:
            self.fail((error.offset or 1) - 1, f"cannot be read from here on ({error.msg})", ALLOWED)
        expression = _settled(self.value(tree).expression)
        if fault := fault_of(expression):
            self.fail(tree, fault, "Simplify the expression.")
        return expression

    def fail(self, place: ast.expr | int, what: str, hint: str) -> NoReturn:
        fail(self.text, place if isinstance(place, int) else place.col_offset, what, hint)

    def behind(self, node: ast.expr) -> int:
        """Where the operator behind a node stands."""
        match = _BEFORE_OPERATOR.match(self.text, node.end_col_offset or 0)
        return match.end() if match else 0

    def value(self, node: ast.expr) -> _Parsed:
        term = self.term(node)
        if isinstance(term.expression, Boolean):
            self.fail(node, "has a condition where a value is needed", "Write Piecewise((1, condition), (0, True)).")
        return term

    def condition(self, node: ast.expr) -> _Parsed:
        term = self.term(node)
        if not isinstance(term.expression, Boolean):
            self.fail(node, "has a value where a condition is needed", "Compare it, as omega > 0.")
        return term

    def term(self, node: ast.expr) -> _Parsed:
        match node:
            case ast.Constant(value=int() | float() as value):
                return self.literal(node, value)
            case ast.Name(id=name):
                return self.name(node, name)
            case ast.Call(keywords=[]):
                return self.call(node)
            case ast.BinOp(op=ast.Add() | ast.Sub()):
                return self.made(node, sympy.Add, self.terms(node), lambda *values: math.fsum(values))
            case ast.BinOp(op=ast.Mult() | ast.Div()) | ast.UnaryOp(op=ast.UAdd() | ast.USub()):
                return self.product(node, self.factors(node))
            case ast.BinOp(op=ast.Pow()):
                return self.power(node)
            case ast.UnaryOp(op=ast.Not()):
                return self.made(node, sympy.Not, [self.condition(node.operand)])
            case ast.BoolOp():
                make = sympy.Or if isinstance(node.op, ast.Or) else sympy.And
                return self.made(node, make, [self.condition(part) for part in node.values])
            case ast.Compare():
                return self.comparison(node)
        return self.fail(node, f"contains {self.source(node)!r}, which is not allowed", ALLOWED)

    def literal(self, node: ast.expr, value: float) -> _Parsed:
        if isinstance(value, bool):
            return _Parsed(sympy.true if value else sympy.false)
        if not math.isfinite(value) or (isinstance(value, int) and value > LIMITS.integer):
            self.fail(node, "has a number that is too large", "Integers reach 1e40, numbers with a point 1.7e308.")
        return _Parsed(sympy.Integer(value) if isinstance(value, int) else sympy.Float(value), float(value))

    def source(self, node: ast.expr) -> str:
        return self.text[node.col_offset : node.end_col_offset][:40]

    def name(self, node: ast.expr, name: str) -> _Parsed:
        if name in self.symbols:
            return _Parsed(self.symbols[name])
        if name == "pi":
            return _Parsed(sympy.pi, math.pi)
        if name in (*FUNCTIONS, "Piecewise", "Table"):
            self.fail(node, f"uses the function {name} without arguments", f"Write {name}(...).")
        names = ", ".join([*self.symbols, "pi"])
        return self.fail(node, f"contains the unknown name {name[:40]!r}", f"Names here: {names}.")

    def comparison(self, node: ast.Compare) -> _Parsed:
        (right, *others), place = node.comparators, self.behind(node.left)
        if others:
            self.fail(self.behind(right), "compares twice", "Write (0 < t) and (t < 1).")
        if (sign := _SIGNS.get(type(node.ops[0]))) is None:
            self.fail(place, "has a comparison that is not allowed", f"Compare with {' '.join(COMPARISONS)}.")
        sides = [self.value(node.left), self.value(right)]
        if any(side.expression.has(sympy.Piecewise) for side in sides):
            self.fail(place, "compares a Piecewise", "Write its cases as conditions joined by 'and' and 'or'.")
        return self.made(place, COMPARISONS[sign], sides)

    def terms(self, node: ast.expr) -> list[_Parsed]:
        """The terms of a sum."""
        first, others = _chain(node, ast.Add, ast.Sub)
        terms = [self.value(first)]
        for operator, term in others:
            negative = isinstance(operator, ast.Sub)
            terms.append(self.product(term, [_MINUS_ONE, *self.factors(term)]) if negative else self.value(term))
        return terms

    def factors(self, node: ast.expr) -> list[_Parsed]:
        """The factors of a product; a sign is a factor, and a divisor a power."""
        first, others = _chain(node, ast.Mult, ast.Div)
        factors: list[_Parsed] = []
        for operator, operand in ((ast.Mult(), first), *others):
            unsigned = operand
            while isinstance(unsigned, ast.UnaryOp) and isinstance(unsigned.op, ast.UAdd | ast.USub):
                factors += [_MINUS_ONE] if isinstance(unsigned.op, ast.USub) else []
                unsigned = unsigned.operand
            factor = self.value(unsigned)
            factors.append(self.raised(unsigned, factor, _MINUS_ONE) if isinstance(operator, ast.Div) else factor)
        return factors

    def product(self, node: ast.expr, factors: list[_Parsed]) -> _Parsed:
        single = len(factors) == 1
        return factors[0] if single else self.made(node, sympy.Mul, factors, lambda *values: math.prod(values))

    def power(self, node: ast.BinOp) -> _Parsed:
        place, base = self.behind(node.left), self.value(node.left)
        self.towers += 1
        if self.towers > LIMITS.depth:
            self.fail(place, f"is nested deeper than {LIMITS.depth}", "Use fewer parentheses.")
        exponent = self.value(node.right)
        self.towers -= 1
        return self.raised(place, base, exponent)

    def raised(self, place: ast.expr | int, base: _Parsed, exponent: _Parsed) -> _Parsed:
        if exponent.value is not None and exponent.expression.count(sympy.Pow) > LIMITS.tower:
            self.fail(place, f"has more than {LIMITS.tower} powers of numbers in an exponent", "Write its number.")
        coefficient = base.expression.as_coeff_Mul()[0]
        if exponent.value is not None and coefficient.is_Rational:
            size = (max(abs(coefficient.p), coefficient.q) - 1).bit_length() * abs(exponent.value)
            if size > 4 * LIMITS.integer.bit_length():
                self.fail(place, "has a power that is too large", "Integers reach 1e40; write 10.0**50 as 1e50.")
        return self.made(place, sympy.Pow, [base, exponent], math.pow)

    def call(self, node: ast.Call) -> _Parsed:
        match node.func:
            case ast.Name(id="Piecewise"):
                return self.piecewise(node)
            case ast.Name(id="Table"):
                return _Parsed(as_expression(self.table(node)))
            case ast.Call(func=ast.Name(id="Table"), keywords=[]) as table:
                if len(node.args) != 1:
                    self.fail(node, f"gives Table {len(node.args)} arguments", "It takes 1.")
                return self.made(node, self.table(table), [self.value(node.args[0])])
            case ast.Name(id=name) if name in FUNCTIONS:
                return self.function(node, name)
            case ast.Name(id=name) if name not in (*self.symbols, "pi"):
                self.fail(node, f"contains the unknown function {name[:40]!r}", f"Functions: {FUNCTION_NAMES}.")
        number = self.source(node.func)
        return self.fail(node, f"calls {number}, which is no function", f"Multiply: {number}*(...).")

    def function(self, node: ast.Call, name: str) -> _Parsed:
        function, arguments = FUNCTIONS[name], [self.value(argument) for argument in node.args]
        if not function.fewest <= len(arguments) <= function.most:
            numbers = " to ".join(str(number) for number in dict.fromkeys((function.fewest, function.most)))
            self.fail(node, f"gives {name} {len(arguments)} arguments", f"It takes {numbers}.")
        self.extrema += len(arguments) if name in ("Max", "Min") else 0
        if self.extrema > LIMITS.extrema:
            self.fail(node, f"gives Max and Min more than {LIMITS.extrema} arguments", "Use a Table or Piecewise.")
        return self.made(node, function.make, arguments, function.value)

    def piecewise(self, node: ast.Call) -> _Parsed:
        values, conditions = list[_Parsed](), list[Any]()
        for pair in node.args:
            if not isinstance(pair, ast.Tuple) or len(pair.elts) != 2:
                self.fail(pair, "needs a pair (value, condition)", "Write Piecewise((1, t > 0), (0, True)).")
            values.append(self.value(pair.elts[0]))
            conditions.append(self.condition(pair.elts[1]).expression)
        return self.made(node, lambda *cases: sympy.Piecewise(*zip(cases, conditions, strict=True)), values)

    def table(self, node: ast.Call) -> Table:
        columns = [self.column(argument) for argument in node.args]
        try:
            return Table(*columns)
        except (ParameterError, TypeError) as error:
            self.fail(node, f"has a wrong table ({error})", "Write Table([x0, x1, ...], [y0, y1, ...]).")

    def column(self, node: ast.expr) -> list[float]:
        if not isinstance(node, ast.List):
            self.fail(node, "needs a list of numbers in Table", "Write Table([x0, x1, ...], [y0, y1, ...]).")
        items = [item.strip() for item in self.text[node.col_offset + 1 : (node.end_col_offset or 0) - 1].split(",")]
        if strange := [number for number, item in enumerate(items, 1) if not SIGNED_NUMBER.fullmatch(item)]:
            self.fail(node, f"has a list whose item {strange[0]} is no number", "Lists hold numbers alone.")
        return [float(item) for item in items]

    def made(
        self,
        place: ast.expr | int,
        make: Callable[..., Any],
        parts: Sequence[_Parsed],
        value: Callable[..., float] | None = None,
    ) -> _Parsed:
        """The expression of its parts; computed with plain floats first, so that nothing huge or imaginary is built."""
        number: float | None = None
        try:
            if value is not None and all(part.value is not None for part in parts):
                number = value(*(part.value for part in parts))
                if not math.isfinite(number):
                    raise OverflowError(number)
            expression = make(*(part.expression for part in parts))
            fault = fault_of(expression)
        except (ArithmeticError, ValueError, TypeError):
            fault = NOT_REAL
        if fault is not None:
            self.fail(place, fault, "Change that part; it may not overflow, divide by zero or be imaginary.")
        if expression.is_Number:
            return _Parsed(expression, float(expression))
        if number is None and isinstance(expression, sympy.Expr) and not expression.free_symbols:
            number = next((part.value for part in parts if part.expression == expression), None)
            if number is None:
                self.fail(place, "has symbols that cancel", "Write the number that remains.")
        return _Parsed(expression, number)


def _chain(node: ast.expr, *operators: type[ast.operator]) -> tuple[ast.expr, list[tuple[ast.operator, ast.expr]]]:
    """The first operand of a chain of operators of equal precedence, and each further one with its operator."""
    others = list[tuple[ast.operator, ast.expr]]()
    while isinstance(node, ast.BinOp) and isinstance(node.op, operators):
        others.append((node.op, node.right))
        node = node.left
    return node, others[::-1]


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
