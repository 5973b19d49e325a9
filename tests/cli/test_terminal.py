"""The command on a terminal: what is seen while it works, and how it ends on Ctrl-C.

Each test starts it as a shell does.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path

import pytest

import shaftwork as sw
from shaftwork.cli import DONE, INTERRUPTED

pty = pytest.importorskip("pty", reason="needs pseudo-terminals")
termios = pytest.importorskip("termios")
COMMAND = [sys.executable, "-m", "shaftwork"]


def started(
    *arguments: str, terminal: bool = False, environment: Mapping[str, str] | None = None
) -> tuple[subprocess.Popen[bytes], int]:
    """The command as a process, and where its standard error is read: a terminal or a pipe."""
    reading, writing = pty.openpty() if terminal else os.pipe()
    if terminal:
        termios.tcsetwinsize(writing, (24, 80))
    process = subprocess.Popen(
        [*COMMAND, *arguments], stdout=subprocess.PIPE, stderr=writing, env={**os.environ, **(environment or {})}
    )
    os.close(writing)
    return process, reading


def all_of(reading: int) -> str:
    """Everything that is written until the other end is closed, which a terminal tells by an error."""
    said = b""
    while True:
        try:
            new = os.read(reading, 4096)
        except OSError:
            new = b""
        if not new:
            os.close(reading)
            return said.decode()
        said += new


def swinging(folder: Path, name: str = "swing") -> str:
    """A model file of an undamped oscillator, which takes an engine that is asked for as long as one likes."""
    net = sw.Network(name)
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Spring("c", c=1e4), "a", "ground")
    net.add(sw.TorqueSource("pull", tau=1.0), "a")
    net.save(folder / "swing.toml")
    return str(folder / "swing.toml")


@pytest.mark.slow
def test_ctrl_c_ends_a_run_with_130_and_one_line_that_says_how_far_it_came(tmp_path: Path) -> None:
    run = ("run", swinging(tmp_path), "--engine", "scipy", "--rtol", "1e-12", "--t-end", "1e6", "--out", str(tmp_path))
    process, errors = started(*run)
    assert process.stdout is not None
    time.sleep(5.0)  # the motion takes minutes, and nothing is printed before its end
    process.send_signal(signal.SIGINT)
    (line,) = all_of(errors).splitlines()
    assert re.match(r"shaftwork: interrupted(: the motion had come to t = |$)", line)  # it may not have begun yet
    assert process.wait() == INTERRUPTED
    assert process.stdout.read() == b""
    process.stdout.close()
    assert [path.name for path in tmp_path.iterdir()] == ["swing.toml"]  # no half of a result


@pytest.mark.slow
def test_a_terminal_shows_how_far_a_run_has_come_and_is_left_clean(tmp_path: Path) -> None:
    pytest.importorskip("tqdm")
    accurately = ("--engine", "scipy", "--rtol", "1e-10")  # so that nothing is to be warned of
    process, terminal = started("run", swinging(tmp_path), *accurately, "--t-end", "30", terminal=True)
    shown = all_of(terminal)
    assert process.communicate()[0].startswith(b"swing: 30 s of motion\n")
    assert process.returncode == DONE
    assert "swing, compiling:   0%" in shown
    assert "of 30 s [" in shown
    assert not shown.rpartition("\r")[0].rpartition("\r")[2].strip()  # the last line is blank again


@pytest.mark.slow
def test_without_a_terminal_no_progress_is_written(tmp_path: Path) -> None:
    process, errors = started("run", swinging(tmp_path), "--engine", "scipy", "--t-end", "1")
    assert all_of(errors) == ""
    assert process.communicate()[0]
    assert process.returncode == DONE


@pytest.mark.slow
def test_without_tqdm_a_terminal_shows_nothing_and_the_run_is_done(tmp_path: Path) -> None:
    (tmp_path / "tqdm.py").write_text("raise ImportError('not installed')\n", encoding="utf-8")
    path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    process, terminal = started(
        "run", swinging(tmp_path), "--engine", "scipy", "--t-end", "1", terminal=True, environment={"PYTHONPATH": path}
    )
    assert all_of(terminal) == ""
    assert process.communicate()[0]
    assert process.returncode == DONE


@pytest.mark.slow
@pytest.mark.parametrize("terminal", [False, True])
def test_a_terminal_of_ascii_shows_other_letters_as_escapes(tmp_path: Path, terminal: bool) -> None:  # noqa: FBT001
    environment = {"PYTHONIOENCODING": "ascii", "LANG": "C", "LC_ALL": "C", "PYTHONUTF8": "0"}
    path = swinging(tmp_path, "Übersetzung ω")
    process, errors = started(
        "run", path, "--engine", "scipy", "--t-end", "1", terminal=terminal, environment=environment
    )
    said = all_of(errors)
    assert process.communicate()[0].startswith(rb"\xdcbersetzung \u03c9: 1 s of motion")
    assert process.returncode == DONE
    assert "UnicodeEncodeError" not in said
    assert said.isascii()
