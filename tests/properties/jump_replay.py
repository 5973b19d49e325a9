"""The jumps of a motion replayed: what speeds gain at an instant are the impulses of parts that may give one.

Rigid contacts at their limit push, freewheels push one way, gears and planetary gears pass impulses on, gears that rub
pass them on by their direction, and prescribed speeds give any. Springs, dampers, frictions, brakes and clutches give
none. So the gains of momentum must be a sum of such impulses with positive sizes; and only where flanks meet or a
prescribed speed jumps is there one at all, as far as parts that pass it on reach.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Iterator

import networkx as nx
import numpy as np
from scipy.optimize import nnls

from shaftwork import Solution
from tests.properties.examples import Array
from tests.properties.law_replay import CLOSE, INSTANT, Motion, limits
from tests.trains import GROUND, Part

# Speeds just before and after an instant are ends of dense output; as part of the largest.
JUMP_CLOSE = 1e-7
TWISTS = {"Spring": "phi_rel", "Backlash": "phi", "HardStop": "phi"}
BOTH_WAYS = ("Gear", "PlanetaryGear", "SpeedSource")
Impulse = dict[str, float]
"""What nodes get, in proportion."""
Pair = tuple[float, float]
"""Before and after."""


class Instant:
    """What is just before and just after some events at one time.

    Args:
        parts: what moves.
        speeds: of nodes, before and after.
        twists: of contacts, before and after.
        met: contacts with an event, or closed before or after it.
        fast: the largest speed of the motion.
    """

    def __init__(
        self, parts: tuple[Part, ...], speeds: dict[str, Pair], twists: dict[str, Pair], met: set[str], fast: float
    ) -> None:
        self.parts, self.nodes, self.twists, self.met, self.fast = parts, speeds, twists, met, fast
        # up to the speed at which flanks rest, what is joined in an impact may stay so
        self.slow = max(JUMP_CLOSE * fast, *(2 * _rest(part) for part in parts if part.name in met), 0.0)
        self.inertias: dict[str, float] = {}
        for part in parts:
            if part.type == "Inertia":
                self.inertias[part.nodes[0]] = self.inertias.get(part.nodes[0], 0.0) + part.values["J"]

    def speeds(self, node: str) -> Pair:
        """The speed of a node, before and after."""
        return (0.0, 0.0) if node == GROUND else self.nodes[node]

    def across(self, part: Part) -> Pair:
        """The speed of its first node against its second, before and after."""
        one, other = (at_a - at_b for at_a, at_b in zip(*map(self.speeds, part.ends), strict=True))
        return one, other

    def gain(self, node: str) -> float:
        """Of the momentum of a node."""
        before, after = self.speeds(node)
        return self.inertias.get(node, 0.0) * (after - before)

    def ways(self, part: Part) -> Iterator[float]:
        """The limits at which the flanks of a rigid contact meet: 1 the upper, -1 the lower one."""
        for way, limit in zip((-1.0, 1.0), limits(part), strict=True):
            if part.name in self.met and min(abs(twist - limit) for twist in self.twists[part.name]) < CLOSE:
                yield way

    def impulses(self, part: Part) -> Iterator[Impulse]:
        """What a part may give to its nodes, of any positive size."""
        a, b = part.ends
        if part.is_rigid:
            yield from ({a: -way, b: way} for way in self.ways(part))
        elif part.type == "Freewheel" and max(self.across(part)) > -self.slow:
            yield {a: -1.0, b: 1.0}
        elif part.type == "Gear":
            yield from _both({a: -1.0, b: part.values["ratio"]})
        elif part.type == "PlanetaryGear":
            ratio = part.values["ratio"]
            yield from _both(dict(zip(part.nodes, (-1.0, 1.0 + ratio, -ratio), strict=True)))
        elif part.type == "SpeedSource":
            yield from _both({a: 1.0})
        elif part.type == "LossyGear":
            yield from self._through_teeth(part)

    def _through_teeth(self, part: Part) -> Iterator[Impulse]:
        """Turning forward, a drives by a positive torque or b by a negative one in the mesh; it may turn round."""
        before, after = self.speeds(part.nodes[0])
        for way in (1.0, -1.0):
            if max(way * before, way * after) > -self.slow:
                yield from _teeth(part, way, way)

    def jams(self, part: Part) -> Iterator[Impulse]:
        """What holds a gear that would brake by more than the inertia before it can answer: b pushes on one flank.

        That impulse is beyond the law of the gear that turns, and within what the gear at rest can hold.
        """
        before, after = self.speeds(part.nodes[0]) if part.type == "LossyGear" else (0.0, 0.0)
        if abs(before) > self.slow and after == 0.0:
            way = math.copysign(1.0, before)
            yield from _teeth(part, -way, way)

    def begins(self, part: Part) -> bool:
        """Whether flanks meet here, or a prescribed speed jumps."""
        before, after = self.across(part)
        if part.type == "SpeedSource":
            return abs(after - before) > self.slow
        return part.is_rigid and any(way * before > 0 for way in self.ways(part))

    def objections(self) -> Iterator[str]:
        """Every jump that nothing explains."""
        made = {part.name: list(self.impulses(part)) for part in self.parts}
        reached = nx.Graph()
        reached.add_nodes_from(self.inertias)
        for part in self.parts:
            nodes = [node for node in part.ends if node != GROUND] if part.type != "PlanetaryGear" else part.nodes
            if made[part.name]:
                nx.add_path(reached, nodes)
        for nodes in nx.connected_components(reached):
            inside = [part for part in self.parts if made[part.name] and {*part.nodes} - {GROUND} <= nodes]
            yield from self._group(nodes, inside, made)

    def _group(self, nodes: set[str], parts: list[Part], made: dict[str, list[Impulse]]) -> Iterator[str]:
        begins = [part.name for part in parts if self.begins(part)]
        if not begins:
            jams = {part.name: jam for part in parts if (jam := list(self.jams(part)))}
            begins, made = list(jams), {**made, **jams}
        if not begins:
            for node in sorted(nodes):
                before, after = self.speeds(node)
                if abs(after - before) > self.slow:
                    yield f"{node} jumps from {before!r} to {after!r} rad/s, though no impulse reaches it"
            return
        impulses, order = [impulse for part in parts for impulse in made[part.name]], sorted(nodes)
        gains = np.array([self.gain(node) for node in order])
        columns = np.array([[impulse.get(node, 0.0) for impulse in impulses] for node in order])
        _, left = nnls(columns, gains)
        size = self.slow * max((self.inertias.get(node, 0.0) for node in order), default=0.0)
        if left > size:
            yield f"{begins}: no impulses of the parts give the gains {gains} of {order}, {left:.3g} is left"
        if not any(part.type == "SpeedSource" for part in parts):
            had, has = (sum(J * self.speeds(node)[k] ** 2 / 2 for node, J in self._of(nodes)) for k in (0, 1))
            if has > had + size * self.fast:
                yield f"{begins}: the energy rises from {had} to {has} J"
        for part in parts:
            if part.is_rigid:
                others = (other.type for other in parts if other is not part)
                yield from self._thrown_back(part, alone=all(other in BOTH_WAYS for other in others))

    def _of(self, nodes: set[str]) -> Iterator[tuple[str, float]]:
        return ((node, J) for node, J in self.inertias.items() if node in nodes)

    def _thrown_back(self, part: Part, *, alone: bool) -> Iterator[str]:
        """Flanks that have met do not go on into each other; beside what passes on both ways by Newton's law."""
        before, after = self.across(part)
        rest = _rest(part)
        for way in self.ways(part):
            if way * after > max(CLOSE * self.fast, rest):
                yield f"{part.name} goes on through its limit at {way * after:.3g} rad/s"
            back = part.values.get("restitution", 0.0) * way * before
            close = JUMP_CLOSE * self.fast
            if alone and way * before > close:
                wanted = (-back,) if back > rest + close else (-back, 0.0)
                # it is found a rounding of the twist beyond its limit, and has gained some energy there
                late = 2 * close * abs(before) + INSTANT * self.fast**2
                if min(abs(after**2 - one**2) for one in wanted) > late:
                    yield f"{part.name} comes with {before!r} rad/s and goes with {after!r}"


