"""Which parameters the laws of a network read: the ramp of a drive whose frequency is given has no effect."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from sympy import Symbol

from shaftwork.components.modes import ModeChoice, Modes
from shaftwork.network.graph import CircuitGraph, GraphPart, resolve
from shaftwork.network.netlist import Placed
from shaftwork.network.sharing import Shared
from shaftwork.network.templates import Template, make_template


def effective(graph: CircuitGraph) -> frozenset[str]:
    """The parameters, "part.name", that a law reads in any mode of its part, or that say when a mode begins or ends."""
    templates = Shared(make_template)
    return frozenset(f"{part.name}.{name}" for part in graph.parts for name in _of_part(part, templates))


def _of_part(part: GraphPart, templates: Shared[Template]) -> Iterator[str]:
    values = resolve(Placed(part.component, ()))[0].values
    forms = [templates.of(part.component, values, choices)[0] for choices in _forms(part.modes)]
    laws = {item.name: item.law for template in forms for item in template.derived}
    pending, read = list(_symbols(forms)), set(part.consulted)
    while pending:
        name = pending.pop().name
        pending += laws.pop(name).free_symbols if name in laws else ()
        read.add(name)
    return (name for name in part.component.declared if name in read)


def _forms(elements: tuple[Modes, ...]) -> Iterator[tuple[ModeChoice, ...]]:
    """What may be chosen: each form of each element beside the first ones of the others."""
    firsts = tuple(ModeChoice(element.options[0].form) for element in elements)
    yield firsts
    for place, element in enumerate(elements):
        for form in dict.fromkeys(form for mode in element.options for form in mode.forms):
            yield (*firsts[:place], ModeChoice(form), *firsts[place + 1 :])


def _symbols(templates: Iterable[Template]) -> Iterator[Symbol]:
    """The symbols in laws, in what is stored, and in what begins and ends modes."""
    for template in templates:
        for branch in template.branches:
            yield from branch.symbols
        for mode in (mode for element in template.modes for mode in element.options):
            yield from mode.starts.free_symbols
            for leave in mode.leaves:
                for guard in (leave.when, leave.rebound, leave.rest):
                    yield from () if guard is None else guard.free_symbols
