"""The state form solved row by row: rates of the states, and speeds of nodes without a store.

Coupled unknowns are solved together while that stays readable; beyond, a row keeps all its unknowns on the left.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import networkx as nx
from sympy import Add, Expr, Integer, count_ops, together

from shaftwork.components.law_slopes import slope
from shaftwork.components.laws import t as TIME
from shaftwork.core.storing import StoredByFields
from shaftwork.equations.assembly import Assembly, FactoredTerms, Sides, Terms, rising_first, sides
from shaftwork.equations.quantities import rate_of
from shaftwork.formulation.explicit_rows import LARGEST_BLOCK, congruence, solve_blocks
from shaftwork.network.kinds import Kind

Matrix = Mapping[tuple[int, int], Expr]


@dataclass(frozen=True, eq=False)
class EliminationSystem:
    """Linear equations for some unknowns.

    Args:
        unknowns: branch numbers, in order.
        matrix: the nonzero entries by row and column.
        right: the terms of a row's right side, some of which may be zero.
        symbol: what an unknown is called.
    """

    unknowns: tuple[int, ...]
    matrix: Matrix
    right: Callable[[int], Terms]
    symbol: Callable[[int], Expr]

    @cached_property
    def blocks(self) -> dict[int, tuple[int, ...]]:
        """For each unknown all those that it is coupled with."""
        links: nx.Graph[int] = nx.Graph()
        links.add_nodes_from(self.unknowns)
        links.add_edges_from(self.matrix)
        blocks = (tuple(sorted(block)) for block in nx.connected_components(links))
        return {unknown: block for block in blocks for unknown in block}

    def solved(self, unknown: int) -> bool:
        """Whether the unknown's row stands alone on its left side."""
        return len(self.blocks[unknown]) <= LARGEST_BLOCK

    def row(self, unknown: int) -> Sides:
        """The equation of an unknown, solved where its block is small."""
        block = self.blocks[unknown]
        if not self.solved(unknown):
            return self.coupled(unknown)
        factors = self._inverse_row(block, block.index(unknown))
        pairs = zip(factors, block, strict=True)
        groups = (group for factor, other in pairs if factor != 0 for group in _grouped(factor, self.right(other)))
        return Sides(self.symbol(unknown), tuple(group for group in groups if group.terms))

    def coupled(self, unknown: int) -> Sides:
        """The equation of an unknown with all unknowns that it contains on the left."""
        block = self.blocks[unknown]
        left = (self.matrix[unknown, other] * self.symbol(other) for other in block if (unknown, other) in self.matrix)
        return sides(Add(*left), self.right(unknown))

    def _inverse_row(self, block: Sequence[int], place: int) -> tuple[Expr, ...]:
        if len(block) == 1:
            (only,) = block
            factor = 1 / self.matrix[only, only]
            return (min(factor, together(factor), key=count_ops),)
        matrix = {key: entry for key, entry in self.matrix.items() if key[0] in block}
        units = ({other: Integer(int(other == one)) for other in block} for one in block)
        return tuple(together(solve_blocks(matrix, block, unit)[place]) for unit in units)


