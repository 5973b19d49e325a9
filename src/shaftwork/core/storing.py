"""How records are stored: pickled, copied, and sent to other processes."""

from __future__ import annotations

from dataclasses import fields
from typing import Any


class StoredByFields:
    """A dataclass that is stored as its fields; what was worked out from them, compiled code too, is made again."""

    def __getstate__(self) -> dict[str, Any]:
        return {item.name: getattr(self, item.name) for item in fields(self)}  # type: ignore[arg-type]
