"""Cramer's rule: an unknown of the tableau as the quotient of two determinants, polynomials in s; exact."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import networkx as nx
import numpy as np
from sympy import Expr, Integer, Poly, Rational, Symbol, lcm, prime, sring, together
from sympy.combinatorics import Permutation

from shaftwork.equations.point_slopes import exact, fraction
from shaftwork.equations.tableau import INPUT, S, Sum

Polynomial = Any
"""An element of a ring of sympy's sparse polynomials."""
Numbers = dict[Symbol, Rational]
"""Values of symbols."""
MOST_TERMS = 5_000
"""Terms of the minors on the way to a determinant; one of more is longer than anyone reads, and takes minutes."""
MOST_NUMBERS = 200_000
"""Terms of the minors where these are polynomials in s alone."""
SHORT = 600
"""Terms of a quotient up to which all common factors are looked for: it takes seconds."""


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
    most = MOST_TERMS if numbers is None else MOST_NUMBERS
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
    if not (above and below) or len(above) + len(below) <= SHORT or ring.ngens == 1:
        return above.cancel(below) if below else (above, below)
    powers = np.min([*above.itermonoms(), *below.itermonoms()], axis=0)
    above, below = (p.exquo(ring.term_new(tuple(powers.tolist()), ring.domain.one)) for p in (above, below))
    place = ring.symbols.index(S)
    primes = [(x, prime(7 + 3 * k)) for k, x in enumerate(ring.gens) if k != place]
    evaluated = [p.evaluate(primes) for p in (above, below)]
    if evaluated[0].gcd(evaluated[1]).is_ground:
        return above, below
    raise TooManyTermsError
