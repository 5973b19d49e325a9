"""A train of many inertias as one of few, and what is lost by it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import Any

import numpy as np

from shaftwork.components.rotation import Gear
from shaftwork.core.domains import ROTATION
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import in_si
from shaftwork.network.netlist import REFERENCE, Placed
from shaftwork.pipeline.network import Network, network_of
from shaftwork.reduce.chain import Chain, read_chain
from shaftwork.reduce.comparison import Comparison
from shaftwork.reduce.grouping import Grouping, grouped, groupings
from shaftwork.reduce.groups import GroupTable, add_chain
from shaftwork.reduce.reference_shaft import Referred, refer
from shaftwork.reduce.truncation import ModalChain, truncated
from shaftwork.results.measures import Measure
from shaftwork.results.solution import Solution

KEPT = 0.05
"""A natural frequency is kept when the small model has it within this fraction."""
AMPLIFIED = 0.1
"""Up to where a lost mode would swing along by no more than this fraction, the small model is valid."""
POINTS = 4001


@dataclass(frozen=True)
class FrequencyLoss:
    """A natural frequency of a train, and of models with as few unknowns; None where they have no such mode.

    Args:
        mode: its number, from 1, without the turning of the whole.
        before: of the train, Hz.
        after: of the small model, Hz.
        error: of it, relative.
        by_modes: of a description by as many ends of the kept shaft, prescribed speeds, and modes of the rest (Craig
            and Bampton), Hz.
    """

    mode: int
    before: float
    after: float | None
    error: float | None
    by_modes: float | None = None


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
    """

    network: Network
    by_modes: Network | None
    table: GroupTable
    frequencies: tuple[FrequencyLoss, ...]
    keep: str
    groupings: tuple[Grouping, ...]
    train: Network
    referred: Referred
    chain: Chain

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

    def compare(
        self, t_end: float, *, before: Solution | None = None, modes: bool = True, **options: Any
    ) -> Comparison:
        """Simulate the train and its small models and compare the torque of the kept shaft.

        Of a single mass it is the torque that would be in the kept shaft if it were rigid as well.

        Args:
            t_end: end of the motion, s.
            before: the train's motion, where it is known already; its times are taken.
            modes: whether the model by modes is simulated as well, where there is one.
            **options: of `Network.simulate`, for all.

        Raises:
            ParameterError: no shaft was kept, `t_end` is no time, or the motion that is known has another end.
        """
        if not self.keep:
            raise ParameterError("compare: there is no kept shaft. Simplify with keep='...', the name of one.")
        end = in_si("t_end", t_end, "s", above=0)
        if before is None:
            before = self.train.simulate(end, **{"t_eval": np.linspace(0.0, end, POINTS), **options})
        elif not math.isclose(float(before.t[-1]), end):
            raise ParameterError(f"compare: the motion `before` ends at {before.t[-1]:g} s, and t_end is {end:g} s.")
        options |= {"t_eval": before.t}
        own = f"{self.keep}.tau" if f"{self.keep}.tau" in before.names else f"{self.keep}.f"
        small = self.network if len(self.groupings[0].groups) > 1 else _split(self.chain, self.keep)
        torque = f"{self.keep}.{'tau' if small is self.network else 'tau_a'}"
        after = small.simulate(end, **options)
        modal = self.by_modes.simulate(end, **options) if modes and self.by_modes else None
        ratio = self.referred.torque_ratio(self.keep)
        largest = [Measure("peak", own).of(before) * abs(ratio), Measure("peak", torque).of(after)]
        largest += [Measure("peak", torque).of(modal)] if modal else []
        by_modes = modal[torque] if modal else None
        return Comparison(before.t, before[own] * ratio, after[torque], tuple(largest), by_modes)


def _split(chain: Chain, keep: str) -> Network:
    """The rigid train as two halves of which one carries the other, so that the torque between them can be read."""
    kept = _place(chain, keep)
    halves = grouped(chain, (kept,), kept)[0]
    own = next(item for item in chain.links[kept].placed if item.part.name == keep)
    link = replace(halves.links[0], placed=(Placed(Gear(keep, ratio=1.0), own.nodes),))
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
        known = ", ".join(item.part.name for link in chain.links for item in link.placed)
        raise ParameterError(f"keep = {keep!r} is no shaft between two inertias of '{net.name}'. There are: {known}.")
    tried = groupings(chain, masses, keep, _driven(chain))
    title = f"{net.name}, {masses} {'mass' if masses == 1 else 'masses'}"
    made = Network(title)
    rows = add_chain(made, tried[0].chain)
    used = {name for row in rows for name in row.made_of}
    rigid = tuple(name for link in chain.links for name in link.parts if name not in used)
    modal = truncated(chain, masses, _place(chain, keep)) if keep and masses > 1 else None
    by_modes = modal.network(f"{title}, by modes") if modal else None
    losses = _losses(chain, tried[0].chain, modal)
    return Simplified(made, by_modes, GroupTable(rows, rigid), losses, keep, tried, net, referred, chain)


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


def _losses(before: Chain, after: Chain, modal: ModalChain | None) -> tuple[FrequencyLoss, ...]:
    by_modes = () if modal is None else modal.frequencies()
    was, now, other = (
        [float(f) for f in found if f > 0] for found in (before.frequencies(), after.frequencies(), by_modes)
    )
    rows = zip_longest(was, now, other)
    return tuple(
        FrequencyLoss(k, f, found, None if found is None else found / f - 1, bound)
        for k, (f, found, bound) in enumerate(rows, 1)
    )


def _line(row: FrequencyLoss) -> str:
    after, by_modes = (f"{f:.6g}" if f is not None else "lost" for f in (row.after, row.by_modes))
    error = "" if row.error is None else f"{row.error:+.2%}"
    return f"{row.mode:>4}  {row.before:>10.6g}  {after:>10}  {error:>8}  {by_modes:>11}"
