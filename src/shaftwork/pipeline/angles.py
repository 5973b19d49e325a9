"""Angles that are recorded, and what is said where one cannot be."""

from __future__ import annotations

from collections.abc import Sequence

from sympy import Add, Symbol

from shaftwork.core.errors import SignalError
from shaftwork.network.graph import CircuitGraph
from shaftwork.network.meters import with_meters
from shaftwork.network.wording import listed
from shaftwork.reduction.form import StateForm, state_form
from shaftwork.reduction.gains import exact_of


def with_angles(graph: CircuitGraph, names: Sequence[str]) -> StateForm:
    """The state form of a network with the angles of some parts as states.

    Raises:
        SignalError: a part has no angle, or its speed contains the rate of a torque, as that of a node between springs
            in series does: such an angle jumps with a torque, and no state does.
    """
    form = state_form(*with_meters(graph, names))
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
        own = (
            name for name, made in part.component.signals().items() if (made.kind, made.ends) == (kind, template.ends)
        )
        name = next(own, None)
        if name is None or (kind == "across" and "_" in name) or template.terms:
            return ""
        if kind == "across":
            stores.append(part.name)
            name = form.graph.domains[
                max(form.graph.branches[tree].plus, form.graph.branches[tree].minus)
            ].integral.name
        terms.append(gain * Symbol(f"sol['{part.name}.{name}']"))
    asked = f", with angles={stores}" if stores else ""
    return f"{Add(*terms)}{asked}, less what that is at the start"
