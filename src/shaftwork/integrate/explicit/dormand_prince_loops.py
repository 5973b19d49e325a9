"""Steps of Dormand and Prince's method of order 8(5,3), many of them in one call, compiled by numba.

A system is a function rates(t, x, p, dx) in machine code. What is compiled here knows it by its address, so that it is
compiled once for all systems, and numba keeps it for other processes. Numbers are copied one by one: to compile `a[:] =
b` takes numba a second.
"""

from __future__ import annotations

import math

import numpy as np
from numba import types
from scipy.integrate import DOP853

from shaftwork.integrate.crossings import LEFT, RESTING
from shaftwork.integrate.engines import ENGINES
from shaftwork.integrate.explicit.explicit_runs import INSIDE
from shaftwork.numerics.machine_code import MATRIX, VECTOR, call_at, compiled, inner
from shaftwork.numerics.tolerances import EPS
from shaftwork.numerics.zeros import LOOKS

STAGES, FURTHER, SHAPES = 12, 3, 7
"""Stages of a step, those that dense output needs besides the slope at the end, and the shapes that make it."""
WEIGHTS = np.vstack([DOP853.B, DOP853.E5[:STAGES], DOP853.E3[:STAGES]])
FINEST = ENGINES["numba"].finest
BEFORE, AFTER = np.ascontiguousarray(DOP853.A), np.ascontiguousarray(DOP853.A_EXTRA)
NODES, LATER, DENSE = DOP853.C.copy(), DOP853.C_EXTRA.copy(), np.ascontiguousarray(DOP853.D)
PARTS = np.array([0.0, *LOOKS, 1.0])
"""Where a step near a guard or a switch is looked at, as parts of it."""

_PLACES = types.Array(types.int64, 1, "C")
_SYSTEM = types.Tuple((types.int64, types.int64, types.int64, types.float64, types.float64, VECTOR))  # type: ignore[no-untyped-call]
"""Addresses of its rates and of what is watched, how many of that are guards, the earliest and the latest time in s at
which both are evaluated, and their parameters."""
COURSE = PARTS.size + 5
"""Rows of what is watched in a step: at its parts, anywhere, at its start moved by the tolerance; the sides and offsets
with which it is a height above zero; and how often in a row the motion has rested at a switch."""


@inner
def _copy(x, y):  # type: ignore[no-untyped-def]
    for i in range(x.size):
        y[i] = x[i]


@inner
def _rates(system, t, x, slope):  # type: ignore[no-untyped-def]
    rates, _, _, low, high, p = system
    call_at(rates, min(max(t, low), high), x, p, slope)


@inner
def _values(system, t, x, values):  # type: ignore[no-untyped-def]
    _, watched, _, low, high, p = system
    call_at(watched, min(max(t, low), high), x, p, values)


@inner
def _stage(slopes, factors, x, step, y):  # type: ignore[no-untyped-def]
    """Write into y (n,) the state at the next stage."""
    _copy(x, y)
    for j in range(factors.size):
        factor = step * factors[j]
        if factor != 0:  # those of later stages are zero
            for i in range(x.size):
                y[i] += factor * slopes[j, i]


@inner
def _all_stages(system, t, x, step, slopes, y, end):  # type: ignore[no-untyped-def]
    """Write the slopes of a step whose first is known, and the state at its end."""
    for stage in range(1, STAGES):
        _stage(slopes, BEFORE[stage], x, step, y)
        _rates(system, t + NODES[stage] * step, y, slopes[stage])
    _stage(slopes, WEIGHTS[0], x, step, end)


@inner
def _shapes(system, t, x, step, slopes, y, end, shapes):  # type: ignore[no-untyped-def]
    """Write what makes the dense output of a step from all its slopes, with that at the end; behind it its start."""
    for stage in range(FURTHER):
        _stage(slopes, AFTER[stage], x, step, y)
        _rates(system, t + LATER[stage] * step, y, slopes[STAGES + 1 + stage])
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
        shapes[SHAPES, i] = x[i]


