"""A user's own function that an engine calls: what it raises comes out as it went in."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

Result = TypeVar("Result")


class _Carried(BaseException):
    """An error of the user on its way through an engine; what engines catch of their own does not catch it."""

    def __init__(self, error: BaseException) -> None:
        super().__init__(error)
        self.error = error


class Callback:
    """A user's function that is told of a run, for engines to call.

    Args:
        function: of one number; None where nobody is told.
    """

    def __init__(self, function: Callable[[float], Any] | None) -> None:
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
        except _Carried as made:
            error = made.error
        finally:
            self._function = None
        raise error
