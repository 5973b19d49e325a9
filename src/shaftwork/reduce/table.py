"""The table of a reduction: every parameter before and after, with its formula, as text and as LaTeX."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from sympy import Expr, Symbol, latex

from shaftwork.core.errors import SignalError
from shaftwork.equations.nomenclature import table as longtable
from shaftwork.equations.nomenclature import unit
from shaftwork.equations.notation import without_marks
from shaftwork.equations.printing import printed_number
from shaftwork.equations.spelling import escaped, in_text
from shaftwork.reduce.referred_parts import Entry

HEADINGS = ("part", "quantity", "value", "unit", "ratio", "referred", "unit", "formula")
WIDEST = 28
"""Characters of a law in the text; a longer one is cut."""


@dataclass(frozen=True, eq=False)
class ReductionTable:
    """What became of every parameter at a reference shaft.

    Args:
        to: node of the reference shaft.
        entries: in the order of the network.
        read_names: gives LaTeX of the symbols of the network by name, when it is asked for.
    """

    to: str
    entries: tuple[Entry, ...]
    read_names: Callable[[], Mapping[str, str]]

    def __len__(self) -> int:
        return len(self.entries)

    def __iter__(self) -> Iterator[Entry]:
        return iter(self.entries)

    def __getitem__(self, name: str) -> Entry:
        """The entry of a parameter, "shaft.c".

        Raises:
            SignalError: there is none.
        """
        known = {f"{entry.part}.{entry.quantity}": entry for entry in self.entries}
        if name not in known:
            raise SignalError(f"No parameter '{name}' was referred to '{self.to}'. There are: {', '.join(known)}.")
        return known[name]

    def __str__(self) -> str:
        rows = [HEADINGS, *(_cells(entry) for entry in self.entries)]
        widths = [max(len(row[column]) for row in rows) for column in range(len(HEADINGS))]
        lines = ("  ".join(map(str.ljust, row, widths)).rstrip() for row in rows)
        return "\n".join((f"referred to {self.to}", *lines))

    def latex(self) -> str:
        """The table as LaTeX, a `longtable` in the letters of the equations (packages booktabs, array, longtable)."""
        titles = ("Part", "Formula", "Value", "Unit", "Ratio", "Referred", "Unit")
        columns = "ll" + "rl" + "r" + "rl"
        return longtable(columns, titles, [self._printed(entry) for entry in self.entries])

    @cached_property
    def _names(self) -> Mapping[Symbol, str]:
        known = {name: without_marks(text) for name, text in self.read_names().items()}
        symbols = {symbol for entry in self.entries for symbol in (_own(entry), *entry.factor.free_symbols)}
        return {symbol: known.get(symbol.name) or _fallback(symbol.name) for symbol in symbols}

    def _printed(self, entry: Entry) -> tuple[str, ...]:
        own = self._names[_own(entry)]
        above, below = (self._factors(factor) for factor in entry.factor.as_numer_denom())
        law = r" \, ".join((own, *above))
        law = rf"\frac{{{law}}}{{{''.join(below)}}}" if below else law
        return (
            in_text(entry.part),
            f"${_primed(own)} = {law}$",
            _number(entry.value),
            unit(entry.unit),
            f"${printed_number(entry.ratio)}$",
            _number(entry.referred),
            unit(entry.referred_unit),
        )

    def _factors(self, product: Expr) -> tuple[str, ...]:
        """A product as LaTeX, nothing where it is one."""
        if product == 1:
            return ()
        text = latex(product, symbol_names=dict(self._names), mul_symbol=r"\,")
        return (rf"\left({text}\right)" if product.is_Add else text,)


def _own(entry: Entry) -> Symbol:
    return Symbol(f"{entry.part}.{entry.quantity}", real=True)


def _formula(entry: Entry) -> str:
    above, below = entry.factor.as_numer_denom()
    text = str(_own(entry)) if above == 1 else f"{_own(entry)} * {_bracketed(above)}"
    return text if below == 1 else f"{text} / {_bracketed(below)}"


def _bracketed(product: Expr) -> str:
    return f"({product})" if product.args and not product.is_Pow else str(product)


def _cells(entry: Entry) -> tuple[str, ...]:
    value, ratio, referred = (_text(number) for number in (entry.value, entry.ratio, entry.referred))
    return (entry.part, entry.quantity, value, entry.unit, ratio, referred, entry.referred_unit, _formula(entry))


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    shown = str(value)
    return shown if len(shown) <= WIDEST else f"{shown[: WIDEST - 4]} ..."


def _number(value: float | Expr) -> str:
    return f"${printed_number(value)}$" if isinstance(value, float) else "law"


def _primed(letter: str) -> str:
    """A letter with a prime before its subscript: J_{1} becomes J'_{1}."""
    base, underscore, subscript = letter.partition("_{")
    return f"{base}'{underscore}{subscript}"


def _fallback(name: str) -> str:
    """The letter of a law, which is no symbol of the equations."""
    part, _, quantity = name.rpartition(".")
    return rf"\mathrm{{{escaped(quantity)}}}_{{\mathrm{{{escaped(part)}}}}}"
