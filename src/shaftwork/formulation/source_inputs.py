"""The inputs of a network: what its sources give, or would give beside their laws."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

from sympy import Integer

from shaftwork.components.base import Signal
from shaftwork.core.errors import SignalError
from shaftwork.formulation.form import StateForm
from shaftwork.formulation.gains import add
from shaftwork.formulation.tree import Row
from shaftwork.network.graph import GROUND, CircuitGraph, GraphBranch, GraphPart, signals_of
from shaftwork.network.kinds import Kind
from shaftwork.network.templates import BranchTemplate


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
    if not prescribed and part.component.role not in ("source", "loss"):
        return {}
    return {
        f"{part.name}.{name}": Place(number, signal, prescribed.get(signal.ends, -1))
        for name, signal in signals_of(graph, part).items()
        if signal.kind == ("across" if prescribed else "through") and (not prescribed or signal.ends in prescribed)
    }


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
    by_name = {name: place for number in range(len(graph.parts)) for name, place in inputs_of(graph, number).items()}
    for name in names:
        if name not in by_name:
            close = get_close_matches(str(name), by_name, n=3) or tuple(by_name)[:12]
            raise SignalError(
                f"'{name}' is no input of '{graph.name}'. An input is what a source gives: "
                f"{', '.join(close) or 'none'}. To excite another node, add a source there; its law may be 0."
            )
    return tuple(by_name[name] for name in names)


def with_inputs(form: StateForm, places: Sequence[Place]) -> tuple[StateForm, tuple[int, ...]]:
    """The form with a branch for every torque that is an input, and the branches of all inputs.

    An input torque acts between the nodes of its source, beside whatever the source does by itself, also where its law
    is zero or depends on speed. So it is a branch of its own: one more link of the tree that is there already.
    """
    graph, tree = form.graph, form.tree
    branches, parts, members = list(graph.branches), list(graph.parts), list[int]()
    loops = dict(tree.loops)
    cutsets = dict(tree.cutsets) if form.loses_power else loops
    for place in places:
        if place.branch >= 0:
            members.append(place.branch)
            continue
        index, part, ends = len(branches), parts[place.part], place.signal.ends
        loops[index] = _row(form, part, place.signal, tree.loops, tree.potentials)
        if cutsets is not loops:
            cutsets[index] = _row(form, part, place.signal, tree.cutsets, tree.shares)
        plus, minus = map(part.node_at, ends)
        template = BranchTemplate(Kind.THROUGH_SOURCE, Integer(0), ends, (), "", (), Integer(0))
        branches.append(GraphBranch(index, place.part, template, plus, minus, ()))
        parts[place.part] = dataclasses.replace(part, branches=(*part.branches, index))
        members.append(index)
    added = tuple(range(len(graph.branches), len(branches)))
    if not added:
        return form, tuple(members)
    links = {**tree.links, Kind.THROUGH_SOURCE: (*tree.links[Kind.THROUGH_SOURCE], *added)}
    return StateForm(
        dataclasses.replace(graph, parts=tuple(parts), branches=tuple(branches)),
        dataclasses.replace(tree, links=links, loops=loops, cutsets=cutsets),
        form.angles,
    ), tuple(members)


def _row(
    form: StateForm, part: GraphPart, signal: Signal, links: Mapping[int, Row], nodes: Sequence[Row | None]
) -> Row:
    """The loop or cutset of a branch between the ends of a signal, from those of the links and nodes."""
    for index in part.branches:
        if index in links and form.graph.branches[index].template.ends == signal.ends:
            return links[index]
    ends = [*map(part.node_at, signal.ends)]
    rows = [{} if end == GROUND else _of_node(form, part, end, nodes) for end in ends]
    loop = dict(rows[0])
    for key, factor in rows[1].items():
        total = add(loop.pop(key, 0), -factor, [])
        if not (isinstance(total, int) and total == 0):
            loop[key] = total
    return loop


def _of_node(form: StateForm, part: GraphPart, node: int, rows: Sequence[Row | None]) -> Row:
    row = rows[node]
    if row is None:
        name = form.graph.node_name(node)
        raise SignalError(
            f"'{part.name}' is no input: nothing ties its node '{name}' to the reference. Join it to a Ground."
        )
    return row
