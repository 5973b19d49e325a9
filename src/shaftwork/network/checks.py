"""Checks of a network before its equations are made: what is typed wrong, and what is not joined to anything.

Nothing here raises. What cannot be used is replaced or left out, so that the later stages run and every problem of a
network is reported together.
"""

from __future__ import annotations

import dataclasses
import reprlib
from collections.abc import Iterator, Mapping
from typing import Any

import networkx as nx
import sympy
from sympy import Expr, Float, Integer

from shaftwork.components.base import Component
from shaftwork.components.branches import ACROSS, INTEGRAL
from shaftwork.components.modes import mode_symbol
from shaftwork.core.domains import Domain
from shaftwork.core.errors import Diagnostic, ShaftworkError
from shaftwork.network.graph import GROUND, CircuitGraph, GraphPart, resolve, signals_of
from shaftwork.network.kinds import Kind
from shaftwork.network.law_faults import Fault, instead_of, law_faults
from shaftwork.network.measurements import unmeasurable
from shaftwork.network.netlist import (
    MAXIMUM_NAME,
    REFERENCE,
    Netlist,
    Placed,
    Spelling,
    at_nodes,
    is_name,
    listed,
    title,
)
from shaftwork.network.templates import BranchTemplate, Shared

LEFT_OUT = ("node name", "node count", "wrong domain", "no effect", "component")
"""Kinds of problems whose part is left out of what is examined further."""

SEPARATE = "separate train"
"""The kind of problem of a train beside the largest one."""

Train = tuple[int, ...]
"""Numbers of the parts that hang together."""


def examine(netlist: Netlist) -> tuple[Netlist, tuple[Diagnostic, ...]]:
    """Check every part by itself and against the names and nodes before it.

    Args:
        netlist: any netlist.

    Returns:
        A netlist that `build_graph` accepts (bad values replaced, bad parts left out, equal names told apart), and all
        problems in the order of the parts.
    """
    work = _Examination(netlist)
    for placed in netlist.placed:
        work.take(placed)
    work.leave_out_blind()
    if not netlist.placed:
        work.report("empty network", f"'{netlist.name}' has no parts.", "Add parts: net.add(part, 'node').")
    return dataclasses.replace(netlist, placed=tuple(work.usable), ports=()), tuple(work.problems)


