"""Texts for one screen: what a record says of itself, whatever its size, and a line on how far something has come."""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from typing import Any

LINES, COLUMNS = 25, 100
"""Size of the screen."""
ROWS, MOST_MODES = 12, 30
"""Of a printed table that could have any number of them: half a screen; of one of modes or resonances: a page."""
Show = Callable[[float, str], None]
"""Told how much is done, and a word or two on it."""
FORMAT = "{desc}: {percentage:3.0f}%|{bar}| {n:.4g} of {total:.4g} {unit} [{elapsed}<{remaining}]"


def on_one_screen(title: str, lines: Iterable[str], count: int) -> str:
    """A title and lines below it; of too many lines the first ones, and how many more there are.

    Args:
        title: first line.
        lines: the others; those that do not fit are not even made.
        count: of the lines.
    """
    shown = list(islice(lines, LINES - 1 if count < LINES else LINES - 2))
    rest = [f"  ... and {count - len(shown)} more"] if count > len(shown) else []
    return "\n".join(shorter(line) for line in (title, *shown, *rest))


def named(title: str, names: Sequence[str], most: int = 3) -> list[str]:
    """Names behind a title, on at most some lines; of too many names the first ones, and how many more there are."""
    if not names:
        return []
    head = f"  {title}: "
    shown, text = 0, ""
    for name in names:
        longer = f"{text}, {name}" if text else name
        left = f" and {len(names) - shown} more"
        if len(textwrap.wrap(head + longer + left, COLUMNS, subsequent_indent="    ")) > most and shown:
            text += left
            break
        text, shown = longer, shown + 1
    return textwrap.wrap(head + text, COLUMNS, subsequent_indent="    ", break_on_hyphens=False)[:most]


def shorter(text: str) -> str:
    """A line that fits the screen."""
    return text if len(text) <= COLUMNS else f"{text[: COLUMNS - 3]}..."


def in_lines(title: str, width: float, size: float = 12.0) -> str:
    """The title of a picture in as many lines as it needs.

    Args:
        title: the text.
        width: of the picture, in.
        size: of the type, pt.
    """
    character = 0.55 * size / 72  # mean width, in: a point is 1/72 in
    return textwrap.fill(title, int(width / character), break_on_hyphens=False)


def counted(number: int, what: str) -> str:
    """A number and what it counts: "1 node", "2 nodes", "2 branches"."""
    return f"{number} {what}{'' if number == 1 else 'es' if what.endswith('ch') else 's'}"


@contextmanager
def progress(total: float, unit: str, stage: str) -> Iterator[Show]:
    """Show on standard error, where that is a terminal and tqdm is installed (extra `progress`), how far something is.

    Args:
        total: how much there is to do.
        unit: of what.
        stage: words for the time before anything is done.
    """
    bar_of = _tqdm() if sys.stderr.isatty() else None
    if bar_of is None:
        yield lambda _done, _stage: None
        return
    with bar_of(total=total, desc=stage, unit=unit, bar_format=FORMAT, leave=False, dynamic_ncols=True) as bar:

        def show(done: float, stage: str) -> None:
            bar.set_description_str(stage, refresh=False)
            bar.update(max(done - bar.n, 0))  # engines may look at a time twice

        yield show


def _tqdm() -> Any:
    try:
        from tqdm import tqdm
    except ImportError:
        return None
    return tqdm


def in_columns(rows: Sequence[Sequence[str]], numbers: Container[int] = ()) -> list[str]:
    """Rows of as many cells as lines, every column as wide as its widest cell; columns of numbers end alike."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    sides = [str.rjust if column in numbers else str.ljust for column in range(len(widths))]
    cells = ([side(*cell) for side, cell in zip(sides, zip(row, widths, strict=True), strict=True)] for row in rows)
    return ["  ".join(row).rstrip() for row in cells]
