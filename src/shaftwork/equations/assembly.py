"""The terms of every equation, row by row: balances, loops, laws, couplings and the state form.

Nothing is multiplied out: a row is a left side and groups of terms under a common factor, as it will be printed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

from sympy import Add, Expr, Integer, Mul

from shaftwork.components.branches import ACROSS, HISTORY, INTEGRAL
from shaftwork.components.laws import t as TIME
from shaftwork.equations.quantities import Quantities, ThroughQuantity, rate_of
from shaftwork.formulation.form import StateForm
from shaftwork.formulation.gains import Number, simplified
from shaftwork.network.graph import GROUND
from shaftwork.network.kinds import Kind

Terms = tuple[Expr, ...]


class FactoredTerms(NamedTuple):
    """A common factor and the terms that it multiplies."""

    factor: Expr
    terms: Terms


class Sides(NamedTuple):
    """Left side and right side of a row."""

    left: Expr
    groups: tuple[FactoredTerms, ...]


def branches_of(item: ThroughQuantity | int) -> tuple[int, ...]:
    """The branches of a flow, or the one that is an across store or a coupling."""
    return item.branches if isinstance(item, ThroughQuantity) else (item,)


def sides(left: Expr, terms: Iterable[Expr]) -> Sides:
    """A row without a common factor."""
    return Sides(tidy(left), (FactoredTerms(Integer(1), rising_first(terms)),))


def rising_first(terms: Iterable[Expr]) -> Terms:
    """The terms that are not zero, those with a plus sign first, else in their order."""
    tidied = (tidy(term) for term in terms if term != 0)
    return tuple(sorted(tidied, key=lambda term: bool(term.could_extract_minus_sign())))


def terms_of(total: Expr) -> tuple[Expr, ...]:
    """The terms of a sum."""
    return tuple(total.args) if total.is_Add else (total,)


def tidy(expression: Expr) -> Expr:
    """The expression with sums of negative terms inside products turned round: -(-1 - i) x is (1 + i) x."""
    if not (expression.is_Add or expression.is_Mul or (expression.is_Pow and expression.exp.is_even)):
        return expression
    parts = [tidy(part) for part in expression.args]
    if expression.is_Pow:
        base, exponent = parts
        return (-base if _falls(base) else base) ** exponent
    if expression.is_Add:
        return Add(*parts)
    turned = [_falls(part) for part in parts]
    if not any(turned):
        return Mul(*parts)
    return Mul((-1) ** sum(turned), *(-part if turn else part for part, turn in zip(parts, turned, strict=True)))


def _falls(part: Expr) -> bool:
    """Whether a sum has negative terms only."""
    return bool(part.is_Add) and all(term.could_extract_minus_sign() for term in part.args)


@dataclass(frozen=True, eq=False)
class Assembly:
    """Makes the rows of a state form.

    Args:
        form: the state form.
        laws: coefficients by their branches that are written otherwise than their parts have them.
        by_flow: links that stand in the state form by what their part lets through, although it follows from states.
    """

    form: StateForm
    laws: Mapping[int, Expr] = field(default_factory=dict)
    by_flow: frozenset[int] = frozenset()

    @cached_property
    def quantities(self) -> Quantities:
        """The symbols of the network."""
        return Quantities(self.form.graph, self.laws)

    def ends(self, branch: int) -> tuple[int, int]:
        """First and second node of a branch."""
        return self.form.graph.branches[branch].plus, self.form.graph.branches[branch].minus

    @cached_property
    def at_node(self) -> tuple[tuple[ThroughQuantity | int, ...], ...]:
        """For each node the flows, across stores and couplings that touch it, in the order of the parts."""
        touching: list[dict[ThroughQuantity | int, None]] = [{} for _ in self.form.graph.nodes]
        for branch in self.form.graph.branches:
            item = self.quantities.flow_of.get(branch.index, branch.index)
            touched = [node for _, plus, minus in branch.terms for node in (plus, minus)]
            for node in touched or (branch.plus, branch.minus):
                if node != GROUND:
                    touching[node][item] = None
        return tuple(tuple(items) for items in touching)

    def balance(self, node: int) -> Sides:
        """Stores of the node against everything that drives or loads it."""
        items = self.at_node[node]
        stores = [item for item in items if isinstance(item, int) and self.ends(item) == (node, GROUND)]
        inertia = Add(*map(self.quantities.law, stores))
        left = Mul(inertia, rate_of(self.quantities.node(node))) if stores else Integer(0)
        return sides(left, (self.received(item, node) for item in items if item not in stores))

    def received(self, item: ThroughQuantity | int, node: int) -> Expr:
        """What a node receives through a flow, an across store or a coupling."""
        if isinstance(item, ThroughQuantity):
            return (1 if item.minus == node else -1) * item.sign * self.quantities.through(item)
        return -Add(*(gain * self.stored(item) for gain in self.incidence(item, node)))

    def incidence(self, branch: int, node: int) -> Iterator[Expr]:
        """Factors with which a branch takes its through variable from a node."""
        graph, record = self.form.graph, self.form.graph.branches[branch]
        for coefficient, plus, minus in record.balances or ((Integer(1), record.plus, record.minus),):
            for end, sign in ((plus, 1), (minus, -1)):
                if end == node:
                    yield sign * graph.in_network_symbols(coefficient, record)

    def stored(self, branch: int) -> Expr:
        """The through variable of an across store or of a coupling."""
        if self.form.graph.branches[branch].terms:
            symbol, sign = self.quantities.passing(branch)
            return sign * symbol
        across = self.quantities.across(self.ends(branch))
        sign = -1 if across.could_extract_minus_sign() else 1
        return sign * self.quantities.law(branch) * rate_of(sign * across)

    def loop(self, link: int) -> Sides:
        """Across variable of a link as the sum over the tree branches of its loop."""
        return sides(self.quantities.across(self.ends(link)), self.around(link))

    def kind(self, branch: int) -> Kind:
        """What the law of a branch is."""
        return self.form.graph.branches[branch].template.kind

    def factors(self, link: int) -> tuple[tuple[int, Expr], ...]:
        """The tree branches of a link's loop with their factors, without couplings, which have nothing across."""
        return self.referred(self.form.tree.loops[link])

    def balanced(self, link: int) -> tuple[tuple[int, Expr], ...]:
        """The tree branches that balance a link's through variable with their factors, without couplings."""
        return self.referred(self.form.tree.cutsets[link])

    def referred(self, row: Mapping[int, Number]) -> tuple[tuple[int, Expr], ...]:
        """A sum of tree branches as pairs of branch and factor, without couplings."""
        trees = [tree for tree in row if self.kind(tree) is not Kind.COUPLING]
        return tuple(zip(trees, simplified(row[tree] for tree in trees), strict=True))

    def around(self, link: int, without: Kind | None = None) -> Terms:
        """The across variables in a link's loop, but for those of a kind."""
        return tuple(
            gain * self.quantities.across(self.ends(tree))
            for tree, gain in self.factors(link)
            if self.kind(tree) is not without
        )

    def is_sum(self, branch: int) -> bool:
        """Whether a law is a sum of what it reads of others, so that it is printed where it stands."""
        template = self.form.graph.branches[branch].template
        factors = {symbol: template.printed.diff(symbol) for symbol in template.reads}
        total = Add(*(symbol * factor for symbol, factor in factors.items()))
        left = (template.printed - total).expand()
        moving = (*factors, ACROSS, INTEGRAL, TIME)
        return bool(factors) and left == 0 and not any(factor.has(*moving) for factor in factors.values())

    def in_place(self, terms: Iterable[Expr]) -> Terms:
        """Terms in which prescribed across variables that are sums stand by these."""
        replaced = (term.xreplace(self._sums) for term in terms)
        return tuple(part for term in replaced for part in terms_of(term.expand(deep=False)))

    @cached_property
    def _sums(self) -> dict[Expr, Expr]:
        sums: dict[Expr, Expr] = {}
        for branch in self.form.across_sources:
            across = self.quantities.across(self.ends(branch))
            if self.is_sum(branch):
                (letter,) = across.free_symbols
                sums[letter] = across.coeff(letter) * self.quantities.law(branch)
        return sums

    def coupling(self, branch: int) -> Sides:
        """What an ideal coupling imposes on the speeds of its nodes."""
        graph, record = self.form.graph, self.form.graph.branches[branch]
        pairs = [(graph.in_network_symbols(factor, record), ends) for factor, *ends in record.terms]
        terms = [tidy(factor * self.quantities.across((ends[0], ends[1]))) for factor, ends in pairs]
        left = [term for term in terms if not term.could_extract_minus_sign()]
        return sides(Add(*left), (-term for term in terms if term.could_extract_minus_sign()))

    def law_of_flow(self, flow: ThroughQuantity, across: Expr | None = None) -> Sides:
        """A flow's through variable by the laws of its branches."""
        terms = (flow.sign * self.through_law(branch, across) for branch in flow.branches)
        return sides(self.quantities.through(flow), terms)

    def through_law(self, branch: int, across: Expr | None = None) -> Expr:
        """The through variable of a branch in terms of what is across it."""
        kind, law = self.form.graph.branches[branch].template.kind, self.quantities.law(branch)
        if kind is Kind.THROUGH_STORE:
            return self.quantities.store(branch)
        across = self.quantities.across(self.ends(branch)) if across is None else across
        if kind is Kind.CONDUCTANCE:
            return law * across
        return law.xreplace({ACROSS: across, INTEGRAL: self.quantities.integral(branch)})

    def law_of_store(self, branch: int) -> Sides:
        """A compliance's law: its through variable changes with what is across it."""
        stiffness, rate = self.quantities.law(branch), rate_of(self.quantities.store(branch))
        across = self.quantities.across(self.ends(branch))
        if stiffness.is_Pow and stiffness.exp == -1:
            return sides(stiffness.base * rate, (across,))
        return sides(rate, (stiffness * across,))

    @cached_property
    def opposite(self) -> dict[int, int]:
        """For each wave that arrives at an end of a line the one that arrives at the other end."""
        ends = self.form.waves
        return {end: ends[place ^ 1] for place, end in enumerate(ends)}

    def law_of_history(self, branch: int, across: Expr | None = None) -> Sides:
        """What arrives at an end of a line: what left the other end, with `across` at it, a delay ago."""
        other = self.opposite[branch]
        across = self.quantities.across(self.ends(other)) if across is None else across
        law = self.quantities.printed(branch).xreplace({ACROSS: across, HISTORY: self.quantities.history(other)})
        return sides(self.quantities.history(branch), (law,))

    def law_of_source(self, branch: int) -> Sides:
        """A prescribed across variable."""
        return sides(self.quantities.across(self.ends(branch)), (self.quantities.law(branch),))

    @cached_property
    def cutsets(self) -> dict[int, tuple[tuple[int, Expr], ...]]:
        """For each tree branch the links of its cutset with their factors, in the order of the branch table."""
        rows, members = sorted(self.form.tree.cutsets.items()), dict[int, list[tuple[int, Expr]]]()
        gains = iter(simplified(gain for _, row in rows for gain in row.values()))
        for link, row in rows:
            for tree in row:
                members.setdefault(tree, []).append((link, next(gains)))
        return {tree: tuple(links) for tree, links in members.items()}

    @cached_property
    def lumped(self) -> frozenset[int]:
        """Links that are printed by their flow's symbol: laws and sources whose flow lies wholly outside the tree."""
        flows = dict.fromkeys(self.quantities.flow_of[law] for law in self.form.laws if not self.is_sum(law))
        return frozenset(branch for flow in flows if all(map(self._is_free, flow.branches)) for branch in flow.branches)

    def _is_free(self, branch: int) -> bool:
        """Whether a branch is a link that shares no unknown with the conductances of the tree."""
        if branch not in self.form.tree.loops:
            return False
        coupled = any(self.kind(tree) is Kind.CONDUCTANCE for tree in self.form.tree.loops[branch])
        return self.kind(branch) is not Kind.CONDUCTANCE or not coupled

    def out_of(self, tree: int, left_out: Kind | None = None) -> Terms:
        """Through variables that drive a tree branch: minus those of the links in its cutset."""
        terms: dict[ThroughQuantity | int, Terms] = {}
        for link, gain in self.cutsets.get(tree, ()):
            if self.kind(link) is left_out:
                continue
            flow = self.quantities.flow_of.get(link)
            if flow is not None and (link in self.lumped or link in self.by_flow):
                terms[flow] = (-gain * flow.sign * self.quantities.through(flow),)
            elif flow is None:
                terms[link] = (-gain * self.stored(link),)
            else:
                term = -gain * self.through_law(link, Add(*self.around(link)))
                terms[link] = terms_of(term.expand()) if self.is_sum(link) else (term,)
        return tuple(term for of_link in terms.values() for term in of_link)
