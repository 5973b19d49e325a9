"""A thread that is kept from printing is alone in that, and only meanwhile."""

from __future__ import annotations

import io
import sys
import threading

import pytest

from shaftwork.core.calls import unprinted


def test_only_the_thread_that_is_kept_from_printing_is_silent_and_only_meanwhile(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stdout", stream)
    with unprinted():
        with unprinted():
            sys.stdout.write("unseen\n")
        sys.stdout.write("unseen, too\n")
        other = threading.Thread(target=print, args=("of another thread",))
        other.start()
        other.join()
    assert sys.stdout is stream
    sys.stdout.write("seen\n")
    with unprinted():
        sys.stdout.write("unseen once more\n")
    sys.stdout.write("and seen\n")
    assert stream.getvalue() == "of another thread\nseen\nand seen\n"
