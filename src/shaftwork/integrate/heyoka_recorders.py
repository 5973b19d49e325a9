"""What a run of heyoka records while it goes on: rows of output, or its series."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from shaftwork.integrate.breaks import Breaks
from shaftwork.integrate.problem import Array, Problem
from shaftwork.integrate.switches import SwitchWatch

# What heyoka's outcomes are called here where a guard ended the run.
GUARD = "guard"
# heyoka's outcomes proper are below this number; those above are events that have ended a run.
FIRST_OUTCOME = -(2**32)


class GridRecorder:
    """Fills rows of output while the integrator passes their times; `stops` are those at which it stops in between."""

    def __init__(self, problem: Problem, rows: Array, times: Array, end: float, chunk: int, stops: list[float]) -> None:
        self._breaks = Breaks(problem)
        self._rows, self._chunk, self._stops = rows, chunk, stops
        # The grid always ends with the piece, because the next piece starts from there.
        self._grid = times if times.size and times[-1] == end else np.append(times, end)
        self._filled = 0

    @property
    def filled(self) -> int:
        """Rows of output that are filled."""
        return min(self._filled, len(self._rows))

    def __call__(self, integrator: Any, watch: SwitchWatch | None, limit: int, longest: float) -> tuple[Any, str, int]:
        taken = 0
        while True:
            pending, now = self._grid[self._filled : self._filled + self._chunk], integrator.time
            extra = int(pending[0] != now)  # heyoka's grid starts at the present time
            outcome, _, _, steps, _, found = integrator.propagate_grid(
                np.append(now, pending) if extra else pending,
                max_steps=self._breaks.limit(limit - taken),
                max_delta_t=longest,
                callback=watch,
            )
            found, taken = found[extra:], taken + steps
            kept = found[: len(self._rows) - self._filled]
            self._rows[self._filled : self._filled + len(kept)] = kept
            self._filled += len(found)
            arrived = self._filled == self._grid.size
            if len(found) < len(pending) and self._breaks.goes_on(integrator, outcome, steps, limit - taken):
                continue
            if arrived or len(found) < len(pending) or taken >= limit:
                return outcome, _outcome(outcome, watch, arrived=arrived), taken
            self._stops.append(integrator.time)


class SegmentRecorder:
    """Keeps heyoka's continuous output of the spans that it passes, with the stops of an earlier run in between."""

    def __init__(self, problem: Problem, end: float, stops: Sequence[float] = ()) -> None:
        self._breaks = Breaks(problem)
        self._end, self._stops = end, stops
        self.segments: list[Any] = []

    def __call__(self, integrator: Any, watch: SwitchWatch | None, limit: int, longest: float) -> tuple[Any, str, int]:
        taken = 0
        while True:
            stop = min((stop for stop in self._stops if stop > integrator.time), default=self._end)
            outcome, _, _, steps, segment, _ = integrator.propagate_until(
                stop, max_steps=self._breaks.limit(limit - taken), max_delta_t=longest, callback=watch, c_output=True
            )
            taken += steps
            if outcome.name == "time_limit":  # heyoka counts time in two numbers, and may end a rounding beside it
                integrator.time = stop
            if segment is not None:
                self.segments.append(segment)
            arrived = integrator.time == self._end
            if integrator.time != stop and self._breaks.goes_on(integrator, outcome, steps, limit - taken):
                continue
            if arrived or integrator.time != stop or taken >= limit:
                return outcome, _outcome(outcome, watch, arrived=arrived), taken


def _outcome(outcome: Any, watch: SwitchWatch | None, *, arrived: bool) -> str:
    """Name of heyoka's outcome; a watch that stops the very last step has stopped the run only if it has a reason.

    A run that has come to a stop on its way with its last step has met the limit of its steps, not its end.
    """
    failed = watch is not None and watch.reason is not None
    if int(outcome) > FIRST_OUTCOME and not failed:
        return GUARD
    if arrived and not failed:
        return "time_limit"
    return "step_limit" if outcome.name == "time_limit" else str(outcome.name)
