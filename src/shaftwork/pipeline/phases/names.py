"""Phases by their names: "gap open, load stuck" to the modes of every part."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from shaftwork.components.modes import Mode, ModeChoice, Modes
from shaftwork.core.errors import ParameterError
from shaftwork.network.graph import CircuitGraph, GraphPart, build_graph
from shaftwork.network.netlist import Netlist
from shaftwork.pipeline.phases.resting import at_rest
from shaftwork.reduction.form import state_form


def words_of(phase: Any) -> str:
    """The name of a phase that is given by it, or as a row of `Solution.phases`; whatever else is refused later."""
    words: str = getattr(phase, "name", phase)
    return words


def in_phase(netlist: Netlist, graph: CircuitGraph, phase: str) -> Netlist:
    """The network as it is in a phase: each part with the branches and the law of its mode alone.

    Args:
        netlist: of the network.
        graph: of the same network.
        phase: parts and modes, "gap open, load stuck"; parts that are not named are in their first mode.

    Raises:
        ParameterError: no part or mode has this name.
    """
    found = _modes_in(graph, phase)
    chosen = {
        part.name: tuple(_choice(found.get((part.name, modes.label), modes.options[0])) for modes in part.modes)
        for part in graph.parts
        if part.modes
    }
    made = netlist.with_choices(chosen)
    return at_rest(made, state_form(build_graph(made)))


def whole_name(graph: CircuitGraph, phase: str = "") -> str:
    """The name of a phase with the mode of every part in it, also of those that are not named: "gap open, load stuck".

    Raises:
        ParameterError: no part or mode has this name.
    """
    names = (name for name, _, _ in _elements(graph))
    return ", ".join(f"{name} {mode.words}" for name, mode in zip(names, modes_in(graph, phase), strict=True))


def modes_in(graph: CircuitGraph, phase: str) -> tuple[Mode, ...]:
    """The mode of every element in a phase; the first one of those that are not named.

    Raises:
        ParameterError: no part or mode has this name.
    """
    found = _modes_in(graph, phase)
    return tuple(found.get((part.name, modes.label), modes.options[0]) for _, part, modes in _elements(graph))


def meant(graph: CircuitGraph, phase: str) -> Iterator[tuple[GraphPart, tuple[Mode, ...]]]:
    """Of each element its part, and the modes that say what the phase says of it.

    Raises:
        ParameterError: no part or mode has this name.
    """
    found = _modes_in(graph, phase)
    for _, part, modes in _elements(graph):
        words = found.get((part.name, modes.label), modes.options[0]).words
        yield part, tuple(mode for mode in modes.options if mode.words == words)


def _choice(mode: Mode) -> ModeChoice:
    return ModeChoice(mode.form, mode.value)


def _modes_in(graph: CircuitGraph, phase: str) -> dict[tuple[str, str], Mode]:
    """The modes that a phase names, by part and label of the element."""
    if not isinstance(phase, str):
        raise ParameterError(f"phase = {phase!r} must be a text such as 'gap open'. {known_modes(graph)}")
    found: dict[tuple[str, str], Mode] = {}
    for words in filter(None, (part.strip() for part in phase.split(","))):
        part, modes, mode = _named(graph, words)
        found[part.name, modes.label] = mode
    return found


def _elements(graph: CircuitGraph) -> Iterator[tuple[str, GraphPart, Modes]]:
    for part in graph.parts:
        for modes in part.modes:
            yield (f"{part.name}.{modes.label}" if modes.label else part.name), part, modes


def _named(graph: CircuitGraph, words: str) -> tuple[GraphPart, Modes, Mode]:
    for name, part, modes in _elements(graph):
        for mode in modes.options:
            if words in (f"{name} {mode.words}", f"{name} {mode.name}"):
                return part, modes, mode
    raise ParameterError(f"There is no phase '{words}'. {known_modes(graph)}")


def known_modes(graph: CircuitGraph) -> str:
    """The parts that change their mode with their modes, as the end of a message."""
    known = [f"{name} {_either(modes.options)}" for name, _, modes in _elements(graph)]
    return f"There are: {'; '.join(known)}." if known else "No part of this network changes its mode."


def _either(options: Sequence[Mode]) -> str:
    return " | ".join(dict.fromkeys(mode.words for mode in options))
