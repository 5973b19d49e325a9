"""Many variants side by side in machine code: each with its own time, state and parameters, eight in one call.

A variant is followed from where it starts up to the first guard that it meets, the end, or what it cannot pass; where
one is done the next takes its lane. What comes out for one does not depend on those beside it.

Between the ends of steps a quantity is the quintic through its values and first two derivatives there; where that may
reach a limit, or more than the largest value so far, the step is made again up to that place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shaftwork.codegen.array_form.elements import Array, Index
from shaftwork.numerics.hermite import JET, peak, powers, reach, root
from shaftwork.numerics.lane_functions import LANES
from shaftwork.numerics.machine_code import compiled, inner, run_at
from shaftwork.numerics.tolerances import EPS, ROUNDINGS, TYPED
from shaftwork.sweep.lane_tables import LaneCourse, LaneRow, LaneTables, Met


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


@inner
def _fill(memory, row, value):  # type: ignore[no-untyped-def]
    """Write a number for all lanes; numba takes a second to compile an assignment to a row."""
    for lane in range(LANES):
        memory[row, lane] = value


@inner
def _look(tables, memory):  # type: ignore[no-untyped-def]
    """See what there is at the start of a step, and write the first slopes."""
    for lane in range(LANES):
        for row in range(tables.moving):
            memory[tables.first[LaneRow.Y.value] + row, lane] = memory[tables.first[LaneRow.X.value] + row, lane]
        memory[LaneRow.MOMENT.value, lane] = min(memory[LaneRow.TIME.value, lane], memory[LaneRow.HIGH.value, lane])
    run_at(tables.jets, memory, tables.first[LaneRow.SIGHT.value])
    run_at(tables.rates, memory, tables.first[LaneRow.SLOPES.value])


@inner
def _jet(memory, row, sign, offset, lane):  # type: ignore[no-untyped-def]
    """A value and its derivatives of one lane, times a sign and less an offset."""
    return sign * memory[row, lane] - offset, sign * memory[row + 1, lane], sign * memory[row + 2, lane]


@inner
def _repeat(tables, lanes, lane):  # type: ignore[no-untyped-def]
    """Let all lanes of the probe start where the last step of one did."""
    probe, now, first = lanes.probe, lanes.now, tables.first
    for row in range(first[LaneRow.HEIGHT.value]):
        _fill(probe, row, now[row, lane])
    for row in range(tables.moving):
        _fill(probe, first[LaneRow.X.value] + row, now[first[LaneRow.LAST_X.value] + row, lane])
    _fill(probe, LaneRow.TIME.value, now[LaneRow.LAST_TIME.value, lane])
    _look(tables, probe)


@inner
def _probe(tables, probe, t):  # type: ignore[no-untyped-def]
    """Follow the lane in a probe up to a time in s, and see what is there."""
    first = tables.first
    _fill(probe, LaneRow.SIZE.value, t - probe[LaneRow.TIME.value, 0])
    run_at(tables.probe, probe, 0)
    for row in range(tables.moving):
        _fill(probe, first[LaneRow.Y.value] + row, probe[first[LaneRow.NEW.value] + row, 0])
    _fill(probe, LaneRow.MOMENT.value, min(t, probe[LaneRow.HIGH.value, 0]))
    run_at(tables.jets, probe, first[LaneRow.SIGHT.value])


@inner
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


@inner
def _put(stack, row, low, left, high, right, missed, room):  # type: ignore[no-untyped-def]
    """An interval: time and jet at both ends, how much the quintic was off at one of them, and how near that was."""
    interval = stack[row]
    interval[0], interval[1], interval[2], interval[3] = low, left[0], left[1], left[2]
    interval[4], interval[5], interval[6], interval[7] = high, right[0], right[1], right[2]
    interval[8], interval[9] = missed, room


@inner
def _top(tables, lanes, row, sign, offset, best, near, enough):  # type: ignore[no-untyped-def]
    """The largest value in the interval that is on the stack, and when; or the first that is seen above `enough`.

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
            best = max(best, height) if enough == np.inf else best
            continue
        if looks > 60 or count + 2 > len(stack):
            return np.nan, when
        looks += 1
        _probe(tables, probe, t)
        middle = _jet(probe, row, sign, offset, 0)
        if middle[0] > best:
            best, when = middle[0], t
            if best > enough:
                return best, when
        missed, room = abs(height - middle[0]), min(t - low, high - t)
        _put(stack, count, low, left, t, middle, missed, room)
        _put(stack, count + 1, t, middle, high, right, missed, room)
        count += 2
    return best, when