class _Examination:
    """Goes through the parts in order and remembers names, nodes and domains."""

    def __init__(self, netlist: Netlist) -> None:
        self._parts = {placed.part.name for placed in netlist.placed if isinstance(placed.part.name, str)}
        self.problems: list[Diagnostic] = []
        self.usable: list[Placed] = []
        self._named: dict[str, str] = {}
        self._domains: dict[str, tuple[Domain, str]] = {}
        self._dotted: dict[str, None] = {}
        self._faults = Shared(lambda part, values, _: tuple(law_faults(part, values)))

    def report(self, kind: str, message: str, hint: str, placed: Placed | None = None, parameter: str = "") -> None:
        """Put down an error, with the part and the nodes that it concerns, and its place in a model file."""
        if placed is not None and placed.origin is not None:
            message = f"{message.removesuffix('.')} ({placed.origin.of(parameter)})."
        parts = (str(placed.part.name),) if placed else ()
        nodes = tuple(node for node in placed.nodes if isinstance(node, str) and node) if placed else ()
        self.problems.append(Diagnostic(kind, message, hint, parts, tuple(dict.fromkeys(nodes))))

    def take(self, placed: Placed) -> None:
        """Check one part and keep it if the rest can be examined with it."""
        renamed = dataclasses.replace(placed, part=self._with_name(placed))
        fits = self._stands(renamed)
        sound = self._with_values(renamed)
        if fits and sound is not None:
            self.usable.append(dataclasses.replace(placed, part=sound))

    def leave_out_blind(self) -> None:
        """Leave out the parts that measure what none of the others has."""
        for placed, fault in unmeasurable(Netlist("", tuple(self.usable)), resolve):
            self.report("measurement", f"{title(placed.part)}: {fault}", "Correct measured.", placed, "measured")
            self.usable.remove(placed)

    def _with_name(self, placed: Placed) -> Component:
        """The part under a name that no other part has."""
        part, name = placed.part, placed.part.name
        if not isinstance(name, str) or not name.strip():
            self.report("part name", f"{title(part)} has no name.", "Give it a text that no other part has.", placed)
        elif name == REFERENCE:
            hint = "Rename the part; a Ground part may be called 'frame'."
            self.report("part name", f"{title(part)}: the name '{REFERENCE}' stands for the frame.", hint, placed)
        elif not is_name(name):
            hint = f"Use 1 to {MAXIMUM_NAME} printable characters, without line ends and tabs."
            self.report("part name", f"{type(part).__name__} {reprlib.repr(name)} has no plain name.", hint, placed)
        elif whole := self._unclear(name):
            hint = f"A dot joins part and quantity, as in 'shaft.tau': write '{name.replace('.', '_')}'."
            self.report("part name", f"{title(part)} has a dot in its name{whole}.", hint, placed)
        elif name in self._named:
            message = f"{title(part)} at {at_nodes(placed.nodes)} has the name of {self._named[name]}."
            self.report("duplicate name", message, f"Rename one of them, for example '{name}_2'.", placed)
        free, count = str(name) if str(name).strip() else "unnamed", 1
        while free in self._named:
            count += 1
            free = f"{name} ({count})"
        self._named[free] = f"{title(part)} at {at_nodes(placed.nodes)}"
        return part if free == name else dataclasses.replace(part, name=free)

    def _unclear(self, name: str) -> str:
        """Why a name with dots could be mistaken; empty where it is that of something in a network within this one."""
        before = [name[:place] for place, letter in enumerate(name) if letter == "."]
        if not before or not all(word.strip() for word in name.split(".")) or before[0] == REFERENCE:
            return " without the name of a network before it" if before else ""
        owner = next((whole for whole in before if whole in self._parts), None)
        return "" if owner is None else f", and '{owner}' is a part"

    def _stands(self, placed: Placed) -> bool:
        """Whether the part stands at nodes that suit its ports."""
        part, nodes, before = placed.part, placed.nodes, len(self.problems)
        if strange := [node for node in nodes if not is_name(node)]:
            hint = f"A node is named by a text such as 'rotor', of 1 to {MAXIMUM_NAME} printable characters."
            self.report("node name", f"{title(part)}: {reprlib.repr(strange[0])} is no node.", hint, placed)
            return False
        self._check_count(placed)
        self._check_domains(placed)
        if len(self.problems) == before:
            self._check_effect(placed)
        fits = len(self.problems) == before
        for node in (node for node in nodes if self._unclear(node) and node not in self._dotted):
            self._dotted[node] = None
            hint = f"A dot marks the nodes inside a part: write '{node.replace('.', '_')}'."
            message = f"{title(part)} stands at node '{node}', which has a dot in its name{self._unclear(node)}."
            self.problems.append(Diagnostic("dotted node name", message, hint, (part.name,), (node,)))
        return fits

    def _check_count(self, placed: Placed) -> None:
        part, count = placed.part, len(placed.nodes)
        needed = max((k for k, port in enumerate(part.ports, 1) if not port.optional), default=0)
        if needed <= count <= len(part.ports):
            return
        ports = ", ".join(f"{port.name} (may be left out)" if port.optional else port.name for port in part.ports)
        pattern = ", ".join(f"'node {port.name}'" for port in part.ports)
        message = f"{title(part)} is given {at_nodes(placed.nodes)}, but its ports are: {ports}."
        self.report("node count", message, f"Write net.add(part, {pattern}).", placed)

    def _check_domains(self, placed: Placed) -> None:
        for port, node in zip(placed.part.ports, placed.nodes, strict=False):
            if port.domain is None or node == REFERENCE:
                continue
            domain, first = self._domains.setdefault(node, (port.domain, title(placed.part)))
            if domain != port.domain:
                self.report(
                    "wrong domain",
                    f"{title(placed.part)}: its port {port.name} is for the domain {port.domain.name}, but "
                    f"node '{node}' belongs to {domain.name} since {first} stands there.",
                    f"Choose another node, or a part for {domain.name}; Drum, Wheel and DCMachine join domains.",
                    placed,
                )

    def _check_effect(self, placed: Placed) -> None:
        part = placed.part
        places = {*placed.nodes, *(REFERENCE for _ in part.ports[len(placed.nodes) :])}
        single = len(part.ports) == 1
        if len(places) == 1 and not (single and (REFERENCE not in places or part.ports[0].domain is None)):
            (node,) = places
            stands = "stands" if single else "begins and ends"
            message = f"{title(part)} {stands} at node '{node}' and does nothing there."
            hint = "Move it to a node that can move." if single else "Join one of its ends to another node."
            self.report("no effect", message, hint, placed)

    def _with_values(self, placed: Placed) -> Component | None:
        """The part with values that can be used in place of those that cannot; None if it yields no branches."""
        part = placed.part
        try:
            values, objections = resolve(part)
            for name, value, objection in objections:
                self._report_value(placed, name, value, objection)
            faults = self._faults_of(part, values)
        except ShaftworkError as error:
            self.report("component", f"{title(part)}: {error}", "Correct its branches().", placed)
            return None
        except Exception as error:  # noqa: BLE001 - a component written by a user may raise anything
            message = f"{title(part)}: its laws cannot be made ({type(error).__name__}: {error})."
            self.report("component", message, "Correct its branches() or the law that it is given.", placed)
            return None
        for name, what, hint in faults:
            kind = "law" if name else "component"
            self.report(kind, f"{title(part)}: {f'{name} ' if name else ''}{what}.", hint, placed, name)
        if any(not fault.parameter for fault in faults):
            return None
        usable: dict[str, Any] = {fault.parameter: 1.0 for fault in faults}
        return dataclasses.replace(part, **usable) if faults else part

    def _report_value(self, placed: Placed, name: str, value: Any, objection: str) -> None:
        part, declared = placed.part, placed.part.declared[name]
        kind = "wrong unit" if hasattr(value, "dimensionality") else "parameter"
        unit = " as a pure number" if declared.unit == "1" else f" in {declared.unit}"
        unit = "" if declared.record is not None else unit
        shown = "" if kind == "wrong unit" else f" = {reprlib.repr(value)}"
        law = ", or a formula such as 20 * sympy.sin(3 * sw.t)" if declared.law and isinstance(value, str) else ""
        hint = f"Give {name} ({declared.meaning}){unit}{f', {declared.bounds}' if declared.bounds else ''}{law}."
        self.report(kind, f"{title(part)}: {name}{shown} {objection}.", hint, placed, name)

    def _faults_of(self, part: Component, values: Mapping[str, Any]) -> tuple[Fault, ...]:
        """Faults of the laws, found once for parts that have the same."""
        odd = tuple(
            Fault(name, f"is a {type(value).__name__}, not a number or a law", instead_of(value))
            for name, value in values.items()
            if not isinstance(value, float) and (not isinstance(value, sympy.Expr) or value.is_Matrix)
            if part.declared[name].record is None and (value is not None or part.declared[name].default is not None)
        )
        return odd or self._faults.of(part, values)[0]


