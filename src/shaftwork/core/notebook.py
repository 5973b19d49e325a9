"""Results as tables of HTML, for notebooks."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape


def html_table(title: str, headings: Sequence[str], rows: Sequence[Sequence[str]], note: str = "") -> str:
    """A table with a title above it and a note below; whatever names contain is shown as it is."""
    shown = 40  # rows that a screen has room for
    head = "".join(f"<th>{escape(text)}</th>" for text in headings)
    body = "".join(f"<tr>{''.join(f'<td>{escape(text)}</td>' for text in row)}</tr>" for row in rows[:shown])
    more = f"and {len(rows) - shown} more" if len(rows) > shown else ""
    below = "".join(f"<p>{escape(text)}</p>" for text in (more, note) if text)
    table = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>" if body else ""
    return f"<p><b>{escape(title)}</b></p>{table}{below}"
