"""Discs, shafts and gears as openTorsion has them, and the network that they are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from shaftwork.components.base import Component
from shaftwork.components.mechanics import Damper, Gear, Inertia, PlanetaryGear, Spring
from shaftwork.network.netlist import REFERENCE, unused
from shaftwork.pipeline.network import Network

Wired = tuple[Component, tuple[str, ...]]


@dataclass(frozen=True)
class Disc:
    """An inertia at a node, kg m^2, with its damping, N m s/rad, and stiffness, N m/rad, against the frame."""

    name: str
    node: int
    inertia: float
    damping: float = 0.0
    stiffness: float = 0.0

    def parts(self) -> Iterator[Wired]:
        """Its inertia, spring and damper, where they are not zero."""
        if self.inertia:
            yield Inertia(self.name, J=self.inertia), (_node(self.node),)
        if self.stiffness:
            yield Spring(f"{self.name} stiffness", c=self.stiffness), (_node(self.node), REFERENCE)
        if self.damping:
            yield Damper(f"{self.name} damping", d=self.damping), (_node(self.node),)


@dataclass(frozen=True)
class ShaftElement:
    """A finite element between two nodes.

    Its mass matrix is `sixth` [[2, 1], [1, 2]], that of a uniform shaft whose twist grows evenly along it. The same
    kinetic energy have an inertia `sixth` at both ends and one of four times that which turns at their mean speed:
    sixth/2 (omega_l^2 + omega_r^2 + 4 ((omega_l + omega_r) / 2)^2).

    Args:
        name: of it.
        left, right: its nodes.
        stiffness: N m/rad.
        damping: N m s/rad.
        sixth: a sixth of its moment of inertia, kg m^2.
    """

    name: str
    left: int
    right: int
    stiffness: float
    damping: float = 0.0
    sixth: float = 0.0

    def parts(self) -> Iterator[Wired]:
        """Its spring, and its inertias where it has any."""
        left, right, mean = _node(self.left), _node(self.right), f"{self.name} mean"
        yield Spring(self.name, c=self.stiffness, d=self.damping), (left, right)
        if self.sixth:
            yield Inertia(f"{self.name} left", J=self.sixth), (left,)
            yield Inertia(f"{self.name} right", J=self.sixth), (right,)
            yield PlanetaryGear(f"{self.name} halves", ratio=1.0), (left, mean, right)
            yield Inertia(mean, J=4.0 * self.sixth), (mean,)


@dataclass(frozen=True)
class GearMesh:
    """A pair of gears that turn against each other, rigid or elastic.

    Law: omega_parent = -ratio omega_child; an elastic one has a spring between parent and what is there on the right.

    Args:
        name: of the child.
        parent, child: nodes.
        ratio: radius of the child over that of the parent.
        stiffness: about the axis of the parent, N m/rad; None for a rigid one.
        damping: beside the spring, N m s/rad.
    """

    name: str
    parent: int
    child: int
    ratio: float
    stiffness: float | None = None
    damping: float = 0.0

    def parts(self) -> Iterator[Wired]:
        """The gear, and its spring where it has one."""
        mesh = f"{self.name} mesh"
        inner = _node(self.parent) if self.stiffness is None else mesh
        yield Gear(mesh, ratio=-self.ratio), (inner, _node(self.child))
        if self.stiffness is not None:
            yield Spring(f"{self.name} teeth", c=self.stiffness, d=self.damping), (_node(self.parent), mesh)


Element = Disc | ShaftElement | GearMesh


def network_of_elements(name: str, elements: Sequence[Element]) -> Network:
    """The network of some elements, each part under the name of its element; its check says which value is wrong."""
    network = Network(name)
    for element in elements:
        for part, nodes in element.parts():
            network.add(part, *nodes)
    return network


def unique(name: str, taken: set[str]) -> str:
    """The name, or with the first number behind it that makes it a new one; it is taken from then on."""
    free = unused(name, taken, "{} ({})")
    taken.add(free)
    return free


def _node(number: int) -> str:
    return f"n{number}"
