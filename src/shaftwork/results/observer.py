"""What a solution needs to know of its model: plain arrays by name, no symbols. Its quantities at any times."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from shaftwork.core.errors import AccuracyWarning, ParameterError, SignalError, no_quantity
from shaftwork.core.notices import muted, warn
from shaftwork.core.parameters import in_si, numbers_in_si

Array = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]

RPM = 30 / np.pi
"""1/min of a rad/s."""
Read = Callable[[Array], Array]
"""From ascending times (k,) to the values of a quantity there."""
ANGLES = ("phi", "s", "psi")
"""Integrals of speeds and voltages, which are recorded when asked for."""


def blocks(count: int, width: int) -> Iterator[slice]:
    """Places 0 to `count` in blocks, of as many as are read at once where each holds `width` numbers."""
    rows = max(1, 4_000_000 // max(1, width))  # numbers in 32 MB
    return (slice(first, min(first + rows, count)) for first in range(0, count, rows))


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


class Reader:
    """Reads quantities of a motion; what many of them are read at, the first look at each, is solved for once.

    Args:
        title: of the network.
        states: n names.
        observer: recovers quantities from states.
        dense: states (k, n) at any times (k,).
    """

    def __init__(self, title: str, states: tuple[str, ...], observer: Observer, dense: DenseStates) -> None:
        self.title, self.states, self.observer, self.dense = title, states, observer, dense
        self._states_at: tuple[Array, Array] | None = None
        self._ahead: dict[str, tuple[Array, Array]] = {}
        self._profile: tuple[str, Array, Array] | None = None
        self.unbounded: dict[tuple[str, int | None], dict[float, float]] = {}
        """Values that are not finite, by the name of the quantity and its place, and by time in s."""

    @cached_property
    def steps(self) -> Array:
        """(s,) ends of the integration steps. An engine of output times alone integrates anew to tell them."""
        return self.dense.steps

    @property
    def names(self) -> dict[str, None]:
        """Every quantity that can be read, at a place or along a part, in order."""
        return dict.fromkeys((*self.observer.units, *self.observer.profiles))

    def unit(self, name: str) -> str:
        """The unit of a quantity; empty for what is stored and has no other meaning.

        Raises:
            SignalError: there is no such quantity; the message lists what the part has.
        """
        units, profiles = self.observer.units, self.observer.profiles
        if not isinstance(name, str):
            some = ", ".join(tuple(units)[:6])
            raise SignalError(
                f"{reprlib.repr(name)} is no name of a quantity. '{self.title}' has {len(units)}, such as: {some}. "
                "All of them are in `names`."
            )
        if name in profiles:
            return profiles[name][0]
        if name in units:
            return units[name]
        if name in self.states:
            return ""
        error = no_quantity(name, self.title, self.names)
        owner, _, quantity = name.rpartition(".")
        if quantity.partition("_")[0] in ANGLES and any(other.rpartition(".")[0] == owner for other in units):
            raise SignalError(f"{error} An angle is recorded when asked for: net.compile(angles=['{owner}']).")
        raise error

    def places(self, name: str) -> tuple[float, ...]:
        """Where a quantity is read along a part, m from its first end; empty for any other."""
        profiles = self.observer.profiles
        return profiles[name][1] if isinstance(name, str) and name in profiles else ()

    def numbers(self, name: str) -> range | tuple[None]:
        """The places of a quantity as `quantity` takes them."""
        return range(len(self.places(name))) or (None,)

    def values(self, name: str, t: Array, x: Array) -> Array:
        """(k,) a quantity at times (k,) with states (k, n); (k, places) one along a part.

        Where it has no value, as 0/0, it is what it goes to on the side of the next step; an `AccuracyWarning` says
        where it goes to nothing finite.

        Raises:
            SignalError: there is no such quantity.
        """
        if isinstance(name, str) and name in self.states:
            return x[:, self.states.index(name)].copy()
        values = self._computed(name, t, x)
        missing = ~np.isfinite(values)
        if missing.any():
            rows = missing.reshape(len(t), -1).any(axis=1)
            limit, _ = beside(lambda times: self._computed(name, times, self.dense(times)), t[rows], self.steps)
            values[rows] = np.where(missing[rows] & np.isfinite(limit), limit, values[rows])
            self._warn_of_missing(name, t, values)
        return values

    def quantity(self, name: str, place: int | None = None) -> Read:
        """A quantity by its name, of one that is read along a part that at a place, by its number.

        Where it has no finite value, a value next to it stands for that; what it was is in `unbounded`.
        """

        def plain(times: Array) -> Array:
            if name in self._ahead and np.array_equal(self._ahead[name][0], times):
                ahead = self._ahead[name][1]
                return (ahead if place is None else ahead[:, place]).copy()
            parts = blocks(len(times), len(self.states))
            with muted(*((AccuracyWarning,) if (name, place) in self.unbounded else ())):  # it has been said
                return np.concatenate([self._at(name, place, times[block]) for block in parts])

        def read(times: Array) -> Array:
            values = plain(times)
            if (rows := np.flatnonzero(~np.isfinite(values))).size:
                unbounded = self.unbounded.setdefault((name, place), {})
                unbounded.update(zip(times[rows].tolist(), values[rows].tolist(), strict=True))
                with muted(AccuracyWarning):
                    values[rows] = beside(plain, times[rows], self.steps)[1]
            return values

        return read

    @contextmanager
    def read_ahead(self, names: Sequence[str], times: Array) -> Iterator[None]:
        """Meanwhile quantities are read at these times (k,) from values computed together.

        Every quantity of a motion is looked at on the same times first; what all branches bear there is computed once.
        """
        width = max(1, len(self.states), len(self.observer.units))
        ahead: dict[str, list[Array]] = {name: [] for name in names if name not in self.states}
        for block in blocks(len(times), width) if len(ahead) > 1 else ():
            t, x = times[block], self.dense(times[block])
            for name, values in ahead.items():
                values.append(self.values(name, t, x))
        self._ahead = {name: (times, np.concatenate(values)) for name, values in ahead.items() if values}
        try:
            yield
        finally:
            self._ahead = {}

    def _at(self, name: str, place: int | None, times: Array) -> Array:
        if self._states_at is None or not np.array_equal(self._states_at[0], times):
            self._states_at = times.copy(), self.dense(times)
        last, x = self._states_at
        if place is None:
            return self.values(name, last, x)
        if self._profile is None or self._profile[0] != name or self._profile[1] is not last:
            self._profile = name, last, self.values(name, last, x)
        return self._profile[2][:, place]

    def _computed(self, name: str, t: Array, x: Array) -> Array:
        """A quantity as it is computed, which may be 0/0."""
        self.unit(name)  # refuses a name that does not exist
        along = name in self.observer.profiles
        return (self.observer.profile if along else self.observer.signal)(name, t, x, self.dense)

    def _warn_of_missing(self, name: str, t: Array, values: Array) -> None:
        """Say where a quantity has no finite value."""
        missing = ~np.isfinite(values).reshape(len(t), -1).all(axis=1)
        if missing.any():
            warn(
                f"'{name}' of '{self.title}' has no finite value at t = {t[missing][0]:.6g} s, as where the slope "
                "of a law, sqrt(t) at t = 0, is infinite. Its extremes hold it where it is infinite, its mean and "
                "cycles the values beside it. Give the law a finite slope there.",
                AccuracyWarning,
            )


def span_of(reader: Reader, start: float | None, end: float | None) -> tuple[float, float]:
    """Start and end of a span of a motion, s.

    Raises:
        ParameterError: they are none.
    """
    begins, ends = float(reader.steps[0]), float(reader.steps[-1])
    first = begins if start is None else in_si("start", start, "s")
    last = ends if end is None else in_si("end", end, "s")
    if not begins <= first < last <= ends:
        raise ParameterError(
            f"start = {first:g} s, end = {last:g} s: give a span within the motion, from {begins:g} to {ends:g} s."
        )
    return first, last


def beside(read: Callable[[Array], Array], times: Array, steps: Array) -> tuple[Array, Array]:
    """What a quantity goes to on the side of its step at times at which it has no finite value.

    Args:
        read: from ascending times (k,) to values (k, ...).
        times: (k,) ascending, s.
        steps: (s,) times between which the motion is smooth, s.

    Returns:
        (k, ...) the limits, not a number where there is none, and finite values next to the times.
    """
    scale = min(float(steps[-1] - steps[0]), 1.0) * np.maximum(np.abs(times), 1.0)
    nearest, *farther = 1e-13, 1e-11, 1e-9, 1e-7, 1e-6  # parts of that by which a value is looked for aside
    before = np.append(times[1:] == times[:-1], False)  # of a time listed twice the first is before what jumps there
    following = np.append(steps, np.inf)[np.searchsorted(steps, times, side="right")]
    side = np.where(before | (following - times <= 2 * nearest * scale) | (times >= steps[-1]), -1.0, 1.0)
    limit: Array = np.full_like(read(times), np.nan)
    near = limit.copy()
    for distance in (nearest, *farther):
        values = []
        for part in (1, 2, 4):
            aside = np.clip(times + side * part * distance * scale, steps[0], steps[-1])
            order = np.argsort(aside, kind="stable")
            values.append(np.empty_like(limit))
            values[-1][order] = read(aside[order])
        with np.errstate(invalid="ignore", divide="ignore"):
            left = (values[1] - values[0]) / (values[2] - values[1])  # of each difference at half the distance
            # The 13th root leaves so much; what falls more slowly cannot be told from a pole of the logarithm.
            falls = (left > 0) & (left < 0.95)
            goes_to = np.where(falls, values[0] - (values[1] - values[0]) * left / (1 - left), values[0])
            # A value that is the same to four digits at twice the distance is what the quantity goes to; one that falls
            # as a power of the distance goes to zero where what that power leaves is below this part of it.
            same = 1e-4
            settles = np.isnan(limit) & (np.abs(values[0] - values[1]) <= same * np.abs(values[0]))
            vanishes = np.isnan(limit) & falls & (np.abs(goes_to) <= same * np.abs(values[0]))
        limit[settles] = goes_to[settles]
        limit[vanishes] = 0.0
        empty = np.isnan(near) & np.isfinite(values[0])
        near[empty] = values[0][empty]
    return limit, near
