"""A server of one page on this machine alone, on Starlette and uvicorn."""

from __future__ import annotations

import asyncio
import contextlib
import json
import secrets
import socket
import tempfile
import threading
import webbrowser
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shaftwork.core.errors import ParameterError, ShaftworkError, imported
from shaftwork.core.parameters import whole
from shaftwork.live.admission import HOST, HOSTS, Admission
from shaftwork.live.desk import Desk
from shaftwork.live.page import SCRIPTS, WEB, plotly_script, served_page
from shaftwork.live.page_requests import checked
from shaftwork.live.session import Session
from shaftwork.modelfiles.storage import write_netlist
from shaftwork.pipeline.network import Network
from shaftwork.reporting.report import report

if TYPE_CHECKING:
    from starlette.applications import Starlette
    from starlette.requests import Request
    from starlette.responses import Response
    from starlette.websockets import WebSocket

    from shaftwork.scenes.catalog import Scene

FILES = {"model.toml": "application/toml", "report.pdf": "application/pdf", "report.html": "text/html; charset=utf-8"}
"""What can be saved from the page, with its kind."""
KINDS = {".css": "text/css; charset=utf-8", ".js": "text/javascript; charset=utf-8"}
MOST_BYTES = 1_000_000
"""Of a request."""
EXTRA, PURPOSE = "live", "A live page"


def serve(
    subject: Network | Scene | Session,
    *,
    port: int = 0,
    browser: bool = True,
    say: Callable[[str], None] = print,
    t_end: float | None = None,
    signals: Sequence[str] | None = None,
    initial: Mapping[str, float] | None = None,
) -> None:
    """Open a live page of a network in the browser, and serve it until Ctrl-C.

    Args:
        subject: a network, a scene, or a session.
        port: by default a free one.
        browser: whether to open the page.
        say: prints a line.
        t_end: end of the motion, s.
        signals: quantities to draw, as of `Session`.
        initial: start values, as of `Session`.

    Raises:
        ParameterError: the port is taken, or none.
        MissingExtraError: starlette, uvicorn, websockets or plotly is not installed (extra `live`).
    """
    session = subject
    if not isinstance(session, Session):
        session = Session(session, t_end=t_end, signals=signals, initial=initial)
    with contextlib.suppress(KeyboardInterrupt), serving(session, port=port) as address:
        say(f"{session.title}: {address}\nCtrl-C ends it.")
        if browser:
            webbrowser.open(address)
        while not session.closing.wait(0.5):  # in rounds of 0.5 s, which Ctrl-C ends on every system
            pass


@contextlib.contextmanager
def serving(session: Session, *, port: int = 0) -> Iterator[str]:
    """Serve the live page of a session meanwhile, in a thread of its own; gives the address, with its token.

    The server listens to the loopback address alone, and answers those who know the token.

    Args:
        session: what answers; it is closed in the end.
        port: by default a free one.

    Raises:
        ParameterError: the port is taken, or none.
        MissingExtraError: starlette, uvicorn, websockets or plotly is not installed (extra `live`).
    """
    uvicorn = [imported(name, EXTRA, PURPOSE) for name in ("websockets", "uvicorn")][-1]
    if whole(port, 0, last := 2**16 - 1) is None:
        raise ParameterError(f"port = {port!r} must be a whole number up to {last}; 0 takes a free one.")
    try:
        listening = socket.create_server((HOST, port))
    except OSError as error:
        raise ParameterError(f"Port {port} cannot be opened: {error}. Leave it out for a free one.") from None
    with listening:
        token, number = secrets.token_urlsafe(32), listening.getsockname()[1]
        options = {"log_level": "error", "timeout_graceful_shutdown": 1, "ws_max_size": MOST_BYTES}
        app = application(session, token, number)
        server = uvicorn.Server(uvicorn.Config(app, ws="websockets-sansio", lifespan="off", **options))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]}, name="live page")
        thread.start()
        try:
            yield f"http://{HOST}:{number}/?token={token}"
        finally:
            session.closing.set()
            server.should_exit = True
            thread.join()


