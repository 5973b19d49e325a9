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


class LaneTables(NamedTuple):
    """The functions of a program, and where its numbers stand: rows of the memory of a block of lanes.

    Args:
        slopes: address of what writes the rates at y and the moment.
        sight: of what writes jets of all that is seen there.
        step: of what makes a step, from its first slopes on, with its error.
        height: rows in all.
        states: how many; integrals follow them,
        moving: and so many are both.
        x: first row of states and integrals at the start of a step.
        time: row of the time there, s.
        size: row of the length of the step, s.
        high: row of the latest time at which anything is evaluated, s.
        y: first row of states at the moment,
        moment: and the row of this, s.
        new: first row of states and integrals at the end of the step.
        error: row of its error in units of the tolerance.
        first: first row of the slopes at the start.
        seen: first row of the jets.
        p: first row of the parameters.
        guards: how many of those seen are guards and switches; they come last.
        free: how many of these are switches of laws; they come last.
        extremes: (extremes, 2) which of those seen, and the row of its largest value.
        signs: (extremes,) times which it is the largest.
    """

    slopes: int
    sight: int
    step: int
    height: int
    states: int
    moving: int
    x: int
    time: int
    size: int
    high: int
    y: int
    moment: int
    new: int
    error: int
    first: int
    seen: int
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
    met: Index


class _Lanes(NamedTuple):
    """Eight lanes; arrays are (rows, LANES).

    Args:
        now: memory of a block, at the ends of the last steps.
        last: the same at their starts.
        probe: memory of a block in which one lane is followed.
        stack: intervals in which a peak is looked for.
        sides: on which guards are met.
        offsets: how far beyond zero they have to go.
        best: largest values so far,
        lows: and the lowest.
        close: (LANES,) where more than the ends of a step is to be looked at.
        moved: (LANES,) which have made a step.
        steps: (3, LANES) the length of the next step, the time at the start in s, and how many steps there were.
        variants: (LANES,) which each of them is; -1 for none.
    """

    now: Array
    last: Array
    probe: Array
    stack: Array
    sides: Array
    offsets: Array
    best: Array
    lows: Array
    close: Array
    moved: Array
    steps: Array
    variants: Index


@_compiled
def _look(tables, memory):  # type: ignore[no-untyped-def]
    """See what there is at the start of a step, and write the first slopes."""
    for lane in range(LANES):
        for row in range(tables.moving):
            memory[tables.y + row, lane] = memory[tables.x + row, lane]
        memory[tables.moment, lane] = min(memory[tables.time, lane], memory[tables.high, lane])
    run_at(tables.sight, memory, tables.seen)
    run_at(tables.slopes, memory, tables.first)


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
def _peak(length, left, right):  # type: ignore[no-untyped-def]
    """Share of the length and height of the highest peak of the quintic; -inf where there is none."""
    v0, v1, a0, a1 = length * left[1], length * right[1], length**2 * left[2], length**2 * right[2]
    rise = right[0] - left[0]
    c5, c4 = 6 * rise - 3 * (v0 + v1) - (a0 - a1) / 2, -15 * rise + 8 * v0 + 7 * v1 + (3 * a0 - 2 * a1) / 2
    c3 = 10 * rise - 6 * v0 - 4 * v1 - (3 * a0 - a1) / 2
    top, place, pieces = -np.inf, 0.0, 6
    low, low_slope = 0.0, v0
    for k in range(1, pieces + 1):
        high = k / pieces
        high_slope = (((5 * c5 * high + 4 * c4) * high + 3 * c3) * high + a0) * high + v0
        if low_slope > 0 and high_slope < 0:
            lower, upper, u = low, high, (low + high) / 2
            for _ in range(5):
                slope = (((5 * c5 * u + 4 * c4) * u + 3 * c3) * u + a0) * u + v0
                bend = ((20 * c5 * u + 12 * c4) * u + 6 * c3) * u + a0
                lower, upper = (u, upper) if slope > 0 else (lower, u)
                new = u - slope / bend
                u = new if lower <= new <= upper else (lower + upper) / 2
            height = ((((c5 * u + c4) * u + c3) * u + a0 / 2) * u + v0) * u + left[0]
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
        probe[tables.x + row] = lanes.last[tables.x + row, lane]
    probe[tables.time] = lanes.last[tables.time, lane]
    _look(tables, probe)


