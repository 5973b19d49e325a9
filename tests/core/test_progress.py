"""The line that shows how far something is costs nothing that one would notice."""

from __future__ import annotations

import io
import sys

import pytest

from shaftwork.core.screen import progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_the_line_is_drawn_now_and_then_however_often_it_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """A second of work at most, five drawings in it, one at the begin and one at the end; a jump back is none."""
    pytest.importorskip("tqdm", reason="the line is the extra `progress`")
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with progress(1000.0, "s", "compiling") as show:
        for done in (*range(500), *range(400, 1000)):
            show(float(done), "running")
    drawn = terminal.getvalue()
    assert "compiling:   0%" in drawn
    assert 1 <= drawn.count("%|") <= 8
