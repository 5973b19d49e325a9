"""The circuit graph: nodes, parts and an ordered table of branches, also as a networkx multigraph."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import networkx as nx
from sympy import Expr, Symbol

from shaftwork.components.base import Component, Derived, Signal
from shaftwork.components.branches import End, named_in
from shaftwork.components.laws import as_expression, replaced
from shaftwork.components.modes import ModeChoice, Modes
from shaftwork.components.tables import Table
from shaftwork.core.domains import ROTATION, Domain
from shaftwork.network.kinds import Kind
from shaftwork.network.measurements import AT_NODE, IN_STORE, Measurements
from shaftwork.network.netlist import REFERENCE, Netlist, Placed, overview
from shaftwork.network.templates import BranchTemplate, Choices, Shared, Template, make_template, with_factors

GROUND = -1
"""Node number of the reference."""


@dataclass(frozen=True, slots=True, eq=False)
class GraphBranch:
    """One branch of the circuit.

    Args:
        index: place in the branch table.
        part: place of its part in the part table.
        template: its law in the symbols of its component.
        plus: number of its first node (`GROUND` for the reference); -1 for couplings.
        minus: number of its second node.
        terms: of a coupling, (coefficient in the component's symbols, first node, second node).
    """

    index: int
    part: int
    template: BranchTemplate
    plus: int
    minus: int
    terms: tuple[tuple[Expr, int, int], ...]

    @property
    def balances(self) -> tuple[tuple[Expr, int, int], ...]:
        """Of a coupling, (factor of its through variable, first node, second node); else empty."""
        return with_factors(self.terms, self.template.through)


@dataclass(frozen=True, slots=True, eq=False)
class GraphPart:
    """A part with its nodes by port name, the places of its parameters in the parameter vector, and its branches.

    The derived quantities are those in whose letters its laws are printed; the modes are of its elements that change.
    Of the parameters consulted its branches need the numbers themselves: other numbers may be other branches.
    """

    component: Component
    nodes: Mapping[str, int]
    parameters: Mapping[str, int]
    branches: tuple[int, ...]
    derived: tuple[Derived, ...]
    modes: tuple[Modes, ...] = ()
    consulted: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name of the part."""
        return self.component.name

    def node_at(self, end: End) -> int:
        """The node at one of its ports; None stands for the frame."""
        return GROUND if end is None else self.nodes[end]

    def ends_of(self, element: Modes) -> tuple[End, End]:
        """The ports that the across variable of an element is of; its own two by default."""
        ports = [port.name for port in self.component.ports]
        return element.ends or (ports[0], ports[1] if len(ports) > 1 else None)


@dataclass(frozen=True, eq=False)
class CircuitGraph:
    """A network as branches between nodes.

    Args:
        name: title of the network.
        nodes: node names; inner nodes of a part are named "part.inner".
        domains: domain of each node.
        parts: the part table.
        branches: the branch table, in the order of the parts.
        parameters: every parameter that is left in a law, "part.name" to value.
        zeros: every parameter that is exactly zero and therefore left out.
    """

    name: str
    nodes: tuple[str, ...]
    domains: tuple[Domain, ...]
    parts: tuple[GraphPart, ...]
    branches: tuple[GraphBranch, ...]
    parameters: Mapping[str, float]
    zeros: tuple[str, ...]

    def __repr__(self) -> str:
        return overview(Netlist(self.name, tuple(Placed(part.component, self._nodes_of(part)) for part in self.parts)))

    def _nodes_of(self, part: GraphPart) -> tuple[str, ...]:
        return tuple(self.node_name(part.nodes[port.name]) for port in part.component.ports)

    @cached_property
    def multigraph(self) -> nx.MultiDiGraph:
        """Nodes by name, an edge for each branch term from its first to its second node, keyed by branch and term."""
        multigraph = nx.MultiDiGraph(name=self.name)
        multigraph.add_nodes_from(self.nodes)
        for branch in self.branches:
            for key, plus, minus in ends_of(branch):
                multigraph.add_edge(
                    self.node_name(plus), self.node_name(minus), key=key, part=self.parts[branch.part].name
                )
        return multigraph

    @cached_property
    def integrated(self) -> tuple[tuple[int, ...], ...]:
        """For each part the branches the integral of whose across variable a law of the part reads."""
        return tuple(tuple(self._integrated_in(part)) for part in self.parts)

    def _integrated_in(self, part: GraphPart) -> Iterator[int]:
        laws = [(index, self.branches[index].template) for index in part.branches]
        named = {name for _, template in laws for kind, name in map(named_in, template.reads) if kind == "integral"}
        for index, template in laws:
            if template.has_integral or (template.label in named and template.kind is not Kind.COUPLING):
                yield index

    @property
    def wiring(self) -> dict[str, str]:
        """By part, what it is, where it is, and what is no number of it: its laws, tables and models."""
        descriptions = {}
        for part in self.parts:
            nodes = ", ".join(f"{end} {self.node_name(number)}" for end, number in part.nodes.items())
            values = part.component.values.items()
            laws = (f"{name} = {value}" for name, value in values if not isinstance(value, float | None))
            descriptions[part.name] = "; ".join((f"{type(part.component).__name__} ({nodes})", *laws))
        return descriptions

    def node_name(self, number: int) -> str:
        """Name of a node by its number."""
        return REFERENCE if number == GROUND else self.nodes[number]

    def part_of(self, branch: int) -> GraphPart:
        """The part that a branch belongs to."""
        return self.parts[self.branches[branch].part]

    def change_of(self, constant: int) -> int:
        """Of an inertia or capacitor that changes, the law of what it has beyond a constant: it comes next to that."""
        return constant + 1

    def constant_of(self, change: int) -> int:
        """The constant store before the law of what it has beyond it."""
        return change - 1

    def symbol_of(self, part: GraphPart, name: str) -> Symbol:
        """The symbol of a parameter or derived quantity in the equations of the whole network."""
        return Symbol(f"{part.name}.{name}", real=True)

    def in_network_symbols(self, expression: Expr, branch: GraphBranch) -> Expr:
        """An expression of a template with the part's own parameter symbols replaced by the network's."""
        part = self.parts[branch.part]
        return replaced(expression, {s: self.symbol_of(part, s.name) for s in branch.template.symbols})


def signals_of(graph: CircuitGraph, part: GraphPart) -> Mapping[str, Signal]:
    """The signals that a part has in this network.

    Those of a store that was left out are missing. A part with its optional end at rest also answers to the plain name
    of its speed, omega for omega_rel.
    """
    stores = any(graph.branches[k].template.kind is Kind.THROUGH_STORE for k in part.branches)
    declared = part.component.signals()
    signals = {name: signal for name, signal in declared.items() if stores or signal.kind not in ("twist", "store")}
    ports = part.component.ports
    if any(port.optional for port in ports) and any(part.nodes[port.name] == GROUND for port in ports):
        signals |= {name.removesuffix("_rel"): signal for name, signal in signals.items()}
    return signals


def ends_of(branch: GraphBranch) -> tuple[tuple[tuple[int, int], int, int], ...]:
    """((branch, term), first node, second node) for each edge that the branch stands for."""
    if branch.terms:
        return tuple(((branch.index, k), plus, minus) for k, (_, plus, minus) in enumerate(branch.terms))
    return (((branch.index, 0), branch.plus, branch.minus),)


def resolve(part: Component) -> tuple[dict[str, Any], tuple[tuple[str, Any, str], ...]]:
    """Values of a part in SI, floats or expressions of laws; and the objections as (parameter, given value, objection).

    A value that cannot be used is replaced by 1, a record by its default, so that the analysis of the network can go on
    and report everything.
    """
    values: dict[str, Any] = {}
    objections: list[tuple[str, Any, str]] = []
    for name, declared in part.declared.items():
        entry = getattr(part, name)
        value, objection = declared.magnitude(entry)
        if objection is None and not isinstance(value, float):
            value = as_expression(value) if isinstance(value, Table | Expr) else value  # the checks name the rest
        if objection is not None:
            objections.append((name, entry, objection))
            value = 1.0 if declared.record is None or declared.required else declared.magnitude(declared.default)[0]
        values[name] = value
    return values, tuple(objections)


class _Table:
    """Collects nodes and branches while the graph is made."""

    def __init__(self) -> None:
        self.numbers: dict[str, int] = {REFERENCE: GROUND}
        self.domains: list[Domain] = []
        self.templates = Shared(make_template)

    def node(self, name: str, domain: Domain | None) -> int:
        if name not in self.numbers:
            self.numbers[name] = len(self.domains)
            self.domains.append(domain or ROTATION)
        return self.numbers[name]


def build_graph(netlist: Netlist) -> CircuitGraph:
    """Netlist to graph. The netlist must have passed `checks.examine`."""
    table = _Table()
    for placed in netlist.placed:  # ports with a domain first, so that a Ground does not decide the domain of its node
        for port, node in zip(placed.part.ports, placed.nodes, strict=False):
            if port.domain is not None:
                table.node(node, port.domain)
    by_default: Choices = None if netlist.free_modes else ()
    parameters: dict[str, float] = {}
    zeros: list[str] = []
    parts: list[GraphPart] = []
    branches: list[GraphBranch] = []
    for item in netlist.placed:
        part, (values, _) = item.part, resolve(item.part)
        template, read = table.templates.of(part, values, item.choices or by_default)
        places: dict[str, int] = {}
        first_numbers = {element.symbol: element.options[0].value for element in template.modes}
        for name in template.parameters:
            places[name] = len(parameters)
            parameters[f"{part.name}.{name}"] = values[name] if name in values else first_numbers[name]
        zeros.extend(f"{part.name}.{name}" for name, value in values.items() if isinstance(value, float) and not value)
        nodes = _port_nodes(item, table)
        first = len(branches)
        branches.extend(_place(branch, first + k, len(parts), nodes) for k, branch in enumerate(template.branches))
        numbers = tuple(range(first, len(branches)))
        consulted = tuple(name for name in read if isinstance(values.get(name), float))
        parts.append(GraphPart(part, nodes, places, numbers, template.derived, template.modes, consulted))
    names = tuple(table.numbers)[1:]
    if any(part.component.measures for part in parts):
        measured = Measurements(netlist, resolve).placed
        branches = [replace(branch, template=measured(branch.template)) for branch in branches]
    return CircuitGraph(
        netlist.name, names, tuple(table.domains), tuple(parts), tuple(branches), parameters, tuple(zeros)
    )


def _port_nodes(placed: Placed, table: _Table) -> dict[str, int]:
    part = placed.part
    nodes = {port.name: GROUND for port in part.ports}
    for port, node in zip(part.ports, placed.nodes, strict=False):
        nodes[port.name] = table.node(node, port.domain)
    for port in part.inner_ports():
        nodes[port.name] = table.node(f"{part.name}.{port.name}", port.domain)
    return nodes


def _place(template: BranchTemplate, index: int, part: int, nodes: Mapping[str, int]) -> GraphBranch:
    def number(end: End) -> int:
        return GROUND if end is None else nodes[end]

    if template.kind is Kind.COUPLING:
        terms = tuple((coefficient, number(plus), number(minus)) for coefficient, plus, minus in template.terms)
        return GraphBranch(index, part, template, GROUND, GROUND, terms)
    plus, minus = template.ends
    return GraphBranch(index, part, template, number(plus), number(minus), ())


def effective(graph: CircuitGraph) -> frozenset[str]:
    """The parameters, "part.name", that a law reads in any mode of its part, or that say when a mode begins or ends."""
    templates = Shared(make_template)
    return frozenset(f"{part.name}.{name}" for part in graph.parts for name in _effective_of(part, templates))


def _effective_of(part: GraphPart, templates: Shared[Template]) -> Iterator[str]:
    values = resolve(part.component)[0]
    forms = [templates.of(part.component, values, choices)[0] for choices in _mode_choices(part.modes)]
    laws = {item.name: item.law for template in forms for item in template.derived}
    pending, read = list(_symbols_of(forms)), set(part.consulted)
    while pending:
        name = pending.pop().name
        pending += laws.pop(name).free_symbols if name in laws else ()
        read.add(name)
    return (name for name in part.component.declared if name in read)


def _mode_choices(elements: tuple[Modes, ...]) -> Iterator[tuple[ModeChoice, ...]]:
    """What may be chosen: each form of each element beside the first ones of the others."""
    firsts = tuple(ModeChoice(element.options[0].form) for element in elements)
    yield firsts
    for place, element in enumerate(elements):
        for form in dict.fromkeys(form for mode in element.options for form in mode.forms):
            yield (*firsts[:place], ModeChoice(form), *firsts[place + 1 :])


def _symbols_of(templates: Iterable[Template]) -> Iterator[Symbol]:
    """The symbols in laws, in what is stored, and in what begins and ends modes."""
    for template in templates:
        for branch in template.branches:
            yield from branch.symbols
        for mode in (mode for element in template.modes for mode in element.options):
            yield from mode.starts.free_symbols
            for leave in mode.leaves:
                for guard in (leave.when, leave.rebound, leave.rest):
                    yield from () if guard is None else guard.free_symbols


@dataclass(frozen=True)
class Reading:
    """A quantity of the circuit that a law reads.

    Args:
        kind: "across" (of a node against the reference), "through", "integral" or "rate" of across (of a branch).
        of: number of the node or branch.
    """

    kind: Literal["across", "through", "integral", "rate"]
    of: int


def readings_of(graph: CircuitGraph, branch: int) -> Mapping[Symbol, Reading]:
    """What the law of a branch reads besides its own, by the symbols of its template."""
    reads = graph.branches[branch].template.reads
    if not reads:
        return {}
    part = graph.part_of(branch)
    readings: dict[Symbol, Reading] = {}
    for symbol in reads:
        kind, name = named_in(symbol)
        if kind == "across":
            readings[symbol] = Reading("across", part.nodes[name])
        elif kind == "rate":
            readings[symbol] = Reading("rate", branch)
        elif kind == AT_NODE:
            readings[symbol] = Reading("across", graph.nodes.index(name))
        elif kind == IN_STORE:
            owner, _, label = name.rpartition(".")
            other = next(each for each in graph.parts if each.name == owner)
            readings[symbol] = Reading("through", _carrying(graph, other, "through", label))
        else:
            of = _carrying(graph, part, kind, name)
            readings[symbol] = Reading("through" if kind == "through" else "integral", of)
    return readings


def _carrying(graph: CircuitGraph, part: GraphPart, kind: str, label: str) -> int:
    """The branch of a part that a law reads under a label."""
    return next(k for k in part.branches if _stands_for(graph.branches[k].template, kind, label))


def _stands_for(template: BranchTemplate, kind: str, label: str) -> bool:
    """Whether a branch is the one that a law of its part reads under a label."""
    carrying = template.kind in (Kind.THROUGH_STORE, Kind.ACROSS_SOURCE)
    readable = carrying if kind == "through" else template.kind is not Kind.COUPLING
    return template.label == label and readable


def check_readings(part: Component, templates: tuple[BranchTemplate, ...]) -> None:
    """That what the laws of a part read is there.

    Raises:
        ValueError: the part has no such port, no such store or source, no such branch.
    """
    ports = {port.name for port in (*part.ports, *part.inner_ports())}
    for symbol in dict.fromkeys(symbol for template in templates for symbol in template.reads):
        kind, name = named_in(symbol)
        if kind == "across" and name not in ports:
            raise ValueError(f"a law reads across_of({name!r}), but the part has no such port")
        if kind in ("through", "integral") and not any(_stands_for(template, kind, name) for template in templates):
            what = "spring, inductor or source of voltage" if kind == "through" else "branch between two nodes"
            raise ValueError(f"a law reads {kind}_of({name!r}), but the part has no {what} of that label")