@inner
def _inside(shapes, part, y):  # type: ignore[no-untyped-def]
    """Write the state at a part of a step."""
    for i in range(y.size):
        total = 0.0
        for k in range(SHAPES):
            total = (total + shapes[SHAPES - 1 - k, i]) * (part if k % 2 == 0 else 1 - part)
        y[i] = shapes[SHAPES, i] + total


@inner
def _error(system, t, x, new, step, slopes, y, sizes, atol, rtol):  # type: ignore[no-untyped-def]
    """Of a step, in parts of its tolerance: of its states or, where that is larger, of the rates inside it.

    Users read rates, as the torque on an inertia and the speed of a twist: small differences of large states. What the
    error changes in them counts against the largest so far, unless the states are as right as rounding lets them be.
    """
    missed, moved, states, rates = slopes[STAGES + 1], slopes[STAGES + 2], 0.0, 0.0
    _stage(slopes, BEFORE[INSIDE], x, step, y)
    for i in range(x.size):
        fifth, third = 0.0, 0.0
        for j in range(STAGES):
            fifth += WEIGHTS[1, j] * slopes[j, i]
            third += WEIGHTS[2, j] * slopes[j, i]
        whole = math.sqrt(fifth**2 + 0.01 * third**2)
        missed[i] = step * fifth * abs(fifth) / whole if whole > 0 else whole
        states += (missed[i] / (atol[i] + rtol * max(abs(x[i]), abs(new[i])))) ** 2
        y[i] += missed[i]
    states = math.sqrt(states / max(x.size, 1))
    if not 0 < states < 1:
        return states
    _rates(system, t + NODES[INSIDE] * step, y, moved)
    for i in range(x.size):
        change, sizes[i] = moved[i] - slopes[INSIDE, i], max(sizes[i], abs(slopes[0, i]), abs(slopes[INSIDE, i]))
        rates += (change / (rtol * sizes[i])) ** 2 if change != 0 else 0.0
    rates = math.sqrt(rates / x.size)
    return min(rates, states * rtol / FINEST) if rates > states else states


@inner
def _factor(error, before, most):  # type: ignore[no-untyped-def]
    """How many times as long the next step may be, by the errors of the last two: Hairer and Wanner, II, IV.2."""
    if error == 0:
        return most
    return min(most, max(0.2, 0.95 * error**-0.1 * before**0.05)) if error < np.inf else 0.2


@inner
def _first_step(system, t, x, slope, limits, atol, rtol, y, other):  # type: ignore[no-untyped-def]
    """A first step in s of which the error is small: Hairer, section II.4."""
    size, speed, bend, n = 0.0, 0.0, 0.0, max(x.size, 1)
    for i in range(x.size):
        scale = atol[i] + rtol * abs(x[i])
        size, speed = size + (x[i] / scale) ** 2, speed + (slope[i] / scale) ** 2
    size, speed = math.sqrt(size / n), math.sqrt(speed / n)
    guess = min(0.01 * size / speed if size > 1e-5 and speed > 1e-5 else 1e-6, limits[1] - t)
    for i in range(x.size):
        y[i] = x[i] + guess * slope[i]
    _rates(system, t + guess, y, other)
    for i in range(x.size):
        bend += ((other[i] - slope[i]) / (atol[i] + rtol * abs(x[i]))) ** 2
    largest = max(speed, math.sqrt(bend / n) / guess)
    step = max(1e-6, 1e-3 * guess) if largest <= 1e-15 else (0.01 / largest) ** 0.125
    return max(min(100 * guess, step, limits[3]), 20 * EPS * abs(t))  # a state near zero is short of time alone


@inner
def _height(course, row, c):  # type: ignore[no-untyped-def]
    """How far a guard is within its limit, or a switch on the side on which it starts."""
    side = course[PARTS.size + 2, c]
    return side * course[row, c] + course[PARTS.size + 3, c] if side != 0 else -abs(course[row, c])


