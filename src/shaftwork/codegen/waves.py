"""A network with lossless lines as arrays: its states, and the histories at the ends of its lines."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, lru_cache
from typing import Any, Protocol, runtime_checkable

import numpy as np

from shaftwork.codegen.arrays import BoundArrays
from shaftwork.codegen.code import scalar
from shaftwork.codegen.elements import Array
from shaftwork.codegen.recovery import History
from shaftwork.components.base import Profile
from shaftwork.network.graph import GraphPart
from shaftwork.network.templates import BranchTemplate


class Dense(Protocol):
    """States, and histories behind them, at any time."""

    @property
    def steps(self) -> Array:
        """Ends of the steps, the start first, s."""
        ...

    def __call__(self, times: Array) -> Array:
        """(k, n) at times (k,)."""
        ...


@runtime_checkable
class Carrying(Protocol):
    """What a motion of a network with lines can tell besides."""

    def held(self, times: Array) -> Array:
        """(k, lines) energy in J that is on its way in each line at times (k,)."""
        ...


class WaveSystem:
    """Rates and speeds of the ends for states x (n, k) and histories h (q, k); the ends a and b of each line in a row.

    Args:
        bound: the array program for one parameter vector.
    """

    def __init__(self, bound: BoundArrays) -> None:
        self._bound, self._form = bound, bound.program.form
        place = {branch: k for k, branch in enumerate(self._form.outputs)}
        self._ends = np.array([place[branch] for branch in self._form.waves], dtype=np.intp)

    def rhs(self, t: Array, x: Array, h: Array) -> Array:
        """d x / dt (n, k) at times (k,)."""
        return self._bound.rhs(t, np.concatenate([x, h]))

    def speeds(self, t: Array, x: Array, h: Array) -> Array:
        """The speeds (q, k) of the ends at times (k,)."""
        y, _ = self._bound.values(t, np.concatenate([x, h]))
        return np.asarray(y[self._ends])

    def jacobian(self, t: float, x: Array, h: Array) -> Any:
        """d rhs / d x, sparse, at one time with x (n,) and h (q,)."""
        return self._bound.jacobian(t, np.concatenate([x, h]))

    @cached_property
    def lines(self) -> tuple[Array, Array]:
        """Impedances in N m s and delays in s (q / 2,)."""
        graph, p = self._form.graph, self._bound.p
        made = []
        for branch in self._form.waves[::2]:
            template, places = graph.branches[branch].template, graph.part_of(branch).parameters
            made.append(_line(template)(*(float(p[places[symbol.name]]) for symbol in template.symbols)))
        impedances, delays = np.array(made).T
        return impedances, delays


@lru_cache(maxsize=256)
def _line(template: BranchTemplate) -> Callable[..., Sequence[float]]:
    """From the values of its symbols to a line's impedance and delay."""
    return scalar(template.symbols, template.line or ())


def along_lines(bound: BoundArrays, part: GraphPart, profile: Profile, t: Array, dense: Dense) -> Array:
    """(k, places) torque or speed along a part that is made of lines.

    Law: tau = (f - g) / 2, omega = (f + g) / (2 Z), with f and g the waves that have left the two ends and come by.
    """
    lines = dict(zip(bound.program.form.waves[::2], zip(*WaveSystem(bound).lines, strict=True), strict=True))
    labels = {bound.program.form.graph.branches[k].template.label: k for k in part.branches}
    made = np.empty((len(t), len(profile.lines)))
    for place, (label, share) in enumerate(profile.lines):
        first = labels[f"{label}_a" if f"{label}_a" in labels else f"{label}_middle"]
        second = labels[f"{label}_b" if f"{label}_b" in labels else f"{label}_middle"]
        impedance, delay = lines[first]
        f = _leaving(bound, (first, second), impedance, delay, t - share * delay, dense)
        g = _leaving(bound, (second, first), impedance, delay, t - (1 - share) * delay, dense)
        made[:, place] = (f - g) / 2 if profile.kind == "through" else (f + g) / (2 * impedance)
    return made


def _leaving(
    bound: BoundArrays, ends: tuple[int, int], impedance: float, delay: float, times: Array, dense: Dense
) -> Array:
    """The wave that leaves the first of a line's ends at some times: 2 Z v + h.

    Before the start it is a straight line in time, and arrives at the second end within the first delay.
    """
    start = dense.steps[0]
    inside = np.maximum(times, start)
    order = np.argsort(inside, kind="stable")
    history = History(bound, inside[order], dense(inside[order]))
    values = np.empty(len(times))
    values[order] = 2 * impedance * history.across[ends[0]] + history.through[ends[0]]
    marks = start + np.array([0.25, 0.5]) * min(delay, dense.steps[-1] - start)
    early, late = -History(bound, marks, dense(marks)).through[ends[1]]
    before = early + (late - early) / (marks[1] - marks[0]) * (times + delay - marks[0])
    return np.where(times >= start, values, before)
