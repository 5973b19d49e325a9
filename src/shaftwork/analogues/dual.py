"""The force-voltage analogue of a network: the dual circuit, whose nodes are the meshes of the graph."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

from shaftwork.analogues.analogy import Analogy
from shaftwork.analogues.circuit_elements import Edge, Element, ElementNames, Sum, elements_of, in_numbers, is_linear
from shaftwork.analogues.faces import DualEnds, Kuratowski, dual_ends
from shaftwork.analogues.readings import EdgeReading, Readings, sums_of_nodes, total
from shaftwork.analogues.rigid_joints import RigidJoints
from shaftwork.components.base import Component
from shaftwork.components.electrical import (
    Capacitor,
    CurrentSource,
    Inductor,
    Resistor,
    Transformer,
    VoltageSource,
)
from shaftwork.core.errors import Diagnostic, NetworkError
from shaftwork.formulation.form import StateForm
from shaftwork.network.graph import CircuitGraph, GraphPart, ends_of
from shaftwork.network.kinds import Kind
from shaftwork.network.netlist import REFERENCE, Netlist, Placed, listed, title

OTHERWISE = "Take net.circuit(), which every network has"


RANKS = {
    Kind.THROUGH_STORE: 0,
    Kind.COUPLING: 1,
    Kind.ACROSS_SOURCE: 2,
    Kind.THROUGH_SOURCE: 2,
    Kind.CONDUCTANCE: 3,
    Kind.ACROSS_STORE: 4,
}
"""What is in series in the dual, from the reference on: springs are drawn across, inertias along the line."""


def dual(netlist: Netlist, form: StateForm) -> Analogy:
    """The dual of a network: `Network.dual` says of what.

    Args:
        netlist: of the network.
        form: its state form.

    Raises:
        NetworkError: a part has no dual, or the graph is not planar.
    """
    graph = form.graph
    title_of_error = f"'{netlist.name}' has no dual"
    if problems := tuple(_without_dual(part, graph) for part in graph.parts if not _has_dual(part, graph)):
        raise NetworkError(title_of_error, problems)
    names = ElementNames(graph)
    idle = frozenset(form.tree.links[Kind.COUPLING])  # of gears side by side all but one, which carry nothing
    elements = [
        element
        for part in graph.parts
        for element in elements_of(part, graph, names)
        if element.edges[0][0] not in idle
    ]
    ends = {key: (plus, minus) for branch in graph.branches for key, plus, minus in ends_of(branch)}
    joints = RigidJoints(elements, ends)
    ranks = {edge: RANKS[element.kind] for element in elements for edge in element.edges}
    faces = dual_ends({edge: joints.nodes(edge) for edge in joints.free([*ranks])}, ranks)
    if isinstance(faces, Kuratowski):
        raise NetworkError(title_of_error, (_not_planar(faces, graph),))
    work = _Dual(faces)
    placed = [item for element in elements for item in work.placed(element)]
    changed = dataclasses.replace(netlist, name=f"dual of {netlist.name}", placed=tuple(placed), ports=())
    return Analogy(netlist.name, changed, _quantities(form, elements, joints, work.edges), work.branches)


def _quantities(
    form: StateForm, elements: Sequence[Element], joints: RigidJoints, edges: dict[Edge, EdgeReading]
) -> dict[str, Sum]:
    """What each quantity of the network is in the dual.

    Args:
        form: the state form of the network.
        elements: of the network, without couplings that carry nothing.
        joints: its rigid joints.
        edges: what is read of the edges that have a dual; of the others it is added here.
    """
    couplings = [element for element in elements if element.kind is Kind.COUPLING]
    owner = {edge: element for element in couplings for edge in element.edges}
    for element in couplings:
        _add_loops(element, edges)
    for joint in reversed(joints.edges):
        edges[joint] = EdgeReading({}, joints.through(joint, edges))
        _add_loops(owner[joint], edges)
    nodes = sums_of_nodes(form.graph, edges)
    for index in form.tree.links[Kind.COUPLING]:
        for key, plus, minus in ends_of(form.graph.branches[index]):
            edges[key] = EdgeReading(total((1.0, nodes[plus]), (-1.0, nodes[minus])), {})
    return Readings(form, edges, nodes).quantities()


def _add_loops(element: Element, edges: dict[Edge, EdgeReading]) -> None:
    """The terms of a coupling between nodes that are one: what passes there is in proportion to another term."""
    factors = dict(zip(element.edges, element.terms, strict=True))
    if (base := next((edge for edge in element.edges if edge in edges), None)) is not None:
        for edge, factor in factors.items():
            edges.setdefault(edge, EdgeReading({}, total((factor / factors[base], edges[base].through))))


def _has_dual(part: GraphPart, graph: CircuitGraph) -> bool:
    return is_linear(part, graph) and not _drives(part, graph)


def _drives(part: GraphPart, graph: CircuitGraph) -> bool:
    """Whether a part has a damping below zero, which is no resistance."""
    branches = (graph.branches[index] for index in part.branches)
    laws = (in_numbers(one.template.law, one, graph) for one in branches if one.template.kind is Kind.CONDUCTANCE)
    return any(law < 0 for law in laws)


def _without_dual(part: GraphPart, graph: CircuitGraph) -> Diagnostic:
    """Why a part has no dual."""
    templates = [graph.branches[index].template for index in part.branches]
    if part.modes:
        why = "it changes its mode"
    elif any(template.line is not None for template in templates):
        why = "waves travel along it; Lumped(20) instead of Wave() has one"
    elif any(template.reads for template in templates):
        why = "its laws read other nodes and branches"
    elif any(template.through for template in templates):
        why = "it loses power in its teeth"
    elif _drives(part, graph):
        why = "its torque rises with its speed"
    else:
        why = "its law is not linear"
    nodes = tuple(graph.node_name(number) for number in dict.fromkeys(part.nodes.values()))
    message = f"{title(part.component)}: {why}, and duals are of stores, dampers, gears and sources over time."
    return Diagnostic("no dual", message, f"{OTHERWISE}.", (part.name,), nodes)


def _not_planar(why: Kuratowski, graph: CircuitGraph) -> Diagnostic:
    parts = tuple(dict.fromkeys(graph.part_of(index).name for index, _ in why.edges))
    nodes = tuple(map(graph.node_name, why.nodes))
    message = (
        f"The graph cannot be drawn without crossings: parts {listed(parts, len(parts))} join nodes "
        f"{listed(nodes)} as the graph {why.name}."
    )
    return Diagnostic("not planar", message, f"{OTHERWISE}, or leave one of these parts out.", parts, nodes)


class _Dual:
    """Puts the duals of elements at the faces, and remembers what is read of each edge."""

    def __init__(self, faces: DualEnds) -> None:
        self._faces = faces
        self.edges: dict[Edge, EdgeReading] = {}
        self.branches: dict[str, int] = {}

    def placed(self, element: Element) -> Iterator[Placed]:
        """The parts that are the dual of an element."""
        if element.kind is Kind.COUPLING:
            yield from self._coupling(element)
        else:
            (edge,) = element.edges
            left, right = self._nodes(edge)
            is_source = element.kind in (Kind.ACROSS_SOURCE, Kind.THROUGH_SOURCE)
            yield Placed(_made(element), (right, left) if is_source else (left, right))
            name, sign = element.name, -1.0 if is_source else 1.0
            self.branches[name] = edge[0]
            self.edges[edge] = EdgeReading({f"{name}.i": 1.0}, {f"{name}.u": sign})
        for edge in element.edges:
            if edge in self._faces.bridges:
                number = f" {edge[1] + 1}" if len(element.edges) > 1 else ""
                yield Placed(Resistor(f"{element.name} short{number}", R=0.0), self._nodes(edge))

    def _coupling(self, element: Element) -> Iterator[Placed]:
        """Transformers from one term of a coupling to each other one.

        The sum of a_k u_k is zero and i_k = a_k lambda. So in the dual u_k = a_k lambda and the sum of a_k i_k is zero.
        """
        factors = zip(element.edges, element.terms, strict=True)
        sides = [(edge, factor) for edge, factor in factors if edge in self._faces.ends]
        if len(sides) < 2:
            return
        (first, base), *others = sides
        names = [element.name if len(others) == 1 else f"{element.name} {number}" for number in range(1, len(sides))]
        self.branches |= dict.fromkeys(names, first[0])
        for name, (edge, factor) in zip(names, others, strict=True):
            sign = 1.0 if base / factor > 0 else -1.0
            ends = self._nodes(edge)[:: int(sign)]
            yield Placed(
                Transformer(name, symbol=element.symbol, ratio=abs(base / factor)), (*self._nodes(first), *ends)
            )
            self.edges[edge] = EdgeReading({f"{name}.i_2": sign}, {f"{name}.u_2": sign})
        currents = total(*((1.0, {f"{name}.i_1": 1.0}) for name in names))
        self.edges[first] = EdgeReading(currents, {f"{names[0]}.u_1": 1.0})

    def _nodes(self, edge: Edge) -> tuple[str, str]:
        left, right = self._faces.ends[edge]
        return _node(left), _node(right)


def _node(face: int) -> str:
    return f"mesh {face}" if face else REFERENCE


def _made(element: Element) -> Component:
    """The dual of a store, a loss or a source."""
    name, symbol, value = element.name, element.symbol, element.value
    match element.kind:
        case Kind.ACROSS_STORE:
            return Inductor(name, symbol=symbol, L=value)
        case Kind.THROUGH_STORE:
            return Capacitor(name, symbol=symbol, C=1 / value)
        case Kind.CONDUCTANCE:
            return Resistor(name, symbol=symbol, R=value)
        case Kind.ACROSS_SOURCE:
            return CurrentSource(name, symbol=symbol, i=value)
        case Kind.THROUGH_SOURCE | Kind.LAW:
            return VoltageSource(name, symbol=symbol, u=-value)
    raise AssertionError(f"{element.kind} of '{name}' has no dual element")  # pragma: no cover
