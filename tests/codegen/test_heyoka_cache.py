"""Where compiled code is kept between processes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.heyoka

PROGRAM = """
import shaftwork as sw
sw.scenes.crane_start().simulate(t_end=0.01, engine="heyoka")
"""


def run(folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """The program in a folder, with what else is said of its environment."""
    kept = {name: value for name, value in os.environ.items() if name not in ("HOME", "XDG_CACHE_HOME")}
    command = [sys.executable, "-W", "error", "-c", PROGRAM]
    return subprocess.run(command, cwd=folder, env=kept | environment, capture_output=True, text=True, check=True)


@pytest.mark.slow
def test_compiled_code_is_kept_in_a_folder_of_its_own(tmp_path: Path) -> None:
    run(tmp_path, XDG_CACHE_HOME=str(tmp_path / "cache"))
    assert [made.name for made in (tmp_path / "cache").iterdir()] == ["shaftwork"]


@pytest.mark.slow
@pytest.mark.parametrize("environment", [{}, {"HOME": "/proc/nowhere"}])
def test_without_a_place_nothing_is_kept_and_nothing_is_said(tmp_path: Path, environment: dict[str, str]) -> None:
    made = run(tmp_path, **environment)
    assert made.stdout + made.stderr == ""
    assert list(tmp_path.iterdir()) == []
