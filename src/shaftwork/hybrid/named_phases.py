"""Phases by their names: "gap open, load stuck" to the modes of every part, the network in them, and its laws then.

A phase may be possible at some times only. Of their laws of time only what acts at these is shown: a motor that is off
by then has none.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from sympy import And, Expr, Float, Not, Or, Piecewise, Symbol, false, true
from sympy.core.relational import Ge, Gt, Le, Lt, Relational

from shaftwork.components.laws import t as TIME
from shaftwork.components.modes import Mode, ModeChoice
from shaftwork.core.errors import ParameterError
from shaftwork.equations.kirchhoff import kirchhoff
from shaftwork.equations.records import Equations, NamedPhase
from shaftwork.formulation.form import StateForm, state_form
from shaftwork.hybrid.modes.mode_machines import machines_of, with_laws_of_rest
from shaftwork.network.graph import CircuitGraph, GraphPart, build_graph
from shaftwork.network.netlist import Netlist

Span = tuple[float, float]
"""From a time up to another, s."""
ALWAYS: Span = (-math.inf, math.inf)


def words_of(phase: Any) -> str:
    """The name of a phase that is given by it, or as a row of `Solution.phases`; whatever else is refused later."""
    words: str = getattr(phase, "name", phase)
    return words


def equations_in(
    netlist: Netlist, form: StateForm, phase: str | NamedPhase, sound: Callable[[Netlist], StateForm]
) -> Equations:
    """The equations of a network in a phase of its motion.

    Args:
        netlist: of the network.
        form: its state form in the first mode of every part.
        phase: parts and modes, or a row of `Solution.phases`.
        sound: makes the state form of a network without errors.

    Raises:
        NetworkError: the network cannot be assembled in that phase.
        ParameterError: no part or mode has this name.
    """
    name = words_of(phase)
    then = _form_in(netlist, form.graph, name, sound) if name else form
    again = partial(equations_in, netlist, form, sound=sound)
    return dataclasses.replace(kirchhoff(then), phase=whole_name(form.graph, name), in_phase=again)


def _form_in(netlist: Netlist, graph: CircuitGraph, phase: str, sound: Callable[[Netlist], StateForm]) -> StateForm:
    """The state form in a phase, with the laws that hold at its times."""
    form = sound(in_phase(netlist, graph, phase))
    then = during(form.graph, span_of(graph, phase))
    return form if then is form.graph else state_form(then)


def in_phase(netlist: Netlist, graph: CircuitGraph, phase: str) -> Netlist:
    """The network as it is in a phase: each part with the branches and the law of its mode alone.

    Args:
        netlist: of the network.
        graph: of the same network.
        phase: parts and modes, "gap open, load stuck"; parts that are not named are in their first mode.

    Raises:
        ParameterError: no part or mode has this name.
    """
    chosen: dict[str, tuple[ModeChoice, ...]] = {}
    for machine, mode in zip(machines_of(graph), modes_in(graph, phase), strict=True):
        chosen[machine.part.name] = (*chosen.get(machine.part.name, ()), ModeChoice(mode.form, mode.value))
    in_modes = netlist.with_choices(chosen)
    return with_laws_of_rest(in_modes, state_form(build_graph(in_modes)))


def whole_name(graph: CircuitGraph, phase: str = "") -> str:
    """The name of a phase with the mode of every part in it, also of those that are not named: "gap open, load stuck".

    Raises:
        ParameterError: no part or mode has this name.
    """
    return ", ".join(f"{name} {words}" for name, words in words_of_modes(graph, phase).items())


def words_of_modes(graph: CircuitGraph, phase: str) -> dict[str, str]:
    """The mode of every part in words, also of those that a phase does not name.

    Raises:
        ParameterError: no part or mode has this name.
    """
    pairs = zip(machines_of(graph), modes_in(graph, phase), strict=True)
    return {machine.name: mode.words for machine, mode in pairs}


def modes_in(graph: CircuitGraph, phase: str) -> tuple[Mode, ...]:
    """The mode of every machine in a phase; the first one of those that are not named.

    Raises:
        ParameterError: no part or mode has this name.
    """
    if not isinstance(phase, str):
        raise ParameterError(f"phase = {phase!r} must be a text such as 'gap open'. {known_modes(graph)}")
    machines = machines_of(graph)
    named = dict(_named(graph, words) for words in filter(None, (part.strip() for part in phase.split(","))))
    return tuple(named.get(machine.name, machine.modes.options[0]) for machine in machines)


def _named(graph: CircuitGraph, words: str) -> tuple[str, Mode]:
    """The machine and its mode of which some words are."""
    for machine in machines_of(graph):
        for mode in machine.modes.options:
            if words in (f"{machine.name} {mode.words}", f"{machine.name} {mode.name}"):
                return machine.name, mode
    raise ParameterError(f"There is no phase '{words}'. {known_modes(graph)}")


def known_modes(graph: CircuitGraph) -> str:
    """The parts that change their mode with their modes, as the end of a message."""
    machines = machines_of(graph)
    options = [f"{e.name} {' | '.join(dict.fromkeys(mode.words for mode in e.modes.options))}" for e in machines]
    return f"There are: {'; '.join(options)}." if options else "No part of this network changes its mode."


def span_of(graph: CircuitGraph, phase: str) -> Span:
    """The times that the modes of a phase leave: a brake that is on is so from its `t_on` up to its `t_off`.

    Raises:
        ParameterError: no part or mode has this name.
    """
    low, high = ALWAYS
    for machine, mode in zip(machines_of(graph), modes_in(graph, phase), strict=True):
        values = _values(graph, machine.part)
        spans = [_begins(other.starts, values) for other in machine.modes.options if other.words == mode.words]
        first, last = min(begin for begin, _ in spans), max(end for _, end in spans)
        if first < last:  # no motion begins in a contact of rigid flanks, and it is at any time
            low, high = max(low, first), min(high, last)
    return (low, high) if low < high else ALWAYS


def during(graph: CircuitGraph, span: Span) -> CircuitGraph:
    """The same network with laws that keep, of their cases of the time, those of a span; itself where none changes."""
    changed = {}
    for branch in graph.branches:
        template = branch.template
        if template.law.has(Piecewise) and TIME in template.law.free_symbols:
            values = _values(graph, graph.parts[branch.part])
            law, printed = (_restricted(each, span, values) for each in (template.law, template.printed))
            if law != template.law:
                other = dataclasses.replace(template, law=law, printed=printed)
                changed[branch.index] = dataclasses.replace(branch, template=other)
    if not changed:
        return graph
    branches = tuple(changed.get(branch.index, branch) for branch in graph.branches)
    parts = tuple(
        _with_letters_left(part, [branches[index].template.printed for index in part.branches]) for part in graph.parts
    )
    return dataclasses.replace(graph, branches=branches, parts=parts)


def _with_letters_left(part: GraphPart, printed: Sequence[Expr]) -> GraphPart:
    """The part, without its derived quantities where no law is printed in them any more."""
    left = {symbol.name for law in printed for symbol in law.free_symbols}
    return part if left & {each.name for each in part.derived} else dataclasses.replace(part, derived=())


def _values(graph: CircuitGraph, part: GraphPart) -> Mapping[Symbol, Float]:
    names = part.component.declared
    return {Symbol(name, real=True): Float(graph.parameters.get(f"{part.name}.{name}", 0.0)) for name in names}


def _begins(condition: Any, values: Mapping[Symbol, Float]) -> Span:
    """The least span of time outside which a condition does not hold, whatever the motion."""
    if condition == false:
        return math.inf, -math.inf
    if isinstance(condition, Relational):
        return _side(condition, values) or ALWAYS
    if isinstance(condition, Not) and isinstance(condition.args[0], Relational):
        return _begins(condition.args[0].negated, values)
    parts = [_begins(part, values) for part in condition.args] if isinstance(condition, And | Or) else [ALWAYS]
    inner, outer = (max, min) if isinstance(condition, And) else (min, max)
    return inner(low for low, _ in parts), outer(high for _, high in parts)


def _side(relation: Relational, values: Mapping[Symbol, Float]) -> Span | None:
    """The span of time in which an inequality of the time and parameters holds; None of any other condition."""
    difference = relation.lhs - relation.rhs
    slope = difference.diff(TIME)
    if slope not in (1, -1) or not isinstance(relation, Lt | Le | Gt | Ge):
        return None
    boundary = (-difference.xreplace({TIME: 0 * slope}) / slope).xreplace(values)
    if not boundary.is_number:
        return None
    later = isinstance(relation, Gt | Ge) == (slope == 1)
    return (float(boundary), math.inf) if later else (-math.inf, float(boundary))


def _restricted(law: Expr, span: Span, values: Mapping[Symbol, Float]) -> Expr:
    """A law whose conditions are true or false where the whole span says so."""
    relations = {relation for cases in law.atoms(Piecewise) for relation in cases.atoms(Relational)}
    decided = {relation: _decided(relation, span, values) for relation in relations}
    return law.subs({relation: truth for relation, truth in decided.items() if truth is not None})


def _decided(relation: Relational, span: Span, values: Mapping[Symbol, Float]) -> Any:
    side = _side(relation, values)
    if side is None:
        return None
    if side[0] <= span[0] and span[1] <= side[1]:
        return true
    return false if span[1] <= side[0] or side[1] <= span[0] else None
