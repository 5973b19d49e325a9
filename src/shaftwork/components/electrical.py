"""Electrical parts, as far as motors and their supplies need them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from shaftwork.components.base import Component, Port, Role, component
from shaftwork.components.branches import ACROSS, AcrossLaw, AcrossStore, Branch, ThroughLaw, ThroughStore
from shaftwork.core.domains import ELECTRICAL
from shaftwork.core.parameters import parameter

TERMINALS = (Port("p", ELECTRICAL), Port("n", ELECTRICAL))


@component
class Resistor(Component):
    """A resistor. Law: i = u / R."""

    R: float = parameter("ohm", "resistance", at_least=0)

    role: ClassVar[Role] = "loss"
    ports: ClassVar = TERMINALS

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughLaw(ACROSS / p.R)


@component
class Inductor(Component):
    """An inductor. Law: u = L di/dt. Mechanical analogue: a shaft of compliance L."""

    L: float = parameter("H", "inductance", at_least=0)

    ports: ClassVar = TERMINALS

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughStore(1 / p.L)


@component
class Capacitor(Component):
    """A capacitor. Law: i = C du/dt. Mechanical analogue: an inertia C."""

    C: float = parameter("F", "capacitance", at_least=0)

    ports: ClassVar = TERMINALS

    def branches(self, p: Any) -> Iterator[Branch]:
        yield AcrossStore(p.C)


@component
class VoltageSource(Component):
    """A voltage from n to p. Law: u_p - u_n = u(t). The signal i is the current delivered at p."""

    u: Any = parameter("V", "voltage", law=True)

    role: ClassVar[Role] = "source"
    ports: ClassVar = TERMINALS

    def branches(self, p: Any) -> Iterator[Branch]:
        yield AcrossLaw(p.u)


@component
class CurrentSource(Component):
    """A current delivered at p and taken from n. Law: i(t, u)."""

    i: Any = parameter("A", "current", law=True)

    role: ClassVar[Role] = "source"
    ports: ClassVar = TERMINALS

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughLaw(-p.i)
