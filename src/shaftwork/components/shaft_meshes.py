"""Where the speeds and torques of a shaft's model stand, and the weights that join them.

Every model but the wave is the same construction. The speeds omega_j stand at nodes x_j, each with a share of the
shaft's inertia; the torques tau_k stand at stations y_k, each with a share of its length and so of its compliance. One
matrix of weights w joins them, in both equations:

    d(tau_k)/dt / (C' / l_k) = sum_j w_kj omega_j,     J' h_j d(omega_j)/dt = - sum_k w_kj tau_k + torque at the ends.

Because it is the same matrix, the energy of the shaft changes by the powers at its two ends and by nothing else,
whatever the weights are. Internal damping only takes energy: a damper stands beside each torque, or between each two
neighbouring speeds.
"""

from __future__ import annotations

from dataclasses import dataclass

Row = tuple[tuple[int, float], ...]


@dataclass(frozen=True, eq=False)
class Mesh:
    """A shaft as speeds at nodes and torques at stations.

    Args:
        intervals: how many times the unit of all lengths goes into the shaft; 1 where its elements are unequal: then
            the unit is the whole shaft.
        nodes: (n,) places of the speeds, from 0 to 1.
        inertias: (n,) the length whose inertia is at each; they sum to `intervals`, less what a closure leaves out.
        stations: (k,) places of the torques, from 0 to 1.
        lengths: (k,) the length whose compliance is that of each; they sum to `intervals`.
        weights: for each torque the nodes and factors that its rate of twist is the sum of.
        dampers: (n - 1,) length of the damper between each two neighbouring speeds, where torque k stands at node k;
            empty where a damper stands beside each torque, with its length.
        first: number of the first torque.
    """

    intervals: int
    nodes: tuple[float, ...]
    inertias: tuple[float, ...]
    stations: tuple[float, ...]
    lengths: tuple[float, ...]
    weights: tuple[Row, ...]
    dampers: tuple[float, ...] = ()
    first: int = 0


SUMMATION_BY_PARTS = {
    2: (((-1, -1 / 2), (1, 1 / 2)), (1 / 2,), ((-1 / 2, 1 / 2),)),
    4: (
        ((-2, 1 / 12), (-1, -2 / 3), (1, 2 / 3), (2, -1 / 12)),
        (17 / 48, 59 / 48, 43 / 48, 49 / 48),
        (
            (-1 / 2, 59 / 96, -1 / 12, -1 / 32),
            (-59 / 96, 0.0, 59 / 96),
            (1 / 12, -59 / 96, 0.0, 59 / 96, -1 / 12),
            (1 / 32, 0.0, -59 / 96, 0.0, 2 / 3, -1 / 12),
        ),
    ),
}
"""By order: the stencil inside as (offset, factor), the norm and the first rows at an end, times the interval.

Source: Strand 1994.
"""


def central(m: int, nodes: tuple[float, ...], dampers: tuple[float, ...], order: int) -> Mesh:
    """Speeds and torques at the same nodes, closed by summation by parts."""
    inside, norm, rows = SUMMATION_BY_PARTS[order]
    shares = [1.0] * (m + 1)
    shares[: len(norm)], shares[m + 1 - len(norm) :] = norm, norm[::-1]
    weights = []
    for k in range(m + 1):
        if k < len(rows):
            row = [(j, -q) for j, q in enumerate(rows[k])]
        elif k > m - len(rows):
            row = [(m - j, q) for j, q in enumerate(rows[m - k])][::-1]
        else:
            row = [(k + offset, -q) for offset, q in inside]
        weights.append(tuple((j, weight) for j, weight in row if weight))
    return Mesh(m, nodes, tuple(shares), nodes, tuple(shares), tuple(weights), dampers)


def central_as_printed(m: int, nodes: tuple[float, ...], dampers: tuple[float, ...]) -> Mesh:
    """Torques at the m - 1 nodes between the ends, whose speeds have no inertia of the shaft.

    The rows of the first and last torque are those that make, transposed, the equations of the speeds as printed.
    """
    inside = (((k - 1, 0.5), (k + 1, -0.5)) for k in range(2, m - 1))
    return Mesh(
        intervals=m,
        nodes=nodes,
        inertias=(0.0, *[1.0] * (m - 1), 0.0),
        stations=nodes[1:-1],
        lengths=(1.5, *[1.0] * (m - 3), 1.5),
        weights=(((0, 1.0), (1, -0.5), (2, -0.5)), *inside, ((m - 2, 0.5), (m - 1, 0.5), (m, -1.0))),
        dampers=dampers,
        first=1,
    )
