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
from shaftwork.numerics.hermite import BEYOND, JET
from shaftwork.numerics.machine_code import LANES, run_at
from shaftwork.numerics.tolerances import EPS, ROUNDINGS, TYPED

MOST_STEPS = 100_000
"""A variant that will take more up to its end is stiff, or swings so often that it is better off alone."""
NOTHING, THE_END, A_LIMIT = -1, -2, -3
"""What a lane has met where that is no guard: nothing, the end, or what it cannot pass."""
_compiled = njit(error_model="numpy", cache=True)


ROWS = (
    "nominal", "tolerance", "longest", "time", "size", "high", "moment", "end", "step", "active", "moved", "close",
    "count", "last time", "begun", "x", "y", "new", "last x", "slopes", "sight", "last sight", "best", "lows", "sides",
    "offsets", "p",
)  # fmt: skip
"""Arrays in the memory of a block of lanes: nominal sizes of the states, the tolerance and the longest step; time at the
start of a step, its length, and the latest time at which anything is evaluated; the moment at which it is; the time up
to which a lane goes, the length of its next step; whether it is on its way, has moved, and is to be looked at more
closely; how many steps it has made, when its last step began and it itself, s; states and integrals at the start, at
the moment, at the end and at the start of the last step; slopes of all stages; what is seen, and was at the start of
the last step; the largest and lowest values; the sides on which guards are met and how far beyond zero; parameters."""


class LaneTables(NamedTuple):
    """The functions of a program, and where its numbers stand: the first rows of `ROWS`.

    Args:
        rates: address of what writes the slopes at y and the moment.
        jets: of what writes what is seen there.
        probe: of what makes a step of a given size.
        advance: of what makes a step that is as long as the tolerance lets it be.
        compare: of what looks at the ends of the last step.
        height: rows in all.
        states: how many; integrals follow them,
        moving: and so many are both.
        guards: how many of those seen are guards and switches; they come last.
        free: how many of these are switches of laws; they come last.
        extremes: (extremes, 2) which of those seen, and the row of its largest value.
        signs: (extremes,) times which it is the largest.
    """

    rates: int
    jets: int
    probe: int
    advance: int
    compare: int
    height: int
    states: int
    moving: int
    nominal: int
    tolerance: int
    longest: int
    time: int
    size: int
    high: int
    moment: int
    end: int
    step: int
    active: int
    moved: int
    close: int
    count: int
    last_time: int
    begun: int
    x: int
    y: int
    new: int
    last_x: int
    slopes: int
    sight: int
    last_sight: int
    best: int
    lows: int
    sides: int
    offsets: int
    p: int
    guards: int
    free: int
    extremes: Index
    signs: Array


class LaneCourse(NamedTuple):
    """Variants on their way; time, states, integrals, largest values and what is met change in place.

    Args:
        t: (k,) s.
        x: (n, k) states.
        p: (parameters, k).
        ends: (k,) up to which they go, s.
        highs: (k,) the latest times at which anything is evaluated, s: just before a jump at the end.
        sides: (guards, k) on which a guard is met; 0 where it is not watched.
        offsets: (guards, k) how far beyond zero each has to go.
        integrals: (integrals, k); what is added to them.
        best: (rows, k) largest values so far.
        steps: (k,) the length of the last step, which the next is tried with, s.
        met: (k,) guards, THE_END or A_LIMIT.
    """

    t: Array
    x: Array
    p: Array
    ends: Array
    highs: Array
    sides: Array
    offsets: Array
    integrals: Array
    best: Array
    steps: Array
    met: Index


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
            memory[tables.y + row, lane] = memory[tables.x + row, lane]
        memory[tables.moment, lane] = min(memory[tables.time, lane], memory[tables.high, lane])
    run_at(tables.jets, memory, tables.sight)
    run_at(tables.rates, memory, tables.slopes)


@_compiled
def _jet(memory, row, sign, offset, lane):  # type: ignore[no-untyped-def]
    """A value and its derivatives of one lane, times a sign and less an offset."""
    return sign * memory[row, lane] - offset, sign * memory[row + 1, lane], sign * memory[row + 2, lane]


