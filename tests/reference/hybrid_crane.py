"""The crane with a gap and a brake, typed by hand: the reference for motions of many phases.

    J1 w1' = M(w1) - tau - brake,   J2 w2' = tau - load,   phi' = w1 - w2
    tau = max(0, c (phi - gap/2) + d phi') where phi > gap/2, mirrored where phi < -gap/2, else 0
    M = ratio eta 2 tau_k s s_k / (s^2 + s_k^2),  s = 1 - ratio w1 / (2 pi n_sync / 60),  until t_brake; 0 afterwards

From t_brake on a dry brake acts on J1: it slips against the motion or holds J1 exactly while the torque that this takes
is within its own. The load on J2 is of the same kind (``coulomb``), a constant torque (``constant``) or absent.
Source: Marinkovic 2012, section 3 and equations (12)-(16); tau_k and s_k are chosen.

Inside a phase the motion is a Taylor series, from recurrences typed for these equations, or the dense output of DOP853
in short steps. What ends a phase is the first sign change of a guard, found by bisection to the last bit. The series
take any arithmetic: hybrid_crane.json comes from mpmath's with 40 digits.

    python -m tests.reference.hybrid_crane          writes hybrid_crane.json anew
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from itertools import pairwise
from math import pi
from pathlib import Path
from typing import Any, Literal

import mpmath  # type: ignore[import-untyped]
from scipy.integrate import solve_ivp

STORE = Path(__file__).with_suffix(".json")
Load = Literal["none", "coulomb", "constant"]
LOADS: tuple[Load, ...] = ("none", "coulomb", "constant")
SAMPLES = 8
"""Of a guard in a step."""

Number = Any
"""A float or an mpmath number."""
Event = tuple[float, str, str, str]
"""Time in s, part, mode before, mode after."""
State = Sequence[Number]
"""Speeds of J1 and J2, rad/s, and the twist, rad."""
Flow = Callable[[Number], State]
"""The state at a time after the start of a step."""
Guard = Callable[[State], Number]
"""Positive once its mode cannot last."""

TOUCH = {1: "forward", 0: "open", -1: "backward"}
"""Which flank carries, by the sign of its torque."""
GRIP = {1: "slips forward", 0: "locked", -1: "slips backward", None: "released"}
"""What a dry contact does, by the sign of the speed."""


@dataclass(frozen=True)
class Crane:
    """Parameters in SI units; n_sync in 1/min, tau_k at the motor, everything else at the wheel's shaft."""

    load: Load = "none"
    J1: Number = 27.35
    J2: Number = 62.5
    gap: Number = 0.02
    c: Number = 24206.0
    d: Number = 14.0
    tau_k: Number = 9.6
    s_k: Number = 0.25
    n_sync: Number = 3000.0
    ratio: Number = 35.5
    efficiency: Number = 0.95
    t_brake: Number = 6.5
    tau_brake: Number = 323.8
    tau_w: Number = 22.4

    def exact(self) -> Crane:
        """The same with the decimal numbers above, not the floats next to them."""
        return replace(self, **{name: mpmath.mpf(str(v)) for name, v in asdict(self).items() if name != "load"})


@dataclass(frozen=True)
class Phase:
    """What every hybrid part does: signs as in TOUCH and GRIP."""

    gap: int
    brake: int | None
    load: int | None


Method = Callable[[Crane, Phase, State, Number], Flow]
"""From the start of a step and its length to the motion in it."""


@dataclass(frozen=True)
class Motion:
    """All events and the end state: speeds of J1 and J2 (rad/s), twist (rad)."""

    events: tuple[Event, ...]
    end: tuple[float, float, float]

    def of(self, *parts: str) -> tuple[Event, ...]:
        """The events of these parts."""
        return tuple(event for event in self.events if event[1] in parts)


def _contact(crane: Crane, side: int, state: State) -> Number:
    """The torque of the spring and damper behind one flank, as if it never let go."""
    w1, w2, phi = state
    return crane.c * (phi - side * crane.gap / 2) + crane.d * (w1 - w2)


