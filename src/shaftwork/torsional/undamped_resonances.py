"""Resonances that nothing damps, in words: which they are, which shafts lack damping, and what to give them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from shaftwork.components.mechanics import Spring
from shaftwork.components.shafts import Shaft
from shaftwork.core.parameters import in_si
from shaftwork.network.netlist import first_few, listed
from shaftwork.numerics.tolerances import TYPED
from shaftwork.results.observer import RPM, Array, Complex
from shaftwork.torsional.order_excitations import amplitudes_of

if TYPE_CHECKING:
    from shaftwork.pipeline.network import Network
    from shaftwork.torsional.forced_train import ForcedTrain, Resonance


def is_undamped(resonance: Resonance) -> bool:
    """Whether nothing damps it: a ratio that rounding alone makes."""
    return abs(resonance.damping) < TYPED


def without_bound(torques: Complex, train: ForcedTrain, speeds: Array, resonances: Sequence[Resonance]) -> Complex:
    """The torques of a shaft, infinite where an order excites a resonance that nothing damps.

    There a computed torque is finite by rounding alone, and above that of the sources over twice any damping ratio.

    Args:
        torques: (n, k), or along a shaft (n, k, places).
        train: with its excitations.
        speeds: (n,) of the reference shaft, rad/s.
        resonances: damped ones among them are left out.
    """
    bounded = torques.copy()
    excited = np.abs(amplitudes_of(train.excitations, train.orders, speeds)).sum(axis=0)
    for one in filter(is_undamped, resonances):
        order = int(np.abs(np.asarray(train.orders) - one.order).argmin())
        for place in np.flatnonzero(np.abs(speeds - one.speed) <= TYPED * one.speed):
            there = bounded[place, order]
            bounded[place, order] = np.where(np.abs(there) > excited[place, order] / TYPED, np.inf, there)
    return bounded


def undamped_note(resonances: Sequence[Resonance], net: Network, shafts: Iterable[str]) -> str:
    """Which resonances have no bound, and how damping is given; empty where there are none.

    Args:
        resonances: that nothing damps.
        net: the train.
        shafts: names of its springs and shafts.
    """
    if not resonances:
        return ""
    modes: dict[str, list[Resonance]] = {}
    for one in resonances:
        modes.setdefault(one.mode, []).append(one)
    where = "; ".join(
        f"{mode} ({several[0].frequency:.5g} Hz) at "
        + first_few([f"{one.speed * RPM:.5g} 1/min in order {one.order:g}" for one in several], separator=", ")
        for mode, several in modes.items()
    )
    said = "Nothing damps these resonances, so torques have no bound where an order excites them"
    return f"{said}: {where}. {_remedy(resonances, net, shafts)}"


def _remedy(resonances: Sequence[Resonance], net: Network, shafts: Iterable[str]) -> str:
    parts = {part.name: part for part in net.parts}
    bare = [name for name in shafts if not _is_damped(parts[name])]
    if not bare:
        return "The dampers do not move in these modes: add one where the mode swings."
    frequency = resonances[0].frequency
    example = _example(parts[bare[0]], 0.01 / (2 * math.pi * frequency))
    return (
        f"Without damping: {listed(tuple(bare))}. Give d= to a Spring, damping= to a Shaft, or add a Damper. A loss "
        f"factor of 1 % at {frequency:.5g} Hz, for example, is {example}."
    )


def _example(part: object, share: float) -> str:
    """The damping of a part that is so many s of its stiffness."""
    match part:
        case Spring(name=str(name), c=float() | int() as stiffness):
            return f"d = {share * stiffness:.3g} N m s/rad for '{name}'"
        case Shaft(name=str(name)):
            diameters = in_si("diameter", part.diameter, "m"), in_si("bore", part.inner_diameter, "m")
            modulus = in_si("shear_modulus", part.shear_modulus, "Pa")
            stiffness = modulus * math.pi * (diameters[0] ** 4 - diameters[1] ** 4) / 32
            return f"damping = {share * stiffness:.3g} N m^2 s/rad for '{name}'"
    return f"d = {share:.3g} s times its stiffness"


def _is_damped(part: object) -> bool:
    return bool(part.d if isinstance(part, Spring) else part.damping if isinstance(part, Shaft) else True)