@dataclass(frozen=True, eq=False)
class SolvedForm(StoredByFields):
    """The three systems of a state form: speeds, torques, and speeds without a store."""

    assembly: Assembly

    def __getstate__(self) -> dict[str, Assembly]:
        return {"assembly": self.assembly}  # what is pickled; the systems are made anew

    @cached_property
    def speeds(self) -> EliminationSystem:
        """d(across)/dt of the tree's stores: referred inertias times accelerations."""
        form = self.assembly.form
        matrix = self._congruence(form.across_states, form.dependent_across)

        def right(tree: int) -> Terms:
            driven = self.assembly.out_of(tree, left_out=Kind.ACROSS_STORE)
            return (*driven, *self._prescribed_inertia(tree))

        def symbol(tree: int) -> Expr:
            return rate_of(self.assembly.quantities.across(self.assembly.ends(tree)))

        return EliminationSystem(form.across_states, matrix, right, symbol)

    @cached_property
    def torques(self) -> EliminationSystem:
        """d(through)/dt of the links' stores: compliances times torque rates."""
        assembly, form = self.assembly, self.assembly.form
        compliances = {link: 1 / assembly.quantities.law(link) for link in form.through_states}
        loops: dict[int, list[tuple[int, Expr]]] = {}
        for link in form.through_states if form.dependent_through else ():
            for tree, gain in assembly.factors(link):
                loops.setdefault(tree, []).append((link, gain))
        springs = (
            (
                loops.get(tree, []),
                1 / assembly.quantities.law(tree),
                [(link, gain) for link, gain in assembly.cutsets.get(tree, ()) if link in compliances],
            )
            for tree in form.dependent_through
        )

        def right(link: int) -> Terms:
            twist = assembly.in_place(assembly.around(link, without=Kind.THROUGH_STORE))
            return (*twist, *self._forced_twist(link))

        def symbol(link: int) -> Expr:
            return rate_of(assembly.quantities.store(link))

        return EliminationSystem(form.through_states, congruence(compliances, springs), right, symbol)

    @cached_property
    def algebraic(self) -> EliminationSystem:
        """Across variables of conductances between nodes without a store."""
        assembly, form = self.assembly, self.assembly.form
        matrix = self._congruence(form.tree_conductances, form.link_conductances)

        def right(tree: int) -> Terms:
            terms = list(assembly.out_of(tree, left_out=Kind.CONDUCTANCE))
            for link, gain in assembly.cutsets.get(tree, ()):
                if assembly.kind(link) is Kind.CONDUCTANCE:
                    drive = Add(*assembly.around(link, without=Kind.CONDUCTANCE))
                    terms.append(-gain * assembly.quantities.law(link) * drive)
            return tuple(terms)

        def symbol(tree: int) -> Expr:
            return assembly.quantities.across(assembly.ends(tree))

        return EliminationSystem(form.tree_conductances, matrix, right, symbol)

    def _congruence(self, unknowns: tuple[int, ...], links: tuple[int, ...]) -> Matrix:
        """Coefficients of tree branches plus those of links referred to them."""
        quantities = self.assembly.quantities
        coefficients = {tree: quantities.law(tree) for tree in unknowns}
        referred = (
            (
                [pair for pair in self.assembly.balanced(link) if pair[0] in coefficients],
                quantities.law(link),
                [pair for pair in self.assembly.factors(link) if pair[0] in coefficients],
            )
            for link in links
        )
        return congruence(coefficients, referred)

    def _prescribed_inertia(self, tree: int) -> Iterator[Expr]:
        """What a prescribed acceleration demands of an inertia that is geared to it and to the unknown."""
        assembly = self.assembly
        for link, gain in assembly.cutsets.get(tree, ()):
            if assembly.kind(link) is Kind.ACROSS_STORE:
                for source, factor in assembly.factors(link):
                    if assembly.kind(source) is Kind.ACROSS_SOURCE:
                        yield -gain * assembly.quantities.law(link) * factor * self._source_rate(source)

    def _forced_twist(self, link: int) -> Iterator[Expr]:
        """What a source's changing torque adds to the twist of a spring in series with it."""
        assembly = self.assembly
        for tree, gain in assembly.factors(link):
            if assembly.kind(tree) is Kind.THROUGH_STORE:
                compliance = 1 / assembly.quantities.law(tree)
                for source, factor in assembly.cutsets.get(tree, ()):
                    if assembly.kind(source) is not Kind.THROUGH_STORE:
                        yield -gain * compliance * factor * self._source_rate(source)

    def _source_rate(self, source: int) -> Expr:
        return slope(self.assembly.quantities.law(source), TIME)


def _grouped(factor: Expr, terms: Terms) -> Iterator[FactoredTerms]:
    """A factor of terms as groups: a sum whose own factor cancels a part of the other one stands beside the bracket."""
    beside: list[FactoredTerms] = []
    within: list[Expr] = []
    for term in terms:
        sums = [part for part in term.args if part.is_Add] if term.is_Mul else []
        rest = factor * term / sums[0] if len(sums) == 1 else factor
        if len(sums) == 1 and not factor.free_symbols <= rest.free_symbols:
            beside.append(FactoredTerms(rest, rising_first(sums[0].args)))
        else:
            within.append(term)
    yield FactoredTerms(factor, rising_first(within))
    yield from beside
