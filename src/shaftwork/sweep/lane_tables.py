"""The memory of lanes, and what is told about them."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from shaftwork.codegen.array_form.elements import Array, Index

FIRST_CHANGE = 0.01
"""By so small a part of its size each state may change in a first step."""
PAST = 0.01
"""A switch of a law is passed by so small a part of the tolerance of each state."""
TOLD = 0.01
"""A quintic is believed where its own points are nearer by this factor than they were to the place looked at before."""
LOOKS = 60
"""A peak or a guard that so many looks into a step have not told is left to a single run."""
MOST_STEPS = 100_000
"""A variant that will take more of them is stiff, or swings that often: it is better off alone."""


class Met(IntEnum):
    """What a lane has met where that is no guard: nothing, the end, or what it cannot pass."""

    NOTHING = -1
    THE_END = -2
    GIVEN_UP = -3


class LaneRow(IntEnum):
    """What stands in the memory of a block of lanes: what has one row, of which this is the number, and then arrays.

    Those before Y are there for each variant as well, and are loaded where it takes a lane.
    """

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
    """Time at which slopes and monitored values are, s."""
    END = 6
    """Up to which a lane goes, s."""
    STEP = 7
    """Length of the next step, s; of a variant that of the last one."""
    ACTIVE = 8
    """1 where a lane is on its way."""
    MOVED = 9
    """1 where its last step was good."""
    INSPECTED = 10
    """1 where the inside of that has to be looked at."""
    MADE = 11
    """How many steps were tried."""
    LAST_TIME = 12
    """At the start of the last good step, s."""
    BEGUN = 13
    """Time at which the lane began, s."""
    VARIANT = 14
    """Which one is in a lane; -1 for none."""
    MET = 15
    """What a variant has met."""
    NOMINAL = 16
    """Nominal sizes of the states."""
    X = 17
    """States and integrals at the start of a step."""
    BEST = 18
    """Largest values so far, of extremes."""
    LOWS = 19
    """Lowest values so far, of extremes."""
    SIGNS = 20
    """Of extremes: times which a quantity is the largest."""
    SIDES = 21
    """On which guards are met; 0 where one is not watched."""
    OFFSETS = 22
    """How far beyond zero they have to go."""
    P = 23
    """Parameters."""
    Y = 24
    """States and integrals at the moment."""
    NEW = 25
    """The same at the end of a step."""
    LAST_X = 26
    """The same at the start of the last good step."""
    SLOPES = 27
    """Of states, integrals and what depends on time itself, stage by stage."""
    FIFTH = 28
    """What a method of order 5 misses of all slopes."""
    THIRD = 29
    """The same by one of order 3."""
    FIFTHS = 30
    """Squares of that over what is allowed, of the states."""
    THIRDS = 31
    """The same by order 3."""
    MONITORED = 32
    """Jets of what is watched, and values and gradients of what controls the step by its error."""
    LAST_MONITORED = 33
    """Jets at the start of the last good step."""
    HEIGHT = 34
    """Behind all of them."""


class LaneNumber(IntEnum):
    """What is told about lanes, behind the first rows of what is in their memory."""

    JETS = LaneRow.HEIGHT + 1
    """Address of what writes what is seen at y and the moment."""
    PROBE = LaneRow.HEIGHT + 2
    """Of what makes a step of a given size."""
    ADVANCE = LaneRow.HEIGHT + 3
    """Of what makes a step that is as long as the tolerance lets it be."""
    LOOK = LaneRow.HEIGHT + 4
    """Of what writes the first slopes and what is seen at the start of a step, and looks at the last one."""
    STATES = LaneRow.HEIGHT + 5
    """Number of states."""
    MOVING = LaneRow.HEIGHT + 6
    """Number of states and integrals; integrals stand behind states."""
    EXTREMES = LaneRow.HEIGHT + 7
    """Number of extremes; their quantities are the first monitored values."""
    GUARDS = LaneRow.HEIGHT + 8
    """Number of guards and switches, the monitored values behind those."""
    SWITCHES = LaneRow.HEIGHT + 9
    """Number of switches of laws, the last of these."""


class LaneCourse(NamedTuple):
    """Variants on their way.

    Args:
        t: (k,) s.
        x: (n, k) states.
        p: (parameters, k).
        ends: (k,) up to which they go, s.
        highs: (k,) the latest times at which anything is evaluated, s: just before a jump at the end.
        sides: (guards, k) on which a guard is met; 0 where it is not watched.
        offsets: (guards, k) how far beyond zero each has to go.
        best: (measures, k) largest values so far.
        steps: (k,) the length of the last step, which the next is tried with, s.
    """

    t: Array
    x: Array
    p: Array
    ends: Array
    highs: Array
    sides: Array
    offsets: Array
    best: Array
    steps: Array


class LaneEnd(NamedTuple):
    """Where variants have come to.

    Args:
        t, x, best, steps: as in `LaneCourse`.
        integrals: (integrals, k).
        met: (k,) guards, THE_END or GIVEN_UP.
    """

    t: Array
    x: Array
    best: Array
    steps: Array
    integrals: Array
    met: Index
