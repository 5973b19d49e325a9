"""Warnings that point at the line of the user that led to them."""

from __future__ import annotations

import sys
import warnings

PACKAGE = __name__.partition(".")[0]


def warn(message: str, category: type[Warning]) -> None:
    """Warn at the line outside this package from which it was called, by whichever of its functions and however deep.

    Args:
        message: what is worth knowing.
        category: kind of warning.
    """
    level, frame = 1, sys._getframe()  # noqa: SLF001 (what `warnings` itself counts by)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] == PACKAGE:
        level, frame = level + 1, frame.f_back
    warnings.warn(message, category, stacklevel=level)
