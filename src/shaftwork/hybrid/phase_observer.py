"""The quantities of a network whose equations change from phase to phase, along a motion through all of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array, Index
from shaftwork.codegen.model_observer import DenseWaves, Impact, ModelObserver
from shaftwork.codegen.state_transfer import StateTransfer
from shaftwork.codegen.timeline import Timeline
from shaftwork.components.base import Component


@dataclass(frozen=True, eq=False)
class Stretch:
    """A phase as it is read.

    Args:
        start: s.
        key: the same for phases of the same equations with the same parameters.
        stores: what the equations store.
        bind: makes the array program.
        observer: of the equations.
        instants: at which inputs jump.
        dense: the motion, in the states of the equations; None where it has none.
        states: their names; what arrives by waves stands behind them.
        ends: number of ends of waves.
        modes: of every element.
    """

    start: float
    key: Any
    stores: StateTransfer
    bind: Callable[[], BoundArrays]
    observer: ModelObserver
    instants: Timeline
    dense: Callable[[Array], Array]
    states: tuple[str, ...]
    ends: int
    modes: Mapping[str, str]


class Stretches:
    """All phases of a motion, by time; each is made when it is first read.

    Args:
        starts: of each phase, s, not falling.
        make: makes a phase by its number.
    """

    def __init__(self, starts: Sequence[float], make: Callable[[int], Stretch]) -> None:
        self.starts, self._make = np.array(starts), make
        self._made: dict[int, Stretch] = {}

    def __getitem__(self, number: int) -> Stretch:
        if number not in self._made:
            self._made[number] = self._make(number)
        return self._made[number]

    def groups(self, t: Array) -> Iterator[tuple[tuple[Stretch, ...], Index]]:
        """Phases with equal equations, and the places of the times (k,) in them.

        A time between two phases belongs to the later one; of one that is listed twice in a row the first does not.
        """
        index = self._numbers(t)
        twice = np.append(t[1:] == t[:-1], False) & (self.starts[index] == t) & (index > 0)
        index = index - twice
        keys: dict[Any, list[int]] = {}
        for number in np.unique(index).tolist():
            keys.setdefault(self[number].key, []).append(number)
        for numbers in keys.values():
            places = np.flatnonzero(np.isin(index, numbers))
            yield tuple(self[number] for number in numbers), places

    def at(self, t: float) -> Stretch:
        """The phase at a time in s; of a time between two the later one."""
        return self[max(int(np.searchsorted(self.starts, t, side="right")) - 1, 0)]

    def _numbers(self, t: Array) -> Index:
        """The numbers of the phases at times (k,), of a time between two that of the later one."""
        numbers: Index = np.clip(np.searchsorted(self.starts, t, side="right") - 1, 0, None)
        return numbers

    def dense(self, t: Array) -> Array:
        """(k, stores) all that is stored at times (k,), and behind it what arrives by waves."""
        t = np.atleast_1d(np.asarray(t, dtype=float))
        count = len(self[0].stores.names)
        stored = np.empty((t.size, count + self[0].ends))
        index = self._numbers(t)
        for number in np.unique(index).tolist():
            stretch, places = self[number], np.flatnonzero(index == number)
            read_at = stretch.instants.one_sided(t[places])
            x = stretch.dense(t[places])
            stored[places, :count] = stretch.stores.of(stretch.bind, read_at, x)
            stored[places, count:] = x[:, len(stretch.states) :]
        return stored


class PhaseObserver:
    """Recovers every quantity from all that is stored, in each phase by its own equations.

    Args:
        names: of all that is stored.
        stretches: makes the phases when a quantity is first read.
        impacts: finds the impacts.
    """

    def __init__(
        self,
        names: tuple[str, ...],
        stretches: Callable[[], Stretches],
        impacts: Callable[[], tuple[Impact, ...]],
    ) -> None:
        self._names, self._make, self._find_impacts = names, stretches, impacts

    def impacts(self, _dense: DenseWaves) -> tuple[Impact, ...]:
        """Instants at which energy may be given or lost at once."""
        return self._find_impacts()

    @property
    def _stretches(self) -> Stretches:
        return self._make()

    @property
    def _first(self) -> ModelObserver:
        return self._stretches[0].observer

    @property
    def units(self) -> Mapping[str, str]:
        """Every quantity that can be read and its unit."""
        return self._first.units

    @property
    def wiring(self) -> Mapping[str, str]:
        """By part, what it is, where it is, and what is no number of it."""
        return self._first.wiring

    def nodes_of(self, name: str) -> tuple[str, ...]:
        """The moving nodes that a torque or speed is of, by its name in `units`; none for other quantities."""
        return self._first.nodes_of(name)

    @property
    def profiles(self) -> Mapping[str, tuple[str, tuple[float, ...]]]:
        """Every quantity that can be read along a part."""
        return self._first.profiles

    def signal(self, name: str, t: Array, x: Array, dense: DenseWaves | None = None) -> Array:
        """(k,) a quantity by its name in `units`."""
        values = np.empty(len(t))
        for observer, places, times, states in self._pieces(t, x):
            values[places] = observer.signal(name, times, states, dense)
        return values

    def profile(self, name: str, t: Array, x: Array, dense: DenseWaves) -> Array:
        """(k, places) a quantity along a part by its name in `profiles`."""
        values = np.empty((len(t), len(self.profiles[name][1])))
        for observer, places, times, states in self._pieces(t, x):
            values[places] = observer.profile(name, times, states, dense)
        return values

    def stored(self, t: Array, x: Array, dense: DenseWaves) -> dict[str, Array]:
        """Stored energy by part."""
        energies: dict[str, Array] = {}
        for observer, places, times, states in self._pieces(t, x):
            _fill(energies, observer.stored(times, states, dense), places, len(t))
        return energies

    def powers(self, t: Array, x: Array) -> tuple[dict[str, Array], dict[str, Array]]:
        """Lost power and supplied power by part."""
        lost: dict[str, Array] = {}
        supplied: dict[str, Array] = {}
        for observer, places, times, states in self._pieces(t, x):
            for totals, powers in zip((lost, supplied), observer.powers(times, states), strict=True):
                _fill(totals, powers, places, len(t))
        return lost, supplied

    def held(self, t: float, x: Array) -> dict[str, float]:  # noqa: ARG002
        """All that is stored, by name, which is what the states (n,) of a motion through phases are."""
        return dict(zip(self._names, x.tolist(), strict=False))  # waves may follow

    def read_at(self, t: float) -> float:
        """When inputs are read at a time in s, as in one phase."""
        return self._stretches.at(t).observer.read_at(t)

    def modes_at(self, t: float) -> dict[str, str]:
        """The mode of every element at a time in s."""
        return dict(self._stretches.at(t).modes)

    def part(self, name: str) -> Component:
        """A component of the network, with the parameter values of this motion."""
        return self._first.part(name)

    def _pieces(self, t: Array, x: Array) -> Iterator[tuple[ModelObserver, Index, Array, Array]]:
        names = self._names
        for stretches, places in self._stretches.groups(t):
            first = stretches[0]
            columns = [*(names.index(state) for state in first.states), *range(len(names), x.shape[1])]
            yield first.observer, places, self._sided(first.instants, t, places), x[places][:, columns]

    @staticmethod
    def _sided(instants: Timeline, t: Array, places: Index) -> Array:
        """The times, and where an instant is listed twice and only its first is here, one before it."""
        times = t[places].copy()
        alone = np.append(t[1:] == t[:-1], False)[places] & ~np.isin(places + 1, places)
        for k in np.flatnonzero(alone).tolist():
            times[k] = instants.sides(float(times[k]))[0]
        return times


def _fill(totals: dict[str, Array], values_of: Mapping[str, Array], places: Index, count: int) -> None:
    """Put what is known of parts at some places of `count` times to the rest of it."""
    for name, values in values_of.items():
        totals.setdefault(name, np.zeros(count))[places] = values
