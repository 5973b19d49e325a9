"""Rows as LaTeX: factors in a fixed order, numbers in sensible digits, long right sides broken into lines."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

from sympy import Basic, Expr, Float, Heaviside, Integer, Piecewise, Pow, Symbol, true
from sympy.printing.latex import LatexPrinter

from shaftwork.components.laws import t as TIME
from shaftwork.equations.assembly import FactoredTerms, Sides, rising_first
from shaftwork.equations.quantities import rate_of
from shaftwork.equations.spelling import without_marks

LINE_WIDTH, WIDEST_PIECE, WIDEST_CASE = 76, 60, 36
"""Characters of ordinary width that fit beside a left side: on a printed line; of a product with a sum, which is broken
inside it where it is wider; and of a sum in a row of cases, where the condition stands besides."""
DIGITS = 6
"""Significant digits of numbers in equations."""
TOKEN = re.compile(r"\\[A-Za-z]+|\\.|.", re.DOTALL)
WIDTHS = {
    **dict.fromkeys("+-=<>", 2.5),
    **dict.fromkeys("()[].:!|", 0.65),
    **dict.fromkeys(",;", 0.8),
    **dict.fromkeys(" &$", 0.0),
    **dict.fromkeys((r"\left", r"\right", r"\biggl", r"\biggr", r"\displaystyle"), 0.25),
    r"\,": 0.3,
    r"\ ": 0.6,
    r"\quad": 1.9,
    r"\qquad": 3.8,
    r"\Delta": 1.5,
    r"\dots": 2.3,
    r"\cdot": 1.3,
}
"""Widths in units of an ordinary letter, about 5.7 points at a font size of 11 points."""
FUNCTION = re.compile(r"\\(tanh|cosh|sinh|cos|sin|tan|exp|log|sqrt|operatorname|max|min|sign)$")
OPENS, CLOSES = "\ue002", "\ue003"
"""Stand for the brackets of a group until it is known whether it stays on one line."""


@dataclass(frozen=True)
class Line:
    """A printed equation: left side, the pieces of the right side between which it may be broken, and a remark."""

    left: str
    pieces: tuple[str, ...]
    remark: str = ""
    relation: str = "="

    @property
    def text(self) -> str:
        """Everything in one string, to compare lines by."""
        return "\n".join((self.left, *self.pieces, self.remark))

    def mapped(self, change: Callable[[str], str]) -> Line:
        """The line with a change made to every piece of it."""
        left = change(self.left)  # in the order of `text`, for a change that counts its matches
        return replace(self, left=left, pieces=tuple(map(change, self.pieces)), remark=change(self.remark))


class _Printer(LatexPrinter):  # type: ignore[misc]
    """sympy's printer with numbers as engineers write them."""

    def _as_ordered_terms(self, expression: Expr, order: str | None = None) -> list[Expr]:
        terms = super()._as_ordered_terms(expression, order)
        return sorted(terms, key=lambda term: bool(term.could_extract_minus_sign()))

    def _print_Float(self, number: Float) -> str:
        value = float(number)
        if math.isfinite(value):
            return printed_number(value)
        mantissa, _, exponent = str(number.n(DIGITS)).partition("e")  # one that floats do not hold
        return rf"{mantissa} \cdot 10^{{{int(exponent)}}}"

    def _print_Piecewise(self, cases: Piecewise) -> str:
        """One case a row, and a sum that is wider than that in several."""
        rows = [
            f"{self._case(value)} & "
            + (r"\text{otherwise}" if holds == true else rf"\text{{for}}\: {self._print(holds)}")
            for value, holds in cases.args
        ]
        return r"\begin{cases} " + r" \\".join(rows) + r" \end{cases}"

    def _case(self, value: Expr) -> str:
        whole = str(self._print(value))
        if printed_width(whole) <= WIDEST_CASE or not value.is_Add:
            return whole
        rows, used = list[str](), math.inf
        for term in self._as_ordered_terms(value):
            text = str(self._print(term))
            text = f"- {text[1:].lstrip()}" if text.startswith("-") else f"+ {text}" if rows else text
            if used + (width := printed_width(text)) > WIDEST_CASE:
                rows, used = [*rows, text], width
            else:
                rows[-1], used = f"{rows[-1]} {text}", used + width
        return r"\begin{array}{@{}l@{}} " + r" \\ ".join(rows) + r" \end{array}"

    def _print_Heaviside(self, step: Heaviside, exp: str | None = None) -> str:
        """The unit step, whatever its value at the step is."""
        text = rf"\mathrm{{H}}\left({self._print(step.args[0])}\right)"
        return text if exp is None else rf"{text}^{{{exp}}}"


