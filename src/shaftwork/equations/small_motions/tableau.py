"""Kirchhoff's equations of small motions in the image domain: a row for each unknown, with entries of s and parameters.

    sum of i = 0,   i = s C v,   i = G v,   s i = K v,   i = k v + k_q q + sum of k_r (what the law reads),   s q = v

They are the balances, laws and couplings of the network whose laws have their slopes at a point, where sources are zero
but for inputs. No state is chosen: what couplings make dependent, and what turns without inertia, is one more unknown.
Cramer's rule gives an unknown as the quotient of two determinants, polynomials in s; exact.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import networkx as nx
import numpy as np
from sympy import Add, Dummy, Expr, Integer, Mul, Poly, Rational, Symbol, lcm, prime, sring, together
from sympy.combinatorics import Permutation

from shaftwork.components.base import Signal
from shaftwork.components.branches import INTEGRAL
from shaftwork.core.errors import CompileError
from shaftwork.equations.assembly import Assembly
from shaftwork.equations.quantities import rate_of
from shaftwork.equations.small_motions.point_slopes import exact, fraction
from shaftwork.formulation.form import StateForm
from shaftwork.formulation.sampling_instants import refuse_sampled
from shaftwork.network.graph import GROUND, GraphBranch, GraphPart
from shaftwork.network.kinds import Kind

if TYPE_CHECKING:
    from shaftwork.equations.records import Equations
    from shaftwork.equations.small_motions.point_slopes import LawSlopes

S = Symbol("s")
"""The variable of the image domain, 1/s."""
INPUT = Dummy("input", real=True)
"""Stands for the input."""
Sum = Mapping[Symbol, Expr]
"""Factors of unknowns, and of the input."""
CARRYING = (Kind.THROUGH_STORE, Kind.ACROSS_SOURCE, Kind.COUPLING)
"""Branches through which passes one more unknown, which no law gives by what is across."""
Polynomial = Any
"""An element of a ring of sympy's sparse polynomials."""
Numbers = dict[Symbol, Rational]
"""Values of symbols."""


def linear_form(equations: Equations, slopes: LawSlopes) -> StateForm:
    """The state form with laws by their slopes, in letters of the network, and sources at zero.

    Raises:
        CompileError: a shaft is a travelling wave: no polynomials and matrices tell its motion.
    """
    form = equations.form
    refuse_sampled(form, "it has no transfer functions")
    if form.waves:
        raise CompileError(
            f"Shaft '{form.graph.part_of(form.waves[0]).name}' is a travelling wave, whose transfer functions are no "
            "rational functions of s. Take model=Spectral(8), or frequency_response for their values."
        )
    laws: dict[int, Expr] = {}
    for branch in form.graph.branches:
        own = equations.assembly.quantities.own_law(branch.index)
        match branch.template.kind:
            case Kind.THROUGH_SOURCE:
                laws[branch.index] = Integer(0)
            case Kind.LAW | Kind.ACROSS_SOURCE:
                laws[branch.index] = Add(*(slope * by for by, slope in slopes.of(branch).items()))
            case Kind.COUPLING:
                pass
            case Kind.ACROSS_STORE:  # of one that changes the part that stays; a law has the rest
                laws[branch.index] = form.law_of(branch.index) if branch.template.printed.has(INTEGRAL) else own
            case _:
                laws[branch.index] = own
    return with_laws(form, laws)


def with_laws(form: StateForm, laws: Mapping[int, Expr]) -> StateForm:
    """The form with other laws, in symbols of the network."""

    def changed(branch: GraphBranch) -> GraphBranch:
        law = laws[branch.index]
        template = dataclasses.replace(branch.template, law=law, printed=law, symbols=())
        return dataclasses.replace(branch, template=template)

    branches = (changed(branch) if branch.index in laws else branch for branch in form.graph.branches)
    return dataclasses.replace(form, graph=dataclasses.replace(form.graph, branches=tuple(branches)))


