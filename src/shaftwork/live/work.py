"""The work on one answer of a page: how much it may be, and whether anybody waits for it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property

from shaftwork.core.errors import SimulationError
from shaftwork.results.observer import Array, Read, Reader
from shaftwork.results.solution import Solution

LONGEST, MOST_STEPS = 120.0, 100_000
"""Of the work on an answer, s: compiling a train of many parts takes a part of the first. And of a motion, whose
continuous output takes some 10 kB a step where there are many states."""
LIMITS = f"{MOST_STEPS} steps and {LONGEST:g} s are the most that an answer of a page takes"
ADVICE = "Let the motion end earlier on the page, or compute it with simulate."


class Work:
    """The work on one answer; `waits` says whether anybody still waits for it, from the thread of the work."""

    def __init__(self, waits: Callable[[], bool]) -> None:
        self._waits, self._start = waits, time.monotonic()

    def go_on(self, reached: float | None = None) -> None:
        """Raise a `SimulationError` where the work is to end; `reached` is the time in s to which a motion has come."""
        where = "" if reached is None else f" at t = {reached:g} s of the motion"
        if not self._waits():
            raise SimulationError(f"The work on the answer ended{where}: nobody waits for it any more.")
        if time.monotonic() - self._start > LONGEST:
            raise SimulationError(f"The work on the answer ended{where}: {LIMITS}. {ADVICE}")


class _WatchedReader(Reader):
    """Looks before each reading whether the work is to go on."""

    go_on: Callable[[], None]

    def quantity(self, name: str, place: int | None = None) -> Read:
        read = super().quantity(name, place)

        def watched(times: Array) -> Array:
            self.go_on()
            return read(times)

        return watched


@dataclass(frozen=True, eq=False, kw_only=True)
class WatchedSolution(Solution):
    """A motion whose extremes and pictures are read while the work goes on: `go_on` raises where it is to end."""

    go_on: Callable[[], None]

    @classmethod
    def of(cls, motion: Solution, go_on: Callable[[], None]) -> WatchedSolution:
        """The same motion, watched."""
        return cls(**{item.name: getattr(motion, item.name) for item in fields(motion)}, go_on=go_on)

    @cached_property
    def reader(self) -> Reader:
        reader = _WatchedReader(self.name, self.states, self.observer, self.dense)
        reader.go_on = self.go_on
        return reader
