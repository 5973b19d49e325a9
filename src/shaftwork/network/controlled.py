"""Controlled sources: what laws read of other ports and branches of their part, found in the circuit graph."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from sympy import Symbol

from shaftwork.components.base import Component
from shaftwork.components.branches import named_in
from shaftwork.network.graph import CircuitGraph
from shaftwork.network.kinds import Kind
from shaftwork.network.templates import BranchTemplate


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
        else:
            of = next(k for k in part.branches if _stands_for(graph.branches[k].template, kind, name))
            readings[symbol] = Reading("through" if kind == "through" else "integral", of)
    return readings


def _stands_for(template: BranchTemplate, kind: str, label: str) -> bool:
    """Whether a branch is the one that a law of its part reads under a label."""
    readable = template.kind is Kind.THROUGH_STORE if kind == "through" else template.kind is not Kind.COUPLING
    return template.label == label and readable


def check_readings(part: Component, templates: tuple[BranchTemplate, ...]) -> None:
    """That what the laws of a part read is there.

    Raises:
        ValueError: the part has no such port, no such store, no such branch.
    """
    ports = {port.name for port in (*part.ports, *part.inner_ports())}
    for symbol in dict.fromkeys(symbol for template in templates for symbol in template.reads):
        kind, name = named_in(symbol)
        if kind == "across" and name not in ports:
            raise ValueError(f"a law reads across_of({name!r}), but the part has no such port")
        if kind in ("through", "integral") and not any(_stands_for(template, kind, name) for template in templates):
            what = "spring or inductor" if kind == "through" else "branch between two nodes"
            raise ValueError(f"a law reads {kind}_of({name!r}), but the part has no {what} of that label")