@_compiled
def _reach(length, left, right):  # type: ignore[no-untyped-def]
    """How high the quintic may come between two times, and how far the motion may be from it; see `hermite`."""
    a, b = length / 5, length * length / 20
    inside = max(
        left[0] + a * left[1], left[0] + 2 * a * left[1] + b * left[2],
        right[0] - a * right[1], right[0] - 2 * a * right[1] + b * right[2],
    )  # fmt: skip
    apart = (left[1] - right[1]) * (length / 32) + (left[2] + right[2]) * (length * length / 64)
    return inside, BEYOND * abs(apart)


@_compiled
def _powers(length, left, right):  # type: ignore[no-untyped-def]
    """Coefficients of the quintic, the highest first, in the share of the length; see `hermite`."""
    v0, v1, a0, a1 = length * left[1], length * right[1], length**2 * left[2], length**2 * right[2]
    rise = right[0] - left[0]
    c5, c4 = 6 * rise - 3 * (v0 + v1) - (a0 - a1) / 2, -15 * rise + 8 * v0 + 7 * v1 + (3 * a0 - 2 * a1) / 2
    return c5, c4, 10 * rise - 6 * v0 - 4 * v1 - (3 * a0 - a1) / 2, a0 / 2, v0, left[0]


@_compiled
def _root(powers, low, high, rising, most):  # type: ignore[no-untyped-def]
    """A zero of a polynomial of degree 5 between two places: Newton's steps, halves where they leave the interval."""
    c5, c4, c3, c2, c1, c0 = powers
    u = (low + high) / 2
    for _ in range(most):
        value = ((((c5 * u + c4) * u + c3) * u + c2) * u + c1) * u + c0
        slope = (((5 * c5 * u + 4 * c4) * u + 3 * c3) * u + 2 * c2) * u + c1
        low, high = (low, u) if (value > 0) == rising else (u, high)
        new = u - value / slope
        u = new if low <= new <= high else (low + high) / 2
    return u


@_compiled
def _peak(length, left, right):  # type: ignore[no-untyped-def]
    """Share of the length and height of the highest peak of the quintic; -inf where there is none."""
    c5, c4, c3, c2, c1, c0 = _powers(length, left, right)
    slopes = (0.0, 5 * c5, 4 * c4, 3 * c3, 2 * c2, c1)
    top, place, pieces, low, low_slope = -np.inf, 0.0, 6, 0.0, c1
    for k in range(1, pieces + 1):
        high = k / pieces
        high_slope = (((5 * c5 * high + 4 * c4) * high + 3 * c3) * high + 2 * c2) * high + c1
        if low_slope > 0 and high_slope < 0:
            u = _root(slopes, low, high, False, 5)
            height = ((((c5 * u + c4) * u + c3) * u + c2) * u + c1) * u + c0
            if height > top:
                top, place = height, u
        low, low_slope = high, high_slope
    return min(max(place, 1e-4), 1 - 1e-4), top


@_compiled
def _repeat(tables, lanes, lane):  # type: ignore[no-untyped-def]
    """Let all lanes of the probe start where the last step of one did."""
    probe = lanes.probe
    for row in range(tables.height):
        probe[row] = lanes.now[row, lane]
    for row in range(tables.moving):
        probe[tables.x + row] = lanes.now[tables.last_x + row, lane]
    probe[tables.time] = lanes.now[tables.last_time, lane]
    _look(tables, probe)


