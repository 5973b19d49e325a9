"""Tables of the orders of torques that swing: each once, for all cylinders that have it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

from shaftwork.components.harmonics import HarmonicTable
from shaftwork.equations.spelling import in_text
from shaftwork.latex.nomenclature import Cells, breakable, unit
from shaftwork.latex.printing import Line, printed_number
from shaftwork.network.graph import CircuitGraph


@dataclass(frozen=True, eq=False)
class HarmonicTables:
    """The tables of orders in the laws of a network.

    Args:
        graph: the network.
    """

    graph: CircuitGraph

    @cached_property
    def owners(self) -> dict[HarmonicTable, list[str]]:
        """For each table the names of the parts that swing by it."""
        owners: dict[HarmonicTable, list[str]] = {}
        for branch in self.graph.branches:
            for table in branch.template.printed.atoms(HarmonicTable):
                names = owners.setdefault(table, [])
                if (name := self.graph.parts[branch.part].name) not in names:
                    names.append(name)
        return owners

    @cached_property
    def marked(self) -> dict[HarmonicTable, HarmonicTable]:
        """The tables with letters that tell them apart: T_k alone, or T_{A, k}, T_{B, k} and so on."""
        several = len(self.owners) > 1
        return {
            table: HarmonicTable(table.harmonics, rf"\mathrm{{{_letters(number)}}}" if several else "")
            for number, table in enumerate(self.owners)
        }

    @property
    def remark(self) -> str:
        """Whose letters they are, in which units, and at which speed."""
        return " ".join(
            self._of_table(table, [in_text(name) for name in names]) for table, names in self.owners.items()
        )

    def _of_table(self, table: HarmonicTable, names: Sequence[str]) -> str:
        harmonics, (amplitude, phase) = table.harmonics, self.marked[table].letters
        *first, last = names
        parts = f"{', '.join(first)} and {last}" if first else last
        text = rf"${amplitude}$ in $\mathrm{{N\,m}}$ and ${phase}$ in $\mathrm{{rad}}$ are those of {parts}"
        if harmonics.omega_n is not None:
            text += rf", the amplitudes at ${printed_number(harmonics.omega_n)}\,\mathrm{{rad/s}}$"
        if harmonics.speeds:
            text += rf"; between the speeds ${amplitude} \cos {phase}$ and ${amplitude} \sin {phase}$ are linear"
        return f"{text}."

    def lines(self) -> Iterator[Line]:
        """The tables, as many orders beside each other as have room on a line."""
        most = 6
        for table, marked in self.marked.items():
            harmonics = table.harmonics
            for first in range(0, len(harmonics.orders), most):
                yield from _lines(marked, slice(first, first + most))

    def helpers(self) -> Iterator[Cells]:
        """Rows of a nomenclature: the letters of the tables."""
        for table, names in self.owners.items():
            amplitude, phase = self.marked[table].letters
            owner = breakable(names[0]) + (r", \ldots" if len(names) > 1 else "")
            yield f"${amplitude}$", "amplitude of order $k$", owner, unit("N*m")
            yield f"${phase}$", "phase of order $k$", owner, unit("rad")


def _letters(number: int) -> str:
    """A, B, ..., Z, AA, AB, ..."""
    before, last = divmod(number, 26)
    return (_letters(before - 1) if before else "") + chr(ord("A") + last)


def _lines(table: HarmonicTable, there: slice) -> Iterator[Line]:
    """Some orders in columns, above their amplitudes and phases; at each speed where there are several."""
    harmonics, letters = table.harmonics, table.letters
    sizes, turns = harmonics.amplitudes, harmonics.phases
    if not harmonics.speeds:
        yield _line(letters, (harmonics.orders[there], sizes[there], turns[there]))
        return
    for speed, *rows in zip(harmonics.speeds, sizes, turns, strict=True):
        at = rf"({printed_number(speed)}\,\mathrm{{rad/s}})"
        yield _line([letter + at for letter in letters], (harmonics.orders[there], *(row[there] for row in rows)))


def _line(letters: Iterable[str], rows: Iterable[Sequence[float]]) -> Line:
    digits = 5  # more than any torque of a cylinder is known to
    values = (" & ".join(printed_number(value, digits) for value in row) for row in rows)
    return Line(_matrix(("k", *letters)), (_matrix(values),))


def _matrix(rows: Iterable[str]) -> str:
    return r"\begin{bmatrix} " + r" \\ ".join(rows) + r" \end{bmatrix}"
