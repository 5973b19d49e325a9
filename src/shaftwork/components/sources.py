"""Sources of torque, force and speed: by a law of time, speed and angle, or by a controller."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from sympy import Expr

from shaftwork.components.base import Component, Port, Role, Signal, component, number_of
from shaftwork.components.branches import ACROSS, AcrossLaw, Branch, ThroughLaw, ThroughStore, across_of, through_of
from shaftwork.components.laws import larger, smaller
from shaftwork.components.motors import off_time, on_time, while_on
from shaftwork.components.switch_times import refuse_no_time_on
from shaftwork.core.domains import ROTATION, TRANSLATION
from shaftwork.core.errors import ParameterError
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


@component
class SpeedController(Component):
    """A drive that holds its node at a reference speed: a PI controller with torque limits and anti-windup.

    Law: tau = min(tau_max, max(tau_min, tau_0)), tau_0 = k_p (omega_ref - omega) + tau_i, with the integral part
    d(tau_i)/dt = k_p / t_i (omega_ref - omega) + (tau - tau_0) / t_track: the second term is zero within the limits and
    keeps tau_i from winding up beyond them (back-calculation). Without t_i it is a proportional controller without
    tau_i; without tau_max there are no limits. Before t_on and from t_off on there is no torque, and tau_i rests.

    So the controller is a damper k_p and a spring k_p / t_i to a shaft that turns at the reference speed, and tau_i is
    the torque of that spring. Its energy is not energy of the drive, and no balance counts it.
    Analogue: a controlled current source. Source: Åström 2006, section 3.5.
    """

    omega_ref: Any = parameter("rad/s", "reference speed over time", law=True, latex=r"\omega_{ref}")
    k_p: float = parameter("N*m*s/rad", "proportional gain", above=0)
    t_i: float | None = parameter("s", "integral time", above=0, default=None)
    tau_max: float | None = parameter("N*m", "largest torque", default=None, latex=r"\tau_{max}")
    tau_min: float | None = parameter("N*m", "smallest torque, by default -tau_max", default=None, latex=r"\tau_{min}")
    t_track: float | None = parameter("s", "time of anti-windup, by default t_i", above=0, default=None, latex="t_{tr}")
    t_on: float | None = on_time()
    t_off: float | None = off_time()

    role: ClassVar[Role] = "source"
    ports: ClassVar = (Port("a"),)
    signal_ports: ClassVar = frozenset({"i"})

    def __post_init__(self) -> None:
        refuse_no_time_on(self)
        if self.t_track is not None and (self.t_i is None or self.tau_max is None):
            raise ParameterError(
                f"SpeedController '{self.name}': t_track unwinds the integral part at the limits of the torque, and "
                f"there {'is no integral part' if self.t_i is None else 'are no limits'}. Give "
                f"{'t_i' if self.t_i is None else 'tau_max'}, or leave t_track out."
            )
        most, least = number_of(self, "tau_max"), number_of(self, "tau_min")
        if most is None:
            if self.tau_max is None and self.tau_min is not None:
                raise ParameterError(f"SpeedController '{self.name}': tau_min is given without tau_max. Give both.")
        elif (-most if least is None else least) >= most:
            raise ParameterError(
                f"SpeedController '{self.name}': its torque has no room between tau_min = "
                f"{-most if least is None else least:g} N m and tau_max = {most:g} N m. Give tau_min < tau_max."
            )

    def inner_ports(self) -> tuple[Port, ...]:
        """Where the spring of the integral part ends, where there is one."""
        return () if self.t_i is None else (Port("i"),)

    def signals(self) -> dict[str, Signal]:
        """Speed, torque on the node, and the integral part of the torque."""
        signals = super().signals()
        return signals if self.t_i is None else {**signals, "tau_i": Signal("store", ("i", None), ROTATION)}

    def branches(self, p: Any) -> Iterator[Branch]:
        torque = -while_on(_limited(_wanted(p, ACROSS), p), p)
        if p.t_i is None:
            yield ThroughLaw(torque)
            return
        yield ThroughLaw(torque, ("a", None), "tau_u")
        speed = across_of("a")
        wanted, track = _wanted(p, speed), p.t_i if p.t_track is None else p.t_track
        wound = (_limited(wanted, p) - wanted) * p.t_i / (p.k_p * track)
        yield AcrossLaw(-while_on(p.omega_ref - speed + wound, p), (None, "i"))
        yield ThroughStore(p.k_p / p.t_i, ("i", None), "tau_i")


def _wanted(p: Any, speed: Expr) -> Expr:
    """The torque without limits."""
    proportional = p.k_p * (p.omega_ref - speed)
    return proportional if p.t_i is None else proportional + through_of("tau_i")


def _limited(torque: Expr, p: Any) -> Expr:
    """A torque within the limits."""
    if p.tau_max is None:
        return torque
    return smaller(p.tau_max, larger(-p.tau_max if p.tau_min is None else p.tau_min, torque))