def _rest(part: Part) -> float:
    """The speed below which flanks stay together."""
    return float(part.values.get("omega_rest", 0.0)) if part.is_rigid else 0.0


def _teeth(part: Part, driving: float, driven: float) -> Iterator[Impulse]:
    """What a gear that rubs gives to its nodes where a drives and where b does, by the ways in which it turns then."""
    a, b = part.nodes
    ratio, share = part.values["ratio"], part.values["efficiency"]
    yield {a: -driving, b: driving * ratio * share}
    yield {a: driven * part.values.get("efficiency_back", share), b: -driven * ratio}


def _both(impulse: Impulse) -> tuple[Impulse, Impulse]:
    return impulse, {node: -size for node, size in impulse.items()}


def jump_objections(parts: tuple[Part, ...], motion: Motion) -> list[str]:
    """Every jump of a speed or a twist in a motion that the parts do not explain."""
    firsts, lasts, *sides = motion.instants
    speeds = {
        node: np.array([side[f"{node}.omega"] for side in sides])
        for part in parts
        for node in part.nodes
        if node != GROUND
    }
    twists = {
        part.name: np.array([side[f"{part.name}.{TWISTS[part.type]}"] for side in sides])
        for part in parts
        if part.type in TWISTS
    }
    found = list(_torn(lasts, twists))
    jumps = np.any([np.abs(pair[1] - pair[0]) > JUMP_CLOSE * motion.fast for pair in speeds.values()], axis=0)
    for k in np.flatnonzero(jumps).tolist():
        met = _met(motion.sol, firsts[k], lasts[k])
        here = Instant(parts, _pairs(speeds, k), _pairs(twists, k), met, motion.fast)
        found += [f"at {lasts[k]!r} s {said}" for said in here.objections()]
    return found


def _torn(times: Array, twists: dict[str, Array]) -> Iterator[str]:
    """No twist jumps."""
    for name, pair in twists.items():
        torn = np.abs(pair[1] - pair[0])
        if torn.max() > CLOSE * max(1.0, np.abs(pair).max()):
            yield f"at {times[torn.argmax()]!r} s the twist of {name} jumps by {torn.max():.3g} rad"


def _met(sol: Solution, first: float, last: float) -> set[str]:
    """What has an event from one time to another, or is in contact just before or after."""
    starts = [phase.start for phase in sol.phases]
    around = {bisect.bisect_left(starts, first) - 1, bisect.bisect_right(starts, last) - 1}
    closed = {name for k in around for name, mode in sol.phases[k].modes.items() if mode.startswith("in contact")}
    return closed | {event[1] for event in sol.events if first <= event[0] <= last}


def _pairs(values: dict[str, Array], k: int) -> dict[str, Pair]:
    return {name: (float(pair[0, k]), float(pair[1, k])) for name, pair in values.items()}
