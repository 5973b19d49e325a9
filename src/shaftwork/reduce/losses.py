"""What a small model loses: natural frequencies, and the torque of the kept shaft on one motion."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

import numpy as np

from shaftwork.core.errors import ParameterError
from shaftwork.pipeline.motion_start import rewired
from shaftwork.pipeline.network import Network
from shaftwork.reduce.tridiagonal_modes import Array
from shaftwork.results.solution import Solution


@dataclass(frozen=True)
class FrequencyLoss:
    """A natural frequency of a train, and of models with as few unknowns; None where they have no such mode.

    Args:
        mode: its number, from 1, without the turning of the whole.
        before: of the train, Hz.
        after: of the small model, Hz.
        error: of it, relative.
        by_modes: of a description by as many ends of the kept shaft, prescribed speeds, and modes of the rest (Craig
            and Bampton), Hz.
    """

    mode: int
    before: float
    after: float | None
    error: float | None
    by_modes: float | None = None


@dataclass(frozen=True)
class FrequencyTable:
    """The natural frequencies of a train, lowest first, and what became of them.

    Args:
        rows: one for each.
        modes: whether there is a model by modes.
    """

    rows: tuple[FrequencyLoss, ...]
    modes: bool

    @classmethod
    def of(cls, before: Array, after: Array, by_modes: Array | None) -> FrequencyTable:
        """The frequencies (n,) of a train in Hz beside those of its small models, each ascending, zero for none."""
        models = before, after, () if by_modes is None else by_modes
        swinging = ([float(f) for f in model if f > 0] for model in models)
        rows = (
            FrequencyLoss(k, was, now, None if now is None else now / was - 1, bound)
            for k, (was, now, bound) in enumerate(zip_longest(*swinging), 1)
        )
        return cls(tuple(rows), by_modes is not None)

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[FrequencyLoss]:
        return iter(self.rows)

    def __getitem__(self, place: int) -> FrequencyLoss:
        """The row of a place, from 0."""
        return self.rows[place]

    def __str__(self) -> str:
        rows = [("mode", "before Hz", "after Hz", "error", "by modes Hz"), *map(_cells, self.rows)]
        return "\n".join(map(self._line, rows))

    def latex(self) -> str:
        """The table as LaTeX, a `longtable` (packages booktabs, array, longtable), frequencies in Hz."""
        from shaftwork.latex.nomenclature import table

        titles = ("Mode", "Before, Hz", "After, Hz", "Error", "By modes, Hz")
        columns = len(titles) if self.modes else len(titles) - 1
        rows = []
        for row, (mode, _, _, error, _) in zip(self.rows, map(_cells, self.rows), strict=True):
            share = f"${error[:-1]} \\, \\%$" if error else ""
            rows.append((mode, _printed(row.before), _printed(row.after), share, _printed(row.by_modes)))
        return table("r" * columns, titles[:columns], [row[:columns] for row in rows])

    def _line(self, cells: Sequence[str]) -> str:
        mode, before, after, error, by_modes = cells
        line = f"{mode:>4}  {before:>10}  {after:>10}  {error:>8}"
        return f"{line}  {by_modes:>11}" if self.modes else line.rstrip()


def _cells(row: FrequencyLoss) -> tuple[str, str, str, str, str]:
    after, by_modes = ("lost" if f is None else f"{f:.6g}" for f in (row.after, row.by_modes))
    error = "" if row.error is None else f"{row.error:+z.2%}"
    return str(row.mode), f"{row.before:.6g}", after, error, by_modes


def _printed(frequency: float | None) -> str:
    from shaftwork.latex.printing import printed_number

    return "lost" if frequency is None else f"${printed_number(frequency)}$"


@dataclass(frozen=True, eq=False)
class Comparison:
    """What small models say of the torque in the kept shaft, beside what the train says.

    Args:
        t: (k,) times, s.
        before: (k,) torque of the train at the reference shaft, N m.
        after: (k,) torque of the small model of groups, N m.
        extremes: largest torque in size of these, in this order, N m; between the times as well.
        by_modes: (k,) torque of the one with modes, N m; None where there is none, as of a single mass.
    """

    t: Array
    before: Array
    after: Array
    extremes: tuple[float, ...]
    by_modes: Array | None = None

    @property
    def peaks(self) -> tuple[float, float]:
        """Largest torque in size before and after, N m."""
        return self.extremes[0], self.extremes[1]

    @property
    def peak_error(self) -> float:
        """Of the largest torque, relative; negative where the small model says less. Infinite where there was none."""
        return self._peak_error(1)

    @property
    def rms_error(self) -> float:
        """Root mean square of the difference over that of the torque of the train, at the times."""
        return self._rms_error(self.after)

    @property
    def peak_error_by_modes(self) -> float | None:
        """As `peak_error`, of the model with modes."""
        return None if self.by_modes is None else self._peak_error(2)

    @property
    def rms_error_by_modes(self) -> float | None:
        """As `rms_error`, of the model with modes."""
        return None if self.by_modes is None else self._rms_error(self.by_modes)

    def __str__(self) -> str:
        lines = ["model       peak N m     error  rms error", f"train     {self.extremes[0]:10.6g}"]
        models = {"groups": self.after, **({} if self.by_modes is None else {"modes": self.by_modes})}
        for place, (name, torque) in enumerate(models.items(), 1):
            errors = f"{self._peak_error(place):+z10.2%}{self._rms_error(torque):11.2%}"
            lines.append(f"{name:10}{self.extremes[place]:10.6g}{errors}")
        return "\n".join(lines)

    def _peak_error(self, place: int) -> float:
        return _share(self.extremes[place] - self.extremes[0], self.extremes[0])

    def _rms_error(self, torque: Array) -> float:
        return math.sqrt(_share(float(np.mean((torque - self.before) ** 2)), float(np.mean(self.before**2))))


def _share(difference: float, size: float) -> float:
    """A difference over a size; where the size is zero, nothing for none and infinity for any."""
    if not size:
        return math.inf if difference else 0.0
    return difference / size


def refuse_changes(options: Mapping[str, Any]) -> None:
    """Raise `ParameterError` for options of a simulation that make another train, for which no small model was made."""
    if options.get("parameters"):
        raise ParameterError(
            "compare: parameters are those of the train, and its small models were made for the values that it has. "
            "Build the network with the new ones, simplify it, and compare that."
        )
    if options.get("initial"):
        raise ParameterError(
            "compare: initial values are those of parts of the train, many of which are one in a small model. Leave "
            "them out: all models start from rest."
        )


def check_motion(before: Any, train: Network, start: float, end: float) -> None:
    """Raise `ParameterError` where something is no motion of a train from rest, from a time in s to another."""
    if not isinstance(before, Solution):
        raise ParameterError(f"compare: before = {before!r} is no motion. Give what `simulate` of the train returns.")
    for what, time, wanted in (("starts", before.steps[0], start), ("ends", before.steps[-1], end)):
        if not math.isclose(float(time), wanted, abs_tol=1e-12 * end):
            name = "t_start" if wanted == start else "t_end"
            raise ParameterError(f"compare: the motion `before` {what} at {time:g} s, and {name} is {wanted:g} s.")
    moving = [name for name, value in before.initial.items() if value]
    if moving:
        raise ParameterError(
            f"compare: the motion `before` does not start from rest, but with {', '.join(moving)}. The small models do."
        )
    graph = train.graph()
    here, there = graph.parameters, before.parameters
    pairs = {name: (there.get(name, 0.0), here.get(name, 0.0)) for name in (*here, *there)}
    differing = [f"{name} = {was:g} instead of {now:g}" for name, (was, now) in pairs.items() if was != now]
    if differing := differing or rewired(graph.wiring, before.observer.wiring):
        most = 3  # differences that are named
        shown = ", ".join([*differing[:most], *(["..."] if len(differing) > most else [])])
        raise ParameterError(
            f"compare: the motion `before` is not that of '{train.name}': {shown}. Simulate the train as it is, or "
            "simplify the one that moved."
        )
