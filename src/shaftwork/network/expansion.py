"""Long shafts written out part by part: the chain that the array stands for, as a network of its own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from sympy import Expr

from shaftwork.components.base import Component
from shaftwork.components.mechanics import Damper, Inertia, Spring
from shaftwork.components.shaft_models import Rigid
from shaftwork.components.shafts import Shaft
from shaftwork.core.errors import ParameterError
from shaftwork.network.graph import GROUND, CircuitGraph, GraphBranch, GraphPart
from shaftwork.network.kinds import Kind
from shaftwork.network.netlist import REFERENCE, Netlist, Placed


def expanded(netlist: Netlist, graph: CircuitGraph) -> Netlist:
    """The network with an inertia, a spring or a damper for everything inside its shafts; rigid ones are as they were.

    Args:
        netlist: of the network.
        graph: of the same network.

    Raises:
        ParameterError: a shaft is no chain of springs.
    """
    placed: list[Placed] = []
    for item, part in zip(netlist.placed, graph.parts, strict=True):
        placed += _chain(item, part, graph)
    return replace(netlist, placed=tuple(placed))


def _chain(item: Placed, part: GraphPart, graph: CircuitGraph) -> list[Placed]:
    """The parts of a shaft, from its first end to its second; any other part as it is."""
    if not isinstance(item.part, Shaft) or isinstance(item.part.resolved, Rigid):
        return [item]
    name, branches = item.part.name, [graph.branches[k] for k in part.branches]
    if any(branch.terms or branch.template.line is not None for branch in branches):
        raise ParameterError(
            f"Shaft '{name}': model={item.part.values['model']!r} is no chain of springs, so it cannot be written out "
            "part by part. Lumped(m) can."
        )
    names = {GROUND: REFERENCE}
    for number, node in enumerate(graph.nodes):  # its ends keep their names: other parts are there
        names[number] = node if node in item.nodes else f"{name} {node.removeprefix(f'{name}.')}"
    coefficients = _coefficients(branches, graph)
    joined: dict[tuple[int, int], dict[Kind, float]] = {}
    for branch in branches:
        here = joined.setdefault((branch.plus, branch.minus), {})
        here[branch.template.kind] = here.get(branch.template.kind, 0.0) + coefficients[branch.index]
    return [
        Placed(component, (names[plus],) if isinstance(component, Inertia) else (names[plus], names[minus]))
        for (plus, minus), laws in joined.items()
        for component in _parts(item.part, names[plus], names[minus], laws)
    ]


def _parts(whole: Shaft, plus: str, minus: str, laws: Mapping[Kind, float]) -> Iterator[Component]:
    shaft = whole.name
    here = plus.removeprefix(f"{shaft} ")
    symbol = f"{shaft if whole.symbol is None else whole.symbol},{here}"
    stiffness, damping = laws.get(Kind.THROUGH_STORE), laws.get(Kind.CONDUCTANCE)
    if (inertia := laws.get(Kind.ACROSS_STORE)) is not None:
        yield Inertia(f"{shaft} J {here}", symbol=symbol, J=inertia)
    if stiffness is not None:
        yield Spring(f"{shaft} c {here}", symbol=symbol, c=stiffness, d=damping or 0.0)
    elif damping is not None:
        to = "" if minus == REFERENCE else f" {minus.removeprefix(f'{shaft} ')}"
        yield Damper(f"{shaft} d {here}{to}", symbol=f"bearing,{symbol}" if minus == REFERENCE else symbol, d=damping)


def _coefficients(branches: list[GraphBranch], graph: CircuitGraph) -> dict[int, float]:
    """The value of each branch's capacity, stiffness or conductance; laws that many share are evaluated once."""
    values: dict[Expr, float] = {}
    for branch in branches:
        law = branch.template.law
        if law not in values:
            in_network = graph.in_network_symbols(law, branch)
            values[law] = float(
                in_network.evalf(25, subs={s: graph.parameters[s.name] for s in in_network.free_symbols})
            )
    return {branch.index: values[branch.template.law] for branch in branches}
