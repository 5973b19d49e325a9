"""The natural frequencies that a small model keeps, misses and loses, as a table."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from shaftwork.equations.nomenclature import table as longtable
from shaftwork.equations.printing import printed_number
from shaftwork.reduce.tridiagonal_modes import Array


@dataclass(frozen=True)
class FrequencyLoss:
    """A natural frequency of a train, and of models with as few unknowns; None where they have no such mode.

    Args:
        mode: its number, from 1, without the turning of the whole.
        before: of the train, Hz.
        after: of the small model, Hz.
        error: of it, relative.
        by_modes: of a description by as many ends of the kept shaft, prescribed speeds, and modes of the rest (Craig
            and Bampton), Hz.
    """

    mode: int
    before: float
    after: float | None
    error: float | None
    by_modes: float | None = None


@dataclass(frozen=True)
class FrequencyTable:
    """The natural frequencies of a train, lowest first, and what became of them.

    Args:
        rows: one for each.
        modes: whether there is a model by modes.
    """

    rows: tuple[FrequencyLoss, ...]
    modes: bool

    @classmethod
    def of(cls, before: Array, after: Array, by_modes: Array | None) -> FrequencyTable:
        """The frequencies (n,) of a train in Hz beside those of its small models, each ascending, zero for none."""
        given = before, after, () if by_modes is None else by_modes
        was, now, other = ([float(f) for f in found if f > 0] for found in given)
        rows = (
            FrequencyLoss(k, f, found, None if found is None else found / f - 1, bound)
            for k, (f, found, bound) in enumerate(zip_longest(was, now, other), 1)
        )
        return cls(tuple(rows), by_modes is not None)

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[FrequencyLoss]:
        return iter(self.rows)

    def __getitem__(self, place: int) -> FrequencyLoss:
        """The row of a place, from 0."""
        return self.rows[place]

    def __str__(self) -> str:
        rows = [("mode", "before Hz", "after Hz", "error", "by modes Hz"), *map(_cells, self.rows)]
        return "\n".join(map(self._line, rows))

    def latex(self) -> str:
        """The table as LaTeX, a `longtable` (packages booktabs, array, longtable), frequencies in Hz."""
        titles = ("Mode", "Before, Hz", "After, Hz", "Error", "By modes, Hz")
        columns = len(titles) if self.modes else len(titles) - 1
        rows = []
        for row, (mode, _, _, error, _) in zip(self.rows, map(_cells, self.rows), strict=True):
            share = f"${error[:-1]} \\, \\%$" if error else ""
            rows.append((mode, _printed(row.before), _printed(row.after), share, _printed(row.by_modes)))
        return longtable("r" * columns, titles[:columns], [row[:columns] for row in rows])

    def _line(self, cells: Sequence[str]) -> str:
        mode, before, after, error, by_modes = cells
        line = f"{mode:>4}  {before:>10}  {after:>10}  {error:>8}"
        return f"{line}  {by_modes:>11}" if self.modes else line.rstrip()


def _cells(row: FrequencyLoss) -> tuple[str, str, str, str, str]:
    after, by_modes = ("lost" if f is None else f"{f:.6g}" for f in (row.after, row.by_modes))
    error = "" if row.error is None else f"{row.error:+z.2%}"
    return str(row.mode), f"{row.before:.6g}", after, error, by_modes


def _printed(frequency: float | None) -> str:
    return "lost" if frequency is None else f"${printed_number(frequency)}$"
