"""What slips by its mode, and yet does not move at all, as others hold both of its ends: two frictions on one shaft."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from itertools import chain

from shaftwork.components.branches import End
from shaftwork.components.modes import ModeChoice, Modes
from shaftwork.formulation.form import StateForm
from shaftwork.formulation.gains import Number, add, value_of
from shaftwork.network.graph import GROUND, GraphPart
from shaftwork.network.kinds import Kind
from shaftwork.network.netlist import Netlist


def at_rest(netlist: Netlist, form: StateForm) -> Netlist:
    """The network with the laws of rest for what cannot move; the same one where there are none.

    Args:
        netlist: of the network, with a form chosen for each element.
        form: of the same network.
    """
    parts = {part.name: part for part in form.graph.parts}
    resting: dict[str, tuple[ModeChoice, ...]] = {}
    for item in netlist.placed:
        part = parts[item.part.name]
        pairs = zip(part.modes, item.choices, strict=False)  # nothing is chosen for what has no modes
        choices = tuple(_choice_at_rest(form, part, element, choice) for element, choice in pairs)
        if choices != item.choices:
            resting[part.name] = choices
    return netlist.with_choices(resting) if resting else netlist


def _choice_at_rest(form: StateForm, part: GraphPart, element: Modes, choice: ModeChoice) -> ModeChoice:
    """What is chosen for an element, in the form of rest where it has one and is at rest."""
    forms = (mode.at_rest for mode in element.options if mode.form == choice.form and mode.at_rest is not None)
    other = next(forms, None)
    return replace(choice, form=other) if other is not None and rests(form, part, element) else choice


def rests(form: StateForm, part: GraphPart, element: Modes) -> bool:
    """Whether no branch of the tree but rigid joints is on the way from one end of an element to the other."""
    return joints_across(form, part, element) is not None


def joints_across(form: StateForm, part: GraphPart, element: Modes) -> Mapping[int, float] | None:
    """The rigid joints on the way from one end of an element to the other, by branch, with the speed across the element
    for one across each of them; None where other branches of the tree are on it.
    """
    first, second = (_potential(form, part, end) for end in part.ends_of(element))
    if first is None or second is None:
        return None
    path = {tree: add(first.get(tree, 0), -second.get(tree, 0), []) for tree in dict.fromkeys(chain(first, second))}
    joints = {tree: value_of(share) for tree, share in path.items() if share != 0}
    rigid = all(form.graph.branches[tree].template.kind is Kind.COUPLING for tree in joints)
    return joints if rigid else None


def holds_at_rest(form: StateForm, part: GraphPart, element: Modes) -> tuple[int, float] | None:
    """The branch of the friction that alone holds an element at rest, and the sign of its speed for the element's.

    None where nothing does, or another part that has modes, or several.
    """
    joints = joints_across(form, part, element) or {}
    holders = {branch: share for branch, share in joints.items() if form.graph.part_of(branch).modes}
    if len(holders) != 1:
        return None
    ((branch, share),) = holders.items()
    rubs = any(len(mode.gives_way) > 1 for modes in form.graph.part_of(branch).modes for mode in modes.options)
    return (branch, math.copysign(1.0, share)) if rubs else None


def _potential(form: StateForm, part: GraphPart, end: End) -> Mapping[int, Number] | None:
    node = part.node_at(end)
    return {} if node == GROUND else form.tree.potentials[node]
