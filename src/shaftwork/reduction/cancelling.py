"""Problems of values: those that cancel each other, or that a computer cannot hold, although the structure is sound."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import networkx as nx
import numpy as np
import sympy

from shaftwork.core.errors import Problem
from shaftwork.network.graph import CircuitGraph
from shaftwork.network.wording import at_nodes, listed
from shaftwork.reduction.form import StateForm
from shaftwork.reduction.gains import Gain, value_of
from shaftwork.reduction.view import View

SINGULAR = 1e-13
"""Reciprocal condition below which coupled values cancel; the same as in the assembly of the matrices."""


def numeric_problems(form: StateForm) -> tuple[Problem, ...]:
    """Values that cancel each other or lie outside what a computer can represent, although the structure is sound."""
    graph, loops = form.graph, form.tree.loops
    gains = ((link, entry) for link, loop in loops.items() for entry in loop.values() if isinstance(entry, Gain))
    if wild := sorted({link for link, gain in gains if not (math.isfinite(gain.value) and gain.value)}):
        return (extreme_ratios(graph, (branch for link in wild for branch in (link, *loops[link]))),)
    groups = ((form.tree_conductances, form.link_conductances), (form.across_states, form.dependent_across))
    return tuple(problem for own, beside in groups for problem in _cancelling(form, own, beside))


def extreme_ratios(graph: CircuitGraph, branches: Iterable[int]) -> Problem:
    """That ratios multiply to a number that is not finite or not above zero."""
    names = tuple(dict.fromkeys(graph.part_of(branch).name for branch in branches if graph.branches[branch].terms))
    message = f"the ratios of {listed(names)} multiply to a number that is no longer finite or no longer above zero."
    return Problem("extreme ratios", message, "Check their units and powers of ten.", names)


def _cancelling(form: StateForm, own: Sequence[int], beside: Sequence[int]) -> Iterator[Problem]:
    """Coupled conductances (or inertias) of which a negative one cancels others, block by block."""
    values = _coefficients(form.graph, (*own, *beside))
    if all(value > 0 for value in values.values()):
        return  # positive values cannot cancel
    blocks: nx.Graph[int] = nx.Graph()
    blocks.add_nodes_from(own)
    members = frozenset(own)
    blocks.add_edges_from((tree, link) for link in beside for tree in form.tree.loops[link] if tree in members)
    for found in nx.connected_components(blocks):
        trees, links = sorted(found & members), sorted(found - members)
        loops = [[value_of(form.tree.loops[link].get(tree, 0)) for link in links] for tree in trees]
        F = np.array(loops, dtype=float).reshape(len(trees), len(links))
        matrix = np.diag([values[tree] for tree in trees]) + F * [values[link] for link in links] @ F.T
        if min(values[branch] for branch in found) <= 0 and _is_singular(matrix):
            yield _cancelling_block(View(form), (*trees, *links))


def _coefficients(graph: CircuitGraph, branches: Iterable[int]) -> dict[int, float]:
    made: dict[tuple[Any, ...], Any] = {}
    values: dict[int, float] = {}
    for index in branches:
        template, part = graph.branches[index].template, graph.part_of(index)
        if (key := (template.law, template.symbols)) not in made:
            made[key] = sympy.lambdify(template.symbols, template.law, "math")
        numbers = (graph.parameters[f"{part.name}.{symbol.name}"] for symbol in template.symbols)
        values[index] = float(made[key](*numbers))
    return values


def _is_singular(block: Any) -> bool:
    scale = 1 / np.sqrt(np.abs(np.diag(block)) + np.finfo(float).tiny)
    scaled = block * scale[:, None] * scale[None, :]
    return not (np.isfinite(scaled).all() and 1 / np.linalg.cond(scaled) > SINGULAR)


def _cancelling_block(view: View, branches: Sequence[int]) -> Problem:
    moved = (node for branch in branches for node in view.moved.get(branch, ()))
    nodes, words = view.nodes(moved) or view.ends(branches), view.words(branches[0])
    message = (
        f"the values of {view.titles(branches)} at {at_nodes(nodes)} cancel each other, "
        f"so that no {words.across} follows from a {words.through} there."
    )
    hint = f"Change one of the values, or give a node {words.remedy}."
    return Problem("cancelling values", message, hint, view.parts(branches), nodes)
