"""Conditions in a Taylor run: the sign of each switch is held over a step and checked at its end."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from shaftwork.integrate.problem import Array
from shaftwork.numerics.tolerances import EPS, GOLDEN
from shaftwork.numerics.zeros import LOOKS

# A switch that is on the wrong side by more than this part of its largest value has missed its event.
WRONG_SIDE = 1e-9
# How far rounding may have moved time and states, as a part of them.
ROUNDINGS = 256 * EPS

# Where in a piece switches of the time are read: a law that touches its threshold does so in the middle, if anywhere.
SOMEWHERE = 1.0 - GOLDEN
# Where in a step the sides of the switches are looked at, its end included.
INSIDE = np.append(LOOKS[1:-1], 1.0)


def settle(program: Any, integrator: Any, horizon: float) -> None:
    """Set the signs of all switches for the motion that starts at the integrator's time and state.

    A switch of the time alone has the sign that it has inside the piece. Any other at exactly zero (a table's kink, a
    spring without twist) takes the sign that it has early in a trial step; it stays at zero when it rests there.

    Args:
        program: a `codegen.taylor.heyoka.HeyokaProgram`.
        integrator: its integrator; time and state are left as they were.
        horizon: length of the piece, or of the rest of it, in s.
    """
    parameters, signs = integrator.pars[: program.parameter_count], integrator.pars[program.signs]
    timed = signs * program.timed
    if program.timed.any():
        timed = program.switch_signs(integrator.time + SOMEWHERE * horizon, integrator.state, parameters, timed)
    if program.all_timed:
        signs[:] = timed
        return
    signs[:] = program.switch_signs(integrator.time, integrator.state, parameters, timed * program.timed)
    if (near := _within_rounding(program, integrator) & ~program.timed).any():
        before = signs.copy()
        signs[near] = 0.0
        early = _early_signs(program, integrator, horizon)
        signs[:] = np.where(near & (early != 0.0), early, before)
        _enter(program, integrator, signs)
    for _ in range(signs.size):
        zero = (signs == 0.0) & ~program.timed
        if not zero.any():
            return
        settled = np.where(zero, _early_signs(program, integrator, horizon), signs)
        if np.array_equal(settled, signs):
            return
        signs[:] = settled
        _enter(program, integrator, signs)


def _enter(program: Any, integrator: Any, signs: Array) -> None:
    """Let held functions step where the motion starts at the end of a whole number and leaves it."""
    if program.held is not None:
        for number in program.held.by_switch:
            if signs[number] < 0:
                program.step(number, integrator)


def _within_rounding(program: Any, integrator: Any) -> NDArray[np.bool_]:
    """The switches whose side rounding decides: those at which another event has just ended a run."""
    time, state, parameters = integrator.time, integrator.state, integrator.pars
    values = program.switch_values(time, state, parameters)
    moved = state * (1.0 + ROUNDINGS * np.where(np.arange(state.size) % 2, 1.0, -1.0))
    others = program.switch_values(time + ROUNDINGS * abs(time), moved, parameters)
    with np.errstate(invalid="ignore"):  # one that is infinite is not near zero
        return np.asarray((values != 0.0) & (np.abs(values) <= np.abs(others - values)))


def _early_signs(program: Any, integrator: Any, horizon: float) -> Array:
    """Signs of the switches as early in a trial step as they show."""
    start, state, parameters = integrator.time, integrator.state.copy(), integrator.pars.copy()
    integrator.step(max_delta_t=horizon, write_tc=True)
    step = integrator.time - start
    signs = np.zeros(len(program.switches))
    times = start + np.outer((1e-4, 1e-2, 1e-1), (0.5, 1.0)).ravel() * step  # as early as it is not lost in rounding
    sides = np.sign(_in_step(program, integrator, times, parameters))
    for first, second in zip(sides.T[::2], sides.T[1::2], strict=True):
        signs = np.where((signs == 0.0) & (first == second), second, signs)  # rounding would have no steady sign
    integrator.time = start
    integrator.state[:] = state
    integrator.pars[:] = parameters
    integrator.reset_cooldowns()
    return np.asarray(signs)


def _in_step(program: Any, integrator: Any, times: Array, parameters: Array) -> Array:
    """Values of the switches (switches, k) at times (k,) in s within the last step."""
    states = [integrator.update_d_output(time).copy() for time in times.tolist()]
    columns = np.empty((parameters.size, times.size))
    columns[:] = parameters[:, None]
    return np.asarray(program.switch_values(times, np.ascontiguousarray(np.transpose(states)), columns))


def keeps_sides(program: Any, integrator: Any, parameters: Array, start: float) -> bool:
    """Whether every switch stays on its side up to the end of the last step, which an event would have ended.

    heyoka looks for events in the series of the switches. Where that shows nothing in its last two terms, as that of
    sin(t^2) does, the step is too long for it. Nor does it find any in a series that starts with a double zero, as that
    of an angle from rest does.

    Args:
        program: a `codegen.taylor.heyoka.HeyokaProgram`.
        integrator: its integrator after a step with its Taylor coefficients kept.
        parameters: all parameters before the step, the signs included.
        start: of the step, s.
    """
    signs = parameters[program.signs]
    values = _in_step(program, integrator, start + INSIDE * (integrator.time - start), parameters)
    return bool((signs[:, None] * values >= -WRONG_SIDE * np.abs(values).max(axis=1)[:, None]).all())


class SwitchWatch:
    """Step callback of a run with switches: stops it when a switch is not on the side that its sign says.

    Args:
        program: a `codegen.taylor.heyoka.HeyokaProgram`.
        start: where the run starts, s.
        duration: length of the whole run in s.
        size: (switches,) of the switches at the start.
    """

    def __init__(self, program: Any, start: float, duration: float, size: Array) -> None:
        self._program = program
        self._short = 1e-9 * duration
        """Many shorter steps in a row are chatter and not motion."""
        self._short_steps = 0
        self._last = start
        self.last_good: tuple[float, Array] | None = None
        """Time in s and state (n,) at the start of the step that stopped the run or failed."""
        self._largest: Array = size
        self._signs = program.signs
        self._moving: NDArray[np.bool_] = ~program.timed
        counting = () if program.held is None else tuple(program.held.by_switch)
        self._turns = self._moving & ~np.isin(np.arange(size.size), counting)
        self._cooled = np.full(size.size, -np.inf)
        self.reason: str | None = None
        self.driven_back = False
        """Whether what has stopped the run would stop any."""
        self.leaves = False
        """Whether a switch that rested at zero has stopped the run."""

    def __call__(self, integrator: Any) -> bool:
        now, state, parameters = integrator.time, integrator.state, integrator.pars
        values, signs = self._program.switch_values(now, state, parameters), parameters[self._signs]
        np.maximum(self._largest, np.abs(values), out=self._largest)
        inside = signs * values
        # What switches by the time alone has its sign for the piece, and nothing can drive it back.
        if ((inside > WRONG_SIDE * self._largest) | self._program.timed).all():
            self.leaves = False
            if now - self._last < self._short:
                return self._goes_on(integrator, values)
            self._last, self._short_steps, self.last_good = now, 0, (now, state.copy())
            return True
        if np.isnan(values).any():
            condition = self._program.conditions[int(np.argmax(np.isnan(values)))]
            self.reason = f"the condition {condition} is neither true nor false"
            self.last_good = now, state.copy()
            return False
        return self._looked_at(integrator, values, signs, inside)

    def _looked_at(self, integrator: Any, values: Array, signs: Array, inside: Array) -> bool:
        """Whether the run goes on where a switch is at zero, or on the wrong side of it."""
        wrong = (inside < -WRONG_SIDE * self._largest) & self._moving
        past = inside < 0.0
        cooling = integrator.te_cooldowns[: past.size]
        cooled: list[int] = np.flatnonzero(self._cooled > self._last).tolist()
        for number, cooldown in enumerate(cooling):
            if cooldown is not None:
                passed, whole = cooldown
                self._cooled[number] = integrator.time - passed + whole
        if past.any():
            # Right at its event (heyoka still "cools" it down) a switch may be on the wrong side by rounding. It comes
            # over then. One that rounding made turn, as a speed to which a motion has hardly come yet, may cool for
            # long, and go on to the side on which it is without an event.
            away = [
                cooldown is None or (bool(past[number]) and self._goes_away(integrator, number))
                for number, cooldown in enumerate(cooling)
            ]
            for number, cooldown in enumerate(cooling):
                if cooldown is not None:
                    wrong[number] = wrong[number] and away[number] and self._moved(integrator, number)
            past &= away
            # In a step too short for heyoka to see an event a switch is past it by that step, and has just turned too.
            wrong &= past & (integrator.time - self._last >= self._short)
            # A speed that dies away turns while heyoka still cools its last turn down: wrong only where it matters.
            for number in cooled:
                wrong[number] = wrong[number] and self._matters(integrator, number)
            signs[past & ~wrong & self._turns] *= -1.0  # the step ended at another event, at the very same instant
        # A switch that rested at zero and now leaves it needs its sign, and it may do so where another one turns.
        resting = (signs == 0.0) & self._moving
        self.leaves = bool(resting.any()) and (bool(values[resting].any()) or self._ended_at_a_switch(integrator))
        # Where a switch turns a guard may be met too, and heyoka would not see it any more.
        return self._goes_on(integrator, values, wrong) and not (
            self.leaves or (self._program.guards and self._ended_at_a_switch(integrator))
        )

    def _goes_on(self, integrator: Any, values: Array, wrong: NDArray[np.bool_] | None = None) -> bool:
        """Whether time goes on and no switch is on the wrong side."""
        before, now = self._last, integrator.time
        self._short_steps = self._short_steps + 1 if now - before < self._short else 0
        self._last = now
        stuck = None
        if wrong is not None and wrong.any():
            stuck = np.argmax(wrong)
        elif self._short_steps > 200:
            stuck = np.argmin(np.where(self._moving, np.abs(values), np.inf))
        if stuck is not None:
            self.driven_back = self._drives_back(integrator, int(stuck))
            condition = self._program.conditions[int(stuck)]
            self.reason = (
                f"from t = {before:.9g} s on the motion sticks where the condition {condition} changes, because "
                "the laws on both sides drive it back there. Give the law a smooth transition, such as "
                "tanh(omega / 0.01) in place of sign(omega)"
            )
            return False
        self.last_good = now, integrator.state.copy()
        return True

    def _moved(self, integrator: Any, number: int) -> bool:
        """Whether the last step would have ended elsewhere, by more than rounding, on the other side of a switch."""
        here, there = self._both_sides(integrator, number)
        moved = np.abs(here - there).max() * (integrator.time - self._last)
        return bool(moved > EPS * np.abs(integrator.state).max())

    def _both_sides(self, integrator: Any, number: int) -> tuple[Array, Array]:
        """(n,) slopes with the sign of a switch and with the other one."""
        other = integrator.pars.copy()
        other[self._signs.start + number] *= -1.0
        slopes, at = self._program.slopes, (integrator.time, integrator.state)
        return slopes(*at, integrator.pars), slopes(*at, other)

    def _goes_away(self, integrator: Any, number: int) -> bool:
        """Whether a switch goes on to the side of zero on which it is."""
        time, state, pars = integrator.time, integrator.state, integrator.pars
        later = state + self._short * self._program.slopes(time, state, pars)
        here = self._program.switch_values(time, state, pars)[number]
        there = self._program.switch_values(time + self._short, later, pars)[number]
        return bool(here * (there - here) > 0.0)

    def _matters(self, integrator: Any, number: int) -> bool:
        """Whether the motion is another one on the other side of a switch."""
        here, there = self._both_sides(integrator, number)
        return not np.allclose(here, there, rtol=WRONG_SIDE, atol=0.0)

    def _drives_back(self, integrator: Any, number: int) -> bool:
        """Whether the motion on either side of a switch comes back to it: neither as a touch, nor along it."""
        time, state, program = integrator.time, integrator.state, self._program
        speeds = []
        for side in (1.0, -1.0):
            pars = integrator.pars.copy()
            pars[self._signs.start + number] = side
            later = state + self._short * program.slopes(time, state, pars)
            here = program.switch_values(time, state, pars)[number]
            there = program.switch_values(time + self._short, later, pars)[number]
            speeds.append(side * (there - here))
        # What comes back on one side more slowly than at 1e-3 of the speed on the other may be a touch.
        return bool(max(speeds) < -1e-3 * max(map(abs, speeds)) < 0.0)

    def _ended_at_a_switch(self, integrator: Any) -> bool:
        """Whether the last step ended where a switch passed through zero."""
        cooldowns = integrator.te_cooldowns[: len(self._program.switches)]
        return any(cooldown is not None and cooldown[0] == 0.0 for cooldown in cooldowns)
