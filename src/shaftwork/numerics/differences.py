"""Derivatives by differences, where nothing better is known."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import numpy as np

from shaftwork.core.errors import ShaftworkError, SimulationError
from shaftwork.numerics.polynomials import Array


def differences(values: Callable[[Array], Array], at: Array, steps: Array) -> Array:
    """(k, m) derivatives of values (k,) by m numbers: central ones; one-sided where a side has no values.

    Args:
        values: of the numbers (m,); raises a `ShaftworkError` where there are none.
        at: (m,) the numbers.
        steps: (m,) lengths.

    Raises:
        SimulationError: there are no values on either side.
    """
    columns = []
    for shift in np.diag(steps):
        sides = dict[float, Array]()
        for sign in (1.0, -1.0):
            with suppress(ShaftworkError):
                sides[sign] = values(at + sign * shift)
        if not sides:
            raise SimulationError("There are no values beside a point, by which to find a derivative there.")
        if len(sides) < 2:
            sides.setdefault(1.0 if -1.0 in sides else -1.0, values(at))
            columns.append((sides[1.0] - sides[-1.0]) / shift.sum())
        else:
            columns.append((sides[1.0] - sides[-1.0]) / (2 * shift.sum()))
    return np.array(columns).T
