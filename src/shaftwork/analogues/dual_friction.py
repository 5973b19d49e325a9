"""Frictions of a network whose dual is asked for: those side by side are one, and no two may hold the same shaft."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence

from shaftwork.analogues.circuit_elements import Edge, Element, in_letters
from shaftwork.analogues.dual_modes import DualModes
from shaftwork.components.branches import ACROSS
from shaftwork.core.errors import Diagnostic
from shaftwork.formulation.form import StateForm, state_form
from shaftwork.network.graph import build_graph
from shaftwork.network.kinds import Kind
from shaftwork.network.netlist import Netlist, listed, title


def side_by_side(
    elements: Sequence[Element], nodes_of: Mapping[Edge, tuple[int, int]]
) -> tuple[tuple[Element, ...], Mapping[Edge, tuple[Edge, float]]]:
    """The elements, with frictions between the same two nodes as one: in the dual two open contacts would be in series.

    Args:
        elements: of the network.
        nodes_of: first and second node of each edge.

    Returns:
        The elements, and for each friction that is part of another one the edge of that, and the sign of its own.
    """
    results: list[Element] = []
    places: dict[tuple[int, ...], int] = {}
    shared: dict[Edge, tuple[Edge, float]] = {}
    for element in elements:
        nodes = nodes_of[element.edges[0]]
        place = places.setdefault(tuple(sorted(nodes)), len(results)) if element.back is not None else len(results)
        if place == len(results):
            results.append(element)
            continue
        first = results[place]
        along = nodes_of[first.edges[0]] == nodes
        ahead, back = element.value, element.back
        if not along:
            ahead, back = (-in_letters(law, {ACROSS: -ACROSS}) for law in (back, ahead))
        results[place] = dataclasses.replace(first, value=first.value + ahead, back=first.back + back)
        shared[element.edges[0]] = first.edges[0], 1.0 if along else -1.0
    return tuple(results), shared


def held_twice(netlist: Netlist, form: StateForm, shared: Mapping[Edge, tuple[Edge, float]]) -> Iterator[Diagnostic]:
    """Parts that hold, by their modes, what others hold: in the dual the voltage between two open contacts is free.

    Args:
        netlist: of the network.
        form: its state form, with a branch for each part that has modes.
        shared: frictions that are part of others.
    """
    parts = {form.graph.part_of(branch).name for branch, _ in shared}  # only asked for membership
    holding = [part for part in form.graph.parts if part.modes and part.name not in parts]
    choices = {part.name: (DualModes(part).holding,) for part in holding if DualModes(part).holds}
    if not choices:
        return
    slipping = {part.name: (DualModes(part).choice,) for part in form.graph.parts if part.modes}
    stuck = state_form(build_graph(netlist.with_choices({**slipping, **choices})))
    for index in stuck.tree.links[Kind.COUPLING]:
        part = stuck.graph.part_of(index)
        if part.name not in choices:
            continue
        around = (stuck.graph.part_of(branch).name for branch in stuck.tree.loops[index])
        names = tuple(name for name in dict.fromkeys(around) if name != part.name)
        message = f"{title(part.component)} holds what {listed(names)} can hold too, and how they share it is open."
        yield Diagnostic("no dual", message, "Leave one of them out.", (part.name, *names))
