"""How fast every node turns for each turn of a reference shaft, by the rigid parts and the shafts between them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from sympy import Expr, S

AGREE = 1e-12
"""Two ways round a train have one ratio when they differ by less than this fraction: only rounding."""


@dataclass(frozen=True)
class Scale:
    """What a speed and a power at a node are for those at another one.

    Law: omega = ratio omega', P = P' / power; hence tau' = ratio power tau, and J' = J ratio^2 power for any store.

    Args:
        ratio: speed of the node over speed of the other.
        power: share of the node's power that arrives at the other; 1 without lossy gears.
        ratio_law: the ratio in the symbols of the network.
        power_law: the share in the symbols of the network.
    """

    ratio: float = 1.0
    power: float = 1.0
    ratio_law: Expr = S.One
    power_law: Expr = S.One

    @property
    def through(self) -> float:
        """A torque at the other shaft over the torque here: ratio * power."""
        return self.ratio * self.power

    def __mul__(self, other: Scale) -> Scale:
        return Scale(
            self.ratio * other.ratio,
            self.power * other.power,
            self.ratio_law * other.ratio_law,
            self.power_law * other.power_law,
        )

    def __truediv__(self, other: Scale) -> Scale:
        return Scale(
            self.ratio / other.ratio,
            self.power / other.power,
            self.ratio_law / other.ratio_law,
            self.power_law / other.power_law,
        )

    def agrees(self, other: Scale) -> bool:
        """Whether both are the same but for rounding."""
        return math.isclose(self.ratio, other.ratio, rel_tol=AGREE) and math.isclose(
            self.power, other.power, rel_tol=AGREE
        )


class Clusters:
    """Nodes that turn at fixed ratios, in groups that grow together; a scale is to the first node of its group."""

    def __init__(self, nodes: Iterable[int]) -> None:
        self._of = {node: (node, Scale()) for node in nodes}
        self._members = {node: [node] for node in self._of}

    def __contains__(self, node: int) -> bool:
        return node in self._of

    def __getitem__(self, node: int) -> tuple[int, Scale]:
        """First node of the group, and the scale of the node to it."""
        return self._of[node]

    def members(self, node: int) -> tuple[int, ...]:
        """The group of a node, in the order of the nodes."""
        return tuple(sorted(self._members[self._of[node][0]]))

    def join(self, node: int, other: int, scale: Scale) -> None:
        """Make one group of two apart, where `scale` is that of `node` to `other`."""
        (first, own), (second, target) = self._of[node], self._of[other]
        moved = scale * target / own
        if len(self._members[first]) > len(self._members[second]):
            first, second, moved = second, first, Scale() / moved
        for member in self._members.pop(first):
            self._of[member] = (second, self._of[member][1] * moved)
            self._members[second].append(member)

    def lock(self, node: int) -> None:
        """Take out a group whose speed is zero, which has no ratio to anything."""
        for member in self._members.pop(self._of[node][0]):
            del self._of[member]
