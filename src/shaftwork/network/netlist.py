"""The netlist: what a network is made of, frozen and in the order in which it was built."""

from __future__ import annotations

from dataclasses import dataclass

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
