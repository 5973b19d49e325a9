"""How far the discs of a drive train have turned, as it is shown: slowed down, with enlarged twists."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_simpson
from scipy.sparse.csgraph import connected_components

from shaftwork.core.errors import ParameterError
from shaftwork.results.observer import Array, Reader

SAMPLES = 20
"""Of a speed, from which its angle is integrated, for each picture and each step of the engine."""
FASTEST = np.pi
"""Of what is shown, rad/s: half a turn per second can be followed by eye."""
TWIST = np.pi / 6
"""Largest twist as shown, rad."""


@dataclass(frozen=True, eq=False)
class Turning:
    """Angles of discs over time.

    Args:
        times: (k,) s.
        discs: n names of the nodes that rotate, or of parts there, in the order of the network.
        angles: (k, n) as shown, rad.
        joints: pairs of discs that something twists between, with the quantity that is its torque.
        slowed: by which turning is slower than it is.
        enlarged: by which twists are larger than they are.
    """

    times: Array
    discs: tuple[str, ...]
    angles: Array
    joints: tuple[tuple[int, int, str], ...]
    slowed: float
    enlarged: float


def turning(reader: Reader, times: Array, shown_seconds: float) -> Turning:
    """The angles of all discs of a motion.

    Law: discs that shafts and springs join turn together by the mean of their angles, divided by `slowed`, and differ
    from it by `enlarged` times what they truly do.

    Args:
        reader: of the motion.
        times: (k,) of the pictures, s.
        shown_seconds: how long they are shown.

    Raises:
        ParameterError: nothing in the network rotates.
    """
    units, nodes_of = reader.observer.units, reader.observer.nodes_of
    discs: dict[str, str] = {}  # node to part
    shafts = {name.rpartition(".")[0] for name in reader.observer.profiles}  # long ones, with nodes inside
    for name in units:
        part, _, quantity = name.rpartition(".")
        ends = nodes_of(name)
        if quantity == "omega" and len(ends) == 1 and ends[0].rpartition(".")[0] not in shafts:
            discs.setdefault(ends[0], part)
    if not discs:
        raise ParameterError(f"Nothing in '{reader.title}' rotates, so there are no discs to show.")
    places = {node: number for number, node in enumerate(discs)}
    joints = []
    for name in units:
        part, _, quantity = name.rpartition(".")
        ends = nodes_of(name)
        if quantity not in ("phi_rel", "tau_a") or (quantity == "tau_a") != (part in shafts):
            continue
        if len(ends) == 1:  # a long shaft's torque at an end is read there
            ends = (*ends, *nodes_of(f"{part}.tau_b"))
        if len(ends) == 2 and all(node in places for node in ends):
            joints.append((places[ends[0]], places[ends[1]], name if part in shafts else f"{part}.tau"))
    true = np.column_stack([_angle(reader, f"{part}.omega", times) for part in discs.values()])
    joined = np.zeros((len(discs), len(discs)), dtype=bool)
    for a, b, _ in joints:
        joined[a, b] = True
    count, groups = connected_components(joined, directed=False)
    mean = np.empty_like(true)
    for group in range(count):
        members = groups == group
        mean[:, members] = true[:, members].mean(axis=1, keepdims=True)
    twist = float(np.abs(true - mean).max())
    fastest = float(np.abs(np.diff(mean, axis=0)).max() / (shown_seconds / len(times)))
    slowed, enlarged = max(1.0, fastest / FASTEST), TWIST / twist if twist else 1.0
    return Turning(
        times, tuple(discs.values()), mean / slowed + enlarged * (true - mean), tuple(joints), slowed, enlarged
    )


def _angle(reader: Reader, name: str, times: Array) -> Array:
    """(k,) the integral of a speed up to each picture."""
    fine = np.unique(np.concatenate([np.linspace(times[0], times[-1], SAMPLES * len(times)), reader.steps]))
    fine = fine[(fine >= times[0]) & (fine <= times[-1])]
    angle: Array = np.interp(times, fine, cumulative_simpson(reader.quantity(name)(fine), x=fine, initial=0.0))
    return angle
