"""Sources: torque, force and speed as a number, a table over time or an expression of time, speed and angle."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from shaftwork.components.base import Component, Port, Role, component
from shaftwork.components.branches import AcrossLaw, Branch, ThroughLaw
from shaftwork.core.domains import TRANSLATION
from shaftwork.core.parameters import parameter


@component
class TorqueSource(Component):
    """A torque given to node a, and taken from node b where it has one.

    Law: tau(t, omega, phi), positive raises the speed of a; omega and phi are those of a relative to b.
    Analogue: a current source.
    """

    tau: Any = parameter("N*m", "torque", law=True)

    role: ClassVar[Role] = "source"
    ports: ClassVar = (Port("a"), Port("b", optional=True))

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughLaw(-p.tau)


@component
class ForceSource(Component):
    """A force given to node a, and taken from node b where it has one.

    Law: f(t, v, s), positive raises the speed of a; v and s are those of a relative to b. Analogue: a current source.
    """

    f: Any = parameter("N", "force", law=True)

    role: ClassVar[Role] = "source"
    ports: ClassVar = (Port("a", TRANSLATION), Port("b", TRANSLATION, optional=True))

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughLaw(-p.f)


@component
class SpeedSource(Component):
    """Prescribes the speed of node a, relative to node b where it has one.

    Law: omega_a - omega_b = omega(t). Analogue: a voltage source. A jump of the speed is an impulse to whatever inertia
    is rigidly joined to it.
    """

    omega: Any = parameter("rad/s", "speed", law=True, latex=r"\omega")

    role: ClassVar[Role] = "source"
    ports: ClassVar = (Port("a"), Port("b", optional=True))

    def branches(self, p: Any) -> Iterator[Branch]:
        yield AcrossLaw(p.omega)
