"""Lagrange's equations of a mechanical network, from its energies alone.

An independent way to the second-order form: coordinates come from the couplings by linear algebra, the equations from
differentiating kinetic and potential energy, Rayleigh's dissipation function and virtual work. Neither the normal tree
nor the matrices of the second-order form are used. Source: Abdelkader 2016, (18)-(31).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from sympy import Add, Expr, Float, Integer, Matrix, Rational, Symbol, cancel

from shaftwork.components.branches import ACROSS, INTEGRAL
from shaftwork.components.laws import t as TIME
from shaftwork.core.domains import ELECTRICAL
from shaftwork.core.errors import CompileError
from shaftwork.equations.quantities import Quantities, rate_of, refuse_controlled
from shaftwork.network.graph import GROUND, CircuitGraph, GraphBranch
from shaftwork.network.templates import Kind

INDEPENDENT = 1e-9
"""A coupling whose row is within this of the rows before it says nothing new."""


@dataclass(frozen=True, eq=False)
class Lagrangian:
    """The energies of a network and the equations of motion that follow.

    Args:
        coordinates: generalised coordinates: angles and positions of nodes.
        kinetic: kinetic energy T of inertias and masses.
        potential: potential energy V of springs.
        dissipation: Rayleigh's function R of linear dampers, half of the power that they lose.
        forces: generalised force of laws and sources by virtual work, for each coordinate.
        equations: d/dt(dT/dq') - dT/dq + dR/dq' + dV/dq - Q, zero along every motion.
    """

    coordinates: tuple[Symbol, ...]
    kinetic: Expr
    potential: Expr
    dissipation: Expr
    forces: tuple[Expr, ...]
    equations: tuple[Expr, ...]

    @property
    def lagrangian(self) -> Expr:
        """L = T - V."""
        return self.kinetic - self.potential


def lagrangian(graph: CircuitGraph) -> Lagrangian:
    """Lagrange's equations of a network of rotating and translating parts.

    Raises:
        CompileError: the network has electrical nodes, or a law reads others.
    """
    if ELECTRICAL in graph.domains:
        raise CompileError(
            f"Lagrange's equations are for mechanical networks, but '{graph.name}' has electrical nodes. "
            "Take form='state'."
        )
    refuse_controlled(graph)
    return _Energies(graph).made()


class _Energies:
    def __init__(self, graph: CircuitGraph) -> None:
        self.graph, self.quantities = graph, Quantities(graph)
        self.free, self.position = _positions(graph, self.quantities)
        self.coordinates = tuple(map(self.quantities.angle, self.free))
        self.velocities = tuple(map(rate_of, self.coordinates))
        self.speeds: dict[Symbol, Expr] = dict(zip(self.coordinates, self.velocities, strict=True))
        for branch in graph.branches:
            if branch.template.kind is Kind.ACROSS_SOURCE:
                self.speeds[self.quantities.integral(branch.index)] = self.quantities.law(branch.index)

    def across(self, branch: GraphBranch) -> tuple[Expr, Expr]:
        """The position and the speed across a branch."""
        position = self.position[branch.plus] - self.position[branch.minus]
        return position, self.rate(position)

    def rate(self, position: Expr) -> Expr:
        """The time derivative of a position, by the chain rule."""
        return Add(*(position.diff(symbol) * speed for symbol, speed in self.speeds.items()))

    def energy(self, kind: Kind, of: int) -> Expr:
        """Half the sum of coefficient times square of the position (`of` 0) or speed (1) across branches of a kind."""
        branches = (branch for branch in self.graph.branches if branch.template.kind is kind)
        squares = (self.quantities.law(branch.index) * self.across(branch)[of] ** 2 for branch in branches)
        return Rational(1, 2) * Add(*squares)

    def work(self, coordinate: Symbol) -> Expr:
        """Generalised force: what laws and sources do along a small change of the coordinate."""
        terms: list[Expr] = []
        for branch in self.graph.branches:
            if branch.template.kind in (Kind.LAW, Kind.THROUGH_SOURCE):
                position, speed = self.across(branch)
                law = self.quantities.law(branch.index).xreplace({ACROSS: speed, INTEGRAL: position})
                terms.append(-law * position.diff(coordinate))
        return Add(*terms)

    def made(self) -> Lagrangian:
        kinetic, potential = self.energy(Kind.ACROSS_STORE, 1), self.energy(Kind.THROUGH_STORE, 0)
        dissipation = self.energy(Kind.CONDUCTANCE, 1)
        forces = tuple(map(self.work, self.coordinates))
        equations = tuple(
            self._momentum_rate(kinetic.diff(velocity))
            - kinetic.diff(coordinate)
            + dissipation.diff(velocity)
            + potential.diff(coordinate)
            - force
            for coordinate, velocity, force in zip(self.coordinates, self.velocities, forces, strict=True)
        )
        return Lagrangian(self.coordinates, kinetic, potential, dissipation, forces, equations)

    def _momentum_rate(self, momentum: Expr) -> Expr:
        by_speed = (momentum.diff(velocity) * rate_of(velocity) for velocity in self.velocities)
        by_position = (momentum.diff(position) * speed for position, speed in self.speeds.items())
        return Add(*by_speed, *by_position, momentum.diff(TIME))


def _positions(graph: CircuitGraph, quantities: Quantities) -> tuple[tuple[int, ...], Mapping[int, Expr]]:
    """Free nodes, and the position of every node in terms of theirs and of prescribed ones.

    Nodes without inertia are solved for first, and of two nodes the one named later.
    """
    heavy = {
        node
        for branch in graph.branches
        if branch.template.kind is Kind.ACROSS_STORE and GROUND in (branch.plus, branch.minus)
        for node in (branch.plus, branch.minus)
    }
    order = sorted(range(len(graph.nodes)), key=lambda node: (node in heavy, -node))
    rows = _independent(tuple(_constraints(graph, quantities, order)), graph.parameters)
    position: dict[int, Expr] = {GROUND: Integer(0), **{node: quantities.angle(node) for node in order}}
    if not rows:
        return tuple(range(len(graph.nodes))), position
    reduced, pivots = Matrix(rows).rref(iszerofunc=lambda entry: cancel(entry) == 0, simplify=cancel)
    unknowns = [*(position[node] for node in order), Integer(1)]
    for row, pivot in enumerate(pivots):
        others = (reduced[row, k] * unknowns[k] for k in range(pivot + 1, len(unknowns)))
        position[order[pivot]] = -Add(*others)
    return tuple(sorted(set(range(len(order))) - {order[pivot] for pivot in pivots})), position


def _constraints(graph: CircuitGraph, quantities: Quantities, order: list[int]) -> Iterator[list[Expr]]:
    """Couplings and prescribed positions as rows of coefficients of the nodes in the given order; last the constant."""
    for branch in graph.branches:
        terms = branch.terms or ((Integer(1), branch.plus, branch.minus),)
        if branch.template.kind not in (Kind.COUPLING, Kind.ACROSS_SOURCE):
            continue
        row = [Integer(0)] * (len(order) + 1)
        for coefficient, plus, minus in terms:
            for node, sign in ((plus, 1), (minus, -1)):
                if node != GROUND:
                    row[order.index(node)] += sign * graph.in_network_symbols(coefficient, branch)
        if not branch.terms:
            row[-1] = -quantities.integral(branch.index)
        yield row


def _independent(rows: tuple[list[Expr], ...], parameters: Mapping[str, float]) -> list[list[Expr]]:
    """The rows that say something new for the given values of the ratios."""
    values = {Symbol(name, real=True): Float(value) for name, value in parameters.items()}
    kept: list[list[Expr]] = []
    numbers: list[list[float]] = []
    for row in rows:
        candidate = [*numbers, [float(entry.xreplace(values)) for entry in row[:-1]]]
        if np.linalg.matrix_rank(np.array(candidate), rtol=INDEPENDENT) == len(candidate):
            kept.append(row)
            numbers = candidate
    return kept
