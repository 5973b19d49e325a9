"""Rotating parts: inertia, spring, damper, frame, gears."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from sympy import Integer

from shaftwork.components.base import Component, Port, Role, component
from shaftwork.components.branches import ACROSS, AcrossStore, Branch, IdealCoupling, ThroughLaw, ThroughStore
from shaftwork.core.parameters import parameter


@component
class Inertia(Component):
    """A rigid rotating mass: rotor, disc, flywheel; or an arm or mechanism whose inertia changes.

    Law: tau = J d(omega)/dt. Of a law J(phi, t), tau = d(J omega)/dt - J_phi omega^2 / 2, with phi the angle of its
    node from the start, or from `name.phi` among the start values: the momentum is J omega and the energy
    J omega^2 / 2, of which what moves the masses takes J_t omega^2 / 2, counted as lost, or gives it where that is
    negative. J is above zero at all times and does not jump. Analogue: a capacitor J to the reference.
    Source: Popenda 2019, (1)-(3); of a law: Lagrange's equation.
    """

    J: Any = parameter("kg*m^2", "moment of inertia, also over its angle or time", at_least=0, law=True)

    ports: ClassVar = (Port("a"),)

    def branches(self, p: Any) -> Iterator[Branch]:
        yield AcrossStore(p.J)


@component
class Spring(Component):
    """A massless shaft between two nodes: torsional stiffness with internal damping beside it.

    Law: tau = tau_c + d omega_rel, d(tau_c)/dt = c omega_rel, with tau the torque that node a gives to node b. Of a
    law c(phi, t), tau = c phi + d omega_rel, with phi the twist of a against b: it stores the integral of c phi over
    the twist; what a change over time gives or takes counts as lost. Analogue: an inductor 1/c beside a conductance d.
    Source: Popenda 2019, (2), (4); Marinkovic 2012, (14), (17).
    """

    c: Any = parameter("N*m/rad", "torsional stiffness, also over its twist or time", at_least=0, law=True)
    d: float = parameter("N*m*s/rad", "internal damping", at_least=0, default=0.0)

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughStore(p.c, label="tau_c")
        yield ThroughLaw(p.d * ACROSS)


@component
class Damper(Component):
    """Viscous friction between two nodes, or between a node and the frame (bearing).

    Law: tau = d omega_rel. Analogue: a conductance d. Source: Popenda 2019, (1), (3).
    """

    d: float = parameter("N*m*s/rad", "damping", at_least=0)

    role: ClassVar[Role] = "loss"
    ports: ClassVar = (Port("a"), Port("b", optional=True))

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughLaw(p.d * ACROSS)


@component
class Ground(Component):
    """The frame: holds its node at rest (in a circuit: at zero potential).

    Law: omega = 0. Analogue: the reference node. The signal reaction is the torque that the node gives to it.
    """

    role: ClassVar[Role] = "coupling"
    ports: ClassVar = (Port("a", None),)

    def branches(self, p: Any) -> Iterator[Branch]:  # noqa: ARG002
        yield IdealCoupling(((Integer(1), "a", None),))


@component
class Gear(Component):
    """An ideal gear between shafts a and b, without inertia, compliance or loss.

    Law: omega_a = ratio omega_b, tau_b = -ratio tau_a. Analogue: an ideal transformer. Source: Marinkovic 2012, (18).
    """

    ratio: float = parameter(
        "1", "speed of a over speed of b; negative for a pair that reverses", nonzero=True, latex="i"
    )

    role: ClassVar[Role] = "coupling"

    def branches(self, p: Any) -> Iterator[Branch]:
        yield IdealCoupling(((Integer(1), "a", None), (-p.ratio, "b", None)))


@component
class PlanetaryGear(Component):
    """An ideal planetary gear.

    Law: omega_sun + ratio omega_ring = (1 + ratio) omega_carrier (Willis). Analogue: a three-winding transformer.
    """

    ratio: float = parameter("1", "teeth of the ring over teeth of the sun", above=0, latex="i")

    role: ClassVar[Role] = "coupling"
    ports: ClassVar = (Port("sun"), Port("carrier"), Port("ring"))

    def branches(self, p: Any) -> Iterator[Branch]:
        yield IdealCoupling(((Integer(1), "sun", None), (p.ratio, "ring", None), (-(1 + p.ratio), "carrier", None)))
