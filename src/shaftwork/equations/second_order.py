"""The second-order form of a mechanical network: M phi'' + D phi' + K phi = T.

The coordinates are the angles and positions of nodes that couplings and prescribed speeds leave free, counted from the
untwisted position. A node without inertia keeps its coordinate: its row of M is empty.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from sympy import Add, Expr, Symbol

from shaftwork.core.domains import ELECTRICAL
from shaftwork.core.errors import CompileError
from shaftwork.equations.coordinates import Coordinates, coordinates
from shaftwork.equations.energies import Energies, Square
from shaftwork.equations.quantities import INSTEAD, Quantities, refuse_controlled
from shaftwork.network.graph import CircuitGraph

Entries = Mapping[tuple[int, int], Expr]


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
    at = coordinates(Quantities(graph))
    energies, forces = Energies(at), [list[Expr]() for _ in at.symbols]
    energies.enter(graph.branches)
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
