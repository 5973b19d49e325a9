"""The variational equation, linear along a motion that is known, solved by Gauss collocation.

All steps are made at once: a step takes Y to (1 + P) Y + Q, whatever Y is, so P and Q of every step come from one stack
of linear systems, and only their products follow one after another.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shaftwork.codegen.array_form.elements import Array
from shaftwork.core.errors import SimulationError
from shaftwork.numerics.polynomials import to_integrals
from shaftwork.results.observer import blocks

STAGES = 6
"""Of a step: order 12, and no stage on its ends, where laws jump."""

Coefficients = Callable[[Array], tuple[Array, Array]]
"""From times (k,) to A (k, N, n) and B (k, N, m) of Y' = A Y[:n] + B; rows behind the first n are mere integrals."""

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(STAGES)
NODES = (_POINTS + 1) / 2
# integrals from the start of a step to each node and to its end, from values at the nodes
_TO_NODES, _TO_END = to_integrals(_POINTS) / 2, _WEIGHTS / 2


@dataclass(frozen=True, eq=False)
class Variation:
    """The solution of the variational equation over a span of time.

    Args:
        coefficients: A and B.
        ends: (s,) ends of the steps, s.
        values: (s, N, m) Y there.
    """

    coefficients: Coefficients
    ends: Array
    values: Array

    def at(self, times: Array) -> Array:
        """(k, N, m) Y at times (k,) in s."""
        steps = np.clip(np.searchsorted(self.ends, times, side="right") - 1, 0, len(self.ends) - 1)
        values, lengths = self.values[steps], times - self.ends[steps]
        if (within := (lengths > 0.0) & (steps < len(self.ends) - 1)).any():
            maps = _maps(self.coefficients, self.ends[steps[within]], lengths[within])
            values[within] = _stepped(maps, values[within])
        return np.asarray(values)


def variation(
    coefficients: Coefficients, ends: Array, start: Array, sizes: Array, least: Array, rtol: float
) -> Variation:
    """Solve Y' = A Y[:n] + B; steps are halved until the halves say the same.

    Args:
        coefficients: A and B, smooth between the first and the last of the ends; never asked for there.
        ends: (s,) ends of the steps of the run, increasing, s.
        start: (N, m) Y at the first of them.
        sizes: (N,) sizes of what Y are the slopes of: those of one parameter are held against each other by them.
        least: (m,) slopes, as parts of those sizes, below which all is rounding.
        rtol: error of a step, as a part of the largest slope by the same parameter so far.

    Raises:
        SimulationError: it takes too many steps, or there is no value.
    """
    # Eight steps of the run are one at first: an implicit method need not follow what has died away.
    ends = np.append(ends[:-1:8], ends[-1])
    begins, lengths = ends[:-1], np.diff(ends)
    steps = _Steps(begins, lengths, _maps(coefficients, begins, lengths), np.zeros(len(lengths), dtype=bool))
    while True:
        parts, whole = _parted(coefficients, steps)
        values = _passed(parts.maps, start)
        errors = np.abs(_stepped(steps.maps[~steps.right], values[whole]) - values[whole + 2])
        largest = np.maximum.accumulate((np.abs(values) / sizes[:, None]).max(axis=1, initial=0.0), axis=0)
        scale = sizes[:, None] * np.maximum(largest, least)[:, None]
        # Two halves are more than 64 times as close to the solution as to the whole.
        accurate = (errors <= 64 * rtol * scale[whole + 2]).all(axis=(1, 2))
        parts.right[whole] = parts.right[whole + 1] = accurate
        if parts.right.all():
            return Variation(coefficients, np.append(parts.begins, ends[-1]), values)
        if len(parts.begins) > 1_000_000 or not np.isfinite(values).all():
            worst = int(np.argmin(parts.right))
            raise SimulationError(f"The sensitivities could not be integrated beyond t = {parts.begins[worst]:.9g} s.")
        steps = parts


class _Steps(NamedTuple):
    """Steps in a row.

    Args:
        begins: (s,) s.
        lengths: (s,) s.
        maps: (s, N, n + m) see `_maps`.
        right: (s,) which of them need no smaller ones.
    """

    begins: Array
    lengths: Array
    maps: Array
    right: NDArray[np.bool_]


def _parted(coefficients: Coefficients, steps: _Steps) -> tuple[_Steps, NDArray[np.intp]]:
    """Two halves for each step that is not right, and where the first ones are."""
    order = np.repeat(np.arange(len(steps.begins)), np.where(steps.right, 1, 2))
    first, halved = np.append(True, order[1:] != order[:-1]), ~steps.right[order]
    lengths = np.where(halved, steps.lengths[order] / 2, steps.lengths[order])
    begins = np.where(first, steps.begins[order], steps.begins[order] + lengths)
    maps = steps.maps[order]
    maps[halved] = _maps(coefficients, begins[halved], lengths[halved])
    return _Steps(begins, lengths, maps, ~halved), np.flatnonzero(first & halved)


def _passed(maps: Array, start: Array) -> Array:
    """(s + 1, N, m) Y before the first step and after each."""
    values = np.empty((len(maps) + 1, *start.shape))
    values[0] = start
    for k, one in enumerate(maps):
        values[k + 1] = _stepped(one, values[k])
    return values


def _stepped(maps: Array, before: Array) -> Array:
    """(..., N, m) Y after steps, from Y before them."""
    size = maps.shape[-1] - before.shape[-1]
    return np.asarray(before + maps[..., :size] @ before[..., :size, :] + maps[..., size:])


def _maps(coefficients: Coefficients, begins: Array, lengths: Array) -> Array:
    """(s, N, n + m) of each step P and, beside it, Q."""
    A, B = coefficients((begins[:, None] + lengths[:, None] * NODES).ravel())
    (_, every, size), columns = A.shape, A.shape[2] + B.shape[2]
    both = np.concatenate([A, B], axis=2).reshape(len(begins), STAGES, every, columns)
    maps = np.empty((len(begins), every, columns))
    for steps in blocks(len(begins), (STAGES * size) ** 2):
        maps[steps] = _solved(both[steps], size, lengths[steps])
    return maps


def _solved(both: Array, size: int, lengths: Array) -> Array:
    """The same for as many steps as are solved at once, from A and B (s, stages, N, n + m)."""
    count, columns = len(both), both.shape[-1]
    h = lengths[:, None, None, None]
    # K_i = A_i (Y + h sum_j a_ij K_j) + B_i for the slopes K at the stages
    system = -(lengths[:, None, None] * _TO_NODES)[:, :, None, :, None] * both[:, :, :size, None, :size]
    system = system.reshape(count, STAGES * size, STAGES * size) + np.eye(STAGES * size)
    right = both[:, :, :size].reshape(count, STAGES * size, columns)
    K = np.linalg.solve(system, right).reshape(count, STAGES, size, columns)
    moved = h * np.tensordot(_TO_NODES, K, (1, 1)).swapaxes(0, 1)
    beside = both[:, :, size:] + both[:, :, size:, :size] @ moved
    return np.asarray(lengths[:, None, None] * np.einsum("i,sipc->spc", _TO_END, np.concatenate([K, beside], axis=2)))
