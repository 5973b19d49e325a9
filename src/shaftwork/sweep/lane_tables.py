"""The memory of lanes, and what is told about them."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from shaftwork.codegen.array_form.elements import Array, Index


class Met(IntEnum):
    """What a lane has met where that is no guard: nothing, the end, or what it cannot pass."""

    NOTHING = -1
    THE_END = -2
    A_LIMIT = -3


class LaneRows(NamedTuple):
    """The first row of each array in the memory of a block of lanes.

    Args:
        nominal: nominal sizes of the states.
        tolerance: of a step.
        longest: a step at most, s.
        time: at the start of a step, s.
        size: length of a step, s.
        high: the latest time at which anything is evaluated, s.
        moment: time at which slopes and sights are, s.
        end: up to which a lane goes, s.
        step: length of the next step, s.
        active: 1 where a lane is on its way.
        moved: 1 where its last step was good.
        close: 1 where more than the ends of that is to be looked at.
        made: how many steps were tried.
        last_time: at the start of the last good step, s.
        begun: time at which the lane began, s.
        x: states and integrals at the start of a step.
        y: the same at the moment.
        new: the same at the end.
        last_x: the same at the start of the last good step.
        slopes: of states, integrals and what is blind, stage by stage.
        fifth: what a method of order 5 misses of all slopes.
        third: the same by one of order 3.
        fifths: squares of that over what is allowed, of the states.
        thirds: the same by order 3.
        sight: jets of what is seen, and values and gradients of what is judged.
        last_sight: jets at the start of the last good step.
        best: largest values so far, of extremes,
        lows: and the lowest.
        sides: on which guards are met; 0 where one is not watched.
        offsets: how far beyond zero they have to go.
        p: parameters.
        height: rows in all.
    """

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
    made: int
    last_time: int
    begun: int
    x: int
    y: int
    new: int
    last_x: int
    slopes: int
    fifth: int
    third: int
    fifths: int
    thirds: int
    sight: int
    last_sight: int
    best: int
    lows: int
    sides: int
    offsets: int
    p: int
    height: int


class LaneTables(NamedTuple):
    """The functions of a program, by address, and where its numbers stand.

    Args:
        rates: writes the slopes at y and the moment.
        jets: writes what is seen there.
        probe: makes a step of a given size.
        advance: makes a step that is as long as the tolerance lets it be.
        compare: looks at the ends of the last step.
        rows: the memory.
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
    rows: LaneRows
    states: int
    moving: int
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
