"""What a solution needs to know of its model: plain arrays by name, no symbols."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from shaftwork.core.parameters import numbers_in_si

Array = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]

RPM = 30 / np.pi
"""1/min of a rad/s."""
AT_ONCE = 4_000_000
"""Numbers that are read of a motion at once, 32 MB."""


def blocks(count: int, width: int) -> Iterator[slice]:
    """Places 0 to `count` in blocks, of as many as are read at once where each holds `width` numbers; at least one."""
    rows = max(1, AT_ONCE // max(1, width))
    return (slice(first, min(first + rows, count)) for first in range(0, max(count, 1), rows))


def array_in_si(name: str, values: Any, unit: str) -> Array:
    """(k,) numbers that a user gave, in SI; empty where they are no list of numbers.

    Raises:
        ParameterError: they have the unit of something else.
    """
    plain = numbers_in_si(name, values, unit)
    try:
        array = np.atleast_1d(np.asarray(plain, dtype=float))
    except (TypeError, ValueError):
        return np.empty(0)
    return array if array.ndim == 1 else np.empty(0)


class PhaseRow(NamedTuple):
    """A phase of a motion.

    Args:
        start: s.
        end: s.
        modes: of every part that changes its mode, in words.
    """

    start: float
    end: float
    modes: Mapping[str, str]

    @property
    def name(self) -> str:
        """In words, "gap open, brake locked"."""
        return ", ".join(f"{part} {mode}" for part, mode in self.modes.items())


class Observer(Protocol):
    """Recovers quantities of parts and nodes from states."""

    @property
    def units(self) -> Mapping[str, str]:
        """Every quantity that can be read, "part.quantity" or "node.quantity", and its unit."""
        ...

    def signal(self, name: str, t: Array, x: Array, dense: DenseStates) -> Array:
        """(k,) a quantity at times t (k,) with states x (k, n), with the motion behind them."""
        ...

    @property
    def profiles(self) -> Mapping[str, tuple[str, tuple[float, ...]]]:
        """Every quantity that can be read along a part, "part.quantity": its unit and the places in m."""
        ...

    def profile(self, name: str, t: Array, x: Array, dense: DenseStates) -> Array:
        """(k, places) a quantity along a part at times t (k,) with states x (k, n), with the motion behind them."""
        ...

    def impacts(self, dense: DenseStates) -> Sequence[tuple[float, str, Mapping[str, float], Mapping[str, float]]]:
        """Times in s at which energy may be given or lost at once.

        Of each the part that is hit, if any, what sources give then and what others lose of it, in J by part.
        """
        ...

    def stored(self, t: Array, x: Array, dense: DenseStates) -> dict[str, Array]:
        """By part, stored energy in J at times t (k,) with states x (k, n), with the motion behind them.

        Of a time that is listed twice in a row the first is before whatever jumps there.
        """
        ...

    def powers(self, t: Array, x: Array) -> tuple[dict[str, Array], dict[str, Array]]:
        """By part, at times t (k,) with states x (k, n): lost power in W, supplied power in W."""
        ...

    def held(self, t: float, x: Array) -> dict[str, float]:
        """All that is stored at a time in s with the states (n,), by name: speeds, torques of springs, angles."""
        ...

    def read_at(self, t: float) -> float:
        """When inputs are read at a time in s: after what jumps there, or at the end of a run before it."""
        ...

    def modes_at(self, t: float) -> dict[str, str]:
        """The mode of every element that changes its mode, at a time in s."""
        ...

    @property
    def wiring(self) -> Mapping[str, str]:
        """By part, what it is, where it is, and what is no number of it."""
        ...

    def nodes_of(self, name: str) -> tuple[str, ...]:
        """The moving nodes that a torque or speed is of, by its name in `units`; none for other quantities."""
        ...

    def part(self, name: str) -> Any:
        """A component of the network, with the parameter values of this motion."""
        ...


class DenseStates(Protocol):
    """The states between the output times."""

    @property
    def steps(self) -> Array:
        """(s,) ends of the integration steps; between two of them the states are smooth."""
        ...

    def __call__(self, times: Array) -> Array:
        """(k, n) states at times (k,)."""
        ...
