"""Lagrange's equations of a network, from its energies alone.

An independent way to the equations of motion: coordinates come from the couplings by linear algebra, the equations from
differentiating kinetic and potential energy, Rayleigh's dissipation function and virtual work. Neither the normal tree
nor Kirchhoff's laws are used. In the analogy the coordinate of an electrical node is its flux linkage, so that circuits
have energies like drive trains: a capacitor's is kinetic, a coil's potential. Source: Abdelkader 2016, (18)-(31).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from typing import NamedTuple, TypeVar

from sympy import Add, Expr, Integer, Symbol, cancel, expand

from shaftwork.components.branches import ACROSS, HISTORY, INTEGRAL
from shaftwork.components.laws import t as TIME
from shaftwork.equations.assembly import FactoredTerms, Sides, sides, terms_of
from shaftwork.equations.coordinates import Coordinates, coordinates, is_prescribed
from shaftwork.equations.records import Equations
from shaftwork.equations.second_order import linear_stiffness
from shaftwork.lagrange.lagrange_equations import Constraint, LagrangeEquations, MotionEquation, Square
from shaftwork.lagrange.lagrange_print import blocks_of, document
from shaftwork.lagrange.lagrange_proof import Proof, prove
from shaftwork.latex.document import rendered, typeset
from shaftwork.network.graph import GROUND, GraphBranch
from shaftwork.network.kinds import Kind


@dataclass(frozen=True, eq=False)
class Lagrangian(LagrangeEquations):
    """Lagrange's equations of a network, and what is made of them."""

    def proof(self) -> Proof:
        """That these are Kirchhoff's equations: every one compared, with the symbolic difference, which is zero."""
        return prove(self)

    def latex(self, *, values: bool = False) -> str:
        """Energies, generalised forces and equations as the body of a LaTeX document (needs amsmath).

        Args:
            values: print the parameters' values instead of their symbols.
        """
        return typeset(self.kirchhoff, blocks_of(self, values=values))

    def document(self, *, values: bool = False) -> str:
        """A complete LaTeX document: energies, generalised forces and equations, and the nomenclature with the values.

        Args:
            values: print the parameters' values instead of their symbols.
        """
        return document(self, values=values)

    def _repr_latex_(self) -> str:
        return rendered(self.kirchhoff, blocks_of(self, values=False))


def lagrangian(equations: Equations) -> Lagrangian:
    """Lagrange's equations of the network that Kirchhoff's are given of; of these only the network is read."""
    return _LagrangeWriter(equations).lagrangian()


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