def printed_number(value: float, digits: int = DIGITS) -> str:
    """A number with sensible digits, a power of ten where it is very large or small."""
    mantissa, _, exponent = f"{value:.{digits}g}".partition("e")
    return rf"{mantissa} \cdot 10^{{{int(exponent)}}}" if exponent else mantissa


class Writer:
    """Prints expressions of one network.

    Args:
        names: LaTeX of every symbol by name, in the order in which factors are printed.
        parameters: names of the parameters among them; their sums are printed before the variable that they multiply.
        last: names of the variables that stand behind a fraction, not above it: rates and coordinates.
        values: number of every parameter that is printed by its value; empty to print symbols.
        inverses: for parameters that are printed by their reciprocals the symbols of these.
        tables: of orders, with the letters by which they are printed.
    """

    def __init__(
        self,
        names: Mapping[str, str],
        parameters: Collection[str],
        last: Collection[str],
        values: Mapping[str, float],
        inverses: Mapping[Symbol, Symbol] = MappingProxyType({}),
        tables: Mapping[Basic, Basic] = MappingProxyType({}),
    ) -> None:
        self._tables = dict(tables)
        self._replaced: dict[Symbol, Expr] = {symbol: 1 / inverse for symbol, inverse in inverses.items()}
        self._last = {Symbol(name, real=True) for name in last}
        self._values = {Symbol(name, real=True): _number(value) for name, value in values.items()}
        self._ordered = {Symbol(name, real=True): Symbol(f"{k:07d}", real=True) for k, name in enumerate(names)}
        printed = dict(zip(self._ordered.values(), names.values(), strict=True))
        self._parameters = {Symbol(name, real=True) for name in parameters}
        self._sums: dict[Expr, Symbol] = {}
        self._symbol_names = {**printed, TIME: "t"}
        self.used: dict[str, None] = {}
        """The names of all symbols that have been printed, in their order."""
        self._printer = _Printer({"symbol_names": self._symbol_names, "mul_symbol": r" \, ", "inv_trig_style": "full"})

    def latex(self, expression: Expr) -> str:
        """An expression in LaTeX."""
        valued = self._valued(expression.xreplace(self._tables) if self._tables else expression)
        self.used.update(dict.fromkeys(sorted(str(symbol.name) for symbol in valued.free_symbols)))
        return str(self._printer.doprint(self._in_order(valued).xreplace(self._ordered)))

    def _valued(self, expression: Expr) -> Expr:
        """The expression with numbers for those parameters that are printed by their value, or with reciprocals."""
        if self._replaced and not self._values:
            return expression.xreplace(self._replaced)
        if not self._values or self._values.keys().isdisjoint(expression.free_symbols):
            return expression
        return _rounded(expression.xreplace(self._values))

    def _in_order(self, expression: Expr) -> Expr:
        """The expression with every sum of parameters that multiplies something as a symbol, to be sorted as such."""
        if not expression.args or expression.is_Atom or isinstance(expression, Piecewise):
            return expression
        parts = [self._in_order(part) for part in expression.args]
        over = [part for part in parts if not (part.is_Number or (part.is_Pow and part.exp.is_negative))]
        if expression.is_Mul and len(over) > 1:
            parts = [self._as_symbol(part) if part.is_Add else part for part in parts]
        return expression.func(*parts)

    def _as_symbol(self, total: Expr) -> Expr:
        if not total.free_symbols <= self._parameters:
            return total
        if total not in self._sums:
            self._sums[total] = Symbol(f"{len(self._parameters) - 1:07d} {len(self._sums)}", real=True)
            inner = self._printer.doprint(total.xreplace(self._ordered))
            self._symbol_names[self._sums[total]] = rf"\left({inner}\right)"
        return self._sums[total]

    def line(self, sides: Sides, remark: str = "") -> Line:
        """A row of the equations."""
        pieces = self.pieces(sides.groups)
        terms = sorted(sides.left.args, key=self._rank) if sides.left.is_Add else [sides.left]
        left = " ".join(self.pieces((FactoredTerms(Integer(1), tuple(terms)),)))
        return Line(left, pieces or ("0",), remark)

    def pieces(self, groups: Iterable[FactoredTerms]) -> tuple[str, ...]:
        """The terms of all groups, each with its sign, the first without a plus."""
        signed = [piece for group in groups for piece in self._group(group)]
        return (signed[0].removeprefix("+ "), *signed[1:]) if signed else ()

    def _group(self, group: FactoredTerms) -> list[str]:
        """The pieces of a group, each with its sign."""
        factor, terms = group
        if len(terms) < 2:
            return [piece for term in terms for piece in self._parted(factor * term)]
        if self._valued(factor) == 1:
            return [piece for term in terms for piece in self._parted(term)]
        sizes = [abs(term.as_coeff_Mul()[0]) for term in terms]
        if sizes.count(sizes[0]) == len(sizes):  # a half of every term is a half before the bracket
            factor, terms = factor * sizes[0], tuple(term / sizes[0] for term in terms)
        inside = [piece for term in terms for piece in self._parted(term)]
        inside[0] = inside[0].removeprefix("+ ")
        inside[0] = rf"{self._signed(factor)} {OPENS} {inside[0]}"
        inside[-1] = f"{inside[-1]} {CLOSES}"
        return inside

    def _parted(self, term: Expr) -> list[str]:
        """A term with its sign; one that is too wide as the pieces of the sum that it is a multiple of."""
        text = self._signed(term)
        sums = [factor for factor in term.args if factor.is_Add] if term.is_Mul else []
        if printed_width(text) <= WIDEST_PIECE or len(sums) != 1:
            return [text]
        summed = sorted(sums[0].args, key=self._first)
        pieces = [self._signed(part) for part in rising_first(summed)]
        factor, first = self._signed(term / sums[0]), rf"\bigl( {pieces[0].removeprefix('+ ')}"
        apart = printed_width(factor + first) > WIDEST_PIECE
        begun = [factor, rf"\cdot {first}"] if apart else [rf"{factor} \, {first}"]
        return [*begun, *pieces[1:-1], rf"{pieces[-1]} \bigr)"]

    def _first(self, term: Expr) -> str:
        """Sorts terms by the first of their symbols."""
        return min((self._ordered[symbol].name for symbol in term.free_symbols & self._ordered.keys()), default="")

    def _rank(self, term: Expr) -> str:
        """Sorts the terms of a left side by the rates that they contain."""
        return min((self._ordered[symbol].name for symbol in term.free_symbols & self._last), default="")

    def _product(self, term: Expr) -> str:
        """A term with a rate or coordinate behind its coefficient."""
        behind = [factor for factor in term.args if factor in self._last] if term.is_Mul else []
        if len(behind) != 1 or not (coefficient := term / behind[0]).has(Pow):
            return self.latex(term)
        text = rf"\left({self.latex(coefficient)}\right)" if coefficient.is_Add else self.latex(coefficient)
        return rf"{text} \, {self.latex(behind[0])}"

    def factor(self, gain: Expr) -> tuple[str, str]:
        """Sign and size of what stands before a product that is printed already; nothing for a size of 1."""
        sign = "-" if gain.could_extract_minus_sign() else "+"
        size = -gain if sign == "-" else gain
        text = rf"\left({self.latex(size)}\right)" if size.is_Add else self.latex(size)
        return sign, "" if size == 1 else rf"{text} \, "

    def _signed(self, term: Expr) -> str:
        text = self._product(term)
        return f"- {text[1:].lstrip()}" if text.startswith("-") else f"+ {text}"


