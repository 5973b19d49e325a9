"""A file to which a sweep appends every chunk that is done, so that stopping loses nothing.

One JSON text a line: first what the sweep is, then chunks, each with a sum over what it says. A line that was cut off
when the sweep was killed is written anew.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import sys
import zlib
from collections.abc import Callable, Mapping
from contextlib import suppress
from io import FileIO
from pathlib import Path
from typing import Any, Self

import numpy as np

from shaftwork.core.errors import ParameterError
from shaftwork.network.netlist import listed
from shaftwork.results.measures import Measure
from shaftwork.sweep.sweep_task import Chunk, Reader, Task

try:
    import fcntl
except ImportError:  # a system without such locks
    fcntl = None  # type: ignore[assignment]


class Store:
    """The file of a sweep, which is for one sweep at a time, until it is closed.

    Args:
        path: of the file; it is made where there is none.
        task: the sweep.

    Raises:
        ParameterError: the file is that of another sweep, is in use, is damaged in a line that is not the last, or
            cannot be written.
    """

    def __init__(self, path: str | Path, task: Task) -> None:
        self._path, self._title = Path(path), _title(task)
        title = (json.dumps(self._title | {"version": _version()}) + "\n").encode()
        self._file = self._opened()
        try:
            raw = self._file.read()
            *whole, torn = raw.split(b"\n")
            if whole or not title.startswith(torn):
                self._refuse_other(raw.split(b"\n", 1)[0])
            self.chunks = [self._read(line, number, task) for number, line in enumerate(whole[1:], 2)]
            """What is there."""
            if torn:
                self._file.truncate(len(raw) - len(torn))
            if not whole:
                self._write(title)
        except BaseException:
            self.close()
            raise

    def _opened(self) -> FileIO:
        """The file, locked against other sweeps where the system has locks; the system lets go of them at any end."""
        try:
            if self._path.exists() and not self._path.is_file():
                why = "it is no file"
            else:
                return self._locked(FileIO(self._path, "a+"))
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or str(error)
        raise ParameterError(f"store = '{self._path}' cannot be used: {why}. Give a file in a folder that exists.")

    def _locked(self, file: FileIO) -> FileIO:
        file.seek(0)
        try:
            if fcntl is not None:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.close()
            raise ParameterError(
                f"store = '{self._path}' is in use by another sweep. Wait until it has ended, or give another name."
            ) from None
        except OSError:
            pass  # a file system without locks
        return file

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave the file to others."""
        self._file.close()

    def _write(self, line: bytes) -> None:
        """Append a line, whole or not at all.

        Raises:
            ParameterError: it cannot be written, as on a full disk.
        """
        before, left = self._file.seek(0, os.SEEK_END), memoryview(line)
        try:
            while left:
                left = left[self._file.write(left) :]
        except OSError as error:
            with suppress(OSError):
                self._file.truncate(before)
            raise ParameterError(
                f"store = '{self._path}' cannot be written any more: {error}. What it has is kept: make room, and the "
                "same call goes on from there."
            ) from None

    def _refuse_other(self, line: bytes) -> None:
        title = _parsed(line)
        if not isinstance(title, dict) or "format" not in title:
            raise ParameterError(
                f"store = '{self._path}' is no file of a sweep: line 1 does not say of which. Give another name; if it "
                "was one and is damaged, delete the file."
            )
        for what, expected in self._title.items():
            if title.get(what) != expected:
                raise ParameterError(
                    f"store = '{self._path}' holds another sweep, which differs in its {what}, so its results are "
                    "not those of this one. Give another name, or repeat the call that made it."
                )
        if (before := title.get("version")) != _version():
            raise ParameterError(
                f"store = '{self._path}' was begun by {f'version {before}' if before else 'an earlier version'} of "
                f"Shaftwork, and this is {_version()}: other versions may come to other digits. Give another name."
            )

    def _read(self, line: bytes, number: int, task: Task) -> Chunk:
        record = _parsed(line)
        if wrong := _objection(record, task):
            raise ParameterError(
                f"store = '{self._path}' is damaged in line {number}: {wrong}. Delete this line, and its variants are "
                "computed anew, or delete the file."
            )
        values = [[math.nan if value is None else value for value in row] for row in record["values"]]
        return Chunk(
            np.array(record["variants"], dtype=np.intp),
            np.array(values, dtype=float).reshape(-1, len(task.measures)),
            tuple(record["reasons"]),
            record.get("left", 0),
        )

    def append(self, chunk: Chunk) -> None:
        """Write what has been done.

        Raises:
            ParameterError: it cannot be written.
        """
        values = [[value if math.isfinite(value) else None for value in row] for row in chunk.values.tolist()]
        record = {
            "variants": chunk.variants.tolist(),
            "values": values,
            "reasons": list(chunk.reasons),
            "left": chunk.left,
        }
        self._write((json.dumps(record | {"check": check_of(record)}) + "\n").encode())


