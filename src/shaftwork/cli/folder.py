"""The folder of `--out`: it holds the files of one run, and files of the user, which stay as they are."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from shaftwork.cli.command import Say
from shaftwork.core.errors import MissingExtraError, ParameterError
from shaftwork.core.files import replaced

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MANIFEST = "shaftwork.json"
"""The file that lists the others of the run."""


class Folder:
    """A folder for the files of a run.

    Args:
        path: of the folder; it comes to be where there is none.
        names: of all files that the command may write.
        line: the words of the command line, to be written beside the results.

    Raises:
        ParameterError: nothing can be written there, or a file of the user has one of these names.
    """

    def __init__(self, path: Path, names: Sequence[str], line: Sequence[str]) -> None:
        self.path, self._line = path, tuple(line)
        try:
            path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ParameterError(f"--out {path} is no folder to write to: {error}. Give another folder.") from None
        if not os.access(path, os.W_OK):
            raise ParameterError(f"--out {path} is a folder that you may not write to. Give another folder.")
        older = self._files()
        if foreign := [name for name in names if (path / name).exists() and name not in older]:
            raise ParameterError(
                f"--out {path} has a file {foreign[0]} that its {MANIFEST} does not list, so no earlier run "
                "wrote it. Move it away, or give another folder."
            )

    @contextmanager
    def new_files(self, say: Say) -> Iterator[Path]:
        """A folder to write into; once everything is written it takes the place of the older run's files, and is said.

        Raises:
            ParameterError: something cannot be written, as on a full disk.
        """
        try:
            draft = Path(tempfile.mkdtemp(prefix=".shaftwork-", dir=self.path))
            try:
                yield draft
                self._take(draft)
            finally:
                shutil.rmtree(draft, ignore_errors=True)
        except OSError as error:
            raise ParameterError(
                f"--out {self.path} cannot be written: {error}. Make room, or give another folder."
            ) from None
        say(f"\nwritten: {', '.join(str(self.path / name) for name in self._files())}")

    def _take(self, draft: Path) -> None:
        """Put the files of a draft in the place of the older run's; wherever it ends, the next run knows them all."""
        new, older = sorted(path.name for path in draft.iterdir()), self._files()
        stale = [name for name in older if name not in new]
        self._list([*new, *stale])
        for name in new:
            (draft / name).replace(self.path / name)
        for name in stale:
            (self.path / name).unlink(missing_ok=True)
        self._list(new)

    def _list(self, names: Sequence[str]) -> None:
        manifest = {"command": ["shaftwork", *self._line], "files": names}
        with replaced(self.path / MANIFEST) as file:
            file.write(json.dumps(manifest, indent=2, ensure_ascii=False) + "\n")

    def _files(self) -> list[str]:
        """Names of the files of the run that is there."""
        place = self.path / MANIFEST
        if not place.exists():
            return []
        try:
            names = json.loads(place.read_text(encoding="utf-8"))["files"]
            if all(Path(name).name == name for name in names):
                return [str(name) for name in names]
        except (OSError, ValueError, TypeError, KeyError):
            pass
        raise ParameterError(
            f"--out {self.path} has a {MANIFEST} that no run has written, so that nobody knows which files are of an "
            "older run. Move it away, or give another folder."
        )


def write_picture(path: Path, draw: Callable[[], Figure]) -> None:
    """Write a picture as PNG; where matplotlib is not installed, warn that it is left out."""
    try:
        draw().savefig(path, dpi=150)
    except MissingExtraError as error:
        warnings.warn(f"{path.name} is left out. {error}", stacklevel=2)
