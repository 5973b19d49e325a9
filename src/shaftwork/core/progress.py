"""A line on a terminal that shows how far something long has come."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

Show = Callable[[float, str], None]
"""Told how much is done, and a word or two on it."""
FORMAT = "{desc}: {percentage:3.0f}%|{bar}| {n:.4g} of {total:.4g} {unit} [{elapsed}<{remaining}]"
PAUSE = 0.2
"""The line is drawn anew not more often than every so many seconds."""


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
    with bar_of(
        total=total, desc=stage, unit=unit, bar_format=FORMAT, mininterval=PAUSE, leave=False, dynamic_ncols=True
    ) as bar:

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
