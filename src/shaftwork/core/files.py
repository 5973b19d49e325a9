"""Files that are whole at every moment: whoever stops the program or writes beside it, and however full the disk is."""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import threading
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import IO

from shaftwork.core.errors import ParameterError


def in_a_folder(path: str | Path) -> Path:
    """A path to write to, in a folder that there is.

    Raises:
        ParameterError: there is no such folder, or the path is the name of no file.
    """
    if not isinstance(path, str | Path) or "\0" in str(path):
        raise ParameterError(f"path = {path!r} must be the name of a file, such as 'report.pdf'.")
    place = Path(path)
    if not place.parent.is_dir():
        raise ParameterError(f"There is no folder '{place.parent}' for '{place.name}'. Make it, or name another.")
    return place


@contextlib.contextmanager
def replaced(path: str | Path) -> Iterator[IO[str]]:
    """A file for text that takes the place of one at a path once it is written; till then that one stays.

    What is no file, as a terminal, is written to as it is.

    Raises:
        OSError: it cannot be written; what was there is as it was.
    """
    place = Path(os.path.realpath(path))  # a link stays one
    if place.exists() and not place.is_file():
        with place.open("w", encoding="utf-8", newline="") as file:
            yield file
        return
    # each thread has its own, whose name fits beside any 4-byte letters
    draft = place.with_name(f".{place.name[:50]}.{os.getpid()}.{threading.get_ident()}.part")
    if not place.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, f"there is no folder '{place.parent}'", str(path))
    try:
        with draft.open("w", encoding="utf-8", newline="") as file:
            yield file
        with contextlib.suppress(FileNotFoundError):
            shutil.copymode(place, draft)
        draft.replace(place)
    except OSError as error:
        if error.filename == str(draft):  # the user knows the path, not the draft
            error.filename = str(path)
        raise
    finally:
        draft.unlink(missing_ok=True)


@contextlib.contextmanager
def drafted(place: Path) -> Iterator[Path]:
    """A path for a library to write to, of the same end; what is there takes the place of the file once it is written.

    Raises:
        OSError: it cannot be written; what was there is as it was.
    """
    draft = place.with_name(f".{place.stem[:50]}.{os.getpid()}.{threading.get_ident()}.part{place.suffix}")
    try:
        yield draft
        draft.replace(place)
    finally:
        draft.unlink(missing_ok=True)


def write_rows(path: str | Path, head: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write a table as CSV.

    Raises:
        OSError: it cannot be written.
    """
    import csv

    with replaced(path) as file:
        csv.writer(file, lineterminator="\n").writerows([head, *rows])


def write_text(text: str, path: str | Path) -> None:
    """Write a text to a file.

    Raises:
        ParameterError: there is no such folder, or the file cannot be written.
    """
    place = in_a_folder(path)
    try:
        with replaced(place) as file:
            file.write(text)
    except OSError as error:
        raise ParameterError(f"{place} cannot be written: {error.strerror or error}. Name another file.") from None
