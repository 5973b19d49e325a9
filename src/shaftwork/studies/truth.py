"""What a shaft of a network really does: the exact solution that its models are compared with."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from shaftwork.components.shaft_models import OneSpring, Rigid, ShaftModel, Spectral, Wave
from shaftwork.components.shafts import Shaft
from shaftwork.core.errors import ShaftworkError
from shaftwork.frequency.natural_modes import Modes
from shaftwork.pipeline.network import Network
from shaftwork.results.observer import Array
from shaftwork.results.solution import Solution

QUANTITIES = ("tau_a", "tau_b", "tau_mid", "omega_a", "omega_b")
"""What is compared: torque at both ends and in the middle, speed of both ends."""
COARSE = Spectral(8)
"""The model of a network whose shafts are then taken without one."""
FINE, FINER = 48, 64
"""Degrees of two spectral models whose difference says how well the finer one stands for the truth."""
TIGHT = 1e-11
"""Tolerance of runs that stand for the truth."""
NONLINEAR, LOOSER = (8, 12, 16, 24, 32), 1e-8
"""The same for a nonlinear network that no wave solves, up to where two are alike: its modes are stepped through one by
one, and of a shaft that is damped the high ones do not matter."""
ALIKE = 1e-7
"""So much of the largest torque two models may differ that stand for the truth of a nonlinear network."""
MODES = 3
"""Elastic natural frequencies that are compared. The truth names one more, to tell those beyond from them."""


@dataclass(frozen=True)
class ShaftMotion:
    """The motion of one shaft at the times asked for.

    Args:
        values: (k,) of each compared quantity, by name.
        error: estimate of its own error, relative to the largest torque.
        source: where it comes from, a few words.
    """

    values: Mapping[str, Array]
    error: float
    source: str


def with_model(net: Network, shaft: str, model: ShaftModel) -> Network:
    """The same network with another model of its shafts.

    Other shafts than the named one that are rigid or one spring stay so: that is a wish, no approximation.
    """
    varied = Network(net.name)
    for placed in net.netlist().placed:
        part = placed.part
        if isinstance(part, Shaft) and (part.name == shaft or not isinstance(part.resolved, Rigid | OneSpring)):
            part = dataclasses.replace(part, model=model)
        varied.add(part, *placed.nodes)
    return varied


def exact_motion(
    net: Network, shaft: str, t_end: float, t: Array, tell: Callable[[str], None] = lambda _: None
) -> ShaftMotion:
    """The exact motion of a shaft.

    A network without losses along its shafts is solved by travelling waves; any other by a spectral model of high
    degree.

    Args:
        net: the network.
        shaft: name of the shaft.
        t_end: end of the motion, s.
        t: (k,) times at which it is wanted, s.
        tell: is told what is done meanwhile, in a line.

    Raises:
        ShaftworkError: the network cannot be solved.
    """
    if not any(part.damping or part.friction for part in net.parts if isinstance(part, Shaft)):
        tell("the exact motion, by travelling waves")
        with suppress(ShaftworkError):  # such as a clearance at an end of a shaft where no inertia is
            return ShaftMotion(_read(with_model(net, shaft, Wave(3)), shaft, t_end, t), TIGHT, "travelling waves")
    linear = with_model(net, shaft, COARSE).compile().linear
    degrees, rtol = ((FINE, FINER), TIGHT) if linear else (NONLINEAR, LOOSER)
    finer, gap, degree = dict[str, Array](), np.inf, 0
    for degree in degrees:
        tell(f"the motion with Spectral({degree}), which stands for the exact one")
        fine, finer = finer, _read(with_model(net, shaft, Spectral(degree)), shaft, t_end, t, rtol)
        gap = max((_apart(fine[name], finer[name]) for name in ("tau_a", "tau_b") if fine), default=np.inf)
        if gap <= ALIKE and not linear:
            break
    return ShaftMotion(finer, gap, f"Spectral({degree})")


def _apart(one: Array, other: Array) -> float:
    """By how much two courses differ, as a part of the largest value."""
    return float(np.abs(one - other).max() / np.abs(other).max())


def quantities(solution: Solution, net: Network, shaft: str) -> dict[str, Array]:
    """The compared quantities of a solution.

    The torque in the middle is what the model says: the value of its polynomial, or between the two nearest places.
    """
    places, torques = solution.places[f"{shaft}.tau"], solution[f"{shaft}.tau"]
    model = next(part.resolved for part in net.parts if isinstance(part, Shaft) and part.name == shaft)
    middle = places[-1] / 2
    if isinstance(model, Spectral):
        read = np.arange(1, len(places) - 1)  # the ends belong to what is there, not to the polynomial
    else:
        read = np.argsort(np.abs(places - middle), kind="stable")[:2]
    apart = places[read][:, None] - places[read] + np.eye(len(read))
    lagrange = np.prod((middle - places[read] - np.diag(middle - places[read] - 1)) / apart, axis=1)
    values = {name: solution[f"{shaft}.{name}"] for name in QUANTITIES if name != "tau_mid"}
    return values | {"tau_mid": torques[:, read] @ lagrange}


def frequencies(modes: Modes) -> Array:
    """The natural frequencies |rate| / 2 pi in Hz of the modes that swing."""
    return modes.frequencies[modes.frequencies > 0]


def exact_frequencies(net: Network, shaft: str) -> Array:
    """The lowest natural frequencies |rate| / 2 pi in Hz of a network at rest with exact shafts, damping included.

    They are those of modes that swing; empty where they are unknown.
    """
    try:
        exact = frequencies(with_model(net, shaft, COARSE).modes(exact=True))
    except ShaftworkError:
        return np.empty(0)
    return exact[: MODES + 1] if len(exact) > MODES else np.empty(0)


def _read(net: Network, shaft: str, t_end: float, t: Array, rtol: float = TIGHT) -> dict[str, Array]:
    return quantities(net.simulate(t_end, t_eval=t, rtol=rtol), net, shaft)
