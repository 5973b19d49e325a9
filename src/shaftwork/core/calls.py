"""Calls from several threads, of compiled libraries and of users: Ctrl-C, errors, prints, and a cache."""

from __future__ import annotations

import contextvars
import sys
import threading
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from typing import Any, Generic, TypeVar

from shaftwork.core.errors import ParameterError

Result = TypeVar("Result")
_LOCK = threading.Lock()
_silent: dict[int, int] = {}
"""Threads that print nothing now, and how often each has entered."""


def interruptible(function: Callable[..., Result], *arguments: Any, **options: Any) -> Result:
    """Call a function that stays in compiled code for seconds, such as LAPACK's, so that Ctrl-C ends the wait.

    Python notices Ctrl-C in the main thread alone, and not before compiled code returns there. So the function runs in
    a thread of its own, and the main thread waits. After Ctrl-C the function runs to its end unseen. In any other
    thread it is called as it is.

    Args:
        function: releases Python's lock while it works.
        arguments: of the function.
        options: its named arguments.
    """
    if threading.current_thread() is not threading.main_thread():
        return function(*arguments, **options)
    context, outcome = contextvars.copy_context(), dict[str, Any]()

    def work() -> None:
        try:
            outcome["result"] = context.run(function, *arguments, **options)
        except BaseException as error:  # noqa: BLE001 (raised again where the function was called)
            outcome["error"] = error

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    while thread.is_alive():
        thread.join(0.1)  # s: on Windows Python's waiting cannot be interrupted, and Ctrl-C is noticed after it
    if "error" in outcome:
        raise outcome["error"]
    result: Result = outcome["result"]
    return result


class _Carried(BaseException):
    """An error of the user on its way through an engine; what engines catch of their own does not catch it."""

    def __init__(self, error: BaseException) -> None:
        super().__init__(error)
        self.error = error


class Callback:
    """A user's function that is told of a run, for engines to call.

    Args:
        function: of one number; None where nobody is told.

    Raises:
        ParameterError: it is no function.
    """

    def __init__(self, function: Callable[[float], Any] | None) -> None:
        if function is not None and not callable(function):
            raise ParameterError(f"progress = {function!r} must be a function of the time in s.")
        self._function = function

    def __call__(self, value: float) -> None:
        if self._function is None:
            return
        try:
            self._function(value)
        except BaseException as error:  # noqa: BLE001 (raised again where the run was asked for)
            raise _Carried(error) from None

    def of(self, run: Callable[[], Result]) -> Result:
        """What a run gives, or the very error that the function has raised in it.

        Afterwards it is told no more: parts of a run may be made again when they are read.
        """
        try:
            return run()
        except _Carried as carrier:
            error = carrier.error
        finally:
            self._function = None
        raise error


class _Others:
    """A stream for all threads but the silent ones."""

    def __init__(self, stream: Any) -> None:
        self.stream = stream

    def write(self, text: str) -> int:
        """Write what another thread prints."""
        return len(text) if threading.get_ident() in _silent else self.stream.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


@contextmanager
def unprinted() -> Iterator[None]:
    """Nothing that this thread prints meanwhile is seen; what other threads print is.

    `contextlib.redirect_stdout` is of all threads: the first to leave would take it from the others, and the last
    would leave it behind for good.
    """
    thread = threading.get_ident()
    with _LOCK:
        _silent[thread] = _silent.get(thread, 0) + 1
        if sys.stdout is not None and not isinstance(sys.stdout, _Others):
            sys.stdout = _Others(sys.stdout)
    try:
        yield
    finally:
        with _LOCK:
            _silent[thread] -= 1
            if not _silent[thread]:
                del _silent[thread]
            if not _silent and isinstance(sys.stdout, _Others):
                sys.stdout = sys.stdout.stream


Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")


class BoundedCache(Generic[Key, Value]):
    """The last few values, by key.

    Threads that need the same key at once may compute it twice, and all get the first value.

    Args:
        most: how many are kept; by default what a user goes back to, as models of other structure.
    """

    def __init__(self, most: int = 8) -> None:
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
        return BoundedCache, (self._most,)  # locks cannot be stored