class Tableau:
    """The rows, made as they are asked for.

    Args:
        form: the linear form, with the input as the law of a source.
    """

    def __init__(self, form: StateForm) -> None:
        self._graph, self._assembly, self._redundant = form.graph, Assembly(form), form.tree.redundant
        self.quantities = quantities = self._assembly.quantities
        self._nodes = {quantities.node(number): number for number in range(len(form.graph.nodes))}
        self._integrals = {quantities.integral(k): k for part in form.graph.integrated for k in part}
        carrying = [k for k, branch in enumerate(form.graph.branches) if branch.template.kind in CARRYING]
        self._branches = {quantities.passing(k)[0]: k for k in carrying}

    def rows(self, read: Sum) -> dict[Symbol, Sum]:
        """As many rows as unknowns, each by the one that it is the row of; with what a sum contains among them."""
        rows = {symbol: self.sum(Add(*self._leaving[number])) for symbol, number in self._nodes.items()}
        unknowns = [unknown for row in (*rows.values(), read) for unknown in row]
        while missing := [unknown for unknown in dict.fromkeys(unknowns) if unknown not in rows and unknown != INPUT]:
            added = {unknown: self.sum(self._imposed(unknown)) for unknown in missing}
            rows |= added
            unknowns = [unknown for row in added.values() for unknown in row]
        return rows

    def sum(self, expression: Expr) -> Sum:
        """A linear expression in quantities and their rates, as factors of the unknowns and the input."""
        factors: dict[Symbol, list[Expr]] = {}
        terms = [(Integer(1), expression.xreplace(self._in_unknowns))]
        while terms:  # sympy would differentiate by the product rule
            factor, term = terms.pop()
            if term.is_Add:
                terms += ((factor, part) for part in reversed(term.args))
            elif term.is_Mul:
                moving = next(part for part in term.args if any(map(self._moves, part.free_symbols)))
                terms.append((Mul(factor, *(part for part in term.args if part is not moving)), moving))
            elif term != 0:
                factors.setdefault(term, []).append(factor)
        summed = {symbol: Add(*of) for symbol, of in factors.items()}
        return {symbol: factor for symbol, factor in summed.items() if factor != 0}

    def _moves(self, symbol: Symbol) -> bool:
        return symbol in self._nodes or symbol in self._branches or symbol in self._integrals or symbol == INPUT

    @cached_property
    def _in_unknowns(self) -> dict[Expr, Expr]:
        """Differences of speeds by those of nodes, and rates by s times what they are rates of."""
        pairs = {
            p.symbol: self.quantities.node(a) - self.quantities.node(b) for (a, b), p in self.quantities.pairs.items()
        }
        moving = (*self._nodes, *self._branches, *self._integrals)
        return pairs | {rate_of(symbol): S * pairs.get(symbol, symbol) for symbol in (*moving, *pairs)}

    def integral(self, branch: int) -> Expr:
        """The integral of what is across a branch, one more unknown where no law reads it."""
        symbol = self.quantities.integral(branch)
        self._integrals.setdefault(symbol, branch)
        return symbol

    def signal(self, part: GraphPart, signal: Signal) -> Expr:
        """A quantity of a part."""
        if signal.kind == "across":
            plus, minus = map(part.node_at, signal.ends)
            return signal.sign * (self.quantities.node(plus) - self.quantities.node(minus))
        branches = [branch for branch in self._graph.branches if self._graph.parts[branch.part].name == part.name]
        if signal.kind == "through":
            return Add(
                *(
                    signal.sign * sign * self._graph.in_network_symbols(factor, branch) * self._carried(branch)
                    for branch in branches
                    for factor, *ends in branch.template.balances or ((Integer(1), *branch.template.ends),)
                    for end, sign in zip(ends, (1, -1), strict=True)
                    if end == signal.ends[0]
                )
            )
        stores = (branch for branch in branches if branch.template.kind is Kind.THROUGH_STORE)
        store = next(branch for branch in stores if signal.label in ("", branch.template.label)).index
        factor = 1 / self.quantities.law(store) if signal.kind == "twist" else Integer(signal.sign)
        return factor * self.quantities.store(store)

    def _carried(self, branch: GraphBranch) -> Expr:
        """What passes through a branch."""
        if branch.index in self._redundant:  # it says what other couplings have said
            return Integer(0)
        if branch.template.kind is Kind.ACROSS_STORE:
            return self.quantities.law(branch.index) * self.quantities.rate(branch.index)
        if branch.template.kind in CARRYING:
            symbol, sign = self.quantities.passing(branch.index)
            return sign * symbol
        return self._assembly.through_law(branch.index)

    @cached_property
    def _leaving(self) -> tuple[list[Expr], ...]:
        """What leaves each node through the branches."""
        leaving = tuple(list[Expr]() for _ in self._nodes)
        for branch in self._graph.branches:
            carried, ends = self._carried(branch), branch.balances or ((Integer(1), branch.plus, branch.minus),)
            for coefficient, *nodes in ends:
                factor = self._graph.in_network_symbols(coefficient, branch)
                for node, sign in zip(nodes, (1, -1), strict=True):
                    if node != GROUND:
                        leaving[node].append(sign * factor * carried)
        return leaving

    def _imposed(self, unknown: Symbol) -> Expr:
        """The row of an integral, or of what passes through a branch: what its law says less what is so."""
        if unknown in self._integrals:
            plus, minus = self._assembly.ends(self._integrals[unknown])
            return rate_of(unknown) - self.quantities.across((plus, minus))
        branch, assembly = self._branches[unknown], self._assembly
        law = {
            Kind.THROUGH_STORE: assembly.law_of_store,
            Kind.ACROSS_SOURCE: assembly.law_of_source,
            Kind.COUPLING: assembly.coupling,
        }[assembly.kind(branch)](branch)
        return law.left - Add(*(factor * Add(*terms) for factor, terms in law.groups))


