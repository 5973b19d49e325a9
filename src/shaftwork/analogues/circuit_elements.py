"""The elements of a network, one for each branch: what they are called, their values and their places."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from sympy import Expr, Float

from shaftwork.components.laws import replaced
from shaftwork.network.graph import GROUND, CircuitGraph, GraphBranch, GraphPart, ends_of
from shaftwork.network.kinds import Kind
from shaftwork.network.netlist import REFERENCE, unused

Edge = tuple[int, int]
"""A branch and the number of its term, as `CircuitGraph.multigraph` keys them."""
Sum = dict[str, float]
"""A sum of quantities: the factor of each by name."""


@dataclass(frozen=True)
class Element:
    """A branch with its numbers.

    Args:
        name: of the part that is made of it; that of its own part, where this has no other element.
        symbol: of its own part, where it has the name of that.
        kind: what its law is.
        value: capacity, stiffness or conductance; of a law or source the number or expression of what
            passes, or is across; None of what passes one way alone.
        terms: of a coupling the factor of each term; else (1,).
        edges: its keys in the graph, one for each term.
        ends: the names of the nodes of each term.
        back: what passes backward, where that is another law; else None.
    """

    name: str
    symbol: str | None
    kind: Kind
    value: Any
    terms: tuple[float, ...]
    edges: tuple[Edge, ...]
    ends: tuple[tuple[str, str], ...]
    back: Any = None


class ElementNames:
    """Names for elements and nodes that no part and no other element has.

    Args:
        graph: of the network.
    """

    def __init__(self, graph: CircuitGraph) -> None:
        self._graph = graph
        self._taken = {part.name for part in graph.parts}  # only asked for membership
        # a spring has omega_rel beside the omega of a node of its name; in a circuit both are u
        self._elsewhere = {part.name: {*part.nodes.values()} - {GROUND} for part in graph.parts}

    def node(self, number: int) -> str:
        """The name of a node; one inside a part loses its dot, which marks those alone."""
        if number == GROUND:
            return REFERENCE
        name = self._graph.nodes[number]
        owner, _, inner = name.rpartition(".")
        if owner in self._taken:
            return f"{owner} {inner}"
        return f"{name} node" if self._elsewhere.get(name, {number}) != {number} else name

    def mesh(self, number: int) -> str:
        """The name of a node of the dual; number 0 is its reference."""
        name = f"mesh {number}"
        return REFERENCE if number == 0 else f"{name} node" if name in self._taken else name

    def of_branches(self, part: GraphPart, kept: int) -> Iterator[str]:
        """A name for each branch of a part: its own for one of them, with the letter of the law behind it for others.

        Args:
            part: the part.
            kept: the place of the branch that has the name of the part.
        """
        for place, index in enumerate(part.branches):
            if place == kept:
                yield part.name
                continue
            template = self._graph.branches[index].template
            letter = template.symbols[0].name if len(template.symbols) == 1 else template.label or str(place + 1)
            yield self.unique(f"{part.name} {letter}")

    def unique(self, name: str) -> str:
        """A name, or one with a number where that is taken; it is taken from then on."""
        name = unused(name, self._taken)
        self._taken.add(name)
        return name


def is_linear(part: GraphPart, graph: CircuitGraph) -> bool:
    """Whether all that a part is made of are stores, losses, sources over time and couplings, for good."""
    templates = [graph.branches[index].template for index in part.branches]
    return not part.modes and all(
        template.kind is not Kind.LAW and not template.reads and template.line is None and not template.through
        for template in templates
    )


def elements_of(part: GraphPart, graph: CircuitGraph, names: ElementNames) -> Iterator[Element]:
    """The elements of a part, in the order of its branches; a coupling or a source has the name of the part."""
    branches = [graph.branches[index] for index in part.branches]
    named = [place for place, branch in enumerate(branches) if branch.template.kind in FIRST]
    geared = (place for place in named if len(branches[place].terms) > 1)  # not a resistance that is zero
    first = next(geared, named[0] if named else 0)
    for name, branch in zip(names.of_branches(part, first), branches, strict=True):
        keys, ends = [], []
        for key, plus, minus in ends_of(branch):
            keys.append(key)
            ends.append((names.node(plus), names.node(minus)))
        factors = tuple(float(in_numbers(factor, branch, graph)) for factor, _, _ in branch.terms) or (1.0,)
        value = in_numbers(branch.template.law, branch, graph)
        symbol = part.component.symbol if name == part.name else None
        yield Element(name, symbol, branch.template.kind, value, factors, tuple(keys), tuple(ends))


FIRST = (Kind.COUPLING, Kind.ACROSS_SOURCE, Kind.THROUGH_SOURCE)
"""Kinds of elements that have the name of their part where it has several elements."""


def in_numbers(law: Expr, branch: GraphBranch, graph: CircuitGraph) -> Any:
    """A law with the values of its parameters, or the number that it is."""
    part = graph.parts[branch.part]
    symbols = (symbol for symbol in law.free_symbols if symbol.name in part.parameters)
    value = replaced(law, {symbol: Float(graph.parameters[f"{part.name}.{symbol.name}"]) for symbol in symbols})
    return float(value) if value.is_number else value


def in_letters(value: Any, letters: Mapping[Any, Any]) -> Any:
    """A number, or a law with other letters."""
    return value if isinstance(value, float) else replaced(value, letters)
