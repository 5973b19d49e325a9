"""Motions written to files, with the call that led to them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from shaftwork.core.errors import ModelFileError
from shaftwork.core.files import drafted, in_a_folder
from shaftwork.modelfiles.storage import netlist_text
from shaftwork.motionfiles.motion_formats import format_of
from shaftwork.results.observer import Array
from shaftwork.results.solution import Solution

if TYPE_CHECKING:
    from shaftwork.pipeline.motion_start import Repetition

FORMAT = 1
"""Version of what is written here; a reader refuses newer ones."""
PLAIN = ("name", "states", "engine", "why", "statistics", "events", "parameters", "initial", "rtol", "caveat")
"""Fields of a solution that stand in a file as they are."""


def write_motion(call: Repetition, motion: Solution, path: Any, names: Sequence[str]) -> None:
    """Write a motion; see `Solution.save`."""
    place = in_a_folder(path)
    writer, _ = format_of(place)
    wanted = dict.fromkeys((*motion.states, *(names or (*motion.names, *motion.places))))
    text = record_text(motion, call)
    try:
        with drafted(place) as draft:
            writer(motion, tuple(wanted), text, draft)
    except OSError as error:
        raise ModelFileError(f"{place} cannot be written: {error}.") from None


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
    initial: Any = call.initial
    goes_on = hasattr(initial, "read")  # from where another motion has ended
    if goes_on and initial.waves is not None:
        return {"why": "it went on from a motion with waves on their way through shafts"}
    compiler: Any = call.rebuild
    if not hasattr(compiler, "angles"):
        return {"why": "its model was not made by Network.compile"}
    demand = call.demand
    times = "t" if demand.t_eval is not None and np.array_equal(demand.t_eval, t) else demand.t_eval
    before = (
        {"t": initial.t, "read": initial.read, "modes": initial.modes, "parameters": initial.parameters}
        if goes_on
        else None
    )
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
