"""How records are stored: pickled, copied, and sent to other processes."""

from __future__ import annotations

import sys
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any


class StoredByFields:
    """A dataclass that is stored as its fields; what was worked out from them, compiled code too, is made again."""

    def __getstate__(self) -> dict[str, Any]:
        return {item.name: getattr(self, item.name) for item in fields(self)}  # type: ignore[arg-type]


def is_found_elsewhere(thing: Any) -> bool:
    """Whether another process finds a function or a class, or the class of something else, by its name.

    It does not find what is inside a function, in a notebook, or in a script that is no file.
    """
    while isinstance(thing, partial):
        thing = thing.func
    named = thing if hasattr(thing, "__qualname__") else type(thing)
    is_here = getattr(named, "__module__", "") == "__main__"
    return "<" not in named.__qualname__ and not (
        is_here and not Path(getattr(sys.modules["__main__"], "__file__", "")).is_file()
    )
