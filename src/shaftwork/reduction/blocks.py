"""Coupled unknowns, block by block, as sympy expressions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import networkx as nx
from sympy import Add, Expr, Integer, Matrix, Symbol

LARGEST_BLOCK = 3
"""Coupled unknowns that are solved symbolically; the formulas for more are longer than anyone reads."""


class BlockTooLargeError(Exception):
    """The rows have no closed form that anyone would read."""


@dataclass(frozen=True)
class Tie:
    """A dependent store: y = capacity (row x + given) acts back on the stores that carry it, each by its share of y.

    Args:
        capacity: of the store.
        shares: of y, by unknown.
        row: what its rate has of each unknown rate x.
        given: what its rate has besides, of prescribed ones.
    """

    capacity: Expr
    shares: Mapping[int, Expr]
    row: Mapping[int, Expr]
    given: Expr


def solve_tied(own: Mapping[int, Expr], ties: Sequence[Tie], right: Mapping[int, Expr]) -> tuple[Expr, ...]:
    """Solve own x + shares y = right for the rates x of stores, where y are the reactions of dependent ones.

    Law: few unknowns are solved for with y put in. Of many that are tied by few, the reactions are solved for,
    (1 + capacity row shares / own) y = capacity (row right / own + given), and each rate follows from them by itself.

    Raises:
        BlockTooLargeError: neither has a block of `LARGEST_BLOCK` or fewer.
    """
    driven = dict(right)
    matrix = {(tree, tree): capacity for tree, capacity in own.items()}
    for tie in ties:
        for first, share in tie.shares.items():
            driven[first] -= share * tie.capacity * tie.given
            for second, gain in tie.row.items():
                matrix[first, second] = matrix.get((first, second), Integer(0)) + share * tie.capacity * gain
    try:
        return solve_blocks(matrix, tuple(own), driven)
    except BlockTooLargeError:
        return _by_reactions(own, ties, right)


def _by_reactions(own: Mapping[int, Expr], ties: Sequence[Tie], right: Mapping[int, Expr]) -> tuple[Expr, ...]:
    """The rates by the reactions of what is carried by several; what is carried by one alone is added to that one."""
    whole, driven = dict(own), dict(right)
    for tie in ties:
        if len(tie.row) == 1 and tie.row.keys() == tie.shares.keys():
            ((tree, share),) = tie.shares.items()
            whole[tree] += share * tie.capacity * tie.row[tree]
            driven[tree] -= share * tie.capacity * tie.given
    several = [tie for tie in ties if len(tie.row) > 1 or tie.row.keys() != tie.shares.keys()]
    matrix = {(k, k): Integer(1) for k in range(len(several))}
    for k, tie in enumerate(several):
        for m, other in enumerate(several):
            common = [tree for tree in tie.row if tree in other.shares]
            if common:
                felt = Add(*(tie.row[tree] * other.shares[tree] / whole[tree] for tree in common))
                matrix[k, m] = matrix.get((k, m), Integer(0)) + tie.capacity * felt
    apart = {
        k: tie.capacity * Add(tie.given, *(gain * driven[tree] / whole[tree] for tree, gain in tie.row.items()))
        for k, tie in enumerate(several)
    }
    reactions = solve_blocks(matrix, range(len(several)), apart)
    for tie, reaction in zip(several, reactions, strict=True):
        for tree, share in tie.shares.items():
            driven[tree] -= share * reaction
    return tuple(driven[tree] / capacity for tree, capacity in whole.items())


def solve_blocks(
    matrix: Mapping[tuple[int, int], Expr], unknowns: Sequence[int], right: Mapping[int, Expr]
) -> tuple[Expr, ...]:
    """Solve a sparse symbolic system block by block of coupled unknowns.

    Raises:
        BlockTooLargeError: a block has more than `LARGEST_BLOCK` unknowns.
    """
    links: nx.Graph[int] = nx.Graph()
    links.add_nodes_from(unknowns)
    links.add_edges_from(matrix)
    solution: dict[int, Expr] = {}
    order = {unknown: k for k, unknown in enumerate(unknowns)}
    for component in nx.connected_components(links):
        block = sorted(component, key=order.__getitem__)
        if len(block) > LARGEST_BLOCK:
            raise BlockTooLargeError
        if len(block) == 1:
            (only,) = block
            solution[only] = right[only] / matrix[only, only]
            continue
        solution.update(zip(block, _cramer(matrix, block, right), strict=True))
    return tuple(solution[unknown] for unknown in unknowns)


def _cramer(matrix: Mapping[tuple[int, int], Expr], block: Sequence[int], right: Mapping[int, Expr]) -> Iterator[Expr]:
    """Solve one block by cofactors.

    The cofactors are made of single symbols, and the entries put in afterwards: sympy would otherwise try to cancel
    factors of long entries, which takes minutes for a few geared inertias.
    """
    entries = {
        (i, j): matrix[first, second]
        for i, first in enumerate(block)
        for j, second in enumerate(block)
        if (first, second) in matrix
    }
    names = {place: Symbol(f"m{place[0]}{place[1]}") for place in entries}
    square = Matrix(len(block), len(block), lambda i, j: names.get((i, j), Integer(0)))
    put_in = {names[place]: entry for place, entry in entries.items()}
    adjugate = square.adjugate().xreplace(put_in)
    determinant = square.det(method="berkowitz").xreplace(put_in)
    for i in range(len(block)):
        yield Add(*(adjugate[i, j] * right[other] for j, other in enumerate(block))) / determinant
