"""What is wrong with the equations of a network, in drive-train words: read off the normal tree, then off the values."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import networkx as nx
import numpy as np
import sympy
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from shaftwork.components.branches import ACROSS
from shaftwork.components.laws import InterpolationSlope, breakpoints, t
from shaftwork.core.domains import Domain
from shaftwork.core.errors import Problem
from shaftwork.network.checks import LEFT_OUT, Spelling, at_nodes, connection_problems, examine, listed, title
from shaftwork.network.graph import GROUND, CircuitGraph, build_graph, ends_of
from shaftwork.network.netlist import Netlist
from shaftwork.network.templates import Kind
from shaftwork.reduction.form import StateForm, state_form
from shaftwork.reduction.gains import Gain, value_of
from shaftwork.reduction.tree import column_of

SINGULAR = 1e-13
"""Reciprocal condition below which coupled values cancel; the same as in the assembly of the matrices."""

_LACKING = ("floating part", "loose end", "massless node", "algebraic loop", "undetermined speed", "separate train")
"""Kinds that say that something is missing at a node; each is said only where none before it says so already."""
_OF_VALUES = ("locked gear loop", "redundant coupling", "fixed ratios", "cancelling values", "extreme ratios")
"""Kinds that depend on values: not said of parts whose values are replaced."""


@dataclass(frozen=True)
class _Words:
    """What an engineer calls the quantities and parts of a domain."""

    across: str
    through: str
    store: str
    loss: str
    remedy: str


_WORDS = {
    "rotation": _Words("speed", "torque", "inertia", "damper", "an Inertia, or a Damper to the frame"),
    "translation": _Words("speed", "force", "mass", "damper", "a Mass, or a TranslationalDamper to the frame"),
    "electrical": _Words("voltage", "current", "capacitor", "resistor", "a Resistor or a Capacitor to ground"),
}


def diagnose(netlist: Netlist) -> tuple[CircuitGraph | None, StateForm | None, tuple[Problem, ...]]:
    """Run all checks in order and collect what they say.

    Args:
        netlist: any netlist; nothing is raised.

    Returns:
        Graph and state form of the network, None where it cannot be made as it was typed, and every problem: those of
        the parts first, then of their connections, then of the equations.
    """
    repaired, typed = examine(netlist)
    if not repaired.placed:
        return None, None, typed
    graph = build_graph(repaired)
    found = [*connection_problems(graph)]
    form: StateForm | None = None
    try:
        form = state_form(graph)
        found += [*structural_problems(form), *numeric_problems(form)]
    except ArithmeticError:
        found.append(_extreme(graph, (branch.index for branch in graph.branches if branch.terms)))
        form = None
    problems = (*typed, *_causes(typed, found))
    return (None, None, problems) if typed else (graph, form, problems)


def _causes(typed: Sequence[Problem], found: Sequence[Problem]) -> Iterator[Problem]:
    """The problems without those that only follow from others: from a part left out, a value replaced, a missing end."""
    replaced = {part for problem in typed if problem.kind not in LEFT_OUT for part in problem.parts}
    covered = {node for problem in typed if problem.kind in LEFT_OUT for node in problem.nodes}
    follows = {k for k, problem in enumerate(found) if problem.kind in _LACKING and covered & {*problem.nodes}}
    for kind in _LACKING:
        same = [k for k, problem in enumerate(found) if problem.kind == kind]
        follows |= {k for k in same if covered.issuperset(found[k].nodes)}
        covered.update(node for k in same if found[k].severity == "error" for node in found[k].nodes)
    for k, problem in enumerate(found):
        if k not in follows and not (problem.kind in _OF_VALUES and replaced & {*problem.parts}):
            yield problem


def structural_problems(form: StateForm) -> tuple[Problem, ...]:
    """What the normal tree says: errors, then warnings, then notes, whatever the values are."""
    view = _View(form)
    return (
        *view.prescribed_twice(),
        *view.massless(),
        *view.implicit_in_the_tree(),
        *view.implicit_beside_losses(),
        *view.undetermined(),
        *view.locked(),
        *view.jumping(),
        *view.redundant(),
        *view.fixed_ratios(),
    )


class _View:
    """The state form with names for what is in it."""

    def __init__(self, form: StateForm) -> None:
        self.form, self.graph, self.tree = form, form.graph, form.tree
        self.spelling = Spelling(form.graph.nodes)
        wanted = {*form.tree.tree[Kind.THROUGH_SOURCE], *form.tree.tree[Kind.LAW], *form.tree_conductances}
        self.moved: dict[int, list[int]] = {branch: [] for branch in wanted}
        for node, row in enumerate(form.tree.potentials if wanted else ()):
            for branch in wanted.intersection(row or ()):
                self.moved[branch].append(node)
        self.cutsets: dict[int, list[int]] = {branch: [] for branch in wanted}
        for link, loop in form.tree.loops.items() if wanted else ():
            for branch in wanted.intersection(loop):
                self.cutsets[branch].append(link)

    def kind(self, branch: int) -> Kind:
        return self.graph.branches[branch].template.kind

    def parts(self, branches: Iterable[int]) -> tuple[str, ...]:
        return tuple(dict.fromkeys(self.graph.part_of(branch).name for branch in branches))

    def titles(self, branches: Iterable[int]) -> str:
        """Parts with their classes, joined as in "A, B and C"."""
        names = tuple(dict.fromkeys(title(self.graph.part_of(branch).component) for branch in branches))
        return _joined(names)

    def nodes(self, numbers: Iterable[int]) -> tuple[str, ...]:
        """Names of the nodes that the user has named; of those inside a part only where there are no others."""
        names = tuple(dict.fromkeys(self.graph.nodes[node] for node in numbers if node != GROUND))
        return tuple(name for name in names if "." not in name) or names

    def ends(self, branches: Iterable[int]) -> tuple[str, ...]:
        """The nodes at the ends of branches."""
        found = (ends_of(self.graph.branches[branch]) for branch in branches)
        return self.nodes(node for ends in found for _, plus, minus in ends for node in (plus, minus))

    def domain(self, branch: int) -> Domain:
        made = self.graph.branches[branch]
        nodes = (node for _, plus, minus in ends_of(made) for node in (plus, minus) if node != GROUND)
        return self.graph.domains[next(nodes)]

    def words(self, branch: int) -> _Words:
        return _WORDS[self.domain(branch).name]

    def prescribed_twice(self) -> Iterator[Problem]:
        """Sources of speed or voltage that others in their loop contradict."""
        for source in self.tree.links[Kind.ACROSS_SOURCE]:
            loop = self.tree.loops[source]
            others = [branch for branch in loop if self.kind(branch) is Kind.ACROSS_SOURCE]
            rigid = [branch for branch in loop if self.kind(branch) is Kind.COUPLING]
            across, name = self.words(source).across, title(self.graph.part_of(source).component)
            where, through = at_nodes(self.ends([source])), f" through {self.titles(rigid)}" if rigid else ""
            if others:
                kind = f"two {across} sources"
                message = f"{name} at {where} prescribes a {across} that {self.titles(others)} prescribes already{through}."
                hint = "Keep one of them, or put a spring, a damper or a resistor between the two."
            else:
                kind = f"blocked {across} source"
                message = f"{name} prescribes the {across} of {where}, which is held at zero{through}."
                hint = "Remove the source or what holds the node, or put a spring, a damper or a resistor between the two."
            yield Problem(kind, message, hint, self.parts([source, *others, *rigid]), self.ends([source, *others]))

    def massless(self) -> Iterator[Problem]:
        """Sources of torque or current that nothing answers."""
        for source in self.tree.tree[Kind.THROUGH_SOURCE]:
            words, sources = self.words(source), [source, *self.cutsets[source]]
            nodes = self.nodes(self.moved[source]) or self.ends([source])
            message = (
                f"{at_nodes(nodes)} {'have' if len(nodes) > 1 else 'has'} no {words.store}, no {words.loss} and no spring: "
                f"nothing answers the {words.through} of {self.titles(sources)}."
            )
            hint = f"Give {'one of them' if len(nodes) > 1 else 'it'} {words.remedy}{self.spelling.suggestion(nodes)}."
            yield Problem("massless node", message, hint, self.parts(sources), nodes)

    def implicit_in_the_tree(self) -> Iterator[Problem]:
        """Laws that alone decide the speed of a massless node."""
        for law in self.tree.tree[Kind.LAW]:
            words = self.words(law)
            nodes = self.nodes(node for node in self.moved[law] if node in self._ends_of(law)) or self.ends([law])
            message = (
                f"{at_nodes(nodes)} has no {words.store} and no {words.loss}, so its {words.across} would have to be found "
                f"from the nonlinear law of {self.titles([law])} backwards, at every instant."
            )
            hint = f"Give the node {words.remedy}; a small value will do{self.spelling.suggestion(nodes)}."
            yield Problem("algebraic loop", message, hint, self.parts([law]), nodes)

    def _ends_of(self, branch: int) -> tuple[int, int]:
        made = self.graph.branches[branch]
        return made.plus, made.minus

    def implicit_beside_losses(self) -> Iterator[Problem]:
        """Laws whose own torque decides, through dampers alone, the speed that they depend on."""
        for law in self.tree.links[Kind.LAW]:
            losses = [branch for branch in self.tree.loops[law] if self.kind(branch) is Kind.CONDUCTANCE]
            if not losses or not self.graph.branches[law].template.law.has(ACROSS):
                continue
            words, ends = self.words(law), self._ends_of(law)
            moved = [node for branch in losses for node in self.moved[branch]]
            nodes = self.nodes(node for node in moved if node in ends) or self.nodes(moved)
            message = (
                f"{at_nodes(nodes)} has no {words.store}: the {words.through} of {self.titles([law])} and the {words.across} "
                f"that {self.titles(losses)} then allows determine each other."
            )
            hint = f"Give the node {'an' if words.store[0] in 'aeiou' else 'a'} {words.store}; a small value will do."
            yield Problem("algebraic loop", message, hint, self.parts([law, *losses]), nodes)

    def undetermined(self) -> Iterator[Problem]:
        """Nodes whose speed or voltage nothing fixes, group by group."""
        free = {node for node, row in enumerate(self.tree.potentials) if row is None}
        if not free:
            return
        groups: nx.Graph[int] = nx.Graph()
        groups.add_nodes_from(sorted(free))
        parts: dict[int, list[int]] = {node: [] for node in free}
        for number, part in enumerate(self.graph.parts):
            nodes = [node for node in part.nodes.values() if node in free]
            for node in nodes:
                parts[node].append(number)
            domains = self.graph.domains
            groups.add_edges_from(pair for pair in pairwise(nodes) if domains[pair[0]] == domains[pair[1]])
        for group in nx.connected_components(groups):
            members = sorted(group)
            at = sorted({number for node in members for number in parts[node]})
            yield self._undetermined_group(members, at)

    def _undetermined_group(self, members: Sequence[int], at: Sequence[int]) -> Problem:
        parts, nodes = [self.graph.parts[number] for number in at], self.nodes(members)
        domain = self.graph.domains[members[0]]
        words, names = _WORDS[domain.name], tuple(part.name for part in parts)
        many = len(nodes) > 1
        if domain.name == "electrical":
            message = f"the circuit at {at_nodes(nodes)} ({listed(names)}) is joined to ground nowhere."
            return Problem("undetermined speed", message, f"Add a Ground at '{nodes[0]}'.", names, nodes)
        zeros = tuple(zero for zero in self.graph.zeros if zero.rsplit(".", 1)[0] in names)
        left_out = f" ({listed(zeros)} {'are' if len(zeros) > 1 else 'is'} zero and left out)" if zeros else ""
        message = (
            f"{at_nodes(nodes)} {'hang' if many else 'hangs'} on nothing but {listed(names)}: nothing there has "
            f"{words.store}, a {words.loss} to the frame or a prescribed {words.across}{left_out}."
        )
        hint = f"Give {'one of the nodes' if many else 'the node'} {words.remedy}, or a Ground."
        return Problem("undetermined speed", message, hint, names, nodes)