@inner
def _is_near(system, places, t, x, step, slopes, y, new, course):  # type: ignore[no-untyped-def]
    """Whether a guard or a switch is less than twice as far from zero as it moves in a step.

    Inside it the state is that of the cubic with the right values and slopes at both ends.
    """
    last, side = PARTS.size - 1, PARTS.size + 2
    for i in range(x.size):
        y[i] = (x[i] + new[i]) / 2 + step / 8 * (slopes[0, i] - slopes[STAGES, i])
    _values(system, t + step / 2, y, course[1])
    _values(system, t + step, new, course[last])
    for c in range(system[2], course.shape[1]):
        course[side, c] = (course[0, c] > 0) * 1.0 - (course[0, c] < 0)
    for c in places:
        low, high, unknown = np.inf, -np.inf, 0.0
        for row in (0, 1, last):
            height = _height(course, row, c)
            low, high, unknown = min(low, height), max(high, height), unknown + 0 * height
        if not (low > 2 * (high - low) + unknown or (course[side, c] == 0 and low == high)):
            return True
    return False


@inner
def _watched(looks, part, row):  # type: ignore[no-untyped-def]
    """Write what is watched at a part of a step into a row."""
    system, _, t, step, shapes, course = looks
    _inside(shapes, part, shapes[SHAPES + 1])
    _values(system, t + part * step, shapes[SHAPES + 1], course[row])


@inner
def _leaves(looks, c, band):  # type: ignore[no-untyped-def]
    """Parts of a step between which a height falls below zero by more than a band; -1 where it does not.

    It may between two rows, near the vertex of a parabola through three heights, as `crossings.vertices` has them.
    """
    _, _, _, _, _, course = looks
    before, last = 0.0, PARTS.size - 1
    for row in range(1, PARTS.size):
        here = _height(course, row, c)
        if here < -band:
            return before, PARTS[row]
        before = PARTS[row] if here >= 0 else before
        left, right = row - 1, min(row + 1, last)
        ta, tb, tc = PARTS[left], PARTS[row], PARTS[right]
        a, b, d = _height(course, left, c), here, _height(course, right, c)
        for _ in range(3):
            first, second = (b - a) / (tb - ta), (d - b) / (tc - tb)
            bend, slope = (second - first) / (tc - ta), (first * (tc - tb) + second * (tb - ta)) / (tc - ta)
            at = tb - slope / (2 * bend)
            if not (0 < b <= min(a, d) and bend > 0 and ta < at < tc and b - slope**2 / (4 * bend) < b / 2):
                break
            _watched(looks, at, PARTS.size)
            new = _height(course, PARTS.size, c)
            if new < -band:
                return ta if at < tb else tb, at
            if at < tb:
                ta, a, tb, b, tc, d = (ta, a, at, new, tb, b) if new < b else (at, new, tb, b, tc, d)
            else:
                ta, a, tb, b, tc, d = (tb, b, at, new, tc, d) if new < b else (ta, a, tb, b, at, new)
    return -1.0, -1.0