def connection_problems(graph: CircuitGraph) -> tuple[Diagnostic, ...]:
    """Parts, ends and whole trains that are not joined to the rest, and nodes whose speed has the name of another."""
    ends = _ends(graph)
    spelling = Spelling(graph.nodes)
    floating, main, others = _split(graph, ends)
    problems = [_floating_part(graph, number, spelling) for number in floating]
    alone = {*floating}
    for node, meeting in enumerate(ends):
        if len(meeting) == 1 and meeting[0][0] not in alone and not _is_complete(graph, meeting[0][0], node):
            problems.append(_loose_end(graph, *meeting[0], node, spelling))
    problems += [_separate_train(graph, train, main, spelling) for train in others]
    return (*problems, *_nearly_reference(graph), *_shared_names(graph))


def resting_trains(graph: CircuitGraph) -> tuple[Diagnostic, ...]:
    """The trains beside a driven one in which nothing moves unless it is given a start value."""
    _, main, others = _split(graph, _ends(graph))
    spelling = Spelling(graph.nodes)
    return tuple(_separate_train(graph, train, main, spelling) for train in others if _rests(graph, train, main))


def _split(graph: CircuitGraph, ends: list[list[tuple[int, str]]]) -> tuple[list[int], Train, list[Train]]:
    """Parts that are joined to nothing, the largest train, and the others."""
    trains = _trains(ends)
    single = [train[0] for train in trains if len(train) == 1]
    floating = [k for k in single if not any(_is_complete(graph, k, node) for node in _port_nodes(graph, (k,)))]
    joined = [train for train in trains if train[0] not in {*floating}]
    main = max(joined, key=len, default=())
    return floating, main, [train for train in joined if train is not main]


def _ends(graph: CircuitGraph) -> list[list[tuple[int, str]]]:
    """Of each node the parts that end there, by number and port."""
    ends: list[list[tuple[int, str]]] = [[] for _ in graph.nodes]
    for number, part in enumerate(graph.parts):
        for port in part.component.ports:
            if (node := part.nodes[port.name]) != GROUND:
                ends[node].append((number, port.name))
    return ends


def _trains(ends: list[list[tuple[int, str]]]) -> list[Train]:
    """The parts that hang together by nodes other than the frame; those that stand at the frame alone are left out."""
    joints: nx.Graph[int] = nx.Graph()
    joints.add_nodes_from(number for meeting in ends for number, _ in meeting)
    joints.add_edges_from((meeting[0][0], number) for meeting in ends for number, _ in meeting[1:])
    return sorted(tuple(sorted(train)) for train in nx.connected_components(joints))


def _is_complete(graph: CircuitGraph, number: int, node: int) -> bool:
    """Whether a part needs no other at a node: it has an inertia there, or a law whose torque is judged later."""
    for branch in (graph.branches[index] for index in graph.parts[number].branches):
        kind, ends = branch.template.kind, (branch.plus, branch.minus)
        is_law = kind in (Kind.THROUGH_SOURCE, Kind.LAW)
        if node in ends and (is_law or (kind is Kind.ACROSS_STORE and GROUND in ends)):
            return True
    return False


