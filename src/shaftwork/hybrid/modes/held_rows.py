"""Explicit rows for all that holds and slips: what holds is numbers in them, and not another set of equations.

A law h that holds has no torque of its own, and in its place a reaction that keeps the speed across it at zero:

    lambda_h = R_h f,    x' = P f,

with f the rates without reactions. R and P are made of the inertias and of what holds; where nothing does, R is zero
and P the unit matrix. They have entries for the states of one group alone, which such laws connect.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace

import networkx as nx
from sympy import Add, Expr, Symbol

from shaftwork.formulation.explicit_rows import Rows
from shaftwork.formulation.form import StateForm

LARGEST_GROUP = 8
"""States that such laws may connect: each of their rows has as many terms."""
FRAME = -1

Entries = dict[tuple[int, int], Symbol]
"""Symbols in place of the entries of a matrix, by row and column."""


class HeldRows:
    """The rows of a network in which laws may hold their ends together.

    Args:
        rows: of the equations in which none does.
        laws: branches of what may hold; they are zero while they do.
        groups: the places of the states that they connect, see `groups`.
    """

    def __init__(self, rows: Rows, laws: Sequence[tuple[int, set[int]]], groups: Iterable[Collection[int]]) -> None:
        self.joins: Entries = {}
        """P, by places of states."""
        self.reactions: Entries = {}
        """R, by branch and place of a state."""
        rates, through = [*rows.rates], dict(rows.through)
        for group in map(sorted, groups):
            for place in group:
                rates[place] = _product(self.joins, "joins", place, group, rows.rates)
            for law, places in laws:
                if not places.isdisjoint(group):
                    through[law] += _product(self.reactions, "reaction", law, group, rows.rates)
        self.symbols = (*self.joins.values(), *self.reactions.values())
        """Parameters of the rows behind those of the network."""
        parameters = (*rows.parameters, *self.symbols)
        self.rows = replace(rows, parameters=parameters, rates=tuple(rates), through=through)


def _product(entries: Entries, name: str, row: int, columns: Iterable[int], rates: Sequence[Expr]) -> Expr:
    for column in columns:
        entries[row, column] = Symbol(f"{name} {row} {column}", real=True)
    return Add(*(entries[row, column] * rates[column] for column in columns))


def held_places(form: StateForm, link: int) -> set[int]:
    """Places of the states of speed that a link connects."""
    members = {*form.tree.loops.get(link, ()), *form.tree.cutsets.get(link, ())}
    return {place for place, tree in enumerate(form.across_states) if tree in members}


def groups(form: StateForm, laws: Iterable[int], others: Iterable[Collection[int]]) -> list[set[int]] | None:
    """The states that laws connect, or None where rows are not the place for what holds.

    They are where no element rests because others hold both of its ends: as a rule, each holds inertias of its own. Who
    carries would be another question, which an assembly of its own answers.

    Args:
        form: of the equations in which nothing holds.
        laws: branches of what may hold.
        others: places of states between which something else may become rigid.
    """
    graph = nx.Graph()
    for link in laws:
        places = held_places(form, link)
        ends = (*places, FRAME)[:2]
        if not 0 < len(places) <= 2 or graph.has_edge(*ends):
            return None
        graph.add_edge(*ends)
    sets = [set(group) for group in nx.connected_components(graph.subgraph([n for n in graph if n != FRAME]))]
    rigid = (*others, *(held_places(form, link) for link in form.dependent_across))
    taken = set[int]().union(*rigid)
    if not nx.is_forest(graph) or any(len(group) > LARGEST_GROUP or not taken.isdisjoint(group) for group in sets):
        return None
    return sets