def _drag(crane: Crane, phase: Phase) -> tuple[Number, Number]:
    """What brake and load take from J1 and J2 while they slip."""
    load = {"none": 0, "coulomb": crane.tau_w * (phase.load or 0), "constant": crane.tau_w}
    return crane.tau_brake * (phase.brake or 0), load[crane.load]


def taylor(crane: Crane, phase: Phase, start: State, step: Number) -> Flow:  # noqa: ARG001
    """A step as Taylor series about its start, in the arithmetic of the parameters."""
    exact = not isinstance(crane.c, float)
    order = 24 if exact else 14
    rows: list[list[Number]] = [[value] for value in start]
    w1, w2, phi = rows
    per_speed = crane.ratio * 30 / ((mpmath.pi if exact else pi) * crane.n_sync)
    strength = 2 * crane.ratio * crane.efficiency * crane.tau_k * crane.s_k
    slip: list[Number] = []
    square: list[Number] = []
    curve: list[Number] = []
    drag_1, drag_2 = _drag(crane, phase)
    contact = phase.gap * crane.c * crane.gap / 2
    for k in range(order):  # what is locked has speed 0, and so are its coefficients
        tau = (crane.c * phi[k] + crane.d * (w1[k] - w2[k]) if phase.gap else 0) - contact
        drive = 0
        if phase.brake is None:
            slip.append((0 if k else 1) - per_speed * w1[k])
            square.append(sum(slip[j] * slip[k - j] for j in range(k + 1)) + (0 if k else crane.s_k * crane.s_k))
            curve.append((slip[k] - sum(square[j] * curve[k - j] for j in range(1, k + 1))) / square[0])
            drive = strength * curve[k]
        w1.append(w1[k] if phase.brake == 0 else (drive - tau - drag_1) / crane.J1 / (k + 1))
        w2.append(w2[k] if phase.load == 0 else (tau - drag_2) / crane.J2 / (k + 1))
        phi.append((w1[k] - w2[k]) / (k + 1))
        drag_1 = drag_2 = contact = 0

    def flow(h: Number) -> State:
        values = [row[-1] for row in rows]
        for k in range(order - 1, -1, -1):
            values = [value * h + row[k] for value, row in zip(values, rows, strict=True)]
        return values

    return flow


def runge_kutta(crane: Crane, phase: Phase, start: State, step: Number) -> Flow:
    """A step by DOP853 at its tightest tolerance."""
    drag_1, drag_2 = _drag(crane, phase)

    def rates(_time: float, y: State) -> State:
        w1, w2, _ = y
        tau = _contact(crane, phase.gap, y) if phase.gap else 0.0
        s = 1.0 - w1 * crane.ratio / (2.0 * pi * crane.n_sync / 60.0)
        kloss = 2.0 * crane.tau_k / (s / crane.s_k + crane.s_k / s) if s and phase.brake is None else 0.0
        return [
            0.0 if phase.brake == 0 else (crane.ratio * crane.efficiency * kloss - tau - drag_1) / crane.J1,
            0.0 if phase.load == 0 else (tau - drag_2) / crane.J2,
            w1 - w2,
        ]

    solved = solve_ivp(rates, (0.0, step), start, method="DOP853", rtol=2.3e-14, atol=1e-16, dense_output=True)
    end = solved.y[:, -1].tolist()
    return lambda h: end if h == step else solved.sol(h).tolist()


def _guards(crane: Crane, phase: Phase) -> Iterator[tuple[str, int, Guard]]:
    """Part, the sign that it is about to take, guard."""

    def carried(state: State) -> Number:
        return _contact(crane, phase.gap, state) if phase.gap else 0

    if phase.gap:
        yield "gap", 0, lambda state: -phase.gap * carried(state)
    else:
        for side in (1, -1):
            yield (
                "gap",
                side,
                lambda state, side=side: min(side * state[2] - crane.gap / 2, side * _contact(crane, side, state)),
            )
    for part, grip, row, sign, limit in (
        ("brake", phase.brake, 0, -1, crane.tau_brake),  # tau holds J1 back and drives J2
        ("load", phase.load, 1, 1, crane.tau_w),
    ):
        if grip == 0:
            yield part, 1, lambda state, sign=sign, limit=limit: sign * carried(state) - limit
            yield part, -1, lambda state, sign=sign, limit=limit: -sign * carried(state) - limit
        elif grip is not None:
            yield part, 0, lambda state, grip=grip, row=row: -grip * state[row]


