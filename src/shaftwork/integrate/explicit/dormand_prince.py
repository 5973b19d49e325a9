"""The engine in machine code for any platform: Dormand and Prince's method of order 8(5,3), compiled by numba.

It makes many steps in one call, past the switches of laws, up to the first that may meet a guard. Between the ends of
its steps it makes them again where somebody asks.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from shaftwork.core.errors import ParameterError, SimulationError
from shaftwork.integrate.crossings import RESTING, uneven
from shaftwork.integrate.explicit.dormand_prince_loops import COURSE, advance, between, values_at
from shaftwork.integrate.explicit.explicit_runs import MarchedRun, least_rates, stable
from shaftwork.integrate.problem import Array, MachineRates, Problem, Trajectory, changed
from shaftwork.integrate.smooth_intervals import GuardedFunctions, SmoothInterval, failure, pieces
from shaftwork.integrate.stepping import Step, march, with_outputs
from shaftwork.integrate.stiffness import bound_of_decay, jacobians
from shaftwork.numerics.tolerances import CLEARANCE

MOST_AHEAD = 512
"""Steps in one call."""
MOST_SMOOTH = 256
"""Steps in one from outside: where more are needed the motion is stiff."""


def solve(problem: Problem) -> Trajectory:
    """Integrate a system whose right-hand side is machine code.

    Raises:
        ParameterError: it is none.
        SimulationError: the step became too small, a value was not finite, or `max_steps` were not enough.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 1993, section II.10.
    """
    machine = problem.machine
    if machine is None:
        raise ParameterError(
            "The engine 'numba' needs equations line by line, without smooth noise, functions of your own and waves; "
            "these are not. Take engine='auto'."
        )

    def run(problem: Problem, longest: float) -> MarchedRun:
        stepper = _MachineStepper(problem, machine, longest)
        whole = march(changed(problem, switches=None), stepper)
        counts = {"rejected": stepper.tried - (whole.steps.size - 1)}
        return MarchedRun(whole, stepper.dense(whole.steps), counts)

    problem = _watching(problem, machine)
    whole = stable(problem, run)
    return with_outputs(problem, whole.march, whole.dense, whole.counts)


def _watching(problem: Problem, machine: MachineRates) -> Problem:
    """The same problem, with guards and rates of many states in machine code."""
    if problem.guards is None:
        return problem

    def of_many(code: Any, count: int, times: Array, states: Array) -> Array:
        values = np.empty((times.size, count))
        values_at(code.address, machine.p, times, np.ascontiguousarray(states), values)
        return values

    guards = partial(of_many, machine.watched, machine.guards + machine.switches)
    rates = partial(of_many, machine.rates, problem.x0.size)
    return changed(
        problem, rates=rates, guards=replace(problem.guards, values=lambda t, x: guards(t, x)[:, : machine.guards])
    )


class _Taken(NamedTuple):
    """Steps as dense output makes them again.

    Args:
        spans: (s, 2) of each step the earliest and latest time in s at which the system is evaluated.
        starts: (s,) of the steps, s.
        lengths: (s,) of the steps, s.
        states: (s, n) at their starts.
    """

    spans: Array
    starts: Array
    lengths: Array
    states: Array


class _MachineDense:
    """The motion at any time, from steps that are made again.

    Args:
        machine: the system.
        steps: (s + 1,) ends of the steps in s, the start first.
        taken: the steps.
    """

    def __init__(self, machine: MachineRates, steps: Array, taken: _Taken) -> None:
        self._machine, self.steps, self._taken = machine, steps, taken

    def __call__(self, times: Array) -> Array:
        times = np.atleast_1d(np.asarray(times, dtype=float))
        order = times.argsort(kind="stable")
        taken, numbers = self._taken, self.steps[1:-1].searchsorted(times[order], side="right")
        values = np.empty((times.size, taken.states.shape[1]))
        between(_system(self._machine, 0.0, 0.0), *taken, numbers, times[order], values)
        states = np.empty_like(values)
        states[order] = values
        return states


class MachineSnapshot(NamedTuple):
    """All that tells how smooth steps go on.

    Args:
        t: time, s.
        x: (n,) state.
        piece: in which they go on.
        length: of the next step, s.
        longest: a step at most, s: far from the edge of stability, so that strong dampers have right torques.
        offsets: of the guards, if there are any.
        atol: (n,) absolute tolerances; those of guards that are integrated depend on where the motion began.
        sizes: (n,) of the rates, the largest so far.
    """

    t: float
    x: Array
    piece: SmoothInterval
    length: float
    longest: float
    offsets: Array | None
    atol: Array
    sizes: Array


class MachineSteps:
    """Steps from a state on while nothing happens; where one fails, nothing has changed.

    Args:
        problem: the motion up to its next breakpoint.
        machine: its right-hand side.
        at: goes on from there, in equal equations; by default from the start of the problem.
    """

    def __init__(self, problem: Problem, machine: MachineRates, at: MachineSnapshot | None = None) -> None:
        guards = problem.guards
        if at is None:
            bound = bound_of_decay(jacobians(problem))
            offsets = None if guards is None else guards.offsets
            longest = 1 / bound if bound > 0 else np.inf
            piece, sizes = pieces(problem)[0], least_rates(problem)
            at = MachineSnapshot(problem.t0, problem.x0, piece, 0.0, longest, offsets, problem.atol, sizes)
        elif guards is not None:
            problem = changed(problem, atol=at.atol, guards=replace(guards, offsets=np.asarray(at.offsets)))
        self._problem, self._machine, self.at = _watching(problem, machine), machine, at

    def step(self, end: float) -> bool:
        """Go on to a time in s; False where something happens on the way, and nothing has been done."""
        at = self.at
        if end >= at.piece.end or end - at.t > MOST_SMOOTH * at.longest:
            return False
        stepper = _MachineStepper(self._problem, self._machine, at.longest)
        stepper.resume(at, end)
        try:
            step = stepper.step(at.t, at.x)
        except SimulationError:
            return False
        if not step.clear or step.end < end:
            return False
        self.at = at._replace(t=end, x=step.state, length=stepper.length, sizes=stepper.sizes)
        return True

    def with_parameters(self, p: Array) -> bool:
        """Go on in the same equations with other parameters (p,) of the model."""
        self._machine = self._machine._replace(p=self._machine.values(p))
        self._problem = _watching(self._problem, self._machine)
        return True


def _system(machine: MachineRates, low: float, high: float) -> tuple[int, int, int, float, float, Array]:
    """A system as `dormand_prince_loops` takes it, with the earliest and latest time in s at which it is evaluated."""
    return machine.rates.address, machine.watched.address, machine.guards, low, high, machine.p


class _MachineStepper:
    """The method.

    Args:
        problem: what is being solved.
        machine: its right-hand side.
        longest: a step at most, s.
    """

    engine = "numba"
    cuts_off = False

    def __init__(self, problem: Problem, machine: MachineRates, longest: float) -> None:
        self._problem, self._machine, self._longest = problem, machine, longest
        self._taken, self.tried, self._steps = list[_Taken](), 0, 0
        self._clearance = CLEARANCE * float(np.spacing(max(abs(problem.t0), abs(problem.t_end))))
        self._uneven, guards, count = uneven(problem.x0.size), problem.guards, machine.guards
        self.sizes = least_rates(problem)
        self._course = np.zeros((COURSE, count + machine.switches))
        sides, offsets, _ = self._course[-3:]
        if guards is not None:
            sides[:count], offsets[:count] = -guards.sides, guards.offsets
        watched = sides != 0
        watched[count:] = problem.switches is not None
        self._places = np.flatnonzero(watched)

    def dense(self, steps: Array) -> _MachineDense:
        """The motion between the ends (s + 1,) of the steps that were taken."""
        return _MachineDense(self._machine, steps, _Taken(*map(np.concatenate, zip(*self._taken, strict=True))))

    def open(self, piece: SmoothInterval, t: float, x: Array) -> Array:  # noqa: ARG002 (the loops look there)
        self._piece, self._end, self._limit, self.length = piece, piece.end, self._longest, 0.0
        self._course[-1], self._rested = 0.0, 0.0
        return x

    def resume(self, at: MachineSnapshot, end: float) -> None:
        """Go on to a time in s at once."""
        self.open(at.piece, at.t, at.x)
        self._end, self._limit, self.length, self.sizes = end, at.longest, at.length, at.sizes.copy()

    def step(self, t: float, x: Array) -> Step:
        problem, x = self._problem, np.ascontiguousarray(x)
        room = max(1, min(MOST_AHEAD, problem.max_steps - self._steps))
        ends, lengths, states = np.empty(room), np.empty(room), np.empty((room, x.size))
        limits = np.array([t, self._end, self.length, self._limit, self._clearance, self._rested, 0.0])
        count, self.length, tried, guard, unclear = advance(
            _system(self._machine, self._piece.low, self._piece.high), self._places, self._course, limits,
            x, problem.atol, problem.rtol, self._uneven, self.sizes, ends, lengths, states,
        )  # fmt: skip
        self.tried += tried
        if not count:
            raise self._failure(t, x)
        ends, states = ends[:count].copy(), states[:count].copy()
        self._steps += count
        starts, begun = np.append(t, ends[: count - 1]), np.vstack([x, states[: count - 1]])
        spans = np.full((count, 2), (self._piece.low, self._piece.high))
        self._made = _Taken(spans, starts, lengths[:count].copy(), begun)
        before, last = (ends[:-1], states[:-1]) if count > 1 else None, count - 1
        dense = _MachineDense(self._machine, starts[last:], _Taken(*(values[last:] for values in self._made)))
        self._rested = limits[5]
        met = (float(starts[last] + limits[6] * lengths[last]), guard) if guard >= 0 and not unclear else None
        clear, rests = guard < 0 and not unclear, self._rested >= RESTING
        return Step(ends[last], states[last], dense, before, clear=clear, met=met, rests=rests)

    def again(self, t: float, x: Array, end: float, longest: float) -> None:  # noqa: ARG002 (it starts as it did)
        self._taken.append(_Taken(*(values[:-1] for values in self._made)))
        self._end, self._limit, self._steps = end, min(longest, self._longest), self._steps - 1

    def take(self, t: float, end: float, state: Array) -> None:  # noqa: ARG002 (they can be made again)
        self._taken.append(self._made)

    def _failure(self, t: float, x: Array) -> Exception:
        """Why no step could be made."""
        functions = GuardedFunctions(self._problem, self._piece)
        functions.rhs(t, x)
        return failure(self._problem, "numba", t, x, "the step became too small", functions)
