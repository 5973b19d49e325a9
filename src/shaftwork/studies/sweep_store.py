"""A file to which a sweep appends every chunk that is done, so that stopping loses nothing.

One JSON text a line: first what the sweep is, then chunks. A line that was cut off when the sweep was killed is written
anew.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from shaftwork.core.errors import ParameterError
from shaftwork.results.measures import Measure
from shaftwork.studies.sweep_task import Chunk, Reader, Task

FORMAT = 1


class Store:
    """The file of a sweep.

    Args:
        path: of the file; it is made where there is none.
        task: the sweep.

    Raises:
        ParameterError: the file is that of another sweep, or cannot be written.
    """

    def __init__(self, path: str | Path, task: Task) -> None:
        self._path, self._title = Path(path), _title(task)
        try:
            text = self._path.read_text(encoding="utf-8") if self._path.exists() else ""
            lines = text.splitlines(keepends=True)
            whole = [line for line in lines if line.endswith("\n")]
            if not whole:
                self._path.write_text(json.dumps(self._title) + "\n", encoding="utf-8")
            elif len(whole) < len(lines):
                self._path.write_text("".join(whole), encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise ParameterError(
                f"store = '{path}' cannot be used: {error}. Give a file in a folder that exists."
            ) from None
        if whole:
            self._refuse_other(whole[0])
        self.chunks = [self._read(line, len(task.measures)) for line in whole[1:]]
        """What is there."""

    def _refuse_other(self, line: str) -> None:
        try:
            found = json.loads(line)
            known = dict(found)
        except ValueError:
            raise ParameterError(f"store = '{self._path}' is no file of a sweep. Give another name.") from None
        for what, own in self._title.items():
            if known.get(what) != own:
                raise ParameterError(
                    f"store = '{self._path}' holds another sweep, which differs in its {what}, so its results are "
                    "not those of this one. Give another name, or repeat the call that made it."
                )

    def _read(self, line: str, measures: int) -> Chunk:
        made = json.loads(line)
        values = [[math.nan if value is None else value for value in row] for row in made["values"]]
        return Chunk(
            np.array(made["variants"], dtype=np.intp),
            np.array(values, dtype=float).reshape(-1, measures),
            tuple(made["reasons"]),
            made.get("left", 0),
        )

    def append(self, chunk: Chunk) -> None:
        """Write what has been done."""
        values = [[value if math.isfinite(value) else None for value in row] for row in chunk.values.tolist()]
        made = {
            "variants": chunk.variants.tolist(),
            "values": values,
            "reasons": list(chunk.reasons),
            "left": chunk.left,
        }
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(made) + "\n")


def _title(task: Task) -> dict[str, str | int]:
    """What the results of a sweep depend on; long things by their digest."""
    table = hashlib.sha256()
    for name, column in task.columns.items():
        table.update(name.encode() + np.ascontiguousarray(column).tobytes())
    options = task.options.items()
    parts = "\n".join(repr(placed) for placed in task.network.netlist().placed)
    return {
        "format": FORMAT,
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
