"""A chain by the modes of its pieces instead of groups: the frequencies that so few unknowns can have."""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh

from shaftwork.reduce.chain import Array, Chain, hertz, matrices_of


def truncated_frequencies(chain: Chain, unknowns: int, kept: int) -> Array:
    """Natural frequencies of a chain described by the ends of one link and the lowest modes of what is beyond them.

    Law: x = (ends, -K_ii^-1 K_ib ends + Phi q) with Phi the modes of the rest while both ends are held. Every frequency
    is an upper bound. With two unknowns it is the model of two groups, if nothing holds the rest to the frame.

    Args:
        chain: stations with inertia.
        unknowns: the number of ends and modes together, 2 or more.
        kept: place of the link.

    Returns:
        (unknowns,) frequencies in Hz, ascending, 0 for the turning of the whole.

    Source: Craig and Bampton, Coupling of substructures for dynamic analyses, AIAA Journal 6(7), 1968.
    """
    inertias, stiffness = matrices_of(chain)
    ends = [kept, kept + 1]
    rest = [k for k in range(len(inertias)) if k not in ends]
    inner = stiffness[np.ix_(rest, rest)]
    _, shapes = eigh(inner, np.diag(inertias[rest])) if rest else (None, np.zeros((0, 0)))
    basis = np.zeros((len(inertias), unknowns))
    basis[ends] = np.eye(2, unknowns)
    if rest:
        basis[np.ix_(rest, [0, 1])] = -np.linalg.solve(inner, stiffness[np.ix_(rest, ends)])
        basis[np.ix_(rest, range(2, unknowns))] = shapes[:, : unknowns - 2]
    squares = eigh(basis.T @ stiffness @ basis, basis.T @ (inertias[:, None] * basis), eigvals_only=True)
    return hertz(squares, chain)
