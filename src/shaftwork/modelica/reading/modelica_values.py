"""Expressions of a Modelica model as numbers, truths, arrays and laws of time."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from typing import Any

import sympy

from shaftwork.components.laws import larger, smaller
from shaftwork.components.laws import t as TIME
from shaftwork.core.errors import ModelFileError
from shaftwork.modelica.reading.modelica_syntax import SyntaxTerm
from shaftwork.modelica.reading.modelica_tokens import fault

_CONSTANTS = {"pi": math.pi, "eps": 2.220446049250313e-16, "small": 1e-60, "inf": 1e60, "g_n": 9.80665, "e": math.e}
_D2R = {"D2R": math.pi / 180, "R2D": 180 / math.pi}
_FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    **{name: getattr(sympy, name) for name in ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "log")},
    **{name: getattr(sympy, name) for name in ("sinh", "cosh", "tanh", "sqrt", "sign", "floor")},
    "abs": sympy.Abs,
    "max": larger,
    "min": smaller,
    "log10": lambda x: sympy.log(x, 10),
    "mod": lambda x, y: x - y * sympy.floor(x / y),
    "from_deg": lambda x: x * math.pi / 180,
    "from_rpm": lambda x: x * math.pi / 30,
    "noEvent": lambda x: x,
    "smooth": lambda _, x: x,
}
_OPERATORS: Mapping[str, Callable[..., Any]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "^": operator.pow,
    "negative": operator.neg,
    "not": sympy.Not,
    "and": sympy.And,
    "or": sympy.Or,
    "<": sympy.Lt,
    "<=": sympy.Le,
    ">": sympy.Gt,
    ">=": sympy.Ge,
    "==": sympy.Eq,
    "<>": sympy.Ne,
}
LARGEST = 1e100
"""A larger number is a slip, and its powers take long."""


class ModelicaValues:
    """The parameters of a model, each worked out when it is first needed.

    Args:
        terms: by name.
    """

    def __init__(self, terms: Mapping[str, SyntaxTerm | None]) -> None:
        self._terms, self._results, self._open = dict(terms), dict[str, Any](), list[str]()

    def of(self, term: SyntaxTerm) -> Any:
        """The value of an expression: a float, bool, str, list, or a sympy expression of time.

        Raises:
            ModelFileError: it has none; says where.
        """
        try:
            return self._plain(self._value(term), term)
        except (ArithmeticError, TypeError, ValueError, RecursionError) as error:
            if isinstance(error, ModelFileError):
                raise
            raise fault(term.line, f"the expression has no value: {str(error)[:80] or type(error).__name__}.") from None

    def _plain(self, value: Any, term: SyntaxTerm) -> Any:
        if isinstance(value, bool | str | list):
            return value
        expression = sympy.sympify(value, strict=True)
        if expression in (sympy.true, sympy.false):
            return bool(expression)
        if expression.has(sympy.nan, sympy.zoo, sympy.oo, sympy.I, -sympy.oo):
            raise fault(term.line, "the expression has no finite real value.")
        if expression.free_symbols:
            return expression
        number = float(expression)
        if abs(number) > LARGEST:
            raise fault(term.line, f"the number {number:g} is too large.")
        return number

    def _value(self, term: SyntaxTerm) -> Any:
        if term.kind == "number":
            return float(term.value)
        if term.kind == "text":
            return term.value
        if term.kind == "bool":
            return term.value == "true"
        if term.kind == "name":
            return self._named(term)
        if term.kind == "if":
            return self._choice(term)
        values = [self.of(part) for part in term.parts]
        if term.kind == "array":
            return values
        if term.kind == "call":
            return self._call(term, values)
        if term.kind in _OPERATORS:
            return _OPERATORS[term.kind](*values)
        raise fault(term.line, "the expression is not one of numbers, parameters and time.")

    def _choice(self, term: SyntaxTerm) -> Any:
        condition, *branches = term.parts
        chosen = self.of(condition)
        if isinstance(chosen, bool):
            return self.of(branches[0] if chosen else branches[1])
        then, other = map(self.of, branches)
        return sympy.Piecewise((then, chosen), (other, True))

    def _call(self, term: SyntaxTerm, values: list[Any]) -> Any:
        name = term.value.rpartition(".")[2]
        if name not in _FUNCTIONS:
            raise fault(term.line, f"the function '{term.value}' is not read. There are: {', '.join(_FUNCTIONS)}.")
        return _FUNCTIONS[name](*values)

    def _named(self, term: SyntaxTerm) -> Any:
        name = term.value
        if name in self._results:
            return self._results[name]
        if name == "time":
            return TIME
        if name in self._terms:
            value = self._terms[name]
            if value is None:
                raise fault(term.line, f"the parameter '{name}' has no value.")
            if name in self._open:
                raise fault(term.line, f"the parameter '{name}' is its own value.")
            self._open.append(name)
            self._results[name] = self.of(value)
            self._open.pop()
            return self._results[name]
        last = name.rpartition(".")[2]
        for table, places in ((_CONSTANTS, ("Constants",)), (_D2R, ("Constants", "Conversions"))):
            if last in table and (set(places) & set(name.split(".")) or last == name == "pi"):
                return table[last]
        raise fault(term.line, f"there is no parameter '{name}'. There are: {', '.join(self._terms) or 'none'}.")