@_compiled
def _probe(tables, probe, t):  # type: ignore[no-untyped-def]
    """Follow the lane in a probe up to a time in s, and see what is there."""
    probe[tables.size] = t - probe[tables.time, 0]
    run_at(tables.probe, probe, 0)
    for row in range(tables.moving):
        probe[tables.y + row] = probe[tables.new + row]
    probe[tables.moment] = min(t, probe[tables.high, 0])
    run_at(tables.jets, probe, tables.sight)


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
        inside, beyond = _reach(high - low, left, right)
        if high - low <= TYPED * abs(low) or not inside > max(left[0], right[0]) or inside + beyond <= best + near:
            continue
        place, height = _peak(high - low, left, right)
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
    """The guard that is met first in the last step of a lane, and when in s; NOTHING where none is."""
    now, met, extremes = lanes.now, NOTHING, tables.extremes.shape[0]
    low, high = now[tables.last_time, lane], now[tables.time, lane]
    end = high
    for guard in range(tables.guards):
        side, offset, number = now[tables.sides + guard, lane], now[tables.offsets + guard, lane], extremes + guard
        left = _jet(now, tables.last_sight + JET * number, side, offset, lane)
        right = _jet(now, tables.sight + JET * number, side, offset, lane)
        inside, beyond = _reach(high - low, left, right)
        if side == 0.0 or (right[0] <= 0 and inside + beyond <= 0):
            continue
        upper, value, row = high, right[0], tables.sight + JET * number
        if value <= 0:
            _put(lanes.stack, 0, low, left, high, right, 0.0, 0.0)
            near = TYPED * max(abs(left[0]), abs(right[0]))
            value, upper = _top(tables, lanes, row, side, offset, 0.0, near, 1)
        if not value > 0:
            continue
        share = (upper - low) / (high - low)
        guess = low + (high - low) * _root(_powers(high - low, left, right), 0.0, share, True, 8)
        time = _rise(tables, lanes.probe, row, side, offset, low, upper, guess)
        if time < end or met == NOTHING:
            met, end = guard, time
    return met, end


@_compiled
def _past(tables, probe, end):  # type: ignore[no-untyped-def]
    """A time in s just past that of a probe, up to which no state moves by more than a hundredth of its tolerance."""
    longest, tolerance = np.inf, probe[tables.tolerance, 0]
    for row in range(tables.states):
        x = probe[tables.new + row, 0]
        rate = (x - probe[tables.x + row, 0]) / probe[tables.size, 0]
        if rate != 0.0:
            longest = min(longest, 0.01 * tolerance * (probe[tables.nominal + row, 0] + abs(x)) / abs(rate))
    return min(end, probe[tables.moment, 0] + longest)


@_compiled
def _measure(tables, lanes, seen, lane, there, end):  # type: ignore[no-untyped-def]
    """Take the inside of the last step of a lane into the extremes, up to a time in s and what is seen there."""
    now = lanes.now
    low = now[tables.last_time, lane]
    for k in range(tables.extremes.shape[0]):
        number, sign = JET * tables.extremes[k, 0], tables.signs[k]
        left = _jet(now, tables.last_sight + number, sign, 0.0, lane)
        right = _jet(seen, tables.sight + number, sign, 0.0, there)
        best = max(now[tables.best + k, lane], left[0], right[0])
        lowest = min(now[tables.lows + k, lane], left[0], right[0])
        _put(lanes.stack, 0, low, left, end, right, 0.0, 0.0)
        best, _ = _top(tables, lanes, tables.sight + number, sign, 0.0, best, TYPED * (best - lowest), 0)
        now[tables.best + k, lane], now[tables.lows + k, lane] = best, lowest


@_compiled
def _load(tables, course, lanes, lane, variant):  # type: ignore[no-untyped-def]
    """Let a variant begin in a lane."""
    now = lanes.now
    now[tables.time, lane], now[tables.begun, lane] = course.t[variant], course.t[variant]
    now[tables.high, lane], now[tables.end, lane] = course.highs[variant], course.ends[variant]
    now[tables.active, lane], now[tables.step, lane], now[tables.count, lane] = 1.0, -1.0, 0.0
    for row in range(tables.moving):
        now[tables.x + row, lane] = course.x[row, variant] if row < tables.states else 0.0
    for row in range(course.p.shape[0]):
        now[tables.p + row, lane] = course.p[row, variant]
    for guard in range(tables.guards):
        now[tables.sides + guard, lane] = course.sides[guard, variant]
        now[tables.offsets + guard, lane] = course.offsets[guard, variant]
    for k in range(tables.extremes.shape[0]):
        now[tables.best + k, lane] = course.best[tables.extremes[k, 1], variant]
        now[tables.lows + k, lane] = np.inf


@_compiled
def _leave(tables, course, lanes, memory, x, lane, there, t, met):  # type: ignore[no-untyped-def]
    """Write where a variant has come to in a lane, from the row where its states stand, and what it has met."""
    variant = lanes.variants[lane]
    course.met[variant], course.t[variant], course.steps[variant] = met, t, lanes.now[tables.size, lane]
    for row in range(tables.moving):
        if row < tables.states:
            course.x[row, variant] = memory[x + row, there]
        else:
            course.integrals[row - tables.states, variant] += memory[x + row, there]
    for k in range(tables.extremes.shape[0]):
        row, best = tables.extremes[k, 1], lanes.now[tables.best + k, lane]
        course.best[row, variant] = best if np.isnan(best) else max(course.best[row, variant], best)