def check_of(record: Mapping[str, Any]) -> int:
    """A sum over all that a line says but itself: a digit that was changed changes it."""
    return zlib.crc32(json.dumps({key: value for key, value in record.items() if key != "check"}).encode())


def _parsed(line: bytes) -> Any:
    """What a line says; None where it is no JSON."""
    try:
        return json.loads(line)
    except (ValueError, RecursionError):
        return None


def _objection(record: Any, task: Task) -> str:
    """Why a line is not what a chunk of a sweep is written as; empty where it is."""
    if not isinstance(record, dict):
        return "it is not whole, or no chunk of a sweep"
    if missing := [key for key in ("variants", "values", "reasons") if key not in record]:
        return f"it lacks {listed(missing)}"
    variants, values, reasons = record["variants"], record["values"], record["reasons"]
    if not _are(variants, lambda one: _counts(one, len(task) - 1)) or len(set(variants)) < len(variants):
        return f"its variants are not different whole numbers from 0 to {len(task) - 1}"
    if not _are(values, lambda row: _are(row, _measured, len(task.measures)), len(variants)):
        return f"its values are not {len(task.measures)} numbers for each of its {len(variants)} variants"
    if not _are(reasons, lambda one: isinstance(one, str), len(variants)):
        return f"its reasons are not a text for each of its {len(variants)} variants"
    if not _counts(record.get("left", 0), len(variants)):
        return f"'left' is not a whole number from 0 to {len(variants)}"
    return "" if record.get("check") == check_of(record) else "its digits are not those that were written"


def _are(items: Any, holds: Callable[[Any], bool], count: int | None = None) -> bool:
    """Whether it is a list, of so many entries, of which each is as it should be."""
    return isinstance(items, list) and count in (None, len(items)) and all(map(holds, items))


def _counts(value: Any, most: int) -> bool:
    return type(value) is int and 0 <= value <= most


def _measured(value: Any) -> bool:
    """A number, or nothing where a variant failed."""
    return value is None or (type(value) in (int, float) and abs(value) <= sys.float_info.max)


def _version() -> str:
    """Of this library, without an import of the whole of it."""
    version: str = sys.modules[__name__.partition(".")[0]].__version__
    return version


def _title(task: Task) -> dict[str, str | int]:
    """What the results of a sweep depend on; long things by their digest."""
    table = hashlib.sha256()
    for name, column in task.columns.items():
        table.update(name.encode() + np.ascontiguousarray(column).tobytes())
    options = {**task.options, **({"steady": True} if task.steady else {})}.items()
    parts = "\n".join(repr(placed) for placed in task.network.netlist().placed)
    return {
        "format": 2,
        "network": f"{task.network.name} {hashlib.sha256(parts.encode()).hexdigest()}",
        "parameters": f"{', '.join(task.columns)} {table.hexdigest()}",
        "measures": _measures(task.measures),
        "S-N lines": repr(dict(task.sn)),
        "t_end": repr(task.t_end),
        "options": repr({name: getattr(value, "tolist", lambda value=value: value)() for name, value in options}),
    }


def _measures(readers: Mapping[str, Reader]) -> str:
    """Names and what is read; of a function its own name, since no text tells what it does."""
    named = {
        name: str(reader) if isinstance(reader, Measure) else getattr(reader, "__qualname__", type(reader).__name__)
        for name, reader in readers.items()
    }
    return repr(named)
