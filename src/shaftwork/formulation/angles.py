"""Angles that are recorded, each by a branch without torque whose speed is integrated."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

from sympy import Add, Integer, Symbol

from shaftwork.components.base import Component
from shaftwork.components.branches import End
from shaftwork.core.domains import ELECTRICAL
from shaftwork.core.errors import SignalError
from shaftwork.formulation.form import StateForm, state_form
from shaftwork.formulation.gains import exact_of
from shaftwork.network.graph import CircuitGraph, GraphBranch
from shaftwork.network.kinds import Kind
from shaftwork.network.netlist import listed
from shaftwork.network.templates import BranchTemplate


def with_angles(graph: CircuitGraph, names: Sequence[str]) -> StateForm:
    """The state form of a network with the angles of some parts as states.

    Raises:
        SignalError: a part has no angle, or its speed contains the rate of a torque, as that of a node between springs
            in series does: such an angle jumps with a torque, and no state does.
    """
    form = state_form(*_with_meters(graph, names))
    hidden = frozenset(form.dependent_through)
    for branch in form.angles:
        loop = form.tree.loops.get(branch, {})
        if hidden.isdisjoint(loop):
            continue
        springs = listed(tuple(dict.fromkeys(form.graph.part_of(k).name for k in form.dependent_through)))
        instead = _instead(form, branch)
        raise SignalError(
            f"The angle of '{form.graph.part_of(branch).name}' is not recorded: its speed is that of a node without "
            f"inertia between springs ({springs} among them), which turns at once where a torque jumps. Give that node "
            f"an inertia, or read {instead or 'the twist of a spring, such as phi_rel'}."
        )
    return form


def _instead(form: StateForm, branch: int) -> str:
    """What an angle is, from those of stores and the twists of springs, but for what that is at the start."""
    row, terms, stores = form.tree.loops[branch], [], []
    for tree, gain in zip(row, exact_of(row.values()), strict=True):
        part, template = form.graph.part_of(tree), form.graph.branches[tree].template
        kind = "twist" if tree in form.dependent_through else "across"
        names = (
            name
            for name, signal in part.component.signals().items()
            if (signal.kind, signal.ends) == (kind, template.ends)
        )
        name = next(names, None)
        if name is None or (kind == "across" and "_" in name) or template.terms:
            return ""
        if kind == "across":
            stores.append(part.name)
            name = form.graph.domains[
                max(form.graph.branches[tree].plus, form.graph.branches[tree].minus)
            ].integral.name
        terms.append(gain * Symbol(f"sol['{part.name}.{name}']"))
    request = f", with angles={stores}" if stores else ""
    return f"{Add(*terms)}{request}, less what that is at the start"


def _with_meters(graph: CircuitGraph, names: Sequence[str]) -> tuple[CircuitGraph, tuple[int, ...]]:
    """The graph with a branch for every angle of some parts, and these branches.

    Each speed of a part has its angle: omega of a part at one node, omega_rel between two, omega_a and omega_b of a
    gear. Nothing passes through the branch, whatever mode the part is in, so that nothing else changes. Where a law
    of the part reads that angle, it is recorded anyway.

    Args:
        graph: the circuit graph.
        names: of parts.

    Raises:
        SignalError: there is no such part, or it has no speed.
    """
    branches, parts, angles = list(graph.branches), list(graph.parts), list[int]()
    places = {part.name: number for number, part in enumerate(parts)}
    for name in dict.fromkeys(names):
        speeds = dict(_speeds(parts[places[name]].component)) if name in places else {}
        if not speeds:
            able = tuple(part.name for part in parts if any(_speeds(part.component)))
            raise SignalError(f"There is no angle of '{name}'. Parts with an angle are: {listed(able)}.")
        for label, ends in speeds.items():
            part, read = parts[places[name]], graph.integrated[places[name]]
            integrals = (k for k in read if graph.branches[k].template.ends == ends and not label)
            index = next(integrals, len(branches))
            if index == len(branches):
                template = BranchTemplate(Kind.THROUGH_SOURCE, Integer(0), ends, (), label, (), Integer(0), meter=True)
                plus, minus = map(part.node_at, ends)
                branches.append(GraphBranch(index, places[name], template, plus, minus, ()))
                parts[places[name]] = dataclasses.replace(part, branches=(*part.branches, index))
            angles.append(index)
    return dataclasses.replace(graph, parts=tuple(parts), branches=tuple(branches)), tuple(angles)


def _speeds(part: Component) -> Iterator[tuple[str, tuple[End, End]]]:
    """What tells the speeds of a part apart, nothing or the name of a side, and the ends of each; else its voltages."""
    signals = {
        name: signal for name, signal in part.signals().items() if signal.kind == "across" and signal.domain is not None
    }
    mechanical = {name: signal for name, signal in signals.items() if signal.domain is not ELECTRICAL}
    for name, signal in (mechanical or signals).items():
        _, _, side = name.partition("_")
        yield "" if side == "rel" else side, signal.ends
