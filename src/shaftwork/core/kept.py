"""A cache of the last few results of something costly, for any number of threads."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable
from typing import Any, Generic, TypeVar

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")


class Kept(Generic[Key, Value]):
    """The last few values, by key.

    Threads that need the same key at once may compute it twice, and all get the first value.

    Args:
        most: how many are kept.
    """

    def __init__(self, most: int) -> None:
        self._most, self._values, self._lock = most, dict[Key, Value](), threading.Lock()

    def __call__(self, key: Key, make: Callable[[], Value]) -> Value:
        """The value of a key, computed where it is not there."""
        if (value := self._values.get(key)) is not None:
            return value
        value = make()  # may take long, and ask for others of its kind
        with self._lock:
            while key not in self._values and len(self._values) >= self._most:
                del self._values[next(iter(self._values))]
            return self._values.setdefault(key, value)

    def __reduce__(self) -> tuple[Any, ...]:
        return Kept, (self._most,)  # locks cannot be stored
