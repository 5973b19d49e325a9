"""The second-order form of a mechanical network: M phi'' + D phi' + K phi = T.

The coordinates are the angles and positions of nodes that couplings and prescribed speeds leave free, counted from the
untwisted position. A node without inertia keeps its coordinate: its row of M is empty.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

from sympy import Add, Expr, Integer, Mul, Symbol

from shaftwork.components.branches import ACROSS, INTEGRAL
from shaftwork.components.law_slopes import jumps, slope
from shaftwork.components.laws import t as TIME
from shaftwork.core.domains import ELECTRICAL
from shaftwork.core.errors import CompileError
from shaftwork.equations.coordinates import coordinates, shortest
from shaftwork.equations.quantities import INSTEAD, Quantities, rate_of, refuse_controlled
from shaftwork.network.graph import CircuitGraph, GraphBranch
from shaftwork.network.kinds import Kind

Entries = Mapping[tuple[int, int], Expr]


@dataclass(frozen=True, eq=False)
class SecondOrder:
    """M phi'' + D phi' + K phi = T.

    Args:
        nodes: names of the nodes whose angle or position is a coordinate.
        coordinates: their symbols.
        mass: nonzero entries of M by row and column; row by row, columns rising.
        damping: those of D.
        stiffness: those of K.
        forces: T; the torques and forces of laws and sources stand in it by their symbols.
        laws: those torques and forces in terms of the coordinates and their rates.
        across: what is across those laws, and its integral, in terms of the coordinates and their rates.
        prescribed: speed of every prescribed angle or position that `forces` contains.
    """

    nodes: tuple[str, ...]
    coordinates: tuple[Symbol, ...]
    mass: Entries
    damping: Entries
    stiffness: Entries
    forces: tuple[Expr, ...]
    laws: Mapping[Symbol, Expr]
    across: Mapping[Symbol, Expr]
    prescribed: Mapping[Symbol, Expr]

    @cached_property
    def velocities(self) -> tuple[Symbol, ...]:
        """The rates of the coordinates."""
        return tuple(map(rate_of, self.coordinates))

    @cached_property
    def accelerations(self) -> tuple[Symbol, ...]:
        """The second derivatives of the coordinates."""
        return tuple(map(rate_of, self.velocities))

    def terms(self, row: int) -> Iterator[Expr]:
        """The terms of a row of M phi'' + D phi' + K phi."""
        pairs = ((self.mass, self.accelerations), (self.damping, self.velocities), (self.stiffness, self.coordinates))
        for entries, factors in pairs:
            for (i, j), entry in entries.items():
                if i == row:
                    yield entry * factors[j]

    def residual(self, row: int) -> Expr:
        """M phi'' + D phi' + K phi - T of a row, with the laws put in; zero along every motion."""
        return Add(*self.terms(row)) - self.forces[row].xreplace(dict(self.laws))


def second_order(graph: CircuitGraph) -> SecondOrder:
    """The second-order form of a network of rotating and translating parts.

    Raises:
        CompileError: the network has electrical nodes; their equations are of first order. Or a law reads others.
    """
    electrical = [name for name, domain in zip(graph.nodes, graph.domains, strict=True) if domain is ELECTRICAL]
    if electrical:
        raise CompileError(
            f"The second-order form is for mechanical networks, but '{graph.name}' has the electrical nodes "
            f"{', '.join(electrical[:6])}{', ...' if len(electrical) > 6 else ''}.{INSTEAD}"
        )
    refuse_controlled(graph)
    return _SecondOrderWriter(graph).second_order()


