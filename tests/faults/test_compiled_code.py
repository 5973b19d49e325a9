"""Compiled code that is kept on the disk: whatever has become of it, the next process computes the same numbers."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from random import Random

import pytest

pytestmark = pytest.mark.heyoka

PROGRAM = """
import shaftwork as sw
print(sw.scenes.crane_start().simulate(t_end=0.3, engine="heyoka").x.tobytes().hex()[-400:])
"""


def started(cache: Path, before: Sequence[str] = ()) -> subprocess.Popen[str]:
    kept = {name: value for name, value in os.environ.items() if name not in ("HOME", "XDG_CACHE_HOME")}
    command, environment = (
        [*before, sys.executable, "-W", "error", "-c", PROGRAM],
        kept | {"XDG_CACHE_HOME": str(cache)},
    )
    return subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def ended(process: subprocess.Popen[str]) -> tuple[str, str]:
    """What it has printed, and the notices."""
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    return out, err


def rows(cache: Path) -> int:
    import sqlite3
    from contextlib import closing

    with closing(sqlite3.connect(cache / "shaftwork" / "cache.db")) as kept:
        return int(kept.execute("SELECT count(*) FROM cache").fetchone()[0])


@pytest.fixture(scope="module")
def warm(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    cache = tmp_path_factory.mktemp("cache")
    out, err = ended(started(cache))
    assert err == ""
    assert rows(cache) > 0
    assert ended(started(cache)) == (out, "")  # and it is used again
    return cache, out


def flipped(path: Path, seed: int) -> None:
    """Bits in the code, behind the first pages."""
    raw, random = bytearray(path.read_bytes()), Random(seed)  # noqa: S311
    for _ in range(60):
        raw[random.randrange(8192, len(raw))] ^= 1 << random.randrange(8)
    path.write_bytes(raw)


SPOILT: dict[str, Callable[[Path], object]] = {
    **{f"bits flipped {seed}": lambda folder, seed=seed: flipped(folder / "cache.db", seed) for seed in (1, 5, 6)},
    "cut off": lambda folder: os.truncate(folder / "cache.db", 5000),
    "empty": lambda folder: (folder / "cache.db").write_bytes(b""),
    "something else": lambda folder: (folder / "cache.db").write_bytes(b"no data base" * 999),
    "no sums": lambda folder: (folder / "sums.json").unlink(),
    "sums of something else": lambda folder: (folder / "sums.json").write_text("[1, 2", encoding="utf-8"),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", SPOILT)
def test_code_that_was_spoilt_is_compiled_anew_to_the_same_numbers(
    what: str, warm: tuple[Path, str], tmp_path: Path
) -> None:
    cache, out = tmp_path / "cache", warm[1]
    shutil.copytree(warm[0], cache)
    SPOILT[what](cache / "shaftwork")
    assert ended(started(cache)) == (out, "")
    assert rows(cache) > 0
    assert ended(started(cache)) == (out, "")


@pytest.mark.slow
def test_processes_that_begin_at_once_without_kept_code_compute_the_same(
    warm: tuple[Path, str], tmp_path: Path
) -> None:
    made = [ended(process) for process in [started(tmp_path) for _ in range(3)]]
    assert made == [(warm[1], "")] * 3
    assert ended(started(tmp_path)) == (warm[1], "")


BOUND = () if os.getuid() else ("setpriv", "--bounding-set", "-dac_override,-dac_read_search")
"""Before a command of root, that it may not do what rights forbid."""


@pytest.mark.slow
@pytest.mark.skipif(bool(BOUND) and shutil.which("setpriv") is None, reason="root may write anywhere")
@pytest.mark.parametrize("empty", [True, False])
def test_a_folder_that_may_not_be_written_to_is_no_hindrance(
    warm: tuple[Path, str],
    tmp_path: Path,
    empty: bool,  # noqa: FBT001
) -> None:
    cache = tmp_path / "cache"
    (cache / "shaftwork").mkdir(parents=True) if empty else shutil.copytree(warm[0], cache)
    places = [cache, *cache.rglob("*")]
    for place in places:
        place.chmod(0o555 if place.is_dir() else 0o444)
    try:
        assert ended(started(cache, before=BOUND)) == (warm[1], "")
        assert ended(started(cache / "shaftwork", before=BOUND)) == (warm[1], "")  # in which no other can be made
    finally:
        for place in places:
            place.chmod(0o755)
    assert {*cache.rglob("*")} == {*places[1:]}
