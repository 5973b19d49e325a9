"""Ctrl-C while compiled code is at work."""

from __future__ import annotations

import contextvars
import threading
from collections.abc import Callable
from typing import Any, TypeVar

Result = TypeVar("Result")
PAUSE = 0.1
"""Ctrl-C is noticed after so many seconds at most; where Python's waiting cannot be interrupted, as on Windows."""


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
        thread.join(PAUSE)
    if "error" in outcome:
        raise outcome["error"]
    result: Result = outcome["result"]
    return result
