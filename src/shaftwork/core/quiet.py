"""Libraries that print what their results say as well, kept from printing in the threads that run them."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

_LOCK = threading.Lock()
_silent: dict[int, int] = {}
"""Threads that print nothing now, and how often each has entered."""


class _Others:
    """A stream for all threads but the silent ones."""

    def __init__(self, stream: Any) -> None:
        self.stream = stream

    def write(self, text: str) -> int:
        """Write what another thread prints."""
        return len(text) if threading.get_ident() in _silent else self.stream.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


@contextmanager
def unprinted() -> Iterator[None]:
    """Nothing that this thread prints meanwhile is seen; what other threads print is.

    `contextlib.redirect_stdout` is of all threads: the first to leave would take it from the others, and the last
    would leave it behind for good.
    """
    thread = threading.get_ident()
    with _LOCK:
        _silent[thread] = _silent.get(thread, 0) + 1
        if sys.stdout is not None and not isinstance(sys.stdout, _Others):
            sys.stdout = _Others(sys.stdout)
    try:
        yield
    finally:
        with _LOCK:
            _silent[thread] -= 1
            if not _silent[thread]:
                del _silent[thread]
            if not _silent and isinstance(sys.stdout, _Others):
                sys.stdout = sys.stdout.stream
