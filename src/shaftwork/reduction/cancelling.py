"""Problems of values: those that cancel each other, or that a computer cannot hold, although the structure is sound."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import networkx as nx
import numpy as np
import sympy

from shaftwork.core.errors import Diagnostic
from shaftwork.network.graph import CircuitGraph, GraphBranch
from shaftwork.network.wording import at_nodes, listed
from shaftwork.reduction.form import StateForm
from shaftwork.reduction.gains import Gain, Number, fold
from shaftwork.reduction.tree import Row, balance_of, column_of
from shaftwork.reduction.view import View

SINGULAR = 1e-13
"""Reciprocal condition below which coupled values cancel; the same as in the assembly of the matrices."""


def numeric_problems(form: StateForm) -> tuple[Diagnostic, ...]:
    """Values that cancel each other or lie outside what a computer can represent, although the structure is sound."""
    graph, loops, cutsets = form.graph, form.tree.loops, form.tree.cutsets
    rows = (*loops.items(), *(cutsets.items() if cutsets is not loops else ()))
    gains = ((link, entry) for link, row in rows for entry in row.values() if isinstance(entry, Gain))
    if wild := sorted({link for link, gain in gains if not (math.isfinite(gain.value) and gain.value)}):
        return (extreme_ratios(graph, (branch for link in wild for branch in (link, *loops[link]))),)
    groups = ((form.tree_conductances, form.link_conductances), (form.across_states, form.dependent_across))
    found = (problem for own, beside in groups for problem in _cancelling(form, own, beside))
    return (*found, *jamming(form, graph.parameters))


def jamming(form: StateForm, parameters: Mapping[str, float]) -> Iterator[Diagnostic]:
    """A coupling that brakes by more than the inertia (or damping, or compliance) in its way can answer: it jams.

    Args:
        form: the equations.
        parameters: values by name.

    The rates follow from the matrices of `form` and from the tree's own columns in speeds and torques. The product of
    all determinants is positive without losses; a loss that grows takes it through zero, where the rates are infinite.
    """
    groups = (
        (form.tree_conductances, form.link_conductances),
        (form.across_states, form.dependent_across),
        (form.dependent_through, form.through_states),
    )
    if form.tree.cutsets is form.tree.loops:
        return
    sign = _sign_of_tree(form, column_of, parameters) * _sign_of_tree(form, balance_of, parameters)
    for trees, links in groups:
        values = _coefficients(form.graph, (*trees, *links), parameters)
        if min(values.values(), default=1.0) <= 0:
            return  # negative values need no coupling to cancel
        F, Q = (_block(rows, trees, links, parameters) for rows in (form.tree.loops, form.tree.cutsets))
        own, others = (np.array([values[branch] for branch in group]) for group in (trees, links))
        sign *= np.linalg.slogdet(np.diag(own) + Q * others @ F.T).sign
    if sign <= 0:
        yield _jammed(View(form), tuple(branch.index for branch in form.graph.branches if branch.template.through))


def self_locks(form: StateForm, parameters: Mapping[str, float]) -> bool:
    """Whether a coupling turns the power of one of its ends round, so that it may jam.

    Args:
        form: the equations.
        parameters: values by name.
    """
    if form.tree.cutsets is form.tree.loops:
        return False
    lossy = (branch for branch in form.graph.branches if branch.template.through)
    pairs = ((made, *pair) for made in lossy for pair in zip(made.terms, made.balances, strict=True))
    powers = (form.graph.in_network_symbols(term[0] * balance[0], made) for made, term, balance in pairs)
    return any(_value(power, parameters) < 0 for power in powers)


def _value(expression: sympy.Expr, parameters: Mapping[str, float]) -> float:
    return float(expression.xreplace({s: sympy.Float(parameters[s.name]) for s in expression.free_symbols}))


def _sign_of_tree(
    form: StateForm, column: Callable[[CircuitGraph, GraphBranch], Row], parameters: Mapping[str, float]
) -> float:
    """The sign of the determinant of the tree's columns."""
    branches = [branch for branch in form.graph.branches if branch.index not in form.tree.loops]
    columns = [column(form.graph, branch) for branch in branches]
    nodes = range(len(form.graph.nodes))
    matrix = _matrix([[made.get(node, 0) for made in columns] for node in nodes], parameters)
    return float(np.linalg.slogdet(matrix).sign) if len(branches) == len(nodes) else 1.0


