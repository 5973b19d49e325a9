"""The server tells nothing to who does not know the token, comes under another name, or from another page."""

from __future__ import annotations

import http.client
import json
import logging
import math
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect

import shaftwork as sw
from shaftwork.live.server import FILES, serve, serving
from shaftwork.live.session import Session
from shaftwork.scenes import SCENES

SECONDS = 60
"""After which a server that does not answer has failed."""


@dataclass
class Answer:
    """What the server says."""

    status: int
    headers: dict[str, str]
    content: bytes


@dataclass
class Client:
    """A program on this machine, with the cookie that it has been given."""

    port: int
    cookie: dict[str, str] = field(default_factory=dict)

    @property
    def home(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def ask(self, method: str, path: str, body: str | None = None, **headers: str) -> Answer:
        line = http.client.HTTPConnection("127.0.0.1", self.port, timeout=SECONDS)
        line.request(method, path, body, {**self.cookie, **headers})
        response = line.getresponse()
        answer = Answer(response.status, {k.lower(): v for k, v in response.getheaders()}, response.read())
        line.close()
        return answer

    def get(self, path: str, **headers: str) -> Answer:
        return self.ask("GET", path, **headers)

    def post(self, name: str, body: object, **headers: str) -> Answer:
        return self.ask("POST", f"/files/{name}", body if isinstance(body, str) else json.dumps(body), **headers)

    def socket(self, origin: str | None) -> ClientConnection:
        address = f"ws://127.0.0.1:{self.port}/answers"
        return connect(address, origin=origin, additional_headers=self.cookie, open_timeout=SECONDS)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def session() -> Session:
    return Session(SCENES["crane-start"])


@pytest.fixture(scope="module")
def address(session: Session) -> Iterator[str]:
    with serving(session) as address:
        yield address
    session.closing.clear()


@pytest.fixture(scope="module")
def port(address: str) -> int:
    return int(address.split(":")[2].partition("/")[0])


@pytest.fixture(scope="module")
def token(address: str) -> str:
    return address.partition("token=")[2]


@pytest.fixture
def stranger(port: int) -> Client:
    """Somebody on this machine who does not know the token."""
    return Client(port)


@pytest.fixture
def browser(port: int, token: str) -> Client:
    """One that has opened the address with the token."""
    opened = Client(port).get(f"/?token={token}")
    return Client(port, {"Cookie": opened.headers["set-cookie"].partition(";")[0]})


def refused(client: Client, origin: str | None) -> bool:
    """Whether a socket is refused as forbidden."""
    with pytest.raises(InvalidStatus) as error, client.socket(origin):
        pass
    return error.value.response.status_code == 403


PATHS = ["/", "/page.js", "/plotly.js", "/page.css", "/?token=", "/?token=another", "/nothing", "/answers"]


@pytest.mark.parametrize("path", PATHS)
def test_a_request_without_the_token_is_refused(stranger: Client, path: str) -> None:
    answer = stranger.get(path)
    assert answer.status == 403
    assert "set-cookie" not in answer.headers
    assert stranger.post("model.toml", {}).status == 403


def test_a_socket_without_the_token_is_refused(stranger: Client) -> None:
    assert refused(stranger, stranger.home)


def test_the_first_page_gives_a_cookie_that_no_script_and_no_other_site_can_use(stranger: Client, token: str) -> None:
    answer = stranger.get(f"/?token={token}")
    cookie = f"shaftwork-{stranger.port}={token}"
    assert answer.headers["set-cookie"] == f"{cookie}; HttpOnly; SameSite=Strict; Path=/"
    assert "default-src 'none'; script-src 'self'" in answer.headers["content-security-policy"]
    assert token.encode() not in answer.content
    assert [stranger.get(path, Cookie=cookie).status for path in PATHS[:4]] == [200] * 4
    assert "set-cookie" not in stranger.get("/", Cookie=cookie).headers
    assert stranger.get("/", Cookie=f"{cookie}x").status == 403
    assert stranger.get("/", Cookie=f"shaftwork-1={token}").status == 403


@pytest.mark.parametrize("host", ["example.org", "example.org:80", "127.0.0.1.example.org", "-"])
def test_another_name_of_this_machine_is_refused_even_with_the_token(browser: Client, host: str) -> None:
    """A page elsewhere can make its own name point to this machine; its requests then carry that name."""
    assert browser.get("/", Host=host).status == 400
    assert browser.get("/", Host=f"localhost:{browser.port}").status == 200


@pytest.mark.parametrize("origin", ["http://example.org", "http://127.0.0.1:1", "null", "https://127.0.0.1"])
def test_a_request_from_another_page_is_refused_even_with_the_token(browser: Client, origin: str) -> None:
    assert browser.get("/", Origin=origin).status == 403
    assert browser.post("model.toml", {}, Origin=origin).status == 403
    assert refused(browser, origin)


def test_a_socket_must_say_where_it_comes_from(browser: Client) -> None:
    assert refused(browser, None)


def test_the_socket_answers_as_the_session_does_and_stays_open_after_an_error(
    browser: Client, session: Session
) -> None:
    request = {"set": {"J2.J": 80.0}, "want": ["extremes", "modes"]}
    with browser.socket(browser.home) as line:
        line.send(json.dumps(request))
        answer = json.loads(line.recv(SECONDS))
        line.send("{")
        said = json.loads(line.recv(SECONDS))["error"]
        assert said.startswith("The answer failed with ParameterError: The request '{' is no JSON.")
        line.send(json.dumps({"set": {"J2.J": -1}}))
        assert json.loads(line.recv(SECONDS))["error"] == "Inertia 'J2': J = -1 must be at least 0."
        line.send(json.dumps(request))
        again = json.loads(line.recv(SECONDS))
    for key in ("extremes", "modes"):
        assert answer[key] == again[key] == json.loads(json.dumps(session.answer(request)[key]))


def test_of_requests_that_wait_the_newest_alone_is_answered(browser: Client) -> None:
    with browser.socket(browser.home) as line:
        for number, t_end in enumerate((1e4, 3.0, 4.0, 5.0), start=1):
            line.send(json.dumps({"number": number, "t_end": t_end}))
        answers = [json.loads(line.recv(SECONDS))]
        while answers[-1]["number"] != 4:
            answers.append(json.loads(line.recv(SECONDS)))
        line.send(json.dumps({"number": 5, "t_end": 1.0}))
        assert json.loads(line.recv(SECONDS))["number"] == 5
    assert len(answers) <= 2  # the first one may have been quick enough
    assert "error" not in answers[-1]


def test_the_work_for_a_page_that_has_left_ends(browser: Client, session: Session) -> None:
    """Another page is answered long before the motion that nobody waits for would have come to its end."""
    begun, ended = threading.Event(), threading.Event()

    def endless(_request: object, waits: Callable[[], bool]) -> None:
        begun.set()
        while waits():
            time.sleep(0.01)
        ended.set()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(session, "answer", endless)
        with browser.socket(browser.home) as line:
            line.send("{}")
            assert begun.wait(SECONDS)
        assert ended.wait(SECONDS)
    with browser.socket(browser.home) as line:
        line.send("{}")
        assert "curves" in json.loads(line.recv(SECONDS))


def test_the_model_file_has_the_values_of_the_page(browser: Client, tmp_path: Path) -> None:
    answer = browser.post("model.toml", {"set": {"J2.J": 80.0, "shaft.d": 3.5}, "t_end": 2.0})
    (tmp_path / "model.toml").write_bytes(answer.content)
    parts = {part.name: part.values for part in sw.Network.load(tmp_path / "model.toml").parts}
    assert (answer.status, parts["J2"]["J"], parts["shaft"]["d"]) == (200, 80.0, 3.5)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "start"), [("report.html", b"<!DOCTYPE html>"), ("report.pdf", b"%PDF")])