@inner
def _first_met(tables, lanes, lane):  # type: ignore[no-untyped-def]
    """The guard that is met first in the last step of a lane, and when in s; Met.NOTHING where none is."""
    now, met, extremes = lanes.now, Met.NOTHING.value, tables.extremes.shape[0]
    low, high = now[LaneRow.LAST_TIME.value, lane], now[LaneRow.TIME.value, lane]
    end = high
    for guard in range(tables.guards):
        side, offset, number = (
            now[tables.first[LaneRow.SIDES.value] + guard, lane],
            now[tables.first[LaneRow.OFFSETS.value] + guard, lane],
            extremes + guard,
        )
        left = _jet(now, tables.first[LaneRow.LAST_SIGHT.value] + JET * number, side, offset, lane)
        right = _jet(now, tables.first[LaneRow.SIGHT.value] + JET * number, side, offset, lane)
        inside, beyond = reach(high - low, left, right)
        if side == 0.0 or (right[0] <= 0 and inside + beyond <= 0):
            continue
        upper, value, row = high, right[0], tables.first[LaneRow.SIGHT.value] + JET * number
        if value <= 0:
            _put(lanes.stack, 0, low, left, high, right, 0.0, 0.0)
            near = TYPED * max(abs(left[0]), abs(right[0]))
            value, upper = _top(tables, lanes, row, side, offset, 0.0, near, 0.0)
        if not value > 0:
            continue
        share = (upper - low) / (high - low)
        guess = low + (high - low) * root(powers(high - low, left, right), 0.0, share, 1.0, 8)
        time = _rise(tables, lanes.probe, row, side, offset, low, upper, guess)
        if time < end or met == Met.NOTHING.value:
            met, end = guard, time
    return met, end


@inner
def _past(tables, probe, end):  # type: ignore[no-untyped-def]
    """A time in s just past that of a probe, up to which no state moves by more than a hundredth of its tolerance."""
    longest, tolerance = np.inf, probe[LaneRow.TOLERANCE.value, 0]
    for row in range(tables.states):
        x = probe[tables.first[LaneRow.NEW.value] + row, 0]
        rate = (x - probe[tables.first[LaneRow.X.value] + row, 0]) / probe[LaneRow.SIZE.value, 0]
        if rate != 0.0:
            longest = min(
                longest, 0.01 * tolerance * (probe[tables.first[LaneRow.NOMINAL.value] + row, 0] + abs(x)) / abs(rate)
            )
    return min(end, probe[LaneRow.MOMENT.value, 0] + longest)


@inner
def _measure(tables, lanes, seen, lane, end):  # type: ignore[no-untyped-def]
    """Take the inside of the last step of a lane into the extremes, up to a time in s and what is seen there."""
    now = lanes.now
    low = now[LaneRow.LAST_TIME.value, lane]
    for k in range(tables.extremes.shape[0]):
        number, sign = JET * tables.extremes[k, 0], tables.signs[k]
        left = _jet(now, tables.first[LaneRow.LAST_SIGHT.value] + number, sign, 0.0, lane)
        right = _jet(seen, tables.first[LaneRow.SIGHT.value] + number, sign, 0.0, lane)
        best = max(now[tables.first[LaneRow.BEST.value] + k, lane], left[0], right[0])
        lowest = min(now[tables.first[LaneRow.LOWS.value] + k, lane], left[0], right[0])
        _put(lanes.stack, 0, low, left, end, right, 0.0, 0.0)
        best, _ = _top(
            tables, lanes, tables.first[LaneRow.SIGHT.value] + number, sign, 0.0, best, TYPED * (best - lowest), np.inf
        )
        now[tables.first[LaneRow.BEST.value] + k, lane], now[tables.first[LaneRow.LOWS.value] + k, lane] = best, lowest


