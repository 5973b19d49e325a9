"""Pieces of LaTeX that sections are made of; numbers, units and names are escaped here alone."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from shaftwork.equations.spelling import in_text
from shaftwork.latex.nomenclature import column, table
from shaftwork.latex.printing import printed_number

WIDTH = 162.0
"""Of a table, mm."""
SPACE = 4.2
"""Between two columns, mm."""


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
    room = WIDTH - SPACE * (len(shares) - 1)
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
