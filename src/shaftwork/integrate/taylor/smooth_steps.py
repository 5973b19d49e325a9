"""A Taylor integrator that goes on from step to step for as long as nothing happens: no event, no jump, no pole.

A run that is stepped from outside hardly ever meets an event in a step. Such a step is a Taylor series or two, a few
microseconds; what a whole run looks at before and after would take a hundred times as long.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from shaftwork.integrate.problem import Array, Problem
from shaftwork.integrate.smooth_intervals import pieces
from shaftwork.integrate.taylor.heyoka_run import DEFECT, TaylorRun
from shaftwork.integrate.taylor.heyoka_switches import INSIDE, SOMEWHERE, WRONG_SIDE
from shaftwork.integrate.taylor.heyoka_taylor import tolerance

MOST = 100
"""Series in one step from outside: where more are needed the motion is stiff, and another engine may be quicker."""
LOOKS = np.array([0.9, *INSIDE])
"""Where in a series it is compared with the equations, and then where conditions are, as parts of its length."""


class Snapshot(NamedTuple):
    """All that tells how smooth steps go on.

    Args:
        t: time, s.
        x: (n,) state.
        parameters: (p,) all of the program: signs of conditions and sides of guards are among them.
        end: where they end at the latest, s.
        begins: whether the motion begins here, or with other parameters: then its first series is looked at.
        atol: (n,) absolute tolerances; those of guards that are integrated depend on where the motion began.
    """

    t: float
    x: Array
    parameters: Array
    end: float
    begins: bool
    atol: Array


class SmoothSteps:
    """Steps from a state on; where one fails, nothing has changed, and whoever asks makes it by another engine.

    Args:
        problem: the motion up to its next breakpoint.
        at: goes on from there, in equal equations; by default from the start of the problem.
    """

    def __init__(self, problem: Problem, at: Snapshot | None = None) -> None:
        self._program, self._tolerance = problem.program.program, tolerance(problem)
        with self._program.lent(self._tolerance) as lent:
            self._orders = np.arange(lent.integrator.order + 1.0)
        self.at = self._beginning(problem) if at is None else at

    @staticmethod
    def suit(problem: Problem) -> bool:
        """Whether there are such steps: heyoka knows the equations, and they have no pole that a series would miss."""
        return bool(problem.x0.size) and problem.program is not None and not problem.program.program.singular

    def _beginning(self, problem: Problem) -> Snapshot:
        piece = pieces(problem)[0]
        with self._program.lent(self._tolerance) as lent:
            TaylorRun(problem, lent).begin(piece)
            x, parameters = lent.integrator.state.copy(), lent.integrator.pars.copy()
            return Snapshot(piece.start, x, parameters, piece.end, begins=True, atol=problem.atol)

    def step(self, end: float) -> bool:
        """Go on to a time in s; False where something happens on the way, and nothing has been done."""
        begins = self.at.begins
        if end >= self.at.end:
            return False
        with self._program.lent(self._tolerance) as lent:
            integrator = lent.integrator
            self._load(integrator, self.at)
            for number in range(MOST):
                start = integrator.time
                outcome, length = integrator.step(end - start, write_tc=begins)
                if int(outcome) > -(2**32) or not length > 0.0:  # an event, or it stands still
                    return False
                if number == 0 and end - start > MOST * length:
                    return False
                if begins and not self._is_first_good(integrator, start):
                    return False
                begins = False
                if outcome.name == "time_limit":
                    break
            else:
                return False
            after = self.at._replace(t=end, x=integrator.state.copy(), begins=False)
        if not np.isfinite(after.x).all() or not self._is_clear(after):
            return False
        self.at = after
        return True

    def with_parameters(self, p: Array) -> bool:
        """Go on with other parameters (p,) of the model; False where that changes more than they, and nothing has."""
        program, at = self._program, self.at
        parameters, values = at.parameters.copy(), program.bind(p).parameters
        if program.held is not None:
            first = program.held.first
            values[first:] = at.parameters[first : program.parameter_count]
            program.held.start(at.t, at.t + SOMEWHERE * (at.end - at.t), at.x, values)
            if not np.array_equal(values[first:], at.parameters[first : program.parameter_count]):
                return False
        used = min(parameters.size, values.size)  # heyoka keeps none behind the last one that the rows contain
        parameters[:used] = values[:used]
        new = at._replace(parameters=parameters, begins=True)
        if not self._is_clear(new):
            return False
        if program.fading:
            with program.lent(self._tolerance) as lent:
                self._load(lent.integrator, new)
                program.weigh(lent.integrator)
                new = new._replace(parameters=lent.integrator.pars.copy())
        self.at = new
        return True

    @staticmethod
    def _load(integrator: Any, at: Snapshot) -> None:
        integrator.time, integrator.state[:], integrator.pars[:] = at.t, at.x, at.parameters
        if integrator.with_events:
            integrator.reset_cooldowns()

    def _is_first_good(self, integrator: Any, start: float) -> bool:
        """Whether the first series satisfies the equations, and no condition has changed on its way unseen.

        heyoka may take it for a polynomial that it is not; see `TaylorRun` and `keeps_sides`.
        """
        program, parameters = self._program, integrator.pars
        elapsed = LOOKS * (integrator.time - start)
        powers = elapsed ** self._orders[:, None]
        terms = integrator.tc
        states = terms @ powers
        state = np.ascontiguousarray(states[:, 0])
        change = terms @ (self._orders * powers[:, 0])
        defect = np.abs(elapsed[0] * program.slopes(start + elapsed[0], state, parameters) - change)
        if not (defect <= DEFECT * (np.abs(state) + np.abs(change)) + self.at.atol).all():
            return False
        if program.all_timed:
            return True
        repeated = np.repeat(self.at.parameters[:, None], elapsed.size, axis=1)
        values = program.switch_values(start + elapsed, states, repeated)
        signs = self.at.parameters[program.signs][:, None]
        return bool((signs * values >= -WRONG_SIDE * np.abs(values).max(axis=1)[:, None]).all())

    def _is_clear(self, at: Snapshot) -> bool:
        """Whether all guards are within their limits and all conditions on the sides that their signs say."""
        program, (t, x, parameters, *_) = self._program, at
        if program.guards:
            sides, offsets = parameters[program.sides], parameters[program.offsets]
            beyond = sides * program.guard_values(t, x, parameters) + offsets
            if not ((beyond < 0.0) | (sides == 0.0)).all():
                return False
        if program.all_timed:
            return True
        signs = parameters[program.signs] * program.switch_values(t, x, parameters)
        return bool(((signs > 0.0) | program.timed).all())
