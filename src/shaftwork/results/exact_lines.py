"""Uniform shafts without a mesh: what they do at their ends and between, at a complex frequency.

Of a shaft that swings as exp(s t) two numbers say everything: the speed V of its middle and the elastic torque W there.
With p = s T / 2, the delay T, the impedance Z of its lossless waves, the bearing friction d = d' L / (2 Z) and the time
b = D' / C' of its internal damping, and with the places u from -1/2 to 1/2,

    omega(u) = V cosh(G u) - W / Z p 2 u sinhc(G u)             G^2 = 4 p (p + d) / (1 + s b)
    tau(u)   = W (1 + s b) cosh(G u) - V Z (p + d) 2 u sinhc(G u)         sinhc(x) = sinh(x) / x

which are even and odd about the middle. Both are analytic in s but at -1 / b, and neither ever vanishes at the ends, so
what is singular in a network of shafts is so because of a motion. Everything is divided by exp(G / 2), so that nothing
overflows.

Source: the telegraph equations; Popenda 2019, (8)-(12), with d/dt replaced by s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shaftwork.results.observer import Array
from shaftwork.results.slopes import Complex

SMALL = 0.1
"""Below this G^2 the slope of sinhc is taken from its series."""


@dataclass(frozen=True, eq=False)
class ExactLines:
    """Shafts as lines, each with an array entry.

    Args:
        names: (q,) of the shafts.
        delay: (q,) T = L (J' / C')^(1/2), s.
        impedance: (q,) Z = (J' C')^(1/2), N m s/rad.
        friction: (q,) d' L / (2 Z).
        damping: (q,) D' / C', s.
    """

    names: tuple[str, ...]
    delay: Array
    impedance: Array
    friction: Array
    damping: Array

    @property
    def crowding(self) -> float:
        """The smallest C' / D', 1/s, at whose negative infinitely many rates crowd; infinite without damping."""
        largest = float(self.damping.max(initial=0.0))
        return 1 / largest if largest else np.inf

    def half_waves(self, radius: float) -> Array:
        """(q,) half waves along each shaft, at most, at frequencies |s| up to a radius."""
        turns = radius * self.delay
        return np.asarray(np.sqrt(turns * (turns + 2 * self.friction) / (1 - radius * self.damping)) / np.pi)

    def ends(self, s: Complex) -> tuple[Complex, Complex]:
        """Speeds and torques into the shafts at their ends by (V, W), each (k, q, 2, 2), over exp(G / 2)."""
        p, stiffer, _, cosh, sinhc = self._halves(s)
        twist, inertia = p * sinhc / self.impedance, self.impedance * (p + self.friction) * sinhc
        return _blocks(cosh, twist), _blocks(inertia, stiffer * cosh)

    def end_slopes(self, s: Complex) -> tuple[Complex, Complex]:
        """The derivatives of `ends` before the division by s, each (k, q, 2, 2), over the same exp(G / 2)."""
        p, stiffer, square, cosh, sinhc = self._halves(s)
        half, damping = self.delay / 2, self.damping
        by_s = (4 * half * (2 * p + self.friction) - square * damping) / stiffer
        small = np.abs(square) < SMALL
        series = np.exp(-np.sqrt(square) / 2) * (1 / 24 + square / 960 + square**2 / 107520 + square**3 / 23224320)
        slope = np.where(small, series, (cosh - sinhc) / (2 * np.where(small, 1.0, square))) * by_s
        cosh_slope = sinhc / 8 * by_s
        twist = (half * sinhc + p * slope) / self.impedance
        inertia = self.impedance * (half * sinhc + (p + self.friction) * slope)
        return _blocks(cosh_slope, twist), _blocks(inertia, damping * cosh + stiffer * cosh_slope)

    def along(self, number: int, s: Complex, middle: Complex, shares: Array) -> tuple[Complex, Complex]:
        """Speed and torque (k, places) along a shaft, the torque that the left part gives to the right.

        Args:
            number: of the shaft.
            s: (k,) complex frequencies.
            middle: (2, k) V and W, times exp(G / 2).
            shares: (places,) of the way from its first end.
        """
        p, stiffer, square, _, _ = (made[:, number, None] for made in self._halves(s))
        impedance, (speed, torque) = self.impedance[number], middle[:, :, None]
        place = np.asarray(shares) - 0.5
        cosh, sinhc = _even(np.sqrt(square), np.abs(place))
        odd = 2 * place * sinhc
        return (
            speed * cosh - torque / impedance * p * odd,
            torque * stiffer * cosh - speed * impedance * (p + self.friction[number]) * odd,
        )

    def _halves(self, s: Complex) -> tuple[Complex, Complex, Complex, Complex, Complex]:
        """p, 1 + s b, G^2, and cosh and sinhc of G / 2 over exp(G / 2), each (k, q)."""
        p = np.multiply.outer(s, self.delay / 2)
        stiffer = 1 + np.multiply.outer(s, self.damping)
        square = 4 * p * (p + self.friction) / stiffer
        return p, stiffer, square, *_even(np.sqrt(square), np.array(0.5))


def _even(exponent: Complex, place: Array) -> tuple[Complex, Complex]:
    """cosh and sinhc of G u for u from 0 to 1/2, over exp(G / 2)."""
    grown, double = np.exp(-exponent * (0.5 - place)), 2 * exponent * place
    still = double == 0
    sinhc = np.where(still, 1.0, -np.expm1(-double) / np.where(still, 1.0, double))
    return grown * (1 + np.exp(-double)) / 2, grown * sinhc


def _blocks(even: Complex, odd: Complex) -> Complex:
    """(k, q, 2, 2): both ends by V and W, the second of which changes its sign from end to end."""
    return np.stack([np.stack([even, odd], axis=-1), np.stack([even, -odd], axis=-1)], axis=-2)
