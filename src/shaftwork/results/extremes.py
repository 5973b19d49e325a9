"""The largest and smallest values of all quantities of a motion, and whether its output times show them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from shaftwork.core.errors import AccuracyWarning
from shaftwork.core.notices import warn
from shaftwork.numerics.tolerances import GOLDEN
from shaftwork.results.course import course, first_times
from shaftwork.results.observer import Array, Reader

HIDDEN, STRAYED = 0.05, 0.2
"""Of the largest value: what samples may miss of an extreme, and the root mean square by which lines between samples
may miss the quantity. Seven samples in a swing miss a twentieth of it."""
SHARES = np.arange(1, 9) * GOLDEN % 1
"""Where between its neighbours a time lies: in step with nothing that swings, and few, for engines that take as many
matrix exponentials as there are distances from a step end."""
MOST_OUTPUTS = 10_000_000
"""Output times that can be asked for."""


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

    def rows(self, names: Sequence[str]) -> dict[str, ExtremesRow]:
        """The same of several quantities, which are read together.

        Raises:
            SignalError: there is no such quantity.
        """
        missing = [name for name in dict.fromkeys(names) if name not in self._rows]
        together = max(1, 4_000_000 // (8 * len(self._reader.steps)))  # of 32 MB
        for first in range(0, len(missing), together):
            some = missing[first : first + together]
            with self._reader.read_ahead(some, first_times(self._reader.steps)):
                self._rows.update({name: self._searched(name) for name in some})
        return {name: self._rows[name] for name in names}

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
        for name, (least, most, mean, end) in self.rows(names).items():
            ends = f"{float(least):z12.5g} {least.t:8.4g} {float(most):z12.5g} {most.t:8.4g}"
            lines.append(f"{name:{width}}  {least.unit:8} {ends} {mean:z12.5g} {end:z12.5g}")
        return "\n".join(lines)

    def __str__(self) -> str:
        names = tuple(self)
        count = 20  # quantities in the table of all
        more = [f"and {len(names) - count} more"] if len(names) > count else []
        return "\n".join([f"'{self._reader.title}'", self.table(names[:count]), *more])

    __repr__ = __str__


def warn_of_coarse_samples(reader: Reader, t: Array, x: Array, names: Sequence[str] = ()) -> None:
    """Warn where the samples of quantities do not show how these swing.

    Law: the quantities are read between output times and step ends, and compared with lines between their samples.

    Args:
        reader: of the motion.
        t: (k,) output times, s.
        x: (k, n) states at these times.
        names: of the quantities; by default those of the states.
    """
    if len(t) < 50:  # a list of moments, of which nobody expects extremes
        return
    names = names or tuple(name for name in reader.states if name in reader.observer.units)
    if (worst := _worst_shown(reader, t, x, names)) is not None:
        warn(_message(reader, t, x, *worst), AccuracyWarning)


def _worst_shown(reader: Reader, t: Array, x: Array, names: Sequence[str]) -> tuple[str, int, float] | None:
    """What samples show worst of some quantities: name, place and time in s; None where they show all of them."""
    times, first = np.unique(t, return_index=True)
    width = len(reader.states) + sum(len(reader.numbers(name)) for name in names)
    # At most 30 000 times are looked at, and fewer where more than a million values would be read.
    between = _looks(times, reader.steps, min(30_000, 1_000_000 // max(1, width)))
    states = reader.dense(between)
    worst, where = 1.0, None
    for name in names:
        samples, values = (
            reader.values(name, *motion).reshape(len(motion[0]), -1) for motion in ((t, x), (between, states))
        )
        size = np.maximum(np.abs(np.concatenate([samples, values])).max(axis=0), np.finfo(float).tiny)
        over = np.maximum(values - samples.max(axis=0), samples.min(axis=0) - values)
        apart = np.abs(values - _lines(times, samples[first], between))
        astray = np.sqrt(np.trapezoid(apart**2, between, axis=0) / (between[-1] - between[0]))
        for share, far in ((over.max(axis=0) / HIDDEN, over), (astray / STRAYED, apart)):
            place = int(np.argmax(share / size))
            if share[place] > worst * size[place]:
                worst = float(share[place] / size[place])
                where = name, place, float(between[far[:, place].argmax()])
    return where


def _looks(times: Array, steps: Array, most: int) -> Array:
    """Times between neighbours of output times and step ends."""
    edges = np.unique(np.append(times, steps[(steps > times[0]) & (steps < times[-1])]))
    if len(edges) > most:
        edges = edges[np.linspace(0, len(edges) - 1, most).astype(int)]
    each = int(np.clip(most // len(edges), 1, 4))
    shares = (np.arange(each) + np.resize(SHARES, len(edges) - 1)[:, None]) / each
    return np.asarray((edges[:-1, None] + np.diff(edges)[:, None] * shares).ravel())


def _lines(times: Array, samples: Array, at: Array) -> Array:
    """Lines between samples (k, m) at times (k,), at other times (j,)."""
    before = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    share = ((at - times[before]) / (times[before + 1] - times[before]))[:, None]
    return np.asarray((1 - share) * samples[before] + share * samples[before + 1])


def _message(reader: Reader, t: Array, x: Array, name: str, place: int, near: float) -> str:
    """What is not seen of a quantity near a time: its turn there, and how close samples must be to show that."""
    samples = reader.values(name, t, x).reshape(len(t), -1)[:, place]
    low, high = float(samples.min()), float(samples.max())
    read = reader.quantity(name, place if reader.places(name) else None)
    times = np.unique(t)
    after = int(np.searchsorted(times, near))
    start, end = times[after - 1 : after + 1].tolist()
    inner = reader.steps[(reader.steps > start) & (reader.steps < end)]
    left, right = read(np.array([start, end])).tolist()
    turns = course(read, np.array([start, *inner, end])).extremes()
    lines = [left + (right - left) * (when - start) / (end - start) for when, _ in turns]
    which = int(np.argmax([abs(value - line) for (_, value), line in zip(turns, lines, strict=True)]))
    (when, value), line = turns[which], lines[which]
    room, width = HIDDEN * max(abs(value), -low, high), 0.0
    # a turn is no narrower than a millionth of the time between two samples
    offsets = np.geomspace(1e-6, 1.0, 100) * (end - start)
    for side in (-1, 1):
        aside = np.clip(when + side * offsets, reader.steps[0], reader.steps[-1])[::side]
        stays = np.abs(read(aside)[::side] - value) <= room
        width += float(offsets[int(np.argmin(np.append(stays, False))) - 1]) if stays[0] else 0.0
    count = (times[-1] - times[0]) / width if width else np.inf
    enough = f"About t_eval={_rounded_up(count)} show it." if count < MOST_OUTPUTS else "No even output times show it."
    return (
        f"The {len(t)} output times of '{reader.title}' are too far apart for what swings in it: '{name}' is "
        f"{value:.5g} {reader.unit(name)} at t = {when:.6g} s, where a line between its samples is at {line:.5g}, and "
        f"its samples lie between {low:.5g} and {high:.5g}. {enough} sol.max('{name}') and sol.min('{name}') are right "
        "whatever the output times."
    )


def _rounded_up(count: float) -> int:
    """A number of intervals to one digit, as a number of output times."""
    digit = 10.0 ** int(np.log10(count))
    return int(np.ceil(count / digit) * digit) + 1
