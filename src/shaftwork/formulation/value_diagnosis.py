"""What values say: problems where they cancel each other or no computer holds them, and notes of parts on their own."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import networkx as nx
import numpy as np
import sympy
from sympy import Float, Symbol

from shaftwork.components.branches import THROUGH
from shaftwork.core.errors import Diagnostic
from shaftwork.formulation.form import StateForm
from shaftwork.formulation.gains import Gain, Number, fold, value_of
from shaftwork.formulation.tree import Row, balance_of, column_of
from shaftwork.formulation.view import View
from shaftwork.network.graph import GROUND, CircuitGraph, GraphBranch, GraphPart
from shaftwork.network.kinds import Kind
from shaftwork.network.netlist import at_nodes, listed, title


def numeric_problems(form: StateForm) -> tuple[Diagnostic, ...]:
    """Values that cancel each other or lie outside what a computer can represent, although the structure is sound."""
    graph, loops, cutsets = form.graph, form.tree.loops, form.tree.cutsets
    rows = (*loops.items(), *(cutsets.items() if form.loses_power else ()))
    gains = ((link, entry) for link, row in rows for entry in row.values() if isinstance(entry, Gain))
    if wild := sorted({link for link, gain in gains if not (math.isfinite(gain.value) and gain.value)}):
        return (extreme_ratios(graph, (branch for link in wild for branch in (link, *loops[link]))),)
    groups = ((form.tree_conductances, form.link_conductances), (form.across_states, form.dependent_across))
    problems = (problem for trees, beside in groups for problem in _cancelling(form, trees, beside))
    return (*problems, *jamming(form, graph.parameters))


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
    if not form.loses_power:
        return
    sign = _sign_of_tree(form, column_of, parameters) * _sign_of_tree(form, balance_of, parameters)
    for trees, links in groups:
        values = _coefficients(form.graph, (*trees, *links), parameters)
        if min(values.values(), default=1.0) <= 0:
            return  # negative values need no coupling to cancel
        F, Q = (_block(rows, trees, links, parameters) for rows in (form.tree.loops, form.tree.cutsets))
        capacities, others = (np.array([values[branch] for branch in group]) for group in (trees, links))
        sign *= np.linalg.slogdet(np.diag(capacities) + Q * others @ F.T).sign
    if sign <= 0:
        yield _jammed(View(form), tuple(branch.index for branch in form.graph.branches if branch.template.through))


def self_locks(form: StateForm, parameters: Mapping[str, float]) -> bool:
    """Whether a coupling turns the power of one of its ends round, so that it may jam.

    Args:
        form: the equations.
        parameters: values by name.
    """
    lossy = (branch for branch in form.graph.branches if branch.template.through)
    pairs = ((branch, *pair) for branch in lossy for pair in zip(branch.terms, branch.balances, strict=True))
    powers = (form.graph.in_network_symbols(term[0] * balance[0], branch) for branch, term, balance in pairs)
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
    if len(branches) != len(nodes):
        return 1.0
    entries = [factors.get(node, 0) for node in nodes for factors in columns]
    return float(np.linalg.slogdet(_matrix(entries, (len(nodes), len(nodes)), parameters)).sign)


def _block(rows: Mapping[int, Row], trees: Sequence[int], links: Sequence[int], parameters: Mapping[str, float]) -> Any:
    """(trees, links) the factors of tree branches and links in loops or cutsets."""
    entries = [rows[link].get(tree, 0) for tree in trees for link in links]
    return _matrix(entries, (len(trees), len(links)), parameters)


def _matrix(entries: Sequence[Number], shape: tuple[int, int], parameters: Mapping[str, float]) -> Any:
    """Gains in numbers, row by row."""
    return np.array(fold(entries, partial(_value, parameters=parameters)), dtype=float).reshape(shape)


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


def _cancelling(form: StateForm, unknowns: Sequence[int], beside: Sequence[int]) -> Iterator[Diagnostic]:
    """Coupled conductances (or inertias) of which a negative one cancels others, block by block."""
    values = _coefficients(form.graph, (*unknowns, *beside), form.graph.parameters)
    if all(value > 0 for value in values.values()):
        return  # positive values cannot cancel
    blocks: nx.Graph[int] = nx.Graph()
    blocks.add_nodes_from(unknowns)
    members = frozenset(unknowns)
    blocks.add_edges_from((tree, link) for link in beside for tree in form.tree.loops[link] if tree in members)
    for block in nx.connected_components(blocks):
        trees, links = sorted(block & members), sorted(block - members)
        F, Q = (_block(rows, trees, links, form.graph.parameters) for rows in (form.tree.loops, form.tree.cutsets))
        matrix = np.diag([values[tree] for tree in trees]) + Q * [values[link] for link in links] @ F.T
        if min(values[branch] for branch in block) <= 0 and is_singular(matrix):
            yield _cancelling_block(View(form), (*trees, *links))


def _coefficients(graph: CircuitGraph, branches: Iterable[int], parameters: Mapping[str, float]) -> dict[int, float]:
    functions: dict[tuple[Any, ...], Any] = {}
    values: dict[int, float] = {}
    for index in branches:
        template, part = graph.branches[index].template, graph.part_of(index)
        if (key := (template.law, template.symbols)) not in functions:
            functions[key] = sympy.lambdify(template.symbols, template.law, "math")
        numbers = (parameters[f"{part.name}.{symbol.name}"] for symbol in template.symbols)
        values[index] = float(functions[key](*numbers))
    return values


def is_singular(block: Any) -> bool:
    """Whether coupled values cancel in a matrix, whatever the sizes of its rows."""
    scale = 1 / np.sqrt(np.abs(np.diag(block)) + np.finfo(float).tiny)
    scaled = block * scale[:, None] * scale[None, :]
    # At a condition of 1e13 coupled values cancel, and the block has no solution to speak of.
    return not (np.isfinite(scaled).all() and 1 / np.linalg.cond(scaled) > 1e-13)


def _cancelling_block(view: View, branches: Sequence[int]) -> Diagnostic:
    moved = (node for branch in branches for node in view.moved.get(branch, ()))
    nodes, words = view.nodes(moved) or view.ends(branches), view.words(branches[0])
    message = (
        f"the values of {view.titles(branches)} at {at_nodes(nodes)} cancel each other, "
        f"so that no {words.across} follows from a {words.through} there."
    )
    hint = f"Change one of the values, or give a node {words.remedy}."
    return Diagnostic("cancelling values", message, hint, view.parts(branches), nodes)


_JOINTS = (Kind.THROUGH_STORE, Kind.COUPLING)
"""Springs and gears: what hands a torque on at standstill."""


def notes_of(graph: CircuitGraph) -> Iterator[Diagnostic]:
    """What is worth saying about parts by their values."""
    for part in graph.parts:
        at = tuple(node for node in part.nodes.values() if node != GROUND)
        nodes = tuple(graph.nodes[node] for node in at)
        for note in part.component.notes():
            load = "" if note.torque is None else _against(graph, at[0], note.torque)
            message = f"{title(part.component)} at {at_nodes(nodes)} {note.message}{load}."
            yield Diagnostic(note.kind, message, note.hint, (part.name,), nodes, "note")


def _against(graph: CircuitGraph, start: int, torque: float) -> str:
    """The loads behind a node that rest until a torque there is above theirs, in words; losses of gears left out."""
    columns = (column_of(graph, branch) for branch in graph.branches if branch.template.kind in _JOINTS)
    pairs = (
        {node: value_of(factor) for node, factor in column.items()} for column in columns if len(column) == 2
    )  # ends of a spring, or shafts of a gear of two
    speeds = speeds_along(graph, start, pairs)
    loads: dict[str, float] = {}
    for part in graph.parts:
        for node in {*part.nodes.values()} & speeds.keys():
            if limit := _breakaway(graph, part, math.copysign(1.0, torque * speeds[node])):
                loads[title(part.component)] = limit * abs(speeds[node])
    total = sum(loads.values())
    if total <= 0:
        return ""
    stuck = ", which it does not move" if total >= abs(torque) else ""
    return f", against {total:.4g} N*m of {' and '.join(loads)}{stuck}"


def speeds_along(graph: CircuitGraph, start: int, joints: Iterable[Mapping[int, float]]) -> dict[int, float]:
    """Speeds of the nodes that are joined to one, over its own.

    Args:
        graph: the network.
        start: the one.
        joints: node to factor, in sums that are zero; that of the frame is.
    """
    at: list[list[dict[int, float]]] = [[] for _ in graph.nodes]
    for joint in joints:
        moving = {node: factor for node, factor in joint.items() if node != GROUND}
        for node in moving if len(moving) > 1 else ():
            at[node].append(moving)
    speeds, ends = {start: 1.0}, [start]
    while ends:
        for joint in at[ends.pop()]:
            open_ends = [node for node in joint if node not in speeds]
            if len(open_ends) == 1:
                (other,) = open_ends
                speeds[other] = -sum(joint[node] * speeds[node] for node in joint if node != other) / joint[other]
                ends.append(other)
    return speeds


def _breakaway(graph: CircuitGraph, part: GraphPart, direction: float) -> float:
    """The torque up to which a part between a node and the frame rests when pushed; 0 where none is known."""
    if len([end for end in part.nodes.values() if end != GROUND]) > 1:
        return 0.0
    values = {Symbol(name, real=True): Float(graph.parameters[f"{part.name}.{name}"]) for name in part.parameters}
    # What rubs at all times has three modes (forward, backward, stuck); a brake has more.
    slips = (modes.options for modes in part.modes if len(modes.options) == 3)
    guards = (leave.when for options in slips for mode in options if mode.gives_way for leave in mode.leaves)
    limits = [-when.xreplace({THROUGH: Float(0), **values}) for when in guards if direction * when.diff(THROUGH) > 0]
    return sum(float(limit) for limit in limits if limit.is_comparable)
