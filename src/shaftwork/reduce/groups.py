"""A chain of groups as a network, and the table of what its parts were made of."""

from __future__ import annotations

from dataclasses import dataclass

from shaftwork.components.contacts import Backlash
from shaftwork.components.rotation import Inertia, Spring
from shaftwork.equations.nomenclature import breakable, column, unit
from shaftwork.equations.nomenclature import table as longtable
from shaftwork.equations.printing import printed_number
from shaftwork.pipeline.network import Network
from shaftwork.reduce.chain import Chain, Link, Station, turning_nodes


@dataclass(frozen=True)
class Group:
    """What became one part: name, quantity, value in SI, and the names of what it was made of."""

    part: str
    quantity: str
    value: float
    unit: str
    made_of: tuple[str, ...]


@dataclass(frozen=True)
class GroupTable:
    """The inertias and springs of a small model and what they were made of."""

    rows: tuple[Group, ...]
    rigid: tuple[str, ...]

    def __str__(self) -> str:
        cells = [(row.part, row.quantity, f"{row.value:.6g}", row.unit, ", ".join(row.made_of)) for row in self.rows]
        rows = [("part", "quantity", "value", "unit", "made of"), *cells]
        widths = [max(len(row[column]) for row in rows) for column in range(5)]
        lines = ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
        return "\n".join([*lines, f"rigid now: {', '.join(self.rigid) or 'nothing'}"])

    def latex(self) -> str:
        """The table as LaTeX, a `longtable` (packages booktabs, array, longtable); at its end what is rigid now."""
        letters = {"gap": Backlash.declared["gap"].latex}
        rows = [
            (
                breakable(row.part),
                f"${letters.get(row.quantity, row.quantity)}$",
                f"${printed_number(row.value)}$",
                unit(row.unit),
                _listed(row.made_of),
            )
            for row in self.rows
        ]
        if self.rigid:
            rows.append(("rigid now", "", "", "", _listed(self.rigid)))
        gap = r"@{\hspace{3mm}}"
        columns = gap.join((column(30), "l", "r", "l", column(66)))
        return longtable(columns, ("Part", "Quantity", "Value", "Unit", "Made of"), rows)


def _listed(names: tuple[str, ...]) -> str:
    return ", ".join(map(breakable, names))


def add_chain(net: Network, chain: Chain) -> tuple[Group, ...]:
    """Add the parts of a small model, station by station; what each inertia and spring was made of."""
    rows: list[Group] = []
    add_circuits(net, chain)
    for k, station in enumerate(chain.stations):
        add_riders(net, station, station.node)
        if station.inertias:
            name = station.heaviest
            net.add(Inertia(name, J=station.inertia), station.node)
            rows.append(Group(name, "J", station.inertia, "kg*m^2", tuple(own for own, _ in station.inertias)))
        if k < len(chain.links):
            rows += add_link(net, chain.links[k], station, chain.stations[k + 1])
    return tuple(rows)


def add_circuits(net: Network, chain: Chain) -> None:
    """Add the circuits beside a chain."""
    for item in chain.circuits:
        net.add(item.part, *item.nodes)


def add_riders(net: Network, station: Station, node: str) -> None:
    """Add what sits at a station, at a node."""
    for item in station.riders:
        moved = turning_nodes(item)
        net.add(item.part, *(node if each in moved else each for each in item.nodes))


def add_link(net: Network, link: Link, station: Station, other: Station) -> list[Group]:
    """Add what is between two stations: its own parts, or one spring or gap for several in series."""
    if link.placed:
        for item in link.placed:
            forward = item.nodes[0] == station.node
            net.add(item.part, *((station.node, other.node) if forward else (other.node, station.node)))
    elif link.gap:
        net.add(Backlash(link.name, c=link.c, d=link.d, gap=link.gap), station.node, other.node)
    else:
        net.add(Spring(link.name, c=link.c, d=link.d), station.node, other.node)
    stiffness = Group(link.name, "c", link.c, "N*m/rad", link.parts)
    return [stiffness, Group(link.name, "gap", link.gap, "rad", link.parts)] if link.gap else [stiffness]