class TooManyTermsError(Exception):
    """Polynomials on the way to a determinant grow beyond what is asked for."""


def quotient(rows: Mapping[Symbol, Sum], read: Sum, numbers: Numbers | None) -> tuple[Polynomial, Polynomial]:
    """A sum of unknowns over the input, as two polynomials of one ring without common factors.

    Args:
        rows: those of all unknowns; only those that have to do with what is read are taken.
        read: factors of the unknowns and of the input in what is read.
        numbers: of all symbols but s; None keeps them.

    Raises:
        TooManyTermsError: the polynomials on the way are too long.
    """
    rows = _connected(rows, read)
    columns = {unknown: k for k, unknown in enumerate((*rows, INPUT))}
    bordered = [{columns[unknown]: entry for unknown, entry in row.items()} for row in (*rows.values(), read)]
    if numbers is None:
        cleared = [_cleared(row) for row in bordered]
    else:
        cleared = [({k: _entry(e, numbers) for k, e in row.items()}, Integer(1)) for row in bordered]
    entries = [entry for row, _ in cleared for entry in row.values()]
    ring, (_, factor, *polynomials) = sring([S, cleared[-1][1], *entries])
    in_order = iter(polynomials)
    matrix = [{column: next(in_order) for column in row} for row, _ in cleared]
    inner = [{column: entry for column, entry in row.items() if column < len(rows)} for row in matrix[:-1]]
    # Terms of the minors on the way: with letters, more are longer than anyone reads and take minutes.
    most = 5_000 if numbers is None else 200_000
    return _reduced(_determinant(matrix, ring.one, most), _determinant(inner, ring.one, most) * factor)


def _connected(rows: Mapping[Symbol, Sum], read: Sum) -> Mapping[Symbol, Sum]:
    """The rows of the unknowns on which those that are read depend, or which depend on these."""
    trains: nx.Graph[Symbol] = nx.Graph()
    trains.add_nodes_from(rows)
    trains.add_edges_from((key, other) for key, row in rows.items() for other in row if other != INPUT)
    reached = set[Symbol]().union(
        *(nx.node_connected_component(trains, unknown) for unknown in read if unknown != INPUT)
    )
    return {key: row for key, row in rows.items() if key in reached}


