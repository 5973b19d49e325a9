"""Derivatives by differences, where nothing better is known."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import numpy as np

from shaftwork.core.errors import ShaftworkError, SimulationError
from shaftwork.numerics.polynomials import Array


def differences(
    values: Callable[[Array], Array],
    at: Array,
    steps: Array,
    low: Array | float = -np.inf,
    high: Array | float = np.inf,
) -> Array:
    """(k, m) derivatives of values (k,) by m numbers: central ones; one-sided where a side has no values.

    Args:
        values: of the numbers (m,); raises a `ShaftworkError` where there are none.
        at: (m,) the numbers.
        steps: (m,) lengths.
        low: (m,) below which no values are asked.
        high: (m,) above which none are.

    Raises:
        SimulationError: there are no values on either side.
    """
    columns = []
    for k, shift in enumerate(np.diag(steps)):
        sides = list[tuple[float, Array]]()
        for side in (np.clip(at + shift, low, high), np.clip(at - shift, low, high)):
            if side[k] != at[k]:
                with suppress(ShaftworkError):
                    sides.append((side[k], values(side)))
        if not sides:
            raise SimulationError("There are no values beside a point, by which to find a derivative there.")
        if len(sides) < 2:
            sides.append((at[k], values(at)))
        (first, above), (second, below) = sides
        columns.append((above - below) / (first - second))
    return np.array(columns).T
