"""What the frequency domain needs to know of a network near a point: matrices and quantities by name, no symbols."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from shaftwork.results.observer import Array

Complex = NDArray[np.complexfloating[Any, Any]]


class Slopes(Protocol):
    """x' = A x + B v + B1 v' in deviations of the states x and the inputs v from a point."""

    A: Any
    """(n, n), scipy.sparse.csr_array."""
    B: Array
    """(n, m)."""
    B1: Array
    """(n, m)."""
    weights: Array
    """(n,) factors with which the states have equal units."""
    states: tuple[str, ...]
    state_units: tuple[str, ...]
    angles: int
    """How many of the states, the last ones, are integrals of speeds (voltages)."""
    inputs: tuple[str, ...]

    @property
    def units(self) -> Mapping[str, str]:
        """Every quantity that can be read, "part.quantity" or "node.quantity", and its unit."""
        ...

    @property
    def profiles(self) -> Mapping[str, tuple[str, tuple[float, ...]]]:
        """Every quantity that can be read along a part: its unit and the places in m."""
        ...

    @property
    def nodes(self) -> Mapping[str, tuple[str, float]]:
        """The speed (voltage) of every node, "rotor.omega": its unit, and its place along the axis of a picture."""
        ...

    @property
    def masses(self) -> tuple[tuple[str, str], ...]:
        """(part, speed of its node) for every inertia, mass and capacitor, also those that are no states."""
        ...

    def motion(self, x: Complex, v: Complex, v_rate: Complex) -> Callable[[str], Complex]:
        """From deviations (n, k), (m, k), (m, k) a function from a name to the quantity's deviation, (k,)."""
        ...
