"""What is wrong with the equations of a network, in drive-train words, from the normal tree and from the values."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import networkx as nx
import sympy

from shaftwork.components.discontinuities import breakpoints
from shaftwork.components.laws import t
from shaftwork.components.tables import InterpolationSlope
from shaftwork.core.errors import Diagnostic
from shaftwork.formulation.form import StateForm, state_form
from shaftwork.formulation.gains import value_of
from shaftwork.formulation.tree import column_of
from shaftwork.formulation.value_diagnosis import extreme_ratios, notes_of, numeric_problems
from shaftwork.formulation.view import View, controlled_problems, domain_words, reads_itself
from shaftwork.network.checks import LEFT_OUT, SEPARATE, connection_problems, examine
from shaftwork.network.graph import CircuitGraph, GraphBranch, GraphPart, build_graph
from shaftwork.network.kinds import Kind
from shaftwork.network.netlist import Netlist, at_nodes, listed, title

_LACKING = (
    *("floating part", "loose end", "controlled source", "massless node", "algebraic loop", "undetermined speed"),
    SEPARATE,
)
"""Kinds that say that something is missing at a node; each is said only where none before it says so already."""
_OF_VALUES = (
    *("locked gear loop", "blocked speed source", "blocked voltage source"),
    *("redundant coupling", "fixed ratios", "cancelling values", "extreme ratios"),
)
"""Kinds that depend on values: not said of parts whose values are replaced."""


def diagnose(netlist: Netlist) -> tuple[CircuitGraph | None, StateForm | None, tuple[Diagnostic, ...]]:
    """Run all checks in order and collect what they say.

    Args:
        netlist: any netlist; nothing is raised.

    Returns:
        Graph and state form, None where a part is wrong, and every problem: of parts, of connections, of equations.
    """
    # where modes are chosen, the network has passed the checks of its parts before
    in_modes = any(placed.choices for placed in netlist.placed)
    repaired, typed = (replace(netlist, ports=()), ()) if in_modes else examine(netlist)
    if not repaired.placed:
        return None, None, typed
    graph = build_graph(repaired)
    problems = [*connection_problems(graph)]
    try:
        form = state_form(graph)
        problems += [*structural_problems(form), *numeric_problems(form), *(() if typed else notes_of(graph))]
    except ArithmeticError:  # of the ratios: nothing else is computed with before the values are judged
        form = None
        problems.append(extreme_ratios(graph, range(len(graph.branches))))
    causes = (*typed, *_causes(typed, problems))
    return (None, None, causes) if typed else (graph, form, causes)


def _causes(typed: Sequence[Diagnostic], problems: Sequence[Diagnostic]) -> Iterator[Diagnostic]:
    """The problems without those that follow from others: from a part left out, a value replaced, a missing end."""
    replaced = {part for problem in typed if problem.kind not in LEFT_OUT for part in problem.parts}
    covered = {node for problem in typed if problem.kind in LEFT_OUT for node in problem.nodes}
    follows = {k for k, problem in enumerate(problems) if problem.kind in _LACKING and covered & {*problem.nodes}}
    for kind in _LACKING:
        same = [k for k, problem in enumerate(problems) if problem.kind == kind]
        follows |= {k for k in same if problems[k].nodes and covered.issuperset(problems[k].nodes)}
        covered.update(node for k in same if problems[k].severity == "error" for node in problems[k].nodes)
    for k, problem in enumerate(problems):
        if k not in follows and not (problem.kind in _OF_VALUES and replaced & {*problem.parts}):
            yield problem


def structural_problems(form: StateForm) -> tuple[Diagnostic, ...]:
    """What the normal tree says: errors, then warnings, then notes, whatever the values are."""
    view = _Structure(form)
    jumping = tuple(view.jumping())
    return (
        *view.prescribed_twice(),
        *controlled_problems(view),
        *(
            view.unbalanced()
            if form.tree.unbalanced
            else (*view.massless(), *view.implicit(), *view.wound(), *view.undetermined())
        ),
        *view.locked(),
        *jumping,
        *changing_problems(view, jumping),
        *view.redundant(),
        *view.fixed_ratios(),
    )


class _Structure(View):
    """What the state form says, problem by problem."""

    def prescribed_twice(self) -> Iterator[Diagnostic]:
        """Sources of speed or voltage that others in their loop contradict."""
        for source in self.tree.links[Kind.ACROSS_SOURCE]:
            loop = self.tree.loops[source]
            others = [branch for branch in loop if self.kind(branch) is Kind.ACROSS_SOURCE]
            rigid = [branch for branch in loop if self.kind(branch) is Kind.COUPLING]
            words, name = self.words(source), title(self.graph.part_of(source).component)
            where, through = at_nodes(self.ends([source])), f" through {self.titles(rigid)}" if rigid else ""
            between = f"put a {words.loss} or {words.spring} between the two"
            if others:
                kind, first = f"two {words.across} sources", self.titles(others)
                message = f"{name} at {where} prescribes a {words.across} that {first} prescribes already{through}."
                hint = f"Keep one of them, or {between}."
            else:
                kind = f"blocked {words.across} source"
                message = f"{name} prescribes the {words.across} of {where}, which is held at zero{through}."
                hint = f"Remove the source or what holds the node, or {between}."
            yield Diagnostic(kind, message, hint, self.parts([source, *others, *rigid]), self.ends([source, *others]))

    def massless(self) -> Iterator[Diagnostic]:
        """Sources of torque or current that nothing answers."""
        for source in (*self.tree.tree[Kind.THROUGH_SOURCE], *filter(self.is_controlled, self.tree.tree[Kind.LAW])):
            words, sources = self.words(source), [source, *self.cutsets[source]]
            nodes = self.nodes(self.moved[source]) or self.ends([source])
            message = (
                f"{at_nodes(nodes)} {'have' if len(nodes) > 1 else 'has'} no {words.store}, no {words.loss} and "
                f"no {words.spring}: nothing answers the {words.through} of {self.titles(sources)}."
            )
            hint = f"Give {'one of them' if len(nodes) > 1 else 'it'} {words.remedy}{self.spelling.suggestion(nodes)}."
            yield Diagnostic("massless node", message, hint, self.parts(sources), nodes)

    def implicit(self) -> Iterator[Diagnostic]:
        """Laws whose torque decides, alone or through dampers, the speed that they depend on."""
        for law in sorted((*self.tree.tree[Kind.LAW], *self.tree.links[Kind.LAW])):
            if law not in self.tree.loops and self.is_controlled(law):
                continue
            branch, words = self.graph.branches[law], self.words(law)
            losses = [other for other in self.tree.loops.get(law, ()) if self.kind(other) is Kind.CONDUCTANCE]
            if law in self.tree.loops and not (losses and reads_itself(self, law)):
                continue
            nodes = self._moved_by(branch, losses or [law])
            beside = f"beside {self.titles(losses)}, " if losses else ""
            message = (
                f"{at_nodes(nodes)} has no {words.store}: {beside}the {words.through} of {self.titles([law])} and the "
                f"{words.across} that it depends on determine each other, a nonlinear equation at every instant."
            )
            hint = f"Give the node some {words.store}, however small{self.spelling.suggestion(nodes)}."
            yield Diagnostic("algebraic loop", message, hint, self.parts([law, *losses]), nodes)

    def wound(self) -> Iterator[Diagnostic]:
        """Springs that a friction without inertia behind it would wind up at once when it begins to slip."""
        for spring in self.tree.tree[Kind.THROUGH_STORE]:
            laws = [branch for branch in self.cutsets.get(spring, ()) if self._holds(branch)]
            if not laws:
                continue
            branch, words = self.graph.branches[spring], self.words(spring)
            nodes = self._moved_by(branch, [spring])
            message = (
                f"{at_nodes(nodes)} has no {words.store}: the {words.through} of {self.titles([spring])} would be that "
                f"of {self.titles(laws)} at every instant, and jump where its mode changes."
            )
            hint = f"Give the node some {words.store}, however small{self.spelling.suggestion(nodes)}."
            yield Diagnostic("massless node", message, hint, self.parts([spring, *laws]), nodes)

    def _moved_by(self, branch: GraphBranch, trees: Iterable[int]) -> tuple[str, ...]:
        """The nodes that tree branches move: those at the ends of a branch, else all."""
        moved = [node for tree in trees for node in self.moved[tree]]
        return self.nodes(node for node in moved if node in (branch.plus, branch.minus)) or self.nodes(moved)

    def _holds(self, law: int) -> bool:
        """Whether the part of a law holds in another mode, up to a torque: a friction, a brake."""
        modes = (mode for modes in self.graph.part_of(law).modes for mode in modes.options)
        return self.kind(law) in (Kind.LAW, Kind.THROUGH_SOURCE) and any(mode.gives_way for mode in modes)

    def undetermined(self) -> Iterator[Diagnostic]:
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

    def _undetermined_group(self, members: Sequence[int], at: Sequence[int]) -> Diagnostic:
        parts, nodes = [self.graph.parts[number] for number in at], self.nodes(members)
        domain = self.graph.domains[members[0]]
        words, names = domain_words(domain), tuple(part.name for part in parts)
        many = len(nodes) > 1
        if domain.name == "electrical":
            message = f"the circuit at {at_nodes(nodes)} ({listed(names)}) is joined to ground nowhere."
            hint = f"Add a Ground at '{nodes[0]}'."
            if opens := [part.name for part in parts if part.modes]:
                hint = (
                    f"Add a Ground at '{nodes[0]}'; where that would bridge {listed(opens)}, which "
                    f"{'join' if len(opens) > 1 else 'joins'} it to ground at times only, a Resistor of 1e6 ohm from "
                    "there to ground instead."
                )
            return Diagnostic("undetermined speed", message, hint, names, nodes)
        zeros = tuple(zero for zero in self.graph.zeros if zero.rsplit(".", 1)[0] in names)
        left_out = f" ({listed(zeros)} {'are' if len(zeros) > 1 else 'is'} zero and left out)" if zeros else ""
        message = (
            f"{at_nodes(nodes)} {'hang' if many else 'hangs'} on nothing but {listed(names)}: nothing there has "
            f"{words.store}, a {words.loss} to the frame or a prescribed {words.across}{left_out}."
        )
        hint = f"Give {'one of the nodes' if many else 'the node'} {words.remedy}, or a Ground."
        return Diagnostic("undetermined speed", message, hint, names, nodes)

    def locked(self) -> Iterator[Diagnostic]:
        """Loops of couplings whose ratios agree at standstill only."""
        routes: nx.Graph[int] = nx.Graph()
        for closing, nodes in self.tree.locked:
            for branch in self.graph.branches[:closing]:
                column = column_of(self.graph, branch) if branch.terms else {}
                routes.add_edges_from(((a, b) for a, b in pairwise(column) if not routes.has_edge(a, b)), branch=branch)
            routes.add_nodes_from(nodes)
            paths = [nx.shortest_path(routes, nodes[0], b) for b in nodes[1:] if nx.has_path(routes, nodes[0], b)]
            around = [routes.edges[step]["branch"] for path in paths for step in pairwise(path)]
            loop = [*(branch.index for branch in around), closing]
            where = self.nodes(node for node in nodes if not self._moves(node))
            message = (
                f"{self.titles(loop)} close a loop{self._two_ratios(paths, routes, closing)}: this is possible only "
                f"while {at_nodes(where)} {'stand' if len(where) > 1 else 'stands'} still, locked."
            )
            hint = "Make the ratios around the loop agree, or put a spring into one of its shafts."
            yield Diagnostic("locked gear loop", message, hint, self.parts(loop), where, "warning")

    def _moves(self, node: int) -> bool:
        return any(self.kind(branch) is not Kind.COUPLING for branch in self.tree.potentials[node] or ())

    def _two_ratios(self, paths: Sequence[Sequence[int]], routes: Any, closing: int) -> str:
        """What either way around a loop makes of the speeds of two nodes, where every coupling on it joins just two."""
        others = [routes.edges[step]["branch"] for path in paths for step in pairwise(path)]
        columns = [column_of(self.graph, branch) for branch in (*others, self.graph.branches[closing])]
        if len(paths) != 1 or any(len(column) != 2 for column in columns):
            return ""
        first, last = paths[0][0], paths[0][-1]
        steps = zip((*pairwise(paths[0]), (first, last)), columns, strict=True)
        *ratios, direct = (-value_of(column[b]) / value_of(column[a]) for (a, b), column in steps)
        across = self.graph.domains[first].across.name
        a, b = (f"{across}('{self.graph.nodes[node]}')" for node in (first, last))
        names = self.titles(branch.index for branch in others)
        return f" with {a} = {math.prod(ratios):.10g} {b} by {names}, but {direct:.10g} {b} by {self.titles([closing])}"

    def jumping(self) -> Iterator[Diagnostic]:
        """Prescribed speeds that jump although an inertia is joined to them rigidly."""
        joined: dict[int, list[int]] = {}
        for store in self.tree.links[Kind.ACROSS_STORE]:
            for source in self.tree.loops[store]:
                if self.kind(source) is Kind.ACROSS_SOURCE:
                    joined.setdefault(source, []).append(store)
        for source, stores in joined.items():
            if times := _jumps(self.graph.branches[source].template.law):
                words = self.words(source)
                message = (
                    f"{self.titles([source])} jumps at t = {times[0]:g} s, but {self.titles(stores)} "
                    f"{'is' if len(stores) == 1 else 'are'} rigidly joined to it: the {words.through} is an impulse."
                )
                hint = "The impulse is computed exactly; use a Ramp if the change takes time in the machine."
                parts = self.parts([source, *stores])
                yield Diagnostic("jumping source", message, hint, parts, self.ends([source]), "warning")

    def unbalanced(self) -> Iterator[Diagnostic]:
        """Couplings that lose power and let no torque through from where everything that could balance it is."""
        branches, words = self.tree.unbalanced, self.words(self.tree.unbalanced[0])
        lossy = [branch.index for branch in self.graph.branches if branch.template.through]
        message = (
            f"{self.titles(lossy)} {'let' if len(lossy) > 1 else 'lets'} no {words.through} through to "
            f"{self.titles(branches)}, so that nothing balances the {words.through} on the other side."
        )
        hint = f"Give the other side {words.remedy}."
        yield Diagnostic("unbalanced coupling", message, hint, self.parts([*branches, *lossy]), self.ends(lossy))

    def redundant(self) -> Iterator[Diagnostic]:
        """Couplings that repeat what others say."""
        for branch in self.tree.redundant:
            others = [other for other in self.tree.loops[branch] if self.kind(other) is Kind.COUPLING]
            by = f"{self.titles(others)} already" if others else "the frame already"
            message = f"{self.titles([branch])} asks for nothing that is not held by {by}."
            hint = "This is allowed; how rigid ways share the load is open, and this part is taken to carry none."
            parts = self.parts([branch, *others])
            yield Diagnostic("redundant coupling", message, hint, parts, self.ends([branch]), "note")

    def fixed_ratios(self) -> Iterator[Diagnostic]:
        """Ratios whose values decide the structure of the equations."""
        frozen = self.tree.frozen
        names = tuple(name for name in self.graph.parameters if name in frozen)
        if names:
            parts = tuple(dict.fromkeys(name.rsplit(".", 1)[0] for name in names))
            message = f"the values of {listed(names)} match in a closed loop and decide which equations there are."
            hint = "Another value needs a new assembly: build the network with it and compile again."
            yield Diagnostic("fixed ratios", message, hint, parts, (), "note")


def _jumps(law: sympy.Expr) -> tuple[float, ...]:
    """Times after the start at which a law of time jumps: the step over it does not shrink with the distance."""
    if not law.has(sympy.Piecewise, sympy.Heaviside, sympy.sign, InterpolationSlope):
        return ()
    times = tuple(time for time in breakpoints(law) if time > 0)
    gaps = [after - before for before, after in pairwise((0.0, *times))]

    def step(time: float, reach: float) -> float:
        before, after = (law.xreplace({t: sympy.Float(time + side)}) for side in (-reach, reach))
        return abs(float(after) - float(before)) if before.is_comparable and after.is_comparable else 0.0

    reach = 1e-3 * min(gaps, default=1.0)
    return tuple(time for time in times if step(time, reach / 64) > 0.5 * step(time, reach) > 0)


def changing_problems(view: View, jumping: Sequence[Diagnostic]) -> Iterator[Diagnostic]:
    """Impulses that would need the inertia of their instant, and travelling waves.

    Args:
        view: the state form.
        jumping: what is said of prescribed speeds that jump.
    """
    if not (changing := view.form.inertial):
        return
    store = view.words(changing[0]).store
    begin = f"{view.titles(changing)} at {at_nodes(view.ends(changing))}: its {store} changes during the motion,"
    rigid = [part for part in view.graph.parts if _strikes(part)]
    jumps = [problem.parts[0] for problem in jumping]
    waves = [*dict.fromkeys(view.graph.part_of(line).name for line in view.form.waves)]
    for others, what, hint in (
        ([part.name for part in rigid], "strikes rigidly", "Give the contact a stiffness c."),
        (jumps, "jumps, which is an impulse to what is joined to it", "Let it rise in a short while, as Ramp does."),
        (waves, "is a travelling wave", "Take model=Spectral(24) for the shaft."),
    ):
        if others:
            message = f"{begin} but {listed(others)} {what}."
            yield Diagnostic("changing inertia", message, hint, (*view.parts(changing), *others), view.ends(changing))


def _strikes(part: GraphPart) -> bool:
    """Whether a part has contacts from which speeds come back at once."""
    return any(leave.rebound is not None for modes in part.modes for mode in modes.options for leave in mode.leaves)
