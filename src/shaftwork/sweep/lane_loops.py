"""Many variants side by side in machine code: each with its own time, state and parameters, eight in one call.

A variant is followed from where it starts up to the first guard that it meets, the end, or what it cannot pass; where
one is done the next takes its lane. What comes out for one does not depend on those beside it.

Between the ends of steps a quantity is the quintic through its values and first two derivatives there; where that may
reach a limit, or more than the largest value so far, the step is made again up to that place.
"""

from __future__ import annotations

import numpy as np

from shaftwork.numerics.hermite import JET, peak, powers, reach, root
from shaftwork.numerics.lane_functions import LANES
from shaftwork.numerics.machine_code import compiled, inner, run_at
from shaftwork.numerics.tolerances import EPS, ROUNDINGS, TYPED
from shaftwork.sweep.lane_tables import FIRST_CHANGE, LOOKS, MOST_STEPS, PAST, TOLD, LaneNumber, LaneRow, Met


@inner
def _fill(memory, row, value):  # type: ignore[no-untyped-def]
    """Write a number for all lanes; numba takes a second to compile an assignment to a row."""
    for lane in range(LANES):
        memory[row, lane] = value


@inner
def _jet(memory, row, sign, offset, lane):  # type: ignore[no-untyped-def]
    """A value and its derivatives of one lane, times a sign and less an offset."""
    return sign * memory[row, lane] - offset, sign * memory[row + 1, lane], sign * memory[row + 2, lane]


@inner
def _repeat(tables, now, probe, lane):  # type: ignore[no-untyped-def]
    """Let all lanes of the probe start where the last step of one did."""
    for row in range(tables[LaneRow.Y.value]):
        _fill(probe, row, now[row, lane])
    for row in range(tables[LaneNumber.MOVING.value]):
        _fill(probe, tables[LaneRow.X.value] + row, now[tables[LaneRow.LAST_X.value] + row, lane])
    _fill(probe, LaneRow.TIME.value, now[LaneRow.LAST_TIME.value, lane])
    run_at(tables[LaneNumber.LOOK.value], probe, 0)


@inner
def _probe(tables, probe, t):  # type: ignore[no-untyped-def]
    """Follow the lane in a probe up to a time in s, and see what is there."""
    _fill(probe, LaneRow.SIZE.value, t - probe[LaneRow.TIME.value, 0])
    run_at(tables[LaneNumber.PROBE.value], probe, 0)
    for row in range(tables[LaneNumber.MOVING.value]):
        _fill(probe, tables[LaneRow.Y.value] + row, probe[tables[LaneRow.NEW.value] + row, 0])
    _fill(probe, LaneRow.MOMENT.value, min(t, probe[LaneRow.HIGH.value, 0]))
    run_at(tables[LaneNumber.JETS.value], probe, tables[LaneRow.MONITORED.value])


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
def _put(interval, low, left, high, right, missed, room):  # type: ignore[no-untyped-def]
    """An interval: time and jet at both ends, how much the quintic was off at one of them, and how near that was."""
    interval[0], interval[1], interval[2], interval[3] = low, left[0], left[1], left[2]
    interval[4], interval[5], interval[6], interval[7] = high, right[0], right[1], right[2]
    interval[8], interval[9] = missed, room


@inner
def _top(tables, probe, stack, row, sign, offset, best, near, enough):  # type: ignore[no-untyped-def]
    """The largest value in the interval that is on the stack, and when; or the first that is seen above `enough`.

    NaN where too many places were looked at in vain.
    """
    count, when, looks = 1, stack[0, 0], 0
    while count:
        count -= 1
        interval = stack[count]
        low, high, missed, room = interval[0], interval[4], interval[8], interval[9]
        left, right = (interval[1], interval[2], interval[3]), (interval[5], interval[6], interval[7])
        inside, beyond = reach(high - low, left, right)
        if high - low <= TYPED * abs(low) or not inside > max(left[0], right[0]) or inside + beyond <= best + near:
            continue
        place, height = peak(high - low, left, right)
        if height + beyond <= best + near:
            continue
        t = low + place * (high - low)
        # what a polynomial misses grows with the cube of the distance from a point that it goes through
        part = min(t - low, high - t) / room if room > 0 else 1.0
        if part < TOLD and missed * part * part * part < near:
            best = max(best, height) if enough == np.inf else best
            continue
        if looks > LOOKS or count + 2 > len(stack):
            return np.nan, when
        looks += 1
        _probe(tables, probe, t)
        middle = _jet(probe, row, sign, offset, 0)
        if middle[0] > best:
            best, when = middle[0], t
            if best > enough:
                return best, when
        missed, room = abs(height - middle[0]), min(t - low, high - t)
        _put(stack[count], low, left, t, middle, missed, room)
        _put(stack[count + 1], t, middle, high, right, missed, room)
        count += 2
    return best, when


