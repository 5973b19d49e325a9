"""When a phase can be, and the laws of a network at such times: a motor that is off by then has none."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from sympy import And, Expr, Float, Not, Or, Piecewise, Symbol, false, true
from sympy.core.relational import Ge, Gt, Le, Lt, Relational

from shaftwork.components.laws import t as TIME
from shaftwork.components.modes import Mode
from shaftwork.network.graph import CircuitGraph, GraphPart

Span = tuple[float, float]
"""From a time up to another, s."""
ALWAYS: Span = (-math.inf, math.inf)


def span_of(graph: CircuitGraph, modes: Iterable[tuple[GraphPart, tuple[Mode, ...]]]) -> Span:
    """The times that parts in certain modes leave: a brake that is on is so from its `t_on` up to its `t_off`.

    Args:
        graph: of the network.
        modes: of each element those that a phase may mean, with the element's part.
    """
    low, high = ALWAYS
    for part, options in modes:
        values = _values(graph, part)
        spans = [_begins(mode.starts, values) for mode in options]
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
            law, printed = (_kept(each, span, values) for each in (template.law, template.printed))
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
    known = {name: graph.parameters.get(f"{part.name}.{name}", 0.0) for name in part.component.declared}
    return {Symbol(name, real=True): Float(value) for name, value in known.items()}


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


def _kept(law: Expr, span: Span, values: Mapping[Symbol, Float]) -> Expr:
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
