"""What excites a train: its harmonic torques as complex amplitudes by order of the reference shaft."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

import numpy as np

from shaftwork.components.excitations import HarmonicTorque
from shaftwork.components.harmonics import Harmonics
from shaftwork.components.sources import TorqueSource
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import in_si
from shaftwork.numerics.tolerances import TYPED
from shaftwork.pipeline.network import Network
from shaftwork.results.observer import Array, Complex

Misfire = Mapping[str, float | Harmonics] | str | Sequence[str] | None
"""Cylinders that misfire: names, or by name a share of the swing or other harmonics."""


@dataclass(frozen=True)
class OrderExcitation:
    """A harmonic torque of the train.

    Args:
        source: the part.
        harmonics: its own, or those of a cylinder that misfires.
        scale: share of the swing.
        ratio: speed of its shaft over that of the reference shaft; below 0 where it turns the other way.
    """

    source: HarmonicTorque
    harmonics: Harmonics
    scale: float
    ratio: float = 1.0

    @property
    def name(self) -> str:
        """The input of the train that it is."""
        return f"{self.source.name}.tau"

    @property
    def changed(self) -> bool:
        """Whether it swings otherwise than the part says, as a cylinder does that misfires."""
        return self.harmonics != self.source.harmonics or self.scale != in_si("scale", self.source.scale)

    @property
    def orders(self) -> Array:
        """(k,) swings per turn of the reference shaft."""
        return abs(self.ratio) * np.asarray(self.harmonics.orders)

    def at(self, speeds: Array) -> Complex:
        """(n, k) amplitudes in N m at speeds of the reference shaft in rad/s; a shaft that turns back runs through them
        in reverse.
        """
        angle = in_si("firing_angle", self.source.firing_angle, "rad")
        shift = np.exp(-1j * angle * np.asarray(self.harmonics.orders))
        amplitudes = self.scale * self.harmonics.at(self.ratio * speeds) * shift
        return np.asarray(np.conj(amplitudes) if self.ratio < 0 else amplitudes)


def order_excitations(net: Network, misfire: Misfire) -> tuple[OrderExcitation, ...]:
    """The harmonic torques of a train, in its order.

    Args:
        net: the train.
        misfire: cylinders that misfire.

    Raises:
        ParameterError: there is no harmonic torque, or none of a name in `misfire`.
    """
    sources = {part.name: part for part in net.parts if isinstance(part, HarmonicTorque)}
    if not sources:
        raise ParameterError(
            f"'{net.name}' has no HarmonicTorque, so nothing excites it by orders. Add one for each cylinder, "
            "net.add(sw.HarmonicTorque('cylinder 1', harmonics=...), 'throw 1')."
        )
    failing = _failing(misfire)
    for name in failing:
        if name not in sources:
            close = get_close_matches(str(name), sources, n=3) or tuple(sources)[:12]
            raise ParameterError(
                f"misfire: '{name}' is no HarmonicTorque of '{net.name}'. There are: {', '.join(close)}."
            )
    excitations = []
    for name, part in sources.items():
        scale, harmonics = in_si(f"{name}.scale", part.scale), part.harmonics
        match failing.get(name):
            case None:
                pass
            case Harmonics() as other:
                harmonics = other
            case share:
                scale *= in_si(f"misfire['{name}']", share, at_least=0)
        excitations.append(OrderExcitation(part, harmonics, scale))
    return tuple(excitations)


def _failing(misfire: Misfire) -> dict[str, float | Harmonics]:
    if misfire is None:
        return {}
    if isinstance(misfire, Mapping):
        return dict(misfire)
    names = (misfire,) if isinstance(misfire, str) else misfire
    if not isinstance(names, Sequence):
        raise ParameterError(f"misfire = {misfire!r} must be the name of a cylinder, or of several.")
    return dict.fromkeys(names, 0.0)


def without_swing(net: Network, excitations: Sequence[OrderExcitation]) -> Network:
    """The train with the mean torques alone, whose small motions the orders excite."""
    steady = copy.copy(net)
    for one in excitations:
        steady.replace(TorqueSource(one.source.name, tau=one.source.mean, symbol=one.source.symbol))
    return steady


def with_ratios(excitations: Sequence[OrderExcitation], ratios: Sequence[float]) -> tuple[OrderExcitation, ...]:
    """The same, with the speeds of their shafts over that of the reference shaft."""
    return tuple(dataclasses.replace(one, ratio=ratio) for one, ratio in zip(excitations, ratios, strict=True))


def orders_of(excitations: Sequence[OrderExcitation]) -> tuple[float, ...]:
    """All orders of the reference shaft, ascending; those that differ by the digits of typed ratios alone are one."""
    orders: list[float] = []
    for order in sorted(order for one in excitations for order in one.orders.tolist()):
        if not orders or order > orders[-1] * (1 + TYPED):
            orders.append(order)
    return tuple(orders)


def amplitudes_of(excitations: Sequence[OrderExcitation], orders: Sequence[float], speeds: Array) -> Complex:
    """(m, n, k) amplitudes in N m of all excitations at speeds (n,) of the reference shaft in all orders (k,)."""
    table = np.zeros((len(excitations), len(speeds), len(orders)), dtype=complex)
    listed = np.asarray(orders)
    for number, one in enumerate(excitations):
        places: Any = np.abs(listed[None, :] - one.orders[:, None]).argmin(axis=1)
        table[number][:, places] = one.at(speeds)
    return table
