"""The netlist: what a network is made of, frozen and in the order in which it was built."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from shaftwork.components.base import Component
from shaftwork.components.modes import Choice

REFERENCE = "ground"
"""The node name that stands for the reference of every domain (speed zero)."""


@dataclass(frozen=True)
class Origin:
    """Where a part stands in a model file.

    Args:
        file: its path.
        lines: that of the part under "", and that of each parameter.
    """

    file: str
    lines: Mapping[str, int]

    def of(self, parameter: str = "") -> str:
        """The place of a parameter in words, "crane.toml, line 8"; of the part where it is not in the file."""
        return f"{self.file}, line {self.lines.get(parameter, self.lines[''])}"


@dataclass(frozen=True)
class Placed:
    """A component and the nodes at its ports, in the order of the ports.

    Args:
        part: the component.
        nodes: one for each port.
        choices: of a part with modes, what is chosen for each of its elements; by default its first modes.
        origin: where it stands in a model file, if it comes from one.
    """

    part: Component
    nodes: tuple[str, ...]
    choices: tuple[Choice, ...] = ()
    origin: Origin | None = field(default=None, compare=False, repr=False)


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
