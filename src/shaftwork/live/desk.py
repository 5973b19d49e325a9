"""The requests of one page: the newest alone is answered, and nobody waits after the page has left."""

from __future__ import annotations

import asyncio
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from starlette.requests import Request
    from starlette.websockets import WebSocket


class Desk:
    """Takes what comes from a page, and keeps the newest.

    Args:
        patience: how long the work on a request goes on once a newer one waits, s: while a slider moves, quick answers
            still come.
    """

    def __init__(self, patience: float = 0.5) -> None:
        self._patience = patience
        self._text: str | None = None
        self._coming = asyncio.Event()
        self._start = 0.0
        self._left = False

    async def listen(self, line: WebSocket | Request) -> None:
        """Take requests until the page leaves; a frame of bytes, which is none, as an empty text."""
        while not (message := await line.receive())["type"].endswith(".disconnect"):
            self._text = message.get("text") or ""
            self._coming.set()
        self._left = True
        self._coming.set()

    async def comes(self) -> bool:
        """Wait for a request; false once the page has left."""
        await self._coming.wait()
        return not self._left

    def take(self) -> str:
        """The newest request, on which the work begins now."""
        self._coming.clear()
        text, self._text, self._start = self._text or "", None, time.monotonic()
        return text

    def waits(self) -> bool:
        """Whether the page still waits for the answer to the request that was taken."""
        return not self._left and (self._text is None or time.monotonic() - self._start < self._patience)
