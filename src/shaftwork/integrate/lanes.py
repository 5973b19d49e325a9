"""Variants side by side through one heyoka program, each up to its own guard or end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shaftwork.integrate.heyoka_taylor import LOOSEST_TOLERANCE, TIGHTEST_TOLERANCE
from shaftwork.integrate.problem import Array

# A step is at most so many output intervals long: where a motion starts as a polynomial, the last terms of a series are
# zero and would let the first step have no end.
LONGEST_STEP = 2.0
ARRIVED = (-(2**32) - 3, -(2**32) - 1)
"""heyoka's outcomes time_limit and success."""
MOST_STEPS = 1_000_000
"""Of one lane, between two changes of mode."""
Block = tuple[Array, Array, Array, Array]
"""Of some lanes: start states, parameters, output times, and (1, width) the longest steps in s."""


@dataclass(frozen=True, eq=False)
class Lanes:
    """Variants over one stretch of their motion.

    Args:
        t: (m, k) output times in s; after its guard a lane stays there.
        x: (m, n, k) states and, behind them, integrals.
        met: (k,) guard at which a lane has ended, or -1.
        good: (k,) whether it came there.
        steps: (k,) that it took.
    """

    t: Array
    x: Array
    met: NDArray[np.intp]
    good: NDArray[np.bool_]
    steps: NDArray[np.intp]


def run_lanes(program: Any, x: Array, p: Array, sides: Array, offsets: Array, t: Array, rtol: float) -> Lanes:
    """Integrate variants of one system.

    Args:
        program: a `codegen.lanes.LaneProgram`.
        x: (n, k) start states.
        p: (parameters, k).
        sides: (guards,) on which each is met.
        offsets: (guards, k) how far beyond zero it has to go.
        t: (m, k) output times in s, strictly increasing, the first one the start.
        rtol: relative tolerance.
    """
    integrator = program.integrator(min(max(rtol, TIGHTEST_TOLERANCE), LOOSEST_TOLERANCE))
    width, count = integrator.batch_size, t.shape[1]
    padded = np.minimum(np.arange(-(-count // width) * width), count - 1)  # the last one stands in for what is missing
    start = np.zeros((integrator.dim, count))
    start[: len(x)] = x
    full = np.concatenate([p, np.ones((1, count)), np.repeat(sides[:, None], count, axis=1), offsets])
    longest = LONGEST_STEP * (t[-1:] - t[:1]) / (len(t) - 1)
    given = (start, full[: len(integrator.pars)], t, longest)  # heyoka keeps no parameters behind the last one it reads
    blocks = zip(*(_blocks(values, padded, width) for values in given), strict=True)
    ends, met = np.full(padded.size, np.inf), np.full(padded.size, -1, dtype=np.intp)
    states, steps = np.empty((len(t), integrator.dim, padded.size)), []
    for first, block in zip(range(0, padded.size, width), blocks, strict=True):
        states[:, :, first : first + width] = _run(program, integrator, block)
        steps += [taken for _, _, _, taken in integrator.propagate_res]
        for lane, (guard, time) in program.met.items():
            met[first + lane], ends[first + lane] = guard, time
    good = np.isfinite(states[-1]).all(axis=0)
    times = np.minimum(t, ends[:count]) if np.isfinite(ends).any() else t
    return Lanes(times, states[:, :, :count], met[:count], good[:count], np.array(steps[:count]))


def _blocks(values: Array, lanes: NDArray[np.intp], width: int) -> Array:
    """(blocks, rows, width) of some lanes of (rows, lanes)."""
    taken = values if values.shape[1] == lanes.size else values[:, lanes]
    return np.ascontiguousarray(taken.reshape(len(values), -1, width).swapaxes(0, 1))


def _run(program: Any, integrator: Any, block: Block) -> Array:
    """(m, n, width) states of some lanes, NaN in those that fail; where one does, the others run once more without."""
    states, ends = _propagated(program, integrator, block), block[2][-1]
    if (integrator.time >= ends).all():
        return states
    lanes = own = np.arange(ends.size)
    while not (integrator.time >= ends[own]).all():
        # those that a failure of another one has cut off have the outcome of a good step
        failed = np.array([int(result[0]) not in ARRIVED for result in integrator.propagate_res])
        if failed.all() or not failed.any():
            return np.full_like(states, np.nan)
        own = np.where(failed, own[~failed][0], own)
        start, p, times, longest = (np.ascontiguousarray(values[:, own]) for values in block)
        states = _propagated(program, integrator, (start, p, times, longest))
    states[:, :, own != lanes] = np.nan
    return states


def _propagated(program: Any, integrator: Any, block: Block) -> Array:
    """(m, n, width) states of some lanes, as far as all of them come."""
    start, p, times, longest = block
    integrator.set_time(times[0])
    integrator.state[:] = start
    integrator.pars[:] = p
    if integrator.with_events:
        integrator.reset_cooldowns()
    program.met.clear()
    _, states = integrator.propagate_grid(times, max_delta_t=longest[0], max_steps=MOST_STEPS)
    return np.asarray(states)