def with_rates(names: Mapping[str, str], rate: Callable[[str], str]) -> dict[str, str]:
    """The symbols and, after them, their time derivatives."""
    rates = {rate_of(Symbol(name)).name: rate(latex) for name, latex in names.items()}
    return {**names, **rates}


def _number(value: float) -> Expr:
    return Integer(int(value)) if value.is_integer() and abs(value) < 10**DIGITS else Float(value)


def _rounded(expression: Expr) -> Expr:
    """An expression whose parameters are numbers, with everything numeric multiplied out."""
    numeric = expression.evalf()
    return numeric.xreplace({number: _number(float(number)) for number in numeric.atoms(Float)})


def aligned(lines: Sequence[Line]) -> str:
    """Lines as the rows of an aligned block, broken where they are too long for the page."""
    widths = [printed_width(line.left) for line in lines]
    alone = max((width for width in widths if 2 * width > LINE_WIDTH), default=0.0)  # on a row of its own
    most = min(LINE_WIDTH / 2, LINE_WIDTH - alone if alone < LINE_WIDTH else math.inf)  # which begins beside others
    beside = max((width for width in widths if width <= most), default=0.0)
    broken = [_broken(line, beside, most) for line in lines]
    rows = [" \\\\\n".join(rows) + (r" \\[1ex]" if len(rows) > 1 else r" \\") for rows in broken]
    return "\n".join(rows).removesuffix("[1ex]").removesuffix(r" \\")