class _LagrangeWriter:
    def __init__(self, equations: Equations) -> None:
        self.equations, self.quantities = equations, equations.assembly.quantities
        self.graph = self.quantities.graph
        self.coordinates = coordinates(self.quantities)
        self.inertias: list[Square] = []
        self.springs: list[Square] = []
        self.dampers: list[Square] = []
        self.torques: list[GeneralisedTorque] = []
        self.constraints: list[Constraint] = []
        self.laws: dict[Symbol, Expr] = {}

    def lagrangian(self) -> Lagrangian:
        for branch in self.graph.branches:
            self._enter(branch)
        equations = tuple(self._equations())
        flows = (flow for flow in self.quantities.flows if self.quantities.through(flow) not in self.laws)
        return Lagrangian(
            self.equations,
            self.coordinates.symbols,
            tuple(self.inertias),
            tuple(self.springs),
            tuple(self.dampers),
            equations,
            tuple(self.constraints),
            tuple(map(self._reaction, self.coordinates.imposed)),
            self.laws,
            {**self.coordinates.of_flows(flows), **self.coordinates.motion},
            self.coordinates.prescribed,
        )

    @cached_property
    def _accelerations(self) -> frozenset[Symbol]:
        return frozenset(self.coordinates.accelerations)

    def _reaction(self, branch: int) -> Symbol:
        """What a coupling or prescribed speed gives."""
        if self.graph.branches[branch].terms:
            return self.quantities.multiplier(branch)
        return self.quantities.through(self.quantities.flow_of[branch])

    def _enter(self, branch: GraphBranch) -> None:
        """Put a branch down as an energy, a loss, a torque or a constraint."""
        law = self.quantities.law(branch.index)
        match branch.template.kind:
            case Kind.ACROSS_STORE:
                self.inertias.append(Square(branch.index, law, self.coordinates.speed(branch)))
            case Kind.THROUGH_STORE:
                self.springs.append(Square(branch.index, law, self.coordinates.twist(branch)))
            case Kind.CONDUCTANCE:
                self.dampers.append(Square(branch.index, law, self.coordinates.speed(branch)))
            case Kind.LAW | Kind.THROUGH_SOURCE:
                self._enter_law(branch, law)
            case Kind.ACROSS_SOURCE if not is_prescribed(branch):
                reaction, sign = self._reaction(branch.index), self.quantities.flow_of[branch.index].sign
                self._constrain(branch, reaction, self.coordinates.speed(branch), self.coordinates.of(law))
                self.torques.append(GeneralisedTorque(branch.index, sign * reaction, self.coordinates.twist(branch)))
            case Kind.COUPLING if branch.template.through:
                reaction = self._reaction(branch.index)
                speeds = self.coordinates.rate(self.coordinates.summed(branch, branch.terms))
                self._constrain(branch, reaction, speeds, Integer(0))
                self.torques.append(
                    GeneralisedTorque(branch.index, reaction, self.coordinates.summed(branch, branch.balances))
                )

    def _enter_law(self, branch: GraphBranch, law: Expr) -> None:
        """What is linear in the twist is an energy; what is left a torque, by its symbol where it has one."""
        flow, twist, whole = self.quantities.flow_of[branch.index], self.coordinates.twist(branch), True
        if (stiffness := linear_stiffness(law)) != 0:
            rest, whole = law.subs(INTEGRAL, 0), False
            fixed = not branch.template.reads and not rest.has(ACROSS, TIME)
            shift = expand(rest / stiffness) if fixed else Integer(0)
            self.springs.append(Square(branch.index, stiffness, twist + shift))
            law = Integer(0) if fixed else rest
            if law == 0:
                return
        size, symbol = self.coordinates.by_law(branch, law), self.quantities.through(flow)
        if branch.template.is_history:
            self.laws[self.quantities.history(branch.index)] = self._history(branch)
        if whole and len(flow.branches) == 1:
            if symbol != flow.sign * size:
                self.laws[symbol] = flow.sign * size
            size = flow.sign * symbol
        self.torques.append(GeneralisedTorque(branch.index, size, twist))

    def _history(self, branch: GraphBranch) -> Expr:
        """What arrives at an end of a line: what left the other end a delay ago."""
        other = self.equations.assembly.opposite[branch.index]
        speed, history = self.coordinates.speed(self.graph.branches[other]), self.quantities.history(other)
        return self.quantities.printed(branch.index).xreplace({ACROSS: speed, HISTORY: history})

    def _constrain(self, branch: GraphBranch, reaction: Symbol, left: Expr, right: Expr) -> None:
        pairs = branch.terms or ((Integer(1), branch.plus, branch.minus),)
        nodes = dict.fromkeys(node for _, *ends in pairs for node in ends if node != GROUND)
        names, part = tuple(self.graph.nodes[node] for node in nodes), self.graph.part_of(branch.index).name
        make = partial(sides, left, (right,))
        self.constraints.append(Constraint((part,), (branch.index,), names, make, reaction))

    def _equations(self) -> Iterator[MotionEquation]:
        """The equation of every coordinate."""
        at = self.coordinates
        inertias, dampers = _by_symbol(self.inertias, at.velocities), _by_symbol(self.dampers, at.velocities)
        springs, torques = _by_symbol(self.springs, at.symbols), _by_symbol(self.torques, at.symbols)
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
