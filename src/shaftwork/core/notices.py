"""What a user is told: warnings that point at the line that led to them, and next steps in the words of the caller."""

from __future__ import annotations

import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from shaftwork.core.errors import AccuracyWarning

PACKAGE = __name__.partition(".")[0]
FILTERS = threading.RLock()
"""To be held around `warnings.catch_warnings`, whose filters are of all threads: if two overlap, one stays for good."""


class PulsationWarning(AccuracyWarning):
    """What pulsates with the angle of a shaft that turns is linearised at one angle."""


_muted: ContextVar[tuple[type[Warning], ...]] = ContextVar("muted", default=())
_said: ContextVar[set[str] | None] = ContextVar("said", default=None)
_option: ContextVar[str] = ContextVar("option", default="")
"""The option of a command that gives values by name; none in Python."""
VALUES = "--at"
"""How such an option is written in `hint`."""


def warn(message: str, category: type[Warning]) -> None:
    """Warn at the line outside this package from which it was called, by whichever of its functions and however deep.

    Args:
        message: what is worth knowing.
        category: kind of warning.
    """
    said = _said.get()
    if issubclass(category, _muted.get()) or (said is not None and message in said):
        return
    if said is not None:
        said.add(message)
    level, frame = 1, sys._getframe()  # noqa: SLF001 (what `warnings` itself counts by)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] == PACKAGE:
        level, frame = level + 1, frame.f_back
    warnings.warn(message, category, stacklevel=level)


@contextmanager
def muted(*categories: type[Warning]) -> Iterator[None]:
    """This thread's `warn` of these kinds says nothing meanwhile: its author has been warned before.

    Args:
        categories: kinds of warnings.
    """
    before = _muted.set((*_muted.get(), *categories))
    try:
        yield
    finally:
        _muted.reset(before)


@contextmanager
def once() -> Iterator[None]:
    """This thread's `warn` gives each message once meanwhile, of whatever is computed again and again."""
    before = _said.set(set())
    try:
        yield
    finally:
        _said.reset(before)


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