def _broken(line: Line, beside: float, most: float) -> list[str]:
    """The rows of a line, each with as many pieces as there is room for beside the left sides."""
    if printed_width(line.left) > most:  # a left side of its own row
        below = (row.partition("&")[2] for row in _broken(replace(line, left=""), beside, most))
        return [f"& {line.left}", *(rf"&\qquad {row}" for row in below)]
    room = LINE_WIDTH - beside
    rows: list[list[str]] = [[]]
    used = 0.0
    for piece in line.pieces:
        width = printed_width(piece)
        if rows[-1] and used + width > room:
            rows.append([])
            used = printed_width(r"\quad")
        rows[-1].append(piece)
        used += width
    texts = [f"{line.left} &{line.relation} {' '.join(rows[0])}", *(rf"&\quad {' '.join(row)}" for row in rows[1:])]
    if line.remark and used + printed_width(rf"\qquad {line.remark}") > room:
        texts.append(rf"&\qquad {line.remark}")
    elif line.remark:
        texts[-1] += rf" \qquad {line.remark}"
    return [_bracketed(text) for text in texts]


def _bracketed(text: str) -> str:
    """Brackets that grow where they stand on one line, and of a fixed size where a line break parts them."""
    places = [character for character in text if character in (OPENS, CLOSES)]
    whole = places == [OPENS, CLOSES] * (len(places) // 2)
    opens, closes = (r"\left[", r"\right]") if whole else (r"\biggl[", r"\biggr]")
    if whole and r"\left(" not in text:
        opens, closes = r"\left(", r"\right)"
    return text.replace(OPENS, opens).replace(CLOSES, closes)


def printed_width(latex: str) -> float:
    """The width of a formula in ordinary letters: scripts are smaller, a fraction is as wide as its wider part."""
    return _width(iter(TOKEN.findall(without_marks(latex))), one=False)


def _width(tokens: Iterator[str], *, one: bool) -> float:
    """Width of all tokens up to the end of the group, or of the next item alone."""
    total = 0.0
    for item in tokens:
        if item == " " and one:
            continue
        if item == "}":
            break
        total += _item(item, tokens)
        if one:
            break
    return total


def _item(item: str, tokens: Iterator[str]) -> float:
    match item:
        case "{":
            return _width(tokens, one=False)
        case "_" | "^":
            return 0.1 + 0.75 * _width(tokens, one=True)
        case r"\frac":
            return 0.4 + max(_width(tokens, one=True), _width(tokens, one=True))
        case r"\begin" | r"\end":
            _width(tokens, one=True)
            return 0.0
        case r"\mathrm" | r"\text" | r"\mathbf" | r"\mathsf" | r"\dot" | r"\ddot" | r"\operatorname":
            return 0.0  # the group that follows has the width
    if item in WIDTHS:
        return WIDTHS[item]
    if FUNCTION.match(item):
        return 0.9 * len(item)
    if item.isdigit():
        return 0.95
    # widths of Greek and capital letters, measured in those of ordinary ones
    return 1.1 if item.startswith("\\") else 1.35 if item.isupper() else 1.0
