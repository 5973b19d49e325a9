"""Parts that touch and let go."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from sympy import Max, Min, Piecewise

from shaftwork.components.base import Component, Role, component
from shaftwork.components.branches import ACROSS, INTEGRAL, Branch, ThroughLaw
from shaftwork.core.parameters import parameter


@component
class Backlash(Component):
    """A gap between two nodes, with the stiffness and damping of the flanks that close it: teeth, claws, splines.

    Law: tau = max(0, c (phi - gap/2) + d omega) where phi > gap/2, min(0, c (phi + gap/2) + d omega) where
    phi < -gap/2, and 0 between, with phi the twist and omega the speed of node a against node b. A contact never
    pulls: flanks that part faster than they spring back have let go. Source: Marinkovic 2012, (12)-(16).
    """

    gap: float = parameter("rad", "whole free twist", at_least=0, latex=r"\Delta")
    c: float = parameter("N*m/rad", "torsional stiffness in contact", above=0)
    d: float = parameter("N*m*s/rad", "damping in contact", at_least=0, default=0.0)

    role: ClassVar[Role] = "loss"

    def branches(self, p: Any) -> Iterator[Branch]:
        forward = p.c * (INTEGRAL - p.gap / 2) + p.d * ACROSS
        backward = p.c * (INTEGRAL + p.gap / 2) + p.d * ACROSS
        yield ThroughLaw(
            Piecewise((Max(0, forward), p.gap / 2 < INTEGRAL), (Min(0, backward), -p.gap / 2 > INTEGRAL), (0, True))
        )
