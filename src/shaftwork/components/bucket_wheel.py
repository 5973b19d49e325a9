"""The digging of a bucket wheel: soils, and the torque of the buckets that cut at once."""

from __future__ import annotations

import contextlib
import math
import reprlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

from sympy import Expr, Float, Max, Min, Piecewise, Rational, floor, pi, sin, tanh

from shaftwork.components.base import Component, Derived, Port, Role, component
from shaftwork.components.branches import ACROSS, INTEGRAL, Branch, ThroughLaw
from shaftwork.components.laws import t
from shaftwork.components.loads import rounding
from shaftwork.components.noise import HeldNoise
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import call_in, in_si, parameter


@dataclass(frozen=True)
class Soil:
    """The specific cutting resistance of a soil: a normal distribution.

    Args:
        mean: in N/m; a table in N/cm has a hundredth of it.
        std: standard deviation, N/m.

    Raises:
        ParameterError: one is no number, the mean is not above zero, or the deviation is below.
    """

    mean: float
    std: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "mean", in_si("Soil: mean", self.mean, "N/m", above=0))
        object.__setattr__(self, "std", in_si("Soil: std", self.std, "N/m", at_least=0))

    @classmethod
    def read(cls, text: Any) -> Soil:
        """A soil from its name, such as "grey clay" or "Gray Clay", or from its text "Soil(mean=69200.0, std=15800.0)".

        Raises:
            ParameterError: it is no soil.
        """
        if isinstance(text, str) and (name := " ".join(text.lower().split()).replace("gray", "grey")) in SOILS:
            return SOILS[name]
        match call_in(text):
            case (cls.__name__, values, options):
                with contextlib.suppress(TypeError, ValueError):
                    return cls(*values, **options)
        raise ParameterError(
            f"{reprlib.repr(text)} is no soil. The soils are: {', '.join(SOILS)}; another is Soil(mean, std) in N/m."
        )


SOILS: dict[str, Soil] = {
    "fault zone": Soil(43_600.0, 10_400.0),
    "transitional zone": Soil(61_000.0, 10_700.0),
    "grey clay": Soil(69_200.0, 15_800.0),
}
"""Soils by name. Source: Marinkovic 2012, table 1, there in N/cm."""


class Buckets(int):
    """A number of buckets."""

    @classmethod
    def read(cls, text: Any) -> Buckets:
        """The number from its text or a number.

        Raises:
            ParameterError: it is no whole number from 3 to 100.
        """
        try:
            count = cls(text)
        except (TypeError, ValueError, OverflowError):
            count = cls(0)
        if not 3 <= count <= 100 or (not isinstance(text, str) and count != text):
            raise ParameterError(f"{reprlib.repr(text)} buckets: write a whole number from 3 to 100.")
        return count


