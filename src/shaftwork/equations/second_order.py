"""Energies, losses and torques in generalised coordinates, and the second-order form M phi'' + D phi' + K phi = T.

The coordinates are the angles and positions of nodes that couplings and prescribed speeds leave free, counted from the
untwisted position. A node without inertia keeps its coordinate: its row of M is empty.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

from sympy import Add, Expr, Integer, Rational, Symbol, expand

from shaftwork.components.branches import ACROSS, INTEGRAL
from shaftwork.components.law_slopes import jumps, slope
from shaftwork.components.laws import t as TIME
from shaftwork.core.domains import ELECTRICAL
from shaftwork.core.errors import CompileError
from shaftwork.equations.assembly import FactoredTerms, rising_first, terms_of, tidy
from shaftwork.equations.coordinates import Coordinates, coordinates
from shaftwork.equations.quantities import INSTEAD, Quantities, refuse_controlled
from shaftwork.network.graph import CircuitGraph, GraphBranch
from shaftwork.network.kinds import Kind

Entries = Mapping[tuple[int, int], Expr]


class Square(NamedTuple):
    """Half of a coefficient times the square of a position or speed: an energy, or half of a loss.

    Attributes:
        branch: number of the branch.
        coefficient: inertia, stiffness or damping.
        along: what is squared.
    """

    branch: int
    coefficient: Expr
    along: Expr

    @property
    def energy(self) -> Expr:
        """The whole term."""
        return Rational(1, 2) * self.coefficient * self.along**2

    def pull(self, symbol: Symbol) -> FactoredTerms:
        """Minus the term differentiated: a torque."""
        return FactoredTerms(tidy(-self.coefficient * self.along.diff(symbol)), rising_first(terms_of(self.along)))


class GeneralisedTorque(NamedTuple):
    """What a branch takes from nodes, and the position on which that does work.

    Args:
        branch: number of the branch.
        size: the torque, force or current.
        along: position across the branch; of a coupling with losses the sum that its torques work on.
    """

    branch: int
    size: Expr
    along: Expr


@dataclass(eq=False)
class Energies:
    """All of them, branch by branch.

    Args:
        at: the coordinates.
        inertias: kinetic energies.
        springs: potential energies, also of laws that are linear in the twist.
        dampers: terms of Rayleigh's function.
        torques: of laws and sources.
        laws: those that stand in `torques` by their symbols, in coordinates and rates.
    """

    at: Coordinates
    inertias: list[Square] = field(default_factory=list)
    springs: list[Square] = field(default_factory=list)
    dampers: list[Square] = field(default_factory=list)
    torques: list[GeneralisedTorque] = field(default_factory=list)
    laws: dict[Symbol, Expr] = field(default_factory=dict)

    def enter(self, branches: Iterable[GraphBranch]) -> None:
        """Put branches down as energies, losses or torques; sources of speed and couplings are none of these."""
        for branch in branches:
            law = self.at.quantities.law(branch.index)
            match branch.template.kind:
                case Kind.ACROSS_STORE:
                    self.inertias.append(Square(branch.index, law, self.at.speed(branch)))
                case Kind.THROUGH_STORE:
                    self.springs.append(Square(branch.index, law, self.at.twist(branch)))
                case Kind.CONDUCTANCE:
                    self.dampers.append(Square(branch.index, law, self.at.speed(branch)))
                case Kind.LAW | Kind.THROUGH_SOURCE:
                    self._enter_law(branch, law)

    def _enter_law(self, branch: GraphBranch, law: Expr) -> None:
        """What is linear in the twist is an energy; what is left a torque, by its symbol where it has one."""
        flow, twist, whole = self.at.quantities.flow_of[branch.index], self.at.twist(branch), True
        if (stiffness := _linear_stiffness(law)) != 0:
            rest, whole = law.subs(INTEGRAL, 0), False
            fixed = not branch.template.reads and not rest.has(ACROSS, TIME)
            shift = expand(rest / stiffness) if fixed else Integer(0)
            self.springs.append(Square(branch.index, stiffness, twist + shift))
            law = Integer(0) if fixed else rest
            if law == 0:
                return
        size, symbol = self.at.by_law(branch, law), self.at.quantities.through(flow)
        if whole and len(flow.branches) == 1:
            if symbol != flow.sign * size:
                self.laws[symbol] = flow.sign * size
            size = flow.sign * symbol
        self.torques.append(GeneralisedTorque(branch.index, size, twist))


@dataclass(frozen=True, eq=False)
class SecondOrder:
    """M phi'' + D phi' + K phi = T.

    Args:
        at: the angles and positions that are coordinates, and all others in terms of them.
        mass: nonzero entries of M by row and column; row by row, columns rising.
        damping: those of D.
        stiffness: those of K.
        forces: T; the torques and forces of laws and sources stand in it by their symbols.
        laws: those torques and forces in terms of the coordinates and their rates.
    """

    at: Coordinates
    mass: Entries
    damping: Entries
    stiffness: Entries
    forces: tuple[Expr, ...]
    laws: Mapping[Symbol, Expr]

    @cached_property
    def nodes(self) -> tuple[str, ...]:
        """Names of the nodes whose angle or position is a coordinate."""
        return tuple(self.at.quantities.graph.nodes[node] for node in self.at.free)

    @property
    def coordinates(self) -> tuple[Symbol, ...]:
        """Their symbols."""
        return self.at.symbols

    def terms(self, row: int) -> Iterator[Expr]:
        """The terms of a row of M phi'' + D phi' + K phi."""
        at = self.at
        pairs = ((self.mass, at.accelerations), (self.damping, at.velocities), (self.stiffness, at.symbols))
        for entries, factors in pairs:
            for (i, j), entry in entries.items():
                if i == row:
                    yield entry * factors[j]

    def residual(self, row: int) -> Expr:
        """M phi'' + D phi' + K phi - T of a row, with the laws put in; zero along every motion."""
        return Add(*self.terms(row)) - self.forces[row].xreplace(dict(self.laws))


