"""Conditions in a Taylor run: the sign of each switch is held over a step and checked at its end."""

from __future__ import annotations

from typing import Any

import numpy as np

from shaftwork.integrate.problem import Array

# So many steps in a row, each shorter than this part of the whole time, are chatter and not motion.
CHATTER_STEPS, CHATTER_SPAN = 200, 1e-9
# A switch that is on the wrong side by more than this part of its largest value has missed its event.
WRONG_SIDE = 1e-9
# Where in a trial step a switch that starts at zero is looked at: early, but not lost in rounding.
EARLY = 0.1


def settle(program: Any, integrator: Any, horizon: float) -> None:
    """Set the signs of all switches for the motion that starts at the integrator's time and state.

    A switch at exactly zero (a table's kink at its own time, a spring without twist) takes the sign that it has
    early in a trial step; it stays at zero when it rests there.

    Args:
        program: a `codegen.heyoka.HeyokaProgram`.
        integrator: its integrator; time and state are left as they were.
        horizon: longest trial step in s.
    """
    signs = integrator.pars[program.parameter_count :]
    parameters = integrator.pars[: program.parameter_count]
    signs[:] = program.switch_signs(integrator.time, integrator.state, parameters)
    for _ in range(signs.size):
        zero = signs == 0.0
        if not zero.any():
            return
        found = np.where(zero, _early_signs(program, integrator, horizon), signs)
        if np.array_equal(found, signs):
            return
        signs[:] = found


def _early_signs(program: Any, integrator: Any, horizon: float) -> Array:
    start, state, parameters = integrator.time, integrator.state.copy(), integrator.pars.copy()
    integrator.step(max_delta_t=horizon, write_tc=True)
    early = start + EARLY * (integrator.time - start)
    values = program.switch_values(early, np.array(integrator.update_d_output(early)), parameters)
    integrator.time = start
    integrator.state[:] = state
    integrator.pars[:] = parameters
    integrator.reset_cooldowns()
    return np.asarray(np.sign(values))


class Watch:
    """Step callback of a run with switches: stops it when a switch is not on the side that its sign says.

    Args:
        program: a `codegen.heyoka.HeyokaProgram`.
        start: where the run starts, s.
        duration: length of the whole run in s.
    """

    def __init__(self, program: Any, start: float, duration: float) -> None:
        self._program = program
        self._short = CHATTER_SPAN * duration
        self._short_steps = 0
        self._last = start
        self.last_good: tuple[float, Array] | None = None
        """Time in s and state (n,) at the start of the step that stopped the run or failed."""
        self._largest: Array = np.zeros(len(program.switches))
        self.reason: str | None = None

    def __call__(self, integrator: Any) -> bool:
        values = self._program.switch_values(integrator.time, integrator.state, integrator.pars)
        signs = integrator.pars[self._program.parameter_count :]
        np.maximum(self._largest, np.abs(values), out=self._largest)
        wrong = signs * values < -WRONG_SIDE * self._largest
        if wrong.any():
            # Right at its event (heyoka still "cools" it down) a switch may be on the wrong side by rounding.
            wrong &= [cooling is None for cooling in integrator.te_cooldowns]
        self._short_steps = self._short_steps + 1 if integrator.time - self._last < self._short else 0
        before, self._last = self._last, integrator.time
        if wrong.any() or self._short_steps > CHATTER_STEPS:
            suspects = wrong if wrong.any() else np.abs(values) <= np.abs(values).min()
            condition = self._program.conditions[int(np.flatnonzero(suspects)[0])]
            self.reason = (
                f"from t = {before:.9g} s on the motion sticks where the condition {condition} changes, because "
                "the laws on both sides drive it back there. Give the law a smooth transition, such as "
                "tanh(omega / 0.01) in place of sign(omega)"
            )
            return False
        self.last_good = integrator.time, integrator.state.copy()
        # A switch that rested at zero and now leaves it needs its sign.
        return not bool((values[signs == 0.0] != 0.0).any())
