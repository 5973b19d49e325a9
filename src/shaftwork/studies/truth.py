"""What a shaft of a network really does: the exact solution that its models are compared with."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise

import networkx as nx
import numpy as np
from sympy import Expr, lambdify

from shaftwork.components.base import Component
from shaftwork.components.discontinuities import breakpoints
from shaftwork.components.laws import NUMERICAL, as_expression
from shaftwork.components.laws import t as TIME
from shaftwork.components.mechanics import Damper, Inertia
from shaftwork.components.shaft_models import OneSpring, Rigid, ShaftModel, Spectral, Wave
from shaftwork.components.shafts import Shaft
from shaftwork.components.sources import TorqueSource
from shaftwork.core.errors import ParameterError, ShaftworkError
from shaftwork.frequency.natural_modes import Modes
from shaftwork.network.netlist import REFERENCE, Netlist, Placed
from shaftwork.pipeline.network import Network
from shaftwork.results.observer import Array
from shaftwork.results.solution import Solution
from shaftwork.studies.exact_shafts.exact_motion import JunctionTorque, motion
from shaftwork.studies.exact_shafts.line import Section, SectionLine

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
class Truth:
    """The exact motion of one shaft.

    Args:
        values: (k,) of each of `QUANTITIES` at the times asked for.
        frequencies: lowest natural frequencies |rate| / 2 pi of the network at rest in Hz, of modes that swing; empty
            where unknown.
        source: where it comes from, a few words.
        error: estimate of its own error, relative to the largest torque.
    """

    values: Mapping[str, Array]
    frequencies: Array
    source: str
    error: float


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


def truth(net: Network, shaft: str, t_end: float, t: Array, tell: Callable[[str], None] = lambda _: None) -> Truth:
    """The exact motion of a shaft.

    A train of inertias, lossless shafts, bearings and torques of time is solved by characteristics; another network
    without losses along its shafts by travelling waves; any other by a spectral model of high degree. Frequencies are
    those of exact shafts, damping included.

    Args:
        net: the network.
        shaft: name of the shaft.
        t_end: end of the motion, s.
        t: (k,) times at which it is wanted, s.
        tell: is told what is done meanwhile, in a line.

    Raises:
        ShaftworkError: the network cannot be solved.
    """
    tell("the exact natural frequencies")
    exact = _exact_frequencies(with_model(net, shaft, COARSE))
    if not any(part.damping or part.friction for part in net.parts if isinstance(part, Shaft)):
        waves = with_model(net, shaft, Wave(3))
        tell("the exact motion, by travelling waves")
        with suppress(ParameterError):  # it is no train
            values, error = _by_characteristics(waves.netlist(), shaft, t_end, t)
            return Truth(values, exact, "characteristics", error)
        with suppress(ShaftworkError):  # such as a clearance at an end of a shaft where no inertia is
            return Truth(_read(waves, shaft, t_end, t), exact, "travelling waves", TIGHT)
    linear = with_model(net, shaft, COARSE).compile().linear
    degrees, rtol = ((FINE, FINER), TIGHT) if linear else (NONLINEAR, LOOSER)
    finer, gap, degree = dict[str, Array](), np.inf, 0
    for degree in degrees:
        tell(f"the motion with Spectral({degree}), which stands for the exact one")
        fine, finer = finer, _read(with_model(net, shaft, Spectral(degree)), shaft, t_end, t, rtol)
        gap = max((_apart(fine[name], finer[name]) for name in ("tau_a", "tau_b") if fine), default=np.inf)
        if gap <= ALIKE and not linear:
            break
    return Truth(finer, exact, f"Spectral({degree})", gap)


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


def _exact_frequencies(net: Network) -> Array:
    try:
        exact = frequencies(net.modes(exact=True))
    except ShaftworkError:
        return np.empty(0)
    return exact[: MODES + 1] if len(exact) > MODES else np.empty(0)


def _read(net: Network, shaft: str, t_end: float, t: Array, rtol: float = TIGHT) -> dict[str, Array]:
    return quantities(net.simulate(t_end, t_eval=t, rtol=rtol), net, shaft)


def _by_characteristics(netlist: Netlist, shaft: str, t_end: float, t: Array) -> tuple[dict[str, Array], float]:
    order, shafts = _train(netlist)
    sections = [_section(placed.part) for placed in shafts]
    line = SectionLine(
        tuple(sections),
        tuple(_total(netlist, node, Inertia, "J") for node in order),
        tuple(_total(netlist, node, Damper, "d") for node in order),
    )
    sources = [placed for placed in netlist.placed if isinstance(placed.part, TorqueSource)]
    junctions = motion(line, [_torque(placed, order) for placed in sources], t_end)
    number = next(k for k, placed in enumerate(shafts) if placed.part.name == shaft)
    middle = line.junctions[number] + line.sections[number].length / 2
    step = 1 if shafts[number].nodes[0] == order[number] else -1  # wired from left to right, or from right to left
    tau_a, tau_b = [step * junctions.torque_in(number, t, side) for side in ("left", "right")][::step]
    omega_a, omega_b = [junctions.junction_speed(k, t) for k in (number, number + 1)][::step]
    tau_mid = step * junctions.torque(middle, t)
    return dict(zip(QUANTITIES, (tau_a, tau_b, tau_mid, omega_a, omega_b), strict=True)), junctions.error


def _train(netlist: Netlist) -> tuple[list[str], list[Placed]]:
    """The nodes of a train from one end to the other, and the shafts between them."""
    shafts = [placed for placed in netlist.placed if isinstance(placed.part, Shaft)]
    kinds = (Inertia, Damper, TorqueSource, Shaft)
    if not shafts or not all(isinstance(placed.part, kinds) for placed in netlist.placed):
        raise ParameterError("The network is no train of inertias, shafts, bearings and torques.")
    joints = nx.MultiGraph()
    for placed in shafts:
        joints.add_edge(*placed.nodes, placed=placed)
    others = (placed.nodes for placed in netlist.placed if not isinstance(placed.part, Shaft))
    attached = all(len(nodes) == 1 and nodes[0] in joints for nodes in others)
    degrees = dict(joints.degree)
    if not nx.is_tree(joints) or max(degrees.values()) > 2 or REFERENCE in joints or not attached:
        raise ParameterError("The shafts are not in one row.")
    first, last = (node for node, degree in degrees.items() if degree == 1)
    order = nx.shortest_path(joints, first, last)
    return order, [joints.edges[a, b, 0]["placed"] for a, b in pairwise(order)]


def _section(part: Component) -> Section:
    if not isinstance(part, Shaft) or not isinstance(part.model, Wave) or part.damping or part.friction:
        raise ParameterError("Characteristics know neither losses along a shaft nor one that is rigid or one spring.")
    return Section.of_geometry(
        part.length, part.diameter, part.inner_diameter, density=part.density, shear_modulus=part.shear_modulus
    )


def _total(netlist: Netlist, node: str, kind: type, name: str) -> float:
    members = (placed.part for placed in netlist.placed if isinstance(placed.part, kind) and placed.nodes[0] == node)
    return float(sum(getattr(part, name) for part in members))


def _torque(placed: Placed, order: list[str]) -> JunctionTorque:
    law = as_expression(placed.part.tau)  # type: ignore[attr-defined]
    if not law.free_symbols <= {TIME}:
        raise ParameterError("A torque depends on more than time.")
    return JunctionTorque(order.index(placed.nodes[0]), function_of_time(law), breakpoints(law))


def function_of_time(law: Expr) -> Callable[[Array], Array]:
    """A law of time alone as a function of an array of times in s."""
    value = lambdify(TIME, law, modules=[NUMERICAL, "numpy"])
    return lambda t: np.broadcast_to(value(t), np.shape(t))