def _block(rows: Mapping[int, Row], trees: Sequence[int], links: Sequence[int], parameters: Mapping[str, float]) -> Any:
    """(trees, links) the factors of tree branches and links in loops or cutsets."""
    return _matrix([[rows[link].get(tree, 0) for link in links] for tree in trees], parameters, len(links))


def _matrix(numbers: Sequence[Sequence[Number]], parameters: Mapping[str, float], columns: int = 0) -> Any:
    """Gains in numbers."""
    gains = [number for row in numbers for number in row if isinstance(number, Gain)]

    known = dict(zip(map(id, gains), fold(gains, partial(_value, parameters=parameters)), strict=True))
    made = [[known[id(number)] if isinstance(number, Gain) else number for number in row] for row in numbers]
    return np.array(made, dtype=float).reshape(len(numbers), -1 if made and made[0] else columns)


def _jammed(view: View, lossy: Sequence[int]) -> Diagnostic:
    words = view.words(lossy[0])
    message = (
        f"{view.titles(lossy)} would brake by more than the {words.store} before it can answer: "
        f"no rates of {words.across} satisfy its law, it jams."
    )
    hint = f"Give the side that brakes more {words.store}, or let the coupling lose less."
    return Diagnostic("jammed coupling", message, hint, view.parts(lossy), view.ends(lossy))


def extreme_ratios(graph: CircuitGraph, branches: Iterable[int]) -> Diagnostic:
    """That ratios multiply to a number that is not finite or not above zero."""
    names = tuple(dict.fromkeys(graph.part_of(branch).name for branch in branches if graph.branches[branch].terms))
    message = f"the ratios of {listed(names)} multiply to a number that is no longer finite or no longer above zero."
    return Diagnostic("extreme ratios", message, "Check their units and powers of ten.", names)


def _cancelling(form: StateForm, own: Sequence[int], beside: Sequence[int]) -> Iterator[Diagnostic]:
    """Coupled conductances (or inertias) of which a negative one cancels others, block by block."""
    values = _coefficients(form.graph, (*own, *beside), form.graph.parameters)
    if all(value > 0 for value in values.values()):
        return  # positive values cannot cancel
    blocks: nx.Graph[int] = nx.Graph()
    blocks.add_nodes_from(own)
    members = frozenset(own)
    blocks.add_edges_from((tree, link) for link in beside for tree in form.tree.loops[link] if tree in members)
    for found in nx.connected_components(blocks):
        trees, links = sorted(found & members), sorted(found - members)
        F, Q = (_block(rows, trees, links, form.graph.parameters) for rows in (form.tree.loops, form.tree.cutsets))
        matrix = np.diag([values[tree] for tree in trees]) + Q * [values[link] for link in links] @ F.T
        if min(values[branch] for branch in found) <= 0 and _is_singular(matrix):
            yield _cancelling_block(View(form), (*trees, *links))


def _coefficients(graph: CircuitGraph, branches: Iterable[int], parameters: Mapping[str, float]) -> dict[int, float]:
    made: dict[tuple[Any, ...], Any] = {}
    values: dict[int, float] = {}
    for index in branches:
        template, part = graph.branches[index].template, graph.part_of(index)
        if (key := (template.law, template.symbols)) not in made:
            made[key] = sympy.lambdify(template.symbols, template.law, "math")
        numbers = (parameters[f"{part.name}.{symbol.name}"] for symbol in template.symbols)
        values[index] = float(made[key](*numbers))
    return values


def _is_singular(block: Any) -> bool:
    scale = 1 / np.sqrt(np.abs(np.diag(block)) + np.finfo(float).tiny)
    scaled = block * scale[:, None] * scale[None, :]
    return not (np.isfinite(scaled).all() and 1 / np.linalg.cond(scaled) > SINGULAR)


def _cancelling_block(view: View, branches: Sequence[int]) -> Diagnostic:
    moved = (node for branch in branches for node in view.moved.get(branch, ()))
    nodes, words = view.nodes(moved) or view.ends(branches), view.words(branches[0])
    message = (
        f"the values of {view.titles(branches)} at {at_nodes(nodes)} cancel each other, "
        f"so that no {words.across} follows from a {words.through} there."
    )
    hint = f"Change one of the values, or give a node {words.remedy}."
    return Diagnostic("cancelling values", message, hint, view.parts(branches), nodes)
