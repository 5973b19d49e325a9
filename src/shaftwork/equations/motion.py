"""Every quantity of Kirchhoff's equations in generalised coordinates and their rates."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

from sympy import Add, Expr, Symbol

from shaftwork.components.branches import ACROSS, INTEGRAL
from shaftwork.equations.coordinates import Coordinates, is_prescribed
from shaftwork.equations.quantities import Quantities, ThroughQuantity, rate_of
from shaftwork.network.graph import CircuitGraph, GraphBranch
from shaftwork.network.kinds import Kind


@dataclass(frozen=True, eq=False)
class Motion:
    """Speeds, twists and torques in coordinates.

    Args:
        coordinates: the coordinates.
    """

    coordinates: Coordinates

    @property
    def quantities(self) -> Quantities:
        """The symbols of the network."""
        return self.coordinates.quantities

    @property
    def graph(self) -> CircuitGraph:
        """The circuit graph."""
        return self.quantities.graph

    def twist(self, branch: GraphBranch) -> Expr:
        """The position across a branch."""
        return self.coordinates.across(branch.plus, branch.minus)

    def speed(self, branch: GraphBranch) -> Expr:
        """The speed across a branch."""
        return self.coordinates.rate(self.twist(branch))

    def summed(self, branch: GraphBranch, terms: Iterable[tuple[Expr, int, int]]) -> Expr:
        """The sum of factor times position over the terms of a coupling."""
        placed = ((self.graph.in_network_symbols(factor, branch), ends) for factor, *ends in terms)
        return Add(*(factor * self.coordinates.across(*ends) for factor, ends in placed))

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
        made: dict[Symbol, Expr] = {}
        for flow in flows:
            branches = [self.graph.branches[index] for index in flow.branches]
            if branches[0].template.kind is not Kind.ACROSS_SOURCE:
                made[self.quantities.through(flow)] = flow.sign * Add(*map(self.through, branches))
        return {symbol: law for symbol, law in made.items() if symbol not in self._given}

    @cached_property
    def known(self) -> dict[Symbol, Expr]:
        """Speeds, angles, twists and torques of springs, and their rates."""
        found, rate = dict(self._readable), self.coordinates.rate
        pairs = {pair.symbol: rate(self.coordinates.across(*ends)) for ends, pair in self.quantities.pairs.items()}
        speeds = self._speeds | pairs
        found |= {symbol: speed for symbol, speed in speeds.items() if symbol not in self._given}
        found |= {rate_of(symbol): rate(speed) for symbol, speed in speeds.items()}
        for branch in self.graph.branches:
            if branch.template.kind is Kind.THROUGH_STORE:
                stiffness = self.quantities.law(branch.index)
                found[rate_of(self.quantities.store(branch.index))] = stiffness * self.speed(branch)
        found |= {rate_of(symbol): rate(position) for symbol, position in self._integrals.items()}
        return found

    @cached_property
    def _integrals(self) -> dict[Symbol, Expr]:
        """The twists that laws read, but for those that are prescribed."""
        numbers = (index for part in self.graph.integrated for index in part)
        branches = [made for made in map(self.graph.branches.__getitem__, numbers) if not is_prescribed(made)]
        return {self.quantities.integral(made.index): self.twist(made) for made in branches}

    @cached_property
    def _given(self) -> frozenset[Symbol]:
        """Symbols of quantities that are parameters, as a prescribed speed that is a number."""
        return frozenset(Symbol(name, real=True) for name in self.graph.parameters)

    @cached_property
    def _speeds(self) -> dict[Symbol, Expr]:
        numbers = range(len(self.graph.nodes))
        return {self.quantities.node(k): self.coordinates.rate(self.coordinates.positions[k]) for k in numbers}

    @cached_property
    def _readable(self) -> dict[Symbol, Expr]:
        """What laws may read: speeds of nodes, twists of branches and torques of springs."""
        readable = {symbol: speed for symbol, speed in self._speeds.items() if symbol not in self._given}
        readable |= {self.quantities.angle(k): position for k, position in self.coordinates.positions.items() if k >= 0}
        readable |= self._integrals
        for branch in self.graph.branches:
            if branch.template.kind is Kind.THROUGH_STORE:
                readable[self.quantities.store(branch.index)] = self.through(branch)
        return {symbol: expression for symbol, expression in readable.items() if symbol != expression}
