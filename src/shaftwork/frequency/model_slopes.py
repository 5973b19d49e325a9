"""What the frequency domain needs to know of a network near a point: matrices and quantities by name, no symbols."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from shaftwork.results.observer import Array

Complex = NDArray[np.complexfloating[Any, Any]]


class Motions(Protocol):
    """Small motions about a point, and a way to read every quantity of them."""

    @property
    def states(self) -> tuple[str, ...]:
        """What a motion is told by: n names."""
        ...

    @property
    def state_units(self) -> tuple[str, ...]:
        """(n,)."""
        ...

    @property
    def weights(self) -> Array:
        """(n,) factors with which the states have equal units."""
        ...

    @property
    def inputs(self) -> tuple[str, ...]:
        """m names."""
        ...

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

    def swinging(self, s: Complex, x: Complex, v: Complex) -> Callable[[str], Complex]:
        """From motions that go as exp(s t), by s (k,), states (n, k) and inputs (m, k), a function from a name to the
        quantity's complex amplitude, (k,) or along a part (k, places).
        """
        ...


class DeviationEquations(Motions, Protocol):
    """x' = A x + B v + B1 v' in deviations of the states x and the inputs v from a point."""

    A: Any
    """(n, n), scipy.sparse.csr_array."""
    B: Array
    """(n, m)."""
    B1: Array
    """(n, m)."""
    angles: int
    """How many of the states, the last ones, are integrals of speeds (voltages)."""

    def motion(self, x: Complex, v: Complex, v_rate: Complex) -> Callable[[str], Complex]:
        """From deviations (n, k), (m, k), (m, k) a function from a name to the quantity's deviation, (k,)."""
        ...


class OpenSlopes(DeviationEquations, Protocol):
    """A network whose lines are taken out: what arrives at their ends, h, follows the inputs in v.

    The speeds of the ends, the two of each line in a row, are C x + D v.
    """

    C: Any
    """(q, n), scipy.sparse.csr_array."""
    D: Array
    """(q, m + q)."""
