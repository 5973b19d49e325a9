"""Many variants side by side in machine code: each with its own time, state and parameters, eight in one call.

A variant is followed from where it starts up to the first guard that it meets, the end, or what it cannot pass; where
one is done the next takes its lane. What comes out for one does not depend on those beside it.

Between the ends of steps a quantity is the quintic through its values and first two derivatives there; where that may
reach a limit, or more than the largest value so far, the step is made again up to that place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from shaftwork.codegen.array_form.elements import Array, Index
from shaftwork.numerics.hermite import JET, peak, powers, reach, root
from shaftwork.numerics.machine_code import LANES, run_at
from shaftwork.numerics.tolerances import EPS, ROUNDINGS, TYPED
from shaftwork.sweep.lane_tables import Met

_compiled = njit(error_model="numpy", cache=True)


class _Lanes(NamedTuple):
    """Eight lanes.

    Args:
        now: (rows, LANES) memory.
        probe: (rows, LANES) memory in which one lane is followed.
        stack: intervals in which a peak is looked for.
        variants: (LANES,) which each lane is; -1 for none.
    """

    now: Array
    probe: Array
    stack: Array
    variants: Index


@_compiled
def _look(tables, memory):  # type: ignore[no-untyped-def]
    """See what there is at the start of a step, and write the first slopes."""
    for lane in range(LANES):
        for row in range(tables.moving):
            memory[tables.rows.y + row, lane] = memory[tables.rows.x + row, lane]
        memory[tables.rows.moment, lane] = min(memory[tables.rows.time, lane], memory[tables.rows.high, lane])
    run_at(tables.jets, memory, tables.rows.sight)
    run_at(tables.rates, memory, tables.rows.slopes)


@_compiled
def _jet(memory, row, sign, offset, lane):  # type: ignore[no-untyped-def]
    """A value and its derivatives of one lane, times a sign and less an offset."""
    return sign * memory[row, lane] - offset, sign * memory[row + 1, lane], sign * memory[row + 2, lane]


@_compiled
def _repeat(tables, lanes, lane):  # type: ignore[no-untyped-def]
    """Let all lanes of the probe start where the last step of one did."""
    probe = lanes.probe
    for row in range(tables.rows.height):
        probe[row] = lanes.now[row, lane]
    for row in range(tables.moving):
        probe[tables.rows.x + row] = lanes.now[tables.rows.last_x + row, lane]
    probe[tables.rows.time] = lanes.now[tables.rows.last_time, lane]
    _look(tables, probe)


@_compiled
def _probe(tables, probe, t):  # type: ignore[no-untyped-def]
    """Follow the lane in a probe up to a time in s, and see what is there."""
    probe[tables.rows.size] = t - probe[tables.rows.time, 0]
    run_at(tables.probe, probe, 0)
    for row in range(tables.moving):
        probe[tables.rows.y + row] = probe[tables.rows.new + row]
    probe[tables.rows.moment] = min(t, probe[tables.rows.high, 0])
    run_at(tables.jets, probe, tables.rows.sight)


@_compiled
def _rise(tables, probe, row, sign, offset, low, high, there):  # type: ignore[no-untyped-def]
    """The time in s of a rise through zero between two times, with the first guess for it."""
    nothing = 2 * EPS * (abs(high) + ROUNDINGS * (high - low))
    for _ in range(100):
        _probe(tables, probe, there)
        value, slope, _ = _jet(probe, row, sign, offset, 0)
        low, high = (low, there) if value > 0 else (there, high)
        new = there - value / slope
        if not low <= new <= high:
            new = (low + high) / 2
        step, there = abs(new - there), new
        if min(step, high - low) <= nothing:
            break
    return there


@_compiled
def _put(stack, row, low, left, high, right, missed, room):  # type: ignore[no-untyped-def]
    """An interval: time and jet at both ends, how much the quintic was off at one of them, and how near that was."""
    interval = stack[row]
    interval[0], interval[1], interval[2], interval[3] = low, left[0], left[1], left[2]
    interval[4], interval[5], interval[6], interval[7] = high, right[0], right[1], right[2]
    interval[8], interval[9] = missed, room


@_compiled
def _top(tables, lanes, row, sign, offset, best, near, first):  # type: ignore[no-untyped-def]
    """The largest value in the interval that is on the stack, and when; with `first`, the first seen above zero.

    NaN where no peak can be told.
    """
    stack, probe, count, when, looks = lanes.stack, lanes.probe, 1, lanes.stack[0, 0], 0
    while count:
        count -= 1
        low, high, missed, room = stack[count, 0], stack[count, 4], stack[count, 8], stack[count, 9]
        left = stack[count, 1], stack[count, 2], stack[count, 3]
        right = stack[count, 5], stack[count, 6], stack[count, 7]
        inside, beyond = reach(high - low, left, right)
        if high - low <= TYPED * abs(low) or not inside > max(left[0], right[0]) or inside + beyond <= best + near:
            continue
        place, height = peak(high - low, left, right)
        if height + beyond <= best + near:
            continue
        t = low + place * (high - low)
        # what a polynomial misses grows with the cube of the distance from a point that it goes through
        part = min(t - low, high - t) / room if room > 0 else 1.0
        if part < 0.01 and missed * part**3 < near:
            best = best if first else max(best, height)
            continue
        if looks > 60 or count + 2 > len(stack):
            return np.nan, when
        looks += 1
        _probe(tables, probe, t)
        middle = _jet(probe, row, sign, offset, 0)
        if middle[0] > best:
            best, when = middle[0], t
            if first:
                return best, when
        missed, room = abs(height - middle[0]), min(t - low, high - t)
        _put(stack, count, low, left, t, middle, missed, room)
        _put(stack, count + 1, t, middle, high, right, missed, room)
        count += 2
    return best, when


@_compiled
def _first_met(tables, lanes, lane):  # type: ignore[no-untyped-def]
    """The guard that is met first in the last step of a lane, and when in s; Met.NOTHING where none is."""
    now, met, extremes = lanes.now, Met.NOTHING.value, tables.extremes.shape[0]
    low, high = now[tables.rows.last_time, lane], now[tables.rows.time, lane]
    end = high
    for guard in range(tables.guards):
        side, offset, number = (
            now[tables.rows.sides + guard, lane],
            now[tables.rows.offsets + guard, lane],
            extremes + guard,
        )
        left = _jet(now, tables.rows.last_sight + JET * number, side, offset, lane)
        right = _jet(now, tables.rows.sight + JET * number, side, offset, lane)
        inside, beyond = reach(high - low, left, right)
        if side == 0.0 or (right[0] <= 0 and inside + beyond <= 0):
            continue
        upper, value, row = high, right[0], tables.rows.sight + JET * number
        if value <= 0:
            _put(lanes.stack, 0, low, left, high, right, 0.0, 0.0)
            near = TYPED * max(abs(left[0]), abs(right[0]))
            value, upper = _top(tables, lanes, row, side, offset, 0.0, near, 1)
        if not value > 0:
            continue
        share = (upper - low) / (high - low)
        guess = low + (high - low) * root(powers(high - low, left, right), 0.0, share, 1.0, 8)
        time = _rise(tables, lanes.probe, row, side, offset, low, upper, guess)
        if time < end or met == Met.NOTHING.value:
            met, end = guard, time
    return met, end


@_compiled
def _past(tables, probe, end):  # type: ignore[no-untyped-def]
    """A time in s just past that of a probe, up to which no state moves by more than a hundredth of its tolerance."""
    longest, tolerance = np.inf, probe[tables.rows.tolerance, 0]
    for row in range(tables.states):
        x = probe[tables.rows.new + row, 0]
        rate = (x - probe[tables.rows.x + row, 0]) / probe[tables.rows.size, 0]
        if rate != 0.0:
            longest = min(longest, 0.01 * tolerance * (probe[tables.rows.nominal + row, 0] + abs(x)) / abs(rate))
    return min(end, probe[tables.rows.moment, 0] + longest)


@_compiled
def _measure(tables, lanes, seen, lane, there, end):  # type: ignore[no-untyped-def]
    """Take the inside of the last step of a lane into the extremes, up to a time in s and what is seen there."""
    now = lanes.now
    low = now[tables.rows.last_time, lane]
    for k in range(tables.extremes.shape[0]):
        number, sign = JET * tables.extremes[k, 0], tables.signs[k]
        left = _jet(now, tables.rows.last_sight + number, sign, 0.0, lane)
        right = _jet(seen, tables.rows.sight + number, sign, 0.0, there)
        best = max(now[tables.rows.best + k, lane], left[0], right[0])
        lowest = min(now[tables.rows.lows + k, lane], left[0], right[0])
        _put(lanes.stack, 0, low, left, end, right, 0.0, 0.0)
        best, _ = _top(tables, lanes, tables.rows.sight + number, sign, 0.0, best, TYPED * (best - lowest), 0)
        now[tables.rows.best + k, lane], now[tables.rows.lows + k, lane] = best, lowest


@_compiled
def _load(tables, course, lanes, lane, variant):  # type: ignore[no-untyped-def]
    """Let a variant begin in a lane."""
    now = lanes.now
    now[tables.rows.time, lane], now[tables.rows.begun, lane] = course.t[variant], course.t[variant]
    now[tables.rows.high, lane], now[tables.rows.end, lane] = course.highs[variant], course.ends[variant]
    now[tables.rows.active, lane], now[tables.rows.step, lane], now[tables.rows.made, lane] = 1.0, -1.0, 0.0
    for row in range(tables.moving):
        now[tables.rows.x + row, lane] = course.x[row, variant] if row < tables.states else 0.0
    for row in range(course.p.shape[0]):
        now[tables.rows.p + row, lane] = course.p[row, variant]
    for guard in range(tables.guards):
        now[tables.rows.sides + guard, lane] = course.sides[guard, variant]
        now[tables.rows.offsets + guard, lane] = course.offsets[guard, variant]
    for k in range(tables.extremes.shape[0]):
        now[tables.rows.best + k, lane] = course.best[tables.extremes[k, 1], variant]
        now[tables.rows.lows + k, lane] = np.inf


@_compiled
def _leave(tables, course, lanes, memory, x, lane, there, t, met):  # type: ignore[no-untyped-def]
    """Write where a variant has come to in a lane, from the row where its states stand, and what it has met."""
    variant = lanes.variants[lane]
    course.met[variant], course.t[variant], course.steps[variant] = met, t, lanes.now[tables.rows.size, lane]
    for row in range(tables.moving):
        if row < tables.states:
            course.x[row, variant] = memory[x + row, there]
        else:
            course.integrals[row - tables.states, variant] += memory[x + row, there]
    for k in range(tables.extremes.shape[0]):
        row, best = tables.extremes[k, 1], lanes.now[tables.rows.best + k, lane]
        course.best[row, variant] = best if np.isnan(best) else max(course.best[row, variant], best)


@_compiled
def _begin(tables, lanes, lane, last):  # type: ignore[no-untyped-def]
    """Set the first step: as the last one, in s, or such that no state changes by more than a hundredth of its size.

    A law's switch is met on the side on which its value is not, or to which it does not go.
    """
    now, step = lanes.now, np.inf
    for row in range(tables.states):
        x, rate = now[tables.rows.x + row, lane], now[tables.rows.slopes + row, lane]
        if rate != 0.0:
            step = min(step, 0.01 * (now[tables.rows.nominal + row, lane] + abs(x)) / abs(rate))
    now[tables.rows.step, lane] = max(step, last)
    for guard in range(tables.guards - tables.free, tables.guards):
        now[tables.rows.sides + guard, lane] = 0.0
        row = tables.rows.sight + JET * (tables.extremes.shape[0] + guard)
        for value in _jet(now, row, 1.0, 0.0, lane):
            if value != 0.0:
                now[tables.rows.sides + guard, lane] = -np.sign(value)
                break


@_compiled
def _arrived(tables, course, lanes, lane):  # type: ignore[no-untyped-def]
    """Whether a lane is done: it has met a guard in its last step, or is at its end."""
    now, met = lanes.now, Met.NOTHING.value
    end, last, close = now[tables.rows.time, lane], now[tables.rows.end, lane], now[tables.rows.close, lane] > 0
    if close:
        _repeat(tables, lanes, lane)
        met, end = _first_met(tables, lanes, lane)
    if met == Met.NOTHING.value:
        if close:
            _measure(tables, lanes, now, lane, lane, end)
        if end >= last:
            _leave(tables, course, lanes, now, tables.rows.x, lane, lane, end, Met.THE_END.value)
        return end >= last
    _probe(tables, lanes.probe, end)
    if met >= tables.guards - tables.free:
        end = _past(tables, lanes.probe, last)
        _probe(tables, lanes.probe, end)
    there = lanes.probe.copy()
    _measure(tables, lanes, there, lane, 0, end)
    _leave(tables, course, lanes, there, tables.rows.new, lane, 0, end, met)
    return True


@_compiled
def _hopeless(tables, now, lane, end):  # type: ignore[no-untyped-def]
    """Whether the steps of a lane have become too short, or so many are foreseen that it is better off alone.

    A variant that will take more than 100 000 up to the end is stiff, or swings that often.
    """
    t, count = now[tables.rows.time, lane], now[tables.rows.made, lane]
    gone = t - now[tables.rows.begun, lane]
    slow = count > 4 * LANES and count * (gone + end - t) > 100_000 * gone
    return slow or (count > 0 and not now[tables.rows.step, lane] > 8 * EPS * abs(t))


@_compiled
def follow(tables, course, nominal, limits):  # type: ignore[no-untyped-def]
    """Follow all variants of a course up to a guard, their end or a limit.

    Args:
        tables: `LaneTables`.
        course: `LaneCourse`.
        nominal: (n,) sizes of the states.
        limits: (3,) the tolerance of a step, the longest step and the end of the motion, s.
    """
    lanes = _Lanes(
        np.zeros((tables.rows.height, LANES)),
        np.zeros((tables.rows.height, LANES)),
        np.zeros((LANES * JET, 10)),
        np.full(LANES, -1),
    )
    now, variants, following, busy = lanes.now, lanes.variants, 0, True
    now[tables.rows.tolerance], now[tables.rows.longest] = limits[0], limits[1]
    for row in range(tables.states):
        now[tables.rows.nominal + row] = nominal[row]
    while busy:
        _look(tables, now)
        run_at(tables.compare, now, 0)
        busy, loaded = False, False
        for lane in range(LANES):
            variant = variants[lane]
            to_see = now[tables.rows.close, lane] > 0 or now[tables.rows.time, lane] >= now[tables.rows.end, lane]
            if now[tables.rows.moved, lane] > 0 and to_see:
                if _arrived(tables, course, lanes, lane):
                    variant = -1
            elif variant >= 0 and _hopeless(tables, now, lane, limits[2]):
                variant = -1
            if variant < 0 and following < course.t.size:
                variant, following, loaded = following, following + 1, True
                _load(tables, course, lanes, lane, variant)
            elif variant < 0:
                now[tables.rows.active, lane] = 0.0
            variants[lane] = variant
            busy = busy or variant >= 0
        if loaded:
            _look(tables, now)
            for lane in range(LANES):
                if now[tables.rows.step, lane] < 0:
                    _begin(tables, lanes, lane, course.steps[variants[lane]])
        run_at(tables.advance, now, 0)
