"""Parts that hold their ends together by a torque of their own, in the equations of the network in which they slip.

A stuck friction, a locked brake and an engaged clutch pass what keeps the speed across them at zero, their reaction:

    0 = G x,    x' = A x + B u + B_H lambda,    (G B_H) lambda = -G (A x + B u),

with G the speeds across what is held, from the speeds of inertias, and lambda in the place of its law. So one set of
equations serves for whatever holds and whatever slips; an impact by which they come to one speed takes the place of
lambda in the same system. Source: Brogliato, Nonsmooth Mechanics, 2016.

With R and P made of the inertias and of what holds, and f the rates without reactions, lambda_h = R_h f and x' = P f;
where nothing holds, R is zero and P the unit matrix. Both have entries for the states of one group alone, which such
laws connect. Where groups are small these are numbers in explicit rows (`HeldRows`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import networkx as nx
import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu
from sympy import Add, Expr, Symbol

from shaftwork.codegen.array_form.arrays import ArrayProgram, BoundArrays
from shaftwork.codegen.array_form.elements import Array, Factor
from shaftwork.codegen.array_form.matrices import LinearPart
from shaftwork.codegen.state_transfer import StateTransfer
from shaftwork.formulation.explicit_rows import Rows
from shaftwork.formulation.form import StateForm
from shaftwork.network.graph import GROUND
from shaftwork.numerics.tolerances import SAME

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
        self.projection: Entries = {}
        """P, by places of states."""
        self.reactions: Entries = {}
        """R, by branch and place of a state."""
        rates, through = [*rows.rates], dict(rows.through)
        for group in map(sorted, groups):
            for place in group:
                rates[place] = _product(self.projection, "projection", place, group, rows.rates)
            for law, places in laws:
                if not places.isdisjoint(group):
                    through[law] += _product(self.reactions, "reaction", law, group, rows.rates)
        self.symbols = (*self.projection.values(), *self.reactions.values())
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


def groups(
    form: StateForm, laws: Iterable[int], others: Iterable[Collection[int]], largest: int = 8
) -> list[set[int]] | None:
    """The states that laws connect, or None where rows are not the place for what holds.

    They are where no machine rests because others hold both of its ends: as a rule, each holds inertias of its own. Who
    carries would be another question, which equations of their own answer.

    Args:
        form: of the equations in which nothing holds.
        laws: branches of what may hold.
        others: places of states between which something else may become rigid.
        largest: so many states may be connected: each of their rows has as many terms. With 15, rows take twenty times
            as long to compile as matrices, and run slower.
    """
    graph = nx.Graph()
    for link in laws:
        places = held_places(form, link)
        ends = (*places, GROUND)[:2]
        if not 0 < len(places) <= 2 or graph.has_edge(*ends):
            return None
        graph.add_edge(*ends)
    sets = [set(group) for group in nx.connected_components(graph.subgraph([n for n in graph if n != GROUND]))]
    rigid = (*others, *(held_places(form, link) for link in form.dependent_across))
    taken = set[int]().union(*rigid)
    if not nx.is_forest(graph) or any(len(group) > largest or not taken.isdisjoint(group) for group in sets):
        return None
    return sets


class Joints:
    """Law branches whose torque holds the speed across them at zero.

    Args:
        form: of the equations.
        part: their matrices.
        branches: of the laws, all of them links; their speeds follow from those of the states.
    """

    def __init__(self, form: StateForm, part: LinearPart, branches: Sequence[int]) -> None:
        across, size = len(form.across_states), len(form.states)
        self.places = np.array([form.laws.index(branch) for branch in branches], dtype=np.intp)
        self._branches = tuple(branches)
        loops = sparse.csr_array(part.loops)[list(form.across_states)][:, list(branches)]
        G = sparse.csr_array(loops.T)
        G.resize((len(branches), size))  # what is no speed has no share
        B = sparse.csc_array(part.B)[:, self.places]
        followers = _followers(G)
        self.independent = followers is not None and not B[across:].nnz
        """Whether each of them holds inertias that the others do not."""
        if followers is None or not self.independent:
            return
        reactions, as_one = _reactions(G, B), _as_one(followers, size)
        self._B, self._reactions, self._as_one = Factor(B), Factor(reactions), Factor(as_one)
        self._projection = sparse.csr_array(as_one @ (sparse.eye_array(size, format="csr") + B @ reactions))
        self._part = part

    @cached_property
    def moving(self) -> LinearPart:
        """The equations with what holds moving as one, to which its own laws add nothing; explicit rows need none."""
        part, P, as_one = self._part, self._projection, self._as_one.sparse
        others = sparse.diags_array(np.where(np.isin(np.arange(part.B.shape[1]), self.places), 0.0, 1.0))
        return replace(part, A=P @ part.A, B=P @ part.B @ others, B1=P @ part.B1, C=part.C @ as_one)

    def reactions(self, rates: Array) -> Array:
        """(h,) or (h, k): what cancels rates (n,) or (n, k) in the speeds across."""
        return self._reactions @ rates

    def as_one(self, x: Array) -> Array:
        """States or rates in which what is held follows the others to the last bit."""
        return self._as_one @ x

    def entries(self, rows: HeldRows) -> Array:
        """(k,) the numbers of the symbols in rows: those of P and of R."""
        number = {branch: k for k, branch in enumerate(self._branches)}
        entries, first = np.zeros(len(rows.symbols)), len(rows.projection)
        entries[:first] = _at(self._projection, [*rows.projection])
        places = {k: (number[one], place) for k, (one, place) in enumerate(rows.reactions, first) if one in number}
        entries[[*places]] = _at(self._reactions.sparse, [*places.values()])
        return entries

    def met(self, x: Array) -> Array:
        """(n,) the states after an inelastic impact of what is held: every momentum is kept."""
        return self.as_one(x + self._B @ self.reactions(x))


def _at(matrix: Any, places: Sequence[tuple[int, int]]) -> Array:
    """(k,) entries of one of scipy.sparse."""
    rows, columns = np.array(places, dtype=np.intp).reshape(-1, 2).T
    return np.asarray(matrix[rows, columns], dtype=float).ravel() if rows.size else np.empty(0)


def _reactions(G: Any, B: Any) -> Any:
    """(h, n) sparse: R with G (1 + B R) = 0."""
    met = np.unique(G.indices)
    if not met.size:
        return sparse.csr_array(G.shape)
    solved = sparse.coo_array(-splu(sparse.csc_array(G @ B)).solve(G[:, met].toarray()))
    return sparse.csr_array((solved.data, (solved.row, met[solved.col])), shape=G.shape)


def _as_one(followers: Mapping[int, Mapping[int, float]], size: int) -> Any:
    """(n, n) sparse: each follower from the states that it follows, the others as they are."""
    entries = [(1.0, place, place) for place in range(size) if place not in followers]
    entries += [(gain, place, column) for place, row in followers.items() for column, gain in row.items()]
    gains, rows, columns = zip(*entries, strict=True) if entries else ((), (), ())
    return sparse.csr_array((np.array(gains), (rows, columns)), shape=(size, size))


def _followers(G: Any) -> Mapping[int, Mapping[int, float]] | None:
    """For each row of G x = 0 a state that follows from others, and its gains; None where rows depend on each other."""
    rows: dict[int, dict[int, float]] = {}
    followed: dict[int, dict[int, None]] = {}  # by state, those that follow it
    starts, columns, gains_of = G.indptr.tolist(), G.indices.tolist(), G.data.tolist()
    for first, last in pairwise(starts):
        row: dict[int, float] = {}
        for column, gain in zip(columns[first:last], gains_of[first:last], strict=True):
            for place, share in rows[column].items() if column in rows else ((column, 1.0),):
                row[place] = row.get(place, 0.0) + gain * share
        size = max(map(abs, gains_of[first:last]), default=0.0)
        row = {column: gain for column, gain in row.items() if abs(gain) > SAME * size}
        if not row:
            return None
        pivot = max(row, key=lambda column: abs(row[column]))
        gains = {column: -gain / row[pivot] for column, gain in row.items() if column != pivot}
        followers = [*followed.pop(pivot, ())]
        for place in followers:
            share = rows[place].pop(pivot)
            for column, gain in gains.items():
                rows[place][column] = rows[place].get(column, 0.0) + share * gain
        rows[pivot] = gains
        for column in gains:
            followed.setdefault(column, {}).update(dict.fromkeys((*followers, pivot)))
    return rows


class HeldArrays(BoundArrays):
    """The equations of a network in which law branches hold their ends together.

    Args:
        program: the equations in which all of them slip, without algebraic loops.
        p: parameters.
        part: matrices.
        joints: what holds.
    """

    def __init__(self, program: ArrayProgram, p: Array, part: LinearPart, joints: Joints) -> None:
        super().__init__(program, p, part)
        self.joints = joints

    @cached_property
    def _moving(self) -> BoundArrays:
        return BoundArrays(self.program, self.p, self.joints.moving, full=True)

    def __reduce__(self) -> tuple[Any, ...]:
        return HeldArrays, (self.program, self.p, self.part, self.joints)

    def values(self, t: Any, x: Array) -> tuple[Array, Array]:
        """Outputs y and inputs u, with reactions in the place of the laws of what holds."""
        y, u = super().values(t, x)
        u[self.joints.places] = 0.0
        u[self.joints.places] = self.joints.reactions(super().rates(t, x, y, u))
        return y, u

    def rates(self, t: Any, x: Array, y: Array, u: Array) -> Array:
        """x', in which what is held moves as one."""
        return self.joints.as_one(super().rates(t, x, y, u))

    def rhs(self, t: Any, x: Array) -> Array:
        """x' at time t."""
        return self._moving.rhs(t, x)

    def jacobian(self, t: float, x: Array) -> Any:
        """d rhs / d x as scipy.sparse.csc_array (n, n)."""
        return self._moving.jacobian(t, x)

    def jacobians(self, times: Array, states: Array) -> list[Any]:
        """The same at times (k,) and states (k, n)."""
        return self._moving.jacobians(times, states)


class HeldStores(StateTransfer):
    """What is stored where inertias are held together, and each is a state all the same."""

    def states(self, bound: BoundArrays, t: float, stored: Mapping[str, float]) -> Array:
        """(n,) the states that the equations start with: those of what is held come to one speed."""
        assert isinstance(bound, HeldArrays)  # noqa: S101 (equations of this kind are made with it)
        return bound.joints.met(super().states(bound, t, stored))
