"""The force-voltage analogue of a network: the dual circuit, whose nodes are the meshes of the graph."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence

from sympy import Expr, S

from shaftwork.analogues.analogy import Analogy
from shaftwork.analogues.circuit_elements import Edge, Element, ElementNames, Sum, elements_of, in_letters, in_numbers
from shaftwork.analogues.dual_friction import held_twice, side_by_side
from shaftwork.analogues.dual_modes import DualModes
from shaftwork.analogues.faces import DualEnds, Kuratowski, dual_ends
from shaftwork.analogues.readings import EdgeReading, Readings, sums_of_nodes, total
from shaftwork.analogues.rigid_joints import RigidJoints
from shaftwork.components.base import Component
from shaftwork.components.branches import ACROSS, INTEGRAL, RATE
from shaftwork.components.electrical import (
    Capacitor,
    CurrentSource,
    Diode,
    Inductor,
    Resistor,
    Transformer,
    VoltageSource,
)
from shaftwork.components.laws import i, psi, q, u
from shaftwork.core.errors import Diagnostic, NetworkError
from shaftwork.formulation.form import Names, StateForm, integral_name, state_form
from shaftwork.network.graph import CircuitGraph, GraphPart, build_graph, ends_of
from shaftwork.network.kinds import Kind
from shaftwork.network.measurements import refuse_measuring
from shaftwork.network.netlist import REFERENCE, Netlist, Placed, listed, title

OTHERWISE = "Take net.circuit(), which every network has"
READ = {ACROSS: i, INTEGRAL: q}
"""What laws of branches read, in quantities of their duals."""
BACK = {i: u, q: psi}
"""What laws of a source of voltage read, in quantities of their duals."""

RANKS = {
    Kind.THROUGH_STORE: 0,
    Kind.COUPLING: 1,
    Kind.ACROSS_SOURCE: 2,
    Kind.THROUGH_SOURCE: 2,
    Kind.LAW: 2,
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
    title_of_error = f"'{netlist.name}' has no dual"
    refuse_measuring(netlist, title_of_error)
    reasons = ((part, _reason(part, form.graph)) for part in form.graph.parts)
    if problems := tuple(_without_dual(part, why, form.graph) for part, why in reasons if why):
        raise NetworkError(title_of_error, problems)
    choices = {part.name: (DualModes(part).choice,) for part in form.graph.parts if part.modes}
    # a part that is open in its first mode has a place in the graph of another one
    closed = state_form(build_graph(netlist.with_choices(choices))) if choices else form
    graph, names = closed.graph, ElementNames(closed.graph)
    idle = frozenset(_idle(closed))
    elements: Sequence[Element] = [
        element for part in graph.parts for element in _elements(part, graph, names) if element.edges[0][0] not in idle
    ]
    ends = {key: (plus, minus) for branch in graph.branches for key, plus, minus in ends_of(branch)}
    joints = RigidJoints(elements, ends)
    elements, shared = side_by_side(elements, ends)
    if problems := tuple(held_twice(netlist, closed, shared)):
        raise NetworkError(title_of_error, problems)
    ranks = {edge: RANKS[element.kind] for element in elements for edge in element.edges}
    faces = dual_ends({edge: joints.nodes(edge) for edge in joints.free([*ranks])}, ranks)
    if isinstance(faces, Kuratowski):
        raise NetworkError(title_of_error, (_not_planar(faces, graph),))
    work = _Dual(faces, names)
    placed = [item for element in elements for item in work.placed(element)]
    changed = dataclasses.replace(netlist, name=f"dual of {netlist.name}", placed=tuple(placed), ports=())
    quantities, profiles = _quantities(closed, elements, joints, work.edges, shared)
    branches = _in_first_modes(work.branches, closed.graph, form.graph)
    return Analogy(netlist.name, changed, quantities, branches, profiles=profiles, form=form)


def _in_first_modes(branches: Mapping[str, int], closed: CircuitGraph, first: CircuitGraph) -> dict[str, int]:
    """Branches of the graph in which contacts are closed, in that of the first modes; without those that it lacks."""
    place = {
        closed_branch: branch
        for closed_part, part in zip(closed.parts, first.parts, strict=True)
        if len(closed_part.branches) == len(part.branches)
        for closed_branch, branch in zip(closed_part.branches, part.branches, strict=True)
    }
    return {name: place[branch] for name, branch in branches.items() if branch in place}


def _quantities(
    form: StateForm,
    elements: Sequence[Element],
    joints: RigidJoints,
    edges: dict[Edge, EdgeReading],
    shared: Mapping[Edge, tuple[Edge, float]],
) -> tuple[dict[str, Sum], dict[str, tuple[Sum, ...]]]:
    """What each quantity of the network is in the dual, and each that is read along a part.

    Args:
        form: the state form of the network.
        elements: of the network, without couplings that carry nothing.
        joints: its rigid joints.
        edges: what is read of the edges that have a dual; of the others it is added here.
        shared: frictions that are part of others; how these share what holds nothing tells.
    """
    for edge, (first, sign) in shared.items():
        edges[edge] = EdgeReading(total((sign, edges[first].across)), {})
    for part in form.graph.parts:
        _add_others(part, edges)
    couplings = [element for element in elements if element.kind is Kind.COUPLING]
    owner = {edge: element for element in couplings for edge in element.edges}
    for element in couplings:
        _add_loops(element, edges)
    for joint in reversed(joints.edges):
        edges[joint] = EdgeReading({}, joints.through(joint, edges))
        _add_loops(owner[joint], edges)
    nodes = sums_of_nodes(form.graph, edges)
    for index in _idle(form):
        for key, plus, minus in ends_of(form.graph.branches[index]):
            edges[key] = EdgeReading(total((1.0, nodes[plus]), (-1.0, nodes[minus])), {})
    angles = ((integral_name(form.graph, form.graph.branches[k]), edges[k, 0].across) for k in form.integrals)
    charges = {name: {f"{one.removesuffix('.i')}.q": share for one, share in sums.items()} for name, sums in angles}
    readings = Readings(form, edges, nodes)
    sharing = {form.graph.part_of(branch).name for pair in shared.items() for branch, _ in (pair[0], pair[1][0])}
    through = {
        name
        for name, (part, signal) in Names(form).signals.items()
        if part.name in sharing and signal.kind == "through"
    }
    quantities = {name: sums for name, sums in readings.quantities().items() if name not in through}
    return quantities | charges, readings.profiles()


def _idle(form: StateForm) -> Iterator[int]:
    """Of gears side by side all but one, which carry nothing."""
    return (index for index in form.tree.links[Kind.COUPLING] if not form.graph.part_of(index).modes)


def _elements(part: GraphPart, graph: CircuitGraph, names: ElementNames) -> Iterator[Element]:
    """The elements of a part, with the laws of all its modes."""
    elements = elements_of(part, graph, names)
    if (law := _of_current(part)) is not None:
        yield dataclasses.replace(next(elements), value=law)
    elif not part.modes:
        yield from elements
    elif (modes := DualModes(part)).is_one_way:
        yield dataclasses.replace(next(elements), kind=Kind.LAW, value=None)
    elif (whole := part.modes[0].law) is not None:
        value = in_numbers(whole, graph.branches[part.branches[0]], graph)
        yield dataclasses.replace(next(elements), kind=Kind.LAW, value=value)
    else:
        for element, pair in zip(elements, modes.pairs, strict=True):
            ahead, back = (in_numbers(law, graph.branches[element.edges[0][0]], graph) for law in pair)
            yield element if ahead == back else dataclasses.replace(element, kind=Kind.LAW, value=ahead, back=back)


def _add_loops(element: Element, edges: dict[Edge, EdgeReading]) -> None:
    """The terms of a coupling between nodes that are one: what passes there is in proportion to another term."""
    factors = dict(zip(element.edges, element.terms, strict=True))
    if (base := next((edge for edge in element.edges if edge in edges), None)) is not None:
        for edge, factor in factors.items():
            edges.setdefault(edge, EdgeReading({}, total((factor / factors[base], edges[base].through))))


def _add_others(part: GraphPart, edges: dict[Edge, EdgeReading]) -> None:
    """The branches of a part beside the one that stands for all of them."""
    first, *others = part.branches or (0,)
    if part.modes and part.modes[0].law is not None:
        edges.update({(index, 0): EdgeReading(edges[first, 0].across, {}) for index in others})
    elif _of_current(part) is not None:  # what counts its charge
        for index, sign in zip(others, (-1.0, 1.0), strict=False):
            edges[index, 0] = EdgeReading({f"{part.name}.psi": 1.0}, {f"{part.name}.u": sign})


def _of_current(part: GraphPart) -> Expr | None:
    """The law of a source of voltage that reads its own current."""
    law = part.component.values["u"] if isinstance(part.component, VoltageSource) else None
    return law if isinstance(law, Expr) and law.has(i, q) else None


def _reason(part: GraphPart, graph: CircuitGraph) -> str:
    """Why a part has no dual; empty where it has one."""
    templates = [graph.branches[index].template for index in part.branches]
    if any(template.line is not None for template in templates):
        return "waves travel along it; Lumped(20) instead of Wave() has one"
    if any(RATE in template.reads for template in templates):
        return "what it stores changes, and inductances are constant"
    if any(template.reads for template in templates) and _of_current(part) is None:
        return "its laws read other nodes and branches, and those of a dual their own current alone"
    if any(template.through for template in templates):
        return "it does not hand on all power that it takes: teeth lose some, and controlled sources add theirs"
    return f"it {why}" if part.modes and (why := DualModes(part).problem) else ""


def _without_dual(part: GraphPart, why: str, graph: CircuitGraph) -> Diagnostic:
    """The problem of a part that has no dual."""
    nodes = tuple(graph.node_name(number) for number in dict.fromkeys(part.nodes.values()))
    message = f"{title(part.component)}: {why}."
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

    def __init__(self, faces: DualEnds, names: ElementNames) -> None:
        self._faces, self._names = faces, names
        self.edges: dict[Edge, EdgeReading] = {}
        self.branches: dict[str, int] = {}

    def placed(self, element: Element) -> Iterator[Placed]:
        """The parts that are the dual of an element."""
        if element.kind is Kind.COUPLING:
            yield from self._coupling(element)
        elif element.edges[0] not in self._faces.ends:
            yield from self._at_rest(element)
        elif element.value is None:
            (edge,) = element.edges
            yield Placed(Diode(element.name, symbol=element.symbol), self._nodes(edge)[::-1])
            self.edges[edge] = EdgeReading({f"{element.name}.i": -1.0}, {f"{element.name}.u": -1.0})
        elif element.back is not None:
            yield from self._rubbing(element)
        else:
            (edge,) = element.edges
            left, right = self._nodes(edge)
            part = _made(element)
            is_source = isinstance(part, VoltageSource | CurrentSource)
            yield Placed(part, (right, left) if is_source else (left, right))
            name, sign = element.name, -1.0 if is_source else 1.0
            self.branches[name] = edge[0]
            self.edges[edge] = EdgeReading({f"{name}.i": 1.0}, {f"{name}.u": sign})
        for edge in element.edges:
            if edge in self._faces.bridges:
                number = f" {edge[1] + 1}" if len(element.edges) > 1 else ""
                yield Placed(Resistor(self._names.unique(f"{element.name} short{number}"), R=0.0), self._nodes(edge))

    def _coupling(self, element: Element) -> Iterator[Placed]:
        """Transformers from one term of a coupling to each other one.

        The sum of a_k u_k is zero and i_k = a_k lambda. So in the dual u_k = a_k lambda and the sum of a_k i_k is zero.
        """
        factors = zip(element.edges, element.terms, strict=True)
        sides = [(edge, factor) for edge, factor in factors if edge in self._faces.ends]
        if len(sides) < 2:
            return
        (first, base), *others = sides
        numbers = () if len(others) == 1 else range(1, len(sides))
        names = [self._names.unique(f"{element.name} {number}") for number in numbers] or [element.name]
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

    def _at_rest(self, element: Element) -> Iterator[Placed]:
        """A source between nodes that are one, which is of no effect: it feeds a resistor of its own."""
        (edge,) = element.edges
        self.edges[edge] = EdgeReading({}, {})
        if element.kind not in (Kind.THROUGH_SOURCE, Kind.LAW) or element.value is None or element.back is not None:
            return
        still = in_letters(element.value, {ACROSS: S.Zero, INTEGRAL: S.Zero})
        node = f"{element.name} node"
        yield Placed(_made(dataclasses.replace(element, value=still)), (node, REFERENCE))
        yield Placed(Resistor(self._names.unique(f"{element.name} alone"), R=1.0), (node, REFERENCE))
        self.edges[edge] = EdgeReading({}, {f"{element.name}.u": -1.0})

    def _rubbing(self, element: Element) -> Iterator[Placed]:
        """Two diodes, each of which opens at a voltage of its own."""
        (edge,) = element.edges
        left, right = self._nodes(edge)
        currents: Sum = {}
        for side, (start, end), law, sign in (
            ("forward", (left, right), element.value, 1.0),
            ("backward", (right, left), element.back, -1.0),
        ):
            name = self._names.unique(f"{element.name} {side}")
            diode = self._names.unique(f"{element.name} diode {side}")
            yield Placed(Diode(diode), (start, f"{name} node"))
            # the law is that of a current from left to right
            voltage = -in_letters(law, READ) if sign > 0 else in_letters(law, {ACROSS: -i})
            yield Placed(VoltageSource(name, u=voltage), (end, f"{name} node"))
            currents[f"{name}.i"] = sign
            voltages = {f"{diode}.u": sign, f"{name}.u": -sign}  # the same on both sides
        self.branches[element.name] = edge[0]
        self.edges[edge] = EdgeReading(currents, voltages)

    def _nodes(self, edge: Edge) -> tuple[str, str]:
        left, right = self._faces.ends[edge]
        return self._names.mesh(left), self._names.mesh(right)


def _made(element: Element) -> Component:
    """The dual of a store, a loss or a source."""
    name, symbol, value = element.name, element.symbol, element.value
    match element.kind:
        case Kind.ACROSS_STORE:
            return Inductor(name, symbol=symbol, L=value)
        case Kind.THROUGH_STORE:
            return Capacitor(name, symbol=symbol, C=1 / value)
        case Kind.CONDUCTANCE if value < 0:  # it drives
            return VoltageSource(name, symbol=symbol, u=-value * i)
        case Kind.CONDUCTANCE:
            return Resistor(name, symbol=symbol, R=value)
        case Kind.ACROSS_SOURCE:
            return CurrentSource(name, symbol=symbol, i=in_letters(value, BACK))
        case Kind.THROUGH_SOURCE | Kind.LAW:
            return VoltageSource(name, symbol=symbol, u=-in_letters(value, READ))
    raise AssertionError(f"{element.kind} of '{name}' has no dual element")  # pragma: no cover
