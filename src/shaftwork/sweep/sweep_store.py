"""A file to which a sweep writes every chunk that is done, so that stopping loses nothing: a database of SQLite.

SQLite writes a chunk whole or not at all, whatever ends the process. One sweep has the file at a time. Each chunk has a
digest of what it says.
"""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Self

import numpy as np

from shaftwork.core.errors import AccuracyWarning, ParameterError
from shaftwork.core.notices import warn
from shaftwork.core.screen import shorter
from shaftwork.pipeline.network import Network
from shaftwork.results.measures import Measure
from shaftwork.sweep.cluster import libraries
from shaftwork.sweep.sweep_task import Chunk, Reader, Task

TABLES = (
    "CREATE TABLE IF NOT EXISTS sweep (what TEXT PRIMARY KEY, value TEXT)",
    "CREATE TABLE IF NOT EXISTS chunks "
    "(number INTEGER PRIMARY KEY, variants BLOB, measured BLOB, reasons TEXT, alone TEXT, digest TEXT)",
)
"""What the sweep is, and its chunks: numbers of 64 bits, texts by place in the chunk, see `Chunk`."""


LIBRARIES = "libraries"
"""Under which it is said with which versions the sweep was begun."""


class Store:
    """The file of a sweep, which is for one sweep at a time, until it is closed.

    Args:
        path: of the file; it is made where there is none.
        task: the sweep.

    Raises:
        ParameterError: the file is that of another sweep or none, is in use, is damaged, or cannot be written.
    """

    def __init__(self, path: str | Path, task: Task) -> None:
        if not isinstance(path, str | Path):
            raise ParameterError(f"store = {path!r} must be the name of a file.")
        self._path = Path(path)
        if str(path) == ":memory:":  # SQLite's name for what is gone with the process
            raise ParameterError("store = ':memory:' is no file, so nothing would be kept. Give the name of one.")
        if self._path.exists() and not self._path.is_file():
            raise ParameterError(f"store = '{path}' cannot be used: it is no file. Give another name.")
        with self._told():
            self._database = sqlite3.connect(self._path, timeout=0.0, isolation_level=None)
        try:
            with self._told():
                self._begin(_title(task))
                rows = self._database.execute("SELECT variants, measured, reasons, alone, digest, number FROM chunks")
                self.chunks = [chunk for row in rows.fetchall() if (chunk := self._read(row, task)) is not None]
                """What is there."""
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave the file to others."""
        self._database.close()

    def _begin(self, title: Mapping[str, str]) -> None:
        """Take hold of the file, and say in a new one what the sweep is."""
        execute = self._database.execute
        execute("PRAGMA locking_mode = EXCLUSIVE")  # from the first writing to the end of the connection
        execute("BEGIN EXCLUSIVE")
        tables = {name for (name,) in execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if tables - {"sweep", "chunks"}:
            raise ParameterError(f"store = '{self._path}' is a database of something else. Give another name.")
        for table in TABLES:
            execute(table)
        there = dict(execute("SELECT what, value FROM sweep").fetchall())
        if there:
            self._refuse_other(there, title)
        else:
            self._database.executemany("INSERT INTO sweep VALUES (?, ?)", title.items())
        execute("COMMIT")

    def _refuse_other(self, there: Mapping[str, str], title: Mapping[str, str]) -> None:
        differing = [what for what, value in title.items() if there.get(what) != value]
        if others := [what for what in differing if what != LIBRARIES]:
            short = {"t_end", "measures", "options"}  # the others are digests
            both = (shorter(str(one.get(others[0]))) for one in (there, title))
            words = " ({}, and here {})".format(*both) if others[0] in short else ""
            raise ParameterError(
                f"store = '{self._path}' holds another sweep, which differs in its {others[0]}{words}, so its results "
                "are not those of this one. Give another name, or repeat the call that made it."
            )
        if differing:
            before, now = (json.loads(text) for text in (there[LIBRARIES], title[LIBRARIES]))
            changed = [
                f"{name} {before.get(name)}, and this is {now[name]}" for name in now if now[name] != before.get(name)
            ]
            raise ParameterError(
                f"store = '{self._path}' was begun with {'; '.join(changed)}: other versions may come to other digits. "
                "Give another name."
            )

    def _read(self, row: Any, task: Task) -> Chunk | None:
        """A chunk; None of one that is not what was written, and is computed anew."""
        *stored, digest, number = row
        if digest != _digest(*stored):
            warn(
                f"store = '{self._path}': chunk {number} is damaged, and its variants are computed anew.",
                AccuracyWarning,
            )
            self._database.execute("DELETE FROM chunks WHERE number = ?", (number,))
            return None
        variants, measured, reasons, alone = stored
        numbers = np.frombuffer(variants, dtype="<i8").astype(np.intp)
        values = np.frombuffer(measured, dtype="<f8").reshape(-1, len(task.measures))
        failed, left = (
            tuple(texts.get(str(place), "") for place in range(numbers.size))
            for texts in (json.loads(reasons), json.loads(alone))
        )
        return Chunk(numbers, values, failed, left)

    def append(self, chunk: Chunk) -> None:
        """Write what has been done.

        Raises:
            ParameterError: it cannot be written.
        """
        reasons, alone = (
            json.dumps({str(place): text for place, text in enumerate(texts) if text})
            for texts in (chunk.reasons, chunk.alone)
        )
        numbers, values = (
            np.ascontiguousarray(a, dtype=k).tobytes() for a, k in ((chunk.variants, "<i8"), (chunk.values, "<f8"))
        )
        stored = numbers, values, reasons, alone
        row = "INSERT INTO chunks (variants, measured, reasons, alone, digest) VALUES (?, ?, ?, ?, ?)"
        try:
            self._database.execute(row, (*stored, _digest(*stored)))
        except sqlite3.Error as error:
            raise ParameterError(
                f"store = '{self._path}' cannot be written any more: {error}. What it has is kept: make room, and the "
                "same call goes on from there."
            ) from None

    @contextmanager
    def _told(self) -> Iterator[None]:
        """What SQLite says, in the words of whoever gave the file."""
        try:
            yield
        except ParameterError:
            raise
        except (sqlite3.Error, ValueError, TypeError, RecursionError) as error:
            text = str(error)
            if "locked" in text:
                reason = "is in use by another sweep. Wait until it has ended, or give another name"
            elif "not a database" in text:
                reason = "is no file of a sweep. Give another name"
            elif isinstance(error, sqlite3.OperationalError) and "malformed" not in text:
                reason = f"cannot be used: {text}. Give a file in a folder that exists and may be written to"
            else:
                reason = f"is damaged: {text}. Delete the file"
            raise ParameterError(f"store = '{self._path}' {reason}.") from None


def _digest(variants: bytes, measured: bytes, reasons: str, alone: str) -> str:
    """Of all that a chunk says: a bit that was changed changes it."""
    return hashlib.sha256(b"".join((variants, measured, f"{reasons}{alone}".encode()))).hexdigest()


def _title(task: Task) -> dict[str, str]:
    """What the results of a sweep depend on; long things by their digest."""
    table = hashlib.sha256()
    for name, column in task.columns.items():
        table.update(name.encode() + np.ascontiguousarray(column).tobytes())
    options = {**task.options, **({"steady": True} if task.steady else {})}
    options |= {"precision on a graphics processor": task.precision} if task.precision else {}
    return {
        "format": "4",
        "network": f"{task.network.name} {_laws(task.network)}",
        "parameters": f"{', '.join(task.columns)} {table.hexdigest()}",
        "measures": _measures(task.measures),
        "S-N lines": repr(dict(task.sn)),
        "t_end": repr(task.t_end),
        "options": repr(
            {name: getattr(value, "tolist", lambda value=value: value)() for name, value in options.items()}
        ),
        LIBRARIES: json.dumps(libraries()),
    }


def _laws(network: Network) -> str:
    """A digest of the parts and of the laws that they come to, those of your own classes and of files as well."""
    netlist, graph = network.netlist(), network.graph()
    laws = hashlib.sha256(repr((netlist, graph.parts, graph.branches)).encode())
    for placed in netlist.placed:
        for value in placed.part.values.values():
            if isinstance(path := getattr(value, "path", None), Path):
                laws.update(path.read_bytes())
    return laws.hexdigest()


def _measures(readers: Mapping[str, Reader]) -> str:
    """Names and what is read; of a function its own name, since no text tells what it does.

    Raises:
        ParameterError: a function has none.
    """
    names = {name: str(reader) if isinstance(reader, Measure) else _named(reader) for name, reader in readers.items()}
    if unclear := [name for name, text in names.items() if "<lambda>" in text or " at 0x" in text]:
        raise ParameterError(
            f"store: measure '{unclear[0]}' is a lambda, or has no name that stays the same, so the file cannot tell "
            "it from another one. Define a function with a name."
        )
    return repr(names)


def _named(function: Any) -> str:
    """The name of a function, with what a `functools.partial` gives to it."""
    if isinstance(function, partial):
        return f"{_named(function.func)} {function.args} {function.keywords}"
    return str(getattr(function, "__qualname__", repr(function)))
