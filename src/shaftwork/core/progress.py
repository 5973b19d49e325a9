"""A line on a terminal's standard error that shows how far something long has come."""

from __future__ import annotations

import sys
import time

WIDTH = 40
"""Characters of the bar."""
PATIENCE, PAUSE = 1.0, 0.2
"""Nothing is shown of what takes less than the first, and then not more often than every second of these, s."""


class Progress:
    """Shows how far something has come, where standard error is a terminal."""

    def __init__(self) -> None:
        self._next = time.monotonic() + PATIENCE
        self._shown = False

    def show(self, share: float, text: str) -> None:
        """Draw the bar anew where it is time, with a text behind it."""
        if time.monotonic() < self._next or not sys.stderr.isatty():
            return
        filled = int(WIDTH * min(max(share, 0.0), 1.0))
        sys.stderr.write(f"\r[{'=' * filled}{' ' * (WIDTH - filled)}] {text}")
        sys.stderr.flush()
        self._next, self._shown = time.monotonic() + PAUSE, True

    def close(self) -> None:
        """Leave the line."""
        if self._shown:
            sys.stderr.write("\n")
