"""Generalised coordinates of a network: positions that move freely, and all other quantities by them and their rates.

They come from the couplings and prescribed speeds by linear algebra over the ratios, not from the normal tree.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from sympy import Add, Expr, Float, Integer, Symbol, cancel
from sympy.polys.matrices import DomainMatrix

from shaftwork.components.branches import ACROSS, INTEGRAL
from shaftwork.components.laws import t as TIME
from shaftwork.equations.assembly import tidy
from shaftwork.equations.quantities import Quantities, ThroughQuantity, rate_of
from shaftwork.formulation.gains import exactly, in_decimals
from shaftwork.network.graph import GROUND, CircuitGraph, GraphBranch
from shaftwork.network.kinds import Kind
from shaftwork.numerics.tolerances import TYPED

Row = dict[int, Expr]


@dataclass(frozen=True, eq=False)
class Coordinates:
    """The free nodes of a network, and every position, speed and torque in terms of them.

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
        return {self.quantities.integral(source.index): self.quantities.law(source.index) for source in sources}

    @cached_property
    def _rates(self) -> dict[Symbol, Expr]:
        first = zip((*self.symbols, *self.velocities), (*self.velocities, *self.accelerations), strict=True)
        return {**dict(first), **self.prescribed}

    def rate(self, expression: Expr) -> Expr:
        """The time derivative of a sum of functions of time and of what is linear in coordinates and their rates."""
        moving = self._rates.keys()
        return Add(
            *(
                term.diff(TIME) if moving.isdisjoint(term.free_symbols) else term.xreplace(self._rates)
                for term in Add.make_args(expression)
            )
        )

    def across(self, plus: int, minus: int) -> Expr:
        """The position of a node less that of another, each coordinate once with its factor in shortest form."""
        factors: dict[Symbol, list[Expr]] = {}
        for term in Add.make_args(self.positions[plus] - self.positions[minus]):
            for symbol in term.free_symbols & self._rates.keys():  # one: positions are linear
                factors.setdefault(symbol, []).append(term.coeff(symbol))
        return Add(*(tidy(symbol * (_shortest(Add(*of)) if len(of) > 1 else of[0])) for symbol, of in factors.items()))

    def twist(self, branch: GraphBranch) -> Expr:
        """The position across a branch."""
        return self.across(branch.plus, branch.minus)

    def speed(self, branch: GraphBranch) -> Expr:
        """The speed across a branch."""
        return self.rate(self.twist(branch))

    def summed(self, branch: GraphBranch, terms: Iterable[tuple[Expr, int, int]]) -> Expr:
        """The sum of factor times position over the terms of a coupling."""
        placed = ((self.quantities.graph.in_network_symbols(factor, branch), ends) for factor, *ends in terms)
        return Add(*(factor * self.across(*ends) for factor, ends in placed))

    def of(self, law: Expr) -> Expr:
        """A law that reads other quantities of the network."""
        return law.xreplace(self._readable)

    def by_law(self, branch: GraphBranch, law: Expr) -> Expr:
        """What a branch lets through by a law of what is across it."""
        return self.of(law.xreplace({ACROSS: self.speed(branch), INTEGRAL: self.twist(branch)}))

    def through(self, branch: GraphBranch) -> Expr:
        """What a branch lets through: store, loss, law or source of torque."""
        law = self.quantities.law(branch.index)
        match branch.template.kind:
            case Kind.THROUGH_STORE:
                return law * self.twist(branch)
            case Kind.CONDUCTANCE:
                return law * self.speed(branch)
        return self.by_law(branch, law)

    def of_flows(self, flows: Iterable[ThroughQuantity]) -> dict[Symbol, Expr]:
        """What parts let through by their laws; what prescribes a speed lets through whatever it takes."""
        through: dict[Symbol, Expr] = {}
        for flow in flows:
            branches = [self.quantities.graph.branches[index] for index in flow.branches]
            if branches[0].template.kind is not Kind.ACROSS_SOURCE:
                through[self.quantities.through(flow)] = flow.sign * Add(*map(self.through, branches))
        return {symbol: law for symbol, law in through.items() if symbol not in self._parameters}

    @cached_property
    def motion(self) -> dict[Symbol, Expr]:
        """Speeds, angles, twists and torques of springs, and their rates, by their symbols."""
        motion = dict(self._readable)
        pairs = {pair.symbol: self.rate(self.across(*ends)) for ends, pair in self.quantities.pairs.items()}
        speeds = self._speeds | pairs
        motion |= {symbol: speed for symbol, speed in speeds.items() if symbol not in self._parameters}
        motion |= {rate_of(symbol): self.rate(speed) for symbol, speed in speeds.items()}
        for branch in self.quantities.graph.branches:
            if branch.template.kind is Kind.THROUGH_STORE:
                stiffness = self.quantities.law(branch.index)
                motion[rate_of(self.quantities.store(branch.index))] = stiffness * self.speed(branch)
        motion |= {rate_of(symbol): self.rate(position) for symbol, position in self._integrals.items()}
        return motion

    @cached_property
    def _integrals(self) -> dict[Symbol, Expr]:
        """The twists that laws read, but for those that are prescribed."""
        graph = self.quantities.graph
        numbers = (index for part in graph.integrated for index in part)
        branches = [branch for branch in map(graph.branches.__getitem__, numbers) if not is_prescribed(branch)]
        return {self.quantities.integral(branch.index): self.twist(branch) for branch in branches}

    @cached_property
    def _parameters(self) -> frozenset[Symbol]:
        """Symbols of quantities that are parameters, as a prescribed speed that is a number."""
        return frozenset(Symbol(name, real=True) for name in self.quantities.graph.parameters)

    @cached_property
    def _speeds(self) -> dict[Symbol, Expr]:
        numbers = range(len(self.quantities.graph.nodes))
        return {self.quantities.node(k): self.rate(self.positions[k]) for k in numbers}

    @cached_property
    def _readable(self) -> dict[Symbol, Expr]:
        """What laws may read: speeds of nodes, twists of branches and torques of springs."""
        readable = {symbol: speed for symbol, speed in self._speeds.items() if symbol not in self._parameters}
        readable |= {self.quantities.angle(k): position for k, position in self.positions.items() if k >= 0}
        readable |= self._integrals
        for branch in self.quantities.graph.branches:
            if branch.template.kind is Kind.THROUGH_STORE:
                readable[self.quantities.store(branch.index)] = self.through(branch)
        return {symbol: expression for symbol, expression in readable.items() if symbol != expression}


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
    constraints = {branch.index: _row(graph, branch) for branch in (*imposing, *also)}
    imposed = _independent(constraints, graph.parameters)
    rows = [constraints[index] for index in imposed]
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
    independent: list[int] = []
    directions = np.zeros((0, len(place)))
    for index, row in rows.items():
        new = np.zeros(len(place))
        for node, factor in row.items():
            if node >= 0:
                new[place[node]] = float(factor.xreplace(values))
        size = np.linalg.norm(new)
        for _ in range(2):  # twice is enough to be orthogonal to rounding
            new -= directions.T @ (directions @ new)
        if (rest := np.linalg.norm(new)) > TYPED * size:
            independent.append(index)
            directions = np.vstack((directions, new / rest))
    return tuple(independent)


def _shortest(ratio: Expr) -> Expr:
    """A ratio without common factors above and below; decimals are rounded only once."""
    return ratio if ratio.is_Integer else in_decimals(cancel(exactly(ratio)))


def _solved(rows: Sequence[Row], columns: Sequence[int]) -> Iterator[tuple[int, Row]]:
    """The leading node of each row after elimination, and the sum of the others that its position is."""
    if not rows:
        return
    place = {key: k for k, key in enumerate(columns)}
    entries = {i: {place[key]: exactly(factor) for key, factor in row.items()} for i, row in enumerate(rows)}
    reduced, pivots = DomainMatrix.from_dict_sympy(len(rows), len(columns), entries).to_field().rref()
    for i, row in sorted(reduced.to_dod().items()):
        pivot = columns[pivots[i]]
        factors = {columns[k]: _shortest(-reduced.domain.to_sympy(entry)) for k, entry in row.items()}
        yield pivot, {key: factor for key, factor in factors.items() if key != pivot}
