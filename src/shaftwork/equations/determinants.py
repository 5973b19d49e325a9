"""Determinants of sparse matrices of polynomials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

Polynomial = Any
"""An element of a ring of sympy's sparse polynomials."""
MOST_TERMS = 5_000
"""Terms of the minors on the way to a determinant; one of more is longer than anyone reads, and takes minutes."""


class TooManyTermsError(Exception):
    """Polynomials on the way to a determinant grow beyond what is asked for."""


def determinant(rows: Sequence[Mapping[int, Polynomial]], one: Polynomial, most: int = MOST_TERMS) -> Polynomial:
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
        made: dict[int, Polynomial] = {}
        for taken, minor in minors.items():
            for column, entry in rows[row].items():
                both = taken | 1 << column
                if both == taken or closed & ~both:
                    continue
                term = minor * entry
                made[both] = made.get(both, 0) + (-term if (taken >> column).bit_count() % 2 else term)
        minors = {taken: minor for taken, minor in made.items() if minor}
        if sum(map(len, minors.values())) > most:
            raise TooManyTermsError
    return -minors.get(closed, 0 * one) if _is_odd(order) else minors.get(closed, 0 * one)


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


def _is_odd(order: Sequence[int]) -> bool:
    """Whether a permutation is made of an odd number of exchanges."""
    odd, seen = False, set[int]()
    for start in range(len(order)):
        place, length = start, 0
        while place not in seen:
            seen.add(place)
            place, length = order[place], length + 1
        odd ^= length > 0 and length % 2 == 0
    return odd
