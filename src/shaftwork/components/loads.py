"""Loads: torques that oppose the motion of their node."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Any, ClassVar

from sympy import Abs, Expr, Float, Integer, Max, Symbol, cos, pi, sin, tanh

from shaftwork.components.base import Component, Derived, Port, Role, component
from shaftwork.components.branches import ACROSS, THROUGH, Branch, ThroughLaw
from shaftwork.components.friction import rubbing, rubs
from shaftwork.components.laws import t
from shaftwork.components.modes import Leave, Modes
from shaftwork.components.noise import HeldNoise, SmoothNoise
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import in_si, parameter

GRAVITY = Float("9.81")
"""m/s^2, as Marinkovic 2012, (8)."""


def rounding(default: float = 0.0) -> Any:
    """Declares the speed below which a torque against the motion is rounded; zero where it sticks truly."""
    meaning = "speed below which it is rounded" + ("" if default else "; zero for true stick")
    lowest = 1e-6 if default else 0
    return parameter("rad/s", meaning, at_least=lowest, default=default, latex=r"\omega_s")


@dataclass(frozen=True)
class Resistance(Component):
    """Base of the loads with a torque against the motion, and perhaps others that have a direction of their own.

    Where its parameter `omega_s` is zero it sticks: the node rests until the torque on it is more than `against`.
    """

    omega_s: float = rounding()

    role: ClassVar[Role] = "loss"
    ports: ClassVar = (Port("a"),)

    def against(self, p: Any, direction: Any) -> Expr:
        """The torque against the motion, in parameters and time; `direction` is 1 forward, -1 backward, 0 at rest."""
        raise NotImplementedError

    def weight(self, p: Any) -> Expr:  # noqa: ARG002
        """The torque of what is lifted, in parameters; by default nothing is."""
        return Integer(0)

    def besides(self, p: Any) -> Expr:  # noqa: ARG002
        """What the load takes besides, in parameters and speed; by default nothing."""
        return Integer(0)

    def modes(self, p: Any) -> Iterator[Modes]:
        if p.omega_s != 0 or self.against(p, 1) == 0:
            return
        letters = {Symbol(letter.name, real=True): letter.law for letter in self.derived(p)}
        ahead, back = (direction * self.against(p, direction) for direction in (1, -1))
        others = self.weight(p) + self.besides(p).subs(ACROSS, 0)
        yield _loaded(rubbing(ahead.xreplace(letters), back.xreplace(letters)), others.xreplace(letters))

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughLaw(self.weight(p), conservative=True)
        yield ThroughLaw(self.besides(p))
        if self.against(p, 1) == 0:
            return
        if p.omega_s == 0:
            yield rubs(self.against(p, p.mode), p, None)
        else:
            yield ThroughLaw(self.against(p, tanh(ACROSS / p.omega_s)))


def _loaded(modes: Modes, besides: Expr) -> Modes:
    """Modes of what rubs beside another torque, which is no part of the torque that it holds."""

    def loaded(leave: Leave) -> Leave:
        return dataclasses.replace(leave, when=leave.when.xreplace({THROUGH: THROUGH - besides}))

    options = (dataclasses.replace(mode, leaves=tuple(map(loaded, mode.leaves))) for mode in modes.options)
    return dataclasses.replace(modes, options=tuple(options))


@component
class CoulombLoad(Resistance):
    """A travel resistance of constant size, always against the motion, with true stick.

    Law: torque on the node -sign(omega) tau while it slips, whatever holds up to tau in size while it is stuck; with
    omega_s, -tau tanh(omega / omega_s) instead, without sticking. Source: Marinkovic 2012, (7), (8), (16).
    """

    tau: float = parameter("N*m", "size of the resistance", at_least=0, latex=r"\tau_0")

    def against(self, p: Any, direction: Any) -> Expr:
        return direction * p.tau


@component
class ViscousLoad(Component):
    """A resistance proportional to speed. Law: torque on the node -d omega. Analogue: a conductance d to ground."""

    d: float = parameter("N*m*s/rad", "resistance per speed", at_least=0)

    role: ClassVar[Role] = "loss"
    ports: ClassVar = (Port("a"),)

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughLaw(p.d * ACROSS)


@component
class CraneTravel(Resistance):
    """The travel resistance of a crane at the shaft of its wheels, always against the motion.

    Law: torque on the node -sign(omega) tau_w, tau_w = m g (w + kappa) diameter / 2 with g = 9.81 m/s^2.
    The mass itself is no part of it: give the node an Inertia of m diameter^2 / 4, or a Wheel with a Mass.
    Source: Marinkovic 2012, (7), (8); with its 4.0 t and 0.25 m, 22.4 N m are w + kappa = 0.004567.
    """

    m: float = parameter("kg", "mass of crane and load together", at_least=0, latex=r"m_\Sigma")
    diameter: float = parameter("m", "diameter of the wheels on the rail", above=0, latex="D")
    w: float = parameter("1", "specific resistance of friction, see `wheel_friction`", at_least=0)
    kappa: float = parameter("1", "resistance of wheels that run askew", at_least=0, default=0.0, latex=r"\kappa")

    def derived(self, p: Any) -> Iterator[Derived]:
        size = p.m * GRAVITY * (p.w + p.kappa) * p.diameter / 2
        yield Derived("tau_w", size, "N*m", "travel resistance", r"\tau_w")

    def against(self, p: Any, direction: Any) -> Expr:
        return direction * p.tau_w

    @staticmethod
    def wheel_friction(diameter: float, lever_arm: float, bearing_friction: float, bearing_diameter: float) -> float:
        """The specific resistance w of wheels in bearings.

        Law: w = (2 lever_arm + bearing_friction bearing_diameter) / diameter.

        Args:
            diameter: of the wheels, m.
            lever_arm: of the rolling friction, m; about 0.0005 for steel on steel.
            bearing_friction: coefficient of friction of the bearings; about 0.002 for roller bearings.
            bearing_diameter: on which they rub, m.

        Raises:
            ParameterError: one is negative, or the diameter is zero.
        """
        wheel = in_si("diameter", diameter, "m", above=0)
        arm = in_si("lever_arm", lever_arm, "m", at_least=0)
        bearing = in_si("bearing_diameter", bearing_diameter, "m", at_least=0)
        return (2 * arm + in_si("bearing_friction", bearing_friction, at_least=0) * bearing) / wheel


@component
class Hoist(Resistance):
    """A load that hangs on the rope of a drum, behind a gear: it pulls downwards whichever way it moves.

    Law: torque on the node -tau_h / efficiency while it is hoisted, -efficiency tau_h while it is lowered, and whatever
    holds between the two at rest, with tau_h = m g radius / ratio. That is the weight, and a friction against the
    motion of (1 / efficiency - 1) tau_h upwards and (1 - efficiency) tau_h downwards. With omega_s it is -tau_h
    efficiency^(-tanh(omega / omega_s)). A positive speed hoists. A locked brake before it in the network holds tau_h,
    one behind it efficiency tau_h. The friction alone is lost; the weight's work is supplied, and negative while it is
    hoisted. The efficiency applies to the weight, and not to the acceleration of the load. The mass is not included:
    give the node an Inertia of m (radius / ratio)^2.
    """

    m: float = parameter("kg", "mass of the load and its tackle", at_least=0)
    radius: float = parameter("m", "radius of the drum", above=0, latex="r")
    ratio: float = parameter("1", "node speed over drum speed", above=0, default=1.0, latex="i")
    efficiency: float = parameter("1", "efficiency from node to load", above=0, at_most=1, default=1.0, latex=r"\eta")

    def derived(self, p: Any) -> Iterator[Derived]:
        yield Derived("tau_h", p.m * GRAVITY * p.radius / p.ratio, "N*m", "weight at the shaft", r"\tau_h")

    def against(self, p: Any, direction: Any) -> Expr:
        return p.tau_h * (p.efficiency**-direction - 1)

    def weight(self, p: Any) -> Expr:
        return p.tau_h


class RisingResistance(Resistance):
    """Base of machines for gases and liquids: a static torque, and one that rises with the square of the speed."""

    def against(self, p: Any, direction: Any) -> Expr:
        return direction * p.static * p.tau_n

    def besides(self, p: Any) -> Expr:
        speed = ACROSS / (2 * pi * p.n_n / 60)
        return (1 - p.static) * p.tau_n * speed * Abs(speed)


@component
class FanLoad(RisingResistance):
    """A fan: a torque that rises with the square of the speed, and the friction of its bearings.

    Law: torque on the node -tau_n ((1 - static) w |w| + static sign(w)), w = omega / (2 pi n_n / 60).
    """

    tau_n: float = parameter("N*m", "torque at the nominal speed", at_least=0, latex=r"\tau_n")
    n_n: float = parameter("1/min", "nominal speed", above=0)
    static: float = parameter("1", "share of friction in it", at_least=0, at_most=1, default=0.0, latex=r"\sigma")


@component
class PumpLoad(RisingResistance):
    """A pump that lifts a liquid behind a check valve: a static share for the height, the rest as the square of speed.

    Law: torque on the node -tau_n ((1 - static) w |w| + static sign(w)), w = omega / (2 pi n_n / 60). The valve holds
    the liquid, so that nothing drives the pump backwards from rest.
    """

    tau_n: float = parameter("N*m", "torque at the nominal speed", at_least=0, latex=r"\tau_n")
    n_n: float = parameter("1/min", "nominal speed", above=0)
    static: float = parameter("1", "share of the height in it", at_least=0, at_most=1, default=0.5, latex=r"\sigma")


@component
class Conveyor(Resistance):
    """A belt that carries a mass up or along: its weight, friction against the motion, and drag that rises with speed.

    Law: torque on the node -radius (m g sin(incline) + friction m g cos(incline) sign(omega)
    + d radius omega). A positive speed carries upwards where the incline is positive. Friction and drag are lost; the
    weight's work is supplied, and negative upwards. The mass itself is no part of it: give the node an Inertia of
    m radius^2.
    """

    m: float = parameter("kg", "mass on the belt and of the belt", at_least=0)
    radius: float = parameter("m", "radius of the drum", above=0, latex="r")
    friction: float = parameter("1", "coefficient of friction of the idlers", at_least=0, latex=r"\mu")
    incline: float = parameter("rad", "incline of the belt", at_least=-1.57, at_most=1.57, default=0.0, latex=r"\delta")
    d: float = parameter("N*s/m", "drag per belt speed", at_least=0, default=0.0)

    def against(self, p: Any, direction: Any) -> Expr:
        return direction * p.friction * p.m * GRAVITY * p.radius * cos(p.incline)

    def weight(self, p: Any) -> Expr:
        return p.m * GRAVITY * p.radius * sin(p.incline)

    def besides(self, p: Any) -> Expr:
        return p.d * p.radius**2 * ACROSS


class NoiseKind(Enum):
    """How a random load varies in time."""

    HELD = "held"
    BAND_LIMITED = "band-limited"

    def __repr__(self) -> str:
        return self.value

    @classmethod
    def read(cls, text: Any) -> NoiseKind:
        """A kind from its text.

        Raises:
            ParameterError: there is none.
        """
        try:
            return cls(text)
        except ValueError:
            raise ParameterError(f"{text!r} is no kind of noise. The kinds are: held, band-limited.") from None


@component
class RandomLoad(Resistance):
    """A resistance of random size, normally distributed, always against the motion.

    Law: torque on the node -sign(omega) max(0, mean + std nu(t / interval)), with nu a standard normal noise:
    held for each interval (`HeldNoise`), or smooth and band-limited, its power halved at 0.23 / interval
    (`SmoothNoise`). Where the normal distribution falls below zero there is no resistance: nothing drives.
    The same seed gives the same load, as a function of time. Every engine starts anew at each number, so that a run
    costs as many restarts as it has intervals. Source: Marinkovic 2012, section 3, figure 11.
    """

    mean: float = parameter("N*m", "mean of the resistance", at_least=0, latex=r"\bar\tau")
    std: float = parameter("N*m", "standard deviation", at_least=0, latex=r"\sigma")
    interval: float = parameter("s", "time from one random number to the next", above=0, latex="T")
    seed: float = parameter("1", "any number; other numbers, other noise", default=1.0, latex="z")
    kind: NoiseKind | str = parameter("1", "held or band-limited", default=NoiseKind.HELD, record=NoiseKind)

    def against(self, p: Any, direction: Any) -> Expr:
        noise = HeldNoise if p.kind is NoiseKind.HELD else SmoothNoise
        return direction * (Max(0, p.mean + p.std * noise(t / p.interval, p.seed)) if p.std != 0 else p.mean)
