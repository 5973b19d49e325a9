"""The builder of networks: the only mutable object of the library."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from difflib import get_close_matches
from typing import Self, TypeVar, overload

from shaftwork.components.base import Component
from shaftwork.core.errors import ParameterError, ShaftworkError
from shaftwork.network.netlist import IMPACTS, Impacts, Netlist, Placed, overview

C = TypeVar("C", bound=Component)
N = TypeVar("N", bound="NetworkBuilder")


class NetworkBuilder:
    """Parts and the nodes that they join.

    Args:
        name: title of the network, used in reports.
        ports: of a network that is a part of others, the nodes at which it is joined to them.
        impacts: rigid contacts that touch are hit "in turn", as a row of balls, or "together", in one instant.

    Raises:
        ParameterError: the ports are no texts, or two are the same; impacts are neither.
    """

    def __init__(self, name: str = "network", ports: Sequence[str] = (), *, impacts: Impacts = IMPACTS[0]) -> None:
        self.name, self.impacts = name, impacts
        if impacts not in IMPACTS:
            raise ParameterError(f"impacts = {impacts!r} must be one of: {', '.join(map(repr, IMPACTS))}.")
        self.ports = (ports,) if isinstance(ports, str) else tuple(ports)
        if not all(isinstance(port, str) and port for port in self.ports) or len({*self.ports}) < len(self.ports):
            raise ParameterError(f"ports = {ports!r} must be names of nodes, each once: ports=('in_', 'out').")
        self._placed: list[Placed] = []

    def __copy__(self) -> Self:
        """A network of the same parts, which are immutable; what is added, replaced or removed in one is so there."""
        copy = object.__new__(type(self))
        vars(copy).update(vars(self), _placed=[*self._placed])
        return copy

    def __eq__(self, other: object) -> bool:
        """Whether name, ports, parts and nodes are equal, in their order; not from which file they come."""
        return self.netlist() == other.netlist() if isinstance(other, NetworkBuilder) else NotImplemented

    __hash__ = None  # type: ignore[assignment]  # what can be changed must not be found by what it was

    @overload
    def add(self, part: C, *nodes: str) -> C: ...

    @overload
    def add(self, part: N, *nodes: str, name: str = "") -> N: ...

    def add(self, part: C | N, *nodes: str, name: str = "") -> C | N:
        """Add a part with its ports at the given nodes, which come to be when first named.

        A network with ports is added part by part, as it stands: what was named "shaft" in it is "first.shaft" then,
        and so are its nodes but for the ports, which become the given nodes.

        Args:
            part: a component, or a network with ports.
            *nodes: one node name for each port, in the order of the ports; "ground" is the frame (speed zero).
            name: of a network within this one, "first"; by default its own.

        Returns:
            The part.

        Raises:
            ShaftworkError: `part` is neither, a node is no text, or a network is not joined at each of its ports.
                Everything else that may be wrong with a network is reported together by `check`.
        """
        if not isinstance(part, Component | NetworkBuilder):
            raise ShaftworkError(
                f"add() takes a component such as Inertia('J1', J=1.0), not {type(part).__name__} {part!r}."
            )
        if strange := [node for node in nodes if not isinstance(node, str) or not node]:
            raise ShaftworkError(
                f"{type(part).__name__} '{part.name}': a node is named by a text, not by {strange[0]!r}. "
                f"Write net.add(part, 'rotor', 'wheel')."
            )
        if isinstance(part, NetworkBuilder):
            self._placed += part.netlist().within(name or part.name, nodes)
        elif name:
            raise ShaftworkError(
                f"name = {name!r} is for networks within networks: a part has its name, '{part.name}'."
            )
        else:
            self._placed.append(Placed(part, nodes))
        return part

    def remove(self, name: str) -> None:
        """Remove a part, or a network within this one with all its parts. Nodes where nothing is left are no more.

        Raises:
            ParameterError: there is none of this name; the message says what there is.
        """
        numbers = self._numbers(name) or [
            number for number, placed in enumerate(self._placed) if str(placed.part.name).startswith(f"{name}.")
        ]
        if not numbers:
            raise self._unknown(name)
        self._placed = [placed for number, placed in enumerate(self._placed) if number not in numbers]

    def replace(self, part: C) -> C:
        """Put a part in the place of the one of its name, at the same nodes.

        Returns:
            The part.

        Raises:
            ShaftworkError: `part` is no component.
            ParameterError: there is none of its name, or there are several; the message says what there is.
        """
        if not isinstance(part, Component):
            raise ShaftworkError(f"replace() takes a component such as Inertia('J1', J=1.0), not {part!r}.")
        numbers = self._numbers(part.name)
        if not numbers:
            raise self._unknown(part.name)
        if len(numbers) > 1:
            raise ParameterError(f"'{self.name}' has {len(numbers)} parts named '{part.name}'. Rename them first.")
        self._placed[numbers[0]] = replace(self._placed[numbers[0]], part=part)
        return part

    def _numbers(self, name: str) -> list[int]:
        return [number for number, placed in enumerate(self._placed) if placed.part.name == name]

    def _unknown(self, name: str) -> ParameterError:
        names = [str(placed.part.name) for placed in self._placed]
        names = get_close_matches(str(name), names, n=3) or names[:12]
        return ParameterError(
            f"There is no part '{name}' in '{self.name}'. Close to it: {', '.join(names) or 'none, it has no parts'}."
        )

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
        return Netlist(self.name, tuple(self._placed), self.ports, self.impacts)

    def __repr__(self) -> str:
        return overview(self.netlist())