@inner
def _load(tables, course, lanes, lane, variant):  # type: ignore[no-untyped-def]
    """Let a variant begin in a lane."""
    now = lanes.now
    now[LaneRow.TIME.value, lane], now[LaneRow.BEGUN.value, lane] = course.t[variant], course.t[variant]
    now[LaneRow.HIGH.value, lane], now[LaneRow.END.value, lane] = course.highs[variant], course.ends[variant]
    now[LaneRow.ACTIVE.value, lane], now[LaneRow.STEP.value, lane], now[LaneRow.MADE.value, lane] = 1.0, -1.0, 0.0
    for row in range(tables.moving):
        now[tables.first[LaneRow.X.value] + row, lane] = course.x[row, variant] if row < tables.states else 0.0
    for row in range(course.p.shape[0]):
        now[tables.first[LaneRow.P.value] + row, lane] = course.p[row, variant]
    for guard in range(tables.guards):
        now[tables.first[LaneRow.SIDES.value] + guard, lane] = course.sides[guard, variant]
        now[tables.first[LaneRow.OFFSETS.value] + guard, lane] = course.offsets[guard, variant]
    for k in range(tables.extremes.shape[0]):
        now[tables.first[LaneRow.BEST.value] + k, lane] = course.best[tables.extremes[k, 1], variant]
        now[tables.first[LaneRow.LOWS.value] + k, lane] = np.inf


@inner
def _leave(tables, course, lanes, memory, x, lane, t, met):  # type: ignore[no-untyped-def]
    """Write where a variant has come to in a lane, from the row where its states stand, and what it has met."""
    variant = lanes.variants[lane]
    course.met[variant], course.t[variant], course.steps[variant] = met, t, lanes.now[LaneRow.SIZE.value, lane]
    for row in range(tables.moving):
        if row < tables.states:
            course.x[row, variant] = memory[x + row, lane]
        else:
            course.integrals[row - tables.states, variant] += memory[x + row, lane]
    for k in range(tables.extremes.shape[0]):
        row, best = tables.extremes[k, 1], lanes.now[tables.first[LaneRow.BEST.value] + k, lane]
        course.best[row, variant] = best if np.isnan(best) else max(course.best[row, variant], best)


@inner
def _begin(tables, lanes, lane, last):  # type: ignore[no-untyped-def]
    """Set the first step: as the last one, in s, or such that no state changes by more than a hundredth of its size.

    A law's switch is met on the side on which its value is not, or to which it does not go.
    """
    now, step = lanes.now, np.inf
    for row in range(tables.states):
        x, rate = now[tables.first[LaneRow.X.value] + row, lane], now[tables.first[LaneRow.SLOPES.value] + row, lane]
        if rate != 0.0:
            step = min(step, 0.01 * (now[tables.first[LaneRow.NOMINAL.value] + row, lane] + abs(x)) / abs(rate))
    now[LaneRow.STEP.value, lane] = max(step, last)
    for guard in range(tables.guards - tables.free, tables.guards):
        now[tables.first[LaneRow.SIDES.value] + guard, lane] = 0.0
        row = tables.first[LaneRow.SIGHT.value] + JET * (tables.extremes.shape[0] + guard)
        for value in _jet(now, row, 1.0, 0.0, lane):
            if value != 0.0:
                now[tables.first[LaneRow.SIDES.value] + guard, lane] = -np.sign(value)
                break


