"""Where heyoka keeps compiled code between processes, and how code that has changed on the disk is kept from running.

heyoka runs what it finds. So each process, when it ends, puts down sums of all that is kept, and the next one drops
whatever has no sum or another one: a flipped bit would crash it, or change its numbers.
"""

from __future__ import annotations

import atexit
import json
import sqlite3
import zlib
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

from shaftwork.core.files import replaced

ROOM = 2**25
"""Bytes of compiled code that are kept, of the most recently used: opening it takes longer the more there is, 0.3 s of
each process for 1 GiB, which is more than most networks take to compile."""
MEMORY = 8 * ROOM
"""Bytes of compiled code that heyoka keeps in memory for models made again, 2 GiB of its own accord: a network has some
0.1 MB, and a process that makes tens of thousands of them must not grow by gigabytes."""
KEPT, SUMS = "cache.db", "sums.json"
"""heyoka's file and ours."""
_COLUMNS = "hash, bitcode, comp_flag, env_fingerprint, opt_bc, opt_ir, obj"


def keep_apart() -> None:
    """Keep compiled code in a folder of our own beside heyoka's, or nowhere where no folder can be made."""
    import heyoka

    state = heyoka.llvm_state
    state.set_memcache_limit(min(MEMORY, state.get_memcache_limit()))
    path = state.get_diskcache_path()
    if path.name == "heyoka":  # nobody has said where
        folder = path.parent / "shaftwork"
        if not _is_sound(folder):
            state.set_diskcache_enabled(False)
            return
        try:
            state.set_diskcache_path(folder)
            state.set_diskcache_limit(ROOM)  # opens the folder
        except RuntimeError:
            state.set_diskcache_enabled(False)
        else:
            atexit.register(_put_down_sums, folder)
    elif not path.name:  # no home: it would be where the process is
        state.set_diskcache_enabled(False)


def _is_sound(folder: Path) -> bool:
    """Whether all code that is kept is as it was written, once what is not has been dropped."""
    place = folder / KEPT
    if not place.exists():
        return True
    try:
        recorded = _known(folder)
        with closing(_opened(place)) as database, database:
            spoilt = [(key,) for key, total in _sums(database).items() if recorded.get(key) != total]
            if spoilt:
                database.executemany("DELETE FROM cache WHERE hash = ?", spoilt)
                database.execute(
                    "UPDATE config SET value = (SELECT coalesce(sum(size), 0) FROM cache) WHERE key = 'total_size'"
                )
    except sqlite3.Error as error:
        if isinstance(error, sqlite3.OperationalError) and "locked" in str(error):
            return False
        return _removed(folder)
    return True


def _removed(folder: Path) -> bool:
    """Whether a file that cannot be read could be removed, so that heyoka begins a new one."""
    try:
        for name in (KEPT, f"{KEPT}-wal", f"{KEPT}-shm"):
            (folder / name).unlink(missing_ok=True)
    except OSError:
        return False
    return True


def _put_down_sums(folder: Path) -> None:
    """Put down the sums of what is new; what was there keeps that which it had."""
    with suppress(sqlite3.Error, OSError):
        with closing(_opened(folder / KEPT)) as database:
            sums = _sums(database)
        recorded = _known(folder)
        if sums.keys() - recorded.keys():
            with replaced(folder / SUMS) as file:
                json.dump({key: recorded.get(key, total) for key, total in sums.items()}, file)


def _opened(place: Path) -> sqlite3.Connection:
    return sqlite3.connect(f"{place.as_uri()}?mode=rw", uri=True)


def _known(folder: Path) -> dict[int, int]:
    """Sums by what they are of; none where they cannot be read."""
    try:
        record: Any = json.loads((folder / SUMS).read_text(encoding="utf-8"))
        return {int(key): int(value) for key, value in record.items()}
    except (OSError, ValueError, TypeError, AttributeError, RecursionError):
        return {}


def _sums(database: sqlite3.Connection) -> dict[int, int]:
    """A sum over each piece of code and what it was made of."""
    rows = database.execute(f"SELECT {_COLUMNS} FROM cache")  # noqa: S608 (names of our own)
    return {int(row[0]): _sum(row) for row in rows}


def _sum(row: tuple[Any, ...]) -> int:
    total = 0
    for value in row:  # code as it is: its text would take twenty times as long, a tenth of a second of each process
        total = zlib.crc32(value if isinstance(value, bytes) else repr(value).encode(), total)
    return total
