"""A motion in legs: spans of time in which one set of equations holds, no mode changes and no law switches."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq
from sympy import Expr

from shaftwork.codegen.differentiated import Differentiated
from shaftwork.codegen.elements import Array
from shaftwork.pipeline.model import Model
from shaftwork.pipeline.phases.mode_equations import ModeEquations
from shaftwork.pipeline.phases.mode_machines import ModeNames

LOOKS = np.array([0.0, 0.004, 0.07, 0.19, 0.31, 0.42, 0.53, 0.61, 0.74, 0.83, 0.91, 0.996])
"""Where in a step switches of laws are looked at: at no regular places, which a motion might share."""
SILENT = 1e-12
"""What stays within this part of its largest size is on no side: it has not changed it."""
ASIDE = 4
"""Rounding units of time by which a law is read beside its switch, and by how much more where that is too near."""


@dataclass(frozen=True, eq=False)
class Leg:
    """A span of time in which everything is smooth.

    Args:
        start: s.
        end: s.
        low: the earliest time in s at which it is read, after whatever jumps at the start.
        high: the latest, before whatever jumps at the end.
        model: the equations.
        p: their parameters, numbers of modes among them.
        dense: from times (k,) to states (k, n).
        steps: (s,) ends of the steps of the run, from start to end, s.
        assembly: the same equations with their guards; None where no part changes its mode.
        modes: of every element.
        turned: what a law has changed its sides by at the start, because of the motion.
    """

    start: float
    end: float
    low: float
    high: float
    model: Model
    p: Array
    dense: Callable[[Array], Array]
    steps: Array
    assembly: ModeEquations | None = None
    modes: ModeNames = ()
    turned: tuple[Expr, ...] = ()

    def read(self, times: Array) -> tuple[Array, Array]:
        """The times (k,), moved inside the leg, and the states (k, n) there."""
        inside = np.clip(times, self.low, self.high)
        return inside, self.dense(inside)

    def at(self, t: float) -> tuple[float, Array]:
        """The same for one time."""
        times, states = self.read(np.array([t]))
        return float(times[0]), states[0]


def parted(leg: Leg, equations: Differentiated) -> Iterator[Leg]:
    """A leg parted where the motion makes a law jump or bend."""
    grain = ASIDE * float(np.spacing(max(abs(leg.start), abs(leg.end))))
    met: dict[float, list[int]] = {}
    for time, number in sorted(_turned(leg, equations)):
        last = next(reversed(met), -np.inf)
        met.setdefault(last if time - last <= grain else time, []).append(number)
    rest = leg
    for time, numbers in met.items():
        low, high = _beside(rest, equations, time, numbers, grain)
        steps, turned = rest.steps, tuple(equations.turns[number] for number in numbers)
        yield replace(rest, end=time, high=low, steps=np.append(steps[steps < time], time))
        rest = replace(rest, start=time, low=high, steps=np.append(time, steps[steps > time]), turned=turned)
    yield rest


def _turned(leg: Leg, equations: Differentiated) -> Iterator[tuple[float, int]]:
    """Time and number of every switch of a law because of the motion."""
    if not equations.turns:
        return
    times = np.append((leg.steps[:-1, None] + np.diff(leg.steps)[:, None] * LOOKS).ravel(), leg.end)
    values = equations.turning(*leg.read(times), leg.p)
    for number, column in enumerate(values.T):
        sided = np.flatnonzero(np.abs(column) > SILENT * np.abs(column).max(initial=0.0))
        for k in np.flatnonzero(np.diff(np.sign(column[sided]))).tolist():
            yield _root(leg, equations, number, times[sided[k : k + 2]]), number


def _root(leg: Leg, equations: Differentiated, number: int, between: Array) -> float:
    """The time of a switch between two times (2,), in s."""

    def value(t: float) -> float:
        return float(equations.turning(*leg.read(np.array([t])), leg.p)[0, number])

    return float(brentq(value, *between, xtol=np.finfo(float).tiny, rtol=4 * np.finfo(float).eps))


def _beside(
    leg: Leg, equations: Differentiated, time: float, numbers: Sequence[int], grain: float
) -> tuple[float, float]:
    """Times in s just before and after a switch, at which laws are on their sides for sure."""
    aside = grain
    while True:
        low, high = max(time - aside, leg.low), min(time + aside, leg.high)
        before, after = equations.turning(*leg.read(np.array([low, high])), leg.p)[:, list(numbers)]
        if (before * after < 0).all() or low == leg.low or high == leg.high:
            return low, high
        aside *= ASIDE
