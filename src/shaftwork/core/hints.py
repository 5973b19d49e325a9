"""Next steps in the words of whoever called: of Python, or of the command line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_option: ContextVar[str] = ContextVar("option", default="")
"""The option of a command that gives values by name; none in Python."""
VALUES = "--at"
"""How such an option is written in `hint`."""


def hint(call: str, options: str) -> str:
    """The next step that a message names.

    Args:
        call: as it is written in Python.
        options: as it is written on the command line, with `--at` for values by name.
    """
    return options.replace(f"{VALUES} ", f"{_option.get()} ") if _option.get() else call


@contextmanager
def on_the_command_line(option: str = VALUES) -> Iterator[None]:
    """Meanwhile messages name options instead of calls; `option` is that which gives values by name."""
    before = _option.set(option)
    try:
        yield
    finally:
        _option.reset(before)
