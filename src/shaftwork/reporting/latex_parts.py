"""Pieces of LaTeX that sections are made of; numbers, units and names are escaped here alone."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from shaftwork.equations.spelling import in_text
from shaftwork.latex.nomenclature import column, table
from shaftwork.latex.printing import printed_number


class ReportPage(NamedTuple):
    """What a page of a report has room for, and how much of each kind is shown where nobody chooses.

    Args:
        width, gap: of a table and between two of its columns, mm.
        letters: of a line of the model file.
        parts: up to which a drawing can be read.
        curves: in a picture, which is then no higher than a page.
        axis: height of an axis that can be zoomed, pixels.
        marks: changes of mode up to which each is a line across the curves.
        states: whose start and end are listed.
        phases: listed of the beginning, and as many of the end, of a motion that has more.
        printed_phases: whose equations are printed, the longest.
        cycles: quantities whose load cycles are counted.
        holzer: modes in tables of their own, the lowest.
    """

    width: float = 162.0
    gap: float = 4.2
    letters: int = 96
    parts: int = 60
    curves: int = 4
    axis: int = 220
    marks: int = 60
    states: int = 40
    phases: int = 20
    printed_phases: int = 6
    cycles: int = 6
    holzer: int = 3


PAGE = ReportPage()


def number(value: float, digits: int = 5) -> str:
    """A number as a formula."""
    if math.isinf(value):
        return "unbounded"
    return f"${printed_number(float(value), digits)}$"


def columns(headings: Sequence[str], rows: Iterable[Sequence[str]], shares: Sequence[float]) -> str:
    """A table of ready LaTeX, as wide as the text; empty without rows.

    Args:
        headings: of the columns.
        rows: cells in LaTeX.
        shares: widths of the columns, of which only the ratios count.
    """
    room = PAGE.width - PAGE.gap * (len(shares) - 1)
    widths = [int(room * share / sum(shares)) for share in shares]
    body = table("".join(map(column, widths)), tuple(headings), [tuple(cells) for cells in rows])
    return f"\\begingroup\\small\n{body}\n\\endgroup" if body else ""


def listed(sentences: Iterable[str]) -> str:
    """Sentences as a list; empty without any."""
    items = "\n".join(f"\\item {in_text(sentence)}" for sentence in sentences)
    return f"\\begin{{itemize}}\n{items}\n\\end{{itemize}}" if items else ""


def picture(name: str, caption: str) -> str:
    """A figure of the report, as wide as the text, with its caption."""
    return (
        f"\\begin{{figure}}[H]\n\\centering\n\\includegraphics[width=\\linewidth]{{{name}}}\n"
        f"\\caption{{{in_text(caption)}}}\n\\end{{figure}}"
    )


def paragraphs(*texts: str) -> str:
    """Texts that say anything, one below the other."""
    return "\n\n".join(text for text in texts if text)
