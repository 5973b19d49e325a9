"""Parts that touch and let go: gaps and stops, turning or along a line, with flanks that spring or rigid ones."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from sympy import Expr, Integer, Piecewise, true

from shaftwork.components.base import Component, Port, Role, component
from shaftwork.components.branches import ACROSS, INTEGRAL, THROUGH, Branch, ThroughLaw, rigid
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


def _refuse_mixed(part: Any) -> None:
    if part.c is None and part.d:
        raise ParameterError(f"{type(part).__name__} '{part.name}': a damping d needs a stiffness c beside it.")
    if part.c is not None and part.restitution:
        raise ParameterError(
            f"{type(part).__name__} '{part.name}': restitution is for rigid flanks. Leave out c, or take d instead."
        )


def _torques(upper: Any, lower: Any, p: Any) -> tuple[Any, Any]:
    """Torques of a flank beyond each limit, None where there is no limit."""
    made = (None if limit is None else p.c * (INTEGRAL - limit) + p.d * ACROSS for limit in (upper, lower))
    forward, backward = made
    return forward, backward


def _modes(upper: Any, lower: Any, p: Any, rest: Any, twist: str = "phi") -> Modes:
    """Open between two limits of the twist, either of which may be None, and in contact beyond."""
    above = None if upper is None else INTEGRAL - upper
    below = None if lower is None else lower - INTEGRAL
    if p.c is None:
        return _rigid(above, below, (p.restitution, rest), twist)
    return _elastic(above, below, _torques(upper, lower, p))


def _elastic(
    above: Any, below: Any, torques: tuple[Any, Any], contact: str = "in contact", free: str = "open"
) -> Modes:
    """In contact the flank springs back; it never pulls. The last two are the words for the modes."""
    forward, backward = torques
    begins, modes, inside = [], [], true
    if above is not None:
        begins.append(Leave(above, "forward"))
        inside &= above <= 0
        modes += [
            Mode("forward", (Leave(-forward, "parted forward"),), 1.0, starts=above > 0, says=contact),
            # beyond the limit, but the flank springs back more slowly than the other moves away
            Mode("parted forward", (Leave(forward, "forward"), Leave(-above, "open")), starts=NEVER, says=free),
        ]
    if below is not None:
        begins.append(Leave(below, "backward"))
        inside &= below <= 0
        modes += [
            Mode("backward", (Leave(backward, "parted backward"),), -1.0, starts=below > 0, says=f"{contact} backward"),
            Mode("parted backward", (Leave(-backward, "backward"), Leave(-below, "open")), starts=NEVER, says=free),
        ]
    return Modes((Mode("open", tuple(begins), starts=inside, says=free), *modes))


def _rigid(above: Any, below: Any, rebound: tuple[Any, Any], twist: str) -> Modes:
    """At a limit a rebound, and below a small speed a rigid contact; it never pulls."""
    begins, modes = [], []
    if above is not None:
        begins.append(Leave(above, "forward", *rebound))
        modes.append(Mode("forward", (Leave(-THROUGH, "open"),), 1.0, CLOSED, NEVER, "in contact"))
    if below is not None:
        begins.append(Leave(below, "backward", *rebound))
        modes.append(Mode("backward", (Leave(THROUGH, "open"),), -1.0, CLOSED, NEVER, "in contact backward"))
    return Modes((Mode("open", tuple(begins)), *modes), angle=twist)


def _branches(upper: Any, lower: Any, p: Any, twist: str = "phi") -> Iterator[Branch]:
    if p.c is not None:
        yield ThroughLaw(_law(upper, lower, p), stored=_stored(upper, lower, p))
        return
    if p.form == CLOSED:
        yield rigid(("a", "b"))
    yield ThroughLaw(p.mode * (1 - p.mode**2) * INTEGRAL, ("a", "b"), twist)  # no torque: it carries the twist


def _stored(upper: Any, lower: Any, p: Any) -> Expr:
    """What the flanks have taken up and can give back; they still have it where they part and it is relaxing."""
    pieces = [(p.c * (INTEGRAL - upper) ** 2 / 2, upper < INTEGRAL)] if upper is not None else []
    pieces += [(p.c * (INTEGRAL - lower) ** 2 / 2, lower > INTEGRAL)] if lower is not None else []
    return Piecewise(*pieces, (Integer(0), True))


def _law(upper: Any, lower: Any, p: Any) -> Expr:
    """The torque in a mode."""
    one, other = upper if upper is not None else lower, lower if lower is not None else upper
    limit = (one + other) / 2 + p.mode * (one - other) / 2
    return p.mode**2 * (p.c * (INTEGRAL - limit) + p.d * ACROSS)


@component
class Backlash(Component):
    """A gap between two nodes, with the stiffness and damping of the flanks that close it: teeth, claws, splines.

    Law: tau = max(0, c (phi - gap/2) + d omega) where phi > gap/2, min(0, c (phi + gap/2) + d omega) where
    phi < -gap/2, and 0 between, with phi the twist and omega the speed of node a against node b. A contact never
    pulls: flanks that part faster than they spring back have let go. Beyond gap/2 by x they store c x^2 / 2; what d
    takes is lost, and what they have not given back when they let go. Without c the flanks are rigid, and the speed
    omega with which they meet comes back as -restitution omega; `Network(impacts=...)` says what those do that touch
    while others are hit. Contact on one side only is a `HardStop` between two nodes. Modes: open, in contact, in
    contact backward. Source: Marinkovic 2012, (12)-(16); restitution: Newton; energy: Willems 1972.
    """

    gap: float = parameter("rad", "whole free twist", at_least=0, latex=r"\Delta")
    c: float | None = _stiffness()
    d: float = _damping()
    restitution: float = _restitution()
    omega_rest: float = _rest()

    role: ClassVar[Role] = "loss"

    def __post_init__(self) -> None:
        _refuse_mixed(self)

    def modes(self, p: Any) -> Iterator[Modes]:
        yield _modes(p.gap / 2, -p.gap / 2, p, p.omega_rest)

    def branches(self, p: Any) -> Iterator[Branch]:
        yield from _branches(p.gap / 2, -p.gap / 2, p)


@component
class TranslationalBacklash(Component):
    """A gap between two nodes that move along a line: couplings of wagons, claws and pins with play.

    Law: that of a `Backlash`, with the force f, the way s and the speed v of node a against node b in place of torque,
    twist and speed. Modes: open, in contact, in contact backward. Source: as of a `Backlash`.
    """

    gap: float = parameter("m", "whole free way", at_least=0, latex=r"\Delta")
    c: float | None = _stiffness("N/m", "stiffness")
    d: float = _damping("N*s/m")
    restitution: float = _restitution()
    v_rest: float = _rest("m/s", "v_r")

    role: ClassVar[Role] = "loss"
    ports: ClassVar = (Port("a", TRANSLATION), Port("b", TRANSLATION))

    def __post_init__(self) -> None:
        _refuse_mixed(self)

    def modes(self, p: Any) -> Iterator[Modes]:
        yield _modes(p.gap / 2, -p.gap / 2, p, p.v_rest, "s")

    def branches(self, p: Any) -> Iterator[Branch]:
        yield from _branches(p.gap / 2, -p.gap / 2, p, "s")


@component
class Rope(Component):
    """A massless rope, chain or belt between two nodes: it pulls, and hangs slack instead of pushing.

    Law: f = max(0, c s + d v) where s > 0, and 0 else, with s the way and v the speed of node a against node b: s is
    the stretch, negative where the rope hangs slack, and 0 at the start unless it is given. It is a `Backlash` without
    a gap on one side alone: the damper acts while the rope is stretched, and never pushes. A stretched rope stores
    c s^2 / 2. Modes: slack, taut.
    """

    c: float = parameter("N/m", "stiffness", above=0)
    d: float = _damping("N*s/m", "internal damping, while taut")

    role: ClassVar[Role] = "loss"
    ports: ClassVar = (Port("a", TRANSLATION), Port("b", TRANSLATION))

    def modes(self, p: Any) -> Iterator[Modes]:
        yield _elastic(INTEGRAL, None, _torques(Integer(0), None, p), "taut", "slack")

    def branches(self, p: Any) -> Iterator[Branch]:
        yield from _branches(Integer(0), None, p)


@component
class HardStop(Component):
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

    role: ClassVar[Role] = "loss"
    ports: ClassVar = (Port("a"), Port("b", optional=True))

    def __post_init__(self) -> None:
        _refuse_mixed(self)
        if self.upper is None and self.lower is None:
            raise ParameterError(f"HardStop '{self.name}': give upper, lower or both, in rad.")
        if self.upper is not None and self.lower is not None and not self.lower < self.upper:
            raise ParameterError(f"HardStop '{self.name}': lower = {self.lower} must be below upper = {self.upper}.")

    def modes(self, p: Any) -> Iterator[Modes]:
        yield _modes(p.upper, p.lower, p, p.omega_rest)

    def branches(self, p: Any) -> Iterator[Branch]:
        yield from _branches(p.upper, p.lower, p)
