"""The largest and smallest values of all quantities of a motion, between the output times too."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from shaftwork.results.course import course
from shaftwork.results.reader import Reader

SHOWN = 20
"""Quantities in the table of all."""


class Extreme(float):
    """The largest or smallest value of a quantity over a motion: a number that knows when it was.

    Args:
        value: in the unit.
        t: when it is first reached, s; where the quantity jumps, the time of the jump.
        name: of the quantity.
        unit: of the quantity.
        place: of a quantity that is read along a part, m from its first end.
    """

    __slots__ = ("name", "place", "t", "unit")
    t: float
    name: str
    unit: str
    place: float | None

    def __new__(cls, value: float, t: float, name: str, unit: str, place: float | None = None) -> Extreme:  # noqa: PYI034
        extreme = super().__new__(cls, value)
        extreme.t, extreme.name, extreme.unit, extreme.place = t, name, unit, place
        return extreme

    def __getnewargs__(self) -> tuple[float, float, str, str, float | None]:  # type: ignore[override]
        return float(self), self.t, self.name, self.unit, self.place

    def __repr__(self) -> str:
        where = "" if self.place is None else f", {self.place:g} m along"
        return f"{self.name} = {float(self):z.8g} {self.unit} at t = {self.t:.8g} s{where}"

    __str__ = float.__repr__


class ExtremesRow(NamedTuple):
    """What a table says of a quantity; along a part, of all its places."""

    least: Extreme
    most: Extreme
    mean: float
    end: float


class Extremes(Mapping[str, tuple[Extreme, Extreme]]):
    """Minimum and maximum of every quantity of a motion, by name; each is searched when it is first asked for.

    Law: the quantity becomes polynomials on parted panels of the solver's dense output (`results.course`), and is read
    where they turn and on both sides of jumps. Printed, it is a table.

    Args:
        reader: of the motion.
    """

    def __init__(self, reader: Reader) -> None:
        self._reader = reader
        self._rows: dict[str, ExtremesRow] = {}

    def __getitem__(self, name: str) -> tuple[Extreme, Extreme]:
        row = self.row(name)
        return row.least, row.most

    def __iter__(self) -> Iterator[str]:
        return iter(self._reader.names)

    def __len__(self) -> int:
        return len(self._reader.names)

    def __contains__(self, name: object) -> bool:
        return name in self._reader.names

    def row(self, name: str) -> ExtremesRow:
        """Extremes, mean over time and value at the end; along a part those of the worst places.

        Raises:
            SignalError: there is no such quantity.
        """
        if name not in self._rows:
            self._rows[name] = self._searched(name)
        return self._rows[name]

    def _searched(self, name: str) -> ExtremesRow:
        reader, rows = self._reader, []
        unit, places = reader.unit(name), reader.places(name)
        for number in reader.numbers(name):
            quantity = course(reader.quantity(name, number), reader.steps)
            unbounded = reader.unbounded.get((name, number), {}).items()
            infinite = [(t, value) for t, value in unbounded if np.isinf(value)]
            lowest, highest = quantity.extremes()
            turns = min((lowest, *infinite), key=itemgetter(1)), max((highest, *infinite), key=itemgetter(1))
            place = None if number is None else places[number]
            low, high = (Extreme(value + 0.0, t, name, unit, place) for t, value in turns)
            rows.append(ExtremesRow(low, high, quantity.mean, quantity.end))
        least, most = (min(row.least for row in rows), max(row.most for row in rows))
        worst = int(np.argmax([abs(row.mean) for row in rows]))
        return ExtremesRow(least, most, rows[worst].mean, max((row.end for row in rows), key=abs))

    def table(self, names: Sequence[str]) -> str:
        """A line for each quantity: unit, minimum and maximum with their times, mean over time, value at the end.

        Raises:
            SignalError: there is no such quantity.
        """
        width = max((len(name) for name in names), default=0)
        head = f"{'':{width}}  {'unit':8} {'minimum':>12} {'at s':>8} {'maximum':>12} {'at s':>8}"
        lines = [f"{head} {'mean':>12} {'end':>12}"]
        for name in names:
            least, most, mean, end = self.row(name)
            ends = f"{float(least):z12.5g} {least.t:8.4g} {float(most):z12.5g} {most.t:8.4g}"
            lines.append(f"{name:{width}}  {least.unit:8} {ends} {mean:z12.5g} {end:z12.5g}")
        return "\n".join(lines)

    def __str__(self) -> str:
        names = tuple(self)
        more = [f"and {len(names) - SHOWN} more"] if len(names) > SHOWN else []
        return "\n".join([f"'{self._reader.title}'", self.table(names[:SHOWN]), *more])

    __repr__ = __str__
