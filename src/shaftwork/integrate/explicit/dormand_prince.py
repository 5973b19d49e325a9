"""The engine in machine code for any platform: Dormand and Prince's method of order 8(5,3), compiled by numba.

It makes many steps in one call and looks at all their guards and switches at once afterwards: those behind the first
that meets one are thrown away. Between the ends of its steps it makes them again where somebody asks.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from shaftwork.core.errors import ParameterError, SimulationError
from shaftwork.integrate.crossings import FIRST, vertices
from shaftwork.integrate.explicit.dormand_prince_loops import advance, between, watch
from shaftwork.integrate.explicit.explicit_runs import MarchedRun, solid
from shaftwork.integrate.problem import Array, MachineRates, Problem, Trajectory, changed
from shaftwork.integrate.smooth_intervals import GuardedFunctions, SmoothInterval, failure, pieces
from shaftwork.integrate.stepping import Step, march, with_outputs
from shaftwork.integrate.stiffness import bound_of_decay, jacobians
from shaftwork.numerics.zeros import LOOKS

# Where in a step that is not far from a switch the others look.
LATER = np.sort(np.append(FIRST, LOOKS))
# Steps in one call: the most, where nothing can be met in them; and at first, doubled while they meet nothing.
MOST_AHEAD, FIRST_AHEAD = 4096, 8
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
        whole = march(problem, stepper)
        counts = {"rejected": stepper.tried - (whole.steps.size - 1)}
        return MarchedRun(whole, stepper.dense(whole.steps), counts)

    problem = _watching(problem, machine)
    whole = solid(problem, run)
    return with_outputs(problem, whole.march, whole.dense, whole.counts)


def _watching(problem: Problem, machine: MachineRates) -> Problem:
    """The same problem, with guards and switches in machine code."""

    def values(times: Array, states: Array) -> Array:
        watched = np.empty((times.size, machine.guards + machine.switches))
        watch(machine.watched.address, machine.p, times, np.ascontiguousarray(states), watched)
        return watched

    guards, switches = problem.guards, None
    if guards is not None:
        guards = replace(guards, values=lambda times, states: values(times, states)[:, : machine.guards])
    if problem.switches is not None and machine.switches:
        switches = lambda times, states: values(times, states)[:, machine.guards :]  # noqa: E731
    return changed(problem, guards=guards, switches=switches)


class _Taken(NamedTuple):
    """A step as dense output makes it again: its piece, start in s, length in s and state (n,) at the start."""

    piece: SmoothInterval
    start: float
    length: float
    state: Array


class _MachineDense:
    """The motion at any time, from steps that are made again.

    Args:
        machine: the system.
        steps: (s + 1,) ends of the steps in s, the start first.
        taken: (s,) the steps.
    """

    def __init__(self, machine: MachineRates, steps: Array, taken: list[_Taken]) -> None:
        self._machine, self.steps = machine, steps
        self._spans = np.array([(step.piece.low, step.piece.high) for step in taken]).reshape(-1, 2)
        self._starts, self._lengths = (np.array([step[k] for step in taken]) for k in (1, 2))
        self.states = np.array([step.state for step in taken])

    def __call__(self, times: Array) -> Array:
        times = np.atleast_1d(np.asarray(times, dtype=float))
        order = np.argsort(times, kind="stable")
        numbers = np.clip(np.searchsorted(self.steps, times[order], side="right") - 1, 0, len(self._starts) - 1)
        values = np.empty((times.size, self.states.shape[1]))
        rates, p = self._machine.rates.address, self._machine.p
        between(rates, p, self._spans, self._starts, self._lengths, self.states, numbers, times[order], values)
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
    """

    t: float
    x: Array
    piece: SmoothInterval
    length: float
    longest: float
    offsets: Array | None
    atol: Array


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
            at = MachineSnapshot(problem.t0, problem.x0, pieces(problem)[0], 0.0, longest, offsets, problem.atol)
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
        self.at = at._replace(t=end, x=step.state, length=stepper.length)
        return True

    def with_parameters(self, p: Array) -> bool:
        """Go on in the same equations with other parameters (p,) of the model."""
        self._machine = self._machine._replace(p=self._machine.values(p))
        self._problem = _watching(self._problem, self._machine)
        return True


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
        self._watches = problem.guards is not None or problem.switches is not None
        self._taken: list[_Taken] = []
        self._ahead = FIRST_AHEAD
        self.tried = 0

    def dense(self, steps: Array) -> _MachineDense:
        """The motion between the ends (s + 1,) of the steps that were taken."""
        return _MachineDense(self._machine, steps, self._taken)

    def open(self, piece: SmoothInterval, t: float, x: Array) -> Array:
        self._piece, self._end, self._limit = piece, piece.end, self._longest
        self.length, self._ahead = self._first_step(t, x), FIRST_AHEAD
        return x

    def resume(self, at: MachineSnapshot, end: float) -> None:
        """Go on to a time in s at once."""
        self._piece, self._end, self._limit, self._ahead = at.piece, end, at.longest, MOST_SMOOTH
        self.length = at.length or self._first_step(at.t, at.x)

    def step(self, t: float, x: Array) -> Step:
        if t >= self._end:  # up to a switch
            self._end, self._limit = self._piece.end, self._longest
        room = min(self._ahead, max(1, self._problem.max_steps - len(self._taken)))
        ends, lengths, states = np.empty(room), np.empty(room), np.empty((room, x.size))
        middles, piece, machine = np.empty((room if self._watches else 0, x.size)), self._piece, self._machine
        rates, p, span, x = machine.rates.address, machine.p, np.array([piece.low, piece.high]), np.ascontiguousarray(x)
        limits = np.array([t, self._end, self.length, self._limit])
        count, following, tried = advance(
            rates, p, span, limits, x, self._problem.atol, self._problem.rtol, ends, lengths, states, FIRST[0],
            middles,
        )  # fmt: skip
        self.tried += tried
        if not count:
            raise self._failure(t, x)
        starts, begun = np.append(t, ends[: count - 1]), np.vstack([x, states[: count - 1]])
        steps = [_Taken(piece, *step) for step in zip(starts.tolist(), lengths.tolist(), begun, strict=False)]
        batch = _MachineDense(self._machine, np.append(t, ends[:count]), steps)
        first = self._clear(batch, ends[:count], states[:count], middles) if self._watches else count
        number = min(first, count - 1)
        self._ahead = min(2 * self._ahead, MOST_AHEAD) if first == count else FIRST_AHEAD
        self.length = following if number == count - 1 else lengths[number + 1]
        self._taken += steps[:number]
        self._last = steps[number]
        before = (ends[:number], states[:number]) if number else None
        return Step(ends[number], states[number], batch, before, clear=first == count)

    def again(self, t: float, x: Array, end: float, longest: float) -> None:  # noqa: ARG002 (it starts as it did)
        self._end, self._limit, self._ahead = end, min(longest, self._longest), FIRST_AHEAD

    def take(self, t: float, end: float, state: Array) -> None:  # noqa: ARG002 (it can be made again)
        self._taken.append(self._last)

    def _clear(self, batch: _MachineDense, ends: Array, states: Array, middles: Array) -> int:
        """How many of the first steps are so far from all guards and switches that they need no closer look.

        Args:
            batch: the steps.
            ends: (k,) of the steps, s.
            states: (k, n) there.
            middles: (k, n) inside them, at `FIRST`.
        """
        starts, count = batch.steps[:-1], ends.size
        points = np.vstack([batch.states[:1], middles[:count], states])
        values = self._watched(np.concatenate([starts[:1], starts + FIRST * (ends - starts), ends]), points)
        middle, after = values[1 : count + 1], values[count + 1 :]
        before = np.vstack([values[:1], after[:-1]])
        low, high = np.minimum(np.minimum(before, middle), after), np.maximum(np.maximum(before, middle), after)
        far = ((np.minimum(np.abs(low), np.abs(high)) > 2 * (high - low)) | (low == high)).all(axis=1)
        near = np.flatnonzero(~far)
        if near.size:
            times = starts[near, None] + LATER * (ends - starts)[near, None]
            inside = self._watched(times.ravel(), batch(times.ravel())).reshape(*times.shape, -1)
            course = np.concatenate([before[near, None], inside, after[near, None]], axis=1)
            heights = course * np.sign(before[near, None])
            _, low = vertices(np.column_stack([starts[near], times, ends[near]]), heights)
            still = (course == before[near, None]).all(axis=1)
            far[near] = ((heights > 0).all(axis=1) & ~low.any(axis=1) | still).all(axis=1)
            near = np.flatnonzero(~far)
        return int(near[0]) if near.size else count

    def _watched(self, times: Array, states: Array) -> Array:
        """(k, m) all that is watched at times (k,) and states (k, n); guards beyond their limits are NaN."""
        problem, watched, times = self._problem, list[Array](), np.clip(times, self._piece.low, self._piece.high)
        if problem.guards is not None:
            guards = problem.guards
            active = guards.sides != 0
            values = (guards.values(times, states) * guards.sides - guards.offsets)[:, active]
            watched.append(np.where(values < 0, values, np.nan))
        if problem.switches is not None:
            watched.append(problem.switches(times, states))
        return np.hstack(watched)

    def _first_step(self, t: float, x: Array) -> float:
        """A first step in s of which the error is small: Hairer, section II.4."""
        functions, scale = self._functions(), self._problem.atol + self._problem.rtol * np.abs(x)
        slope = functions.rhs(t, x)
        size, speed = (float(np.sqrt(np.mean((vector / scale) ** 2))) for vector in (x, slope))
        guess = 0.01 * size / speed if size > 1e-5 and speed > 1e-5 else 1e-6
        guess = min(guess, self._piece.end - t)
        bend = float(np.sqrt(np.mean(((functions.rhs(t + guess, x + guess * slope) - slope) / scale) ** 2))) / guess
        largest = max(speed, bend)
        step = max(1e-6, 1e-3 * guess) if largest <= 1e-15 else (0.01 / largest) ** (1 / 8)
        return min(100 * guess, step, self._limit)

    def _functions(self) -> GuardedFunctions:
        return GuardedFunctions(self._problem, self._piece)

    def _failure(self, t: float, x: Array) -> Exception:
        """Why no step could be made."""
        functions = self._functions()
        functions.rhs(t, x)
        return failure(self._problem, "numba", t, x, "the step became too small", functions)