class _SecondOrderWriter:
    def __init__(self, graph: CircuitGraph) -> None:
        self.graph, self.quantities = graph, Quantities(graph)
        self.at = coordinates(self.quantities)
        self.place = {symbol: k for k, symbol in enumerate(self.at.symbols)}
        self.moving = frozenset((*self.place, *self.at.prescribed))
        self.matrices: dict[Kind, dict[tuple[int, int], list[Expr]]] = {
            kind: {} for kind in (Kind.ACROSS_STORE, Kind.CONDUCTANCE, Kind.THROUGH_STORE)
        }
        self.forces: list[list[Expr]] = [[] for _ in self.place]
        self.laws: dict[Symbol, Expr] = {}
        self.across: dict[Symbol, Expr] = {}
        self.prescribed: dict[Symbol, Expr] = {}

    def second_order(self) -> SecondOrder:
        for branch in self.graph.branches:
            if branch.template.kind in self.matrices:
                self._add_linear(branch, branch.template.kind, self.quantities.law(branch.index))
            elif branch.template.kind in (Kind.LAW, Kind.THROUGH_SOURCE):
                self._add_force(branch)
        mass, damping, stiffness = (
            {key: total for key in sorted(entries) if (total := Add(*entries[key])) != 0}
            for entries in self.matrices.values()
        )
        nodes = tuple(self.graph.nodes[node] for node in self.at.free)
        forces = tuple(Add(*terms) for terms in self.forces)
        return SecondOrder(
            nodes, tuple(self.place), mass, damping, stiffness, forces, self.laws, self.across, self.prescribed
        )

    def _parted(self, position: Expr) -> tuple[dict[int, Expr], list[Expr]]:
        """A position as factors of the coordinates by their places, in shortest form, and the terms prescribed."""
        factors: dict[Symbol, Expr] = {}
        for term in Add.make_args(position):
            for symbol in term.free_symbols & self.moving:  # one: positions are linear
                factor = Mul(*(other for other in Mul.make_args(term) if other != symbol))
                factors[symbol] = factors.get(symbol, Integer(0)) + factor
        short = {symbol: gain for symbol, factor in factors.items() if (gain := shortest(factor)) != 0}
        gains = {self.place[symbol]: gain for symbol, gain in short.items() if symbol in self.place}
        prescribed = {symbol: speed for symbol, speed in self.at.prescribed.items() if symbol in short}
        self.prescribed |= prescribed
        return dict(sorted(gains.items())), [short[symbol] * symbol for symbol in prescribed]

    def _add_linear(self, branch: GraphBranch, kind: Kind, coefficient: Expr) -> None:
        """Add coefficient * f f' for an inertia, a damping or a stiffness; what a prescribed motion asks goes to T."""
        gains, driven = self._parted(self.at.twist(branch))
        if kind is not Kind.THROUGH_STORE:
            driven = list(map(self.at.rate, driven))
        if kind is Kind.ACROSS_STORE:
            driven = list(map(self.at.rate, driven))
        for i, gain in gains.items():
            for j, other in gains.items():
                self.matrices[kind].setdefault((i, j), []).append(gain * coefficient * other)
            self.forces[i] += (-gain * coefficient * term for term in driven)

    def _add_force(self, branch: GraphBranch) -> None:
        """Add the torque of a law or source to the coordinates that it drives: minus its power per speed.

        A law that is linear in the twist, as that of a gap in contact, is a stiffness, and what is left a torque.
        """
        law, whole = self.quantities.law(branch.index), True
        if (stiffness := linear_stiffness(law)) != 0:
            self._add_linear(branch, Kind.THROUGH_STORE, stiffness)
            law, whole = law.subs(INTEGRAL, 0), False
            if law == 0:
                return
        at, flow = self.at, self.quantities.flow_of[branch.index]
        gains, driven = self._parted(at.twist(branch))
        twist = Add(*(gain * at.symbols[k] for k, gain in gains.items()), *driven)
        across = Add(*(gain * at.velocities[k] for k, gain in gains.items()), *map(at.rate, driven))
        law = law.xreplace({ACROSS: across, INTEGRAL: twist})
        symbol = self.quantities.across((branch.plus, branch.minus))
        for letter in symbol.free_symbols:  # one at most: the across variable of two nodes has one symbol
            self.across[letter] = across * symbol.coeff(letter)
        self.across[self.quantities.integral(branch.index)] = twist
        if whole and len(flow.branches) == 1:
            symbol = self.quantities.through(flow)
            if symbol != flow.sign * law:
                self.laws[symbol] = flow.sign * law
            law = flow.sign * symbol
        for i, gain in gains.items():
            self.forces[i].append(-gain * law)


def linear_stiffness(law: Expr) -> Expr:
    """The slope of a law over the twist where it is the same everywhere, else 0."""
    if not law.has(INTEGRAL) or jumps(law, INTEGRAL):
        return Integer(0)
    stiffness = slope(law, INTEGRAL)
    return Integer(0) if stiffness.has(ACROSS, INTEGRAL, TIME) else stiffness
