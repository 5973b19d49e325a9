"""The netlist: what a network is made of, frozen and in the order in which it was built."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from shaftwork.components.base import Component

REFERENCE = "ground"
"""The node name that stands for the reference of every domain (speed zero)."""


@dataclass(frozen=True)
class Placed:
    """A component and the nodes at its ports, in the order of the ports."""

    part: Component
    nodes: tuple[str, ...]


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
            return item if new is None else Placed(replace(item.part, **new), item.nodes)

        return Netlist(self.name, tuple(changed(item) for item in self.placed))