@inner
def _arrived(tables, course, lanes, lane):  # type: ignore[no-untyped-def]
    """Whether a lane is done: it has met a guard in its last step, or is at its end."""
    now, met = lanes.now, Met.NOTHING.value
    end, last, close = now[LaneRow.TIME.value, lane], now[LaneRow.END.value, lane], now[LaneRow.CLOSE.value, lane] > 0
    if close:
        _repeat(tables, lanes, lane)
        met, end = _first_met(tables, lanes, lane)
    if met == Met.NOTHING.value:
        if close:
            _measure(tables, lanes, now, lane, end)
        if end >= last:
            _leave(tables, course, lanes, now, tables.first[LaneRow.X.value], lane, end, Met.THE_END.value)
        return end >= last
    _probe(tables, lanes.probe, end)
    if met >= tables.guards - tables.free:
        end = _past(tables, lanes.probe, last)
        _probe(tables, lanes.probe, end)
    there = lanes.probe.copy()
    _measure(tables, lanes, there, lane, end)
    _leave(tables, course, lanes, there, tables.first[LaneRow.NEW.value], lane, end, met)
    return True


@inner
def _hopeless(now, lane, end):  # type: ignore[no-untyped-def]
    """Whether the steps of a lane have become too short, or so many are foreseen that it is better off alone.

    A variant that will take more than 100 000 up to the end is stiff, or swings that often.
    """
    t, count = now[LaneRow.TIME.value, lane], now[LaneRow.MADE.value, lane]
    gone = t - now[LaneRow.BEGUN.value, lane]
    slow = count > 4 * LANES and count * (gone + end - t) > 100_000 * gone
    return slow or (count > 0 and not now[LaneRow.STEP.value, lane] > 8 * EPS * abs(t))


@compiled()
def follow(  # type: ignore[no-untyped-def]
    rates, jets, probe, advance, compare, first, states, moving, guards, free, extremes, signs,
    t, x, p, ends, highs, sides, offsets, integrals, best, steps, met, nominal, limits,
):  # fmt: skip
    """Follow all variants of a course up to a guard, their end or a limit.

    All are plain arrays and numbers: numba keeps what it compiles by their kinds, from one version to the next.

    Args:
        rates, jets, probe, advance, compare, first, states, moving, guards, free, extremes, signs: `LaneTables`.
        t, x, p, ends, highs, sides, offsets, integrals, best, steps, met: `LaneCourse`.
        nominal: (n,) sizes of the states.
        limits: (3,) the tolerance of a step, the longest step and the end of the motion, s.
    """
    tables = LaneTables(rates, jets, probe, advance, compare, first, states, moving, guards, free, extremes, signs)
    course = LaneCourse(t, x, p, ends, highs, sides, offsets, integrals, best, steps, met)
    lanes = _Lanes(
        np.zeros((tables.first[LaneRow.HEIGHT.value], LANES)),
        np.zeros((tables.first[LaneRow.HEIGHT.value], LANES)),
        np.zeros((LANES * JET, 10)),
        np.full(LANES, -1),
    )
    now, variants, waiting, busy = lanes.now, lanes.variants, course.t.size, True
    _fill(now, LaneRow.TOLERANCE.value, limits[0])
    _fill(now, LaneRow.LONGEST.value, limits[1])
    for row in range(tables.states):
        _fill(now, tables.first[LaneRow.NOMINAL.value] + row, nominal[row])
    while busy:
        _look(tables, now)
        run_at(tables.compare, now, 0)
        busy, loaded = False, False
        for lane in range(LANES):
            variant = variants[lane]
            to_see = now[LaneRow.CLOSE.value, lane] > 0 or now[LaneRow.TIME.value, lane] >= now[LaneRow.END.value, lane]
            if now[LaneRow.MOVED.value, lane] > 0 and to_see:
                if _arrived(tables, course, lanes, lane):
                    variant = -1
            elif variant >= 0 and _hopeless(now, lane, limits[2]):
                variant = -1
            if variant < 0 and waiting:
                variant, waiting, loaded = course.t.size - waiting, waiting - 1, True
                _load(tables, course, lanes, lane, variant)
            elif variant < 0:
                now[LaneRow.ACTIVE.value, lane] = 0.0
            variants[lane] = variant
            busy = busy or variant >= 0
        if loaded:
            _look(tables, now)
            for lane in range(LANES):
                if now[LaneRow.STEP.value, lane] < 0:
                    _begin(tables, lanes, lane, course.steps[variants[lane]])
        run_at(tables.advance, now, 0)