@_compiled
def _probe(tables, probe, t):  # type: ignore[no-untyped-def]
    """Follow the lane in a probe up to a time in s, and see what is there."""
    probe[tables.size] = t - probe[tables.time, 0]
    run_at(tables.step, probe, 0)
    for row in range(tables.moving):
        probe[tables.y + row] = probe[tables.new + row]
    probe[tables.moment] = min(t, probe[tables.high, 0])
    run_at(tables.sight, probe, tables.seen)


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
def _compare(tables, lanes):  # type: ignore[no-untyped-def]
    """Take the ends of the last steps into the extremes, and tell where more is to be looked at."""
    now, last, close = lanes.now, lanes.last, lanes.close
    extremes = tables.extremes.shape[0]
    for lane in range(LANES):
        close[lane] = False
        if not lanes.moved[lane]:
            continue
        length = now[tables.time, lane] - last[tables.time, lane]
        for guard in range(tables.guards):
            side, offset = lanes.sides[guard, lane], lanes.offsets[guard, lane]
            row = tables.seen + JET * (extremes + guard)
            left, right = _jet(last, row, side, offset, lane), _jet(now, row, side, offset, lane)
            inside, beyond = _reach(length, left, right)
            close[lane] |= side != 0.0 and (right[0] > 0 or inside + beyond > 0)
        for k in range(extremes):
            row, sign = tables.seen + JET * tables.extremes[k, 0], tables.signs[k]
            left, right = _jet(last, row, sign, 0.0, lane), _jet(now, row, sign, 0.0, lane)
            higher, (inside, beyond) = max(left[0], right[0]), _reach(length, left, right)
            if not close[lane]:
                lanes.best[k, lane] = max(lanes.best[k, lane], higher)
                lanes.lows[k, lane] = min(lanes.lows[k, lane], left[0], right[0])
            close[lane] |= inside > higher and inside + beyond > lanes.best[k, lane]


@_compiled
def _first_met(tables, lanes, lane):  # type: ignore[no-untyped-def]
    """The guard that is met first in the last step of a lane, and when in s; NOTHING where none is."""
    low, high, met = lanes.last[tables.time, lane], lanes.now[tables.time, lane], NOTHING
    end = high
    for guard in range(tables.guards):
        side, offset = lanes.sides[guard, lane], lanes.offsets[guard, lane]
        row = tables.seen + JET * (tables.extremes.shape[0] + guard)
        left, right = _jet(lanes.last, row, side, offset, lane), _jet(lanes.now, row, side, offset, lane)
        inside, beyond = _reach(high - low, left, right)
        if side == 0.0 or (right[0] <= 0 and inside + beyond <= 0):
            continue
        upper, value = high, right[0]
        if value <= 0:
            _put(lanes.stack, 0, low, left, high, right, 0.0, 0.0)
            near = TYPED * max(abs(left[0]), abs(right[0]))
            value, upper = _top(tables, lanes, row, side, offset, 0.0, near, 1)
        if not value > 0:
            continue
        guess = low + (upper - low) * left[0] / (left[0] - value)
        time = _rise(tables, lanes.probe, row, side, offset, low, upper, guess)
        if time < end or met == NOTHING:
            met, end = guard, time
    return met, end


@_compiled
def _past(tables, probe, nominal, tolerance, end):  # type: ignore[no-untyped-def]
    """A time in s just past that of a probe, up to which no state moves by more than a hundredth of its tolerance."""
    longest = np.inf
    for row in range(tables.states):
        x = probe[tables.new + row, 0]
        rate = (x - probe[tables.x + row, 0]) / probe[tables.size, 0]
        if rate != 0.0:
            longest = min(longest, 0.01 * tolerance * (nominal[row] + abs(x)) / abs(rate))
    return min(end, probe[tables.moment, 0] + longest)


