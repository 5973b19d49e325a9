"""Transfer functions as LaTeX."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from sympy import Add, Expr, Integer, Symbol, default_sort_key

from shaftwork.equations.assembly import FactoredTerms
from shaftwork.equations.notations import QUANTITIES
from shaftwork.equations.small_motions.tableau import S
from shaftwork.equations.spelling import escaped, without_marks
from shaftwork.latex.blocks import Blocks
from shaftwork.latex.printing import LINE_WIDTH, Line, Writer, aligned, printed_width

if TYPE_CHECKING:
    from shaftwork.equations.small_motions.point_slopes import Slope
    from shaftwork.equations.small_motions.transfer import TransferFunction

REAL = Symbol("s", real=True)
"""Stands for s in print, where all letters are real."""


def typeset_quotient(function: TransferFunction) -> str:
    """The equation for a LaTeX document, and below it what the letters of slopes stand for."""
    return f"\\begin{{align*}}\n{without_marks(aligned(tuple(_lines(function))))}\n\\end{{align*}}"


def _lines(function: TransferFunction) -> Iterator[Line]:
    equations = function.equations
    names, blocks = equations.symbol_names, Blocks(equations, values=False)
    letters = _letters(function.slopes, set(names.values()))
    printed = {**names, **letters, REAL.name: "s"}
    writer = Writer(printed, {*equations.values, *letters}, (), {}, equations.inverses)
    above, below = (writer.pieces(_powers(polynomial)) for polynomial in function.printed)
    left = rf"\frac{{{_named(function.output, names)}}}{{{_named(function.input, names)}}}"
    if 1.5 * max(printed_width(" ".join(pieces)) for pieces in (above, below)) < LINE_WIDTH:
        yield Line(left, (rf"\frac{{{' '.join(above)}}}{{{' '.join(below)}}}",))
    else:
        yield Line(left, (r"\frac{Z(s)}{N(s)}",))
        yield Line("Z(s)", above)
        yield Line("N(s)", below)
    for letter, slope in function.slopes.items():
        yield Line(letters[letter.name], _derivative(slope, blocks.writer))


def _named(name: str, names: Mapping[str, str]) -> str:
    """The letter of a quantity, "line.tau_a" as tau with the name of its part, where no equation has one for it."""
    part, _, quantity = name.rpartition(".")
    stem, _, end = quantity.partition("_")
    index = rf"\mathrm{{{escaped(part)}}}{f',{escaped(end)}' if end else ''}"
    letter = QUANTITIES[stem].latex if stem in QUANTITIES else stem
    return names.get(name, rf"{letter}_{{{index}}}")


def _letters(slopes: Mapping[Symbol, Slope], taken: set[str]) -> dict[str, str]:
    """A letter for each slope, with the name of its part: k, or another where the part has one."""
    letters: dict[str, str] = {}
    for symbol, slope in slopes.items():
        number = symbol.name.partition("(")[0].partition("_")[2]
        index = rf"\mathrm{{{escaped(slope.part)}}}{f',{number}' if number else ''}"
        options = (rf"{base}_{{{index}}}" for base in ("k", r"\kappa", r"\lambda"))
        whole = rf"\mathrm{{{escaped(symbol.name)}}}"
        letters[symbol.name] = next((text for text in options if text not in taken), whole)
    return letters


def _powers(polynomial: Expr) -> list[FactoredTerms]:
    """The terms of a polynomial in s, the highest power first."""
    powers: dict[int, list[Expr]] = {}
    for term in sorted(Add.make_args(polynomial.expand()), key=default_sort_key):  # else each process has its order
        coefficient, power = term.as_independent(S)
        powers.setdefault(int(power.as_base_exp()[1]) if power != 1 else 0, []).append(coefficient)
    return [FactoredTerms(REAL**power, tuple(terms)) for power, terms in sorted(powers.items(), reverse=True)]


def _derivative(slope: Slope, writer: Writer) -> tuple[str, ...]:
    """How a torque changes with what its law reads, or the slope in full where the torque is no quantity by itself."""
    sign, letter = slope.of.as_coeff_Mul()
    if not (letter.is_Symbol and slope.by.is_Symbol):
        return writer.pieces([FactoredTerms(Integer(1), Add.make_args(slope.value))])
    minus = "-" if sign < 0 else ""
    return (rf"{minus}\frac{{\partial {writer.latex(letter)}}}{{\partial {writer.latex(slope.by)}}}",)
