"""The speeds that a point must name: those of all inertias, each as it follows the exciting shaft."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy import linalg

from shaftwork.codegen.elements import Array
from shaftwork.codegen.inputs import is_linear
from shaftwork.codegen.model import CompiledModel
from shaftwork.codegen.start_values import Start
from shaftwork.codegen.wound_shafts import inner_nodes, node_of, speed_at
from shaftwork.components.branches import ACROSS
from shaftwork.core.domains import ELECTRICAL
from shaftwork.core.errors import NetworkWarning
from shaftwork.core.hints import hint
from shaftwork.core.notices import warn
from shaftwork.network.graph import CircuitGraph
from shaftwork.network.templates import Kind
from shaftwork.network.wording import listed
from shaftwork.reduction.form import StateForm

SAME = 1e-9
"""Ratios that differ by less are equal, and a speed below this part of the largest is none."""


def speeds_to_give(model: CompiledModel) -> Mapping[str, float]:
    """The speeds that tell how a network turns, as multiples of the first.

    What is tied rigidly to them follows, and so do the speeds inside shafts. Springs keep their twist: behind a gear
    of ratio 3 is a third. What nothing but a friction or a clutch joins to the first turns as it does.
    """
    form, ratios = model.form, _ratios(model)
    inside, names = inner_nodes(form), dict[str, float]()
    for k, branch in enumerate(form.across_states):
        node = node_of(form, branch)
        if node not in inside and form.graph.domains[node] is not ELECTRICAL:
            names[speed_at(form, node)] = float(ratios[k])
    return names


def _ratios(model: CompiledModel) -> Array:
    """Of each speed among the states, how fast it is while no twist changes, over the first that it is joined to."""
    count = len(model.form.across_states)
    twists = model.bind().part.A.toarray()[count:, :count]
    size = np.abs(twists).max(axis=1, keepdims=True, initial=0.0)
    free = linalg.null_space(twists / np.where(size > 0, size, 1.0)) if twists.size else np.eye(count)
    together = free @ free.T
    ratios = np.ones(count)
    left = np.ones(count, dtype=bool)
    for k in range(count):
        if left[k] and together[k, k] > SAME:
            joined = left & (np.abs(together[k]) > SAME)
            ratios[joined] = together[k, joined] / together[k, k]
            left &= ~joined
    return ratios


def as_multiple(ratio: float) -> str:
    """A multiple of the speed n as Python and the command line read it: "n", "n/3", "2.5*n"."""
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


def _bends(graph: CircuitGraph, branch: int) -> bool:
    template = graph.branches[branch].template
    return template.kind is Kind.LAW and not is_linear(template.law, (ACROSS, *template.reads))


def _ends(graph: CircuitGraph, branch: int) -> tuple[int, int]:
    return graph.branches[branch].plus, graph.branches[branch].minus
