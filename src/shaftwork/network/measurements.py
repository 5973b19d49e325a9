"""What a part measures of others: which nodes and stores a name stands for, "J2.omega", "shaft.tau_c"."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from difflib import get_close_matches
from typing import Any

from sympy import Expr, Integer, Symbol

from shaftwork.components.base import Component
from shaftwork.components.branches import MEASURED, End, named_in
from shaftwork.components.laws import replaced
from shaftwork.core.domains import ROTATION
from shaftwork.core.errors import Diagnostic, NetworkError, ShaftworkError
from shaftwork.network.kinds import Kind
from shaftwork.network.netlist import REFERENCE, Netlist, Placed, listed
from shaftwork.network.templates import BranchTemplate, make_template

AT_NODE, IN_STORE = "node", "store"
"""What a law of a network reads of other parts: the across variable of a node, the through variable of a store."""


Resolve = Callable[[Component], tuple[Mapping[str, Any], Any]]


class NotMeasurableError(ShaftworkError):
    """A name stands for nothing that a part can measure of another; says what it can measure instead."""


class Measurements:
    """The quantities of a network that its parts can measure.

    Args:
        netlist: the network.
        resolve: values of a part in SI, and what is wrong with them.
    """

    def __init__(self, netlist: Netlist, resolve: Resolve) -> None:
        self._placed = {placed.part.name: placed for placed in netlist.placed}
        self._resolve = resolve
        self._templates: dict[BranchTemplate, BranchTemplate] = {}
        self._domains = {
            node: port.domain or ROTATION
            for placed in netlist.placed
            for port, node in zip(placed.part.ports, placed.nodes, strict=False)
            if node != REFERENCE
        }

    def placed(self, template: BranchTemplate) -> BranchTemplate:
        """A branch whose law reads nodes and stores in place of the names of what it measures."""
        if template not in self._templates:
            reads = ((symbol, *named_in(symbol)) for symbol in template.reads)
            laws = {symbol: self.law(name) for symbol, kind, name in reads if kind == MEASURED}
            law, printed = (replaced(each, laws) for each in (template.law, template.printed))
            self._templates[template] = replace(template, law=law, printed=printed) if laws else template
        return self._templates[template]

    def law(self, name: str) -> Expr:
        """A quantity as a sum of across variables of nodes and of what stores let through.

        Raises:
            NotMeasurableError: there is no such quantity, or others decide it at the same instant.
        """
        owner, _, quantity = name.rpartition(".")
        if (placed := self._placed.get(owner)) is not None:
            laws = self._laws_of(placed)
            if (law := laws.get(quantity)) is not None:
                return law
            has = quantity in placed.part.signals()
            why = "follows from others at the same instant" if has else "does not exist"
            able = ", ".join(f"{owner}.{each}" for each in laws) or "nothing"
            raise NotMeasurableError(f"'{name}' {why}. Of '{owner}' it can measure: {able}.")
        if owner in self._domains and quantity == self._domains[owner].across.name:
            return Symbol(f"{AT_NODE} of {owner}", real=True)
        close = get_close_matches(owner, (*self._placed, *self._domains), n=3) or [*self._placed]
        raise NotMeasurableError(f"'{name}': there is no part or node '{owner}'. There are: {listed(close)}.")

    def _laws_of(self, placed: Placed) -> dict[str, Expr]:
        """What can be measured of a part: what its springs and inductors let through, and what is across it."""
        laws = _stores(placed.part, self._resolve(placed.part)[0])
        nodes = dict(zip((port.name for port in placed.part.ports), placed.nodes, strict=False))
        nodes |= {port.name: f"{placed.part.name}.{port.name}" for port in placed.part.inner_ports()}
        at_rest = any(nodes.get(port.name, REFERENCE) == REFERENCE for port in placed.part.ports if port.optional)
        for name, signal in placed.part.signals().items():
            if signal.kind == "across":
                first, second = (_at(nodes, end) for end in signal.ends)
                laws[name] = signal.sign * (first - second)
                laws |= {name.removesuffix("_rel"): laws[name]} if at_rest else {}
        return laws


def _at(nodes: Mapping[str, str], end: End) -> Expr:
    """The across variable at an end of a part."""
    node = REFERENCE if end is None else nodes.get(end, REFERENCE)
    return Integer(0) if node == REFERENCE else Symbol(f"{AT_NODE} of {node}", real=True)


def _stores(part: Component, values: Mapping[str, Any]) -> dict[str, Expr]:
    """What the springs and inductors of a part let through, by the names of states and of signals.

    Of parts with modes there is none, as a store of one mode may not be there in another.
    """
    template = make_template(part, values)
    ports = {port.name: port for port in (*part.ports, *part.inner_ports())}
    if template.modes:
        return {}
    stores: dict[str, tuple[BranchTemplate, Expr]] = {}
    for branch in template.branches:
        if branch.kind is Kind.THROUGH_STORE:
            domain = next(ports[end].domain for end in branch.ends if end is not None) or ROTATION
            symbol = Symbol(f"{IN_STORE} of {part.name}.{branch.label}", real=True)
            stores[branch.label or domain.through.name] = branch, symbol
    laws: dict[str, Expr] = {name: symbol for name, (_, symbol) in stores.items()}
    for name, signal in part.signals().items():
        for branch, symbol in stores.values():
            alone = signal.kind == "through" and len(template.branches) == 1 and branch.ends == signal.ends
            if alone or (signal.kind == "store" and branch.label == signal.label):
                laws[name] = signal.sign * symbol
    return laws


def unmeasurable(netlist: Netlist, resolve: Resolve) -> Iterator[tuple[Placed, str]]:
    """The parts that measure what cannot be measured, each with what is wrong; arguments as of `Measurements`."""
    if not any(placed.part.measures for placed in netlist.placed):
        return
    measurements = Measurements(netlist, resolve)
    for placed in netlist.placed:
        try:
            for name in placed.part.measures:
                measurements.law(name)
        except NotMeasurableError as error:
            yield placed, str(error)


def refuse_measuring(netlist: Netlist, title: str) -> None:
    """Refuse a network that is to become another one, in which what parts measure has other names and values.

    Args:
        netlist: of the network.
        title: of the error, "'crane' has no circuit".

    Raises:
        NetworkError: a part measures quantities of others; lists all such parts.
    """
    problems = tuple(
        Diagnostic(
            "measurement",
            f"{type(placed.part).__name__} '{placed.part.name}' measures {listed(placed.part.measures)} by name, and "
            "these are other quantities there.",
            "Put a TorqueSource in its place, and the controller into the new network.",
            (placed.part.name,),
            placed.nodes,
        )
        for placed in netlist.placed
        if placed.part.measures
    )
    if problems:
        raise NetworkError(title, problems)