def second_order(
    graph: CircuitGraph, quantities: Quantities | None = None, without: Collection[int] = ()
) -> SecondOrder:
    """The second-order form of a network of rotating and translating parts.

    Args:
        graph: the circuit graph.
        quantities: its symbols, where they are not the usual ones.
        without: branches that are left out.

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
    at = coordinates(quantities or Quantities(graph))
    energies, forces = Energies(at), [list[Expr]() for _ in at.symbols]
    energies.enter(branch for branch in graph.branches if branch.index not in without)
    mass = _matrix(energies.inertias, at.velocities, forces, at.rate)
    damping = _matrix(energies.dampers, at.velocities, forces)
    stiffness = _matrix(energies.springs, at.symbols, forces)
    for torque in energies.torques:
        for i, gain in _gains(torque.along, at.symbols).items():
            forces[i].append(-gain * torque.size)
    return SecondOrder(at, mass, damping, stiffness, tuple(Add(*terms) for terms in forces), energies.laws)


def _matrix(
    squares: Sequence[Square],
    symbols: Sequence[Symbol],
    forces: Sequence[list[Expr]],
    felt: Callable[[Expr], Expr] = lambda driven: driven,
) -> Entries:
    """The sum of coefficient * f f' over squares of f' symbols; what is prescribed of them goes to the forces.

    Args:
        squares: the energies or losses.
        symbols: the coordinates or their rates.
        forces: of each coordinate, to which terms are added.
        felt: what the coefficient is multiplied by, from what is prescribed of the position or speed that is squared.
    """
    entries: dict[tuple[int, int], list[Expr]] = {}
    for square in squares:
        gains = _gains(square.along, symbols)
        driven = [term for term in Add.make_args(square.along) if term.free_symbols.isdisjoint(symbols)]
        for i, gain in gains.items():
            for j, other in gains.items():
                entries.setdefault((i, j), []).append(gain * square.coefficient * other)
            forces[i] += (-gain * square.coefficient * felt(term) for term in driven)
    return {key: total for key in sorted(entries) if (total := Add(*entries[key])) != 0}


def _gains(along: Expr, symbols: Sequence[Symbol]) -> dict[int, Expr]:
    """The factors of the coordinates or rates in a linear sum, by their places."""
    moving = along.free_symbols
    return {place: along.coeff(symbol) for place, symbol in enumerate(symbols) if symbol in moving}


def _linear_stiffness(law: Expr) -> Expr:
    """The slope of a law over the twist where it is the same everywhere, else 0."""
    if not law.has(INTEGRAL) or jumps(law, INTEGRAL):
        return Integer(0)
    stiffness = slope(law, INTEGRAL)
    return Integer(0) if stiffness.has(ACROSS, INTEGRAL, TIME) else stiffness
