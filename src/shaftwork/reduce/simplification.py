"""A train of many inertias as one of few, and what is lost by it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shaftwork.components.rotation import Inertia, Spring
from shaftwork.core.domains import ROTATION
from shaftwork.core.errors import ParameterError
from shaftwork.equations.nomenclature import table as longtable
from shaftwork.equations.printing import printed_number
from shaftwork.equations.spelling import in_text
from shaftwork.network.netlist import REFERENCE
from shaftwork.pipeline.network import Network
from shaftwork.reduce.chain import Chain, Link, Station, read_chain, turning_nodes
from shaftwork.reduce.grouping import Grouping, groupings
from shaftwork.reduce.reference_shaft import Referred, refer
from shaftwork.reduce.truncation import truncated_frequencies

KEPT = 0.05
"""A natural frequency is kept when the small model has it within this fraction."""
AMPLIFIED = 0.1
"""Up to where a lost mode would swing along by no more than this fraction, the small model is valid."""
POINTS = 4001


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
        """The table as LaTeX, a `longtable`."""
        rows = [
            (in_text(row.part), f"${row.quantity}$", f"${printed_number(row.value)}$", in_text(", ".join(row.made_of)))
            for row in self.rows
        ]
        return longtable("llrl", ("Part", "Quantity", "Value in SI", "Made of"), rows)


@dataclass(frozen=True)
class FrequencyLoss:
    """A natural frequency of a train, and of models with as few unknowns; None where they have no such mode.

    Args:
        mode: its number, from 1, without the turning of the whole.
        before: of the train, Hz.
        after: of the small model, Hz.
        error: of it, relative.
        by_modes: of a description by as many ends of the kept shaft and modes of the rest (Craig and Bampton), Hz.
    """

    mode: int
    before: float
    after: float | None
    error: float | None
    by_modes: float | None = None


@dataclass(frozen=True, eq=False)
class Comparison:
    """The torque of the kept shaft in the train and in the small model, on one motion.

    Args:
        t: (k,) times, s.
        before: (k,) torque of the train at the reference shaft, N m.
        after: (k,) torque of the small model, N m.
    """

    t: NDArray[np.float64]
    before: NDArray[np.float64]
    after: NDArray[np.float64]

    @property
    def peaks(self) -> tuple[float, float]:
        """Largest torque in size before and after, N m."""
        return float(np.abs(self.before).max()), float(np.abs(self.after).max())

    @property
    def peak_error(self) -> float:
        """Of the largest torque, relative; negative where the small model says less."""
        before, after = self.peaks
        return after / before - 1

    @property
    def rms_error(self) -> float:
        """Root mean square of the difference over that of the torque of the train."""
        return float(np.sqrt(np.mean((self.after - self.before) ** 2) / np.mean(self.before**2)))


@dataclass(frozen=True, eq=False)
class Simplified:
    """A small model of a train.

    Args:
        network: of the small model; the kept shaft and everything but inertias and other springs has its name.
        table: the groups.
        frequencies: before and after.
        keep: the kept shaft; empty for none.
        groupings: all that were tried, the chosen one first.
        train: the network as it was.
        referred: the same at the reference shaft.
    """

    network: Network
    table: GroupTable
    frequencies: tuple[FrequencyLoss, ...]
    keep: str
    groupings: tuple[Grouping, ...]
    train: Network
    referred: Referred

    def __str__(self) -> str:
        title = f"{self.network.name}, valid up to {self.valid_up_to:.3g} Hz"
        lines = "\n".join(map(_line, self.frequencies))
        return f"{title}\n{self.table}\nmode   before Hz    after Hz     error  by modes Hz\n{lines}"

    @property
    def valid_up_to(self) -> float:
        """Frequency in Hz up to which the small model holds: 0.30 times the lowest natural frequency that it has lost.

        A mode at f_l that is left out would swing along by 1 / (1 - (f / f_l)^2), which is 10 % more than standing
        still at f = sqrt(0.1 / 1.1) f_l. A mode counts as lost when the small model misses it by more than 5 %.
        Infinite where none is lost.
        """
        lost = (row.before for row in self.frequencies if row.error is None or abs(row.error) > KEPT)
        return next(lost, math.inf) * math.sqrt(AMPLIFIED / (1 + AMPLIFIED))

    def compare(self, t_end: float, **options: Any) -> Comparison:
        """Simulate both and compare the torque of the kept shaft.

        Args:
            t_end: end of the motion, s.
            **options: of `Network.simulate`, for both.

        Raises:
            ParameterError: no shaft was kept.
        """
        if not any(part.name == self.keep for part in self.network.parts):
            raise ParameterError("compare: there is no kept shaft. Simplify to two or more masses with keep='...'.")
        options = {"t_eval": np.linspace(0.0, t_end, POINTS), **options}
        name = f"{self.keep}.{'tau' if f'{self.keep}.tau' in _signals(self.train, self.keep) else 'f'}"
        before, after = self.train.simulate(t_end, **options), self.network.simulate(t_end, **options)
        return Comparison(before.t, before[name] * self.referred.torque_ratio(self.keep), after[f"{self.keep}.tau"])


def _signals(net: Network, name: str) -> tuple[str, ...]:
    part = next(part for part in net.parts if part.name == name)
    return tuple(f"{name}.{quantity}" for quantity in part.signals())


def simplify(
    net: Network, masses: int, keep: str = "", *, to: str = "", drives: Mapping[str, str] | None = None
) -> Simplified:
    """Few masses for many: neighbours are grouped, and the springs between the groups are one each.

    Law: after `refer`, a group is the sum of its inertias, at the kept shaft if it is beside it and else at its largest
    inertia; between two groups there are the springs from centre to centre in series, 1/c = sum 1/c_k with
    d = sum d_k (c/c_k)^2. The kept shaft is between two groups and keeps its own stiffness, damping and gap. What is
    beyond the outer centres is rigid. Motors, loads and brakes act on the group of their node.

    Every contiguous grouping is tried, and the one with the smallest error of the lowest natural frequency is taken;
    among equal ones the error of the torque in the kept shaft decides, when a step of torque at the motor swings it in
    that mode. The cut at the kept shaft preserves the inertia on either side of it, and so the mean torque in it,
    whichever grouping is taken: what is left to lose is how it swings, which the lowest frequency tells.

    Args:
        net: the train: inertias and springs in a row, once its gears are referred.
        masses: how many are left, 1 for the rigid train.
        keep: a spring, or a gap with stiffness, that is worth looking at; by default none is kept as it is.
        to: node of the reference shaft; by default an end of the kept shaft.
        drives: as for `refer`.

    Raises:
        ParameterError: there is no such shaft, or not so many masses.
        NetworkError: the train cannot be referred, or is no chain; lists every reason.

    Source: Abdelkader 2016, 2.3, (15)-(17), figures 3 to 7; Marinkovic 2012, 2.1, figure 3.
    """
    referred = refer(net, to or _reference(net, keep), drives=drives)
    chain = read_chain(referred.network.netlist(), keep)
    if keep and not any(link.has(keep) for link in chain.links):
        known = ", ".join(item.part.name for link in chain.links for item in link.placed)
        raise ParameterError(f"keep = {keep!r} is no shaft between two inertias of '{net.name}'. There are: {known}.")
    tried = groupings(chain, masses, keep, _driven(chain))
    made = Network(f"{net.name}, {masses} {'mass' if masses == 1 else 'masses'}")
    rows = tuple(_built(made, tried[0].chain))
    used = {name for row in rows for name in row.made_of}
    rigid = tuple(name for link in chain.links for name in link.parts if name not in used)
    losses = _losses(chain, tried[0].chain, keep)
    return Simplified(made, GroupTable(rows, rigid), losses, keep, tried, net, referred)


def _reference(net: Network, keep: str) -> str:
    """An end of the kept shaft, or the first shaft that turns."""
    placed = net.netlist().placed
    own = next((item for item in placed if item.part.name == keep), None)
    if keep and own is None:
        known = ", ".join(item.part.name for item in placed if len(item.nodes) == 2)
        raise ParameterError(f"keep = {keep!r} is no part of '{net.name}'. Parts between two nodes are: {known}.")
    candidates = placed if own is None else (own, *placed)
    turning = (
        node
        for item in candidates
        for port, node in zip(item.part.ports, item.nodes, strict=False)
        if port.domain is ROTATION and node != REFERENCE
    )
    return next(turning, net.nodes[0])


def _driven(chain: Chain) -> int:
    """The station of the first source, else the first."""
    places = (k for k, station in enumerate(chain.stations) if any(r.part.role == "source" for r in station.riders))
    return next(places, 0)


def _built(net: Network, chain: Chain) -> Iterator[Group]:
    """Add the parts of a small model, station by station; what each inertia and spring was made of."""
    for item in chain.circuits:
        net.add(item.part, *item.nodes)
    for k, station in enumerate(chain.stations):
        for item in station.riders:
            moved = turning_nodes(item)
            net.add(item.part, *(station.node if node in moved else node for node in item.nodes))
        name = max(station.inertias, key=lambda own: own[1])[0]
        net.add(Inertia(name, J=station.inertia), station.node)
        yield Group(name, "J", station.inertia, "kg*m^2", tuple(own for own, _ in station.inertias))
        if k < len(chain.links):
            yield from _linked(net, chain.links[k], station, chain.stations[k + 1])


def _linked(net: Network, link: Link, station: Station, other: Station) -> Iterator[Group]:
    if link.placed:
        for item in link.placed:
            forward = item.nodes[0] == station.node
            net.add(item.part, *((station.node, other.node) if forward else (other.node, station.node)))
    else:
        net.add(Spring(link.name, c=link.c, d=link.d), station.node, other.node)
    yield Group(link.name, "c", link.c, "N*m/rad", link.parts)


def _losses(before: Chain, after: Chain, keep: str) -> tuple[FrequencyLoss, ...]:
    kept = next((k for k, link in enumerate(before.links) if keep and link.has(keep)), None)
    by_modes = (
        () if kept is None or len(after.stations) < 2 else truncated_frequencies(before, len(after.stations), kept)
    )
    was, now, modal = (
        [float(f) for f in found if f > 0] for found in (before.frequencies(), after.frequencies(), by_modes)
    )
    rows = zip_longest(was, now, modal)
    return tuple(
        FrequencyLoss(k, f, found, None if found is None else found / f - 1, other)
        for k, (f, found, other) in enumerate(rows, 1)
    )


def _line(row: FrequencyLoss) -> str:
    after, by_modes = (f"{f:.6g}" if f is not None else "lost" for f in (row.after, row.by_modes))
    error = "" if row.error is None else f"{row.error:+.2%}"
    return f"{row.mode:>4}  {row.before:>10.6g}  {after:>10}  {error:>8}  {by_modes:>11}"