def test_the_report_is_of_the_values_of_the_page(browser: Client, name: str, start: bytes) -> None:
    answer = browser.post(name, {"set": {"J2.J": 81.25}, "t_end": 0.5})
    assert answer.status == 200, answer.content
    assert answer.headers["content-type"] == FILES[name]
    assert answer.content.startswith(start)
    assert name.endswith("pdf") or b"81.25" in answer.content


def test_files_of_values_that_cannot_be_are_refused_in_the_words_of_the_library(browser: Client) -> None:
    answer = browser.post("model.toml", {"set": {"J2.J": -1.0}, "t_end": 2.0})
    assert (answer.status, answer.content) == (422, b"Inertia 'J2': J = -1.0 must be at least 0.")
    assert browser.post("model.toml", []).status == 422
    assert browser.post("passwords", {}).status == 404
    assert browser.post("model.toml", " " * 1_000_001).status == 404
    assert browser.get("/files/model.toml").status == 405


def test_serve_listens_to_this_machine_alone_and_refuses_a_port_that_is_taken(session: Session) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        with pytest.raises(sw.ParameterError, match=f"Port {port} cannot be opened: .*Leave it out for a free one."):
            serve(session, port=port, browser=False)
    with pytest.raises(sw.ParameterError, match="port = 70000 must be a whole number up to 65535"):
        serve(session, port=70000, browser=False)


def test_a_page_that_is_closed_before_it_is_answered_leaves_no_error(
    browser: Client, caplog: pytest.LogCaptureFixture
) -> None:
    logging.getLogger("uvicorn").propagate = True
    for _ in range(5):
        with browser.socket(browser.home) as line:
            line.send(json.dumps({"set": {"J2.J": 77.0}, "want": ["extremes"]}))
    with browser.socket(browser.home) as line:
        line.send("{}")
        assert "curves" in json.loads(line.recv(SECONDS))
    assert caplog.records == []


@pytest.mark.slow
def test_the_command_serves_its_page_at_the_address_it_prints_until_ctrl_c() -> None:
    values = ("--set", "J2.J=70", "--initial", "J1.omega=8.5", "--initial", "J2.omega=90 rpm")
    command = [sys.executable, "-m", "shaftwork", "open", "crane-start", "--no-browser", *values]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        line = program.stdout.readline()
        address = re.search(r"http://127\.0\.0\.1:(\d+)(/\?token=[\w-]{40,})\n$", line)
        assert address is not None, line
        client = Client(int(address[1]))
        assert (client.get("/").status, client.get(address[2]).status) == (403, 200)
        page = client.get(address[2]).content
        assert b'"value": 70.0' in page
        assert b'"name": "J1.omega", "symbol": ["\\u03c9", ""], "unit": "rad/s", "value": 8.5}' in page
        assert f'"unit": "rad/s", "value": {str(3 * math.pi)[:12]}'.encode() in page
        assert program.stdout.readline() == "Ctrl-C ends it.\n"
        program.send_signal(signal.SIGINT)
        assert program.wait(timeout=SECONDS) == 0
        assert program.stderr is not None
        assert program.stderr.read() == ""
