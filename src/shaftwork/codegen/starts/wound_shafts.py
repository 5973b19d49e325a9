"""Shafts of several elements at the start: the torque along them, and the speeds inside them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.array_form.linear_readings import GivenSpeeds
from shaftwork.codegen.array_form.recovery import BranchHistory
from shaftwork.components.base import Profile
from shaftwork.formulation.form import StateForm, store_name
from shaftwork.network.graph import GraphPart
from shaftwork.network.kinds import Kind


@dataclass(frozen=True)
class WoundShaft:
    """A shaft whose torque can be given as a whole.

    Args:
        part: the shaft.
        profile: of its torque.
        states: numbers of its stores of torque among the states, in their order along the shaft.
    """

    part: GraphPart
    profile: Profile
    states: tuple[int, ...]

    def wind(self, bound: BoundArrays, t: float, x: Array, torque: float, fixed: Any) -> None:
        """Give each store what the damper beside it leaves of a torque, but where (n,) states keep their values."""
        states = list(self.states)
        beside = self.along(bound, t, x) - x[states]
        x[states] = np.where(fixed[states], x[states], torque - beside)

    def along(self, bound: BoundArrays, t: float, x: Array) -> Array:
        """(stores,) the torque at each store with the damper beside it.

        What is read at the very ends counts inertia there, so it is not read; a store there has the damper of the next.
        """
        columns = BranchHistory(bound, np.array([t]), x[None, :]).profile(self.part, self.profile)[0]
        inside, states = columns[1:-1], list(self.states)
        if len(inside) == len(states):
            return np.asarray(inside)
        return np.asarray(x[states] + np.pad(inside - x[states][1:-1], 1, mode="edge"))


def wound_shafts(form: StateForm) -> Mapping[str, WoundShaft]:
    """By the name of the torque along it, "line.tau", each shaft of several elements whose torques all are states."""
    return dict(_wound_shafts(form))


def _wound_shafts(form: StateForm) -> Iterator[tuple[str, WoundShaft]]:
    state = {branch: k for k, branch in enumerate(form.through_states, form.torques.start)}
    for part in form.graph.parts:
        stores = [k for k in part.branches if form.graph.branches[k].template.kind is Kind.THROUGH_STORE]
        for name, profile in part.component.profiles().items():
            if profile.kind == "through" and len(profile.of) > 2 and stores and all(k in state for k in stores):
                yield f"{part.name}.{name}", WoundShaft(part, profile, tuple(state[k] for k in stores))


def speeds_inside(form: StateForm, given: GivenSpeeds) -> dict[int, float]:
    """For each state that is a speed inside a shaft, what lies on the straight line between those of its ends."""
    owner = {form.graph.branches[branch].plus: k for k, branch in enumerate(form.across_states)}
    speeds: dict[int, float] = {}
    for nodes, places in _along(form):
        first, last = given.at_ends(nodes[0], nodes[-1])
        for node, share in zip(nodes[1:-1], places[1:-1], strict=True):
            if node in owner:
                speeds[owner[node]] = first + share * (last - first)
    return speeds


def inner_nodes(form: StateForm) -> frozenset[int]:
    """The nodes inside shafts of several elements."""
    return frozenset(node for nodes, _ in _along(form) for node in nodes[1:-1])


def node_of(form: StateForm, branch: int) -> int:
    """The node of an across store."""
    return max(form.graph.branches[branch].plus, form.graph.branches[branch].minus)


def speed_at(form: StateForm, node: int) -> str:
    """The name of the speed of a node with stores: of an inertia, or where a shaft alone ends, of the node."""
    graph, inside = form.graph, inner_nodes(form)
    for branch in (*form.across_states, *form.dependent_across):
        if node_of(form, branch) == node and inside.isdisjoint(graph.part_of(branch).nodes.values()):
            return store_name(graph, graph.branches[branch])
    return f"{graph.nodes[node]}.{graph.domains[node].across.name}"


def _along(form: StateForm) -> Iterator[tuple[list[int], tuple[float, ...]]]:
    """The nodes along each shaft of several elements, and their places in m."""
    for part in form.graph.parts:
        for profile in part.component.profiles().values():
            if profile.kind == "across" and not profile.lines and len(profile.of) > 2:
                yield [part.nodes[name] for ((_, name),) in profile.of], profile.places
