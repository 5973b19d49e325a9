"""A train referred to one of its shafts: a network without rigid gears that moves the same."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from shaftwork.components.mechanics import LossyGear
from shaftwork.core.domains import ELECTRICAL
from shaftwork.core.errors import Diagnostic, NetworkError, ParameterError, SignalError
from shaftwork.core.screen import in_columns
from shaftwork.network.graph import GROUND, CircuitGraph, GraphPart
from shaftwork.network.measurements import refuse_measuring
from shaftwork.network.netlist import REFERENCE, Netlist, Placed
from shaftwork.pipeline.network import Network, network_of
from shaftwork.reduce.kinematics import Kinematics, Scale, kinematics
from shaftwork.reduce.referred_parts import Entry, ReferredPart, formula_of, referred_part

HEADINGS = ("part", "quantity", "value", "unit", "ratio", "referred", "unit", "formula")


@dataclass(frozen=True, eq=False)
class ReductionTable:
    """What became of every parameter at a reference shaft.

    Args:
        to: node of the reference shaft.
        entries: in the order of the network.
        read_names: gives LaTeX of the symbols of the network by name, when it is asked for.
    """

    to: str
    entries: tuple[Entry, ...]
    read_names: Callable[[], Mapping[str, str]]

    def __len__(self) -> int:
        return len(self.entries)

    def __iter__(self) -> Iterator[Entry]:
        return iter(self.entries)

    def __getitem__(self, name: str) -> Entry:
        """The entry of a parameter, "shaft.c".

        Raises:
            SignalError: there is none.
        """
        by_name = {f"{entry.part}.{entry.quantity}": entry for entry in self.entries}
        if name not in by_name:
            raise SignalError(f"No parameter '{name}' was referred to '{self.to}'. There are: {', '.join(by_name)}.")
        return by_name[name]

    def __str__(self) -> str:
        lines = in_columns([HEADINGS, *map(_cells, self.entries)])
        return "\n".join((f"referred to {self.to}", *lines))

    def latex(self) -> str:
        """The table as LaTeX, a `longtable` in the letters of the equations; what is a law stands below it.

        It needs the packages amsmath, booktabs, array and longtable.
        """
        from shaftwork.reduce.reduction_print import ReductionPrint

        return ReductionPrint(self.entries, self.read_names).latex()


def _cells(entry: Entry) -> tuple[str, ...]:
    value, ratio, referred = (_text(number) for number in (entry.value, entry.ratio, entry.referred))
    return (entry.part, entry.quantity, value, entry.unit, ratio, referred, entry.referred_unit, formula_of(entry))


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    shown = str(value)
    widest = 28  # characters
    return shown if len(shown) <= widest else f"{shown[: widest - 4]} ..."


@dataclass(frozen=True, eq=False)
class Referred:
    """A network as it is seen from one of its shafts.

    Args:
        network: without rigid gears, planetary gears, drums and wheels; its parts have the names that they had.
        table: every parameter before and after.
        to: node of the reference shaft.
        scales: by part, the ratio of its speed to that of the reference shaft, and what share of its power arrives.
        nodes: by node of the train, the node of the referred network that it became part of, and its scale.
        absorbed: the rigid parts that are in the ratios now.
        at_rest: parts that cannot move, and are left out.
    """

    network: Network
    table: ReductionTable
    to: str
    scales: Mapping[str, Scale]
    nodes: Mapping[str, tuple[str, Scale]]
    absorbed: tuple[str, ...]
    at_rest: tuple[str, ...]

    def ratio(self, part: str) -> float:
        """Speed of a part over that of the reference shaft.

        Raises:
            SignalError: there is no such part in the referred network.
        """
        return self._scale(part).ratio

    def torque_ratio(self, part: str) -> float:
        """Torque of a part in the referred network over that in the train: its ratio, less what lossy gears keep.

        Raises:
            SignalError: there is no such part in the referred network.
        """
        return self._scale(part).through

    def __str__(self) -> str:
        return str(self.table)

    def _scale(self, part: str) -> Scale:
        if part not in self.scales:
            raise SignalError(f"No part '{part}' was referred to '{self.to}'. There are: {', '.join(self.scales)}.")
        return self.scales[part]


def refer(net: Network, to: str, *, drives: Mapping[str, str] | None = None) -> Referred:
    """Refer a whole train to one of its shafts.

    Law: with i the speed of a part over that of the reference shaft, and equal energies and powers, J' = J i^2,
    c' = c i^2, d' = d i^2, gap' = gap / i, tau' = i tau; a mass at the radius r is an inertia, m' = m r^2 i^2, and a
    force a torque, F' = r i F; laws read omega = i omega', phi = i phi'. So every torque of the referred network is
    i times that of the train, exactly and at any time. Behind a lossy gear all but speeds, angles and gaps are
    multiplied by its efficiency besides, on the side that drives, and divided by it on the other: exact as long as that
    side drives, tau' = i eta tau.

    Every part is proven to do the same at the reference shaft: its laws are compared at some points. A part of one's
    own is referred by the units of its parameters; where they do not tell, it says so itself, by a ClassVar `referred`
    from parameters to the exponents of ratio and power, {"radius": (1, 0)}.

    Args:
        net: the train.
        to: a node of the reference shaft, rotating or translating; for the parts that have a counterpart along a line.
        drives: by name of a `LossyGear` the side that drives it, "a" or "b"; by default that of the motors and
            sources, where all of them are on one.

    Raises:
        ParameterError: `net` is no network, there is no such node, it cannot move, or `drives` names no lossy gear.
        NetworkError: the network cannot be assembled, or parts cannot be referred; lists every one with its reason.

    Source: Abdelkader 2016, (4)-(17), with (3) and (6) put right; Marinkovic 2012, 2.2 and (18).
    """
    graph, netlist = network_of(net).graph(), net.netlist()
    sides = _checked_sides(graph, {} if drives is None else drives)
    node = _checked_node(graph, to)
    ratios = kinematics(graph, sides)
    title = f"'{net.name}' cannot be referred to '{to}'"
    refuse_measuring(netlist, title)
    if ratios.problems:
        raise NetworkError(title, ratios.problems)
    if node not in ratios.shafts:
        raise ParameterError(f"Node '{to}' of '{net.name}' is held at rest: nothing can be referred to it.")
    view = _NodeView(graph, netlist, ratios, node)
    parts, problems = view.parts()
    if problems:
        raise NetworkError(title, problems)
    small = Network(f"{net.name}, referred to {to}")
    for part in parts:
        small.add(part.placed.part, *part.placed.nodes)
    entries = tuple(entry for part in parts for entry in part.entries)
    table = ReductionTable(to, entries, partial(_symbol_names, net))
    scales = {part.placed.part.name: part.scale for part in parts}
    absorbed = tuple(graph.parts[place].name for place in ratios.absorbed)
    at_rest = tuple(part.name for part in graph.parts if part.name not in scales and part.name not in absorbed)
    return Referred(small, table, to, scales, view.nodes(), absorbed, at_rest)


def _symbol_names(net: Network) -> Mapping[str, str]:
    return net.equations().symbol_names


def _checked_node(graph: CircuitGraph, to: str) -> int:
    nodes = [name for name, domain in zip(graph.nodes, graph.domains, strict=True) if domain is not ELECTRICAL]
    if to not in nodes:
        raise ParameterError(f"to = {to!r} is no mechanical node of '{graph.name}'. There are: {', '.join(nodes)}.")
    return graph.nodes.index(to)


def _checked_sides(graph: CircuitGraph, drives: Mapping[str, str]) -> Mapping[str, str]:
    if not isinstance(drives, Mapping):
        raise ParameterError(f"drives = {drives!r} must say the side of each gear by its name: drives={{'gear': 'a'}}.")
    gears = [part.name for part in graph.parts if isinstance(part.component, LossyGear)]
    for name, side in drives.items():
        if name not in gears:
            raise ParameterError(f"drives: there is no LossyGear '{name}'. There are: {', '.join(gears) or 'none'}.")
        if side not in ("a", "b"):
            raise ParameterError(f"drives: side {side!r} of '{name}' must be 'a' or 'b'.")
    return drives


@dataclass(frozen=True, eq=False)
class _NodeView:
    """A network from one of its nodes."""

    graph: CircuitGraph
    netlist: Netlist
    ratios: Kinematics
    to: int

    def parts(self) -> tuple[list[ReferredPart], tuple[Diagnostic, ...]]:
        """The parts at the reference shaft, and those that have no place there."""
        parts: list[ReferredPart] = []
        problems: list[Diagnostic] = []
        for place, (item, part) in enumerate(zip(self.netlist.placed, self.graph.parts, strict=True)):
            if place in self.ratios.absorbed:
                continue
            seen = self._part(item, part)
            if isinstance(seen, ReferredPart):
                parts.append(seen)
            elif seen is not None:
                problems.append(seen)
        return parts, tuple(problems)

    def _part(self, item: Placed, part: GraphPart) -> ReferredPart | Diagnostic | None:
        """A part at the reference shaft; None where it cannot move."""
        nodes = [number for number in part.nodes.values() if number != GROUND]
        moving = [number for number in nodes if number in self.ratios.shafts]
        places = tuple(self._place(part.nodes[port.name]) for port in item.part.ports[: len(item.nodes)])
        if not moving:
            electrical = any(self.graph.domains[number] is ELECTRICAL for number in nodes)
            return ReferredPart(Placed(item.part, places), Scale(), ()) if electrical else None
        if len(places) == 2 and places[0] == places[1]:
            return None
        name, kind = part.name, type(item.part).__name__
        if self.ratios.shafts[moving[0]][0] != self.ratios.shafts[self.to][0]:
            return Diagnostic(
                "other train",
                f"{kind} '{name}' is not joined to '{self.graph.node_name(self.to)}' by any shaft.",
                "Refer each train in a network of its own.",
                (name,),
            )
        seen = referred_part(item, places, self.scale(moving[0]), self.graph.domains[self.to])
        if isinstance(seen, ReferredPart):
            return seen
        hint = f"Refer to its own shaft, to='{self.graph.node_name(moving[0])}', or put a simpler part in its place."
        return Diagnostic(
            "no such part there", f"{kind} '{name}' cannot be referred: {seen.rstrip('.')}.", hint, (name,)
        )

    def _place(self, node: int) -> str:
        """Where a node is in the referred network: rigid shafts are one node."""
        if node == GROUND or self.graph.domains[node] is ELECTRICAL:
            return self.graph.node_name(node)
        if node not in self.ratios.rigid:
            return REFERENCE
        members = self.ratios.rigid.members(node)
        return self.graph.node_name(self.to if self.to in members else members[0])

    def scale(self, node: int) -> Scale:
        """Of a node to the reference shaft."""
        return self.ratios.shafts[node][1] / self.ratios.shafts[self.to][1]

    def nodes(self) -> Mapping[str, tuple[str, Scale]]:
        """What every moving node became."""
        moving = (node for node in range(len(self.graph.nodes)) if node in self.ratios.shafts)
        return {self.graph.node_name(node): (self._place(node), self.scale(node)) for node in moving}
