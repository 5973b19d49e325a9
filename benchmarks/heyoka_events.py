"""The crane with gap and brake by hand in heyoka: what the integrator alone costs in the events of phases.py.

One Taylor integrator, compiled once. The modes are numbers among its parameters, and the callback of each terminal
event writes those that follow. Nothing is checked, and nothing is kept but the end state. Equations: scipy_events.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import heyoka as hy
import numpy as np

from benchmarks import scipy_events as rival

DRIVES, SIDE, BRAKE, LOAD, FIRST = range(5)
"""Parameters: whether the motor drives, which flank carries, the signs of the two frictions; from FIRST on the sign
with which each event is met, zero where it is not."""
UPPER, LOWER, PARTS, STOPS_1, SLIPS_1, STOPS_2, SLIPS_2 = range(7)
"""Events: a flank touches, the flanks part; of J1 and J2 each: it stops, and its friction gives way."""
OFFSET = 1e-14
"""So far beyond zero an event is met, or it would end the phase that it begins."""


class BareCrane:
    """The crane, to be run again and again.

    Args:
        tolerance: of heyoka, a part of the largest state.
    """

    def __init__(self, tolerance: float = 1e-12) -> None:
        (w1, w2, phi), par = hy.make_vars("w1", "w2", "phi"), hy.par
        slip = 1.0 - rival.PER_SPEED * w1
        motor = par[DRIVES] * rival.STRENGTH * slip / (slip * slip + rival.S_K**2)
        flank = rival.C * (phi - par[SIDE] * rival.HALF_GAP) + rival.D * (w1 - w2)
        tau = par[SIDE] * par[SIDE] * flank
        turns_1, turns_2 = par[BRAKE] * par[BRAKE] + par[DRIVES], par[LOAD] * par[LOAD]
        rates = [
            (w1, turns_1 * (motor - tau - rival.TAU_BRAKE * par[BRAKE]) / rival.J1),
            (w2, turns_2 * (tau - rival.TAU_LOAD * par[LOAD]) / rival.J2),
            (phi, w1 - w2),
        ]
        slips = [tau * tau / most**2 - 1.0 for most in (rival.TAU_BRAKE, rival.TAU_LOAD)]
        values = phi - rival.HALF_GAP, phi + rival.HALF_GAP, tau / rival.TAU_LOAD, w1, slips[0], w2, slips[1]
        events = [
            hy.t_event(
                hy.select(par[FIRST + k], par[FIRST + k] * value - OFFSET, hy.expression(-1.0)),
                direction=hy.event_direction.positive,
                callback=self._callback(k),
                cooldown=1e-9,
            )
            for k, value in enumerate(values)
        ]
        self._integrator = hy.taylor_adaptive(rates, [0.0] * 3, tol=tolerance, t_events=events)
        self._modes, self._count = [0.0] * FIRST, 0

    def __call__(self, _: float = 0.0) -> tuple[int, np.ndarray]:
        """Number of events and end state."""
        integrator = self._integrator
        integrator.time, integrator.state[:] = 0.0, 0.0
        integrator.reset_cooldowns()
        self._modes, self._count = [1.0, 0.0, 0.0, 0.0], 0
        self._enter(integrator)
        integrator.propagate_until(rival.T_BRAKE)
        self._modes[DRIVES], self._modes[BRAKE] = 0.0, math.copysign(1.0, integrator.state[0])
        self._count += 1
        self._enter(integrator)
        integrator.propagate_until(rival.T_END)
        return self._count, integrator.state.copy()

    def _callback(self, event: int) -> Callable[[Any, int], bool]:
        def met(integrator: Any, _direction: int) -> bool:
            self._count += 1
            self._follow(event, integrator.state)
            self._enter(integrator)
            return True

        return met

    def _follow(self, event: int, state: np.ndarray) -> None:
        """The modes after an event."""
        modes, side = self._modes, self._modes[SIDE]
        if event in (UPPER, LOWER, PARTS):
            modes[SIDE] = {UPPER: 1.0, LOWER: -1.0, PARTS: 0.0}[event]
            return
        if event in (STOPS_1, STOPS_2):
            state[0 if event == STOPS_1 else 1] = 0.0
        w1, w2, phi = state.tolist()
        tau = (rival.C * (phi - side * rival.HALF_GAP) + rival.D * (w1 - w2)) if side else 0.0
        if event in (STOPS_1, SLIPS_1):
            modes[BRAKE] = -math.copysign(1.0, tau) if event == SLIPS_1 or abs(tau) > rival.TAU_BRAKE else 0.0
        else:
            modes[LOAD] = math.copysign(1.0, tau) if event == SLIPS_2 or abs(tau) > rival.TAU_LOAD else 0.0

    def _enter(self, integrator: Any) -> None:
        """Write the modes, and which events they can meet."""
        drives, side, brake, load = self._modes
        touches = abs(side)
        sticks_1, sticks_2 = touches * (1.0 - abs(brake) - drives), touches * (1.0 - abs(load))
        integrator.pars[:] = [*self._modes, 1.0 - touches, touches - 1.0, -side, -brake, sticks_1, -load, sticks_2]
