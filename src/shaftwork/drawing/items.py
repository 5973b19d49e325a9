"""What is drawn of a network: an item for each part of a train, or for each element of its analogue circuit."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from sympy import Expr

from shaftwork.drawing.symbols import CIRCUIT, TRAIN, Shape
from shaftwork.drawing.windings import Winding
from shaftwork.network.graph import GROUND, CircuitGraph, GraphBranch, GraphPart
from shaftwork.network.kinds import Kind

End = int
"""The number of a node; `GROUND` is the frame or the reference."""
MOST_LETTERS, MOST_VALUES = 2, 4
"""Parameters of a part whose letters stand beside it, and whose values do; one of more has its name alone."""

SHAPES: Mapping[str, str] = {
    "Inertia": "disc",
    "Mass": "mass",
    "Spring": "spring",
    "TranslationalSpring": "spring",
    "Damper": "damper",
    "TranslationalDamper": "damper",
    "Shaft": "shaft",
    "Gear": "gear",
    "LossyGear": "gear",
    "PlanetaryGear": "planetary gear",
    "Ground": "wire",
    "Drum": "rack",
    "Wheel": "rack",
    "TorqueSource": "torque",
    "ForceSource": "torque",
    "SpeedSource": "speed",
    "DryFriction": "friction",
    "Brake": "brake",
    "Clutch": "clutch",
    "Freewheel": "freewheel",
    "ContactPart": "gap",
    "HardStop": "stop",
    "Rope": "rope",
    "SpeedController": "controller",
    "StateSpaceController": "controller",
    "TransferFunctionController": "controller",
    "Resistor": "resistor",
    "Inductor": "inductor",
    "Capacitor": "capacitor",
    "VoltageSource": "voltage",
    "CurrentSource": "current",
    "Switch": "switch",
    "Diode": "diode",
}
"""The symbol of a class and of those derived from it; others by their role."""
BY_ROLE = {"source": "motor", "loss": "load", "store": "spring", "coupling": "box"}
ELEMENTS = {
    Kind.ACROSS_STORE: "capacitor",
    Kind.THROUGH_STORE: "inductor",
    Kind.CONDUCTANCE: "resistor",
    Kind.THROUGH_SOURCE: "current",
    Kind.ACROSS_SOURCE: "voltage",
}


@dataclass(frozen=True)
class Item:
    """A symbol with its ends.

    Args:
        part: the part that it is of.
        shape: the symbol.
        ends: the nodes that it joins, in the order of its ends.
        lines: of text beside it, with formulas between dollar signs.
        ports: of a part with more than two ends the name of each, by node.
        windings: of a transformer that is no pair of grounded windings.
        below: what hangs from its second end, and ends at the reference.
    """

    part: str
    shape: Shape
    ends: tuple[End, ...]
    lines: tuple[str, ...]
    ports: Mapping[End, str] = field(default_factory=dict)
    windings: tuple[Winding, ...] = ()
    below: Item | None = None


@dataclass(frozen=True)
class Letters:
    """What is written beside symbols.

    Args:
        graph: of the network.
        latex: by name of parameter, "shaft.c".
        values: whether numbers are written too.
        modes: of parts that change theirs, by name, where a phase is drawn.
    """

    graph: CircuitGraph
    latex: Mapping[str, str]
    values: bool
    modes: Mapping[str, str]

    def of_name(self, part: GraphPart) -> Iterator[str]:
        """The name of a part, and its mode where a phase is drawn."""
        yield plain(part.name)
        yield from self._mode(part)

    def of_part(self, part: GraphPart) -> Iterator[str]:
        """The parameters of a part, times left out, if they are few; else its name."""
        declared = part.component.declared
        names = [name for name in part.parameters if name in declared and declared[name].unit != "s"]
        letters = [self._letter(part, name) for name in names]
        if not names or len(names) > (MOST_VALUES if self.values else MOST_LETTERS) or not all(letters):
            yield plain(part.name)
        elif self.values:
            if len(names) > MOST_LETTERS:
                yield plain(part.name)
            for name, letter in zip(names, letters, strict=True):
                yield _valued(letter, self.graph.parameters[f"{part.name}.{name}"], declared[name].unit)
        else:
            yield ", ".join(f"${letter}$" for letter in letters)
        yield from self._mode(part)

    def of_branch(self, branch: GraphBranch, part: GraphPart, *, dual: bool = False) -> Iterator[str]:
        """The parameter that a law is alone, of springs and dampers its inverse; else the name of the part.

        In the dual a damper has its own letter, and a resistor the inverse.
        """
        law, kind = branch.template.law, branch.template.kind
        symbol = next((symbol for symbol in law.free_symbols if law in (symbol, -symbol, 1 / symbol)), None)
        name = "" if symbol is None or symbol.name not in part.component.declared else symbol.name
        letter = self._letter(part, name) if name in part.parameters else ""
        inverse = kind in (Kind.THROUGH_STORE, Kind.CONDUCTANCE) and (law == symbol) != (
            dual and kind is Kind.CONDUCTANCE
        )
        if not letter:
            yield plain(part.name)
        elif not self.values:
            yield f"$1/{letter}$" if inverse else f"${letter}$"
        else:
            number, unit = self.graph.parameters[f"{part.name}.{name}"], part.component.declared[name].unit
            yield _valued(f"1/{letter}", 1 / number, _inverse(unit)) if inverse else _valued(letter, number, unit)
        if branch.index == part.branches[0]:
            yield from self._mode(part)

    def _mode(self, part: GraphPart) -> Iterator[str]:
        if part.name in self.modes:
            yield self.modes[part.name]

    def _letter(self, part: GraphPart, name: str) -> str:
        """The letter of a parameter, or nothing where its subscript has signs that cannot be drawn."""
        letter = self.latex.get(f"{part.name}.{name}", "").translate(MARKS)
        return letter if DRAWABLE.fullmatch(letter) else ""


MARKS = dict.fromkeys(range(0xE000, 0xF900))
"""Characters without a picture, by which the printer of equations marks numbers."""
DRAWABLE = re.compile(r"(?:[A-Za-z0-9,.()'{}_^ -]|\\(?:[A-Za-z]+|[ ,_%#]))+")
"""Formulas of which every sign can be drawn."""


def plain(name: str) -> str:
    """A name as a text that holds no formula."""
    return name.replace("$", r"\$")


def _valued(letter: str, value: float, unit: str) -> str:
    """A letter with its number, in at most five digits and with a power of ten where it is very large or small."""
    mantissa, _, exponent = f"{value:.5g}".partition("e")
    number = mantissa.replace("-", "$-$") + (rf" $\cdot\,10^{{{int(exponent)}}}$" if exponent else "")
    shown = "" if unit == "1" else unit.replace("*", " ").replace("^2", "²").replace("^3", "³")
    return f"${letter}$ = {number} {shown}".strip()


def _inverse(unit: str) -> str:
    """The unit of the inverse of a quantity: "rad/(N*m)" of "N*m/rad"."""
    above, _, below = unit.partition("/")
    return f"{below or 1}/({above})" if "*" in above else f"{below or 1}/{above}"


def train_items(letters: Letters) -> Iterator[Item]:
    """An item for each part."""
    for part in letters.graph.parts:
        ends = tuple(part.nodes[port.name] for port in part.component.ports)
        if set(ends) != {GROUND}:
            shape = train_shape(part, letters.graph)
            if part.name in letters.modes and _is_closed(part, letters.graph):
                shape = TRAIN["closed"]
            lines = () if shape is TRAIN["wire"] else tuple(letters.of_part(part))
            yield Item(part.name, shape, ends, lines, names_of(part))


def _is_closed(part: GraphPart, graph: CircuitGraph) -> bool:
    """Whether a part holds its ends together in a phase: rigidly, or as a gap in contact does."""
    branches = [graph.branches[k] for k in part.branches]
    rigid = all(branch.template.kind is Kind.COUPLING and len(branch.terms) == 1 for branch in branches)
    return bool(branches) and (rigid or symbol_of(part) in ("gap", "stop"))


def names_of(part: GraphPart) -> dict[End, str]:
    """The port at each node of a part."""
    return {part.nodes[port.name]: plain(port.name) for port in part.component.ports}


def train_shape(part: GraphPart, graph: CircuitGraph) -> Shape:
    """The symbol of a part: that of its class, or of the nearest class above that has one, or of its role."""
    component, name = part.component, symbol_of(part)
    if name == "spring" and any(graph.branches[k].template.kind is Kind.CONDUCTANCE for k in part.branches):
        name = "spring and damper"
    if name == "gear" and abs(graph.parameters.get(f"{part.name}.ratio", 1.0)) < 1.0:
        name = "gear up"
    if name:
        return TRAIN[name]
    if len(component.ports) == 1 and component.role == "store":
        return TRAIN["disc"]
    return TRAIN[BY_ROLE[component.role] if len(component.ports) <= 2 else "box"]


def symbol_of(part: GraphPart) -> str:
    """The symbol of the class of a part, or of the nearest class above that has one; empty where there is none."""
    names = (kind.__name__ for kind in type(part.component).__mro__)
    return next((SHAPES[name] for name in names if name in SHAPES), "")


def circuit_items(letters: Letters) -> Iterator[Item]:
    """An item for each element of the analogue circuit; a part of many elements, or with nodes inside, is one box."""
    graph = letters.graph
    for part in graph.parts:
        ports = tuple(part.nodes[port.name] for port in part.component.ports)
        signals = {part.nodes.get(name) for name in part.component.signal_ports}
        branches = [graph.branches[k] for k in part.branches if signals.isdisjoint(nodes_of(graph.branches[k]))]
        inner = any(node not in (*ports, GROUND) for branch in branches for node in nodes_of(branch))
        symbol = symbol_of(part)
        # A part of more than four elements, such as a machine with windings, is one box.
        whole = "line" if symbol == "shaft" else "box" if len(branches) > 4 or inner else ""
        whole = whole or ("diode" if symbol in ("diode", "freewheel") else "" if branches else "break")
        if whole:
            ends = (*ports, GROUND)[: max(2, len(ports))]
            yield Item(part.name, CIRCUIT[whole], ends, tuple(letters.of_name(part)), names_of(part))
            continue
        for branch in branches:
            yield from _elements(branch, part, letters)


def nodes_of(branch: GraphBranch) -> set[End]:
    """The nodes at which a branch ends."""
    if branch.terms:
        return {node for _, plus, minus in branch.terms for node in (plus, minus)}
    return {branch.plus, branch.minus}


def _elements(branch: GraphBranch, part: GraphPart, letters: Letters) -> Iterator[Item]:
    kind = branch.template.kind
    if kind is Kind.COUPLING:
        yield from _coupling(branch, part, letters)
    elif branch.plus != branch.minus:
        template, role = branch.template, part.component.role
        shape = ELEMENTS.get(kind, "current" if role == "source" else "nonlinear")
        if kind is Kind.LAW and template.has_integral and role != "source":
            shape = "nonlinear inductor"
        if kind is Kind.THROUGH_SOURCE and role == "loss" and not template.conservative:
            shape = "nonlinear"
        lines = letters.of_branch(branch, part)
        yield Item(part.name, CIRCUIT[shape], (branch.plus, branch.minus), tuple(lines))


def _coupling(branch: GraphBranch, part: GraphPart, letters: Letters) -> Iterator[Item]:
    """A closed contact for a rigid joint, else a transformer."""
    terms = [term for term in branch.terms if term[1] != term[2]]
    if len(terms) == 1:
        ground = symbol_of(part) == "wire"
        lines = () if ground else tuple(letters.of_name(part))
        yield Item(part.name, CIRCUIT["wire" if ground else "contact"], terms[0][1:], lines)
    elif terms:
        windings = tuple(_windings(terms, part, letters.graph))
        (first, *others), lines = windings, tuple(letters.of_part(part))
        if len(others) == 1 and all(winding.minus == GROUND for winding in windings):
            shape = CIRCUIT["transformer" if first.factor != others[0].factor else "reversing transformer"]
            yield Item(part.name, shape, (first.plus, others[0].plus), lines)
        else:
            ends = tuple(dict.fromkeys(node for winding in windings for node in (winding.plus, winding.minus)))
            yield Item(part.name, CIRCUIT["box"], ends, lines, windings=windings)


def _windings(terms: Sequence[tuple[Expr, End, End]], part: GraphPart, graph: CircuitGraph) -> Iterator[Winding]:
    """A winding for each term of a coupling; one with a grounded end has it last."""
    ports = {node: plain(port) for port, node in part.nodes.items()} if len(terms) > 2 else {}
    for factor, plus, minus in terms:
        values = {symbol: graph.parameters[f"{part.name}.{symbol.name}"] for symbol in factor.free_symbols}
        sign = 1 if float(factor.subs(values)) > 0.0 else -1
        yield (
            Winding(minus, GROUND, -sign, ports.get(minus, ""))
            if plus == GROUND
            else Winding(plus, minus, sign, ports.get(plus, "") if minus == GROUND else "")
        )
