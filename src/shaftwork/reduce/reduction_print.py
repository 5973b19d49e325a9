"""The table of a reduction as LaTeX: every parameter before and after, with its formula."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

from sympy import Add, Expr, Integer, Symbol, latex

from shaftwork.components.laws import omega, phi, s, v
from shaftwork.components.tables import Table
from shaftwork.equations.assembly import FactoredTerms
from shaftwork.equations.spelling import escaped, in_text, without_marks
from shaftwork.latex.nomenclature import column, unit
from shaftwork.latex.nomenclature import table as longtable
from shaftwork.latex.printing import Line, Writer, aligned, printed_number, printed_width
from shaftwork.reduce.referred_parts import Entry, formula_of, symbol_of

PART, FORMULA, LETTER = 20, 42, 2
"""Width of the names of parts, that of the formulas and about that of a letter in print, mm."""
MOTION = {omega.name: r"\omega", phi.name: r"\varphi", v.name: "v", s.name: "s"}
"""What laws read, of their own shaft."""
TIMES, BREAKS = r" \, ", r" \,\allowbreak "
"""Between factors; where a line may end."""


class ReductionPrint:
    """The table of a reduction in print.

    Args:
        entries: in the order of the network.
        read_names: gives LaTeX of the symbols of the network by name.
    """

    def __init__(self, entries: Sequence[Entry], read_names: Callable[[], Mapping[str, str]]) -> None:
        self.entries, self.read_names = entries, read_names

    def latex(self) -> str:
        """The table as LaTeX, a `longtable` in the letters of the equations; what is a law stands below it.

        It needs the packages amsmath, booktabs, array and longtable.
        """
        titles = ("Part", "Formula", "Value", "Unit", "Ratio", "Referred", "Unit")
        columns = r"@{\hspace{2mm}}".join((column(PART), column(FORMULA), *"rlrrl"))
        text = longtable(columns, titles, [self._printed(entry) for entry in self.entries])
        laws = [line for entry in self.entries if not isinstance(entry.value, float) for line in self._laws(entry)]
        if not laws:
            return text
        return f"{text}\n\\paragraph{{Laws}}\\mbox{{}}\n\\begin{{align*}}\n{aligned(laws)}\n\\end{{align*}}"

    def _laws(self, entry: Entry) -> tuple[Line, Line]:
        """A law as it is and as it is at the reference shaft, which reads the motion there."""
        letter, there = self._names[symbol_of(entry)], {name: f"{text}'" for name, text in MOTION.items()}
        return Line(letter, _pieces(entry.value, MOTION)), Line(_primed(letter), _pieces(entry.referred, there))

    @cached_property
    def _names(self) -> Mapping[Symbol, str]:
        letters = {name: without_marks(text) for name, text in self.read_names().items()}
        symbols = {symbol for entry in self.entries for symbol in (symbol_of(entry), *entry.factor.free_symbols)}
        return {symbol: letters.get(symbol.name) or _fallback(symbol.name) for symbol in symbols}

    def _printed(self, entry: Entry) -> tuple[str, ...]:
        return (
            _broken(entry.part, PART),
            self._law(entry),
            _number(entry.value),
            unit(entry.unit),
            f"${printed_number(entry.ratio)}$",
            _number(entry.referred),
            unit(entry.referred_unit),
        )

    def _law(self, entry: Entry) -> str:
        """The formula, which may be broken between factors; a fraction that is too wide as a quotient on the line.

        Where a letter alone is wider than the column, by the name of its part, the formula is that of the text.
        """
        letter = self._names[symbol_of(entry)]
        if any(printed_width(letter) > FORMULA / LETTER for letter in (_primed(letter), *self._letters_in(entry))):
            return _broken(formula_of(entry), FORMULA)
        above, below = entry.factor.as_numer_denom()
        sign = "-" if above.could_extract_minus_sign() else ""
        upper, lower = (letter, *self._factors(-above if sign else above)), self._factors(below)
        fraction = rf"\frac{{{TIMES.join(upper)}}}{{{TIMES.join(lower)}}}"
        if not lower:
            law = BREAKS.join(upper)
        # letters of a fraction beside text are smaller
        elif 0.75 * printed_width(fraction) <= FORMULA / LETTER:
            law = fraction
        else:
            divisor = BREAKS.join(lower)
            law = rf"{BREAKS.join(upper)} \,/\allowbreak\, {f'({divisor})' if len(lower) > 1 else divisor}"
        return f"${_primed(letter)} = {sign}{law}$"

    def _letters_in(self, entry: Entry) -> tuple[str, ...]:
        return tuple(self._names[symbol] for symbol in (symbol_of(entry), *entry.factor.free_symbols))

    def _factors(self, product: Expr) -> tuple[str, ...]:
        """A product as LaTeX, factor by factor; nothing where it is one."""
        if product == 1:
            return ()
        names = dict(self._names)
        factors = product.as_ordered_factors()
        texts = (latex(factor, symbol_names=names, mul_symbol=TIMES) for factor in factors)
        sums = (factor.is_Add for factor in factors)
        return tuple(rf"\left({text}\right)" if total else text for text, total in zip(texts, sums, strict=True))


def _number(value: float | Expr) -> str:
    return f"${printed_number(value)}$" if isinstance(value, float) else "law"


def _pieces(law: Expr, names: Mapping[str, str]) -> tuple[str, ...]:
    """The right side of a law, in pieces between which it may be broken."""
    if isinstance(law, Table):
        points = [f"({printed_number(x)},\\, {printed_number(y)})\\," for x, y in zip(law.xs, law.ys, strict=True)]
        most = 12  # points of a table that are printed
        return (*points[:most], *([r"\dots"] if len(points) > most else []))
    return Writer(names, (), (), {}).pieces((FactoredTerms(Integer(1), Add.make_args(law)),))


def _broken(text: str, width: int) -> str:
    """A text that may be broken after an underscore, and in words that are wider than a column in mm."""
    words = (re.findall(rf"[^_]{{1,{width // LETTER}}}_*|_+", word) for word in text.split(" "))
    return " ".join(r"\allowbreak ".join(map(in_text, pieces)) for pieces in words)


def _primed(letter: str) -> str:
    """A letter with a prime before its subscript: J_{1} becomes J'_{1}."""
    base, underscore, subscript = letter.partition("_{")
    return f"{base}'{underscore}{subscript}"


def _fallback(name: str) -> str:
    """The letter of a law, which is no symbol of the equations."""
    part, _, quantity = name.rpartition(".")
    return rf"\mathrm{{{escaped(quantity)}}}_{{\mathrm{{{escaped(part)}}}}}"
