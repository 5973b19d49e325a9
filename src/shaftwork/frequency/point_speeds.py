"""The speeds that a point must name: those of all inertias, each as it follows the exciting shaft."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import compress

import numpy as np

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.array_form.inputs import is_linear
from shaftwork.codegen.compiled_model import CompiledModel
from shaftwork.codegen.starts.start_values import Start
from shaftwork.codegen.starts.wound_shafts import inner_nodes, node_of, speed_at
from shaftwork.components.branches import ACROSS, INTEGRAL
from shaftwork.components.law_slopes import jumps, slope
from shaftwork.core.domains import ELECTRICAL
from shaftwork.core.errors import NetworkWarning
from shaftwork.core.notices import PulsationWarning, hint, warn
from shaftwork.formulation.form import StateForm
from shaftwork.formulation.gains import value_of
from shaftwork.formulation.tree import column_of
from shaftwork.formulation.value_diagnosis import speeds_along
from shaftwork.network.graph import CircuitGraph, Reading, readings_of
from shaftwork.network.kinds import Kind
from shaftwork.network.netlist import listed

SAME = 1e-9
"""Ratios that differ by less are equal, and a speed below this part of the largest is none."""


def speeds_to_give(model: CompiledModel) -> Mapping[str, float | None]:
    """The speeds that tell how a network turns, as multiples of the first; None where that does not tell them.

    What is tied rigidly to them follows, and so do the speeds inside shafts. Springs keep their twist, and what joins
    at times, as clutches, gaps and ropes do, is taken for joined: behind a gear of ratio 3 is a third. Behind a
    planetary gear of which one shaft is free, a speed is open.
    """
    form = model.form
    inside = inner_nodes(form)
    nodes = dict.fromkeys(node_of(form, branch) for branch in form.across_states)
    named = [node for node in nodes if node not in inside and form.graph.domains[node] is not ELECTRICAL]
    ratios = speeds_along(form.graph, named[0], _joints(form.graph)) if named else {}
    return {speed_at(form, node): ratios.get(node) for node in named}


def _joints(graph: CircuitGraph) -> Iterator[Mapping[int, float]]:
    """Speeds of nodes that depend on each other while no twist changes: node to factor, in sums that are zero."""
    for part in graph.parts:
        branches = [graph.branches[k] for k in part.branches]
        kinds = {branch.template.kind for branch in branches}
        if (part.modes and Kind.COUPLING not in kinds) or any(branch.template.is_history for branch in branches):
            yield dict(zip((part.nodes[port.name] for port in part.component.ports), (1.0, -1.0), strict=False))
        for branch in branches:
            if branch.template.kind in (Kind.THROUGH_STORE, Kind.COUPLING):
                yield {node: value_of(factor) for node, factor in column_of(graph, branch).items()}


def as_multiple(ratio: float | None) -> str:
    """A multiple of the speed n as Python and the command line read it: "n", "n/3", "2.5*n"; "..." for None."""
    if ratio is None:
        return "..."
    sign, size = "-" * (ratio < 0), abs(ratio)
    if abs(size - 1) < SAME:
        return f"{sign}n"
    return f"{sign}n/{1 / size:.10g}" if size < 1 else f"{sign}{size:.10g}*n"


def warn_of_speeds_left(start: Start, form: StateForm) -> None:
    """Warn where a point gives some speeds and leaves others at rest on which something depends that is not linear.

    Args:
        start: the way from the point to the states.
        form: of the network.
    """
    graph, left = form.graph, start.nodes_left
    if not left:
        return
    parts = {
        part.name: node
        for part in graph.parts
        for node in part.nodes.values()
        if node in left and (part.modes or any(_bends(graph, k) for k in part.branches if node in _ends(graph, k)))
    }
    if not parts:
        return
    speeds = tuple(dict.fromkeys(speed_at(form, node) for node in parts.values()))
    example = hint(
        "at={..., " + ", ".join(f"'{name}': ..." for name in speeds) + "}",
        " ".join(f"--at {name}=..." for name in speeds),
    )
    warn(
        f"The point of '{graph.name}' gives some speeds and leaves {listed(speeds)} at 0, where {listed(tuple(parts))} "
        f"depends on it: what stands has other frequencies than what runs. Give {example}; 0 where it does stand.",
        NetworkWarning,
    )


def warn_of_turning_angles(bound: BoundArrays, t: float, x: Array) -> None:
    """Warn where a law is linearised at one angle of a shaft that turns: a pulsation is frozen at that angle.

    Args:
        bound: the equations of the network.
        t: time at which laws are read, s.
        x: (n,) states at the point.
    """
    form, first = bound.program.form, len(x) - len(bound.program.form.integrals)
    rates = np.abs(bound.rhs(t, x)[first:])
    turns = rates > SAME * np.append(rates, np.abs(x[: len(form.across_states)])).max(initial=0.0)
    angles = zip(form.integrals, form.states[first:], x[first:], strict=True)
    for branch, state, value in compress(angles, turns):
        if readers := _readers(form, branch):
            warn(
                f"The point of '{form.graph.name}' is one moment of a motion: '{state.name}' does not stay, and what "
                f"{listed(readers)} gives bends with it. All is linearised at {state.name} = {value:.4g} {state.unit}; "
                "elsewhere in a turn, frequencies and damping are others. Of a torque that pulsates linearise the mean "
                "over a turn: leave the pulsation out of the law, and take it as an excitation, by the orders of a "
                "diagram or the frequencies of a response.",
                PulsationWarning,
            )


def _readers(form: StateForm, integral: int) -> tuple[str, ...]:
    """The parts with a law whose slopes depend on the integral of a branch, or that jumps with it."""
    graph, names = form.graph, dict[str, None]()
    for branch in form.laws:
        template = graph.branches[branch].template
        symbols = [INTEGRAL] if branch == integral else []
        for symbol in (*symbols, *(one for one, of in readings_of(graph, branch).items() if of == _integral(integral))):
            if slope(template.law, symbol).has(ACROSS, INTEGRAL, *template.reads) or jumps(template.law, symbol):
                names[graph.part_of(branch).name] = None
    return tuple(names)


def _integral(branch: int) -> Reading:
    return Reading("integral", branch)


def _bends(graph: CircuitGraph, branch: int) -> bool:
    template = graph.branches[branch].template
    return template.kind is Kind.LAW and not is_linear(template.law, (ACROSS, *template.reads))


def _ends(graph: CircuitGraph, branch: int) -> tuple[int, int]:
    return graph.branches[branch].plus, graph.branches[branch].minus
