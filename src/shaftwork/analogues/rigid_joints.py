"""Rigid joints, whose two nodes are one in the dual, and what passes through them by the balance of a node."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import networkx as nx

from shaftwork.analogues.elements import Edge, Element, Sum
from shaftwork.analogues.readings import EdgeReading, total
from shaftwork.network.graph import GROUND
from shaftwork.network.kinds import Kind


class RigidJoints:
    """Edges with nothing across them: couplings of which one term alone is not between nodes that are one already.

    A frame holds its node; a planetary gear whose ring and sun are held holds its carrier as well.

    Args:
        elements: of the network.
        ends: first and second node of each edge.
    """

    def __init__(self, elements: Iterable[Element], ends: Mapping[Edge, tuple[int, int]]) -> None:
        self._ends = ends
        self._groups: nx.utils.UnionFind[int] = nx.utils.UnionFind()
        self.edges: list[Edge] = []
        """In the order in which they came to be."""
        couplings = [element for element in elements if element.kind is Kind.COUPLING]
        count = -1
        while count < (count := len(self.edges)):
            for element in couplings:
                if len(free := self.free(element.edges)) == 1:
                    self._groups.union(*ends[free[0]])
                    self.edges.append(free[0])

    def free(self, edges: Sequence[Edge]) -> list[Edge]:
        """Those of some edges that are between nodes of their own."""
        return [edge for edge in edges if len(set(self.nodes(edge))) == 2]

    def nodes(self, edge: Edge) -> tuple[int, int]:
        """The nodes of an edge, the same number for nodes that are one."""
        plus, minus = self._ends[edge]
        return self._groups[plus], self._groups[minus]

    def through(self, joint: Edge, edges: Mapping[Edge, EdgeReading]) -> Sum:
        """What passes through a joint: what all other edges take from the nodes on one of its sides.

        Args:
            joint: the edge.
            edges: what is read of all edges but joints that came to be before.
        """
        others: nx.Graph[int] = nx.Graph()
        others.add_nodes_from(self._ends[joint])
        others.add_edges_from(self._ends[edge] for edge in self.edges if edge != joint)
        plus, minus = (nx.node_connected_component(others, node) for node in self._ends[joint])
        side, sign = (minus, 1.0) if GROUND in plus else (plus, -1.0)
        leaving = ((key, (self._ends[key][0] in side) - (self._ends[key][1] in side)) for key in edges)
        return total(*((sign * count, edges[key].through) for key, count in leaving if count and key != joint))
