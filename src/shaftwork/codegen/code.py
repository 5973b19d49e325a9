"""Expressions as Python functions whose constants are the floats that the expressions hold."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any

from sympy import And, Expr, Float, Or, Pow, S, Symbol, lambdify
from sympy.printing.numpy import NumPyPrinter
from sympy.printing.pycode import PythonCodePrinter

from shaftwork.components.laws import NUMERICAL

SETTINGS = {"fully_qualified_modules": False, "inline": True, "allow_unknown_functions": True}


class _Real:
    """Numbers as the floats that they are, and powers that are real or no number."""

    def _print_Float(self, number: Float) -> str:
        return repr(float(number))  # sympy prints 15 digits, which is another float

    def _print_Pow(self, power: Pow, rational: bool = False) -> str:  # noqa: FBT001, FBT002 (sympy's signature)
        if abs(power.exp) == S.Half or power.exp.is_integer:
            return str(super()._print_Pow(power, rational))  # type: ignore[misc]
        # Python's own ** gives a complex number for a negative base.
        base, exponent = self._print(power.base), self._print(power.exp)  # type: ignore[attr-defined]
        return f"{self.power}({base}, {exponent})"  # type: ignore[attr-defined]


class _Scalar(_Real, PythonCodePrinter):  # type: ignore[misc]
    """Python's own math functions; sign and Heaviside are not among them."""

    power = "pow"

    def _print_sign(self, expression: Expr) -> str:
        argument = self._print(expression.args[0])
        return f"(1.0 if ({argument}) > 0 else -1.0 if ({argument}) < 0 else 0.0)"

    def _print_Heaviside(self, expression: Expr) -> str:
        argument, at_zero = (self._print(part) for part in expression.args)
        return f"(1.0 if ({argument}) > 0 else 0.0 if ({argument}) < 0 else {at_zero})"


class _Vectorised(_Real, NumPyPrinter):  # type: ignore[misc]
    """numpy's functions."""

    power = "power"

    def _print_And(self, condition: And) -> str:
        return self._joined("logical_and", condition)

    def _print_Or(self, condition: Or) -> str:
        return self._joined("logical_or", condition)

    def _joined(self, function: str, condition: And | Or) -> str:
        # sympy's printer stacks the conditions, which fails where one is of the time and another of many states
        first, *others = (self._print(part) for part in condition.args)
        return str(reduce(lambda joined, other: f"{function}({joined}, {other})", others, first))


def scalar(arguments: Sequence[Any], expressions: Any, *, shared: bool = True) -> Callable[..., Any]:
    """Expressions as a function of floats.

    Args:
        arguments: symbols or lists of symbols.
        expressions: one, or a list of them.
        shared: whether common subexpressions are looked for.
    """
    printer, modules = _Scalar(SETTINGS), [NUMERICAL, math]
    function: Callable[..., Any] = lambdify(arguments, expressions, modules=modules, printer=printer, cse=shared)
    return function


def vectorised(symbols: Sequence[Symbol], expression: Expr) -> Callable[..., Any]:
    """An expression as a function of arrays or floats."""
    if len(symbols) == 1 and expression == symbols[0]:
        return lambda value: value
    printer, modules = _Vectorised(SETTINGS), [NUMERICAL, "numpy"]
    function: Callable[..., Any] = lambdify(list(symbols), expression, modules=modules, printer=printer, cse=True)
    return function


def vectorised_list(symbols: Sequence[Symbol], expressions: Sequence[Expr]) -> Callable[..., Any]:
    """Several expressions as one function of arrays or floats."""
    plain = {symbol: Symbol(f"v{k}", real=True) for k, symbol in enumerate(symbols)}
    renamed = [expression.xreplace(plain) for expression in expressions]
    printer, modules = _Vectorised(SETTINGS), [NUMERICAL, "numpy"]
    function: Callable[..., Any] = lambdify(list(plain.values()), renamed, modules=modules, printer=printer, cse=False)
    return function
