"""Neighbouring inertias as one: every grouping of a chain, what each does to it, and the table of one of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain as joined
from itertools import combinations, pairwise, zip_longest
from math import comb

import numpy as np

from shaftwork.components.contacts import Backlash
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import whole
from shaftwork.core.screen import in_columns
from shaftwork.reduce.chain import Chain, Station, series


@dataclass(frozen=True, eq=False)
class Grouping:
    """A chain of groups.

    Args:
        groups: the nodes of each.
        chain: of a station for each group, with springs in series between their centres.
        frequency_error: of the lowest natural frequency, relative.
        torque_error: of the torque that a step at the driving end swings the kept shaft by in that mode, relative.
    """

    groups: tuple[tuple[str, ...], ...]
    chain: Chain
    frequency_error: float
    torque_error: float


def groupings(chain: Chain, masses: int, keep: str, driven: int) -> tuple[Grouping, ...]:
    """Every grouping of neighbours into so many groups in which the kept shaft is between two of them, best first.

    The best one has the smallest error of the lowest natural frequency, and among equal ones that of the torque: a
    group boundary at the kept shaft keeps the inertia on either side of it, and with it the torque that accelerates
    what is beyond, whatever the other boundaries are. What they change is how it swings. A station whose speed is
    prescribed is a group of its own, for its group moves as prescribed; one mass for all moves so as a whole.

    Args:
        chain: stations with inertia, or with a prescribed speed.
        masses: the number of groups.
        keep: a part of one link; empty for none.
        driven: place of the station at which a step of torque acts, or of the prescribed acceleration.

    Raises:
        ParameterError: there are fewer stations than groups, too few groups for a speed that is prescribed, or too many
            groupings.
    """
    count = len(chain.stations)
    if whole(masses, 1, count) is None:
        besides = "" if all(station.inertia for station in chain.stations) else " and prescribed speeds"
        raise ParameterError(
            f"masses = {masses!r} must be a whole number from 1 to the {count} inertias{besides} of the chain."
        )
    shaft = next((k for k, link in enumerate(chain.links) if keep and link.has(keep)), None) if masses > 1 else None
    fixed = _fixed(chain, masses, shaft)
    free = [k for k in range(count - 1) if k not in fixed]
    chosen = masses - 1 - len(fixed)
    most = 20_000  # they are tried one by one
    if comb(len(free), chosen) > most:
        raise ParameterError(
            f"masses = {masses} of {count} inertias: {comb(len(free), chosen)} groupings are more than the {most} that "
            "are tried. Take fewer masses, or simplify in two steps."
        )
    true = _swing(chain, driven, shaft)
    cuts = (tuple(sorted((*some, *fixed))) for some in combinations(free, chosen))
    measured = (_measured(chain, each, shaft, driven, true) for each in cuts)
    return tuple(
        # Errors that agree in 13 decimals are equal: the rest is the rounding of two frequencies.
        sorted(measured, key=lambda grouping: (round(grouping.frequency_error, 13), grouping.torque_error))
    )


def _fixed(chain: Chain, masses: int, shaft: int | None) -> tuple[int, ...]:
    """Links at which groups end in every grouping: the kept one, and those beside a speed that is prescribed."""
    places = [k for k, prescribed in enumerate(chain.prescribed) if prescribed]
    beside = [k for place in places for k in (place - 1, place)] if masses > 1 or len(places) > 1 else []
    ends = (*beside, *(() if shaft is None else (shaft,)))
    fixed = tuple(k for k in range(len(chain.links)) if k in ends)
    if len(fixed) < masses:
        return fixed
    sources = ", ".join(f"'{name}'" for k in places for name in chain.stations[k].prescribed_by)
    nodes = ", ".join(f"'{chain.stations[k].node}'" for k in places)
    rigid = ", or 1 for the rigid train" if len(places) == 1 else ""
    raise ParameterError(
        f"masses = {masses}: a speed is prescribed at {nodes} ({sources}), and what is grouped with it moves as "
        f"prescribed and swings no more. Take masses = {len(fixed) + 1} or more{rigid}."
    )


def _measured(
    chain: Chain, cuts: tuple[int, ...], shaft: int | None, driven: int, true: tuple[float, float]
) -> Grouping:
    groups_chain, groups = grouped(chain, cuts, shaft)
    place = sum(end < driven for end in cuts)
    swing = _swing(groups_chain, place, None if shaft is None else cuts.index(shaft))
    errors = [abs(now - was) / was if was else 0.0 for was, now in zip(true, swing, strict=True)]
    return Grouping(groups, groups_chain, *errors)


def _swing(chain: Chain, driven: int, shaft: int | None) -> tuple[float, float]:
    """The lowest natural frequency, and the torque amplitude of a link in that mode after a unit step at a station.

    Law: |torque shape| / omega^2 for a step of torque; where the speed is prescribed the step is one of acceleration,
    and the stiffness there gives what the shape does not, |torque (K shape)| / omega^4.
    """
    rates = chain.row[1].rates(1)
    if not rates.size:
        return 0.0, 0.0
    rate = float(rates[0])
    if shaft is None:
        return rate / (2 * np.pi), 0.0
    shape, torques = chain.swing(rate)
    answered = np.diff(torques, prepend=0.0, append=0.0)[driven] / rate**2
    pushed = answered if chain.prescribed[driven] else shape[driven]
    return rate / (2 * np.pi), float(abs(torques[shaft] * pushed)) / rate**2


def grouped(chain: Chain, cuts: tuple[int, ...], shaft: int | None) -> tuple[Chain, tuple[tuple[str, ...], ...]]:
    """The chain of the groups between cuts, and their nodes.

    Args:
        chain: stations with inertia.
        cuts: places of the links at which groups end, ascending.
        shaft: that of the link that keeps its own stiffness; the groups beside it have their centres at its ends.
    """
    bounds = tuple(pairwise((-1, *cuts, len(chain.stations) - 1)))
    centres = [_centre(chain, last + 1, end, shaft) for last, end in bounds]
    stations = tuple(
        _one(chain.stations[last + 1 : end + 1], chain.stations[centre])
        for (last, end), centre in zip(bounds, centres, strict=True)
    )
    links = tuple(series(chain.links[a:b]) for a, b in pairwise(centres))
    groups = tuple(tuple(station.node for station in chain.stations[last + 1 : end + 1]) for last, end in bounds)
    return Chain(stations, links, chain.circuits), groups


def _centre(chain: Chain, first: int, last: int, shaft: int | None) -> int:
    """Where a group stands: at the kept shaft, else at its largest inertia."""
    if shaft is not None and last == shaft:
        return last
    if shaft is not None and first == shaft + 1:
        return first
    return max(range(first, last + 1), key=lambda k: chain.stations[k].inertia)


def _one(stations: tuple[Station, ...], centre: Station) -> Station:
    def all_of(name: str) -> Iterator[object]:
        return joined.from_iterable(getattr(station, name) for station in stations)

    return Station(
        centre.node,
        sum(station.inertia for station in stations),
        tuple(all_of("inertias")),  # type: ignore[arg-type]
        tuple(all_of("riders")),  # type: ignore[arg-type]
        sum(station.support for station in stations),
    )


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

    @classmethod
    def of(cls, groups: Chain, train: Chain) -> GroupTable:
        """What the stations and links of a chain of groups were made of, those of a train."""
        rows: list[Group] = []
        for station, link in zip_longest(groups.stations, groups.links):
            if station.inertias:
                names = tuple(name for name, _ in station.inertias)
                rows.append(Group(station.heaviest, "J", station.inertia, "kg*m^2", names))
            if link:
                rows.append(Group(link.name, "c", link.c, "N*m/rad", link.parts))
            if link and link.gap:
                rows.append(Group(link.name, "gap", link.gap, "rad", link.parts))
        used = {name for row in rows for name in row.made_of}
        return cls(tuple(rows), tuple(name for link in train.links for name in link.parts if name not in used))

    def __str__(self) -> str:
        cells = [(row.part, row.quantity, f"{row.value:.6g}", row.unit, ", ".join(row.made_of)) for row in self.rows]
        lines = in_columns([("part", "quantity", "value", "unit", "made of"), *cells])
        return "\n".join([*lines, f"rigid now: {', '.join(self.rigid) or 'nothing'}"])

    def latex(self) -> str:
        """The table as LaTeX, a `longtable` (packages booktabs, array, longtable); at its end what is rigid now."""
        from shaftwork.latex.nomenclature import breakable, column, table, unit
        from shaftwork.latex.printing import printed_number

        def listed(names: tuple[str, ...]) -> str:
            return ", ".join(map(breakable, names))

        letters = {"gap": Backlash.declared["gap"].latex}
        rows = [
            (
                breakable(row.part),
                f"${letters.get(row.quantity, row.quantity)}$",
                f"${printed_number(row.value)}$",
                unit(row.unit),
                listed(row.made_of),
            )
            for row in self.rows
        ]
        if self.rigid:
            rows.append(("rigid now", "", "", "", listed(self.rigid)))
        gap = r"@{\hspace{3mm}}"
        columns = gap.join((column(30), "l", "r", "l", column(66)))
        return table(columns, ("Part", "Quantity", "Value", "Unit", "Made of"), rows)
