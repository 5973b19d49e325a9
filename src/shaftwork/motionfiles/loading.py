"""Motions from files."""

from __future__ import annotations

import json
import reprlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from shaftwork.core.errors import ModelFileError, ParameterError, SignalError
from shaftwork.modelfiles import textfile
from shaftwork.modelfiles.own_parts import checked_trust
from shaftwork.modelfiles.storage import netlist_of
from shaftwork.motionfiles.motion_files import read_motion
from shaftwork.motionfiles.record import ARRIVING, FORMAT, PLAIN
from shaftwork.pipeline.arguments import Demand
from shaftwork.pipeline.compiler import Compiler
from shaftwork.pipeline.motion_start import Ending, Repetition
from shaftwork.results.observer import Array, PhaseRow
from shaftwork.results.solution import Solution

KINDS = dict.fromkeys(("name", "engine", "why", "caveat"), str) | dict.fromkeys(("statistics", "parameters"), dict)
"""Of facts in a file the kinds."""


@dataclass(frozen=True)
class NotRepeatable:
    """Stands for the call that led to a motion where a file cannot hold it.

    Args:
        name: of the network.
        why: it cannot.
    """

    name: str
    why: str

    def __call__(self) -> NoReturn:
        raise SignalError(
            f"The file of '{self.name}' holds the quantities that were saved alone: {self.why}. Save those that are "
            "wanted when the motion is made."
        )

    def save(self, _motion: Solution, _path: Any, _names: Sequence[str]) -> NoReturn:
        """Nothing that the file does not hold can be written: copy the file."""
        self()


def load_solution(path: str | Path, *, trust: Sequence[str] = ()) -> Solution:
    """The motion in a file that `Solution.save` wrote: the same states and saved quantities, to the last bit.

    Other quantities, `at`, extremes and the energy balance are read from the motion made again, when the first of them
    is read: the file holds the network and the call. An `AccuracyWarning` says where it comes out otherwise.

    Args:
        path: of the file, .nc, .h5 or .parquet.
        trust: packages whose modules may be imported for parts of one's own, as for `Network.load`.

    Raises:
        MissingExtraError: a library is not installed (extra `files`).
        ModelFileError: the file cannot be read, or holds no motion.
        ParameterError: another end of the name, or `trust` has no names of packages.
    """
    try:
        place = Path(path)
    except TypeError:
        raise ParameterError(f"path = {path!r} must be the name of a file, such as 'crane.nc'.") from None
    text, t, columns = read_motion(place)
    try:
        return solution_of(text, t, columns, trust)
    except ModelFileError as error:
        raise ModelFileError(f"{place}: {error}") from None


def solution_of(text: str, t: Array, columns: Mapping[str, Array], trust: Any) -> Solution:
    """The motion that a file holds.

    Args:
        text: what it says.
        t: (k,) output times, s.
        columns: quantities at these times by name, the states among them.
        trust: packages whose parts may be imported.

    Raises:
        ModelFileError: it is not what `record_text` writes.
        ParameterError: `trust` has no names of packages.
    """
    trusted = checked_trust(trust)
    try:
        said = json.loads(text)
        version = said["format"]
        if version != FORMAT:
            raise ModelFileError(
                f"its format is {version!r}, and this version reads {FORMAT}. Update the package if the file is newer."
            )
        state: dict[str, Any] = {name: said[name] for name in PLAIN}
        _refuse_other_kinds(said)
        state["states"] = tuple(map(str, said["states"]))
        state["events"] = tuple((float(time), str(part), str(a), str(b)) for time, part, a, b in said["events"])
        state["phases"] = tuple(PhaseRow(float(a), float(b), _words(modes)) for a, b, modes in said["phases"])
        stored = [columns[name] for name in (*said["states"], *(name for name in columns if name.startswith(ARRIVING)))]
        x = np.column_stack(stored) if stored else np.zeros((len(t), 0))
        call = _call_of(said["call"], said["name"], t, trusted)
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        if isinstance(error, ModelFileError):
            raise
        raise ModelFileError(f"it is no motion that was saved: {error!r}") from None
    others = {name: columns[name] for name in columns if name not in said["states"] and not name.startswith(ARRIVING)}
    motion = Solution.__new__(Solution)
    motion.__setstate__({**state, "t": t, "x": x, "again": call, "saved": others})
    return motion


def _refuse_other_kinds(said: Mapping[str, Any]) -> None:
    if wrong := [name for name, kind in KINDS.items() if not isinstance(said[name], kind)]:
        raise TypeError(f"{wrong[0]} = {reprlib.repr(said[wrong[0]])}")


def _words(modes: Mapping[str, str]) -> dict[str, str]:
    return {part: str(mode) for part, mode in modes.items()}


def _call_of(said: Mapping[str, Any], name: str, t: Array, trusted: Sequence[str]) -> Repetition | NotRepeatable:
    if "why" in said:
        return NotRepeatable(name, said["why"])
    netlist = netlist_of(textfile.read(said["network"]), "its network", trusted)
    times = {"t": t, None: None}.get(said["t_eval"]) if not isinstance(said["t_eval"], list) else said["t_eval"]
    initial, before = said["initial"], said["before"]
    if before is not None:
        initial = Ending(initial, before["t"], before["read"], before["modes"], before["parameters"], None)
    start, end = said["span"]
    demand = Demand(
        (start, end),
        said["rtol"],
        said["atol"],
        None if times is None else np.array(times),
        said["engine"],
        said["max_steps"],
        None,
    )
    rebuild = Compiler(tuple(map(str, said["angles"])), str(said["accepted"]))
    return Repetition(rebuild, netlist, demand, said["engine"], said["values"], initial)