@inner
def _first_met(tables, now, probe, stack, lane):  # type: ignore[no-untyped-def]
    """The guard that is met first in the last step of a lane, and when in s; Met.NOTHING, or GIVEN_UP where unknown."""
    low, high = now[LaneRow.LAST_TIME.value, lane], now[LaneRow.TIME.value, lane]
    met, end = Met.NOTHING.value, high
    for guard in range(tables[LaneNumber.GUARDS.value]):
        side = now[tables[LaneRow.SIDES.value] + guard, lane]
        offset = now[tables[LaneRow.OFFSETS.value] + guard, lane]
        number = JET * (tables[LaneNumber.EXTREMES.value] + guard)
        row = tables[LaneRow.MONITORED.value] + number
        left = _jet(now, tables[LaneRow.LAST_MONITORED.value] + number, side, offset, lane)
        right = _jet(now, row, side, offset, lane)
        inside, beyond = reach(high - low, left, right)
        if side == 0.0 or (right[0] <= 0 and inside + beyond <= 0):
            continue
        upper, value = high, right[0]
        if value <= 0:
            _put(stack[0], low, left, high, right, 0.0, 0.0)
            near = TYPED * max(abs(left[0]), abs(right[0]))
            value, upper = _top(tables, probe, stack, row, side, offset, 0.0, near, 0.0)
        if np.isnan(value):
            return Met.GIVEN_UP.value, end
        if value <= 0:
            continue
        share = (upper - low) / (high - low)
        guess = low + (high - low) * root(powers(high - low, left, right), 0.0, share, 1.0)
        time = _rise(tables, probe, row, side, offset, low, upper, guess)
        if time < end or met == Met.NOTHING.value:
            met, end = guard, time
    return met, end


@inner
def _past(tables, probe, end):  # type: ignore[no-untyped-def]
    """A time in s just past that of a probe, up to which no state moves by more than a small part of its tolerance."""
    longest, tolerance = np.inf, probe[LaneRow.TOLERANCE.value, 0]
    for row in range(tables[LaneNumber.STATES.value]):
        x = probe[tables[LaneRow.NEW.value] + row, 0]
        rate = (x - probe[tables[LaneRow.X.value] + row, 0]) / probe[LaneRow.SIZE.value, 0]
        if rate != 0.0:
            allowed = PAST * tolerance * (probe[tables[LaneRow.NOMINAL.value] + row, 0] + abs(x))
            longest = min(longest, allowed / abs(rate))
    return min(end, probe[LaneRow.MOMENT.value, 0] + longest)


@inner
def _measure(tables, now, probe, stack, seen, lane, end):  # type: ignore[no-untyped-def]
    """Take the inside of the last step of a lane into the extremes, up to a time in s and what is seen there.

    Returns:
        Whether all of them are known.
    """
    known, low = True, now[LaneRow.LAST_TIME.value, lane]
    for k in range(tables[LaneNumber.EXTREMES.value]):
        sign, row = now[tables[LaneRow.SIGNS.value] + k, lane], tables[LaneRow.MONITORED.value] + JET * k
        left = _jet(now, tables[LaneRow.LAST_MONITORED.value] + JET * k, sign, 0.0, lane)
        right = _jet(seen, row, sign, 0.0, lane)
        best = max(now[tables[LaneRow.BEST.value] + k, lane], left[0], right[0])
        lowest = min(now[tables[LaneRow.LOWS.value] + k, lane], left[0], right[0])
        _put(stack[0], low, left, end, right, 0.0, 0.0)
        best, _ = _top(tables, probe, stack, row, sign, 0.0, best, TYPED * (best - lowest), np.inf)
        now[tables[LaneRow.BEST.value] + k, lane], now[tables[LaneRow.LOWS.value] + k, lane] = best, lowest
        known = known and not np.isnan(best)
    return known


@inner
def _leave(tables, course, now, memory, x, lane, t, met):  # type: ignore[no-untyped-def]
    """Write where a variant has come to in a lane, from the row where its states stand, and what it has met."""
    variant = np.int64(now[LaneRow.VARIANT.value, lane])
    course[LaneRow.MET.value, variant], course[LaneRow.TIME.value, variant] = met, t
    course[LaneRow.STEP.value, variant] = now[LaneRow.SIZE.value, lane]
    for row in range(tables[LaneNumber.MOVING.value]):
        course[tables[LaneRow.X.value] + row, variant] = memory[x + row, lane]
    for row in range(tables[LaneRow.BEST.value], tables[LaneRow.LOWS.value]):
        course[row, variant] = now[row, lane]


