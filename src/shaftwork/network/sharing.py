"""What follows from a part's class, laws and zeros, worked out once for all parts that are alike."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from typing import Any, Generic, TypeVar

from shaftwork.components.base import Component
from shaftwork.components.modes import ModeChoice

T = TypeVar("T")
Work = Callable[[Component, Mapping[str, Any], tuple[ModeChoice, ...]], T]


class Shared(Generic[T]):
    """A result for each class of parts, pattern of zeros, laws and choices of modes.

    A part may look at its own numbers besides, as a shaft does for a mesh that suits its length. What it reads is
    noted, and a part that differs in any of that gets a result of its own.

    Args:
        work: makes the result of a part, its values in SI and the choices of its modes.
    """

    def __init__(self, work: Work[T]) -> None:
        self._work = work
        self._results: dict[Any, list[tuple[Mapping[str, Any], T]]] = {}

    def of(
        self, part: Component, values: Mapping[str, Any], choices: tuple[ModeChoice, ...] = ()
    ) -> tuple[T, Mapping[str, Any]]:
        """The result for a part, and what was read of such a part besides; arguments as of `work`."""
        pattern = tuple((float, bool(value)) if isinstance(value, float) else value for value in values.values())
        results = self._results.setdefault((type(part), pattern, choices), [])
        for read, result in results:
            if all(_same(getattr(part, name), value) for name, value in read.items()):
                return result, read
        read = dict[str, Any]()
        result = self._work(_noting(part, read), values, choices)
        results.append((read, result))
        return result, read


def _same(first: Any, second: Any) -> bool:
    try:
        return first is second or bool(first == second)
    except Exception:  # noqa: BLE001 (arrays, quantities of other units: whatever does not compare is another value)
        return False


def _noting(part: Component, read: dict[str, Any]) -> Component:
    """A copy of a part that notes which of its own values are read."""
    cls, fields = type(part), frozenset(part.__dataclass_fields__)

    def __getattribute__(self: Any, name: str) -> Any:  # noqa: N807
        if name in fields:
            read[name] = cls.__getattribute__(self, name)
        elif name == "__dict__":
            read.update({field: cls.__getattribute__(self, field) for field in fields})
        return cls.__getattribute__(self, name)

    noting = copy.copy(part)
    members = {"__getattribute__": __getattribute__, "declared": cls.declared, "__doc__": cls.__doc__}
    object.__setattr__(noting, "__class__", type(cls.__name__, (cls,), members))
    return noting
