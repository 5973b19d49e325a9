"""The right-hand side as scalar code with common subexpressions: the fastest plain Python form of a small model."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from sympy import Expr, Symbol, count_ops, cse, lambdify
from sympy.printing.pycode import PythonCodePrinter

from shaftwork.codegen.elements import Array
from shaftwork.components.laws import NUMERICAL
from shaftwork.components.laws import t as TIME
from shaftwork.reduction.rows import Rows


class _Printer(PythonCodePrinter):  # type: ignore[misc]
    """Python's own math functions; sign and Heaviside are not among them."""

    def _print_sign(self, expression: Expr) -> str:
        argument = self._print(expression.args[0])
        return f"(1.0 if ({argument}) > 0 else -1.0 if ({argument}) < 0 else 0.0)"

    def _print_Heaviside(self, expression: Expr) -> str:
        argument, at_zero = (self._print(part) for part in expression.args)
        return f"(1.0 if ({argument}) > 0 else 0.0 if ({argument}) < 0 else {at_zero})"


class ScalarProgram:
    """`rhs(t, x, p)` of explicit rows.

    Args:
        rows: the explicit state equations.
    """

    def __init__(self, rows: Rows) -> None:
        plain = {symbol: Symbol(f"x{k}", real=True) for k, symbol in enumerate(rows.states)}
        plain |= {symbol: Symbol(f"p{k}", real=True) for k, symbol in enumerate(rows.parameters)}
        self._rates = tuple(rate.xreplace(plain) for rate in rows.rates)
        self._states = [plain[symbol] for symbol in rows.states]
        self._parameters = [plain[symbol] for symbol in rows.parameters]

    @cached_property
    def function(self) -> Callable[..., list[float]]:
        """(t, states, parameters) to the list of rates, in Python floats."""
        modules: list[Any] = [NUMERICAL, math]
        settings = {"fully_qualified_modules": False, "inline": True, "allow_unknown_functions": True}
        made: Callable[..., list[float]] = lambdify(
            [TIME, self._states, self._parameters],
            list(self._rates),
            modules=modules,
            printer=_Printer(settings),
            cse=True,
        )
        return made

    @property
    def source(self) -> str:
        """The generated code."""
        return str(self.function.__doc__).split("Source code:\n\n")[1].split("\n\nImported")[0]

    def bind(self, p: Array) -> Callable[[float, Array], Array]:
        """The right-hand side for one parameter vector; NaN where a law cannot be evaluated."""
        function, values, size = self.function, p.tolist(), len(self._rates)

        def rhs(t: float, x: Array) -> Array:
            try:
                return np.array(function(t, x.tolist(), values))
            except (ArithmeticError, ValueError):
                return np.full(size, np.nan)

        return rhs

    @cached_property
    def operations(self) -> dict[str, int]:
        """Operations of one evaluation after common subexpressions are taken out, by name; signs cost nothing."""
        shared, reduced = cse(self._rates)
        total = sum((count_ops(term, visual=True) for term in (*(e for _, e in shared), *reduced)), start=0)
        counts = total.as_coefficients_dict() if total else {}
        return {str(name).lower(): int(count) for name, count in sorted(counts.items(), key=str) if str(name) != "NEG"}