@inner
def _begin(tables, now, lane):  # type: ignore[no-untyped-def]
    """Set the first step: as the last one, or such that no state changes by more than a small part of its size.

    A law's switch is met on the side on which its value is not, or to which it does not go.
    """
    step = np.inf
    for row in range(tables[LaneNumber.STATES.value]):
        x, rate = now[tables[LaneRow.X.value] + row, lane], now[tables[LaneRow.SLOPES.value] + row, lane]
        if rate != 0.0:
            step = min(step, FIRST_CHANGE * (now[tables[LaneRow.NOMINAL.value] + row, lane] + abs(x)) / abs(rate))
    now[LaneRow.STEP.value, lane] = max(step, now[LaneRow.STEP.value, lane])
    guards = tables[LaneNumber.GUARDS.value]
    for guard in range(guards - tables[LaneNumber.SWITCHES.value], guards):
        side, row = 0.0, tables[LaneRow.MONITORED.value] + JET * (tables[LaneNumber.EXTREMES.value] + guard)
        for k in range(JET - 1, -1, -1):
            if now[row + k, lane] != 0.0:
                side = -np.sign(now[row + k, lane])
        now[tables[LaneRow.SIDES.value] + guard, lane] = side


@inner
def _arrived(tables, course, now, probe, there, stack, lane):  # type: ignore[no-untyped-def]
    """Whether a lane is done: it has met a guard in its last step, is at its end, or what it has met is unknown."""
    met, end, last = Met.NOTHING.value, now[LaneRow.TIME.value, lane], now[LaneRow.END.value, lane]
    seen, x, guards = now, tables[LaneRow.X.value], tables[LaneNumber.GUARDS.value]
    if now[LaneRow.INSPECTED.value, lane] > 0:
        _repeat(tables, now, probe, lane)
        met, end = _first_met(tables, now, probe, stack, lane)
        if met >= 0:
            _probe(tables, probe, end)
            if met >= guards - tables[LaneNumber.SWITCHES.value]:
                end = _past(tables, probe, last)
                _probe(tables, probe, end)
            for row in range(tables[LaneRow.HEIGHT.value]):
                there[row, lane] = probe[row, lane]
            seen, x = there, tables[LaneRow.NEW.value]
        if met == Met.GIVEN_UP.value or not _measure(tables, now, probe, stack, seen, lane, end):
            return True  # as it was loaded, GIVEN_UP
    if met == Met.NOTHING.value and end >= last:
        met = Met.THE_END.value
    if met != Met.NOTHING.value:
        _leave(tables, course, now, seen, x, lane, end, met)
    return met != Met.NOTHING.value


@inner
def _hopeless(now, lane, end):  # type: ignore[no-untyped-def]
    """Whether the steps of a lane have become too short, or too many are foreseen up to the end."""
    t, count = now[LaneRow.TIME.value, lane], now[LaneRow.MADE.value, lane]
    gone = t - now[LaneRow.BEGUN.value, lane]
    slow = count > 4 * LANES and count * (gone + end - t) > MOST_STEPS * gone
    return slow or (count > 0 and not now[LaneRow.STEP.value, lane] > 8 * EPS * abs(t))


@compiled()
def follow(tables, course, now, probe, there, stack, end):  # type: ignore[no-untyped-def]
    """Follow all variants of a course up to a guard, their end or a limit.

    Args:
        tables: first rows of all that `LaneRow` names, and behind them what `LaneNumber` does.
        course: (first row of Y, k) variants; changed in place.
        now: (rows, LANES) memory; no variant is in it.
        probe: another one, in which one lane is followed.
        there: another one, for the end of a step.
        stack: (intervals, 10) in which a peak is looked for.
        end: of the motion, s.
    """
    count, waiting, busy = course.shape[1], course.shape[1], True
    while busy:
        run_at(tables[LaneNumber.LOOK.value], now, 0)
        busy, loaded = False, False
        for lane in range(LANES):
            on = now[LaneRow.VARIANT.value, lane] >= 0
            to_see = (
                now[LaneRow.INSPECTED.value, lane] > 0 or now[LaneRow.TIME.value, lane] >= now[LaneRow.END.value, lane]
            )
            if now[LaneRow.MOVED.value, lane] > 0 and to_see:
                on = not _arrived(tables, course, now, probe, there, stack, lane) and on
            on = on and not _hopeless(now, lane, end)
            now[LaneRow.MOVED.value, lane] = 0.0
            if not on and waiting:
                for row in range(tables[LaneRow.Y.value]):
                    now[row, lane] = course[row, count - waiting]
                waiting, loaded, on = waiting - 1, True, True
            elif not on:
                now[LaneRow.ACTIVE.value, lane], now[LaneRow.VARIANT.value, lane] = 0.0, -1.0
            busy = busy or on
        if loaded:
            continue  # nothing is seen yet of what is new
        for lane in range(LANES):
            if now[LaneRow.MADE.value, lane] == 0 and now[LaneRow.ACTIVE.value, lane] > 0:
                _begin(tables, now, lane)
        run_at(tables[LaneNumber.ADVANCE.value], now, 0)
