"""Next steps in the words of whoever called: of Python, or of the command line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_commanded: ContextVar[bool] = ContextVar("commanded", default=False)


def hint(call: str, options: str) -> str:
    """The next step that a message names.

    Args:
        call: as it is written in Python.
        options: as it is written on the command line.
    """
    return options if _commanded.get() else call


@contextmanager
def on_the_command_line() -> Iterator[None]:
    """Meanwhile messages name options instead of calls."""
    before = _commanded.set(True)
    try:
        yield
    finally:
        _commanded.reset(before)
