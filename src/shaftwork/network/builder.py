"""The builder of networks: the only mutable object of the library."""

from __future__ import annotations

from typing import TypeVar

from shaftwork.components.base import Component
from shaftwork.core.errors import ShaftworkError
from shaftwork.network.netlist import Netlist, Placed

C = TypeVar("C", bound=Component)


class NetworkBuilder:
    """Parts and the nodes that they join.

    Args:
        name: title of the network, used in reports.
    """

    def __init__(self, name: str = "network") -> None:
        self.name = name
        self._placed: list[Placed] = []

    def add(self, part: C, *nodes: str) -> C:
        """Add a part with its ports at the given nodes, which come to be when first named.

        Args:
            part: a component.
            *nodes: one node name for each port, in the order of the ports; "ground" is the frame (speed zero).

        Returns:
            The part.

        Raises:
            ShaftworkError: `part` is no component or a node is no text. Everything else that may be wrong with a
                network is reported together by `check`.
        """
        if not isinstance(part, Component):
            raise ShaftworkError(
                f"add() takes a component such as Inertia('J1', J=1.0), not {type(part).__name__} {part!r}."
            )
        if strange := [node for node in nodes if not isinstance(node, str) or not node]:
            raise ShaftworkError(
                f"{type(part).__name__} '{part.name}': a node is named by a text, not by {strange[0]!r}. "
                f"Write net.add(part, 'rotor', 'wheel')."
            )
        self._placed.append(Placed(part, nodes))
        return part

    @property
    def parts(self) -> tuple[Component, ...]:
        """The parts in the order in which they were added."""
        return tuple(placed.part for placed in self._placed)

    @property
    def nodes(self) -> tuple[str, ...]:
        """The nodes in the order in which they were first named."""
        return tuple(dict.fromkeys(node for placed in self._placed for node in placed.nodes))

    def netlist(self) -> Netlist:
        """The network as it stands, frozen."""
        return Netlist(self.name, tuple(self._placed))
