"""Tables of a report: the variables with their units, the parameters with their values."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Container, Iterator, Mapping, Sequence
from itertools import zip_longest
from typing import TYPE_CHECKING

from sympy import Basic

from shaftwork.components.tables import Table
from shaftwork.equations.notations import Letter
from shaftwork.equations.spelling import INDEX_CLOSES, INDEX_OPENS, in_text, split_index, without_marks
from shaftwork.latex.printing import Writer, printed_number
from shaftwork.latex.series import Numbers, listed, replaced, series_in
from shaftwork.network.graph import effective

if TYPE_CHECKING:
    from shaftwork.equations.records import Equations

LAWS = "Formula, or points of a table, over $t$ in s if nothing else is said"
LAW_TOO = re.compile(", also over [^;]*")
"""In the meaning of a parameter for those who set it; here it has a number."""
UNITS = {"1": "--", "ohm": r"$\Omega$"}
Cells = tuple[str, ...]


def nomenclature(
    equations: Equations,
    used: Container[str],
    noted: Mapping[str, str],
    besides: Sequence[Cells] = (),
    helpers: Sequence[Cells] = (),
) -> str:
    """The tables of the variables that equations contain, of the parameters, and of the laws that are given.

    Args:
        equations: what knows all letters.
        used: names of the variables.
        noted: what some of them are besides, as "state", by name.
        besides: rows before them, of quantities that belong to no part.
        helpers: rows after them, of letters that stand for sums and weights.
    """
    tables = (variables((equations,), used, noted, besides, helpers), parameters((equations,)), laws(equations))
    return "\n".join(filter(None, tables))


def variables(
    phases: Sequence[Equations],
    used: Container[str],
    noted: Mapping[str, str],
    besides: Sequence[Cells] = (),
    helpers: Sequence[Cells] = (),
) -> str:
    """The table of the variables of one or several phases; the other arguments are those of `nomenclature`."""
    letters = {
        letter.name: (equations.symbol_names[letter.name], letter)
        for equations in phases
        for letter in equations.letters
        if not letter.parameter and letter.name in used
    }
    rows = condensed(
        [
            (_formula(latex), _meaning(letter, noted), _owner(letter), unit(letter.unit))
            for latex, letter in letters.values()
        ]
    )
    heads = ("Variable", "Meaning", "Of", "Unit")
    return _ruled(_columns(48, 44, 34, 21), heads, [*besides, *_told_apart(tuple(rows)), *dict.fromkeys(helpers)])


def _told_apart(rows: Sequence[Cells]) -> Iterator[Cells]:
    """The rows, with their running numbers beside those meanings that several rows of a part have."""
    meanings, seen = Counter(row[1:3] for row in rows), Counter[Cells]()
    for symbol, meaning, owner, measure in rows:
        seen[meaning, owner] += 1
        several = meanings[meaning, owner] > 1
        yield symbol, f"{meaning}, no.\\ {seen[meaning, owner]}" if several else meaning, owner, measure


def parameters(
    phases: Sequence[Equations],
    origins: Mapping[str, str] | None = None,
    used: Sequence[Container[str]] = (),
) -> str:
    """The table of the parameters with their values, without those that have no effect.

    Args:
        phases: equations of the same network in one or several phases.
        origins: where values come from, in words, by "part.parameter" or by part; a column of its own where given.
        used: names in the printed equations of each phase, whose letters the table has; by default those of the first.
    """
    whence = origins or {}
    rows: dict[tuple[str, str], Cells] = {}
    for letter, latex in _parameter_letters(phases, used):
        equations = next(one for one in phases if letter.name in one.values)
        computed = letter.name not in equations.form.graph.parameters
        origin = "computed" if computed else whence.get(letter.name, whence.get(letter.owner, ""))
        rows[letter.name, latex] = (
            _formula(latex),
            in_text(LAW_TOO.sub("", letter.meaning)),
            _owner(letter),
            f"${printed_number(equations.values[letter.name])}$",
            unit(letter.unit),
            *([in_text(origin)] if whence else []),
        )
    heads = ("Parameter", "Meaning", "Of", "Value", "Unit", *(["From"] if whence else []))
    widths = (28, 30, 22, 19, 17, 22) if whence else (34, 38, 30, 21, 20)
    return table(_columns(*widths), heads, [*rows.values()])


def _parameter_letters(phases: Sequence[Equations], used: Sequence[Container[str]]) -> Iterator[tuple[Letter, str]]:
    """Parameters that have an effect, each under every letter that it is printed with."""
    printed: dict[str, list[str]] = {}
    for equations, names in zip(phases, used, strict=False):
        for letter in equations.letters:
            if letter.parameter and letter.name in names:
                printed.setdefault(letter.name, []).append(equations.symbol_names[letter.name])
    seen: set[str] = set()
    for equations in phases:
        graph = equations.form.graph
        read = effective(graph)
        for letter in equations.letters:
            if letter.name in seen or not letter.parameter:
                continue
            if letter.name in read or letter.name not in graph.parameters:
                seen.add(letter.name)
                for latex in dict.fromkeys(printed.get(letter.name, [equations.symbol_names[letter.name]])):
                    yield letter, latex


def laws(equations: Equations, origins: Mapping[str, str] | None = None) -> str:
    """The table of the laws that are given: with all points of their tables, of which formulas show some, and also
    where the phase has another one. Origins are those of `parameters`.
    """
    heads = ("Law", "Of", LAWS, "Unit", *(["From"] if origins else []))
    return table(
        _columns(*((26, 22, 54, 16, 22) if origins else (34, 24, 68, 20))), heads, [*_laws(equations, origins)]
    )


def _laws(equations: Equations, origins: Mapping[str, str] | None) -> Iterator[Cells]:
    """Rows of the laws that are given as tables or formulas."""
    whence = origins or {}
    writer = Writer({}, (), (), {})
    for part in equations.form.graph.parts:
        for name, declared in part.component.declared.items():
            law, _ = declared.magnitude(getattr(part.component, name))
            if not (declared.law and isinstance(law, Basic)):
                continue
            cells = [] if isinstance(law, Table) else [_formula(writer.latex(law))]
            for curve in sorted(law.atoms(Table), key=str):
                # in all digits, as points may lie close together
                points = [
                    rf"${printed_number(x, 15)} \mapsto {printed_number(y, 15)}$"
                    for x, y in zip(curve.xs, curve.ys, strict=True)
                ]
                # 40 in a row: rows do not run over pages
                cells += [", ".join(points[first : first + 40]) for first in range(0, len(points), 40)]
            origin = in_text(whence.get(f"{part.name}.{name}", whence.get(part.name, "")))
            heads = [(in_text(declared.meaning), breakable(part.name), unit(declared.unit), origin)]
            for (meaning, owner, measure, source), cell in zip_longest(heads, cells, fillvalue=("", "", "", "")):
                yield meaning, owner, str(cell), measure, *([source] if whence else [])


def _formula(latex: str) -> str:
    return f"${latex}$"


def _meaning(letter: Letter, noted: Mapping[str, str]) -> str:
    return in_text(f"{letter.meaning} ({noted[letter.name]})" if letter.name in noted else letter.meaning)


def _owner(letter: Letter) -> str:
    stem, index = split_index(letter.owner)
    text = breakable(stem)
    return f"{text}{INDEX_OPENS}{index}{INDEX_CLOSES}" if index else text


def breakable(name: str) -> str:
    """The name of a part, which may be broken after an underscore."""
    return r"\allowbreak ".join(map(in_text, re.findall("[^_]*_|[^_]+", name)))


def column(width: int) -> str:
    """A column of a fixed width in millimetres: LaTeX needs a second run to know the widths of others."""
    return rf">{{\raggedright\arraybackslash{{}}}}p{{{width}mm}}"


def _columns(*widths: int) -> str:
    return "".join(map(column, widths))


def unit(text: str) -> str:
    """A unit in LaTeX."""
    spaced = text.replace("*", r"\,")
    return UNITS.get(text) or rf"$\mathrm{{{spaced}}}$"


def table(columns: str, headings: Cells, rows: Sequence[Cells]) -> str:
    """A table that may run over pages; rows that differ by a running number are drawn together. Empty without rows."""
    return _ruled(columns, headings, [*condensed(rows)])


def _ruled(columns: str, headings: Cells, rows: Sequence[Cells]) -> str:
    """A table of all these rows."""
    if not rows:
        return ""
    body = "\n".join(f"{' & '.join(cells)} \\\\" for cells in rows)
    text = f"""\\begin{{longtable}}{{@{{}}{columns}@{{}}}}
\\toprule
{" & ".join(headings)} \\\\
\\midrule
\\endhead
\\bottomrule
\\endfoot
{{}}{body}
\\end{{longtable}}"""
    return without_marks(text)


def condensed(rows: Sequence[Cells]) -> Iterator[Cells]:
    """Rows with those that differ by a running number drawn together."""
    series = series_in(["\n".join(cells) for cells in rows])
    inside = replaced(series)
    for place, cells in enumerate(rows):
        if place in series:
            for stretch in series[place].stretches:
                yield _drawn_together(stretch, {number: rows[series[place].members[number]] for number in stretch})
        elif place not in inside:
            yield cells


def _drawn_together(stretch: Numbers, members: Mapping[int, Cells]) -> Cells:
    """The rows of a stretch as one: every cell lists what is in it, once where that is always the same."""
    columns = range(len(members[stretch[0]]))
    cells = ({number: row[column] for number, row in members.items()} for column in columns)
    return tuple(
        cell[stretch[0]] if len(set(cell.values())) == 1 else listed(stretch, cell.__getitem__, r"\ldots")
        for cell in cells
    )