@inner
def _first_met(looks, atol, rtol, uneven):  # type: ignore[no-untyped-def]
    """The part of a step at which a switch leaves its side first and this switch, the same of a guard, or -1 for none;
    and whether a guard is beyond its limit from the start, or has no value anywhere.

    A switch at which the motion rests is not looked at.
    """
    system, places, t, step, shapes, course = looks
    y, moved, rests = shapes[SHAPES + 1], course[PARTS.size + 1], course[PARTS.size + 4]
    for row in range(1, PARTS.size - 1):
        _watched(looks, PARTS[row], row)
    for i in range(y.size):
        y[i] = shapes[SHAPES, i] + uneven[i] * (atol[i] + rtol * abs(shapes[SHAPES, i]))
    _values(system, t, y, moved)
    first, met, part, guard, unclear = 2.0, -1, 2.0, -1, False
    for c in places:
        is_guard, band = c < system[2], abs(moved[c] - course[0, c])
        if is_guard:
            band, unknown = 0.0, 0.0
            for row in range(PARTS.size):
                unknown += 0 * _height(course, row, c)
            unclear |= not _height(course, 0, c) > unknown
        elif abs(course[0, c]) > LEFT * band:
            rests[c] = 0
        low, high = _leaves(looks, c, band) if rests[c] < RESTING else (-1.0, -1.0)
        if course[PARTS.size + 2, c] == 0:
            low, high = 0.0, min(high, 0.0)  # it leaves zero at once
        while high - low > EPS * max(abs(t), abs(t + step)) / step:
            middle = (low + high) / 2
            _watched(looks, middle, PARTS.size)
            low, high = (middle, high) if _height(course, PARTS.size, c) >= 0 else (low, middle)
        if is_guard and 0 <= high < part:
            part, guard = high, c
        elif not is_guard and high >= 0 and low < first:
            first, met = low, c
    return first, met, part, guard, unclear


@inner
def _end_at_switch(looks, part, c, end, limits, atol, rtol, rate):  # type: ignore[no-untyped-def]
    """The time in s at which a step has to end for a switch that leaves its side, if there is one; else infinite.

    It is that of `Crossings.cut`.
    """
    system, places, t, step, shapes, course = looks
    if c < 0:
        for switch in places:
            near = abs(course[0, switch]) <= LEFT * abs(course[PARTS.size + 1, switch] - course[0, switch])
            limits[5] += near and switch >= system[2]
        return np.inf
    y, rests = shapes[SHAPES + 1], course[PARTS.size + 4]
    time, longest, value = t + part * step, np.inf, course[0, c]
    _inside(shapes, part, y)
    _rates(system, time, y, rate)
    for i in range(y.size):
        if rate[i] != 0:
            longest = min(longest, (atol[i] + rtol * abs(y[i])) / abs(rate[i]))
    past, clearance = min(0.01 * longest, step), limits[4]
    if end - time > max(4 * past, clearance):
        rests[c] += value == 0
        return time + max(past, clearance / 2)
    near = abs(value) <= LEFT * abs(course[PARTS.size + 1, c] - value)
    rests[c], limits[5] = near * (rests[c] + 1), near * (limits[5] + 1)
    return end


