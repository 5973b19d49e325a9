"""What is costly to make and asked for again: the last few are kept, whichever threads ask."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable
from typing import Any, Generic, TypeVar

Key = TypeVar("Key", bound=Hashable)
Made = TypeVar("Made")


class Kept(Generic[Key, Made]):
    """The last few of what was made, by what it was made for.

    Threads that ask for the same at once may make it twice, and all get the first. What one thread has asked for is
    its own, whatever others ask for meanwhile.

    Args:
        most: how many are kept.
    """

    def __init__(self, most: int) -> None:
        self._most, self._made, self._lock = most, dict[Key, Made](), threading.Lock()

    def __call__(self, key: Key, make: Callable[[], Made]) -> Made:
        """What belongs to a key, made where it is not there."""
        if (found := self._made.get(key)) is not None:
            return found
        made = make()  # may take long, and ask for others of its kind
        with self._lock:
            while key not in self._made and len(self._made) >= self._most:
                del self._made[next(iter(self._made))]
            return self._made.setdefault(key, made)

    def __reduce__(self) -> tuple[Any, ...]:
        return Kept, (self._most,)  # locks cannot be stored
