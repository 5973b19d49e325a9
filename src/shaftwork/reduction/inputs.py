"""The inputs of a network: what its sources give, or would give beside their laws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches

from shaftwork.components.base import Signal
from shaftwork.core.errors import SignalError
from shaftwork.network.graph import CircuitGraph, signals_of
from shaftwork.network.templates import Kind


@dataclass(frozen=True, eq=False)
class Place:
    """Where an input enters.

    Args:
        part: its number.
        signal: of the part.
        branch: that prescribes it; -1 of a torque, which needs a branch of its own.
    """

    part: int
    signal: Signal
    branch: int


def inputs_of(graph: CircuitGraph, number: int) -> dict[str, Place]:
    """The inputs at a part: what it prescribes, or the torque that it gives; a plain name comes last."""
    part = graph.parts[number]
    prescribed = {
        graph.branches[k].template.ends: k
        for k in part.branches
        if graph.branches[k].template.kind is Kind.ACROSS_SOURCE and not graph.branches[k].template.reads
    }
    own = signals_of(graph, part)
    if prescribed:
        across = ((name, made) for name, made in own.items() if made.kind == "across" and made.ends in prescribed)
        return {f"{part.name}.{name}": Place(number, made, prescribed[made.ends]) for name, made in across}
    if part.component.role not in ("source", "loss"):
        return {}
    return {f"{part.name}.{name}": Place(number, made, -1) for name, made in own.items() if made.kind == "through"}


def source_inputs(graph: CircuitGraph) -> tuple[str, ...]:
    """The inputs of all sources, in the order of the parts."""
    names: list[str] = []
    for number, part in enumerate(graph.parts):
        if part.component.role == "source":
            names.extend({place.signal: name for name, place in inputs_of(graph, number).items()}.values())
    return tuple(names)


def places_of(graph: CircuitGraph, names: Sequence[str]) -> tuple[Place, ...]:
    """Where the named inputs enter.

    Raises:
        SignalError: there is no such input.
    """
    known = {name: place for number in range(len(graph.parts)) for name, place in inputs_of(graph, number).items()}
    for name in names:
        if name not in known:
            close = get_close_matches(str(name), known, n=3) or tuple(known)[:12]
            raise SignalError(
                f"'{name}' is no input of '{graph.name}'. An input is what a source gives: "
                f"{', '.join(close) or 'none'}. To excite another node, add a source there; its law may be 0."
            )
    return tuple(known[name] for name in names)
