"""That Lagrange's equations are Kirchhoff's: each equation compared, and the symbolic difference.

Every speed and every torque with a law is put into Kirchhoff's equations in coordinates and rates. Then

- loops and couplings must hold identically: the coordinates satisfy them, whatever the motion,
- laws must be the same laws,
- the balances at the nodes, each times the displacement of its node, must sum to Lagrange's equation of the coordinate
  (d'Alembert's principle). The reactions of couplings and prescribed speeds do no work and fall out.

There are as many balances as coordinates and reactions together, so that nothing is left: what the sums do not say is
how large the reactions are.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from sympy import Add, Dummy, Expr, Float, Integer, Poly, Symbol, cancel, expand, fraction, together
from sympy.core.function import Application

from shaftwork.equations.coordinates import coordinates
from shaftwork.equations.kirchhoff import Row
from shaftwork.equations.quantities import rate_of
from shaftwork.formulation.gains import exactly, in_decimals
from shaftwork.network.graph import GROUND
from shaftwork.numerics.tolerances import TYPED

if TYPE_CHECKING:
    from shaftwork.lagrange.lagrange import Lagrangian


@dataclass(frozen=True, eq=False)
class LagrangeComparison:
    """Equations of Kirchhoff's beside what Lagrange's say.

    Args:
        kind: "motion" (balances that sum to an equation of motion), "loop", "coupling" or "law".
        of: the coordinate, or the parts.
        kirchhoff: the rows of Kirchhoff's equations.
        factors: what each is multiplied by.
        difference: the sum of factor times row less what Lagrange's equations say of it; zero where they agree.
    """

    kind: str
    of: str
    kirchhoff: tuple[Row, ...]
    factors: tuple[Expr, ...]
    difference: Expr


@dataclass(frozen=True, eq=False)
class Proof:
    """The comparison of all of Kirchhoff's equations with Lagrange's.

    Args:
        name: title of the network.
        phase: the phase for which both hold.
        rows: all comparisons.
        reactions: torques of couplings and prescribed speeds: what the balances say besides.
        left: how many balances are left to say that; as many as there are reactions, or something is not compared.
        given: ratios for whose values alone the network has its structure, in terms of others: gears in a closed loop.
    """

    name: str
    phase: str
    rows: tuple[LagrangeComparison, ...]
    reactions: tuple[Symbol, ...]
    left: int
    given: Mapping[Symbol, Expr]

    @property
    def holds(self) -> bool:
        """Whether every difference is zero, and no balance is left that might say more."""
        return all(row.difference == 0 for row in self.rows) and self.left == len(self.reactions)

    def __str__(self) -> str:
        of = f"{self.name}, {self.phase}" if self.phase else self.name
        lines = [f"{of}: Lagrange's equations {'are' if self.holds else 'are NOT'} Kirchhoff's"]
        width = max((len(row.of) for row in self.rows if row.kind == "motion"), default=0)
        motions = (row for row in self.rows if row.kind == "motion")
        lines += (f"{row.of:{width}}  difference {row.difference}  from {_sum_of(row)}" for row in motions)
        for kind in ("loop", "coupling", "law"):
            agreeing = [row.difference == 0 for row in self.rows if row.kind == kind]
            if agreeing:
                lines.append(f"{kind}s: {sum(agreeing)} of {len(agreeing)} agree")
        if self.left or self.reactions:
            names = ", ".join(symbol.name for symbol in self.reactions)
            lines.append(f"balances left: {self.left}, for the reactions {names}")
        lines += [f"given that {symbol} = {value}" for symbol, value in self.given.items()]
        return "\n".join(lines)


def _sum_of(row: LagrangeComparison) -> str:
    """The balances that make an equation of motion, by the names of their nodes."""
    named = zip((node for balance in row.kirchhoff for node in balance.nodes), row.factors, strict=True)
    return " + ".join(node if factor == 1 else f"{_bracketed(factor)} * {node}" for node, factor in named)


def _bracketed(factor: Expr) -> str:
    return str(factor) if factor.is_Symbol else f"({factor})"


def prove(lagrangian: Lagrangian) -> Proof:
    """Compare every equation of Kirchhoff's with Lagrange's."""
    comparisons, name = _Comparisons(lagrangian), lagrangian.kirchhoff.form.graph.name
    left = len(lagrangian.kirchhoff.nodes) - len(lagrangian.equations)
    return Proof(name, lagrangian.phase, tuple(comparisons.rows()), lagrangian.reactions, left, comparisons.ratios)


class _Comparisons:
    def __init__(self, lagrangian: Lagrangian) -> None:
        self.lagrangian, self.kirchhoff = lagrangian, lagrangian.kirchhoff
        self.quantities = self.kirchhoff.assembly.quantities
        self.motion = dict(lagrangian.motion)
        self.imposed = {row.branches[0]: row for row in lagrangian.constraints}
        self.decided = tuple(Symbol(name, real=True) for name in self.kirchhoff.form.tree.frozen)
        self.ratios = self._ratios() if self.decided else {}

    def rows(self) -> Iterator[LagrangeComparison]:
        """All comparisons: equations of motion, loops, couplings, laws."""
        balances = {row.node: row for row in self.kirchhoff.nodes}
        for equation in self.lagrangian.equations:
            moved = equation.displacements
            nodes = tuple(balances[node] for node in moved)
            works = (factor * self.in_coordinates(balances[node].expression) for node, factor in moved.items())
            difference = self.zero(Add(*works) - equation.expression)
            yield LagrangeComparison("motion", equation.coordinate.name, nodes, tuple(moved.values()), difference)
        for kind, row, residual in self.kinematic:
            yield LagrangeComparison(kind, ", ".join(row.parts), (row,), (Integer(1),), self.zero(residual))
        for row in self.kirchhoff.laws:
            left = self.in_coordinates(row.left.xreplace(dict(self.lagrangian.laws)))
            difference = self.zero(self.in_coordinates(row.right) - left - self._imposed(row))
            yield LagrangeComparison("law", ", ".join(row.parts), (row,), (Integer(1),), difference)

    def in_coordinates(self, expression: Expr) -> Expr:
        """An expression of Kirchhoff's equations in coordinates and rates."""
        return expression.xreplace(self.motion)

    def _imposed(self, row: Row) -> Expr:
        """What the coordinates do not satisfy by themselves: a constraint, where the row is that of its branch."""
        return self.imposed[row.branches[0]].expression if row.branches[0] in self.imposed else Integer(0)

    @cached_property
    def kinematic(self) -> tuple[tuple[str, Row, Expr], ...]:
        """Loops and couplings with what is left of them in coordinates, where nothing should be."""
        kirchhoff, at = self.kirchhoff, self.in_coordinates
        loops = (("loop", row, at(row.expression).xreplace(self._tied)) for row in kirchhoff.loops)
        couplings = (("coupling", row, at(row.expression) - self._imposed(row)) for row in kirchhoff.couplings)
        return (*loops, *couplings)

    @cached_property
    def _tied(self) -> dict[Symbol, Expr]:
        """Rates of coordinates that a coupling with losses ties to others; loops pass through it."""
        branches = [self.quantities.graph.branches[index] for index in self.imposed]
        lossy = [branch for branch in branches if branch.terms]
        if not lossy:
            return {}
        fewer = coordinates(self.quantities, lossy)
        angles = {self.quantities.angle(node): fewer.positions[node] for node in fewer.positions if node != GROUND}
        return {rate_of(symbol): fewer.rate(angles[symbol]) for symbol in self.lagrangian.coordinates}

    def _ratios(self) -> dict[Symbol, Expr]:
        """The ratios on whose values the structure rests, in terms of others: what makes loops and couplings hold."""
        ratios: dict[Symbol, Expr] = {}
        for _, _, residual in self.kinematic:
            rates = [rate for rate in self.lagrangian.velocities if rate in residual.free_symbols]
            conditions = [*(residual.diff(rate) for rate in rates), residual.xreplace(dict.fromkeys(rates, Integer(0)))]
            for condition in conditions:
                solved = self._solved(_cancelled(condition.xreplace(ratios)))
                ratios = {symbol: value.xreplace(solved) for symbol, value in ratios.items()} | solved
        return ratios

    def _solved(self, condition: Expr) -> dict[Symbol, Expr]:
        """The first ratio that the condition gives as the value that it has; none where there is no condition."""
        values = {Symbol(name, real=True): Float(value) for name, value in self.quantities.graph.parameters.items()}
        numerator = fraction(condition)[0]
        for symbol in reversed(self.decided):
            if symbol in numerator.free_symbols and (linear := Poly(numerator, symbol)).degree() == 1:
                slope, rest = linear.all_coeffs()
                value = cancel(-rest / slope)
                if value.free_symbols <= values.keys() and abs(value.xreplace(values) / values[symbol] - 1) < TYPED:
                    return {symbol: value}
        return {}

    def zero(self, expression: Expr) -> Expr:
        """An expression that should be zero, in the form that is, where it is."""
        exact = expand(exactly(expression.xreplace(self.ratios)), power_exp=False, power_base=False, log=False)
        return in_decimals(exact if exact == 0 else _cancelled(exact))


def _cancelled(expression: Expr) -> Expr:
    """A sum as one fraction without common factors.

    sympy cancels nothing beside a law of pieces. To an identity of fractions a function is one more unknown.
    """
    unknowns = {function: Dummy() for function in expression.atoms(Application)}
    functions = {unknown: function for function, unknown in unknowns.items()}
    return cancel(together(expression.xreplace(unknowns))).xreplace(functions)