@_compiled
def _begin(tables, lanes, lane, last):  # type: ignore[no-untyped-def]
    """Set the first step: as the last one, in s, or such that no state changes by more than a hundredth of its size.

    A law's switch is met on the side on which its value is not, or to which it does not go.
    """
    now, step = lanes.now, np.inf
    for row in range(tables.states):
        x, rate = now[tables.x + row, lane], now[tables.slopes + row, lane]
        if rate != 0.0:
            step = min(step, 0.01 * (now[tables.nominal + row, lane] + abs(x)) / abs(rate))
    now[tables.step, lane] = max(step, last)
    for guard in range(tables.guards - tables.free, tables.guards):
        now[tables.sides + guard, lane] = 0.0
        row = tables.sight + JET * (tables.extremes.shape[0] + guard)
        for value in _jet(now, row, 1.0, 0.0, lane):
            if value != 0.0:
                now[tables.sides + guard, lane] = -np.sign(value)
                break


@_compiled
def _arrived(tables, course, lanes, lane):  # type: ignore[no-untyped-def]
    """Whether a lane is done: it has met a guard in its last step, or is at its end."""
    now, met = lanes.now, NOTHING
    end, last, close = now[tables.time, lane], now[tables.end, lane], now[tables.close, lane] > 0
    if close:
        _repeat(tables, lanes, lane)
        met, end = _first_met(tables, lanes, lane)
    if met == NOTHING:
        if close:
            _measure(tables, lanes, now, lane, lane, end)
        if end >= last:
            _leave(tables, course, lanes, now, tables.x, lane, lane, end, THE_END)
        return end >= last
    _probe(tables, lanes.probe, end)
    if met >= tables.guards - tables.free:
        end = _past(tables, lanes.probe, last)
        _probe(tables, lanes.probe, end)
    there = lanes.probe.copy()
    _measure(tables, lanes, there, lane, 0, end)
    _leave(tables, course, lanes, there, tables.new, lane, 0, end, met)
    return True


@_compiled
def _hopeless(tables, now, lane, end):  # type: ignore[no-untyped-def]
    """Whether the steps of a lane have become too short, or so many are foreseen that it is better off alone."""
    t, count = now[tables.time, lane], now[tables.count, lane]
    gone = t - now[tables.begun, lane]
    slow = count > 4 * LANES and count * (gone + end - t) > MOST_STEPS * gone
    return slow or (count > 0 and not now[tables.step, lane] > 8 * EPS * abs(t))


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
        np.zeros((tables.height, LANES)),
        np.zeros((tables.height, LANES)),
        np.zeros((LANES * JET, 10)),
        np.full(LANES, -1),
    )
    now, variants, following, busy = lanes.now, lanes.variants, 0, True
    now[tables.tolerance], now[tables.longest] = limits[0], limits[1]
    for row in range(tables.states):
        now[tables.nominal + row] = nominal[row]
    while busy:
        _look(tables, now)
        run_at(tables.compare, now, 0)
        busy, loaded = False, False
        for lane in range(LANES):
            variant = variants[lane]
            to_see = now[tables.close, lane] > 0 or now[tables.time, lane] >= now[tables.end, lane]
            if now[tables.moved, lane] > 0 and to_see:
                if _arrived(tables, course, lanes, lane):
                    variant = -1
            elif variant >= 0 and _hopeless(tables, now, lane, limits[2]):
                variant = -1
            if variant < 0 and following < course.t.size:
                variant, following, loaded = following, following + 1, True
                _load(tables, course, lanes, lane, variant)
            elif variant < 0:
                now[tables.active, lane] = 0.0
            variants[lane] = variant
            busy = busy or variant >= 0
        if loaded:
            _look(tables, now)
            for lane in range(LANES):
                if now[tables.step, lane] < 0:
                    _begin(tables, lanes, lane, course.steps[variants[lane]])
        run_at(tables.advance, now, 0)
