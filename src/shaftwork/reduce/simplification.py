"""A train of many inertias as one of few, and what is lost by it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shaftwork.components.branches import INTEGRAL
from shaftwork.components.mechanics import Gear
from shaftwork.core.domains import ROTATION
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import in_si
from shaftwork.network.netlist import REFERENCE, Placed
from shaftwork.pipeline.network import Network, network_of
from shaftwork.reduce.chain import Chain, add_chain, read_chain
from shaftwork.reduce.craig_bampton import truncated
from shaftwork.reduce.grouping import Grouping, GroupTable, grouped, groupings
from shaftwork.reduce.losses import Comparison, FrequencyTable, check_motion, refuse_changes
from shaftwork.reduce.reference_shaft import Referred, refer
from shaftwork.results.measures import Measure
from shaftwork.results.solution import Solution

LARGEST_DEVIATION = 0.05
"""A natural frequency is kept when the small model has it within this fraction."""


@dataclass(frozen=True, eq=False)
class Simplified:
    """A small model of a train.

    Args:
        network: of the small model; the kept shaft and everything but inertias and other springs has its name.
        by_modes: as many inertias by modes (Craig and Bampton), a network; None of one mass, or with no shaft kept.
        table: the groups.
        frequencies: before and after.
        keep: the kept shaft; empty for none.
        groupings: all that were tried, the chosen one first.
        train: the network as it was.
        referred: the same at the reference shaft.
        chain: what that is as inertias and springs in a row.
        by_angle: parts that pull by the angle at their node, as a contact to the frame does or a law that reads it.
            They act in the small models as in the train; in no frequency here is what stiffness they have.
    """

    network: Network
    by_modes: Network | None
    table: GroupTable
    frequencies: FrequencyTable
    keep: str
    groupings: tuple[Grouping, ...]
    train: Network
    referred: Referred
    chain: Chain
    by_angle: tuple[str, ...]

    def __str__(self) -> str:
        limit = "" if self.by_angle and math.isinf(self.valid_up_to) else f", valid up to {self.valid_up_to:.3g} Hz"
        lines = [f"{self.network.name}{limit}", str(self.table), str(self.frequencies)]
        if self.by_angle:
            lines.append(f"frequencies without the stiffness that {', '.join(self.by_angle)} may have to the frame")
        return "\n".join(lines)

    @property
    def valid_up_to(self) -> float:
        """Frequency in Hz up to which the small model holds: 0.30 times the lowest natural frequency that it has lost.

        A mode at f_l that is left out would swing along by 1 / (1 - (f / f_l)^2), which is 10 % more than standing
        still at f = sqrt(0.1 / 1.1) f_l. A mode counts as lost when the small model misses it by more than 5 %.
        Infinite where none is lost.

        The 10 % are of what this mode contributes by itself. Several lost modes add up, and those that are kept take
        other shares of the torque: of random chains with a harmonic torque at one end, below their first resonance, one
        in twelve misses the torque of the kept shaft at this limit by more than 11 %, one in a hundred by more than
        17 %. What parts `by_angle` hold is not in it.
        """
        lost = (row.before for row in self.frequencies if row.error is None or abs(row.error) > LARGEST_DEVIATION)
        amplified = 0.1  # a lost mode swings along by this part at most
        return next(lost, math.inf) * math.sqrt(amplified / (1 + amplified))

    def compare(
        self, t_end: float, *, before: Solution | None = None, modes: bool = True, **options: Any
    ) -> Comparison:
        """Simulate the train and its small models and compare the torque of the kept shaft.

        Where something lies beside the kept shaft, it is the torque of the kept part alone. Of a single mass it is the
        torque that would be in it if all were rigid: that between both sides, and of this the part's share of the
        stiffness there, with gaps closed.

        Args:
            t_end: end of the motion, s.
            before: the train's motion from rest, where it is known already; its times are taken.
            modes: whether the model by modes is simulated as well, where there is one.
            **options: of `Network.simulate`, for all; none that changes the train, as parameters or start values.

        Raises:
            ParameterError: no shaft was kept, `t_end` is no time, or what is known is no motion of the train, has
                another start, end or other parameters.
        """
        if not self.keep:
            raise ParameterError("compare: there is no kept shaft. Simplify with keep='...', the name of one.")
        end = in_si("t_end", t_end, "s", above=0)
        refuse_changes(options)
        start = options.get("t_start", 0.0)
        if before is None:
            before = self.train.simulate(end, **{"t_eval": np.linspace(start, end, 4001), **options})
        else:
            check_motion(before, self.train, start, end)
        options |= {"t_eval": before.t}
        name = f"{self.keep}.tau" if f"{self.keep}.tau" in before.names else f"{self.keep}.f"
        single = len(self.groupings[0].groups) == 1
        small = _split(self.chain, self.keep) if single else self.network
        torque, share = (f"{self.keep}.tau_a", _share(self.chain, self.keep)) if single else (f"{self.keep}.tau", 1.0)
        after = small.simulate(end, **options)
        modal = self.by_modes.simulate(end, **options) if modes and self.by_modes else None
        ratio = self.referred.torque_ratio(self.keep)
        largest = [Measure("peak", name).of(before) * abs(ratio), Measure("peak", torque).of(after) * share]
        largest += [Measure("peak", torque).of(modal)] if modal else []
        by_modes = modal[torque] if modal else None
        return Comparison(before.t, before[name] * ratio, after[torque] * share, tuple(largest), by_modes)


def _share(chain: Chain, keep: str) -> float:
    """Of the stiffness of a link, what a part of it has."""
    link = chain.links[_place(chain, keep)]
    return next(float(getattr(item.part, "c", 0.0)) for item in link.placed if item.part.name == keep) / link.c


def _split(chain: Chain, keep: str) -> Network:
    """The rigid train as two halves of which one carries the other, so that the torque between them can be read."""
    cut = _place(chain, keep)
    halves = grouped(chain, (cut,), cut)[0]
    shaft = next(item for item in chain.links[cut].placed if item.part.name == keep)
    link = replace(halves.links[0], placed=(Placed(Gear(keep, ratio=1.0), shaft.nodes),))
    net = Network("rigid")
    add_chain(net, replace(halves, links=(link,)))
    return net


def _place(chain: Chain, keep: str) -> int:
    """The link of a kept shaft."""
    return next(k for k, link in enumerate(chain.links) if link.has(keep))


def simplify(
    net: Network, masses: int, keep: str = "", *, to: str = "", drives: Mapping[str, str] | None = None
) -> Simplified:
    """Few masses for many: neighbours are grouped, and the springs between the groups are one each.

    Law: after `refer`, a group is the sum of its inertias, at the kept shaft if it is beside it and else at its largest
    inertia; between two groups there are the springs from centre to centre in series, 1/c = sum 1/c_k with
    d = sum d_k (c/c_k)^2. The kept shaft is between two groups and keeps its own stiffness, damping and gap. What is
    beyond the outer centres is rigid. Motors, loads and brakes act on the group of their node. A node whose speed a
    `SpeedSource` prescribes is a group of its own, with inertia or without, and frequencies are those with this speed
    prescribed.

    Every contiguous grouping is tried, and the one with the smallest error of the lowest natural frequency is taken;
    among equal ones the error of the torque in the kept shaft decides, when a step of torque at the motor swings it in
    that mode. The cut at the kept shaft preserves the inertia on either side of it, and so the mean torque in it,
    whichever grouping is taken: what is left to lose is how it swings, which the lowest frequency tells.

    Args:
        net: the train: inertias and springs in a row, once its gears are referred.
        masses: how many groups are left, 1 for the rigid train.
        keep: a spring, or a gap with stiffness, that is worth looking at; by default none is kept as it is.
        to: node of the reference shaft; by default an end of the kept shaft.
        drives: as for `refer`.

    Raises:
        ParameterError: `net` is no network, there is no such shaft, not so many masses, or too few for a speed that is
            prescribed.
        NetworkError: the train cannot be referred, or is no chain; lists every reason.

    Source: Abdelkader 2016, 2.3, (15)-(17), figures 3 to 7; Marinkovic 2012, 2.1, figure 3.
    """
    referred = refer(net, to or _reference(network_of(net), keep), drives=drives)
    chain = read_chain(referred.network.netlist(), keep)
    if keep and not any(link.has(keep) for link in chain.links):
        shafts = ", ".join(item.part.name for link in chain.links for item in link.placed)
        raise ParameterError(f"keep = {keep!r} is no shaft between two inertias of '{net.name}'. There are: {shafts}.")
    tried = groupings(chain, masses, keep, _driven(chain))
    best = tried[0].chain
    title = f"{net.name}, {masses} {'mass' if masses == 1 else 'masses'}"
    small = Network(title)
    add_chain(small, best)
    modal = truncated(chain, masses, _place(chain, keep)) if keep and masses > 1 else None
    by_modes = modal.network(f"{title}, by modes") if modal else None
    table = GroupTable.of(best, chain)
    losses = FrequencyTable.of(chain.frequencies(), best.frequencies(), modal.frequencies() if modal else None)
    angles = _by_angle(net, chain)
    return Simplified(small, by_modes, table, losses, keep, tried, net, referred, chain, angles)


def _by_angle(net: Network, chain: Chain) -> tuple[str, ...]:
    """Parts at single places of a chain whose laws or modes read the angle there."""
    graph, riders = net.graph(), {item.part.name for station in chain.stations for item in station.riders}
    guards = (
        [leave.when for each in part.modes for mode in each.options for leave in mode.leaves] for part in graph.parts
    )
    reading = (
        part.name
        for part, angles, ends in zip(graph.parts, graph.integrated, guards, strict=True)
        if angles or any(INTEGRAL in when.free_symbols for when in ends)
    )
    return tuple(name for name in reading if name in riders)


def _reference(net: Network, keep: str) -> str:
    """An end of the kept shaft, or the first shaft that turns."""
    placed = net.netlist().placed
    shaft = next((item for item in placed if item.part.name == keep), None)
    if keep and shaft is None:
        names = ", ".join(item.part.name for item in placed if len(item.nodes) == 2)
        raise ParameterError(f"keep = {keep!r} is no part of '{net.name}'. Parts between two nodes are: {names}.")
    candidates = placed if shaft is None else (shaft, *placed)
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
