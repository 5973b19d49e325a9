"""Rows as LaTeX: factors in a fixed order, numbers in sensible digits, long right sides broken into lines."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from sympy import Expr, Float, Integer, Symbol
from sympy.printing.latex import LatexPrinter

from shaftwork.components.laws import t as TIME
from shaftwork.equations.assembly import Group, Sides
from shaftwork.equations.notation import INDEX_CLOSES, INDEX_OPENS
from shaftwork.equations.quantities import rate_of

LINE_WIDTH = 78
"""Characters of ordinary width that fit on a printed line beside its left side."""
DIGITS = 6
"""Significant digits of numbers in equations."""
OPENS, CLOSES = "\ue002", "\ue003"
"""Stand for the brackets of a group until it is known whether it stays on one line."""


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


class Writer:
    """Prints expressions of one network.

    Args:
        names: LaTeX of every symbol by name, in the order in which factors are printed.
        values: number of every parameter that is printed by its value; empty to print symbols.
    """

    def __init__(self, names: Mapping[str, str], values: Mapping[str, float] = MappingProxyType({})) -> None:
        self._values = {Symbol(name, real=True): _number(value) for name, value in values.items()}
        self._ordered = {Symbol(name, real=True): Symbol(f"{k:07d}", real=True) for k, name in enumerate(names)}
        printed = dict(zip(self._ordered.values(), names.values(), strict=True))
        self._printer = _Printer({"symbol_names": {**printed, TIME: "t"}})

    def latex(self, expression: Expr) -> str:
        """An expression in LaTeX."""
        if self._values and not self._values.keys().isdisjoint(expression.free_symbols):
            expression = _rounded(expression.xreplace(self._values))
        return str(self._printer.doprint(expression.xreplace(self._ordered)))

    def line(self, sides: Sides, remark: str = "") -> Line:
        """A row of the equations."""
        pieces = [piece for group in sides.groups for piece in self._group(group)]
        if pieces and pieces[0].startswith("+ "):
            pieces[0] = pieces[0][2:]
        return Line(self.latex(sides.left), tuple(pieces) or ("0",), remark)

    def _group(self, group: Group) -> list[str]:
        """The pieces of a group, each with its sign."""
        factor, terms = group
        if len(terms) < 2 or factor == 1:
            return [self._signed(factor * term) for term in terms]
        inside = [self._signed(term) for term in terms]
        inside[0] = inside[0].removeprefix("+ ")
        inside[0] = rf"{self._signed(factor)} {OPENS} {inside[0]}"
        inside[-1] = f"{inside[-1]} {CLOSES}"
        return inside

    def _signed(self, term: Expr) -> str:
        text = self.latex(term)
        return text.replace("-", "- ", 1) if text.startswith("-") else f"+ {text}"


def with_rates(names: Mapping[str, str]) -> dict[str, str]:
    """The symbols and, after them, their time derivatives."""
    rates = {rate_of(Symbol(name)).name: rf"\frac{{d {latex}}}{{d t}}" for name, latex in names.items()}
    return {**names, **rates}


def _number(value: float) -> Expr:
    return Integer(int(value)) if value.is_integer() and abs(value) < 10**DIGITS else Float(value)


def _rounded(expression: Expr) -> Expr:
    """An expression whose parameters are numbers, with everything numeric multiplied out."""
    numeric = expression.evalf()
    return numeric.xreplace({number: _number(float(number)) for number in numeric.atoms(Float)})


def aligned(lines: Sequence[Line]) -> str:
    """Lines as the rows of an aligned block, broken where they are too long for the page."""
    return " \\\\\n".join(row for line in lines for row in _broken(line))


def _broken(line: Line) -> list[str]:
    rows = [[]]
    room = LINE_WIDTH - printed_width(line.left)
    used = 0.0
    for piece in line.pieces:
        width = printed_width(piece)
        if rows[-1] and used + width > room:
            rows.append([])
            used = 2.0
        rows[-1].append(piece)
        used += width
    remark = rf" \qquad {line.remark}" if line.remark else ""
    whole = len(rows) == 1
    texts = [_bracketed(" ".join(row), whole=whole) for row in rows]
    return [f"{line.left} &= {texts[0]}" + remark * whole] + [
        rf"&\quad {text}" + remark * (number == len(texts) - 1) for number, text in enumerate(texts[1:], 1)
    ]


def _bracketed(text: str, *, whole: bool) -> str:
    """Brackets that grow where they stand on one line, and of a fixed size where a line break parts them."""
    opens, closes = (r"\left(", r"\right)") if whole else (r"\biggl(", r"\biggr)")
    return text.replace(OPENS, opens).replace(CLOSES, closes)


def printed_width(latex: str) -> float:
    """About how many ordinary characters wide a formula is in print; subscripts are smaller, fractions as wide as their wider part."""
    text = latex.replace(INDEX_OPENS, "").replace(INDEX_CLOSES, "")
    while match := FRACTION.search(text):
        wider = max(match.groups(), key=printed_width)
        text = f"{text[: match.start()]}{wider}{text[match.end() :]}"
    while match := SUBSCRIPT.search(text):
        small = "x" * round(0.65 * printed_width(match.group(1)))
        text = f"{text[: match.start()]}{small}{text[match.end() :]}"
    return float(len(re.sub(r"\\(left|right|mathrm|text|operatorname|begin|end|quad|[,;!\s])|[{}&]|\s+", "", COMMAND.sub("x", text))))


INNER = r"((?:[^{}]|\{[^{}]*\})*)"
FRACTION = re.compile(r"\\frac\{" + INNER + r"\}\{" + INNER + r"\}")
SUBSCRIPT = re.compile(r"[_^]\{" + INNER + r"\}")
COMMAND = re.compile(r"\\(?!left|right|mathrm|text|operatorname|begin|end|quad)[A-Za-z]+")
