"""What a file says of a motion besides its numbers: what it is, and the call that led to it, as JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from shaftwork.core.errors import ModelFileError, SignalError
from shaftwork.modelfiles import textfile
from shaftwork.modelfiles.own_parts import checked_trust
from shaftwork.modelfiles.storage import netlist_of, netlist_text
from shaftwork.pipeline.arguments import Demand
from shaftwork.pipeline.compiler import Compiler
from shaftwork.pipeline.motion_start import Ending, Repetition
from shaftwork.results.observer import Array, PhaseRow
from shaftwork.results.solution import Solution

FORMAT = 1
"""Version of what is written here; a reader refuses newer ones."""
ARRIVING = "shaftwork arriving "
"""Before the numbers of columns with what arrives at the ends of travelling waves, which stands behind the states."""
PLAIN = ("name", "states", "engine", "why", "statistics", "events", "parameters", "initial", "rtol", "caveat")
"""Fields of a solution that stand in a file as they are."""


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


def record_text(motion: Solution, call: Repetition) -> str:
    """What a file says of a motion.

    Raises:
        ModelFileError: a part of the network has no text form.
    """
    facts = {name: getattr(motion, name) for name in PLAIN}
    phases = [[row.start, row.end, dict(row.modes)] for row in motion.phases]
    said = {"format": FORMAT, **facts, "phases": phases, "call": _call(call, motion.t)}
    return json.dumps(said, default=_as_plain, allow_nan=False)


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
        state["states"] = tuple(said["states"])
        state["events"] = tuple(map(tuple, said["events"]))
        state["phases"] = tuple(PhaseRow(start, end, dict(modes)) for start, end, modes in said["phases"])
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


def _call(call: Repetition, t: Array) -> dict[str, Any]:
    initial = call.initial
    if isinstance(initial, Ending) and initial.waves is not None:
        return {"why": "it went on from a motion with waves on their way through shafts"}
    if not isinstance(call.rebuild, Compiler):
        return {"why": "its model was not made by Network.compile"}
    demand = call.demand
    times = "t" if demand.t_eval is not None and np.array_equal(demand.t_eval, t) else demand.t_eval
    before = (
        {"t": initial.t, "read": initial.read, "modes": initial.modes, "parameters": initial.parameters}
        if isinstance(initial, Ending)
        else None
    )
    return {
        "network": netlist_text(call.netlist),
        "angles": call.rebuild.angles,
        "accepted": call.rebuild.accepted,
        "span": demand.span,
        "rtol": demand.rtol,
        "atol": demand.atol,
        "t_eval": times,
        "max_steps": demand.max_steps,
        "engine": call.engine,
        "values": call.values,
        "initial": initial,
        "before": before,
    }


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
    rebuild = Compiler(tuple(said["angles"]), said["accepted"])
    return Repetition(rebuild, netlist, demand, said["engine"], said["values"], initial)


def _as_plain(value: Any) -> Any:
    """A number or array of numpy, a tuple or a mapping, as JSON has it."""
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no place in JSON")
