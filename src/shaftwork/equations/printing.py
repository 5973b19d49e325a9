"""Rows as LaTeX: factors in a fixed order, numbers in sensible digits, long right sides broken into lines."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from sympy import Add, Expr, Float, Integer, Symbol
from sympy.printing.latex import LatexPrinter

from shaftwork.components.laws import t as TIME
from shaftwork.equations.assembly import Group, Sides
from shaftwork.equations.notation import INDEX_CLOSES, INDEX_OPENS
from shaftwork.equations.quantities import rate_of

LINE_WIDTH = 78
"""Characters of ordinary width that fit on a printed line beside its left side."""
DIGITS = 6
"""Significant digits of numbers in equations."""


@dataclass(frozen=True)
class Line:
    """A printed equation: left side, and the pieces of the right side between which it may be broken."""

    left: str
    pieces: tuple[str, ...]
    remark: str = ""

    @property
    def text(self) -> str:
        """Everything in one string, to compare lines by."""
        return "\n".join((self.left, *self.pieces, self.remark))

    def mapped(self, change: Callable[[str], str]) -> Line:
        """The line with a change made to every piece of it."""
        return Line(change(self.left), tuple(map(change, self.pieces)), change(self.remark))


class _Printer(LatexPrinter):  # type: ignore[misc]
    """sympy's printer with numbers as engineers write them."""

    def _print_Float(self, number: Float) -> str:
        mantissa, _, exponent = f"{float(number):.{DIGITS}g}".partition("e")
        return rf"{mantissa} \cdot 10^{{{int(exponent)}}}" if exponent else mantissa


@dataclass(frozen=True)
class Writer:
    """Prints expressions of one network.

    Args:
        names: LaTeX of every symbol by name, in the order in which factors are printed.
        values: number of every parameter that is printed by its value; empty to print symbols.
    """

    names: Mapping[str, str]
    values: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_known", {})
        object.__setattr__(self, "_printer", _Printer({"symbol_names": _Lookup(self), "ln_notation": True}))

    def latex(self, expression: Expr) -> str:
        """An expression in LaTeX."""
        symbols = sorted(expression.free_symbols, key=lambda symbol: symbol.name)
        changes: dict[Any, Any] = {symbol: Float(self.values[symbol.name]) for symbol in symbols if symbol.name in self.values}
        if changes:
            expression = _rounded(expression.xreplace(changes))
        return str(self._printer.doprint(expression.xreplace({s: self._ordered(s) for s in expression.free_symbols})))
