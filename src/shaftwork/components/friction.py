"""Parts that rub and hold: dry friction, brakes and clutches, and the freewheel."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, ClassVar

from sympy import And, Expr, Min, Ne, Not, exp, false
from sympy.logic.boolalg import Boolean

from shaftwork.components.base import Component, Port, Role, component, number_of
from shaftwork.components.branches import ACROSS, INTEGRAL, THROUGH, Branch, End, ThroughLaw, rigid
from shaftwork.components.laws import as_expression, no_less, t
from shaftwork.components.modes import ANEW, Leave, Mode, Modes
from shaftwork.components.switch_times import refuse_no_time_on
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import parameter

SLIPPING, STUCK, HELD = "", "stuck", "held by others"
# What holds gives way a hundred roundings above its limit: then there is a torque that moves it.
GIVES_WAY = 1 + 100 * sys.float_info.epsilon


def rubbing(
    limit: Any,
    back: Any = None,
    *,
    holds: str = "stuck",
    moves: str = "slipping",
    apart: tuple[Leave, ...] = (),
    at_rest: str | None = None,
) -> Modes:
    """Slipping forward and backward, and stuck until the torque through it exceeds a limit.

    Args:
        limit: the torque up to which it holds, N m.
        back: the same backward, where it is another.
        holds: what the mode of rest is called.
        moves: what the modes of motion are called, before "forward" and "backward".
        apart: what else ends each of these modes, where they lead to one that is called "apart".
        at_rest: the form in which it gives way while others hold it at rest, where its law is another one then.
    """
    most, least = (size * GIVES_WAY for size in (limit, limit if back is None else back))
    gives_way = (Leave(THROUGH - most, "forward"), Leave(-THROUGH - least, "backward"))
    return Modes(
        (
            Mode("forward", (Leave(-ACROSS, "stuck"), *apart), 1.0, SLIPPING, ACROSS > 0, f"{moves} forward", at_rest),
            Mode(
                "backward", (Leave(ACROSS, "stuck"), *apart), -1.0, SLIPPING, ACROSS < 0, f"{moves} backward", at_rest
            ),
            Mode("stuck", (*gives_way, *apart), 0.0, STUCK, says=holds),
        )
    )


def rubs(torque: Any, p: Any, second: End = "b") -> Branch:
    """The branch of what has the modes of `rubbing`: a torque while it slips, in which `p.mode` is the direction."""
    return rigid(("a", second)) if p.form == STUCK else ThroughLaw(torque)


@component
class DryFriction(Component):
    """Dry friction between two nodes, or between a node and the frame: Coulomb, Stribeck and viscous, with true stick.

    Law: while slipping tau = sign(omega) (tau_c + (tau_s - tau_c) exp(-(omega / omega_s)^2)) + d omega; while stuck
    omega = 0 exactly, and tau is whatever holds, up to tau_s in size. Modes: slipping forward or backward, stuck.
    Analogue: a conductance that conducts ideally below a limit of current. Source: Marinkovic 2012, (16), fig. 4.
    """

    tau_c: float = parameter("N*m", "torque while slipping", at_least=0, latex=r"\tau_c")
    tau_s: float | None = parameter(
        "N*m", "torque up to which it holds, by default tau_c", at_least=0, default=None, latex=r"\tau_s"
    )
    omega_s: float = parameter(
        "rad/s",
        "speed of the fall from tau_s to tau_c; zero: at once",
        at_least=0,
        default=0.1,
        latex=r"\omega_s",
    )
    d: float = parameter("N*m*s/rad", "viscous friction", at_least=0, default=0.0)

    role: ClassVar[Role] = "loss"
    ports: ClassVar = (Port("a"), Port("b", optional=True))

    def __post_init__(self) -> None:
        slips, holds = number_of(self, "tau_c"), number_of(self, "tau_s")
        if slips is not None and holds is not None and holds < slips:
            raise ParameterError(
                f"DryFriction '{self.name}': it holds up to tau_s = {holds:g} N*m, which is less than tau_c = "
                f"{slips:g} N*m while it slips. Give tau_s >= tau_c, or leave it out."
            )

    def modes(self, p: Any) -> Iterator[Modes]:
        if p.tau_s is None:
            yield rubbing(p.tau_c)
        else:  # a fall at once does not come while nothing moves
            yield rubbing(p.tau_s, at_rest=HELD if p.omega_s == 0 else None)

    def branches(self, p: Any) -> Iterator[Branch]:
        falls = p.tau_s is not None and p.omega_s != 0
        slides = p.tau_c + ((p.tau_s - p.tau_c) * exp(-((ACROSS / p.omega_s) ** 2)) if falls else 0)
        yield rubs(p.mode * (p.tau_s if p.form == HELD else slides), p)
        if p.form != STUCK:
            yield ThroughLaw(p.d * ACROSS)


def onset(p: Any, on: Expr | None) -> Expr:
    """Rises above zero when a part comes on: at `p.t_on`, or with a law when that is above zero after `p.t_on`."""
    if on is None:
        return t - p.t_on
    return on if p.t_on == 0 else Min(t - p.t_on, on)


def is_past(p: Any) -> Boolean:
    """Whether a part is off for good, from `p.t_off` on."""
    return false if p.t_off is None else t >= p.t_off


def ends(p: Any, mode: str) -> tuple[Leave, ...]:
    """What leads to the mode of a part that is off for good."""
    return () if p.t_off is None else (Leave(t - p.t_off, mode),)


@component
class Brake(Component):
    """A brake between a node and the frame, or between two nodes: it slips against the motion, then holds.

    Law: on from t_on, or with `on` from when that rises above zero after t_on, to t_off. While slipping the torque is
    sign(omega) tau, with tau constant; rising along a straight line over t_rise; or as tau
    (1 - exp(-(t - t_on) / t_lag)). While locked omega = 0 exactly, and the torque is whatever holds, up to tau in size.
    Any other course of tau is a law of time, speed or angle; where it falls below zero the torque is zero, max(0, tau),
    since what rubs cannot drive. A brake whose tau is zero still counts as slipping. Model a brake that opens and
    closes again as two, one up to t_off and one from t_on, each released while it is off.
    Modes: released, slipping forward or backward, locked. Source: Marinkovic 2012, (4)-(6).
    """

    tau: Any = parameter("N*m", "torque, also over time", at_least=0, law=True)
    t_on: float = parameter("s", "time from which it acts", default=0.0, latex=r"t_{on}")
    t_off: float | None = parameter("s", "time from which it acts no more", default=None, latex=r"t_{off}")
    t_rise: float = parameter("s", "time over which the torque rises straight", at_least=0, default=0.0, latex="t_A")
    t_lag: float = parameter("s", "time constant of a rise that slows down", at_least=0, default=0.0, latex="t_A")
    on: Any = parameter("1", "acts from when this law is above zero, omega - 10 or phi", law=True, default=None)

    role: ClassVar[Role] = "loss"
    ports: ClassVar = (Port("a"), Port("b", optional=True))
    words: ClassVar[tuple[str, str, str]] = ("released", "slipping", "locked")

    def __post_init__(self) -> None:
        refuse_no_time_on(self)
        if self.on is not None and (self.t_rise or self.t_lag):
            raise ParameterError(
                f"{type(self).__name__} '{self.name}': a rise over t_rise or t_lag starts at t_on, and when `on` comes "
                "true is not known before. Leave one of them out."
            )
        if self.t_rise and self.t_lag:
            raise ParameterError(f"{type(self).__name__} '{self.name}': give t_rise or t_lag, not both.")

    def _capacity(self, p: Any) -> Expr:
        tau = no_less(p, "tau", 0)
        if p.t_rise != 0:
            return tau * Min(1, (t - p.t_on) / p.t_rise)
        return tau if p.t_lag == 0 else tau * (1 - exp(-(t - p.t_on) / p.t_lag))

    def modes(self, p: Any) -> Iterator[Modes]:
        released, moves, holds = self.words
        begins, past, over = onset(p, p.on), is_past(p), ends(p, "released")
        waits = And(begins < 0 if p.on is None else begins <= 0, Not(past))
        rubs_so = rubbing(self._capacity(p), holds=holds, moves=moves, apart=over).options
        yield Modes(
            (
                *(replace(mode, starts=And(mode.starts, Not(waits), Not(past))) for mode in rubs_so),
                Mode("waiting", (Leave(begins, ANEW),), starts=waits, says=released),
                Mode("released", starts=past, says=released),
            ),
            angle="phi",
        )

    def branches(self, p: Any) -> Iterator[Branch]:
        capacity = as_expression(self._capacity(p))
        if p.form != STUCK and capacity.has(INTEGRAL):
            yield ThroughLaw(p.mode * capacity, label="phi")
            return
        yield rubs(p.mode * capacity, p)
        if capacity.has(INTEGRAL) or as_expression(p.on or 0).has(INTEGRAL):
            yield ThroughLaw(p.mode * (1 - p.mode**2) * INTEGRAL, label="phi")  # no torque: it carries the angle


@component
class Clutch(Brake):
    """A friction clutch between two nodes: it slips until both turn alike, then holds up to its torque.

    Law: that of a `Brake` on the speed of node a against node b. Modes: open, slipping forward or backward, engaged.
    """

    ports: ClassVar = (Port("a"), Port("b"))
    words: ClassVar[tuple[str, str, str]] = ("open", "slipping", "engaged")


@component
class Freewheel(Component):
    """An overrunning clutch: it holds node a back from turning faster than node b, and lets it turn more slowly.

    Law: omega_a = omega_b and tau >= 0 while locked, with tau the torque that a gives to b; tau = 0 and
    omega_a <= omega_b while free. A backstop has the frame for one of its nodes. Modes: free, locked.
    Analogue: an ideal diode.
    """

    role: ClassVar[Role] = "loss"
    ports: ClassVar = (Port("a"), Port("b", optional=True))

    def modes(self, p: Any) -> Iterator[Modes]:  # noqa: ARG002
        yield conducting("free", "locked")

    def branches(self, p: Any) -> Iterator[Branch]:
        if p.form == STUCK:
            yield rigid(("a", "b"))


def conducting(apart: str, joined: str) -> Modes:
    """Joined rigidly while the first end gives to the second, apart while its across value is the smaller one."""
    return Modes(
        (
            Mode(apart, (Leave(ACROSS, joined),), starts=Ne(ACROSS, 0)),
            Mode(joined, (Leave(-THROUGH, apart),), 1.0, STUCK),
        )
    )