def application(session: Session, token: str, port: int) -> Starlette:
    """The page of a session as an application of Starlette.

    Args:
        session: what answers.
        token: without which every request is refused.
        port: at which it is served.

    Raises:
        MissingExtraError: starlette or plotly is not installed.
    """
    starlette = imported("starlette.applications", EXTRA, PURPOSE)
    from starlette.middleware import Middleware
    from starlette.middleware.trustedhost import TrustedHostMiddleware
    from starlette.responses import Response
    from starlette.routing import Route, WebSocketRoute
    from starlette.websockets import WebSocketDisconnect

    page, sources = served_page(session), {name: (WEB / name).read_text("utf-8") for name in ("page.css", *SCRIPTS)}
    sources["plotly.js"] = plotly_script()
    one = asyncio.Lock()  # a session answers one after another

    async def first(_request: Request) -> Response:
        return Response(page, media_type="text/html; charset=utf-8")

    async def source(request: Request) -> Response:
        name = str(request.path_params["name"])
        if name not in sources:
            return Response("There is no such file.", 404)
        return Response(sources[name], media_type=KINDS[Path(name).suffix])

    async def file(request: Request) -> Response:
        name = str(request.path_params["name"])
        if name not in FILES or int(request.headers.get("content-length", MOST_BYTES + 1)) > MOST_BYTES:
            return Response("There is no such file.", 404)
        desk, text = Desk(), await request.body()
        leaving = asyncio.create_task(desk.listen(request))
        async with one:
            content = await asyncio.to_thread(_written, session, name, text, desk.waits)
        leaving.cancel()
        refused = isinstance(content, str)
        return Response(content, 422 if refused else 200, media_type="text/plain" if refused else FILES[name])

    async def answers(line: WebSocket) -> None:
        with contextlib.suppress(WebSocketDisconnect):  # the page may be closed before it is answered
            await _converse(line, session, one)

    return starlette.Starlette(  # type: ignore[no-any-return]
        routes=[
            Route("/", first),
            Route("/{name}", source),
            Route("/files/{name}", file, methods=["POST"]),
            WebSocketRoute("/answers", answers),
        ],
        middleware=[
            Middleware(TrustedHostMiddleware, allowed_hosts=list(HOSTS), www_redirect=False),
            Middleware(Admission, token=token, port=port),
        ],
    )


async def _converse(line: WebSocket, session: Session, one: asyncio.Lock) -> None:
    """Answer the newest request of a page, until it leaves."""
    await line.accept()
    desk = Desk()
    listening = asyncio.create_task(desk.listen(line))
    try:
        while await desk.comes():
            async with one:
                answer = await asyncio.to_thread(_answered, session, desk.take(), desk.waits)
            if desk.waits():
                await line.send_text(answer)
    finally:
        listening.cancel()


def _answered(session: Session, text: str, waits: Callable[[], bool]) -> str:
    """The answer to a request, both as JSON; the number by which a page tells its requests is that of the answer."""
    number = None
    try:
        request = read_json(text)
        number = request.pop("number", None) if isinstance(request, dict) else None
        return json.dumps({"number": number, **session.answer(request, waits)}, allow_nan=False)
    except Exception as error:  # noqa: BLE001 (as on the command line: laws beyond all measure may raise anything)
        said = f"The answer failed with {type(error).__name__}: {' '.join(str(error).split()).removesuffix('.')}."
        return json.dumps({"number": number, "error": said})


def read_json(text: str) -> Any:
    """What a page sends.

    Raises:
        ParameterError: it is no JSON.
    """
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        raise ParameterError(f"The request {text[:40]!r} is no JSON. The page of this version sends what is.") from None


def _written(session: Session, name: str, text: bytes, waits: Callable[[], bool]) -> bytes | str:
    """A file of the values in a request; a text says why there is none."""
    try:
        request = checked(json.loads(text))
        subject = session.changed(request["set"])
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / name
            if name == "model.toml":
                network = subject if isinstance(subject, Network) else subject()
                write_netlist(network.netlist(), path)
            else:
                report(subject, solution=session.motion(request, waits), signals=session.signals).save(path)
            return path.read_bytes()
    except ShaftworkError as error:
        return str(error)
    except Exception as error:  # noqa: BLE001 (as above)
        return f"{name} failed with {type(error).__name__}: {' '.join(str(error).split())}."
