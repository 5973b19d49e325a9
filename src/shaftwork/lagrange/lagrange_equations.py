"""Lagrange's equations as data: energies, generalised forces, equations of motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from sympy import Add, Expr, Rational, Symbol

from shaftwork.equations.assembly import FactoredTerms, rising_first, terms_of, tidy
from shaftwork.equations.kirchhoff import Row
from shaftwork.equations.quantities import rate_of
from shaftwork.equations.records import Equations


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
class LagrangeEquations:
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
