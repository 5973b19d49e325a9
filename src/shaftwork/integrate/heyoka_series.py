"""Whether a Taylor series satisfies the equations that it is of."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from shaftwork.integrate.pieces import SmoothInterval
from shaftwork.integrate.problem import Array, Problem

DEFECT = 1e-8
"""Part of what a state moves by which its slope may differ from its rate within a step."""
Rates = Callable[[float, Array], Array]


def satisfied(
    problem: Problem,
    rhs: Rates,
    piece: SmoothInterval,
    terms: Array,
    start: float,
    elapsed: float,
    sizes: Array | float,
) -> bool:
    """Whether a series (n, orders) from a start in s satisfies equations after some time; `sizes` are of states."""
    orders = np.arange(terms.shape[1])
    powers = elapsed**orders
    state, change = terms @ powers, terms @ (orders * powers)  # what it is, and by how much its slope would move it
    with np.errstate(all="ignore"):
        defect = np.abs(np.multiply(elapsed, rhs(piece.inside(start + elapsed), state)) - change)
    moved = np.maximum(np.abs(state), sizes) + np.abs(change)
    return bool((defect <= DEFECT * moved + problem.atol).all())
