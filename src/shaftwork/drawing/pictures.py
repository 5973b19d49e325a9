"""A network as a picture: a drive train, its circuit, or its dual circuit with the letters of the drive train."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from shaftwork.core.errors import ParameterError
from shaftwork.drawing.canvas import Drawing, drawn
from shaftwork.drawing.items import End, Item, Letters, circuit_items, train_items
from shaftwork.drawing.symbols import CIRCUIT
from shaftwork.equations.records import Equations, NamedPhase
from shaftwork.network.graph import GROUND, CircuitGraph


def refuse_analogy(analogy: str, *, as_circuit: bool) -> None:
    """Refuse what is no analogy, or one of circuits for the picture of a drive train.

    Raises:
        ParameterError: it is so.
    """
    if analogy not in ("force-current", "force-voltage"):
        raise ParameterError(f"analogy = {analogy!r} must be 'force-current' or 'force-voltage'.")
    if analogy == "force-voltage" and not as_circuit:
        raise ParameterError(f"analogy = {analogy!r} is one of circuits. Write draw(as_circuit=True, analogy=...).")


def picture(
    equations: Equations,
    in_phase: tuple[CircuitGraph, str | NamedPhase] | None,
    *,
    as_circuit: bool,
    values: bool,
    width: float,
) -> Drawing:
    """A drive train or its circuit.

    Args:
        equations: of the network.
        in_phase: where a phase is drawn, the graph of the network and the phase.
        as_circuit: whether it is drawn as a circuit.
        values: whether the values of parameters are written.
        width: of the drawing, pt.
    """
    modes = {} if in_phase is None else _words_of_modes(*in_phase)
    graph, items = equations.form.graph, circuit_items if as_circuit else train_items
    letters = Letters(graph, equations.symbol_names, values, modes)
    return drawn(graph, tuple(items(letters)), train=not as_circuit, width=width)


def dual_picture(
    equations: Equations, dual: CircuitGraph, branches: Mapping[str, int], *, values: bool, width: float
) -> Drawing:
    """The dual circuit with the letters of the drive train.

    Args:
        equations: of the network.
        dual: the graph of its dual.
        branches: by name of a part of the dual the branch of the network that it is the dual of.
        values: whether the values of parameters are written.
        width: of the drawing, pt.
    """
    letters = Letters(equations.form.graph, equations.symbol_names, values, {})
    return drawn(dual, tuple(_dual_items(letters, dual, branches)), train=False, width=width)


def _words_of_modes(graph: CircuitGraph, phase: str | NamedPhase) -> dict[str, str]:
    """The mode of every part that changes its, in words."""
    from shaftwork.hybrid.named_phases import words_of, words_of_modes

    return words_of_modes(graph, words_of(phase))


def _dual_items(letters: Letters, dual: CircuitGraph, branches: Mapping[str, int]) -> Iterator[Item]:
    """An item for each part of the dual; a resistor and a capacitor in series to the reference hang in a column.

    Args:
        letters: of the drive train.
        dual: the graph of its dual.
        branches: by name of a part of the dual the branch of the train that it is the dual of.
    """
    items = [
        replace(item, lines=_lines(letters, item, branches, dual))
        for item in circuit_items(Letters(dual, {}, letters.values, {}))
    ]
    yield from _in_columns(items)


def _lines(letters: Letters, item: Item, branches: Mapping[str, int], dual: CircuitGraph) -> tuple[str, ...]:
    """The letters of what an item is the dual of; a part that it does not have there has its name.

    A coupling of three speeds is two transformers, whose ratios are no parameters: they are in numbers.
    """
    if item.part not in branches:
        return item.lines
    branch = letters.graph.branches[branches[item.part]]
    part = letters.graph.parts[branch.part]
    if not branch.terms:
        return tuple(letters.of_branch(branch, part, dual=True))
    if len(branch.terms) > 2:
        return *item.lines, f"{dual.parameters[f'{item.part}.ratio']:.5g} : 1"
    lines = tuple(letters.of_part(part))
    letter = lines[0].split(" = ")[0].strip("$") if lines else ""
    return (f"$1/{letter}$", *(line for line in lines if " = " in line)) if letter else lines


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