def _crossing(guard: Guard, flow: Flow, h: Number) -> Number | None:
    """The first time at which a guard is positive: it swings far slower than the samples follow each other."""
    for low, high in pairwise(h * k / SAMPLES for k in range(SAMPLES + 1)):
        if guard(flow(high)) > 0:
            return _root(guard, flow, low, high)
    return None


def _root(guard: Guard, flow: Flow, low: Number, high: Number) -> Number:
    while low < (middle := (low + high) / 2) < high:
        low, high = (low, middle) if guard(flow(middle)) > 0 else (middle, high)
    return high


def _settled(crane: Crane, phase: Phase, state: State, part: str, to: int) -> Phase:
    """The phase after one part's guard has been met: a dry contact at standstill holds what it can."""
    if part == "gap":
        return replace(phase, gap=to)
    if to != 0:
        return replace(phase, **{part: to})
    tau = _contact(crane, phase.gap, state) if phase.gap else 0
    push, limit = (-tau, crane.tau_brake) if part == "brake" else (tau, crane.tau_w)
    return replace(phase, **{part: 0 if abs(push) <= limit else (1 if push > 0 else -1)})


def _event(t: Number, part: str, before: Phase, after: Phase) -> Event:
    words: dict[Any, str] = TOUCH if part == "gap" else GRIP
    return float(t), part, words[getattr(before, part)], words[getattr(after, part)]


def motion(crane: Crane, t_end: Number = 10.0, step: Number = 2e-3, method: Method = taylor) -> Motion:
    """The motion from rest in the middle of the gap.

    Args:
        crane: as floats, or `Crane.exact()`.
        t_end: end time in s.
        step: largest step in s; a period is 0.16 s.
        method: `taylor` or `runge_kutta`, which knows floats alone.
    """
    number = type(crane.c)
    t, state = number(0), [number(0)] * 3
    phase = Phase(0, None, 0 if crane.load == "coulomb" else None)
    events: list[Event] = []

    def change(part: str, to: int) -> Phase:
        after = _settled(crane, phase, state, part, to)
        events.append(_event(t, part, phase, after))
        return after

    for stop in (min(t_end, crane.t_brake), t_end):
        while t < stop:
            h = min(step, stop - t)
            flow = method(crane, phase, state, h)
            guards = tuple(_guards(crane, phase))
            hits = [(time, k) for k, (_, _, g) in enumerate(guards) if (time := _crossing(g, flow, h)) is not None]
            if not hits:
                state, t = list(flow(h)), stop if h == stop - t else t + h
                continue
            time, k = min(hits)
            state, t = list(flow(time)), t + time
            part, to, _ = guards[k]
            if part != "gap":
                state[("brake", "load").index(part)] = number(0)  # it stands, to the last bit
            phase = change(part, to)
        if t == crane.t_brake < t_end:
            phase = change("brake", 1 if state[0] > 0 else -1)
    return Motion(tuple(events), tuple(map(float, state)))  # type: ignore[arg-type]


@cache
def stored(load: str = "none") -> Motion:
    """The motion over 10 s with 40 digits, from hybrid_crane.json."""
    record = json.loads(STORE.read_text(encoding="ascii"))[load]
    return Motion(tuple(tuple(event) for event in record["events"]), tuple(record["end"]))


def main() -> None:
    """Compute the stored motions with 40 digits."""
    record = {}
    for load in LOADS:
        with mpmath.workdps(40):
            exact = motion(Crane(load).exact(), mpmath.mpf(10), mpmath.mpf(2) / 1000)
        record[load] = {"end": exact.end, "events": exact.events}
    STORE.write_text(json.dumps(record, indent=1) + "\n", encoding="ascii")


if __name__ == "__main__":
    main()
