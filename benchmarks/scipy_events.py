"""The rival of benchmarks/phases.py: the crane with gap and brake by hand, scipy's DOP853 with terminal events.

Run `python -m benchmarks.scipy_events`: events found, true error and CPU over tolerances. Each phase has its own
right-hand side in plain Python floats and its own events, terminal and with a direction; the integration starts anew in
the next phase. scipy looks at signs at the ends of its steps alone: two events within a step are lost without a word,
unless the steps are bounded. Equations and truth: tests/reference/hybrid_crane.py, with dry friction at J2.
"""

from __future__ import annotations

import json
import math
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

J1, J2, HALF_GAP, C, D = 27.35, 62.5, 0.01, 24206.0, 14.0
TAU_K, S_K, N_SYNC, RATIO, EFFICIENCY = 9.6, 0.25, 3000.0, 35.5, 0.95
T_BRAKE, TAU_BRAKE, TAU_LOAD, T_END = 6.5, 323.8, 22.4, 10.0
STRENGTH = 2.0 * RATIO * EFFICIENCY * TAU_K * S_K
PER_SPEED = RATIO / (N_SYNC * math.pi / 30.0)
SCALE = np.array([1.0, 1.0, 0.01])
"""Size of the states (rad/s, rad/s, rad): absolute tolerances are the relative one times this."""

MOST_EVENTS = 500
RTOLS = tuple(10.0**-exponent for exponent in range(3, 13))
TRUTH = Path(__file__).parents[1] / "tests" / "reference" / "hybrid_crane.json"

Event = tuple[float, str, int]
"""Time in s, part, and what it does then: the flank that carries, or the sign of the speed of a dry contact."""
Function = Callable[[float, Any], Any]


def rates(side: int, brake: int | None, load: int) -> Function:
    """The right-hand side of one phase; brake None is the time before it acts, 0 is locked."""
    stiffness, damping = (C, D) if side else (0.0, 0.0)
    shift, drag_1, drag_2 = side * HALF_GAP, TAU_BRAKE * (brake or 0), TAU_LOAD * load

    def driven(_t: float, y: Any) -> list[float]:
        w1, w2, phi = y.tolist()
        rate = w1 - w2
        tau = stiffness * (phi - shift) + damping * rate
        slip = 1.0 - PER_SPEED * w1
        acceleration = (STRENGTH * slip / (slip * slip + S_K * S_K) - tau) / J1
        return [acceleration, (tau - drag_2) / J2 if load else 0.0, rate]

    def braked(_t: float, y: Any) -> list[float]:
        w1, w2, phi = y.tolist()
        rate = w1 - w2
        tau = stiffness * (phi - shift) + damping * rate
        return [(-tau - drag_1) / J1 if brake else 0.0, (tau - drag_2) / J2 if load else 0.0, rate]

    return driven if brake is None else braked


def torque(side: int, y: Any) -> float:
    """What J1 gives to J2 through the flank that touches."""
    return float(C * (y[2] - side * HALF_GAP) + D * (y[0] - y[1])) if side else 0.0


def terminal(function: Function, direction: int) -> Function:
    """An event that ends the integration."""
    function.terminal, function.direction = True, direction  # type: ignore[attr-defined]
    return function


def guards(side: int, brake: int | None, load: int) -> list[tuple[str, int, Function]]:
    """Part, what it is about to do, event function: only those that this phase can meet."""
    if side:
        found = [("gap", 0, terminal(lambda _t, y: torque(side, y), -side))]
    else:
        found = [("gap", s, terminal(lambda _t, y, s=s: y[2] - s * HALF_GAP, s)) for s in (1, -1)]
    if brake:
        found.append(("brake", 0, terminal(lambda _t, y: y[0], -brake)))
    elif brake == 0 and side:
        found += [("brake", s, terminal(lambda _t, y, s=s: torque(side, y) + s * TAU_BRAKE, -s)) for s in (1, -1)]
    if load:
        found.append(("load", 0, terminal(lambda _t, y: y[1], -load)))
    elif side:
        found += [("load", s, terminal(lambda _t, y, s=s: torque(side, y) - s * TAU_LOAD, s)) for s in (1, -1)]
    return found


def crane(rtol: float, max_step: float = math.inf) -> tuple[list[Event], Any]:
    """Events and end state (speeds of J1 and J2, twist) after 10 s.

    Args:
        rtol: relative tolerance.
        max_step: largest step in s; events further apart than this are not stepped over.

    Raises:
        RuntimeError: no progress, after an event was lost.
    """
    options = {"method": "DOP853", "rtol": rtol, "atol": rtol * SCALE, "max_step": max_step}
    side, brake, load = 0, None, 0
    t, y, events = 0.0, np.zeros(3), []
    for stop in (T_BRAKE, T_END):
        while t < stop:
            ends = guards(side, brake, load)
            solved = solve_ivp(rates(side, brake, load), (t, stop), y, events=[end for *_, end in ends], **options)
            t, y = float(solved.t[-1]), solved.y[:, -1]
            if solved.status == 0:
                break
            part, to, _ = ends[next(k for k, times in enumerate(solved.t_events) if times.size)]
            if part == "gap":
                side = to
            elif part == "brake":
                y[0] = 0.0
                push = -torque(side, y)
                brake = to or (int(math.copysign(1, push)) if abs(push) > TAU_BRAKE else 0)
            else:
                y[1] = 0.0
                push = torque(side, y)
                load = to or (int(math.copysign(1, push)) if abs(push) > TAU_LOAD else 0)
            if len(events) == MOST_EVENTS:
                message = f"stuck at t = {t:g} s"
                raise RuntimeError(message)
            events.append((t, part, {"gap": side, "brake": brake, "load": load}[part]))
        if brake is None:
            brake = int(np.sign(y[0]))
            events.append((t, "brake", brake))
    return events, y


@dataclass(frozen=True)
class Point:
    """What one tolerance gave.

    Args:
        rtol: the tolerance asked for.
        events: how many were found.
        error: largest error of the end state over SCALE.
        cpu: CPU of one warm call in s, median.
    """

    rtol: float
    events: int
    error: float
    cpu: float


def truth() -> tuple[int, Any]:
    """Number of events and end state."""
    record = json.loads(TRUTH.read_text(encoding="ascii"))["coulomb"]
    return len(record["events"]), np.array(record["end"])


def point(rtol: float, max_step: float = math.inf, samples: int = 3) -> Point:
    """Error and CPU at one tolerance."""
    spent = []
    for _ in range(samples):
        start = time.process_time()
        events, end = crane(rtol, max_step)
        spent.append(time.process_time() - start)
    return Point(rtol, len(events), float(np.max(np.abs(end - truth()[1]) / SCALE)), statistics.median(spent))


def main() -> None:
    """Print the table, without and with a bound on the steps."""
    for max_step in (math.inf, 0.05, 0.02, 0.01):
        print(f"\nscipy DOP853, terminal events, steps up to {max_step:g} s; there are {truth()[0]} events")
        print("      rtol  events    error     CPU ms")
        for rtol in RTOLS:
            try:
                row = point(rtol, max_step)
            except RuntimeError as reason:
                print(f"  {rtol:8.0e}  {reason}")
            else:
                print(f"  {rtol:8.0e}  {row.events:6}  {row.error:7.0e}  {1e3 * row.cpu:9.1f}")


if __name__ == "__main__":
    main()