def _port_nodes(graph: CircuitGraph, numbers: Train) -> tuple[int, ...]:
    parts = (graph.parts[number] for number in numbers)
    nodes = (part.nodes[port.name] for part in parts for port in part.component.ports)
    return tuple(dict.fromkeys(node for node in nodes if node != GROUND))


def _floating_part(graph: CircuitGraph, number: int, spelling: Spelling) -> Diagnostic:
    part = graph.parts[number]
    nodes = tuple(graph.nodes[node] for node in _port_nodes(graph, (number,)))
    return Diagnostic(
        "floating part",
        f"{title(part.component)} at {at_nodes(nodes)} shares no node with any other part.",
        f"Join it to the train{spelling.suggestion(nodes)}, or remove it.",
        (part.name,),
        nodes,
    )


def _loose_end(graph: CircuitGraph, number: int, port: str, node: int, spelling: Spelling) -> Diagnostic:
    part, name = graph.parts[number], graph.nodes[node]
    return Diagnostic(
        "loose end",
        f"node '{name}': only {title(part.component)} ends there, with its port {port}, so it can carry no load.",
        f"Join another part to '{name}'{spelling.suggestion((name,))}, or remove '{part.name}'.",
        (part.name,),
        (name,),
    )


def _shared_names(graph: CircuitGraph) -> Iterator[Diagnostic]:
    """Nodes with the name of a part whose speed is another: sol["wheel.omega"] is that of the part."""
    parts = {part.name: part for part in graph.parts}
    for number, (node, domain) in enumerate(zip(graph.nodes, graph.domains, strict=True)):
        if (part := parts.get(node)) is None or (read := signals_of(graph, part).get(domain.across.name)) is None:
            continue
        ends = tuple(map(part.node_at, read.ends))
        if (read.kind, ends, read.sign) == ("across", (number, GROUND), 1):
            continue
        quantity, at = f"{node}.{domain.across.name}", tuple(graph.node_name(end) for end in ends if end != GROUND)
        yield Diagnostic(
            "shared name",
            f"{title(part.component)} and node '{node}' have the same name: '{quantity}' is read and set at "
            f"{at_nodes(at)}, where the part is, and that of node '{node}' cannot be read.",
            f"Rename one of them, for example the part '{node}_2'.",
            (part.name,),
            (node,),
            "warning",
        )


def _nearly_reference(graph: CircuitGraph) -> Iterator[Diagnostic]:
    """Nodes that are written like the frame, and are not."""
    for node in graph.nodes:
        if node.strip().lower() == REFERENCE:
            yield Diagnostic(
                "nearly ground",
                f"node '{node}' is a node of its own: the frame is '{REFERENCE}', in small letters.",
                f"Write '{REFERENCE}', or give the node another name.",
                (),
                (node,),
                "warning",
            )


def _separate_train(graph: CircuitGraph, train: Train, main: Train, spelling: Spelling) -> Diagnostic:
    names = tuple(graph.parts[number].name for number in train)
    nodes = tuple(graph.nodes[node] for node in _port_nodes(graph, train))
    others = listed(tuple(graph.parts[number].name for number in main), most=3)
    return Diagnostic(
        SEPARATE,
        f"{listed(names)} at {at_nodes(nodes)} share{'s' * (len(names) == 1)} no node with {others}"
        + (", and nothing drives that train." if _rests(graph, train, main) else "."),
        f"Join the two{spelling.suggestion(nodes)}, or simulate them as two networks.",
        names,
        nodes,
        "note",
    )


def _rests(graph: CircuitGraph, train: Train, main: Train) -> bool:
    """Whether nothing sets a train in motion that stands beside a driven one."""
    return _is_driven(graph, main) and not _is_driven(graph, train)


def _is_driven(graph: CircuitGraph, train: Train) -> bool:
    """Whether something in a train can set it in motion from rest."""
    parts = [graph.parts[number] for number in train]
    return any(part.component.role == "source" for part in parts) or any(
        _law_at_rest(part, graph.branches[k].template) != 0
        for part in parts
        for k in part.branches
        if graph.branches[k].template.kind in (Kind.LAW, Kind.THROUGH_SOURCE, Kind.ACROSS_SOURCE)
    )


def _law_at_rest(part: GraphPart, template: BranchTemplate) -> Expr:
    """A law of a part in its first modes, while nothing moves."""
    modes = {mode_symbol(element.symbol): Float(element.options[0].value) for element in part.modes}
    return template.law.xreplace({**dict.fromkeys((ACROSS, INTEGRAL, *template.reads), Integer(0)), **modes})
