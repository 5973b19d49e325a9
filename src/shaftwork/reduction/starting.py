"""What parts say of themselves, with the loads that rest until the torque of a start is above theirs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

from sympy import Float, Symbol

from shaftwork.components.branches import THROUGH
from shaftwork.core.errors import Diagnostic
from shaftwork.network.graph import GROUND, CircuitGraph, GraphPart
from shaftwork.network.kinds import Kind
from shaftwork.network.wording import at_nodes, title
from shaftwork.reduction.gains import value_of
from shaftwork.reduction.tree import column_of

_JOINTS = (Kind.THROUGH_STORE, Kind.COUPLING)
"""Springs and gears: what hands a torque on at standstill."""
PAIR = 2
"""Ends of a spring, or shafts of a gear of two."""
_SLIPPING_OR_STUCK = 3
"""Modes of what rubs at all times: forward, backward, stuck; a brake has more."""


def notes_of(graph: CircuitGraph) -> Iterator[Diagnostic]:
    """What is worth saying about parts by their values."""
    for part in graph.parts:
        at = tuple(node for node in part.nodes.values() if node != GROUND)
        nodes = tuple(graph.nodes[node] for node in at)
        for note in part.component.notes():
            load = "" if note.torque is None else _against(graph, at[0], note.torque)
            message = f"{title(part.component)} at {at_nodes(nodes)} {note.message}{load}."
            yield Diagnostic(note.kind, message, note.hint, (part.name,), nodes, "note")


def _against(graph: CircuitGraph, start: int, torque: float) -> str:
    """The loads behind a node that rest until a torque there is above theirs, in words; losses of gears left out."""
    columns = (column_of(graph, branch) for branch in graph.branches if branch.template.kind in _JOINTS)
    pairs = ({node: value_of(factor) for node, factor in column.items()} for column in columns if len(column) == PAIR)
    speeds = speeds_along(graph, start, pairs)
    held: dict[str, float] = {}
    for part in graph.parts:
        for node in {*part.nodes.values()} & speeds.keys():
            if limit := _breakaway(graph, part, math.copysign(1.0, torque * speeds[node])):
                held[title(part.component)] = limit * abs(speeds[node])
    total = sum(held.values())
    if total <= 0:
        return ""
    stuck = ", which it does not move" if total >= abs(torque) else ""
    return f", against {total:.4g} N*m of {' and '.join(held)}{stuck}"


def speeds_along(graph: CircuitGraph, start: int, joints: Iterable[Mapping[int, float]]) -> dict[int, float]:
    """Speeds of the nodes that are joined to one, over its own.

    Args:
        graph: the network.
        start: the one.
        joints: node to factor, in sums that are zero; that of the frame is.
    """
    at: list[list[dict[int, float]]] = [[] for _ in graph.nodes]
    for joint in joints:
        moving = {node: factor for node, factor in joint.items() if node != GROUND}
        for node in moving if len(moving) > 1 else ():
            at[node].append(moving)
    speeds, ends = {start: 1.0}, [start]
    while ends:
        for joint in at[ends.pop()]:
            open_ends = [node for node in joint if node not in speeds]
            if len(open_ends) == 1:
                (other,) = open_ends
                speeds[other] = -sum(joint[node] * speeds[node] for node in joint if node != other) / joint[other]
                ends.append(other)
    return speeds


def _breakaway(graph: CircuitGraph, part: GraphPart, way: float) -> float:
    """The torque up to which a part between a node and the frame rests when pushed; 0 where none is known."""
    if len([end for end in part.nodes.values() if end != GROUND]) > 1:
        return 0.0
    values = {Symbol(name, real=True): Float(graph.parameters[f"{part.name}.{name}"]) for name in part.parameters}
    slips = (modes.options for modes in part.modes if len(modes.options) == _SLIPPING_OR_STUCK)
    guards = (leave.when for options in slips for mode in options if mode.gives_way for leave in mode.leaves)
    limits = [-when.xreplace({THROUGH: Float(0), **values}) for when in guards if way * when.diff(THROUGH) > 0]
    return sum(float(limit) for limit in limits if limit.is_comparable)
