"""Tables of a report: the variables with their units, the parameters with their values."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from shaftwork.equations.notation import INDEX_CLOSES, INDEX_OPENS, Letter, in_text, split_index, without_marks
from shaftwork.equations.printing import printed_number
from shaftwork.equations.series import SHORTEST_SERIES, runs, together

if TYPE_CHECKING:  # the records print themselves through this module
    from shaftwork.equations.records import Equations

UNITS = {"1": "--", "ohm": r"$\Omega$"}
Cells = tuple[str, ...]


def nomenclature(equations: Equations) -> str:
    """The table of the variables that the equations contain, and that of the parameters."""
    names, values = equations.symbol_names, equations.form.graph.parameters
    states = {state.name for state in equations.form.states}
    used = states | {symbol.name for row in equations.rows for symbol in row.left.free_symbols | row.right.free_symbols}
    variables = [
        (_formula(names[letter.name]), _meaning(letter, states), _owner(letter), unit(letter.unit))
        for letter in equations.letters
        if not letter.parameter and letter.name in used
    ]
    parameters = [
        (
            _formula(names[letter.name]),
            letter.meaning,
            _owner(letter),
            f"${printed_number(values[letter.name])}$",
            unit(letter.unit),
        )
        for letter in equations.letters
        if letter.parameter
    ]
    tables = (
        table("llp{45mm}l", ("Variable", "Meaning", "Of", "Unit"), variables),
        table("lp{45mm}p{30mm}rl", ("Parameter", "Meaning", "Of", "Value", "Unit"), parameters),
    )
    return "\n".join(filter(None, tables))


def _formula(latex: str) -> str:
    return f"${latex}$"


def _meaning(letter: Letter, states: set[str]) -> str:
    return f"{letter.meaning} (state)" if letter.name in states else letter.meaning


def _owner(letter: Letter) -> str:
    stem, index = split_index(letter.owner)
    return f"{in_text(stem)}{INDEX_OPENS}{index}{INDEX_CLOSES}" if index else in_text(stem)


def unit(text: str) -> str:
    """A unit in LaTeX."""
    spaced = text.replace("*", r"\,")
    return UNITS.get(text) or rf"$\mathrm{{{spaced}}}$"


def table(columns: str, headings: Cells, rows: Sequence[Cells]) -> str:
    """A table that may run over pages; rows that differ by a running number are drawn together. Empty without rows."""
    if not rows:
        return ""
    body = "\n".join(f"{' & '.join(cells)} \\\\" for cells in _condensed(rows))
    text = f"""\\begin{{longtable}}{{@{{}}{columns}@{{}}}}
\\toprule
{" & ".join(headings)} \\\\
\\midrule
\\endhead
\\bottomrule
\\endfoot
{body}
\\end{{longtable}}"""
    return without_marks(text)


def _condensed(rows: Sequence[Cells]) -> Iterator[Cells]:
    gathered = [rows[place] for place in together(["\n".join(cells) for cells in rows])]
    for run in runs(["\n".join(cells) for cells in gathered]):
        members = gathered[run.start : run.stop]
        if len(members) < SHORTEST_SERIES:
            yield from members
        else:
            pairs = zip(members[0], members[-1], strict=True)
            yield tuple(first if first == last else rf"{first}, \ldots, {last}" for first, last in pairs)
