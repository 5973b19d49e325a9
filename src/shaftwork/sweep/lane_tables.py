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


class LaneRow(IntEnum):
    """What stands in the memory of a block of lanes: what has one row, of which this is the number, and then arrays."""

    TOLERANCE = 0
    """Of a step."""
    LONGEST = 1
    """A step at most, s."""
    TIME = 2
    """At the start of a step, s."""
    SIZE = 3
    """Length of a step, s."""
    HIGH = 4
    """The latest time at which anything is evaluated, s."""
    MOMENT = 5
    """Time at which slopes and sights are, s."""
    END = 6
    """Up to which a lane goes, s."""
    STEP = 7
    """Length of the next step, s."""
    ACTIVE = 8
    """1 where a lane is on its way."""
    MOVED = 9
    """1 where its last step was good."""
    CLOSE = 10
    """1 where more than the ends of that is to be looked at."""
    MADE = 11
    """How many steps were tried."""
    LAST_TIME = 12
    """At the start of the last good step, s."""
    BEGUN = 13
    """Time at which the lane began, s."""
    NOMINAL = 14
    """Nominal sizes of the states."""
    X = 15
    """States and integrals at the start of a step."""
    Y = 16
    """The same at the moment."""
    NEW = 17
    """The same at the end."""
    LAST_X = 18
    """The same at the start of the last good step."""
    SLOPES = 19
    """Of states, integrals and what is blind, stage by stage."""
    FIFTH = 20
    """What a method of order 5 misses of all slopes."""
    THIRD = 21
    """The same by one of order 3."""
    FIFTHS = 22
    """Squares of that over what is allowed, of the states."""
    THIRDS = 23
    """The same by order 3."""
    SIGHT = 24
    """Jets of what is seen, and values and gradients of what is judged."""
    LAST_SIGHT = 25
    """Jets at the start of the last good step."""
    BEST = 26
    """Largest values so far, of extremes."""
    LOWS = 27
    """And the lowest."""
    SIDES = 28
    """On which guards are met; 0 where one is not watched."""
    OFFSETS = 29
    """How far beyond zero they have to go."""
    P = 30
    """Parameters."""
    HEIGHT = 31
    """Behind all of them."""


class LaneTables(NamedTuple):
    """The functions of a program, by address, and where its numbers stand.

    Args:
        rates: writes the slopes at y and the moment.
        jets: writes what is seen there.
        probe: makes a step of a given size.
        advance: makes a step that is as long as the tolerance lets it be.
        compare: looks at the ends of the last step.
        first: (LaneRow.HEIGHT + 1,) the first row of each array.
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
    first: Index
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
