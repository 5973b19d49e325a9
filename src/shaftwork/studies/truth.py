"""What a shaft of a network really does: the exact solution that its models are compared with."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from sympy import lambdify

from shaftwork.components.base import Component
from shaftwork.components.laws import NUMERICAL, as_expression, breakpoints
from shaftwork.components.laws import t as TIME
from shaftwork.components.rotation import Damper, Inertia
from shaftwork.components.shaft_models import ShaftModel, Spectral, Wave
from shaftwork.components.shafts import Shaft
from shaftwork.components.sources import TorqueSource
from shaftwork.core.errors import ParameterError
from shaftwork.network.netlist import REFERENCE, Netlist, Placed
from shaftwork.pipeline.network import Network
from shaftwork.results.observer import Array
from shaftwork.results.solution import Solution
from shaftwork.shafts.exact_modes import natural_frequencies
from shaftwork.shafts.exact_motion import Torque, motion
from shaftwork.shafts.line import Line, Section

QUANTITIES = ("tau_a", "tau_b", "tau_mid", "omega_a", "omega_b")
"""What is compared: torque at both ends and in the middle, speed of both ends."""
FINE, FINER = 48, 64
"""Degrees of two spectral models whose difference says how well the finer one stands for the truth."""
TIGHT = 1e-11
"""Tolerance of runs that stand for the truth."""


@dataclass(frozen=True)
class Truth:
    """The exact motion of one shaft.

    Args:
        values: (k,) of each of `QUANTITIES` at the times asked for.
        frequencies: lowest natural frequencies of the train in Hz, rigid motion left out; empty where unknown.
        source: where it comes from, a few words.
        error: estimate of its own error, relative to the largest torque.
    """

    values: Mapping[str, Array]
    frequencies: Array
    source: str
    error: float


def with_model(net: Network, shaft: str, model: ShaftModel) -> Network:
    """The same network with another model of one shaft, or of all where `shaft` is empty."""
    made = Network(net.name)
    for placed in net.netlist().placed:
        part = placed.part
        if isinstance(part, Shaft) and shaft in ("", part.name):
            part = dataclasses.replace(part, model=model)
        made.add(part, *placed.nodes)
    return made


def truth(net: Network, shaft: str, t_end: float, t: Array) -> Truth:
    """The exact motion of a shaft.

    A train of inertias, lossless shafts, bearings and torques of time is solved by characteristics; another network
    without internal damping by travelling waves; one with damping by a spectral model of high degree.
    """
    shafts = [part for part in net.parts if isinstance(part, Shaft)]
    try:
        return _by_characteristics(net.netlist(), shaft, t_end, t)
    except ParameterError:
        pass
    if not any(part.damping or part.friction for part in shafts):
        found = _read(with_model(net, "", Wave(3)), shaft, t_end, t)
        return Truth(found, np.empty(0), "travelling waves", TIGHT)
    fine, finer = (_read(with_model(net, "", Spectral(n)), shaft, t_end, t) for n in (FINE, FINER))
    gap = max(np.abs(fine[name] - finer[name]).max() / np.abs(finer[name]).max() for name in ("tau_a", "tau_b"))
    return Truth(finer, np.empty(0), f"Spectral({FINER})", float(gap))


def quantities(solution: Solution, shaft: str) -> dict[str, Array]:
    """The compared quantities of a solution; the torque in the middle between the two places next to it."""
    places, torques = solution.places[f"{shaft}.tau"], solution[f"{shaft}.tau"]
    middle = places[-1] / 2
    after = int(np.clip(np.searchsorted(places, middle), 1, len(places) - 1))
    share = (middle - places[after - 1]) / (places[after] - places[after - 1])
    made = {name: solution[f"{shaft}.{name}"] for name in QUANTITIES if name != "tau_mid"}
    return made | {"tau_mid": (1 - share) * torques[:, after - 1] + share * torques[:, after]}


def _read(net: Network, shaft: str, t_end: float, t: Array) -> dict[str, Array]:
    return quantities(net.simulate(t_end, t_eval=t, rtol=TIGHT), shaft)


def _by_characteristics(netlist: Netlist, shaft: str, t_end: float, t: Array) -> Truth:
    order, shafts = _train(netlist)
    sections = [_section(placed.part) for placed in shafts]
    line = Line(
        tuple(sections),
        tuple(_total(netlist, node, Inertia, "J") for node in order),
        tuple(_total(netlist, node, Damper, "d") for node in order),
    )
    sources = [placed for placed in netlist.placed if isinstance(placed.part, TorqueSource)]
    found = motion(line, [_torque(placed, order) for placed in sources], t_end)
    number = next(k for k, placed in enumerate(shafts) if placed.part.name == shaft)
    left, right = number, number + 1
    middle = line.junctions[number] + line.sections[number].length / 2
    torques = [found.torque_in(number, t, "left"), found.torque_in(number, t, "right")]
    speeds = [found.junction_speed(left, t), found.junction_speed(right, t)]
    sign = 1.0
    if shafts[number].nodes[0] != order[number]:  # wired from right to left
        sign, torques, speeds = -1.0, torques[::-1], speeds[::-1]
    values = dict(
        zip(("tau_a", "tau_b", "omega_a", "omega_b"), (*(sign * tau for tau in torques), *speeds), strict=True)
    )
    values["tau_mid"] = sign * found.torque(middle, t)
    frequencies = natural_frequencies(line.without_losses(), 5)
    return Truth(values, frequencies[frequencies > 0][:4], "characteristics", found.error)


def _train(netlist: Netlist) -> tuple[list[str], list[Placed]]:
    """The nodes of a train from one end to the other, and the shafts between them."""
    shafts = [placed for placed in netlist.placed if isinstance(placed.part, Shaft)]
    known = (Inertia, Damper, TorqueSource, Shaft)
    if not shafts or not all(isinstance(placed.part, known) for placed in netlist.placed):
        raise ParameterError("The network is no train of inertias, shafts, bearings and torques.")
    at: dict[str, list[Placed]] = {}
    for placed in shafts:
        for node in placed.nodes:
            at.setdefault(node, []).append(placed)
    ends = [node for node, members in at.items() if len(members) == 1]
    one_ended = (placed.nodes for placed in netlist.placed if not isinstance(placed.part, Shaft))
    attached = all(len(nodes) == 1 and nodes[0] in at for nodes in one_ended)
    if len(ends) != 2 or max(map(len, at.values())) > 2 or REFERENCE in at or not attached:
        raise ParameterError("The shafts are not in one row.")
    order = [ends[0]]
    row: list[Placed] = []
    while len(row) < len(shafts):
        row.append(next(placed for placed in at[order[-1]] if placed not in row))
        order.append(next(node for node in row[-1].nodes if node != order[-1]))
    return order, row


def _section(part: Component) -> Section:
    if not isinstance(part, Shaft) or part.damping or part.friction:
        raise ParameterError("Characteristics know no losses along the shaft.")
    return Section.of_geometry(
        part.length, part.diameter, part.inner_diameter, density=part.density, shear_modulus=part.shear_modulus
    )


def _total(netlist: Netlist, node: str, kind: type, name: str) -> float:
    members = (placed.part for placed in netlist.placed if isinstance(placed.part, kind) and placed.nodes[0] == node)
    return float(sum(getattr(part, name) for part in members))


def _torque(placed: Placed, order: list[str]) -> Torque:
    law = as_expression(placed.part.tau)  # type: ignore[attr-defined]
    if not law.free_symbols <= {TIME}:
        raise ParameterError("A torque depends on more than time.")
    value = lambdify(TIME, law, modules=[NUMERICAL, "numpy"])
    return Torque(order.index(placed.nodes[0]), lambda t: np.broadcast_to(value(t), np.shape(t)), breakpoints(law))
