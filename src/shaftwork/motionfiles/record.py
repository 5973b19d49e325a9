"""What a file says of a motion besides its numbers: what it is, and the call that led to it, as JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from shaftwork.modelfiles.storage import netlist_text
from shaftwork.results.observer import Array
from shaftwork.results.solution import Solution

if TYPE_CHECKING:
    from shaftwork.pipeline.motion_start import Repetition

FORMAT = 1
"""Version of what is written here; a reader refuses newer ones."""
ARRIVING = "shaftwork arriving "
"""Before the numbers of columns with what arrives at the ends of travelling waves, which stands behind the states."""
PLAIN = ("name", "states", "engine", "why", "statistics", "events", "parameters", "initial", "rtol", "caveat")
"""Fields of a solution that stand in a file as they are."""


def record_text(motion: Solution, call: Repetition) -> str:
    """What a file says of a motion.

    Raises:
        ModelFileError: a part of the network has no text form.
    """
    facts = {name: getattr(motion, name) for name in PLAIN}
    phases = [[row.start, row.end, dict(row.modes)] for row in motion.phases]
    said = {"format": FORMAT, **facts, "phases": phases, "call": _call(call, motion.t)}
    return json.dumps(said, default=_as_plain, allow_nan=False)


def _call(call: Repetition, t: Array) -> dict[str, Any]:
    demand = call.demand
    compiler: Any = call.rebuild
    initial: Any = call.initial  # values, or the end of a motion before
    times = "t" if demand.t_eval is not None and np.array_equal(demand.t_eval, t) else demand.t_eval
    before = None
    if hasattr(initial, "waves"):
        if initial.waves is not None:
            return {"why": "it went on from a motion with waves on their way through shafts"}
        before = {"t": initial.t, "read": initial.read, "modes": initial.modes, "parameters": initial.parameters}
    return {
        "network": netlist_text(call.netlist),
        "angles": compiler.angles,
        "accepted": compiler.accepted,
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


def _as_plain(value: Any) -> Any:
    """A number or array of numpy, a tuple or a mapping, as JSON has it."""
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no place in JSON")
