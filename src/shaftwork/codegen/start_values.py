"""Start states from start values: each value that is given holds at the start, and all other stores are at rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import compress
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.array_form.linear_readings import GivenSpeeds, LinearQuantity, LinearRow
from shaftwork.codegen.array_form.recovery import BranchHistory
from shaftwork.codegen.operating import INSTANT, energy_weights
from shaftwork.codegen.start_names import StartNames, speeds_inside
from shaftwork.core.errors import ParameterError
from shaftwork.numerics.tolerances import TYPED
from shaftwork.numerics.zeros import just_after


def initial_state(bound: BoundArrays, given: Mapping[str, float], t0: float) -> Array:
    """The states at the start: every given value holds, and all other stores are at rest.

    Rest is that before the sources come on: where a prescribed speed is there from the start, its impulse has been
    given to the inertias joined to it rigidly. A speed sets speeds alone and a torque sets torques alone: that of a
    damped spring sets its elastic torque, so that both together are what is given. What is rigidly tied to a given
    value follows it. A value that several stores would have to share is refused, and so is what follows from laws or
    accelerations; the message names the start values to give instead.

    Inside a shaft of several elements the speeds run straight from the one end to the other, and a torque "line.tau"
    stands all along it.

    Args:
        bound: the array program.
        given: "part.quantity" or "node.quantity" to value in SI.
        t0: start time, s; where something jumps there, a time after it.

    Raises:
        SignalError: there is no such quantity.
        ParameterError: a value is not finite, contradicts another one or is none to start from.
    """
    if not isinstance(given, Mapping):
        raise ParameterError(f"initial = {given!r} must map quantities to values, such as {{'J1.omega': 3.0}}.")
    return Start(bound, given, t0).states if given else at_rest(bound, t0)


def with_others(
    bound: BoundArrays, values: Mapping[str, float], others: Mapping[str, float], t0: float
) -> dict[str, float]:
    """Start values of all stores, but for those that others determine, with the others.

    Args:
        bound, t0: as for `initial_state`.
        values: of all stores, by name.
        others: "part.quantity" or "node.quantity" to value in SI.
    """
    determined = Start(bound, others, t0).determined if others else ()
    return {name: value for name, value in values.items() if name not in determined} | dict(others)


def at_rest(bound: BoundArrays, t0: float) -> Array:
    """(n,) the states at rest, sources included that jump from nothing at the start t0 in s."""
    return bound.impulse(np.zeros(len(bound.program.form.states)), None, just_after(t0))


class _Stores(NamedTuple):
    """Stores without a value of their own.

    Args:
        names: of the stores.
        slopes: (stores, k) by the states that are to change.
        offsets: (stores,) how far the given states have moved them from rest.
        is_free: (stores,) whether further states move them, for which nothing is given.
    """

    names: Sequence[str]
    slopes: Array
    offsets: Array
    is_free: Any


class Start:
    """The way from start values to states.

    Args:
        bound: the array program.
        given: values by name.
        t0: start time, s; where something jumps there, a time after it.

    Raises:
        SignalError: there is no such quantity.
        ParameterError: as for `initial_state`.
    """

    def __init__(self, bound: BoundArrays, given: Mapping[str, float], t0: float) -> None:
        self._bound, self._rest, self._t = bound, at_rest(bound, t0), just_after(t0)
        self._names = StartNames(bound, self._t)
        self._values = self._names.checked(given)
        form, numbers = bound.program.form, np.arange(self._rest.size)
        self._of_kind = {
            True: numbers < form.speeds.stop,
            False: (numbers >= form.torques.start) & (numbers < form.torques.stop),
        }
        self._x, self._fixed = self._rest.copy(), np.zeros(numbers.size, dtype=bool)
        self._prescribed: list[LinearQuantity] = []
        direct = {self._names.places[name]: v for name, v in self._values.items() if name in self._names.places}
        self._x[list(direct)], self._fixed[list(direct)] = list(direct.values()), True

    @cached_property
    def states(self) -> Array:
        """(n,) the states at the start."""
        if self._values:
            self._meet_all()
        return self._x

    @cached_property
    def given_speeds(self) -> GivenSpeeds:
        """Which speeds the start values give, those inside shafts included."""
        return self._names.readings.given_speeds(self.states, self._rest, self._fixed, self._prescribed)

    @cached_property
    def determined(self) -> frozenset[str]:
        """The stores that the start values determine: states, and what is tied to one of them."""
        _ = self.states
        states = (name for name, place in self._names.places.items() if self._fixed[place])
        moved = abs(self._names.ties) @ self._fixed.astype(float)
        return frozenset((*states, *compress(self._names.tied, moved)))

    @property
    def nodes_left(self) -> frozenset[int]:
        """The nodes with a store whose speed is at rest for want of a start value, where other speeds are given."""
        graph, form = self._bound.program.form.graph, self._bound.program.form
        if not self.states[self._of_kind[True]].any():
            return frozenset()
        left = self.given_speeds.left(lambda history: history.potentials)
        stores = (graph.branches[k] for k in (*form.across_states, *form.dependent_across))
        nodes = {end for branch in stores for end in (branch.plus, branch.minus) if end >= 0}
        return frozenset(nodes.intersection(np.flatnonzero(left).tolist()))

    def _meet_all(self) -> None:
        names, values = self._names, self._values
        shafts = {name: names.shafts[name] for name in values if name in names.shafts}
        quantities = [self._linear(name) for name in values if name not in names.places and name not in shafts]
        pairs = [*zip(quantities, names.readings.rows(quantities), strict=True)]
        self._meet([pair for pair in pairs if pair[0].is_across], is_across=True)
        self._prescribed += [quantity for quantity, row in pairs if quantity.is_across and not row.moved]
        self._fill_shafts()
        for name, shaft in shafts.items():
            shaft.wind(self._bound, self._t, self._x, values[name], fixed=self._fixed)
        for shaft in shafts.values():
            self._fixed[list(shaft.states)] = True
        self._meet([pair for pair in pairs if not pair[0].is_across], is_across=False)
        for name, shaft in shafts.items():
            torques = shaft.torques(self._bound, self._t, self._x)
            size = max(abs(values[name]), np.abs(self._x[list(shaft.states)]).max())
            self._refuse_other(name, float(torques[np.abs(torques - values[name]).argmax()]), size)

    def _linear(self, name: str) -> LinearQuantity:
        quantity = self._names.quantity(name)
        if quantity is None:
            raise self._refused(name, "is no sum of speeds or of torques")
        return quantity

    def _meet(self, demands: Sequence[tuple[LinearQuantity, LinearRow]], *, is_across: bool) -> None:
        """Change the speeds, or the torques, so that quantities have their values and everything else is at rest."""
        of_kind, x = self._of_kind[is_across], self._x
        free = of_kind & ~self._fixed
        constants = np.array([self._constant(*demand) for demand in demands])
        rows = np.array([row.by_state for _, row in demands]).reshape(len(demands), x.size)
        values = np.array([self._values[quantity.name] for quantity, _ in demands])
        slopes = np.abs(np.where(of_kind, rows, 0.0))
        movable = free & (slopes > TYPED * slopes.max(axis=1, keepdims=True, initial=0.0)).any(axis=0)
        x[movable] += self._changes(rows[:, movable], values - constants - rows @ x, movable, is_across=is_across)
        self._fixed |= movable
        size = np.abs(np.append(rows * np.where(of_kind, x, 0.0), values)).max(initial=0.0)
        reached = rows @ x + constants
        for k, (quantity, _) in enumerate(demands):
            if not abs(reached[k] - values[k]) <= self._drift(quantity):
                self._refuse_other(quantity.name, float(reached[k]), size)

    def _constant(self, quantity: LinearQuantity, row: LinearRow) -> float:
        """What the states do not add to a quantity.

        Raises:
            ParameterError: the quantity is none to start from.
        """
        name, form = quantity.name, self._bound.program.form
        if not quantity.is_across and self._names.torque_along(name) is not None:
            raise self._refused(name, "is that of one end of a shaft of several elements")
        if row.moved:
            raise self._refused(name, "follows from laws or accelerations")
        sizes = np.abs(row.by_state) / energy_weights(self._bound)
        sizes = np.where(sizes > TYPED * sizes.max(initial=0.0), sizes, 0.0)
        if quantity.is_across and sizes[form.speeds.stop :].any():
            raise self._refused(name, "follows from torques, too")
        if not quantity.is_across and sizes.any() and not sizes[self._of_kind[False]].any():
            raise self._refused(name, "follows from speeds")
        return row.prescribed

    def _drift(self, quantity: LinearQuantity) -> float:
        """How far sources move a quantity at once: 3 sin(12 t) is soon not quite the zero that is given."""
        times = np.array([self._t, self._t + INSTANT])
        return float(np.ptp(quantity.read(BranchHistory(self._bound, times, np.array([self._x, self._x])))))

    def _changes(self, rows: Array, gaps: Array, movable: Any, *, is_across: bool) -> Array:
        """(k,) changes of the movable states with which rows close their gaps and all that can be at rest is.

        A store that the rows and the fixed states determine follows them. Every other one must be at rest: where that
        cannot be, several stores would have to share the motion, and the start is refused.
        """
        stores = self._stores(movable, is_across=is_across)
        free: Array = np.eye(rows.shape[1])
        changes: Array = np.zeros(rows.shape[1])
        if rows.size:
            scaled = rows / np.abs(rows).max(axis=1, keepdims=True).clip(np.finfo(float).tiny)
            free = np.asarray(linalg.null_space(scaled, rcond=TYPED))
            changes = np.asarray(np.linalg.lstsq(rows, gaps, rcond=None)[0])
        free_slopes = stores.slopes @ free
        moves = np.abs(free_slopes).max(axis=1, initial=0.0) > TYPED * np.abs(stores.slopes).max(axis=1, initial=0.0)
        rests = stores.is_free | moves
        if free.size:
            moved = stores.slopes[rests] @ changes + stores.offsets[rests]
            changes = changes - free @ np.linalg.lstsq(free_slopes[rests], moved, rcond=None)[0]
        size = np.abs(np.append(changes, stores.offsets)).max(initial=0.0)
        left = rests & (np.abs(stores.slopes @ changes + stores.offsets) > TYPED * size)
        if left.any():
            raise self._shared([name for name, moving in zip(stores.names, left, strict=True) if moving])
        return np.asarray(changes)

    def _stores(self, movable: Any, *, is_across: bool) -> _Stores:
        """The movable states, and the tied stores of their kind that they or the given states move."""
        of_kind = self._of_kind[is_across]
        places, ties = np.flatnonzero(movable), abs(self._names.ties)
        change = np.where(of_kind & self._fixed, self._x - self._rest, 0.0)
        touched = (ties @ (movable | (change != 0)).astype(float)) > 0
        touched &= np.array([name not in self._values for name in self._names.tied], dtype=bool)
        beside = np.flatnonzero(touched)
        rows = self._names.ties[beside]
        tied = [*self._names.tied]
        names = [state for state, moves in zip(self._names.places, movable, strict=True) if moves]
        return _Stores(
            [*names, *(tied[k] for k in beside)],
            np.vstack([np.eye(places.size), rows[:, places].toarray()]),
            np.concatenate([np.zeros(places.size), rows @ change]),
            np.append(
                np.zeros(places.size, dtype=bool),
                (abs(rows) @ (of_kind & ~self._fixed & ~movable).astype(float)) > 0,
            ),
        )

    def _fill_shafts(self) -> None:
        """Let the speeds inside a shaft run straight between those of its ends, where nothing else is given."""
        start = self._names.readings.given_speeds(self._x, self._rest, self._fixed, self._prescribed)
        for place, speed in speeds_inside(self._bound.program.form, start).items():
            if not self._fixed[place]:
                self._x[place], self._fixed[place] = speed, True

    def _refuse_other(self, name: str, reached: float, size: float) -> None:
        if abs(reached - self._values[name]) > TYPED * max(size, np.finfo(float).tiny):
            others = ", ".join(other for other in self._values if other != name) or "its sources"
            raise ParameterError(
                f"The start value {name} = {self._values[name]:g} contradicts {others}: with them it would be "
                f"{reached:g}. Leave it out. {self._names.advice(name)}"
            )

    def _refused(self, name: str, why: str) -> ParameterError:
        return ParameterError(f"'{name}' is no start value: it {why}. {self._names.advice(name)}")

    def _shared(self, stores: Sequence[str]) -> ParameterError:
        return ParameterError(
            f"The start values ({', '.join(self._values)}) leave open how {', '.join(stores)} share the motion: they "
            f"cannot all be at rest. {self._names.advice_for(stores)}"
        )
