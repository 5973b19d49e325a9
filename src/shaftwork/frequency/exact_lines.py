"""Uniform shafts without a mesh: what they do at their ends and between, and the small motions of a network with them.

Of a shaft that swings as exp(s t) two numbers say everything: the speed V of its middle and the elastic torque W there.
With p = s T / 2, the delay T, the impedance Z of its lossless waves, the bearing friction d = d' L / (2 Z) and the time
b = D' / C' of its internal damping, and with the places u from -1/2 to 1/2,

    omega(u) = V cosh(G u) - W / Z p 2 u sinhc(G u)             G^2 = 4 p (p + d) / (1 + s b)
    tau(u)   = W (1 + s b) cosh(G u) - V Z (p + d) 2 u sinhc(G u)         sinhc(x) = sinh(x) / x

which are even and odd about the middle. Both are analytic in s but at -1 / b, and neither ever vanishes at the ends, so
what is singular in a network of shafts is so because of a motion. Everything is divided by exp(R / 2), R >= 0 the real
part of G, so that nothing overflows. G itself would be no scale: it changes its sign where G^2 crosses the negative
axis, and there the modes of shafts with internal damping lie.

The states x of the network between the shafts, and V and W of each of them, swing as exp(s t) where

    s x = A x + Bh h(s) + (B + s B1) v        what arrives at the ends, h = tau - Z omega, drives the network
    omega(s) = C x + Dh h(s) + D v            the ends of the shafts turn as the nodes do

with h(s) and omega(s) linear in V and W. One small matrix for each s (`exact_spectrum`): its solutions are the
frequency response, its singular points the rates of the modes.

Source: the telegraph equations; Popenda 2019, (8)-(12), with d/dt replaced by s.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from shaftwork.frequency.linearization import Linearization
from shaftwork.results.observer import Array, Complex


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
        """Speeds and torques into the shafts at their ends by (V, W), each (k, q, 2, 2), over exp(R / 2)."""
        p, stiffer, _, cosh, sinhc = self._halves(s)
        twist, inertia = p * sinhc / self.impedance, self.impedance * (p + self.friction) * sinhc
        return _blocks(cosh, twist), _blocks(inertia, stiffer * cosh)

    def end_slopes(self, s: Complex) -> tuple[Complex, Complex]:
        """The derivatives of `ends` before the division by s, each (k, q, 2, 2), over the same exp(R / 2)."""
        p, stiffer, square, cosh, sinhc = self._halves(s)
        half, damping = self.delay / 2, self.damping
        by_s = (4 * half * (2 * p + self.friction) - square * damping) / stiffer
        # Near zero the slope of sinhc is taken from its series.
        small = np.abs(square) < 0.1
        series = np.exp(-np.sqrt(square).real / 2) * (1 / 24 + square / 960 + square**2 / 107520 + square**3 / 23224320)
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
            middle: (2, k) V and W, times exp(R / 2).
            shares: (places,) of the way from its first end.
        """
        p, stiffer, square, _, _ = (values[:, number, None] for values in self._halves(s))
        impedance, (speed, torque) = self.impedance[number], middle[:, :, None]
        place = np.asarray(shares) - 0.5
        cosh, sinhc = _even(np.sqrt(square), np.abs(place))
        odd = 2 * place * sinhc
        return (
            speed * cosh - torque / impedance * p * odd,
            torque * stiffer * cosh - speed * impedance * (p + self.friction[number]) * odd,
        )

    def _halves(self, s: Complex) -> tuple[Complex, Complex, Complex, Complex, Complex]:
        """p, 1 + s b, G^2, and cosh and sinhc of G / 2 over exp(R / 2), each (k, q)."""
        p = np.multiply.outer(s, self.delay / 2)
        stiffer = 1 + np.multiply.outer(s, self.damping)
        square = 4 * p * (p + self.friction) / stiffer
        return p, stiffer, square, *_even(np.sqrt(square), np.array(0.5))


def _even(exponent: Complex, place: Array) -> tuple[Complex, Complex]:
    """cosh and sinhc of G u for u from 0 to 1/2, over exp(R / 2)."""
    grown, double = np.exp(exponent * place - exponent.real / 2), 2 * exponent * place
    still = double == 0
    sinhc = np.where(still, 1.0, -np.expm1(-double) / np.where(still, 1.0, double))
    return grown * (1 + np.exp(-double)) / 2, grown * sinhc


