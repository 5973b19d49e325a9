"""The force-current analogue of a network: the circuit that has its graph."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

from shaftwork.analogues.analogy import Analogy
from shaftwork.analogues.circuit_elements import Edge, Element, ElementNames, Sum, elements_of, in_letters, is_linear
from shaftwork.analogues.images import IN_LAWS, image_class, image_of, in_circuit
from shaftwork.analogues.readings import EdgeReading, Readings
from shaftwork.components.base import Component
from shaftwork.components.branches import ACROSS, INTEGRAL
from shaftwork.components.electrical import (
    Capacitor,
    CurrentSource,
    Inductor,
    Resistor,
    Transformer,
    VoltageSource,
)
from shaftwork.components.laws import psi, u
from shaftwork.components.modes import ModeChoice
from shaftwork.core.domains import ELECTRICAL, ROTATION, Domain
from shaftwork.formulation.form import Names, StateForm, integral_name, state_form, store_name
from shaftwork.network.graph import CircuitGraph, GraphPart, build_graph
from shaftwork.network.kinds import Kind
from shaftwork.network.measurements import refuse_measuring
from shaftwork.network.netlist import REFERENCE, Netlist, Placed

READ = {ACROSS: u, INTEGRAL: psi, **IN_LAWS}
"""What laws of branches read, in quantities of a circuit."""


def circuit(netlist: Netlist, form: StateForm) -> Analogy:
    """The circuit of a network: `Network.circuit` says of what.

    Args:
        netlist: of the network.
        form: its state form.
    """
    refuse_measuring(netlist, f"'{netlist.name}' has no circuit")
    work = _Circuit(netlist, form)
    placed: list[Placed] = []
    for item, part in zip(netlist.placed, form.graph.parts, strict=True):
        placed += work.placed(item, part)
    changed = dataclasses.replace(netlist, name=f"circuit of {netlist.name}", placed=tuple(placed))
    domains = {name: domain for name, domain in work.domains() if domain is not ROTATION}
    return Analogy(netlist.name, changed, work.quantities(), work.branches, domains)


class _Circuit:
    """Goes through the parts and remembers what their edges are in the circuit."""

    def __init__(self, netlist: Netlist, form: StateForm) -> None:
        self._netlist, self._form, self._graph = netlist, form, form.graph
        self._names = ElementNames(form.graph)
        self._node_of = {name: self._names.node(number) for number, name in enumerate(form.graph.nodes)}
        self._edges: dict[Edge, EdgeReading] = {}
        self._renamed: list[GraphPart] = []
        self.branches: dict[str, int] = {}

    def placed(self, item: Placed, part: GraphPart) -> Iterator[Placed]:
        """The parts that a part is in the circuit."""
        component = item.part
        elements = tuple(elements_of(part, self._graph, self._names)) if self._is_elementary(part) else ()
        elementary = [_made(element) for element in elements]
        if elements and all(map(_is_admissible, elementary)):
            for element, made in zip(elements, elementary, strict=True):
                self.branches[element.name] = element.edges[0][0]
                self._edges |= zip(element.edges, _readings(element), strict=True)
                yield Placed(made, tuple(node for ends in element.ends for node in ends))
            return
        self._renamed.append(part)
        electrical = image_class(type(component)) is type(component)
        there = (self._node_of.get(node, node) for node in item.nodes)
        nodes = (*there, *(REFERENCE for _ in component.ports[len(item.nodes) :]))
        if electrical:
            yield dataclasses.replace(item, nodes=nodes)
        else:
            yield dataclasses.replace(item, part=image_of(component), nodes=nodes, origin=None)

    def _is_elementary(self, part: GraphPart) -> bool:
        """Whether elements of a circuit can stand for a part: one that is no circuit itself and no mesh."""
        component = part.component
        if component.profiles() or all(port.domain in (ELECTRICAL, None) for port in component.ports):
            return False
        templates = [self._graph.branches[index].template for index in part.branches]
        if not templates or any(len(template.terms) > 2 for template in templates):
            return False
        return is_linear(part, self._graph) or self._is_source(part)

    def _is_source(self, part: GraphPart) -> bool:
        """Whether a part is a source whose torque depends on its own speed, angle and the time."""
        laws = [self._graph.branches[index].template for index in part.branches]
        return (
            len(laws) == 1
            and part.component.role == "source"
            and not (part.modes or laws[0].reads or laws[0].conservative or laws[0].stored != 0)
        )

    def domains(self) -> Iterator[tuple[str, Domain]]:
        """The nodes of the circuit, and their domains in the network."""
        for number, domain in enumerate(self._graph.domains):
            yield self._names.node(number), domain

    def quantities(self) -> dict[str, Sum]:
        """What each quantity of the network is in the circuit."""
        names = Names(self._form)
        graph = self._graph
        owners = {part.name for part in self._renamed}  # nodes inside them keep their names
        nodes: dict[int, Sum] = {
            number: {
                f"{name if name.rpartition('.')[0] in owners else self._node_of[name]}.{ELECTRICAL.across.name}": 1.0
            }
            for number, name in enumerate(graph.nodes)
        }
        quantities = Readings(self._form, self._edges, nodes).quantities()
        integrals = _integrals(self._netlist, graph)
        renamed = {part.name: _names_in_circuit(part.component) for part in self._renamed}
        profiles = [f"{part.name}.{name}" for part in self._renamed for name in part.component.profiles()]
        for name in (*names.signals, *profiles, *integrals):
            owner, _, quantity = name.rpartition(".")
            if owner in renamed:
                quantities[name] = {f"{owner}.{renamed[owner].get(quantity, in_circuit(quantity))}": 1.0}
            elif name not in quantities:
                quantities[name] = {f"{owner}.{in_circuit(quantity)}": 1.0}
        for branch in graph.branches:
            if branch.template.kind in (Kind.ACROSS_STORE, Kind.THROUGH_STORE):
                owner, _, quantity = (name := store_name(graph, branch)).rpartition(".")
                quantities.setdefault(name, {f"{owner}.{branch.template.label or in_circuit(quantity)}": 1.0})
        return quantities


def _integrals(netlist: Netlist, graph: CircuitGraph) -> list[str]:
    """The names of angles and ways that laws read, also of parts that read theirs in other modes than the first."""
    firsts = {part.name: tuple(ModeChoice(one.options[0].form) for one in part.modes) for part in graph.parts}
    form = state_form(build_graph(netlist.with_choices(firsts)))
    return [integral_name(form.graph, form.graph.branches[k]) for k in form.integrals]


def _names_in_circuit(part: Component) -> dict[str, str]:
    """The quantities of a part whose names in a circuit are not just other letters: between two nodes u for omega_rel.

    They come in the same order in both.
    """
    if image_class(type(part)) is type(part):
        return {name: name for name in part.signals()}
    pairs = [*zip(part.signals(), image_of(part).signals(), strict=False)]
    return {
        **dict(pairs),
        **{
            name.removesuffix("_rel"): other
            for name, other in pairs
            if name.removesuffix("_rel") not in part.profiles()
        },
    }


def _is_admissible(part: Component) -> bool:
    """Whether a part may have its values: a damping that drives, below zero, is no resistance."""
    return all(declared.magnitude(part.values[name])[1] is None for name, declared in part.declared.items())


def _made(element: Element) -> Component:
    """The part of a circuit that an element is."""
    name, symbol, value = element.name, element.symbol, element.value
    match element.kind:
        case Kind.ACROSS_STORE:
            return Capacitor(name, symbol=symbol, C=value)
        case Kind.THROUGH_STORE:
            return Inductor(name, symbol=symbol, L=1 / value)
        case Kind.CONDUCTANCE:
            return Resistor(name, symbol=symbol, R=1 / value)
        case Kind.ACROSS_SOURCE:
            return VoltageSource(name, symbol=symbol, u=in_letters(value, READ))
        case Kind.THROUGH_SOURCE | Kind.LAW:
            return CurrentSource(name, symbol=symbol, i=-in_letters(value, READ))
        case Kind.COUPLING if len(element.terms) == 2:
            return Transformer(name, symbol=symbol, ratio=-element.terms[1] / element.terms[0])
        case Kind.COUPLING if len(element.terms) == 1:
            return Resistor(name, symbol=symbol, R=0.0)
    raise AssertionError(f"{element.kind} of '{name}' has no element of a circuit")  # pragma: no cover


def _readings(element: Element) -> Iterator[EdgeReading]:
    """What is across and through each term of an element."""
    if len(element.terms) == 2:
        for side in (1, 2):
            yield EdgeReading({f"{element.name}.u_{side}": 1.0}, {f"{element.name}.i_{side}": 1.0})
        return
    sign = -1.0 if element.kind in (Kind.ACROSS_SOURCE, Kind.THROUGH_SOURCE, Kind.LAW) else 1.0
    yield EdgeReading({f"{element.name}.u": 1.0}, {f"{element.name}.i": sign})