@compiled(
    types.Tuple((types.int64, types.float64, types.int64, types.int64, types.boolean))(  # type: ignore[no-untyped-call]
        _SYSTEM, _PLACES, MATRIX, VECTOR, VECTOR, VECTOR, types.float64, VECTOR, VECTOR, VECTOR, VECTOR, MATRIX
    )
)
def advance(system, places, course, limits, x, atol, rtol, uneven, sizes, ends, lengths, states):  # type: ignore[no-untyped-def]
    """Make steps until there is no room for more, the end is reached, a guard is met or one becomes too small.

    Each of them ends just past the first switch that it meets.

    Args:
        system: see `_SYSTEM`.
        places: of the guards and switches that are watched, in all of them.
        course: see `COURSE`; (COURSE, 0) where nothing is.
        limits: time at the start, end, first step or zero, longest step and clearance, s. Two that are written: how
            often in a row the motion has rested at any switch, and the part of the last step at which the guard is met.
        x: (n,) state at the start.
        atol, rtol, uneven: (n,) absolute tolerances, the relative one, and (n,) parts by which they move states.
        sizes: (n,) of the rates, the largest so far; they are kept up.
        ends, lengths, states: (k,), (k,) and (k, n) take the ends of the steps and their lengths in s, and the states.

    Returns:
        How many steps were made, the length of the next one in s, how many were tried, the guard that is met in the
        last one, or -1, and whether its guards need a closer look.
    """
    n, m, t, end, step, longest = x.size, places.size, limits[0], limits[1], limits[2], limits[3]
    slopes, shapes = np.empty((STAGES + 1 + FURTHER, n)), np.empty((SHAPES + 2, n))
    y, new = np.empty(n), np.empty(n)
    count, tried, shrunk, before, attempts, whole, stop, guard, unclear = 0, 0, False, 1.0, 0, 0.0, end, -1, False
    _rates(system, t, x, slopes[0])
    if m:
        _values(system, t, x, course[0])
    if not step > 0:
        step = _first_step(system, t, x, slopes[0], limits, atol, rtol, y, new)
    while count < ends.size and t < end and guard < 0 and not unclear:
        if not step > 10 * EPS * abs(t):
            break
        last = min(step, longest) >= stop - t
        length = stop - t if last else min(step, longest)
        _all_stages(system, t, x, length, slopes, y, new)
        tried += 1
        error = _error(system, t, x, new, length, slopes, y, sizes, atol, rtol)
        step = length * _factor(error, before, 10.0 if error < 1 and not shrunk else 1.0)
        shrunk, before = not error < 1, max(min(error, 1.0), 1e-4) if error < np.inf else 1.0
        if shrunk:
            continue
        reached = stop if last else t + length
        _rates(system, reached, new, slopes[STAGES])
        if m and _is_near(system, places, t, x, length, slopes, y, new, course):
            looks = (system, places, t, length, shapes, course)
            _shapes(system, t, x, length, slopes, y, new, shapes)
            part, met, limits[6], guard, unclear = _first_met(looks, atol, rtol, uneven)
            switch = _end_at_switch(looks, part, met, reached, limits, atol, rtol, slopes[STAGES + 1])
            if switch < reached:  # after four attempts that do not converge, half of it
                attempts, whole, guard, unclear = attempts + 1, max(whole, length), -1, False
                stop = switch if attempts <= 4 else min(switch, t + length / 2)
                continue
        ends[count], lengths[count], x = reached, length, states[count]
        _copy(new, x)
        _copy(slopes[STAGES], slopes[0])
        _copy(course[PARTS.size - 1], course[0])
        t, stop, step, attempts, whole, count = reached, end, max(whole, step), 0, 0.0, count + 1
    return count, step, tried, guard, unclear


@compiled(types.void(_SYSTEM, MATRIX, VECTOR, VECTOR, MATRIX, _PLACES, VECTOR, MATRIX))
def between(system, spans, starts, lengths, states, numbers, times, values):  # type: ignore[no-untyped-def]
    """Write the states at times inside steps, which are made again.

    Args:
        system: see `_SYSTEM`.
        spans: (s, 2) of each step the earliest and latest time in s at which the system is evaluated.
        starts: (s,) of the steps, s.
        lengths: (s,) of the steps, s.
        states: (s, n) at their starts.
        numbers: (k,) of the step of each time; the same ones behind each other.
        times: (k,) s.
        values: (k, n) takes the states.
    """
    n, prepared = states.shape[1], -1
    slopes, shapes = np.empty((STAGES + 1 + FURTHER, n)), np.empty((SHAPES + 1, n))
    y, end = np.empty(n), np.empty(n)
    for k in range(times.size):
        number = numbers[k]
        t, length, x = starts[number], lengths[number], states[number]
        if number != prepared:
            here = (system[0], system[1], system[2], spans[number, 0], spans[number, 1], system[5])
            _rates(here, t, x, slopes[0])
            _all_stages(here, t, x, length, slopes, y, end)
            _rates(here, t + length, end, slopes[STAGES])
            _shapes(here, t, x, length, slopes, y, end, shapes)
            prepared = number
        _inside(shapes, (times[k] - t) / length, values[k])


@compiled(types.void(types.int64, VECTOR, VECTOR, MATRIX, MATRIX))
def values_at(code, p, times, states, values):  # type: ignore[no-untyped-def]
    """Write rates or what is watched (k, m), by the address of its code, at times (k,) in s and states (k, n)."""
    for k in range(times.size):
        call_at(code, times[k], states[k], p, values[k])
