"""Kirchhoff's equations in the image domain: a row for each unknown, with entries made of s and parameters.

    sum of i = 0,   i = s C v,   i = G v,   s i = K v,   i = k v + k_q q + sum of k_r (what the law reads),   s q = v

A law has its slopes at a point, where sources are zero but for inputs. No state is chosen: what couplings make
dependent, and what turns without inertia, is one more unknown.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

from sympy import Expr, Integer, Symbol

from shaftwork.components.base import Signal
from shaftwork.components.branches import ACROSS, INTEGRAL
from shaftwork.core.errors import CompileError
from shaftwork.equations.assembly import Assembly
from shaftwork.equations.point_slopes import LawSlopes
from shaftwork.formulation.form import StateForm
from shaftwork.formulation.source_inputs import Place
from shaftwork.network.graph import GROUND, CircuitGraph, GraphBranch, GraphPart, Reading, readings_of
from shaftwork.network.kinds import Kind

S = Symbol("s")
"""The variable of the image domain, 1/s."""
Unknown = tuple[Literal["across", "through", "integral"], int]
"""What is across a node, passes through a branch, or is the integral of what is across a branch."""
Sum = Mapping[Unknown, Expr]
"""Factors of unknowns."""


def total(terms: Iterable[tuple[Expr | int, Sum]]) -> Sum:
    """A sum of multiples."""
    factors: dict[Unknown, Expr] = {}
    for factor, row in terms:
        for unknown, entry in row.items():
            factors[unknown] = factors.get(unknown, Integer(0)) + factor * entry
    return {unknown: entry for unknown, entry in factors.items() if entry != 0}


def refuse_waves(form: StateForm) -> None:
    """Refuse a network of which no polynomials and matrices tell the motion.

    Raises:
        CompileError: a shaft is a travelling wave.
    """
    if form.waves:
        raise CompileError(
            f"Shaft '{form.graph.part_of(form.waves[0]).name}' is a travelling wave, whose transfer functions are no "
            "rational functions of s. Take model=Spectral(8), or frequency_response for their values."
        )


@dataclass(frozen=True, eq=False)
class Tableau:
    """The rows, made as they are asked for.

    Args:
        assembly: the equations in the time domain.
        slopes: of their laws.
    """

    assembly: Assembly
    slopes: LawSlopes

    @property
    def _graph(self) -> CircuitGraph:
        return self.assembly.form.graph

    def rows(self, read: Sum) -> dict[Unknown, Sum]:
        """As many rows as unknowns, each by the one that it is the row of; with what a sum contains among them."""
        rows: dict[Unknown, Sum] = {("across", node): self._balance(node) for node in range(len(self._graph.nodes))}
        unknowns = [unknown for row in (*rows.values(), read) for unknown in row]
        while missing := [unknown for unknown in dict.fromkeys(unknowns) if unknown not in rows]:
            added = {unknown: self._imposed(*unknown) for unknown in missing}
            rows |= added
            unknowns = [unknown for row in added.values() for unknown in row]
        return rows

    def entered(self, place: Place) -> dict[Unknown, int]:
        """What an input adds to the right sides of the rows."""
        if place.branch >= 0:
            return {("through", place.branch): place.signal.sign}
        part = self._graph.parts[place.part]
        plus, minus = map(part.node_at, place.signal.ends)
        pairs = ((plus, -place.signal.sign), (minus, place.signal.sign))
        return {("across", node): sign for node, sign in pairs if node != GROUND}

    def signal(self, part: GraphPart, signal: Signal) -> Sum:
        """A quantity of a part; of a torque without what an input adds to it."""
        if signal.kind == "across":
            plus, minus = map(part.node_at, signal.ends)
            return total([(signal.sign, self.node(plus)), (-signal.sign, self.node(minus))])
        branches = [self._graph.branches[index] for index in part.branches]
        if signal.kind == "through":
            return total(
                (signal.sign * sign * self._graph.in_network_symbols(factor, branch), self.through(branch))
                for branch in branches
                for factor, *ends in branch.template.balances or ((Integer(1), *branch.template.ends),)
                for end, sign in zip(ends, (1, -1), strict=True)
                if end == signal.ends[0]
            )
        stores = (branch for branch in branches if branch.template.kind is Kind.THROUGH_STORE)
        store = next(branch for branch in stores if signal.label in ("", branch.template.label))
        factor = 1 / self.assembly.quantities.law(store.index) if signal.kind == "twist" else Integer(signal.sign)
        return total([(factor, self.through(store))])

    def node(self, number: int) -> Sum:
        """What is across a node and the reference."""
        return {} if number == GROUND else {("across", number): Integer(1)}

    def across(self, branch: GraphBranch) -> Sum:
        """What is across a branch."""
        return total([(1, self.node(branch.plus)), (-1, self.node(branch.minus))])

    def integral(self, branch: GraphBranch) -> Sum:
        """The integral of what is across a branch."""
        return {("integral", branch.index): Integer(1)}

    def through(self, branch: GraphBranch) -> Sum:
        """What passes through a branch."""
        index = branch.index
        match branch.template.kind:
            case Kind.ACROSS_STORE:
                constant = self._graph.in_network_symbols(branch.template.law, branch)
                return total([(S * constant, self.across(branch))])
            case Kind.CONDUCTANCE:
                return total([(self.assembly.quantities.law(index), self.across(branch))])
            case Kind.LAW:
                return self._near(branch)
            case Kind.THROUGH_SOURCE:
                return {}
        # a coupling that says what others have said carries nothing
        return {} if index in self.assembly.form.tree.redundant else {("through", index): Integer(1)}

    def _balance(self, node: int) -> Sum:
        """What leaves a node."""
        pairs = ((branch, self.assembly.incidence(branch.index, node)) for branch in self._graph.branches)
        return total((factor, self.through(branch)) for branch, factors in pairs for factor in factors)

    def _imposed(self, kind: str, index: int) -> Sum:
        """The row of an unknown at a branch."""
        branch = self._graph.branches[index]
        if kind == "integral":
            return total([(S, self.integral(branch)), (-1, self.across(branch))])
        match branch.template.kind:
            case Kind.THROUGH_STORE:
                return total([(S, self.through(branch)), (-self.assembly.quantities.law(index), self.across(branch))])
            case Kind.ACROSS_SOURCE:
                return total([(1, self.across(branch)), (-1, self._near(branch))])
        placed = ((self._graph.in_network_symbols(factor, branch), ends) for factor, *ends in branch.terms)
        return total(pair for f, (a, b) in placed for pair in ((f, self.node(a)), (-f, self.node(b))))

    def _near(self, branch: GraphBranch) -> Sum:
        """A law near a point: its slopes times what it reads."""
        at_branch = {ACROSS: self.across, INTEGRAL: self.integral}
        reads = readings_of(self._graph, branch.index)
        slopes = self.slopes.of(branch).items()
        read = ((slope, at_branch[by](branch) if by in at_branch else self._value(reads[by])) for by, slope in slopes)
        return total(read)

    def _value(self, reading: Reading) -> Sum:
        if reading.kind == "across":
            return self.node(reading.of)
        branch = self._graph.branches[reading.of]
        if reading.kind == "rate":
            return total([(S, self.across(branch))])
        return self.through(branch) if reading.kind == "through" else self.integral(branch)
