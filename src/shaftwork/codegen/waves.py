"""A network with lossless lines as arrays: its states, and the histories at the ends of its lines."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, lru_cache
from typing import Any, Protocol, runtime_checkable

import numpy as np

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.code import scalar
from shaftwork.components.base import Profile
from shaftwork.network.graph import GraphPart
from shaftwork.network.templates import BranchTemplate


class DenseWaves(Protocol):
    """States, and histories behind them, at any time."""

    @property
    def steps(self) -> Array:
        """Ends of the steps, the start first, s."""
        ...

    def __call__(self, times: Array) -> Array:
        """(k, n) at times (k,)."""
        ...


@runtime_checkable
class WaveReadings(Protocol):
    """What a motion of a network with lines can tell besides."""

    def held(self, times: Array) -> Array:
        """(k, lines) energy in J that is on its way in each line at times (k,)."""
        ...

    def leaving(self, times: Array) -> Array:
        """(k, ends) the waves 2 Z v + h in N m that leave the ends at times (k,), also before the start."""
        ...


LARGEST_FULL = 64
"""Up to so many states full matrices are faster than sparse ones."""


class WaveSystem:
    """Rates and speeds of the ends for states x (n, k) and histories h (q, k); the ends a and b of each line in a row.

    Args:
        bound: the array program for one parameter vector.
    """

    def __init__(self, bound: BoundArrays) -> None:
        self._bound, self._form = bound, bound.program.form
        place = {branch: k for k, branch in enumerate(self._form.outputs)}
        self._ends = np.array([place[branch] for branch in self._form.waves], dtype=np.intp)
        self._full = bound.full() if len(self._form.states) <= LARGEST_FULL else None

    def rhs(self, t: Array, x: Array, h: Array) -> Array:
        """d x / dt (n, k) at times (k,)."""
        if self._full is None:
            return self._bound.rhs(t, np.concatenate([x, h]))
        by_state, by_input, outputs = self._full
        inputs = self._bound.program.inputs
        u = inputs.values(t, outputs @ x, np.concatenate([x, h]), self._bound.p)
        return np.asarray(by_state @ x + by_input @ u)

    def speeds(self, t: Array, x: Array, h: Array) -> Array:
        """The speeds (q, k) of the ends at times (k,)."""
        return np.asarray(self._bound.outputs(t, np.concatenate([x, h]))[self._ends])

    def jacobian(self, t: float, x: Array, h: Array) -> Any:
        """d rhs / d x, sparse, at one time with x (n,) and h (q,)."""
        return self._bound.jacobian(t, np.concatenate([x, h]))

    @cached_property
    def lines(self) -> tuple[Array, Array]:
        """Impedances in N m s and delays in s (q / 2,)."""
        graph, p = self._form.graph, self._bound.p
        pairs = []
        for branch in self._form.waves[::2]:
            template, places = graph.branches[branch].template, graph.part_of(branch).parameters
            pairs.append(_line(template)(*(float(p[places[symbol.name]]) for symbol in template.symbols)))
        impedances, delays = np.array(pairs).T
        return impedances, delays


@lru_cache(maxsize=256)
def _line(template: BranchTemplate) -> Callable[..., Sequence[float]]:
    """From the values of its symbols to a line's impedance and delay."""
    return scalar(template.symbols, template.line or ())


def along_lines(bound: BoundArrays, part: GraphPart, profile: Profile, t: Array, dense: WaveReadings) -> Array:
    """(k, places) torque or speed along a part that is made of lines.

    Law: tau = (f - g) / 2, omega = (f + g) / (2 Z), with f and g the waves that have left the two ends and come by.
    """
    ends, (impedances, delays) = bound.program.form.waves, WaveSystem(bound).lines
    labels = {bound.program.form.graph.branches[k].template.label: k for k in part.branches}
    values = np.empty((len(t), len(profile.lines)))
    for place, (label, share) in enumerate(profile.lines):
        first = ends.index(labels[f"{label}_a" if f"{label}_a" in labels else f"{label}_middle"])
        impedance, delay = float(impedances[first // 2]), float(delays[first // 2])
        f = dense.leaving(t - share * delay)[:, first]
        g = dense.leaving(t - (1 - share) * delay)[:, first + 1]
        values[:, place] = (f - g) / 2 if profile.kind == "through" else (f + g) / (2 * impedance)
    return values
