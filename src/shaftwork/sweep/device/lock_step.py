"""Many lanes in lock-step: each repetition makes one step of every lane, a further one or one to where it is looked at.

What a step is, is written by `lane_step`; when more than its ends is looked at, and how, is told in `lane_loops`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import IntEnum
from functools import reduce
from typing import Any

import numpy as np
from scipy.integrate import DOP853

from shaftwork.numerics.hermite import JET
from shaftwork.numerics.lane_functions import LANES
from shaftwork.numerics.tolerances import EPS, ROUNDINGS
from shaftwork.numerics.traced_code import TracedBody, rows_of
from shaftwork.sweep.device.inner_search import InnerSearch, quintic
from shaftwork.sweep.lane_step import STAGES, StepWriter
from shaftwork.sweep.lane_tables import FIRST_CHANGE, MOST_STEPS, PAST, Met

SCRATCH = ("y", "new", "slopes", "fifth", "third", "fifths", "thirds", "moment")
"""What holds within a repetition alone."""


class LaneTask(IntEnum):
    """What a lane does in a repetition."""

    DONE = 0
    STARTS = 1
    """It looks at where it is."""
    GOES = 2
    """It makes a step."""
    GUARDS = 3
    """It looks into its last step for guards."""
    CLEARS = 4
    """It has found no guard there."""
    PEAKS = 5
    """It looks into its last step for peaks."""
    RISES = 6
    """It looks for the time at which a guard is met."""
    LANDS = 7
    """It looks at where it is as a guard is met."""
    PASSES = 8
    """It looks at where it is just behind that."""


class TracedStep(StepWriter):
    """Writes the step of arrays: the equations stand once in it, and are run stage by stage.

    A lane that makes no step is moved from the start of its last one up to its goal.
    """

    def _stages(self, size: Any) -> None:
        body: Any = self._body
        jax, memory = body.jax, body.memory
        numpy, going, count = jax.numpy, memory["active"] > 0, self._count
        size = numpy.where(going, size, memory["goal"] - memory["last_time"])
        start = numpy.where(going, memory["time"], memory["last_time"])
        base = numpy.where(going, memory["x"], memory["last_x"])
        kind, self._size = base.dtype, size[0]
        shares, moments = numpy.array(DOP853.A[:STAGES, :STAGES], dtype=kind), numpy.array(DOP853.C[:STAGES])

        def moved(weights: Any, slopes: Any) -> Any:
            parts = (weights[stage] * slopes[stage, : self._moving] for stage in range(STAGES))
            return base + size.astype(kind) * reduce(lambda one, other: one + other, parts)

        def slope(stage: Any, slopes: Any) -> Any:
            moment = numpy.minimum(start + moments[stage] * size, memory["high"])
            rates = self._slopes(memory | {"y": moved(shares[stage], slopes), "moment": moment})
            return slopes.at[stage].set(rates)

        slopes = jax.lax.fori_loop(0, STAGES, slope, numpy.zeros((STAGES, count, base.shape[1]), dtype=kind))
        memory["slopes"] = slopes.reshape(STAGES * count, -1)
        memory["new"] = moved(numpy.array(DOP853.B[:STAGES], dtype=kind), slopes)

    def reach(self, length: Any, left: Any, right: Any) -> tuple[Any, Any]:
        """How high the quintic may come in intervals, and how far the motion may be from it; behind `compare`."""
        self._size = length
        return self._reach(left, right)


class LockStep:
    """Follows lanes to their ends.

    Args:
        jax: the library.
        writer: of the step, a `TracedStep`.
        jets: writes what is seen.
        sizes: rows of each array of `LaneRow`, by its name in small letters.
        signs: of extremes.
        switches: how many of the guards are switches of laws.
    """

    def __init__(
        self,
        jax: Any,
        writer: Any,
        jets: Callable[[TracedBody], None],
        sizes: Mapping[str, int],
        signs: list[float],
        switches: int,
    ) -> None:
        self._jax, self._numpy, self._writer, self._jets, self._sizes = jax, jax.numpy, writer, jets, sizes
        self._guards, self._switches = sizes["sides"] - switches, switches
        self._search = InnerSearch(jax, signs, sizes["sides"], writer.reach)
        self.course = jax.jit(self._course)

    def begun(self, lanes: int, kind: Any) -> dict[str, Any]:
        """The memory of so many lanes, with numbers of a kind; times, parameters and what is told are always double."""
        states = ("nominal", "x", "last_x", "monitored", "last_monitored", "best", "lows")
        kept = {name: rows for name, rows in self._sizes.items() if name not in SCRATCH}
        arrays = {name: np.zeros((rows, lanes), dtype=kind if name in states else float) for name, rows in kept.items()}
        arrays["lows"][:] = np.inf
        mode = {
            "mode": np.full(lanes, LaneTask.DONE, dtype=np.int32),
            "met": np.full(lanes, Met.GIVEN_UP, dtype=np.int32),
        }
        times = {name: np.zeros(lanes) for name in ("goal", "far", "before", "behind", "crossed")}
        rise = {"guard": np.zeros(lanes, dtype=np.int32)}
        return {**arrays, **mode, **times, **rise, **self._search.begun(lanes)}

    def _course(self, memory: dict[str, Any]) -> dict[str, Any]:
        going = self._jax.lax.while_loop(
            lambda now: self._numpy.any(now["mode"] != LaneTask.DONE), self._repeat, memory
        )
        return {name: going[name] for name in ("time", "x", "best", "size", "met")}

    def _repeat(self, before: dict[str, Any]) -> dict[str, Any]:
        numpy, kind = self._numpy, before["x"].dtype
        memory = {name: numpy.zeros((self._sizes[name], before["met"].size), dtype=kind) for name in SCRATCH}
        memory |= {**before, "moment": before["time"]}
        going, starting = (before["mode"] == mode for mode in (LaneTask.GOES, LaneTask.STARTS))
        memory["active"] = going[None].astype(float)
        self._writer.advance(TracedBody(self._jax, memory), self._writer.probe)
        for name in ("step", "made", "size"):
            memory[name] = numpy.where(going, memory[name], before[name])
        there = {"y": numpy.where(going, memory["x"], memory["new"])}
        there["moment"] = numpy.minimum(numpy.where(going, memory["time"], memory["goal"]), memory["high"])
        memory["seen"] = rows_of(self._jax, memory | there, self._jets)
        memory["monitored"] = numpy.where(going | starting, memory["seen"], memory["monitored"])
        self._begin(memory, starting)
        self._writer.compare(TracedBody(self._jax, memory))
        self._turn(memory)
        return {name: memory[name] for name in before}

    def _begin(self, memory: dict[str, Any], starting: Any) -> None:
        """Set the first step of some lanes; see `lane_loops`."""
        numpy, states = self._numpy, self._sizes["nominal"]
        rates, x = abs(memory["slopes"][:states]), abs(memory["x"][:states])
        sizes = numpy.where(
            rates > 0, FIRST_CHANGE * (memory["nominal"] + x) / numpy.where(rates > 0, rates, 1.0), np.inf
        )
        first = numpy.maximum(numpy.min(sizes, axis=0), memory["step"])
        memory["step"] = numpy.where(starting, first, memory["step"])
        memory["mode"] = numpy.where(starting, LaneTask.GOES, memory["mode"])
        first, switches = JET * (self._sizes["best"] + self._guards), self._switches
        jets = memory["seen"][first : first + JET * switches].reshape(switches, JET, starting.size)
        told = numpy.take_along_axis(jets, numpy.argmax(jets != 0, axis=1)[:, None], 1)[:, 0]
        sides = numpy.where(starting, -numpy.sign(told), memory["sides"][self._guards :])
        memory["sides"] = memory["sides"].at[self._guards :].set(sides)

    def _turn(self, memory: dict[str, Any]) -> None:
        """Tell what each lane does next."""
        moved, inspected = memory["moved"][0] > 0, memory["inspected"][0] > 0
        settled = self._look(memory, inspected) if self._search.watched else inspected
        over = memory["time"][0] >= memory["end"][0]
        arrived = moved & ~inspected & over | settled & (over | (memory["met"] >= 0))
        lost = memory["lost"] > 0
        self._set(memory, arrived & (memory["met"] < 0), met=int(Met.THE_END))
        self._set(memory, lost, met=int(Met.GIVEN_UP))
        self._set(memory, arrived | lost | self._hopeless(memory), mode=int(LaneTask.DONE))

    def _look(self, memory: dict[str, Any], inspected: Any) -> Any:
        """Look into last steps; which lanes have nothing more to be looked at."""
        numpy, search, mode, guarded = self._numpy, self._search, memory["mode"], self._sizes["sides"] > 0
        looking, peaks = (mode == LaneTask.GUARDS) | (mode == LaneTask.PEAKS), mode == LaneTask.PEAKS
        search.divide(memory, looking)
        ready = more = numpy.zeros_like(inspected)
        if guarded:
            ready = (mode == LaneTask.CLEARS) | self._land(memory)  # before others are told to land
            more = self._rise(memory)
        ready = search.open(memory, inspected, ready)
        found, peaks = search.next(memory, looking | inspected | ready), peaks | ready
        if guarded:
            guards = (mode == LaneTask.GUARDS) | inspected & ~peaks
            self._set(memory, guards, mode=numpy.where(found, LaneTask.GUARDS, LaneTask.CLEARS))
            self._approach(memory, more | guards & ~found & self._exceeded(memory))
        self._set(memory, peaks, mode=numpy.where(found, LaneTask.PEAKS, LaneTask.GOES))
        return peaks & ~found

    def _set(self, memory: dict[str, Any], on: Any, **values: Any) -> None:
        """Let numbers of some lanes be others."""
        for name, value in values.items():
            memory[name] = self._numpy.where(on, value, memory[name]).astype(memory[name].dtype)

    def _hopeless(self, memory: dict[str, Any]) -> Any:
        """Whether the steps of lanes have become too short, or too many are foreseen; see `lane_loops`."""
        time, step, count = memory["time"][0], memory["step"][0], memory["made"][0]
        gone = time - memory["begun"][0]
        slow = (count > 4 * LANES) & (count * (gone + memory["far"] - time) > MOST_STEPS * gone)
        return (memory["mode"] == LaneTask.GOES) & (slow | (count > 0) & ~(step > 8 * EPS * abs(time)))

    def _exceeded(self, memory: dict[str, Any]) -> Any:
        """Whether there are guards of which the time has to be found."""
        return self._numpy.any(memory["uppers"] < np.inf, axis=0)

    def _approach(self, memory: dict[str, Any], on: Any) -> None:
        """Let some lanes look for the time at which the first of the exceeded guards is met."""
        numpy, low, high = self._numpy, memory["last_time"][0], memory["time"][0]
        guard = numpy.argmax(memory["uppers"] < np.inf, axis=0)
        upper = numpy.take_along_axis(memory["uppers"], guard[None], 0)[0]
        jets = (self._search.jet(memory, name, self._sizes["best"] + guard) for name in ("last_monitored", "monitored"))
        share = numpy.where(on, (upper - low) / (high - low), 1.0)
        part = self._search.root(quintic(high - low, *jets), numpy.zeros_like(low), share, 1.0, 8)
        guess = low + (high - low) * part[0]
        self._set(memory, on, mode=int(LaneTask.RISES), guard=guard, before=low, behind=upper, goal=guess, looks=0)

    def _rise(self, memory: dict[str, Any]) -> Any:
        """A step of Newton's to the time at which a guard rises through zero; which lanes have more of them."""
        numpy, on, there = self._numpy, memory["mode"] == LaneTask.RISES, memory["goal"]
        value, rate, _ = self._search.jet(memory, "seen", self._sizes["best"] + memory["guard"])
        before, behind = (
            numpy.where(value > 0, memory["before"], there),
            numpy.where(value > 0, there, memory["behind"]),
        )
        new = there - value / rate
        new = numpy.where((before <= new) & (new <= behind), new, (before + behind) / 2)
        self._set(memory, on, before=before, behind=behind, goal=new, looks=memory["looks"] + 1)
        high = memory["time"][0]
        nothing = 2 * EPS * (abs(high) + ROUNDINGS * (high - memory["last_time"][0]))
        near = (numpy.minimum(abs(new - there), behind - before) <= nothing) | (memory["looks"] >= 100)
        first = on & near & ((memory["met"] < 0) | (new < memory["crossed"]))
        self._set(memory, first, crossed=new, met=memory["guard"])
        numbers = np.arange(self._sizes["sides"])[:, None]
        memory["uppers"] = numpy.where(on & near & (numbers == memory["guard"]), np.inf, memory["uppers"])
        more = on & near & self._exceeded(memory)
        self._set(memory, on & near & ~more, mode=int(LaneTask.LANDS), goal=memory["crossed"])
        return more

    def _land(self, memory: dict[str, Any]) -> Any:
        """Which lanes have come to where their guard is met, or just past a switch of a law.

        In single precision they go past every guard: where it is met, rounding decides on which side they are.
        """
        numpy, mode, rounding = self._numpy, memory["mode"], self._numpy.finfo(memory["x"].dtype).eps
        passing = (memory["met"] >= self._guards) | (rounding > EPS)
        landed = (mode == LaneTask.LANDS) & ~passing | (mode == LaneTask.PASSES)
        self._set(memory, landed, time=memory["goal"], x=memory["new"], monitored=memory["seen"])
        states = slice(0, self._sizes["nominal"])
        change = abs(memory["new"][states] - memory["last_x"][states])
        rate = change / (memory["goal"] - memory["last_time"][0])
        part = numpy.maximum(PAST * memory["tolerance"], ROUNDINGS * rounding)
        near = part * (memory["nominal"] + abs(memory["new"][states]))
        longest = numpy.min(numpy.where(rate > 0, near / numpy.where(rate > 0, rate, 1.0), np.inf), axis=0)
        past = numpy.minimum(memory["end"][0], memory["goal"] + longest)
        self._set(memory, (mode == LaneTask.LANDS) & passing, mode=int(LaneTask.PASSES), goal=past)
        return landed
