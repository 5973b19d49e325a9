"""Steps of Dormand and Prince's method of order 8(5,3), many of them in one call, compiled by numba.

A system is a function rates(t, x, p, dx) in machine code. What is compiled here knows it by its address, so that it is
compiled once for all systems, and numba keeps it for other processes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit, types
from scipy.integrate import DOP853

from shaftwork.numerics.machine_code import MATRIX, VECTOR, call_at

STAGES, FURTHER, SHAPES = 12, 3, 7
"""Stages of a step, those that dense output needs besides the slope at the end, and the shapes that make it."""
WEIGHTS = np.vstack([DOP853.B, DOP853.E5[:STAGES], DOP853.E3[:STAGES]])
BEFORE, AFTER = np.ascontiguousarray(DOP853.A), np.ascontiguousarray(DOP853.A_EXTRA)
NODES, LATER, DENSE = DOP853.C.copy(), DOP853.C_EXTRA.copy(), np.ascontiguousarray(DOP853.D)


def _compiled(signature: Any) -> Callable[[Any], Any]:
    """Compile a function, and keep it for other processes where there is a folder for it."""

    def decorate(function: Any) -> Any:
        try:
            return njit(signature, error_model="numpy", cache=True)(function)
        except RuntimeError:  # no folder can be written
            return njit(signature, error_model="numpy")(function)

    return decorate


_F = types.int64  # the address of a system
_part = njit(error_model="numpy")


@_part
def _stage(slopes, count, factors, x, step, y):  # type: ignore[no-untyped-def]
    """Write into y (n,) the state at the next stage, behind `count` of them."""
    y[:] = x
    for j in range(count):
        factor = step * factors[j]
        for i in range(x.size):
            y[i] += factor * slopes[j, i]


@_part
def _all_stages(rates, p, span, t, x, step, slopes, y, end):  # type: ignore[no-untyped-def]
    """Write the slopes of a step whose first is known, and the state at its end."""
    for stage in range(1, STAGES):
        _stage(slopes, stage, BEFORE[stage], x, step, y)
        call_at(rates, min(max(t + NODES[stage] * step, span[0]), span[1]), y, p, slopes[stage])
    _stage(slopes, STAGES, WEIGHTS[0], x, step, end)


@_part
def _shapes(rates, p, span, t, x, step, slopes, y, end, shapes):  # type: ignore[no-untyped-def]
    """Write what makes the dense output of a step from all its slopes, with that at the end."""
    for stage in range(FURTHER):
        _stage(slopes, STAGES + 1 + stage, AFTER[stage], x, step, y)
        call_at(rates, min(max(t + LATER[stage] * step, span[0]), span[1]), y, p, slopes[STAGES + 1 + stage])
    for i in range(x.size):
        change = end[i] - x[i]
        shapes[0, i] = change
        shapes[1, i] = step * slopes[0, i] - change
        shapes[2, i] = 2 * change - step * (slopes[STAGES, i] + slopes[0, i])
        for row in range(SHAPES - 3):
            total = 0.0
            for j in range(STAGES + 1 + FURTHER):
                total += DENSE[row, j] * slopes[j, i]
            shapes[3 + row, i] = step * total


@_part
def _inside(shapes, x, part, y):  # type: ignore[no-untyped-def]
    """Write the state at a part of a step."""
    for i in range(x.size):
        total = 0.0
        for k in range(SHAPES):
            total = (total + shapes[SHAPES - 1 - k, i]) * (part if k % 2 == 0 else 1 - part)
        y[i] = x[i] + total


@_compiled(
    types.Tuple((types.int64, types.float64, types.int64))(  # type: ignore[no-untyped-call]
        _F, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, types.float64, VECTOR, VECTOR, MATRIX, types.float64, MATRIX
    )
)
def advance(rates, p, span, limits, x, atol, rtol, ends, lengths, states, part, middles):  # type: ignore[no-untyped-def]
    """Make steps until there is no room for more, the end is reached, or one becomes too small.

    Args:
        rates: address of the system.
        p: its parameters.
        span: the earliest and the latest time in s at which it is evaluated.
        limits: time at the start, end, first step and longest step, s.
        x: (n,) state at the start.
        atol: (n,) absolute tolerances.
        rtol: relative one.
        ends: (k,) takes the times at the ends of the steps, s.
        lengths: (k,) takes their lengths, s.
        states: (k, n) takes the states there.
        part: of a step,
        middles: (k, n) takes the states there; (0, n) if nobody looks at them.

    Returns:
        How many steps were made, the length of the next one in s, and how many were tried.
    """
    n, (t, end, step, longest) = x.size, limits
    slopes, shapes = np.empty((STAGES + 1 + FURTHER, n)), np.empty((SHAPES, n))
    begin, y, new = x.copy(), np.empty(n), np.empty(n)
    call_at(rates, min(max(t, span[0]), span[1]), x, p, slopes[0])
    count, tried, shrunk = 0, 0, False
    while count < ends.size and t < end:
        if not step > 10 * np.spacing(abs(t)):
            break
        left = end - t
        last = min(step, longest) >= left
        length = left if last else min(step, longest)
        _all_stages(rates, p, span, t, begin, length, slopes, y, new)
        tried += 1
        fifth, third = 0.0, 0.0
        for i in range(n):
            scale, a, b = atol[i] + rtol * max(abs(begin[i]), abs(new[i])), 0.0, 0.0
            for j in range(STAGES):
                a += WEIGHTS[1, j] * slopes[j, i]
                b += WEIGHTS[2, j] * slopes[j, i]
            fifth += (a / scale) ** 2
            third += (b / scale) ** 2
        whole = fifth + 0.01 * third
        error = length * fifth / np.sqrt(whole * n) if whole > 0 else whole
        if not error < 1:
            step = length * (max(0.2, 0.9 * error**-0.125) if error >= 1 and error < np.inf else 0.2)
            shrunk = True
            continue
        factor = min(10.0, max(0.2, 0.9 * error**-0.125)) if error > 0 else 10.0
        step = length * (min(1.0, factor) if shrunk else factor)
        shrunk = False
        reached = end if last else t + length
        call_at(rates, min(max(reached, span[0]), span[1]), new, p, slopes[STAGES])
        if middles.shape[0]:
            _shapes(rates, p, span, t, begin, length, slopes, y, new, shapes)
            _inside(shapes, begin, part, middles[count])
        ends[count], lengths[count], states[count] = reached, length, new
        t, begin[:], slopes[0] = reached, new, slopes[STAGES]
        count += 1
    return count, step, tried


@_compiled(types.void(_F, VECTOR, MATRIX, VECTOR, VECTOR, MATRIX, types.Array(types.int64, 1, "C"), VECTOR, MATRIX))
def between(rates, p, spans, starts, lengths, states, numbers, times, values):  # type: ignore[no-untyped-def]
    """Write the states at times inside steps, which are made again.

    Args:
        rates: address of the system.
        p: its parameters.
        spans: (s, 2) of each step the earliest and latest time in s at which the system is evaluated.
        starts: (s,) of the steps, s.
        lengths: (s,) of the steps, s.
        states: (s, n) at their starts.
        numbers: (k,) of the step of each time; the same ones behind each other.
        times: (k,) s.
        values: (k, n) takes the states.
    """
    n, prepared = states.shape[1], -1
    slopes, shapes = np.empty((STAGES + 1 + FURTHER, n)), np.empty((SHAPES, n))
    y, end = np.empty(n), np.empty(n)
    for k in range(times.size):
        number = numbers[k]
        t, length, x, span = starts[number], lengths[number], states[number], spans[number]
        if number != prepared:
            call_at(rates, min(max(t, span[0]), span[1]), x, p, slopes[0])
            _all_stages(rates, p, span, t, x, length, slopes, y, end)
            call_at(rates, min(max(t + length, span[0]), span[1]), end, p, slopes[STAGES])
            _shapes(rates, p, span, t, x, length, slopes, y, end, shapes)
            prepared = number
        _inside(shapes, x, (times[k] - t) / length, values[k])


@_compiled(types.void(_F, VECTOR, VECTOR, MATRIX, MATRIX))
def watch(watched, p, times, states, values):  # type: ignore[no-untyped-def]
    """Write what is watched at times and states.

    Args:
        watched: address of what writes it.
        p: parameters.
        times: (k,) s.
        states: (k, n) then.
        values: (k, m) takes it.
    """
    for k in range(times.size):
        call_at(watched, times[k], states[k], p, values[k])