def _blocks(even: Complex, odd: Complex) -> Complex:
    """(k, q, 2, 2): both ends by V and W, the second of which changes its sign from end to end."""
    return np.stack([np.stack([even, odd], axis=-1), np.stack([even, -odd], axis=-1)], axis=-2)


@dataclass(frozen=True, eq=False)
class ExactSlopes:
    """Small motions of a network with exact shafts, read by the names that they have with a mesh.

    Args:
        open: the network without the shafts.
        lines: the shafts.
        meshed: the same network with meshes, whose nodes say what can be read and how it is drawn.
        profiles: what can be read along a part, with unit and places in m.
        lengths: of the shafts, m.
    """

    open: Linearization
    lines: ExactLines
    meshed: Linearization
    profiles: Mapping[str, tuple[str, tuple[float, ...]]]
    lengths: tuple[float, ...]

    @property
    def states(self) -> tuple[str, ...]:
        """Those of the network, then speed and elastic torque of the middle of each shaft, over exp(-R / 2)."""
        return (*self.open.states, *(f"{name}.{part}" for name in self.lines.names for part in ("even", "odd")))

    @property
    def state_units(self) -> tuple[str, ...]:
        """(n,) their units."""
        return (*self.open.state_units, *("rad/s", "N*m") * len(self.lines.names))

    @cached_property
    def weights(self) -> Array:
        """(n,) factors with which the sum of squares is twice the stored energy, roughly."""
        delay, impedance = self.lines.delay, self.lines.impedance
        middle = np.stack([np.sqrt(impedance * delay), np.sqrt(delay / impedance)], axis=1)
        return np.concatenate([self.open.weights, middle.ravel()])

    @property
    def inputs(self) -> tuple[str, ...]:
        """The named inputs."""
        return self.open.inputs

    @cached_property
    def _inside(self) -> Mapping[str, tuple[int, float]]:
        """Nodes between the ends of shafts: the shaft and the share of the way."""
        return {
            f"{name}.{k}.omega": (number, place / length)
            for number, (name, length) in enumerate(zip(self.lines.names, self.lengths, strict=True))
            for k, place in enumerate(self.meshed.profiles[f"{name}.omega"][1][1:-1], 1)
        }

    @cached_property
    def units(self) -> Mapping[str, str]:
        """Every quantity that can be read, and its unit; the energy of a shaft is none."""
        energies = {f"{name}.energy" for name in self.lines.names}
        units = {name: unit for name, unit in self.open.units.items() if name not in energies}
        return units | {name: self.meshed.units[name] for name in self._inside}

    @property
    def nodes(self) -> Mapping[str, tuple[str, float]]:
        """The nodes of the meshed network, which are read exactly."""
        return self.meshed.nodes

    @property
    def masses(self) -> tuple[tuple[str, str], ...]:
        """Those of the meshed network."""
        return self.meshed.masses

    def arriving(self, s: Complex, x: Complex) -> Complex:
        """(ends, k) h = tau - Z omega at the ends of the shafts."""
        middle = x[len(self.open.states) :].reshape(len(self.lines.names), 2, x.shape[1])
        speeds, torques = self.lines.ends(s)
        arriving = np.einsum("kqij,qjk->qik", torques - self.lines.impedance[:, None, None] * speeds, middle)
        return np.asarray(arriving.reshape(2 * len(middle), x.shape[1]))

    def swinging(self, s: Complex, x: Complex, v: Complex) -> Callable[[str], Complex]:
        """A function from the name of a quantity to its amplitude (k,), along a part (k, places)."""
        count = len(self.open.states)
        middle = x[count:].reshape(len(self.lines.names), 2, x.shape[1])
        read = self.open.swinging(s, x[:count], np.vstack([v, self.arriving(s, x)]))
        inside: dict[int, Complex] = {}

        def along(number: int, places: Any) -> tuple[Complex, Complex]:
            return self.lines.along(number, s, middle[number], np.asarray(places) / self.lengths[number])

        def amplitude(name: str) -> Complex:
            owner, _, quantity = name.rpartition(".")
            if name in self.profiles and owner in self.lines.names:
                speed, torque = along(self.lines.names.index(owner), self.profiles[name][1])
                return speed if quantity == "omega" else torque
            if name not in self._inside:
                return read(name)
            number = self._inside[name][0]
            if number not in inside:
                inside[number] = along(number, self.meshed.profiles[f"{self.lines.names[number]}.omega"][1])[0]
            return np.asarray(inside[number][:, int(owner.rpartition(".")[2])])

        return amplitude


Motions = Linearization | ExactSlopes
"""Small motions about a point, and a way to read every quantity of them by its name."""
