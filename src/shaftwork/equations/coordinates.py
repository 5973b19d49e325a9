"""Generalised coordinates of a network: angles, positions and flux linkages that move freely, and all others by them.

They come from the couplings and prescribed speeds by linear algebra over the ratios, not from the normal tree.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from sympy import Add, Expr, Float, Integer, Mul, Symbol, cancel
from sympy.polys.matrices import DomainMatrix

from shaftwork.components.laws import t as TIME
from shaftwork.equations.quantities import Quantities, rate_of
from shaftwork.network.graph import GROUND, CircuitGraph, GraphBranch
from shaftwork.network.kinds import Kind
from shaftwork.reduction.gains import exactly, in_decimals

INDEPENDENT = 1e-9
"""A coupling whose row is within this of the rows before it, in units of its own length, says nothing new."""
Row = dict[int, Expr]


@dataclass(frozen=True, eq=False)
class Coordinates:
    """The free nodes of a network, and where every node is in terms of them.

    Args:
        quantities: the symbols of the network.
        free: numbers of the nodes whose angle, position or flux linkage is a coordinate.
        positions: that of every node, in coordinates and in prescribed ones.
        imposed: numbers of the couplings and prescribed speeds that fix the others, without those that repeat them.
    """

    quantities: Quantities
    free: tuple[int, ...]
    positions: Mapping[int, Expr]
    imposed: tuple[int, ...]

    @cached_property
    def symbols(self) -> tuple[Symbol, ...]:
        """The coordinates."""
        return tuple(map(self.quantities.angle, self.free))

    @cached_property
    def velocities(self) -> tuple[Symbol, ...]:
        """Their rates."""
        return tuple(map(rate_of, self.symbols))

    @cached_property
    def accelerations(self) -> tuple[Symbol, ...]:
        """Their second derivatives."""
        return tuple(map(rate_of, self.velocities))

    @cached_property
    def prescribed(self) -> dict[Symbol, Expr]:
        """The speed of every prescribed angle or position."""
        sources = filter(is_prescribed, self.quantities.graph.branches)
        return {self.quantities.integral(made.index): self.quantities.law(made.index) for made in sources}

    @cached_property
    def _rates(self) -> dict[Symbol, Expr]:
        first = zip((*self.symbols, *self.velocities), (*self.velocities, *self.accelerations), strict=True)
        return {**dict(first), **self.prescribed}

    def rate(self, expression: Expr) -> Expr:
        """The time derivative, by the chain rule."""
        return Add(*map(self._rate_of, Add.make_args(expression)))

    def _rate_of(self, term: Expr) -> Expr:
        moving = [symbol for symbol in term.free_symbols if symbol in self._rates]
        if len(moving) == 1 and moving[0] in Mul.make_args(term) and TIME not in term.free_symbols:
            # what is linear has the rate in place of the position; sympy would go through the product rule
            constant = Mul(*(factor for factor in Mul.make_args(term) if factor != moving[0]))
            if moving[0] not in constant.free_symbols:
                return constant * self._rates[moving[0]]
        return Add(*(term.diff(symbol) * self._rates[symbol] for symbol in moving), term.diff(TIME))

    def across(self, plus: int, minus: int) -> Expr:
        """The position of a node less that of another."""
        return self.positions[plus] - self.positions[minus]


def is_prescribed(branch: GraphBranch) -> bool:
    """Whether a branch prescribes a speed or voltage over time alone; what reads others is no matter of positions."""
    return branch.template.kind is Kind.ACROSS_SOURCE and not branch.template.reads


def is_workless(branch: GraphBranch) -> bool:
    """Whether a branch is a coupling whose reactions do no work."""
    return bool(branch.terms) and not branch.template.through


def coordinates(quantities: Quantities, also: Sequence[GraphBranch] = ()) -> Coordinates:
    """The coordinates of a network.

    Nodes without inertia are solved for first, and of two nodes the one named later.

    Args:
        quantities: the symbols of the network.
        also: couplings that lose power, to be taken into account like others.
    """
    graph = quantities.graph
    heavy = {
        max(branch.plus, branch.minus)
        for branch in graph.branches
        if branch.template.kind is Kind.ACROSS_STORE and GROUND in (branch.plus, branch.minus)
    }
    order = sorted(range(len(graph.nodes)), key=lambda node: (node in heavy, -node))
    imposing = [branch for branch in graph.branches if is_workless(branch) or is_prescribed(branch)]
    made = {branch.index: _row(graph, branch) for branch in (*imposing, *also)}
    imposed = _independent(made, graph.parameters)
    rows = [made[index] for index in imposed]
    symbols: dict[int, Expr] = {node: quantities.angle(node) for node in order}
    driven = {key: quantities.integral(~key) for row in rows for key in row if key < 0}
    solved = {
        node: Add(*(factor * (symbols | driven)[key] for key, factor in row.items()))
        for node, row in _solved(rows, (*symbols, *driven))
    }
    free = tuple(node for node in range(len(order)) if node not in solved)
    return Coordinates(quantities, free, {GROUND: Integer(0), **symbols, **solved}, imposed)


def _row(graph: CircuitGraph, branch: GraphBranch) -> Row:
    """A sum of positions that is zero: factors by node, that of a prescribed one under the complement of its branch."""
    row: Row = {} if branch.terms else {~branch.index: Integer(-1)}
    for coefficient, plus, minus in branch.terms or ((Integer(1), branch.plus, branch.minus),):
        factor = graph.in_network_symbols(coefficient, branch)
        for node, sign in ((plus, 1), (minus, -1)):
            if node != GROUND:
                row[node] = row.get(node, Integer(0)) + sign * factor
    return row


def _independent(rows: Mapping[int, Row], parameters: Mapping[str, float]) -> tuple[int, ...]:
    """The numbers of the rows that say something new about the nodes for the given values of the ratios."""
    values = {Symbol(name, real=True): Float(value) for name, value in parameters.items()}
    place = {node: k for k, node in enumerate(dict.fromkeys(key for row in rows.values() for key in row if key >= 0))}
    kept: list[int] = []
    directions = np.zeros((0, len(place)))
    for index, row in rows.items():
        new = np.zeros(len(place))
        for node, factor in row.items():
            if node >= 0:
                new[place[node]] = float(factor.xreplace(values))
        size = np.linalg.norm(new)
        for _ in range(2):  # twice is enough to be orthogonal to rounding
            new -= directions.T @ (directions @ new)
        if (rest := np.linalg.norm(new)) > INDEPENDENT * size:
            kept.append(index)
            directions = np.vstack((directions, new / rest))
    return tuple(kept)


def shortest(ratio: Expr) -> Expr:
    """A ratio without common factors above and below; decimals are rounded only once."""
    return in_decimals(cancel(exactly(ratio)))


def _solved(rows: Sequence[Row], columns: Sequence[int]) -> Iterator[tuple[int, Row]]:
    """The leading node of each row after elimination, and the sum of the others that its position is."""
    if not rows:
        return
    place = {key: k for k, key in enumerate(columns)}
    entries = {i: {place[key]: exactly(factor) for key, factor in row.items()} for i, row in enumerate(rows)}
    reduced, pivots = DomainMatrix.from_dict_sympy(len(rows), len(columns), entries).to_field().rref()
    for i, made in sorted(reduced.to_dod().items()):
        found = {columns[k]: shortest(-reduced.domain.to_sympy(entry)) for k, entry in made.items()}
        del found[columns[pivots[i]]]
        yield columns[pivots[i]], found
