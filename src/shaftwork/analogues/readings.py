"""Every quantity of a network as a sum of quantities of its analogue."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import networkx as nx

from shaftwork.analogues.circuit_elements import Edge, Sum, in_numbers
from shaftwork.components.base import Signal
from shaftwork.components.branches import End
from shaftwork.formulation.form import Names, StateForm, store_name
from shaftwork.network.graph import GROUND, CircuitGraph, GraphPart, ends_of
from shaftwork.network.kinds import Kind


@dataclass(frozen=True)
class EdgeReading:
    """What is across an edge of the graph, and what passes through it, in quantities of the analogue."""

    across: Sum
    through: Sum


def total(*terms: tuple[float, Mapping[str, float]]) -> Sum:
    """The sum of some sums, each with a factor."""
    result: Sum = {}
    for factor, part in terms:
        for name, share in part.items():
            result[name] = result.get(name, 0.0) + factor * share
    return {name: share for name, share in result.items() if share}


class Readings:
    """Quantities of a network by those of its edges.

    Args:
        form: the state form of the network.
        edges: what is read of each edge.
        nodes: the across variable of each node.
    """

    def __init__(self, form: StateForm, edges: Mapping[Edge, EdgeReading], nodes: Mapping[int, Sum]) -> None:
        self._form, self._graph, self._edges = form, form.graph, edges
        self._nodes = {GROUND: {}, **nodes}

    def quantities(self) -> dict[str, Sum]:
        """A sum for each quantity of parts and nodes, and each state."""
        names = Names(self._form)
        result = {name: self._nodes[number] for name, number in names.nodes.items() if number in self._nodes}
        for name, (part, signal) in names.signals.items():
            if (reading := self._signal(part, signal)) is not None:
                result[name] = reading
        for branch in self._graph.branches:
            if branch.template.kind in (Kind.ACROSS_STORE, Kind.THROUGH_STORE) and (branch.index, 0) in self._edges:
                edge = self._edges[branch.index, 0]
                is_across = branch.template.kind is Kind.ACROSS_STORE
                result.setdefault(store_name(self._graph, branch), edge.across if is_across else edge.through)
        return result

    def profiles(self) -> dict[str, tuple[Sum, ...]]:
        """For each quantity along a part a sum for each place."""
        return {
            f"{part.name}.{name}": tuple(
                total(*((factor, self._along(part, profile.kind, place)) for factor, place in terms))
                for terms in profile.of
            )
            for part in self._graph.parts
            for name, profile in part.component.profiles().items()
        }

    def _along(self, part: GraphPart, kind: str, place: str) -> Sum:
        """What is across a node, what a part takes in at a port, or what passes through a branch."""
        if kind == "across":
            return self._nodes[part.nodes[place]]
        if place in part.nodes:
            return self._through(part, place, 1.0)
        branches = (k for k in part.branches if self._graph.branches[k].template.label == place)
        return total(*((1.0, self._edges[k, 0].through) for k in branches))  # of a damper of zero there is none

    def _signal(self, part: GraphPart, signal: Signal) -> Sum | None:
        """A quantity of a part; None where its branches have no reading."""
        if any(key not in self._edges for index in part.branches for key, _, _ in ends_of(self._graph.branches[index])):
            return None
        first, second = map(part.node_at, signal.ends)
        if signal.kind == "across":
            if (edge := self._between(part, first, second)) is not None:
                return total((signal.sign, edge.across))
            if first not in self._nodes or second not in self._nodes:
                return None
            return total((signal.sign, self._nodes[first]), (-signal.sign, self._nodes[second]))
        if signal.kind == "through":
            return self._through(part, signal.ends[0], signal.sign)
        return self._of_store(part, signal)

    def _between(self, part: GraphPart, first: int, second: int) -> EdgeReading | None:
        """An edge of a part from a node to another, where it has one."""
        for index in part.branches:
            for key, plus, minus in ends_of(self._graph.branches[index]):
                if (plus, minus) == (first, second):
                    return self._edges[key]
        return None

    def _through(self, part: GraphPart, port: End, sign: float) -> Sum:
        """What the node at a port gives to a part there."""
        terms: list[tuple[float, Sum]] = []
        for index in part.branches:
            template = self._graph.branches[index].template
            places = [(plus, minus) for _, plus, minus in template.terms] or [template.ends]
            for number, (plus, minus) in enumerate(places):
                share = sign * ((plus == port) - (minus == port))
                terms.append((share, self._edges[index, number].through))
        return total(*terms)

    def _of_store(self, part: GraphPart, signal: Signal) -> Sum | None:
        """The torque of a spring alone, or its twist."""
        for index in part.branches:
            branch = self._graph.branches[index]
            is_store = branch.template.kind is Kind.THROUGH_STORE
            if is_store and (not signal.label or branch.template.label == signal.label):
                stiffness = float(in_numbers(branch.template.law, branch, self._graph))
                factor = signal.sign / stiffness if signal.kind == "twist" else signal.sign
                return total((factor, self._edges[index, 0].through))
        return None


def sums_of_nodes(graph: CircuitGraph, edges: Mapping[Edge, EdgeReading]) -> dict[int, Sum]:
    """What is across each node and the frame, summed along a path of edges; nodes without such a path are left out."""
    ends = {key: (plus, minus) for branch in graph.branches for key, plus, minus in ends_of(branch) if key in edges}
    paths: nx.MultiGraph[int] = nx.MultiGraph()
    paths.add_edges_from((plus, minus, key) for key, (plus, minus) in ends.items())
    nodes: dict[int, Sum] = {GROUND: {}}
    if GROUND not in paths:
        return nodes
    for near, far in nx.bfs_edges(paths, GROUND):
        key = next(iter(paths[near][far]))
        nodes[far] = total((1.0, nodes[near]), (1.0 if ends[key][0] == far else -1.0, edges[key].across))
    return nodes
