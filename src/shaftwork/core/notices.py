"""Warnings that point at the line of the user that led to them."""

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