@_compiled
def _measure(tables, lanes, seen, lane, there, end):  # type: ignore[no-untyped-def]
    """Take the inside of the last step of a lane into the extremes, up to a time in s and what is seen there."""
    low = lanes.last[tables.time, lane]
    for k in range(tables.extremes.shape[0]):
        row, sign = tables.seen + JET * tables.extremes[k, 0], tables.signs[k]
        left, right = _jet(lanes.last, row, sign, 0.0, lane), _jet(seen, row, sign, 0.0, there)
        best = max(lanes.best[k, lane], left[0], right[0])
        lanes.lows[k, lane] = min(lanes.lows[k, lane], left[0], right[0])
        _put(lanes.stack, 0, low, left, end, right, 0.0, 0.0)
        near = TYPED * (best - lanes.lows[k, lane])
        lanes.best[k, lane], _ = _top(tables, lanes, row, sign, 0.0, best, near, 0)


@_compiled
def _load(tables, course, lanes, lane, variant):  # type: ignore[no-untyped-def]
    """Let a variant begin in a lane."""
    now = lanes.now
    now[tables.time, lane], now[tables.high, lane] = course.t[variant], course.highs[variant]
    for row in range(tables.moving):
        now[tables.x + row, lane] = course.x[row, variant] if row < tables.states else 0.0
    for row in range(course.p.shape[0]):
        now[tables.p + row, lane] = course.p[row, variant]
    for guard in range(tables.guards):
        lanes.sides[guard, lane] = course.sides[guard, variant]
        lanes.offsets[guard, lane] = course.offsets[guard, variant]
    for k in range(tables.extremes.shape[0]):
        lanes.best[k, lane], lanes.lows[k, lane] = course.best[tables.extremes[k, 1], variant], np.inf
    lanes.steps[0, lane], lanes.steps[1, lane], lanes.steps[2, lane] = -1.0, course.t[variant], 0.0


@_compiled
def _leave(tables, course, lanes, memory, x, lane, there, t, met):  # type: ignore[no-untyped-def]
    """Write where a variant has come to in a lane, from the row where its states stand, and what it has met."""
    variant = lanes.variants[lane]
    course.met[variant], course.t[variant] = met, t
    for row in range(tables.moving):
        if row < tables.states:
            course.x[row, variant] = memory[x + row, there]
        else:
            course.integrals[row - tables.states, variant] += memory[x + row, there]
    for k in range(tables.extremes.shape[0]):
        row, best = tables.extremes[k, 1], lanes.best[k, lane]
        course.best[row, variant] = best if np.isnan(best) else max(course.best[row, variant], best)


@_compiled
def _begin(tables, lanes, lane, nominal):  # type: ignore[no-untyped-def]
    """The length in s of a first step, which changes no state by more than a hundredth of its size.

    A law's switch is met on the side on which its value is not, or to which it does not go.
    """
    step = np.inf
    for row in range(tables.states):
        x, rate = lanes.now[tables.x + row, lane], lanes.now[tables.first + row, lane]
        if rate != 0.0:
            step = min(step, 0.01 * (nominal[row] + abs(x)) / abs(rate))
    for guard in range(tables.guards - tables.free, tables.guards):
        lanes.sides[guard, lane] = 0.0
        row = tables.seen + JET * (tables.extremes.shape[0] + guard)
        for value in _jet(lanes.now, row, 1.0, 0.0, lane):
            if value != 0.0:
                lanes.sides[guard, lane] = -np.sign(value)
                break
    return step


@_compiled
def _arrived(tables, course, lanes, lane, nominal, tolerance):  # type: ignore[no-untyped-def]
    """Whether a lane is done: it has met a guard in its last step, or is at its end."""
    last = course.ends[lanes.variants[lane]]
    met, end = NOTHING, lanes.now[tables.time, lane]
    if lanes.close[lane]:
        _repeat(tables, lanes, lane)
        met, end = _first_met(tables, lanes, lane)
    if met == NOTHING:
        if lanes.close[lane]:
            _measure(tables, lanes, lanes.now, lane, lane, end)
        if end >= last:
            _leave(tables, course, lanes, lanes.now, tables.x, lane, lane, end, THE_END)
        return end >= last
    _probe(tables, lanes.probe, end)
    if met >= tables.guards - tables.free:
        end = _past(tables, lanes.probe, nominal, tolerance, last)
        _probe(tables, lanes.probe, end)
    there = lanes.probe.copy()
    _measure(tables, lanes, there, lane, 0, end)
    _leave(tables, course, lanes, there, tables.new, lane, 0, end, met)
    return True


