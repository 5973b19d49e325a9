"""The netlist: what a network is made of, frozen and in the order in which it was built."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from shaftwork.components.base import Component
from shaftwork.components.modes import Choice

REFERENCE = "ground"
"""The node name that stands for the reference of every domain (speed zero)."""


@dataclass(frozen=True)
class Placed:
    """A component and the nodes at its ports, in the order of the ports.

    Args:
        part: the component.
        nodes: one for each port.
        choices: of a part with modes, what is chosen for each of its elements; by default its first modes.
    """

    part: Component
    nodes: tuple[str, ...]
    choices: tuple[Choice, ...] = ()


@dataclass(frozen=True)
class Netlist:
    """An ordered list of placed components under a name."""

    name: str
    placed: tuple[Placed, ...]

    def with_values(self, values: Mapping[str, Any]) -> Netlist:
        """The same parts with some parameters, "part.name", replaced."""
        by_part: dict[str, dict[str, Any]] = {}
        for name, value in values.items():
            owner, _, parameter = name.rpartition(".")
            by_part.setdefault(owner, {})[parameter] = value

        def changed(item: Placed) -> Placed:
            new = by_part.get(item.part.name)
            return item if new is None else replace(item, part=replace(item.part, **new))

        return Netlist(self.name, tuple(changed(item) for item in self.placed))

    def with_choices(self, choices: Mapping[str, tuple[Choice, ...]]) -> Netlist:
        """The same parts with what is chosen for those that have modes, by name of the part."""
        placed = (replace(item, choices=choices.get(item.part.name, item.choices)) for item in self.placed)
        return Netlist(self.name, tuple(placed))
