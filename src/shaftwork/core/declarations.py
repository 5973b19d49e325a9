"""What must hold for the fields of a declaration, checked where it is written."""

from __future__ import annotations

from typing import Any

from shaftwork.core.errors import ParameterError


def refuse_fields(record: Any, /, **fields: tuple[bool, str]) -> None:
    """Refuse a record with a field that is not what it must be.

    Args:
        record: a dataclass.
        **fields: by name of a field, whether it is right, and in words what would be.

    Raises:
        ParameterError: a field is not right; names the first.
    """
    for name, (right, words) in fields.items():
        if not right:
            value = repr(getattr(record, name))
            shown = value if len(value) <= 80 else f"{value[:77]}..."
            raise ParameterError(f"{type(record).__name__}: {name} = {shown} must be {words}.")


def is_label(value: Any) -> bool:
    """Whether a text can stand behind the dot of a quantity's name: printable, without dots."""
    return isinstance(value, str) and bool(value.strip()) and value.isprintable() and "." not in value


def is_end(value: Any) -> bool:
    """Whether it can be an end of a branch: the name of a port, or None for the reference."""
    return value is None or is_label(value)


def is_pair(value: Any) -> bool:
    """Whether it can be the two ends of a branch."""
    return isinstance(value, tuple | list) and len(value) == 2 and all(map(is_end, value))