@_compiled
def _hopeless(tables, lanes, lane, end):  # type: ignore[no-untyped-def]
    """Whether the steps of a lane have become too short, or so many are foreseen that it is better off alone."""
    t, (step, start, count) = lanes.now[tables.time, lane], lanes.steps[:, lane]
    gone = t - start
    slow = count > 4 * LANES and count * (gone + end - t) > MOST_STEPS * gone
    return slow or (count > 0 and not step > 8 * EPS * abs(t))


@_compiled
def _accept(tables, course, lanes, longest, nominal):  # type: ignore[no-untyped-def]
    """Make a step of all lanes, let those go on whose error is small enough, and set the lengths of the next ones."""
    now, last = lanes.now, lanes.last
    for lane in range(LANES):
        variant, now[tables.size, lane] = lanes.variants[lane], 0.0
        if variant >= 0:
            if lanes.steps[0, lane] < 0:
                lanes.steps[0, lane] = _begin(tables, lanes, lane, nominal)
            lanes.steps[0, lane] = min(lanes.steps[0, lane], longest)
            now[tables.size, lane] = min(lanes.steps[0, lane], course.ends[variant] - now[tables.time, lane])
    run_at(tables.step, now, 0)
    for lane in range(LANES):
        variant, t, size = lanes.variants[lane], now[tables.time, lane], now[tables.size, lane]
        error = now[tables.error, lane]
        lanes.moved[lane] = variant >= 0 and error <= 1.0
        if lanes.moved[lane]:
            last[tables.time, lane], end = t, course.ends[variant]
            now[tables.time, lane] = t + size if lanes.steps[0, lane] < end - t else end
            for row in range(tables.moving):
                last[tables.x + row, lane] = now[tables.x + row, lane]
                now[tables.x + row, lane] = now[tables.new + row, lane]
            for row in range(tables.seen, tables.seen + JET * (tables.extremes.shape[0] + tables.guards)):
                last[row, lane] = now[row, lane]
        factor = 0.85 / np.sqrt(np.sqrt(np.sqrt(error + 1e-30)))  # the error is of order 8
        lanes.steps[0, lane] = size * (min(max(factor, 0.2), 5.0) if error >= 0 else np.nan)
        lanes.steps[2, lane] += 1


@_compiled
def follow(tables, course, nominal, limits):  # type: ignore[no-untyped-def]
    """Follow all variants of a course up to a guard, their end or a limit.

    Args:
        tables: `LaneTables`.
        course: `LaneCourse`.
        nominal: (n,) sizes of the states.
        limits: (3,) the tolerance of a step, the longest step and the end of the motion, s.
    """
    tolerance, longest, end = limits
    extremes, shape = tables.extremes.shape[0], (tables.height, LANES)
    lanes = _Lanes(
        np.zeros(shape), np.zeros(shape), np.zeros(shape), np.zeros((LANES * JET, 10)),
        np.zeros((tables.guards, LANES)), np.zeros((tables.guards, LANES)), np.zeros((extremes, LANES)),
        np.zeros((extremes, LANES)), np.zeros(LANES, np.bool_), np.zeros(LANES, np.bool_), np.zeros((3, LANES)),
        np.full(LANES, -1),
    )  # fmt: skip
    for row in range(tables.states):
        lanes.now[row] = nominal[row]
    lanes.now[tables.states] = tolerance
    following, busy = 0, True
    while busy:
        _look(tables, lanes.now)
        _compare(tables, lanes)
        busy, loaded = False, False
        for lane in range(LANES):
            variant = lanes.variants[lane]
            at_end = variant >= 0 and lanes.now[tables.time, lane] >= course.ends[variant]
            if lanes.moved[lane] and (lanes.close[lane] or at_end):
                if _arrived(tables, course, lanes, lane, nominal, tolerance):
                    variant = -1
            elif variant >= 0 and _hopeless(tables, lanes, lane, end):
                variant = -1
            if variant < 0 and following < course.t.size:
                variant, following, loaded = following, following + 1, True
                _load(tables, course, lanes, lane, variant)
            lanes.variants[lane] = variant
            busy = busy or variant >= 0
        if loaded:
            _look(tables, lanes.now)
        _accept(tables, course, lanes, longest, nominal)
