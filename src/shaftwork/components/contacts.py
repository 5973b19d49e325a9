"""Parts that touch and let go: gaps and stops, turning or along a line, with flanks that spring or rigid ones."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from sympy import Expr, Integer, Piecewise, true

from shaftwork.components.base import Component, Port, Role, component
from shaftwork.components.branches import ACROSS, INTEGRAL, THROUGH, Branch, ThroughLaw, rigid
from shaftwork.components.laws import larger, smaller
from shaftwork.components.modes import NEVER, Leave, Mode, Modes
from shaftwork.core.domains import TRANSLATION
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import parameter

CLOSED = "closed"


def _stiffness(unit: str = "N*m/rad", meaning: str = "torsional stiffness") -> Any:
    return parameter(unit, f"{meaning} in contact, by default rigid", above=0, default=None)


def _damping(unit: str = "N*m*s/rad", meaning: str = "damping in contact") -> Any:
    return parameter(unit, meaning, at_least=0, default=0.0)


def _restitution() -> Any:
    meaning = "of rigid flanks, the share of the speed that comes back"
    return parameter("1", meaning, at_least=0, at_most=1, default=0.0, latex="e")


def _rest(unit: str = "rad/s", latex: str = r"\omega_r") -> Any:
    meaning = "of rigid flanks, speed up to which they stay together"
    return parameter(unit, meaning, at_least=0, default=0.0, latex=latex)


class ContactPart(Component):
    """Base of parts that touch where the twist between their nodes is beyond a limit, and are apart elsewhere.

    In contact a flank of stiffness `c` springs back and never pulls. Without `c` flanks are rigid: they rebound, and
    below a small speed they stay together until they would pull.
    """

    c: float | None
    d: float
    role: ClassVar[Role] = "loss"
    words: ClassVar[tuple[str, str]] = ("open", "in contact")
    twist: ClassVar[str] = "phi"
    """Label of the branch that carries the twist of rigid flanks."""
    rest: ClassVar[str] = "omega_rest"
    """Name of the parameter that is the speed up to which rigid flanks stay together."""

    def limits(self, p: Any) -> tuple[Any, Any]:
        """Upper and lower limit of the twist; None where there is none."""
        raise NotImplementedError

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.c is None and self.d:
            raise ParameterError(f"{type(self).__name__} '{self.name}': a damping d needs a stiffness c beside it.")
        if self.c is not None and getattr(self, "restitution", False):
            raise ParameterError(
                f"{type(self).__name__} '{self.name}': restitution is for rigid flanks. Leave out c, or take d instead."
            )

    def modes(self, p: Any) -> Iterator[Modes]:
        free, contact = self.words
        closes, modes, inside = [], [], true
        for side, sign, limit in (("forward", 1, self.limits(p)[0]), ("backward", -1, self.limits(p)[1])):
            if limit is None:
                continue
            beyond, says = sign * (INTEGRAL - limit), contact if sign > 0 else f"{contact} {side}"
            if p.c is None:
                closes.append(Leave(beyond, side, p.restitution, getattr(p, self.rest)))
                modes.append(Mode(side, (Leave(-sign * THROUGH, "open"),), float(sign), CLOSED, NEVER, says))
                continue
            closes.append(Leave(beyond, side))
            inside &= beyond <= 0
            push, parted = sign * (p.c * (INTEGRAL - limit) + p.d * ACROSS), f"parted {side}"
            modes += [
                Mode(side, (Leave(-push, parted),), float(sign), starts=beyond > 0, says=says),
                # beyond the limit, but the flank springs back more slowly than the other moves away
                Mode(parted, (Leave(push, side), Leave(-beyond, "open")), starts=NEVER, says=free),
            ]
        angle = self.twist if p.c is None else ""
        law = None if p.c is None else _law(*self.limits(p), p)
        yield Modes((Mode("open", tuple(closes), starts=inside, says=free), *modes), angle=angle, law=law)

    def branches(self, p: Any) -> Iterator[Branch]:
        upper, lower = self.limits(p)
        if p.c is not None:
            one, other = upper if upper is not None else lower, lower if lower is not None else upper
            limit = (one + other) / 2 + p.mode * (one - other) / 2
            torque = p.mode**2 * (p.c * (INTEGRAL - limit) + p.d * ACROSS)
            yield ThroughLaw(torque, stored=_stored(upper, lower, p))
            return
        if p.form == CLOSED:
            yield rigid(("a", "b"))
        yield ThroughLaw(p.mode * (1 - p.mode**2) * INTEGRAL, ("a", "b"), self.twist)  # no torque: it carries the twist


def _law(upper: Any, lower: Any, p: Any) -> Expr:
    """The torque of flanks that spring back, in and out of contact."""
    pieces = []
    for limit, sign, bound in ((upper, 1, larger), (lower, -1, smaller)):
        if limit is not None:
            push = bound(0, p.c * (INTEGRAL - limit) + p.d * ACROSS)
            pieces.append((push, sign * (INTEGRAL - limit) > 0))
    return Piecewise(*pieces, (Integer(0), True))


def _stored(upper: Any, lower: Any, p: Any) -> Expr:
    """What the flanks have taken up and can give back; they still have it where they part and it is relaxing."""
    pieces = [(p.c * (INTEGRAL - upper) ** 2 / 2, upper < INTEGRAL)] if upper is not None else []
    pieces += [(p.c * (INTEGRAL - lower) ** 2 / 2, lower > INTEGRAL)] if lower is not None else []
    return Piecewise(*pieces, (Integer(0), True))


@component
class Backlash(ContactPart):
    """A gap between two nodes, with the stiffness and damping of the flanks that close it: teeth, claws, splines.

    Law: tau = max(0, c (phi - gap/2) + d omega) where phi > gap/2, min(0, c (phi + gap/2) + d omega) where
    phi < -gap/2, and 0 between, with phi the twist and omega the speed of node a against node b. A contact never pulls:
    flanks that part faster than they spring back are open. Pressed in by x beyond gap/2 they store c x^2 / 2. Energy
    that d takes is lost, and so is what is still stored when they open. Without c the flanks are rigid, and the speed
    omega with which they meet comes back as -restitution omega; `Network(impacts=...)` says how an impact passes on to
    flanks that touch elsewhere. Contact on one side only is a `HardStop` between two nodes. Modes: open, in contact, in
    contact backward. Source: Marinkovic 2012, (12)-(16); restitution: Newton; energy: Willems 1972.
    """

    gap: float = parameter("rad", "whole free twist", at_least=0, latex=r"\Delta")
    c: float | None = _stiffness()
    d: float = _damping()
    restitution: float = _restitution()
    omega_rest: float = _rest()

    def limits(self, p: Any) -> tuple[Any, Any]:
        return p.gap / 2, -p.gap / 2


@component
class TranslationalBacklash(ContactPart):
    """A gap between two nodes that move along a line: couplings of wagons, claws and pins with play.

    Law: that of a `Backlash`, with the force f, the displacement s and the speed v of node a against node b in place of
    torque, twist and speed. Modes: open, in contact, in contact backward. Source: as of a `Backlash`.
    """

    gap: float = parameter("m", "whole free way", at_least=0, latex=r"\Delta")
    c: float | None = _stiffness("N/m", "stiffness")
    d: float = _damping("N*s/m")
    restitution: float = _restitution()
    v_rest: float = _rest("m/s", "v_r")

    ports: ClassVar = (Port("a", TRANSLATION), Port("b", TRANSLATION))
    twist: ClassVar[str] = "s"
    rest: ClassVar[str] = "v_rest"

    def limits(self, p: Any) -> tuple[Any, Any]:
        return p.gap / 2, -p.gap / 2


@component
class Rope(ContactPart):
    """A massless rope, chain or belt between two nodes: it pulls, and hangs slack instead of pushing.

    Law: f = max(0, c s + d v) where s > 0, and 0 else, with s the displacement and v the speed of node a against node
    b: s is the stretch, negative where the rope hangs slack, and 0 at the start unless it is given. It is a `Backlash`
    without a gap on one side alone: the damper acts while the rope is stretched, and never pushes. A stretched rope
    stores c s^2 / 2. Modes: slack, taut.
    """

    c: float = parameter("N/m", "stiffness", above=0)
    d: float = _damping("N*s/m", "internal damping, while taut")

    ports: ClassVar = (Port("a", TRANSLATION), Port("b", TRANSLATION))
    words: ClassVar[tuple[str, str]] = ("slack", "taut")

    def limits(self, p: Any) -> tuple[Any, Any]:  # noqa: ARG002
        return Integer(0), None


@component
class HardStop(ContactPart):
    """A stop at a limit of the twist of node a against node b, or against the frame, counted from the start.

    Law: as of a `Backlash`, with limits of its own, of which one may be left out. Without c the stop is rigid, and the
    speed omega with which it is hit comes back as -restitution omega, until rounding hides the rebounds; up to
    omega_rest it stays in contact, and never pulls. Modes: open, in contact, in contact backward.
    Source: Newton's law of impact.
    """

    upper: float | None = parameter("rad", "upper limit of the twist", default=None, latex=r"\varphi_+")
    lower: float | None = parameter("rad", "lower limit of the twist", default=None, latex=r"\varphi_-")
    c: float | None = _stiffness()
    d: float = _damping()
    restitution: float = _restitution()
    omega_rest: float = _rest()

    ports: ClassVar = (Port("a"), Port("b", optional=True))

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.upper is None and self.lower is None:
            raise ParameterError(f"HardStop '{self.name}': give upper, lower or both, in rad.")
        if self.upper is not None and self.lower is not None and not self.lower < self.upper:
            raise ParameterError(f"HardStop '{self.name}': lower = {self.lower} must be below upper = {self.upper}.")

    def limits(self, p: Any) -> tuple[Any, Any]:
        return p.upper, p.lower
