"""Digging torque of a bucket wheel by the algorithm of 6 steps of Marinkovic 2012, 2.2.3, bucket by bucket."""

from __future__ import annotations

import math
from collections.abc import Callable


def profile(psi: float, alpha: float) -> float:
    """Cut of a bucket at its own angle: (11)."""
    if psi <= math.pi / 2:
        return math.sin(psi)
    if psi <= alpha:
        return (alpha - psi) / (alpha - math.pi / 2)
    return 0.0


def torque(
    phi: float, *, buckets: int, radius: float, edge: float, alpha: float, resistance: Callable[[int], float]
) -> float:
    """Size of the torque in N m at an angle in rad.

    Args:
        phi: angle of the wheel; at zero, bucket 0 comes into the soil.
        buckets: number of buckets.
        radius: of the cutting edges, m.
        edge: mean length of the cutting edges in the soil, m (step 1).
        alpha: angle at which a bucket leaves the soil, rad.
        resistance: from the number of a bucket pass to its specific cutting resistance, N/m (step 4).
    """
    force = 0.0
    for bucket in range(buckets):
        angle = phi - 2 * math.pi * bucket / buckets  # step 2
        turn = math.floor(angle / (2 * math.pi))
        psi = angle - 2 * math.pi * turn  # step 3
        force += resistance(turn * buckets + bucket) * edge * profile(psi, alpha)  # steps 5 and 6, (10)
    return force * radius  # (9)
