"""A line on a terminal's standard error that shows how far a long study has come."""

from __future__ import annotations

import sys
import time

WIDTH = 40
"""Characters of the bar."""
PATIENCE, PAUSE = 1.0, 0.2
"""Nothing is shown of what takes less than the first, and then not more often than every second of these, s."""


class Progress:
    """Shows how many things are done.

    Args:
        total: of them.
        noun: what they are called.
    """

    def __init__(self, total: int, noun: str) -> None:
        self._total, self._noun, self._next = total, noun, time.monotonic() + PATIENCE
        self._shown = False

    def show(self, done: int, remark: str = "") -> None:
        """Draw the bar anew, where there is a terminal and it is time."""
        if time.monotonic() < self._next or not sys.stderr.isatty():
            return
        filled = WIDTH * done // max(self._total, 1)
        text = f"\r[{'=' * filled}{' ' * (WIDTH - filled)}] {done} of {self._total} {self._noun}{remark}"
        sys.stderr.write(text)
        sys.stderr.flush()
        self._next, self._shown = time.monotonic() + PAUSE, True

    def close(self) -> None:
        """Leave the line."""
        if self._shown:
            sys.stderr.write("\n")
