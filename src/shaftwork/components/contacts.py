"""Parts that touch and let go: gaps and stops."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from sympy import Expr, Max, Min, Piecewise

from shaftwork.components.base import Component, Role, component
from shaftwork.components.branches import ACROSS, INTEGRAL, Branch, ThroughLaw
from shaftwork.components.modes import NEVER, Leave, Mode, Modes
from shaftwork.core.parameters import parameter


def _elastic(upper: Any, lower: Any, p: Any) -> Modes:
    """Open between two limits of the twist, in contact beyond, where the flank springs back; it never pulls."""
    forward, backward = p.c * (INTEGRAL - upper) + p.d * ACROSS, p.c * (INTEGRAL - lower) + p.d * ACROSS
    above, below = INTEGRAL - upper, lower - INTEGRAL
    return Modes(
        (
            Mode("open", (Leave(above, "forward"), Leave(below, "backward")), starts=(above <= 0) & (below <= 0)),
            Mode("forward", (Leave(-forward, "parted forward"),), 1.0, starts=above > 0, says="in contact"),
            Mode("backward", (Leave(backward, "parted backward"),), -1.0, starts=below > 0, says="in contact backward"),
            # beyond the limit, but the flank springs back more slowly than the other moves away
            Mode("parted forward", (Leave(forward, "forward"), Leave(-above, "open")), starts=NEVER, says="open"),
            Mode("parted backward", (Leave(-backward, "backward"), Leave(-below, "open")), starts=NEVER, says="open"),
        )
    )


def _elastic_law(upper: Any, lower: Any, p: Any) -> Expr:
    """The law in a mode; where nothing chooses modes, of all of them in one."""
    if p.form is None:
        forward, backward = p.c * (INTEGRAL - upper) + p.d * ACROSS, p.c * (INTEGRAL - lower) + p.d * ACROSS
        return Piecewise((Max(0, forward), upper < INTEGRAL), (Min(0, backward), lower > INTEGRAL), (0, True))
    limit = (upper + lower) / 2 + p.mode * (upper - lower) / 2
    return p.mode**2 * (p.c * (INTEGRAL - limit) + p.d * ACROSS)


@component
class Backlash(Component):
    """A gap between two nodes, with the stiffness and damping of the flanks that close it: teeth, claws, splines.

    Law: tau = max(0, c (phi - gap/2) + d omega) where phi > gap/2, min(0, c (phi + gap/2) + d omega) where
    phi < -gap/2, and 0 between, with phi the twist and omega the speed of node a against node b. A contact never
    pulls: flanks that part faster than they spring back have let go. Modes: open, in contact, in contact backward.
    Source: Marinkovic 2012, (12)-(16).
    """

    gap: float = parameter("rad", "whole free twist", at_least=0, latex=r"\Delta")
    c: float = parameter("N*m/rad", "torsional stiffness in contact", above=0)
    d: float = parameter("N*m*s/rad", "damping in contact", at_least=0, default=0.0)

    role: ClassVar[Role] = "loss"

    def modes(self, p: Any) -> Iterator[Modes]:
        yield _elastic(p.gap / 2, -p.gap / 2, p)

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughLaw(_elastic_law(p.gap / 2, -p.gap / 2, p))
