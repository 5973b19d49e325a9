"""Who is let in: browsers of this machine that know the token, and pages of this server alone."""

from __future__ import annotations

import hmac
from collections.abc import Awaitable, Callable, Iterable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs

HOST = "127.0.0.1"
HOSTS = (HOST, "localhost")
"""Names of this machine that a browser may use; another name would be one that an attacker has made point here."""
COOKIE = "shaftwork-{port}"
"""In which a browser keeps the token; cookies are of all ports of a machine."""
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""What the page may load and run: what comes from this server alone; drawings and plots have styles in them."""
HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cache-control": "no-store",
}
REFUSED = b"This page is open to the address alone that `shaftwork open` has printed, with its token."

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
Application = Callable[[Scope, Receive, Send], Awaitable[None]]


class Admission:
    """An application of ASGI in front of another, which lets nobody pass without the token.

    The first request has it in its address and is given a cookie, which no script can read and no other site sends.

    Args:
        app: the application behind.
        token: the secret.
        port: of the server.
    """

    def __init__(self, app: Application, token: str, port: int) -> None:
        self._app, self._token = app, token
        self._origins = {f"http://{host}:{port}" for host in HOSTS}
        self._cookie = COOKIE.format(port=port)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        socket, first = scope["type"] == "websocket", self._is_token(_in_address(scope))
        origin = headers.get("origin")
        foreign = origin not in self._origins and (socket or origin is not None)
        if foreign or not (first or self._is_token(self._in_cookie(headers))):
            await _refuse(send, socket=socket)
            return
        await self._app(scope, receive, self._with_headers(send, first=first))

    def _is_token(self, text: str) -> bool:
        return hmac.compare_digest(text.encode(), self._token.encode())

    def _in_cookie(self, headers: MutableMapping[str, str]) -> str:
        try:
            cookies = SimpleCookie(headers.get("cookie", ""))
        except CookieError:
            return ""
        return str(cookies[self._cookie].value) if self._cookie in cookies else ""

    def _with_headers(self, send: Send, *, first: bool) -> Send:
        async def sent(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                extra = dict(HEADERS)
                if first:
                    extra["set-cookie"] = f"{self._cookie}={self._token}; HttpOnly; SameSite=Strict; Path=/"
                message["headers"] = [*message.get("headers", ()), *_encoded(extra.items())]
            await send(message)

        return sent


def _in_address(scope: Scope) -> str:
    """The token in an address."""
    query: bytes = scope["query_string"]
    return parse_qs(query.decode("latin-1")).get("token", [""])[0]


def _encoded(headers: Iterable[tuple[str, str]]) -> list[tuple[bytes, bytes]]:
    return [(name.encode(), value.encode()) for name, value in headers]


async def _refuse(send: Send, *, socket: bool) -> None:
    if socket:  # closed before it is accepted, a socket answers 403
        await send({"type": "websocket.close", "code": 1008})
        return
    headers = _encoded([("content-type", "text/plain; charset=utf-8"), *HEADERS.items()])
    await send({"type": "http.response.start", "status": 403, "headers": headers})
    await send({"type": "http.response.body", "body": REFUSED})
