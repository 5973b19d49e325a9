"""Translating parts, and the drum and wheel that turn rotation into translation."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from sympy import Integer

from shaftwork.components.base import Component, Port, Role, component
from shaftwork.components.branches import ACROSS, AcrossStore, Branch, IdealCoupling, ThroughLaw, ThroughStore
from shaftwork.core.domains import ROTATION, TRANSLATION
from shaftwork.core.parameters import parameter

ENDS = (Port("a", TRANSLATION), Port("b", TRANSLATION))


@component
class Mass(Component):
    """A rigid translating mass. Law: f = m dv/dt; of a law m(s, t) as of an `Inertia`. Analogue: a capacitor m.

    Source: Abdelkader 2016, (6).
    """

    m: Any = parameter("kg", "mass, also over its position or time", at_least=0, law=True)

    ports: ClassVar = (Port("a", TRANSLATION),)

    def branches(self, p: Any) -> Iterator[Branch]:
        yield AcrossStore(p.m)


@component
class TranslationalSpring(Component):
    """A massless rod or spring with internal damping beside it. It pushes as it pulls; what only pulls is a `Rope`.

    Law: f = f_c + d v_rel, d(f_c)/dt = c v_rel; of a law c(s, t) as of a `Spring`. Analogue: an inductor 1/c beside a
    conductance d.
    """

    c: Any = parameter("N/m", "stiffness, also over its stretch or time", at_least=0, law=True)
    d: float = parameter("N*s/m", "internal damping", at_least=0, default=0.0)

    ports: ClassVar = ENDS

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughStore(p.c, label="f_c")
        yield ThroughLaw(p.d * ACROSS)


@component
class TranslationalDamper(Component):
    """Viscous friction between two nodes, or a node and the frame. Law: f = d v_rel. Analogue: conductance d."""

    d: float = parameter("N*s/m", "damping", at_least=0)

    role: ClassVar[Role] = "loss"
    ports: ClassVar = (ENDS[0], Port("b", TRANSLATION, optional=True))

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughLaw(p.d * ACROSS)


@component
class Drum(Component):
    """A rope drum, pinion or pulley: node a rotates, node b translates.

    Law: v_b = radius omega_a, tau_a = -radius f_b. Analogue: an ideal transformer. Source: Abdelkader 2016, (6).
    """

    radius: float = parameter("m", "radius", nonzero=True, latex="r")

    role: ClassVar[Role] = "coupling"
    ports: ClassVar = (Port("a", ROTATION), Port("b", TRANSLATION))

    def branches(self, p: Any) -> Iterator[Branch]:
        yield IdealCoupling(((p.radius, "a", None), (Integer(-1), "b", None)))


@component
class Wheel(Component):
    """A wheel that rolls without slip: node a rotates, node b translates.

    Law: v_b = radius omega_a. Analogue: an ideal transformer. Source: Marinkovic 2012, (7).
    """

    radius: float = parameter("m", "rolling radius", nonzero=True, latex="r")

    role: ClassVar[Role] = "coupling"
    ports: ClassVar = (Port("a", ROTATION), Port("b", TRANSLATION))

    def branches(self, p: Any) -> Iterator[Branch]:
        yield IdealCoupling(((p.radius, "a", None), (Integer(-1), "b", None)))
