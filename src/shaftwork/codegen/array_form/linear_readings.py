"""How quantities follow from states, from what sources prescribe, and from laws and accelerations."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array, Factor, blocks
from shaftwork.codegen.array_form.recovery import BranchHistory, GivenHistory
from shaftwork.numerics.tolerances import GOLDEN, SAME

Read = Callable[[BranchHistory], Array]


@dataclass(frozen=True)
class LinearQuantity:
    """A quantity that is linear in states, inputs and rates.

    Args:
        name: "part.quantity" or "node.quantity".
        is_across: whether it is a speed (velocity, voltage), and no torque (force, current).
        read: takes it from all branch quantities.
    """

    name: str
    is_across: bool
    read: Read


@dataclass(frozen=True)
class LinearRow:
    """How a quantity follows from the states.

    Args:
        by_state: (n,) its slopes by the states.
        prescribed: what sources of time alone add to it.
        moved: whether it follows from laws of the motion or from accelerations, too.
    """

    by_state: Array
    prescribed: float
    moved: bool


class ReadingMatrices:
    """Quantities as matrices of states and inputs, for who reads them again and again, at few times at once.

    Law: q = X x + U u + R x' + S u', with the inputs and rates that go with the states.

    Args:
        bound: the array program.
        reads: take each quantity from all branch quantities.
    """

    def __init__(self, bound: BoundArrays, reads: Sequence[Read]) -> None:
        states, inputs = len(bound.program.form.states), bound.part.B.shape[1]
        self._sizes = states, inputs, inputs, states
        self._matrices = [
            Factor(sparse.hstack([sparse.csr_array(np.array([read(one) for read in reads])) for one in histories]))
            for histories in (self._unit_histories(bound, place) for place in range(4))
        ]

    def _unit_histories(self, bound: BoundArrays, place: int) -> Iterator[GivenHistory]:
        """One column for each of what is given at a place: states, inputs, rates of inputs, rates of states."""
        for one in _units(bound, self._sizes[place]):
            yield GivenHistory(
                bound, *(one if k == place else np.zeros((size, one.shape[1])) for k, size in enumerate(self._sizes))
            )

    def __call__(self, history: BranchHistory) -> Array:
        """(quantities, k) the quantities along a history."""
        by_state, by_input, by_slope, by_rate = self._matrices
        read = by_state @ history.x[: self._sizes[0]] + by_input @ history.values[1]
        if not (by_rate.is_zero and by_slope.is_zero):
            _, slopes, rate = history.inputs
            read = read + by_rate @ rate + by_slope @ slopes
        return read


def _units(bound: BoundArrays, size: int) -> Iterator[Array]:
    """The columns of a unit matrix, in blocks of which all branch quantities may be made at once."""
    return (np.eye(size)[:, block] for block in blocks(size, len(bound.program.form.graph.branches)))


@dataclass(frozen=True)
class GivenSpeeds:
    """Which speeds start values give, by themselves or together with sources.

    Args:
        states: four columns: the given states; the changes of all states from rest; any numbers for the given states
            and the sources behind given speeds; any numbers for all other states.
        others: three columns: what sources prescribe; any numbers for laws, and for accelerations.
    """

    states: BranchHistory
    others: BranchHistory

    def of(self, read: Read, rest: Any = 0.0) -> Array:
        """Speeds: as they are where they follow from start values and sources alone, else at rest.

        What rests is moved by given speeds all the same: the carrier of a planetary gear by that of its ring.

        Args:
            read: takes the speeds from all branch quantities.
            rest: what they are at rest.
        """
        states, others = read(self.states), read(self.others)
        follows = _is_nothing(states, self.states)[..., 3] & _is_nothing(others, self.others)[..., 1:].all(axis=-1)
        return np.where(follows, states[..., 0] + others[..., 0], rest + states[..., 1])

    def left(self, read: Read) -> Any:
        """Whether speeds are at rest for want of start values."""
        return ~_is_nothing(read(self.states), self.states)[..., 3] & (self.of(read) == 0)

    def move(self, read: Read) -> Any:
        """Whether start values have a part in speeds."""
        return ~_is_nothing(read(self.states), self.states)[..., 2]

    @cached_property
    def _at_nodes(self) -> tuple[Array, Any]:
        return self.of(lambda history: history.potentials), self.move(lambda history: history.potentials)

    def at_ends(self, first: int, last: int) -> tuple[float, float]:
        """The speeds in rad/s at the first and the last node of a shaft, between which those along it run.

        A speed that start values and sources give counts as it is. What a source has jolted at the start is at rest
        here: that has not yet run along the shaft. Of a shaft with no given speed at either end both are at rest.
        """
        speeds, are_given = self._at_nodes
        if not (are_given[first] or are_given[last]):
            return 0.0, 0.0
        return float(speeds[first]), float(speeds[last])


def _is_nothing(speeds: Array, history: BranchHistory) -> Any:
    """Whether speeds are rounding beside the largest one of their column."""
    return np.abs(speeds) <= SAME * np.abs(history.across).max(axis=0, initial=0.0)


def _any_numbers(count: int) -> Array:
    """Numbers of like size, no two alike."""
    return np.asarray(0.5 + np.arange(1, count + 1) * GOLDEN % 1)


class LinearReadings:
    """The rows of quantities.

    Args:
        bound: the array program.
        t: time at which sources are read, s.
    """

    def __init__(self, bound: BoundArrays, t: float) -> None:
        self._bound = bound
        self._size = len(bound.program.form.states)
        self._prescribed = bound.sources(t)

    def rows(self, quantities: Sequence[LinearQuantity]) -> list[LinearRow]:
        """How each quantity follows from the states."""
        if not quantities:
            return []
        by_state = np.hstack([self._values(quantities, columns) for columns in self._by_states(moving=False)])
        others = self._others()
        values = self._values(quantities, others)
        largest = {True: np.abs(others.across), False: np.abs(others.through)}
        sizes = np.array([largest[q.is_across].max(axis=0, initial=0.0) for q in quantities])
        moved: Any = (np.abs(values) - SAME * sizes)[:, 1:].max(axis=1) > 0
        return [LinearRow(by_state[k], float(values[k, 0]), bool(moved[k])) for k in range(len(quantities))]

    def states_behind(self, quantities: Sequence[LinearQuantity]) -> list[int]:
        """The states on which quantities depend, by way of rates as well."""
        if not quantities:
            return []
        values = np.hstack([self._values(quantities, columns) for columns in self._by_states(moving=True)])
        size = np.abs(values).max(axis=1, keepdims=True, initial=0.0)
        return [int(k) for k in np.flatnonzero((np.abs(values) > SAME * size).any(axis=0))]

    def given_speeds(self, x: Array, rest: Array, is_given: Any, prescribed: Sequence[LinearQuantity]) -> GivenSpeeds:
        """Which speeds start values give.

        Args:
            x: (n,) states.
            rest: (n,) the states at rest.
            is_given: (n,) which of the states the start values have set.
            prescribed: those start values that sources of time have a part in.
        """
        anything = _any_numbers(self._size)
        states = np.stack([is_given * x, x - rest, is_given * anything, ~is_given * anything], axis=1)
        u, zero = np.zeros((self._prescribed.size, 4)), np.zeros_like(states)
        u[:, 2] = self._are_behind(prescribed) * _any_numbers(self._prescribed.size)
        return GivenSpeeds(GivenHistory(self._bound, states, u, np.zeros_like(u), zero), self._others())

    def _are_behind(self, quantities: Sequence[LinearQuantity]) -> Any:
        """(m,) which of the inputs are sources of time that have a part in quantities."""
        sources = np.flatnonzero(self._bound.program.inputs.of_time)
        behind = np.zeros(self._prescribed.size, dtype=bool)
        if quantities:
            u, x = np.eye(self._prescribed.size)[:, sources], np.zeros((self._size, sources.size))
            values = self._values(quantities, GivenHistory(self._bound, x, u, np.zeros_like(u), x))
            behind[sources] = (values != 0).any(axis=0)
        return behind

    def _values(self, quantities: Sequence[LinearQuantity], columns: GivenHistory) -> Array:
        return np.array([quantity.read(columns) for quantity in quantities])

    def _by_states(self, *, moving: bool) -> list[GivenHistory]:
        """One column for each state, in blocks; with the rates that the states alone cause where they move."""
        bound, histories = self._bound, list[GivenHistory]()
        for x in _units(bound, self._size):
            zero = np.zeros((self._prescribed.size, x.shape[1]))
            histories.append(GivenHistory(bound, x, zero, zero, bound.part.A @ x if moving else np.zeros_like(x)))
        return histories

    def _others(self) -> GivenHistory:
        """Three columns: what sources prescribe, laws, accelerations; of the last two any numbers."""
        of_time, size = self._bound.program.inputs.of_time, self._size
        any_input, any_rate = _any_numbers(of_time.size), _any_numbers(size)
        zero, still = np.zeros(of_time.size), np.zeros(size)
        u = np.stack([self._prescribed, np.where(of_time, 0.0, any_input), zero], axis=1)
        rate = np.stack([still, still, any_rate], axis=1)
        return GivenHistory(self._bound, np.zeros((size, 3)), u, np.stack([zero, zero, any_input], axis=1), rate)
