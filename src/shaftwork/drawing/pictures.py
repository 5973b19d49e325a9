"""A network as a picture: a drive train, its circuit, or its dual circuit with the letters of the drive train."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from shaftwork.core.errors import ParameterError
from shaftwork.drawing.canvas import Drawing, drawn
from shaftwork.drawing.items import End, Item, Letters, circuit_items, train_items
from shaftwork.drawing.symbols import CIRCUIT
from shaftwork.equations.records import NamedPhase
from shaftwork.network.graph import GROUND, CircuitGraph

if TYPE_CHECKING:
    from shaftwork.pipeline.network import Network


def drawing_of(
    network: Network, *, as_circuit: bool, analogy: str, values: bool, expand: bool, phase: str | NamedPhase | None
) -> Drawing:
    """The drawing of a network; arguments and errors as of `Network.draw`."""
    if analogy not in ("force-current", "force-voltage"):
        raise ParameterError(f"analogy = {analogy!r} must be 'force-current' or 'force-voltage'.")
    if analogy == "force-current":
        equations = network.equations(expand=expand, phase=phase)
        graph, items = equations.form.graph, circuit_items if as_circuit else train_items
        modes = {} if phase is None else _modes_in(network, phase)
        return drawn(graph, tuple(items(Letters(graph, equations.symbol_names, values, modes))), train=not as_circuit)
    if not as_circuit:
        raise ParameterError("analogy='force-voltage' is one of circuits. Write draw(as_circuit=True, analogy=...).")
    dual = network.dual()
    equations, graph = dual.original.equations(phase=phase), dual.graph()
    letters = Letters(equations.form.graph, equations.symbol_names, values, {})
    return drawn(graph, tuple(_dual_items(letters, graph, dual.branches)), train=False)


def _modes_in(network: Network, phase: str | NamedPhase) -> dict[str, str]:
    """The mode of every part that changes its, in words."""
    from shaftwork.hybrid.named_phases import words_of, words_of_modes

    return words_of_modes(network.graph(), words_of(phase))


def _dual_items(letters: Letters, dual: CircuitGraph, branches: Mapping[str, int]) -> Iterator[Item]:
    """An item for each part of the dual; a resistor and a capacitor in series to the reference hang in a column.

    Args:
        letters: of the drive train.
        dual: the graph of its dual.
        branches: by name of a part of the dual the branch of the train that it is the dual of.
    """
    items = [
        replace(item, lines=_lines(letters, item, branches))
        for item in circuit_items(Letters(dual, {}, letters.values, {}))
    ]
    yield from _in_columns(items)


def _lines(letters: Letters, item: Item, branches: Mapping[str, int]) -> tuple[str, ...]:
    """The letters of what an item is the dual of; a part that it does not have there has its name."""
    if item.part not in branches:
        return item.lines
    branch = letters.graph.branches[branches[item.part]]
    part = letters.graph.parts[branch.part]
    return tuple(letters.of_part(part) if branch.terms else letters.of_branch(branch, part, dual=True))


def _in_columns(items: Sequence[Item]) -> Iterator[Item]:
    """The items, a resistor above the capacitor with which it alone shares a node."""
    at: dict[End, list[Item]] = defaultdict(list)
    for item in items:
        for end in dict.fromkeys(item.ends):
            at[end].append(item)
    below: dict[int, Item] = {}
    for node, pair in at.items():
        upper = next((item for item in pair if item.shape is CIRCUIT["resistor"] and GROUND not in item.ends), None)
        lower = next((item for item in pair if item.shape is CIRCUIT["capacitor"] and GROUND in item.ends), None)
        if node != GROUND and len(pair) == 2 and upper is not None and lower is not None and id(upper) not in below:
            first = next(end for end in upper.ends if end != node)
            below[id(upper)] = replace(upper, ends=(first, node), below=replace(lower, ends=(node, GROUND)))
            below[id(lower)] = lower
    for item in items:
        if id(item) not in below:
            yield item
        elif below[id(item)].below is not None:
            yield below[id(item)]