def _cleared(row: Mapping[int, Expr]) -> tuple[dict[int, Expr], Expr]:
    """A row without fractions of symbols, and by what it has been multiplied."""
    parts = {column: exact(together(entry)).as_numer_denom() for column, entry in row.items()}
    common = Integer(1)
    for _, below in parts.values():
        common = lcm(common, below)
    return {column: (above * (common / below).cancel()).expand() for column, (above, below) in parts.items()}, common


def _entry(expression: Expr, numbers: Numbers) -> Expr:
    """The same as an expression; most are numbers, which need no polynomial."""
    value = exact(expression).xreplace(numbers)
    return value if value.is_Rational else in_numbers(value, numbers).as_expr()


def in_numbers(expression: Expr, numbers: Numbers) -> Poly:
    """A polynomial in s whose coefficients are fractions."""
    polynomial = Poly(exact(expression).xreplace(numbers), S)
    return Poly([fraction(coefficient) for coefficient in polynomial.all_coeffs()], S)


def _determinant(rows: Sequence[Mapping[int, Polynomial]], one: Polynomial, most: int) -> Polynomial:
    """The determinant of a square matrix, expanded row by row (Laplace).

    The minors known at a time are those of the rows so far, by their columns. One without a column that no later row
    has is dropped. Rows that share columns follow each other, so that of a chain or tree they are few.

    Args:
        rows: nonzero entries by column.
        one: of the ring.
        most: terms that all minors may have.

    Raises:
        TooManyTermsError: they have more.
    """
    order = _order(rows)
    last = {column: place for place, row in enumerate(order) for column in rows[row]}
    if len(last) < len(rows):
        return 0 * one
    closing = [0] * len(order)
    for column, place in last.items():
        closing[place] |= 1 << column
    closed, minors = 0, {0: one}
    for place, row in enumerate(order):
        closed |= closing[place]
        larger: dict[int, Polynomial] = {}
        for taken, minor in minors.items():
            for column, entry in rows[row].items():
                both = taken | 1 << column
                if both == taken or closed & ~both:
                    continue
                term = minor * entry
                larger[both] = larger.get(both, 0) + (-term if (taken >> column).bit_count() % 2 else term)
        minors = {taken: minor for taken, minor in larger.items() if minor}
        if sum(map(len, minors.values())) > most:
            raise TooManyTermsError
    return Permutation(order).signature() * minors.get(closed, 0 * one)


def _order(rows: Sequence[Mapping[int, Polynomial]]) -> list[int]:
    """Each time the row by which the fewest columns are begun, or among such the most are done with."""
    holders: dict[int, set[int]] = {}
    for number, row in enumerate(rows):
        for column in row:
            holders.setdefault(column, set()).add(number)
    left, begun, order = dict.fromkeys(range(len(rows))), set[int](), list[int]()
    while left:
        growths = {
            number: sum((column not in begun) - (holders[column] == {number}) for column in rows[number])
            for number in left
        }
        taken = min(left, key=growths.__getitem__)
        del left[taken]
        order.append(taken)
        begun |= rows[taken].keys()
        for column in rows[taken]:
            holders[column].discard(taken)
    return order


def _reduced(above: Polynomial, below: Polynomial) -> tuple[Polynomial, Polynomial]:
    """The same quotient without common factors.

    Of a long one only factors that hold s are looked for: where numerator and denominator have none in common for one
    choice of the parameters, they have none at all.

    Raises:
        TooManyTermsError: a long one has such a factor.
    """
    ring = above.ring
    # All common factors of 600 terms take seconds to find.
    if not (above and below) or len(above) + len(below) <= 600 or ring.ngens == 1:
        return above.cancel(below) if below else (above, below)
    powers = np.min([*above.itermonoms(), *below.itermonoms()], axis=0)
    above, below = (p.exquo(ring.term_new(tuple(powers.tolist()), ring.domain.one)) for p in (above, below))
    place = ring.symbols.index(S)
    primes = [(x, prime(7 + 3 * k)) for k, x in enumerate(ring.gens) if k != place]
    evaluated = [p.evaluate(primes) for p in (above, below)]
    if evaluated[0].gcd(evaluated[1]).is_ground:
        return above, below
    raise TooManyTermsError
