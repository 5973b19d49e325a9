"""The torque of the kept shaft in a train and in its small models, on one motion."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from shaftwork.core.errors import ParameterError
from shaftwork.pipeline.network import Network
from shaftwork.reduce.tridiagonal_modes import Array
from shaftwork.results.solution import Solution

SHOWN = 3
"""Differences between two networks that are named."""


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
    given = [name for name, value in before.initial.items() if value]
    if given:
        raise ParameterError(
            f"compare: the motion `before` does not start from rest, but with {', '.join(given)}. The small models do."
        )
    graph, there = train.graph(), before.observer.wiring
    known, found = graph.parameters, before.parameters
    pairs = {name: (found.get(name, 0.0), known.get(name, 0.0)) for name in (*known, *found)}
    other = [f"{name} = {was:g} instead of {now:g}" for name, (was, now) in pairs.items() if was != now]
    if not other:  # what differs in a law or a node
        here = graph.wiring
        names = dict.fromkeys(name for name in (*here, *there) if here.get(name) != there.get(name))
        other = [f"'{n}' is {there.get(n, 'not there')} instead of {here.get(n, 'not there')}" for n in names]
    if other:
        shown = ", ".join([*other[:SHOWN], *(["..."] if len(other) > SHOWN else [])])
        raise ParameterError(
            f"compare: the motion `before` is not that of '{train.name}': {shown}. Simulate the train as it is, or "
            "simplify the one that moved."
        )
