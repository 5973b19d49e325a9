"""Lagrange's equations of a network, from its energies alone.

An independent way to the equations of motion: coordinates come from the couplings by linear algebra, the equations from
differentiating kinetic and potential energy, Rayleigh's dissipation function and virtual work. Neither the normal tree
nor Kirchhoff's laws are used. In the analogy the coordinate of an electrical node is its flux linkage, so that circuits
have energies like drive trains: a capacitor's is kinetic, a coil's potential. Source: Abdelkader 2016, (18)-(31).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, TypeVar

from sympy import Add, Expr, Integer, Symbol, cancel

from shaftwork.components.branches import ACROSS, HISTORY
from shaftwork.equations.assembly import FactoredTerms, Sides, sides, terms_of
from shaftwork.equations.coordinates import Coordinates, coordinates, is_prescribed
from shaftwork.equations.kirchhoff import Row
from shaftwork.equations.quantities import rate_of
from shaftwork.equations.records import Equations
from shaftwork.equations.second_order import Energies, GeneralisedTorque, Square
from shaftwork.network.graph import GROUND, GraphBranch
from shaftwork.network.kinds import Kind

if TYPE_CHECKING:
    from shaftwork.lagrange.lagrange_proof import Proof


@dataclass(frozen=True, eq=False)
class MotionEquation(Row):
    """Lagrange's equation of a coordinate, solved for the rate of its momentum: d/dt(dT/dq') = Q - dV/dq - dR/dq'.

    Args:
        node: the node whose angle, position or flux linkage the coordinate is.
        coordinate: its symbol q.
        force: the generalised force Q.
        displacements: for each node that moves with the coordinate by how much: its position differentiated by q.
    """

    node: str
    coordinate: Symbol
    force: Expr
    displacements: Mapping[str, Expr]


@dataclass(frozen=True, eq=False)
class Constraint(Row):
    """What a part imposes on the rates by a reaction that does work: a gear with losses, a controlled voltage.

    Args:
        reaction: the torque, force or current with which it does so; it stands in the generalised forces.
    """

    reaction: Symbol


@dataclass(frozen=True, eq=False)
class Lagrangian:
    """The energies of a network and the equations of motion that follow.

    Law: d/dt(dL/dq') - dL/dq + dR/dq' = Q with L = T - V. Angles are counted from the untwisted position.

    Args:
        kirchhoff: Kirchhoff's equations of the same network, in the same phase.
        coordinates: generalised coordinates q: angles, positions and flux linkages of nodes.
        inertias: kinetic energies of inertias and masses (and of capacitors).
        springs: potential energies of springs and of laws that are linear in the twist (and of coils).
        dampers: terms of Rayleigh's function: of linear dampers (and resistors), half of the power that each loses.
        equations: the equation of each coordinate, with its generalised force.
        constraints: what couplings with losses and controlled sources impose besides, each with a reaction in `forces`.
        reactions: torques, forces and currents of couplings and prescribed speeds, which do no work and stand nowhere.
        laws: torques, forces and currents that stand in `forces`, in coordinates and rates.
        motion: every other quantity of Kirchhoff's equations in coordinates and rates: speeds, torques of springs.
        prescribed: speed of every prescribed angle or position.
    """

    kirchhoff: Equations
    coordinates: tuple[Symbol, ...]
    inertias: tuple[Square, ...]
    springs: tuple[Square, ...]
    dampers: tuple[Square, ...]
    equations: tuple[MotionEquation, ...]
    constraints: tuple[Constraint, ...]
    reactions: tuple[Symbol, ...]
    laws: Mapping[Symbol, Expr]
    motion: Mapping[Symbol, Expr]
    prescribed: Mapping[Symbol, Expr]

    @cached_property
    def kinetic(self) -> Expr:
        """Kinetic energy T."""
        return Add(*(square.energy for square in self.inertias))

    @cached_property
    def potential(self) -> Expr:
        """Potential energy V."""
        return Add(*(square.energy for square in self.springs))

    @cached_property
    def dissipation(self) -> Expr:
        """Rayleigh's function R, half of the power that linear dampers lose."""
        return Add(*(square.energy for square in self.dampers))

    @property
    def forces(self) -> tuple[Expr, ...]:
        """Generalised force Q of each coordinate: laws and sources by virtual work, in their symbols."""
        return tuple(row.force for row in self.equations)

    @property
    def lagrangian(self) -> Expr:
        """L = T - V."""
        return self.kinetic - self.potential

    @property
    def velocities(self) -> tuple[Symbol, ...]:
        """The rates of the coordinates."""
        return tuple(map(rate_of, self.coordinates))

    @property
    def phase(self) -> str:
        """The mode of every part that changes its mode, "gap open, load stuck", for which the equations hold."""
        return self.kirchhoff.phase

    def proof(self) -> Proof:
        """That these are Kirchhoff's equations: every one compared, with the symbolic difference, which is zero."""
        from shaftwork.lagrange.lagrange_proof import prove

        return prove(self)

    def latex(self, *, values: bool = False) -> str:
        """Energies, generalised forces and equations as the body of a LaTeX document (needs amsmath).

        Args:
            values: print the parameters' values instead of their symbols.
        """
        from shaftwork.lagrange.lagrange_print import blocks_of
        from shaftwork.latex.document import typeset

        return typeset(self.kirchhoff, blocks_of(self, values=values))

    def document(self, *, values: bool = False, title: str | None = None) -> str:
        """A complete LaTeX document: energies, generalised forces and equations, and the nomenclature with the values.

        Args:
            values: print the parameters' values instead of their symbols.
        """
        from shaftwork.lagrange.lagrange_print import document

        return document(self, values=values, title=title)

    def _repr_latex_(self) -> str:
        from shaftwork.lagrange.lagrange_print import blocks_of
        from shaftwork.latex.document import rendered

        return rendered(self.kirchhoff, blocks_of(self, values=False))


def lagrangian(equations: Equations) -> Lagrangian:
    """Lagrange's equations of the network that Kirchhoff's are given of; of these only the network is read."""
    return _LagrangeWriter(equations).lagrangian()


class _LagrangeWriter:
    def __init__(self, equations: Equations) -> None:
        self.equations, self.quantities = equations, equations.assembly.quantities
        self.graph = self.quantities.graph
        self.coordinates = coordinates(self.quantities)
        self.energies = Energies(self.coordinates)
        self.constraints: list[Constraint] = []

    def lagrangian(self) -> Lagrangian:
        energies = self.energies
        for branch in self.graph.branches:
            if (branch.template.kind is Kind.ACROSS_SOURCE and not is_prescribed(branch)) or branch.template.through:
                self._enter_constraint(branch)
            energies.enter((branch,))
            if branch.template.is_history:
                energies.laws[self.quantities.history(branch.index)] = self._history(branch)
        equations = tuple(self._equations())
        flows = (flow for flow in self.quantities.flows if self.quantities.through(flow) not in energies.laws)
        return Lagrangian(
            self.equations,
            self.coordinates.symbols,
            tuple(energies.inertias),
            tuple(energies.springs),
            tuple(energies.dampers),
            equations,
            tuple(self.constraints),
            tuple(self.quantities.passing(branch)[0] for branch in self.coordinates.imposed),
            energies.laws,
            {**self.coordinates.of_flows(flows), **self.coordinates.motion},
            self.coordinates.prescribed,
        )

    @cached_property
    def _accelerations(self) -> frozenset[Symbol]:
        return frozenset(self.coordinates.accelerations)

    def _enter_constraint(self, branch: GraphBranch) -> None:
        """Put down what a controlled source or a coupling with losses imposes, and the torque that does so."""
        (reaction, sign), at = self.quantities.passing(branch.index), self.coordinates
        if branch.terms:
            left, right = at.rate(at.summed(branch, branch.terms)), Integer(0)
            along = at.summed(branch, branch.balances)
        else:
            left, right = at.speed(branch), at.of(self.quantities.law(branch.index))
            along = at.twist(branch)
        self.energies.torques.append(GeneralisedTorque(branch.index, sign * reaction, along))
        pairs = branch.terms or ((Integer(1), branch.plus, branch.minus),)
        nodes = dict.fromkeys(node for _, *ends in pairs for node in ends if node != GROUND)
        names, part = tuple(self.graph.nodes[node] for node in nodes), self.graph.part_of(branch.index).name
        make = partial(sides, left, (right,))
        self.constraints.append(Constraint((part,), (branch.index,), names, make, reaction))

    def _history(self, branch: GraphBranch) -> Expr:
        """What arrives at an end of a line: what left the other end a delay ago."""
        other = self.equations.assembly.opposite[branch.index]
        speed, history = self.coordinates.speed(self.graph.branches[other]), self.quantities.history(other)
        return self.quantities.printed(branch.index).xreplace({ACROSS: speed, HISTORY: history})

    def _equations(self) -> Iterator[MotionEquation]:
        """The equation of every coordinate."""
        at = self.coordinates
        inertias = _by_symbol(self.energies.inertias, at.velocities)
        dampers = _by_symbol(self.energies.dampers, at.velocities)
        springs = _by_symbol(self.energies.springs, at.symbols)
        torques = _by_symbol(self.energies.torques, at.symbols)
        moved = _moved(at)
        for node, symbol, velocity in zip(at.free, at.symbols, at.velocities, strict=True):
            force = Add(*(-term.size * term.along.diff(symbol) for term in torques[symbol]))
            stored = (*inertias[velocity], *springs[symbol], *dampers[velocity])
            numbers = [*(term.branch for term in stored), *(term.branch for term in torques[symbol])]
            branches = dict.fromkeys(sorted(numbers))
            parts = dict.fromkeys(self.graph.part_of(branch).name for branch in branches)
            pulls = [term.pull(symbol) for term in springs[symbol]]
            pulls += [term.pull(velocity) for term in dampers[velocity]]
            make = partial(self._sides, velocity, inertias[velocity], pulls, force)
            origin = (tuple(parts), tuple(branches), tuple(moved[symbol]))
            yield MotionEquation(*origin, make, self.graph.nodes[node], symbol, force, moved[symbol])

    def _sides(self, velocity: Symbol, inertias: list[Square], pulls: list[FactoredTerms], force: Expr) -> Sides:
        """The rate of the momentum dT/dq', sorted by accelerations; what is prescribed of it counts as a torque."""
        coefficients: dict[Symbol, list[Expr]] = {}
        right = [*terms_of(force)]
        for inertia in inertias:
            rate, factor = self.coordinates.rate(inertia.along), inertia.coefficient * inertia.along.diff(velocity)
            present = rate.free_symbols & self._accelerations
            for symbol in present:
                coefficients.setdefault(symbol, []).append(factor * rate.diff(symbol))
            right.append(-factor * rate.xreplace(dict.fromkeys(present, Integer(0))))
        left, (torques,) = sides(Add(*(Add(*terms) * symbol for symbol, terms in coefficients.items())), right)
        groups = (group for group in (torques, *pulls) if group.terms)
        return Sides(left, tuple(sorted(groups, key=lambda group: _falls(group.factor * group.terms[0]))))


def _falls(term: Expr) -> bool:
    return bool(term.could_extract_minus_sign())


def _moved(at: Coordinates) -> dict[Symbol, dict[str, Expr]]:
    """For each coordinate the nodes that move with it, and by how much."""
    moved: dict[Symbol, dict[str, Expr]] = {symbol: {} for symbol in at.symbols}
    for number, name in enumerate(at.quantities.graph.nodes):
        position = at.positions[number]
        for symbol in position.free_symbols & moved.keys():
            moved[symbol][name] = cancel(position.diff(symbol))
    return moved


S = TypeVar("S", Square, GeneralisedTorque)


def _by_symbol(terms: Iterable[S], symbols: Iterable[Symbol]) -> dict[Symbol, list[S]]:
    """For each symbol the terms that contain it."""
    containing: dict[Symbol, list[S]] = {symbol: [] for symbol in symbols}
    for term in terms:
        for symbol in term.along.free_symbols & containing.keys():
            containing[symbol].append(term)
    return containing
