"""The energies, losses and torques of a network in generalised coordinates: what equations of motion are made of."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

from sympy import Expr, Integer, Rational, Symbol, expand

from shaftwork.components.branches import ACROSS, INTEGRAL
from shaftwork.components.law_slopes import jumps, slope
from shaftwork.components.laws import t as TIME
from shaftwork.equations.assembly import FactoredTerms, rising_first, terms_of, tidy
from shaftwork.equations.coordinates import Coordinates
from shaftwork.network.graph import GraphBranch
from shaftwork.network.kinds import Kind


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


def _linear_stiffness(law: Expr) -> Expr:
    """The slope of a law over the twist where it is the same everywhere, else 0."""
    if not law.has(INTEGRAL) or jumps(law, INTEGRAL):
        return Integer(0)
    stiffness = slope(law, INTEGRAL)
    return Integer(0) if stiffness.has(ACROSS, INTEGRAL, TIME) else stiffness
