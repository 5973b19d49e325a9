"""Motions that are stored: pickled, copied and written to files without compiled code, and made again to be read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self

import numpy as np

from shaftwork.core.errors import AccuracyWarning, ParameterError
from shaftwork.core.notices import warn
from shaftwork.results.observer import Array, DenseStates

if TYPE_CHECKING:
    from shaftwork.results.solution import Solution

COMPILED = ("dense", "observer")
"""What of a motion holds compiled code."""


class Repeatable(Protocol):
    """The call that led to a motion."""

    def __call__(self) -> Solution:
        """The motion, made again."""
        ...

    def save(self, motion: Any, path: str | Path, names: Sequence[str]) -> None:
        """Write the motion to a file, with the call."""
        ...


class StoredMotion:
    """What of a solution stores it; a dataclass that has its fields."""

    if TYPE_CHECKING:
        name: str
        t: Array
        x: Array
        dense: DenseStates
        again: Repeatable | None
        __dataclass_fields__: ClassVar[dict[str, Any]]

    def _protect(self) -> None:
        """Refuse writing into times and states: all that is read of the motion comes from them."""
        vars(self).update(t=read_only(self.t), x=read_only(self.x))

    def __getstate__(self) -> dict[str, Any]:
        stored = (item.name for item in fields(self) if item.name not in COMPILED)
        return {name: getattr(self, name) for name in stored}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        vars(self).update(state)
        self._protect()

    def __deepcopy__(self, _memo: Any) -> Self:
        return replace(self, x=self.x.copy())

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            again = vars(self).get("again") if name in COMPILED else None
            if again is None:
                raise AttributeError(f"A Solution has no '{name}'.")
            motion = again()
            self._warn_of_another(motion)
            vars(self).update({part: getattr(motion, part) for part in COMPILED})
            return vars(self)[name]

    def _warn_of_another(self, motion: Self) -> None:
        """Say where a motion that was made again differs from what was stored of it."""
        if not self.x.size:
            return
        inside = np.append(self.t[1:] != self.t[:-1], True)  # of two sides the later one
        off = np.abs(motion.dense(self.t[inside]) - self.x[inside]).max(axis=0)
        share = float((off / np.maximum(np.abs(self.x).max(axis=0), np.finfo(float).tiny)).max())
        # Two runs of one motion at the usual tolerance differ by less of the largest value of a state.
        if share > 1e-6:
            warn(
                f"The stored motion of '{self.name}' was made again to be read, by other versions or on another "
                f"machine: its states differ by up to {share:.1e} of their largest value.",
                AccuracyWarning,
            )

    def save(self, path: str | Path, *names: str) -> None:
        """Write the motion to a file: netCDF (.nc, also .h5) or Parquet (.parquet), which `sw.load_solution` reads.

        It holds times, states, the named quantities with units, events, phases, parameters, the network and the call.

        Args:
            path: of the file.
            *names: quantities; by default all, along shafts too.

        Raises:
            MissingExtraError: a library is not installed (extra `files`).
            ModelFileError: the file cannot be written, or a part of the network has no text form.
            ParameterError: another end of the name, or there is no such folder.
            SignalError: there is no such quantity.
        """
        if self.again is None:
            raise ParameterError("This motion does not know the call that led to it. Save what simulate(...) gave.")
        self.again.save(self, path, names)


def read_only(values: Array) -> Array:
    """The same numbers, not to be written into."""
    view = values.view()
    view.flags.writeable = False
    return view