@component
class BucketWheelLoad(Component):
    """The torque of a bucket wheel that digs: of each bucket in the soil, with a random resistance for each pass.

    Law: torque on the node -(radius edge / ratio) sum_j k_j f(psi_j) tanh(omega / (ratio omega_s)) over the buckets in
    the soil. Bucket pass j begins at the angle phi / ratio = 2 pi j / buckets of the wheel, its own angle psi_j goes on
    from zero, and f = sin(psi) up to pi/2, then (alpha - psi) / (alpha - pi/2), and zero from alpha on.
    k_j = max(0, k_1 + sigma nu_j) is drawn for each pass from the soil's normal distribution. So the torque is a
    function of the angle and the seed, and continuous. From `t_on` on the wheel digs, to its full depth after `rise`.
    The weight of the soil in the buckets is left out, as in the source. The load does not stick: a wheel that is pushed
    in the soil creeps, at a speed below omega_s where the law balances the push.
    Source: Marinkovic 2012, (9)-(11), algorithm of 6 steps, table 1.
    """

    radius: float = parameter("m", "radius of the cutting edges", above=0, latex="R")
    edge: float = parameter("m", "mean length of an edge in the soil", at_least=0, latex="l")
    ratio: float = parameter("1", "node speed over wheel speed", nonzero=True, default=1.0, latex="i")
    alpha: float = parameter(
        "rad", "angle at which a bucket leaves the soil", above=1.5708, at_most=3.1416, default=2.0, latex=r"\alpha"
    )
    buckets: Buckets | int = parameter("1", "number of buckets", default=Buckets(8), record=Buckets)
    soil: Soil | str = parameter("1", "name of a soil, or Soil(mean, std)", default=SOILS["grey clay"], record=Soil)
    seed: float = parameter("1", "any number; other numbers, other noise", default=1.0, latex="z")
    t_on: float = parameter("s", "time at which it begins to dig", at_least=0, default=0.0, latex=r"t_{on}")
    rise: float = parameter("s", "time in which it comes to its full depth", at_least=0, default=0.0, latex=r"t_r")
    omega_s: float = rounding(0.01)

    role: ClassVar[Role] = "loss"
    ports: ClassVar = (Port("a"),)

    @property
    def mean_torque(self) -> float:
        """Mean over many passes in N m, at the wheel: radius edge k_1 buckets (2 + alpha - pi/2) / (4 pi).

        Raises:
            ParameterError: radius, edge or alpha is not admissible.
        """
        names = ("radius", "edge", "alpha")
        for name in names:
            if (objection := self.declared[name].magnitude(getattr(self, name))[1]) is not None:
                raise ParameterError(f"BucketWheelLoad '{self.name}': {name} = {getattr(self, name)!r} {objection}.")
        radius, edge, alpha = (self.declared[name].magnitude(getattr(self, name))[0] for name in names)
        mean = Soil.read(self.soil).mean if isinstance(self.soil, str) else self.soil.mean
        return float(radius * edge * mean * Buckets.read(self.buckets) * (2 + alpha - math.pi / 2) / (4 * math.pi))

    def derived(self, p: Any) -> Iterator[Derived]:
        meaning = "specific cutting resistance"
        yield Derived("k_mean", Float(p.soil.mean), "N/m", f"mean {meaning}", "k_1")
        yield Derived("k_std", Float(p.soil.std), "N/m", f"standard deviation of the {meaning}", r"\sigma_k")

    def branches(self, p: Any) -> Iterator[Branch]:
        pitch = 2 * pi / p.buckets
        angle, speed = INTEGRAL / p.ratio, ACROSS / p.ratio
        last = floor(angle / pitch)
        force = sum(
            _resistance(last - k, p) * _profile(angle - pitch * (last - k), k, p)
            for k in range((p.buckets + 1) // 2)  # alpha is at most pi: only half of the buckets are in the soil
        )
        yield ThroughLaw(_depth(p) * p.radius * p.edge / p.ratio * force * tanh(speed / p.omega_s))


def _resistance(number: Expr, p: Any) -> Expr:
    """The specific resistance of a bucket pass."""
    return Max(0, p.k_mean + p.k_std * HeldNoise(number, p.seed)) if p.k_std != 0 else p.k_mean


def _profile(angle: Expr, number: int, p: Any) -> Expr:
    """The cut of the bucket that came in as so manieth before the last one: (11) within its way to the next."""
    leaving = Max(0, (p.alpha - angle) / (p.alpha - pi / 2))
    if 4 * (number + 1) <= p.buckets:
        return sin(angle)
    if 4 * number >= p.buckets:
        return leaving
    return Piecewise((sin(angle), angle < pi / 2), (leaving, True))


def _depth(p: Any) -> Expr:
    """The share of the full depth: zero until it digs, then rising."""
    if p.rise != 0:
        return Max(0, Min(1, (t - p.t_on) / p.rise))
    return Rational(1) if p.t_on == 0 else Piecewise((0, t < p.t_on), (1, True))
