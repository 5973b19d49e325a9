"""Rows in which terms run along a shaft: the sum of these terms under one letter, so that a row stays one line.

The end of a spectral shaft receives sum_k w_{k,j} tau_k, and its inertia is J' L h_j. The rows of an assembly have the
weights w and h as numbers. Here the numbers are recognised, exactly to rounding; a row in which they are others stays
as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from sympy import Add, Expr, Float, Rational, Symbol

from shaftwork.components.shaft_models import Spectral
from shaftwork.components.shafts import Shaft
from shaftwork.equations.assembly import Assembly, FactoredTerms, Sides, Terms, rising_first
from shaftwork.equations.quantities import Quantities
from shaftwork.formulation.form import StateForm
from shaftwork.formulation.gains import LARGEST_DENOMINATOR
from shaftwork.network.graph import GraphPart
from shaftwork.network.kinds import Kind
from shaftwork.numerics.tolerances import TYPED


@dataclass(frozen=True, eq=False)
class SpectralShaft:
    """A shaft whose rows are printed as sums: its nodes, torques and weights.

    Args:
        part: the shaft.
        degree: of its spectral model.
        quantities: the symbols of the network.
        mark: superscript of its weights where shafts of the network have several degrees.
    """

    part: GraphPart
    degree: int
    quantities: Quantities
    mark: str

    @cached_property
    def inside(self) -> frozenset[int]:
        """The nodes between its ends."""
        return frozenset(self.part.nodes[str(j)] for j in range(1, self.degree))

    @cached_property
    def twists(self) -> frozenset[int]:
        """The nodes whose speeds are its rates of twist."""
        return frozenset(self.part.nodes[f"twist{k}"] for k in range(self.degree))

    @property
    def ends(self) -> tuple[tuple[int, str], ...]:
        """Number and name of the nodes at its ends."""
        return ((0, "a"), (self.degree, "b"))

    @cached_property
    def links(self) -> frozenset[int]:
        """The springs and dampers along it."""
        branches = self.quantities.graph.branches
        return frozenset(k for k in self.part.branches if branches[k].plus in self.twists and not branches[k].terms)

    @cached_property
    def torques(self) -> tuple[Symbol, ...]:
        """What passes at the nodes of Gauss, with damping."""
        flows = dict.fromkeys(self.quantities.flow_of[link] for link in sorted(self.links))
        return tuple(map(self.quantities.through, flows))

    @cached_property
    def stores(self) -> tuple[Symbol, ...]:
        """The same without damping: states."""
        branches = self.quantities.graph.branches
        links = (link for link in sorted(self.links) if branches[link].template.kind is Kind.THROUGH_STORE)
        return tuple(map(self.quantities.store, links))

    @cached_property
    def couplings(self) -> tuple[int, ...]:
        """The branches that say what the rates of twist are."""
        return tuple(k for k in self.part.branches if self.quantities.graph.branches[k].terms)

    @cached_property
    def families(self) -> tuple[tuple[Symbol, ...], ...]:
        """The quantities that differ by a running number: all of a family stand where one of them is printed."""
        nodes = [self.part.nodes[str(j)] for j in range(1, self.degree)]
        twists = tuple(self.quantities.node(self.part.nodes[f"twist{k}"]) for k in range(self.degree))
        sums = tuple(self.sum_at(number) for number, _ in self.ends)
        speeds, angles = (tuple(map(of, nodes)) for of in (self.quantities.node, self.quantities.angle))
        return (speeds, angles, twists, self.stores, (*self.torques, *sums))

    def sum_at(self, end: int) -> Symbol:
        """Stands for sum_k w_{k,j} tau_k."""
        return Symbol(f"{self.part.name}, sum at {end}", real=True)

    def share(self, node: int | str) -> Symbol:
        """Stands for h_j, the share of a node in the inertia of the shaft."""
        return Symbol(f"h_{node} of {self.degree}", real=True)

    @property
    def weight(self) -> Symbol:
        """Stands for lambda_k, the share of a torque in the length of the shaft."""
        return Symbol(f"lambda of {self.degree}", real=True)

    @cached_property
    def laws_at_ends(self) -> dict[int, Expr]:
        """Inertia and bearing friction of the ends by their branches, with h."""
        graph, laws = self.quantities.graph, dict[int, Expr]()
        of_kinds = {Kind.ACROSS_STORE: "line_inertia", Kind.CONDUCTANCE: "friction"}
        numbers = {end: number for number, end in self.ends}
        for index in self.part.branches:
            template = graph.branches[index].template
            if template.kind in of_kinds and template.ends[0] in numbers:
                per_length, length = (graph.symbol_of(self.part, k) for k in (of_kinds[template.kind], "length"))
                laws[index] = length * per_length * self.share(numbers[template.ends[0]])
        return laws

    @cached_property
    def weights(self) -> NDArray[np.float64]:
        """(n, 2) the weights w of both ends."""
        rows = (dict(row) for row in Spectral(self.degree).mesh().weights)
        return np.array([[row[0], row[self.degree]] for row in rows])

    def in_sums(self, terms: Terms) -> Terms:
        """Terms with those of the torques along the shaft as multiples of their sums at the ends.

        The terms as they are, where they are no such multiples.
        """
        numbers = {symbol: k for k, symbol in enumerate(self.torques)}
        multipliers = map(self.quantities.multiplier, self.couplings)
        numbers |= {symbol: k for k, symbol in enumerate(multipliers)}
        places = [place for place, term in enumerate(terms) if not numbers.keys().isdisjoint(term.free_symbols)]
        if not places:
            return terms
        factors: dict[Expr, NDArray[np.float64]] = {}
        for place in places:
            symbol, *others = numbers.keys() & terms[place].free_symbols
            factor = terms[place] / symbol
            if others or symbol in factor.free_symbols:
                return terms
            for part in Add.make_args(factor.expand()):
                number, rest = part.as_coeff_Mul()
                factors.setdefault(rest, np.zeros(self.degree))[numbers[symbol]] += float(number)
        summed: list[Expr] = []
        for rest, row in factors.items():
            multiples = np.linalg.lstsq(self.weights, row)[0]
            if np.abs(self.weights @ multiples - row).max() > TYPED * np.abs(row).max():
                return terms
            summed += (_exact(m) * rest * self.sum_at(end) for m, (end, _) in zip(multiples, self.ends, strict=True))
        kept = {place: (term,) for place, term in enumerate(terms) if place not in places}
        kept[places[0]] = tuple(term for term in summed if term != 0)
        return tuple(term for place in sorted(kept) for term in kept[place])


def spectral_shafts(quantities: Quantities) -> tuple[SpectralShaft, ...]:
    """The shafts whose rows are printed as sums: all spectral ones that have nodes inside."""
    resolved = [(part, part.component.resolved) for part in quantities.graph.parts if isinstance(part.component, Shaft)]
    degrees = [(part, model.n) for part, model in resolved if isinstance(model, Spectral) and model.n > 1]
    several = len({degree for _, degree in degrees}) > 1
    return tuple(SpectralShaft(part, n, quantities, f"^{{({n})}}" if several else "") for part, n in degrees)


def compact_assembly(form: StateForm, shafts: Sequence[SpectralShaft]) -> Assembly:
    """An assembly whose rows have the whole torques along these shafts, and h in the inertia of their ends."""
    laws = {branch: law for shaft in shafts for branch, law in shaft.laws_at_ends.items()}
    return Assembly(form, laws, frozenset(link for shaft in shafts for link in shaft.links))


def in_sums(row: Sides, shafts: Sequence[SpectralShaft]) -> Sides:
    """A row with the sums along these shafts under their letters."""
    groups = []
    for factor, terms in row.groups:
        shortened = terms
        for shaft in shafts:
            shortened = shaft.in_sums(shortened)
        groups.append(FactoredTerms(factor, terms if shortened is terms else rising_first(shortened)))
    return Sides(row.left, tuple(groups))


def _exact(value: float) -> Expr:
    """A whole number or a short fraction where a number is one to rounding, as 0, 1 and -1 are."""
    short = Rational(value).limit_denominator(LARGEST_DENOMINATOR)
    return short if abs(float(short) - value) <= TYPED * max(1.0, abs(value)) else Float(value)
