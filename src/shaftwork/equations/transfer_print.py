"""Transfer functions as LaTeX."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from sympy import Add, Expr, Integer, Symbol, default_sort_key

from shaftwork.equations.assembly import FactoredTerms
from shaftwork.equations.blocks import Blocks
from shaftwork.equations.printing import LINE_WIDTH, Line, Writer, aligned, printed_width
from shaftwork.equations.slopes import Slope
from shaftwork.equations.spelling import escaped, without_marks
from shaftwork.equations.tableau import S

if TYPE_CHECKING:  # the record prints itself through this module
    from shaftwork.equations.transfer import TransferFunction

REAL = Symbol("s", real=True)
"""Stands for s in print, where all letters are real."""
GREEK = {"tau": r"\tau", "omega": r"\omega", "phi": r"\varphi", "psi": r"\psi"}
"""The letters of quantities whose names are those of Greek ones."""


def in_latex(made: TransferFunction) -> str:
    """The quotient, its polynomials by themselves where they are wide, and what letters of slopes stand for."""
    return f"\\begin{{align*}}\n{without_marks(aligned(tuple(_lines(made))))}\n\\end{{align*}}"


def _lines(made: TransferFunction) -> Iterator[Line]:
    names, blocks = made.equations.symbol_names, Blocks(made.equations, values=False)
    letters = _letters(made.slopes, set(names.values()))
    writer = Writer(
        {**names, **letters, REAL.name: "s"}, {*made.equations.values, *letters}, (), {}, made.equations.inverses
    )
    above, below = (writer.pieces(_powers(polynomial)) for polynomial in made.printed)
    left = rf"\frac{{{_named(made.output, names)}}}{{{_named(made.input, names)}}}"
    if 1.5 * max(printed_width(" ".join(pieces)) for pieces in (above, below)) < LINE_WIDTH:
        yield Line(left, (rf"\frac{{{' '.join(above)}}}{{{' '.join(below)}}}",))
    else:
        yield Line(left, (r"\frac{Z(s)}{N(s)}",))
        yield Line("Z(s)", above)
        yield Line("N(s)", below)
    for letter, slope in made.slopes.items():
        yield Line(letters[letter.name], _derivative(slope, blocks.writer))


def _named(name: str, names: Mapping[str, str]) -> str:
    """The letter of a quantity, "line.tau_a" as tau with the name of its part, where no equation has one for it."""
    part, _, quantity = name.rpartition(".")
    stem, _, end = quantity.partition("_")
    index = rf"\mathrm{{{escaped(part)}}}{f',{escaped(end)}' if end else ''}"
    return names.get(name, rf"{GREEK.get(stem, stem)}_{{{index}}}")


def _letters(slopes: Mapping[Symbol, Slope], taken: set[str]) -> dict[str, str]:
    """A letter for each slope, with the name of its part: k, or another where the part has one."""
    found: dict[str, str] = {}
    for symbol, slope in slopes.items():
        number = symbol.name.partition("(")[0].partition("_")[2]
        index = rf"\mathrm{{{escaped(slope.part)}}}{f',{number}' if number else ''}"
        options = (rf"{base}_{{{index}}}" for base in ("k", r"\kappa", r"\lambda"))
        whole = rf"\mathrm{{{escaped(symbol.name)}}}"
        found[symbol.name] = next((text for text in options if text not in taken), whole)
    return found


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
