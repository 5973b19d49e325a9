"""The second-order form of a mechanical network: M phi'' + D phi' + K phi = T.

The coordinates are the angles and positions of nodes that couplings and prescribed speeds leave free, counted from the
untwisted position. A node without inertia keeps its coordinate: its row of M is empty.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

from sympy import Add, Expr, Integer, Symbol

from shaftwork.components.branches import ACROSS, INTEGRAL
from shaftwork.components.laws import t as TIME
from shaftwork.components.slopes import jumps, slope
from shaftwork.core.domains import ELECTRICAL
from shaftwork.core.errors import CompileError
from shaftwork.equations.quantities import INSTEAD, Quantities, rate_of, refuse_controlled
from shaftwork.network.graph import GROUND, CircuitGraph
from shaftwork.network.kinds import Kind
from shaftwork.reduction.gains import Number, add, divide, simplified
from shaftwork.reduction.tree import column_of

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
    return _SecondOrderWriter(graph).made()


class _Positions:
    """Positions of all nodes in terms of free nodes and prescribed positions (`~branch`)."""

    def __init__(self, graph: CircuitGraph) -> None:
        self.solved: dict[int, dict[int, Number]] = {}
        stores = (b for b in graph.branches if b.template.kind is Kind.ACROSS_STORE and GROUND in (b.plus, b.minus))
        self.heavy = frozenset(max(branch.plus, branch.minus) for branch in stores)
        for branch in graph.branches:
            if branch.terms or branch.template.kind is Kind.ACROSS_SOURCE:
                column = column_of(graph, branch)
                self._impose(column if branch.terms else {**column, ~branch.index: -1})

    def reduce(self, column: Mapping[int, Number]) -> dict[int, Number]:
        """A sum of positions in terms of free ones."""
        result: dict[int, Number] = {}
        for node, factor in column.items():
            for key, entry in self.solved.get(node, {node: 1}).items():
                product = factor * entry
                total = add(result[key], product, []) if key in result else product
                if isinstance(total, int) and total == 0:
                    result.pop(key, None)
                else:
                    result[key] = total
        return result

    def _impose(self, column: Mapping[int, Number]) -> None:
        """Let the sum of the column be zero: solve for a node without inertia if there is one, else for the last."""
        reduced = self.reduce(column)
        if not (free := [key for key in reduced if key >= 0]):
            return
        pivot = max(free, key=lambda node: (node not in self.heavy, node))
        factor = reduced.pop(pivot)
        self.solved[pivot] = {key: divide(-entry, factor) for key, entry in reduced.items()}
        self.solved.update({node: self.reduce(row) for node, row in self.solved.items() if pivot in row})


class _SecondOrderWriter:
    def __init__(self, graph: CircuitGraph) -> None:
        self.graph, self.quantities = graph, Quantities(graph)
        self.positions = _Positions(graph)
        self.free = tuple(node for node in range(len(graph.nodes)) if node not in self.positions.solved)
        self.place = {node: k for k, node in enumerate(self.free)}
        self.coordinates = tuple(map(self.quantities.angle, self.free))
        self.matrices: dict[Kind, dict[tuple[int, int], list[Expr]]] = {
            kind: {} for kind in (Kind.ACROSS_STORE, Kind.CONDUCTANCE, Kind.THROUGH_STORE)
        }
        self.forces: list[list[Expr]] = [[] for _ in self.free]
        self.laws: dict[Symbol, Expr] = {}
        self.across: dict[Symbol, Expr] = {}
        self.prescribed: dict[Symbol, Expr] = {}

    def made(self) -> SecondOrder:
        for branch in self.graph.branches:
            if branch.template.kind in self.matrices:
                self._add_linear(branch.index, branch.template.kind, self.quantities.law(branch.index))
            elif branch.template.kind in (Kind.LAW, Kind.THROUGH_SOURCE):
                self._add_force(branch.index)
        mass, damping, stiffness = (
            {key: total for key in sorted(entries) if (total := Add(*entries[key])) != 0}
            for entries in self.matrices.values()
        )
        nodes = tuple(self.graph.nodes[node] for node in self.free)
        forces = tuple(Add(*terms) for terms in self.forces)
        return SecondOrder(
            nodes, self.coordinates, mass, damping, stiffness, forces, self.laws, self.across, self.prescribed
        )

    def _twist(self, branch: int) -> tuple[dict[int, Expr], dict[int, Expr]]:
        """The position across a branch: factors of coordinates by place, and of prescribed positions by branch."""
        made = self.graph.branches[branch]
        row = self.positions.reduce(column_of(self.graph, made))
        factors = dict(zip(sorted(row), simplified(row[key] for key in sorted(row)), strict=True))
        own = {self.place[key]: factor for key, factor in factors.items() if key >= 0}
        return own, {~key: factor for key, factor in factors.items() if key < 0}

    def _add_linear(self, branch: int, kind: Kind, coefficient: Expr) -> None:
        """Add coefficient * f f' for an inertia, a damping or a stiffness; what a prescribed motion asks goes to T."""
        own, driven = self._twist(branch)
        for i, gain in own.items():
            for j, other in own.items():
                self.matrices[kind].setdefault((i, j), []).append(gain * coefficient * other)
            for source, factor in driven.items():
                self.forces[i].append(-gain * coefficient * factor * self._motion(source)[kind])

    def _motion(self, source: int) -> dict[Kind, Expr]:
        """Acceleration, speed and position of a prescribed motion."""
        speed, position = self.quantities.law(source), self.quantities.integral(source)
        self.prescribed[position] = speed
        return {Kind.ACROSS_STORE: speed.diff(TIME), Kind.CONDUCTANCE: speed, Kind.THROUGH_STORE: position}

    def _add_force(self, branch: int) -> None:
        """Add the torque of a law or source to the coordinates that it drives: minus its power per speed.

        A law that is linear in the twist, as that of a gap in contact, is a stiffness, and what is left a torque.
        """
        law, whole = self.quantities.law(branch), True
        if (stiffness := linear_stiffness(law)) != 0:
            self._add_linear(branch, Kind.THROUGH_STORE, stiffness)
            law, whole = law.subs(INTEGRAL, 0), False
            if law == 0:
                return
        own, driven = self._twist(branch)
        rates = (gain * rate_of(self.coordinates[k]) for k, gain in own.items())
        across = Add(*rates, *(gain * self._motion(source)[Kind.CONDUCTANCE] for source, gain in driven.items()))
        angles = (gain * self.coordinates[k] for k, gain in own.items())
        twist = Add(*angles, *(gain * self._motion(source)[Kind.THROUGH_STORE] for source, gain in driven.items()))
        law = law.xreplace({ACROSS: across, INTEGRAL: twist})
        made, flow = self.graph.branches[branch], self.quantities.flow_of[branch]
        symbol = self.quantities.across((made.plus, made.minus))
        for letter in symbol.free_symbols:  # one at most: the across variable of two nodes has one symbol
            self.across[letter] = across * symbol.coeff(letter)
        self.across[self.quantities.integral(branch)] = twist
        if whole and len(flow.branches) == 1:
            symbol = self.quantities.through(flow)
            if symbol != flow.sign * law:
                self.laws[symbol] = flow.sign * law
            law = flow.sign * symbol
        for i, gain in own.items():
            self.forces[i].append(-gain * law)


def linear_stiffness(law: Expr) -> Expr:
    """The slope of a law over the twist where it is the same everywhere, else 0."""
    if not law.has(INTEGRAL) or jumps(law, INTEGRAL):
        return Integer(0)
    made = slope(law, INTEGRAL)
    return Integer(0) if made.has(ACROSS, INTEGRAL, TIME) else made
