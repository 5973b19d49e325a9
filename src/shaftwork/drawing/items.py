"""What is drawn of a network: an item for each part of a train, or for each element of its analogue circuit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from shaftwork.core.domains import ELECTRICAL
from shaftwork.drawing.symbols import CIRCUIT, TRAIN, Shape
from shaftwork.network.graph import GROUND, CircuitGraph, GraphBranch, GraphPart
from shaftwork.network.kinds import Kind

End = int
"""The number of a node; `GROUND` is the frame or the reference."""
MOST_ELEMENTS = 4
"""Elements of a part beyond which its circuit is one box: a shaft of many elements, a machine with windings."""

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
    """

    part: str
    shape: Shape
    ends: tuple[End, ...]
    lines: tuple[str, ...]


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

    def of_mode(self, part: GraphPart) -> Iterator[str]:
        """The name of a part, and its mode where a phase is drawn."""
        yield part.name
        if part.name in self.modes:
            yield self.modes[part.name]

    def of_part(self, part: GraphPart) -> Iterator[str]:
        """One or two parameters that are numbers, times left out; of more, or none, the name of the part."""
        declared = part.component.declared
        names = [name for name in part.parameters if name in declared and declared[name].unit != "s"]
        if len(names) not in (1, 2):
            yield part.name
        elif self.values:
            for name in names:
                letter, number = self._letter(part, name), self.graph.parameters[f"{part.name}.{name}"]
                yield f"${letter} = {_number(number)}$ {_unit(declared[name].unit)}".strip()
        else:
            yield ", ".join(f"${self._letter(part, name)}$" for name in names)
        if part.name in self.modes:
            yield self.modes[part.name]

    def of_branch(self, branch: GraphBranch, part: GraphPart) -> Iterator[str]:
        """The parameter that a law is alone, of springs and dampers its inverse; else the name of the part."""
        law, kind = branch.template.law, branch.template.kind
        symbol = next((symbol for symbol in law.free_symbols if law in (symbol, 1 / symbol)), None)
        if symbol is None or symbol.name not in part.parameters:
            yield part.name
            return
        name, inverse = symbol.name, law == symbol and kind in (Kind.THROUGH_STORE, Kind.CONDUCTANCE)
        letter, declared = self._letter(part, name), part.component.declared.get(name)
        if inverse or not self.values or declared is None:
            yield f"$1/{letter}$" if inverse else f"${letter}$"
        if self.values and declared is not None:
            yield f"${letter} = {_number(self.graph.parameters[f'{part.name}.{name}'])}$ {_unit(declared.unit)}".strip()

    def _letter(self, part: GraphPart, name: str) -> str:
        return self.latex[f"{part.name}.{name}"].translate(MARKS)


MARKS = dict.fromkeys(range(0xE000, 0xF900))
"""Characters without a picture, by which the printer of equations marks numbers."""


def _number(value: float) -> str:
    """A number in at most five digits, with a power of ten where it is very large or small."""
    mantissa, _, exponent = f"{value:.5g}".partition("e")
    return mantissa + (rf" \cdot 10^{{{int(exponent)}}}" if exponent else "")


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit.replace("*", " ").replace("^2", "²").replace("^3", "³")


def train_items(letters: Letters) -> Iterator[Item]:
    """An item for each part."""
    for part in letters.graph.parts:
        ends = tuple(part.nodes[port.name] for port in part.component.ports)
        if set(ends) != {GROUND}:
            yield Item(part.name, train_shape(part, letters.graph), ends, tuple(letters.of_part(part)))


def train_shape(part: GraphPart, graph: CircuitGraph) -> Shape:
    """The symbol of a part: that of its class, or of the nearest class above that has one, or of its role."""
    component = part.component
    for kind in type(component).__mro__:
        if kind.__name__ in SHAPES:
            name = SHAPES[kind.__name__]
            if name == "spring" and any(graph.branches[k].template.kind is Kind.CONDUCTANCE for k in part.branches):
                name = "spring and damper"
            return TRAIN[name]
    if len(component.ports) == 1 and component.role == "store":
        return TRAIN["disc"]
    return TRAIN[BY_ROLE[component.role] if len(component.ports) <= 2 else "box"]


def circuit_items(letters: Letters) -> Iterator[Item]:
    """An item for each element of the analogue circuit; a part of many elements, or with nodes inside, is one box."""
    graph = letters.graph
    for part in graph.parts:
        ports = tuple(part.nodes[port.name] for port in part.component.ports)
        branches = [graph.branches[k] for k in part.branches]
        inner = any(node not in (*ports, GROUND) for branch in branches for node in nodes_of(branch))
        if len(branches) > MOST_ELEMENTS or inner:
            shape = CIRCUIT["line" if SHAPES.get(type(part.component).__name__) == "shaft" else "box"]
            yield Item(part.name, shape, ports, (part.name,))
            continue
        if SHAPES.get(type(part.component).__name__) == "diode" or not branches:
            shape = CIRCUIT["diode" if part.component.ports[0].domain is ELECTRICAL else "break"]
            yield Item(part.name, shape, (*ports, GROUND)[:2], tuple(letters.of_mode(part)))
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
        active = part.component.role == "source"
        shape = ELEMENTS.get(kind, "current" if active else "nonlinear")
        if kind is Kind.THROUGH_SOURCE and part.component.role == "loss":
            shape = "nonlinear"
        lines = letters.of_branch(branch, part)
        yield Item(part.name, CIRCUIT[shape], (branch.plus, branch.minus), tuple(lines))


def _coupling(branch: GraphBranch, part: GraphPart, letters: Letters) -> Iterator[Item]:
    """A transformer for a gear between two nodes, a closed contact for a rigid joint, else a box."""
    pairs = [(plus, minus) for _, plus, minus in branch.terms if plus != minus]
    if len(pairs) == 1:
        yield Item(part.name, CIRCUIT["contact"], pairs[0], tuple(letters.of_mode(part)))
    elif len(pairs) == 2 and all(minus == GROUND for _, minus in pairs):
        lines = tuple(letters.of_part(part))
        yield Item(part.name, CIRCUIT["transformer"], (pairs[0][0], pairs[1][0]), lines)
    elif pairs:
        yield Item(part.name, CIRCUIT["box"], tuple(dict.fromkeys(n for pair in pairs for n in pair)), (part.name,))
