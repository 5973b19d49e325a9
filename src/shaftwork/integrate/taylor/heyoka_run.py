"""One run of a heyoka program: how it passes guards and switches, and whether its series satisfy the equations."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from shaftwork.core.errors import SimulationError
from shaftwork.integrate.problem import Array, Problem, SeriesError, StickingError
from shaftwork.integrate.smooth_intervals import SmoothInterval, failure, near, start_of_piece, used_up
from shaftwork.integrate.taylor.heyoka_switches import SOMEWHERE, SwitchWatch, keeps_sides, settle
from shaftwork.numerics.tolerances import SAME

# What heyoka's outcomes are called here where a guard ended the run.
GUARD = "guard"
# Part of a state by which a series and the equations may differ.
DEFECT = 1e-8
# What is the least that rounding moves a guard of size 1.
ROUNDING = 8 * float(np.finfo(float).eps)

# From (integrator, step callback, step limit, longest step) to (outcome, its name, steps taken); called again after an
# interruption. It returns to Python after some steps each, which changes them by rounding alone.
Advance = Callable[[Any, SwitchWatch | None, int, float], tuple[Any, str, int]]
Rates = Callable[[float, Array], Array]


class TaylorRun:
    """One run over a problem, by an integrator that is lent for it."""

    _inside = (0.5, 0.9)
    """Where in a step, as parts of it, its series is compared with the equations: not at its end, where a law may
    jump."""

    def __init__(self, problem: Problem, lent: Any) -> None:
        self.problem = problem
        self.program = problem.program.program
        self.lent, self.integrator = lent, lent.integrator
        self._x, self._p = lent.integrator.state, lent.integrator.pars  # heyoka's own, which it makes anew at each look
        self.parameters: Array = problem.program.parameters.copy()
        self.state: Array = np.array(problem.x0, dtype=float)
        self.start = self.state
        self.steps = 0
        self.met: int | None = None
        """The guard that ended the run."""
        self._begun: tuple[float, Array] | None = None
        """Time in s and state at the last guard past which it went on."""
        self.resets: list[tuple[float, Callable[[], Rates]]] = []
        """Times in s of guards past which it went on, and what makes the equations that hold from there on."""

    def piece(self, piece: SmoothInterval, advance: Advance) -> None:
        """Bring the run to the end of a piece; `advance` records what it passes."""
        integrator, watch = self.integrator, self.begin(piece)
        self.lent.listeners.clear()
        longest = self._first_step(piece)
        self.lent.listeners[:] = [self._goes_on] if watch is None else []
        while True:
            left = self.problem.max_steps - self.steps
            raw, outcome, steps = advance(integrator, watch, left if longest == math.inf else 1, longest)
            self.steps += steps
            if outcome == "step_limit" and longest < math.inf and left > 1:
                longest = math.inf
                continue
            self.met = self._guard_met(raw, outcome, watch)
            if self.met is None and outcome == "cb_stop" and watch is not None and watch.reason is None:
                if watch.leaves:
                    settle(self.program, integrator, piece.end - piece.start)
                continue
            # a switch may be at zero where a guard is met, and settling it takes a step: it is not passed at once
            if self.met is not None and watch is not None and self._goes_on(self.met):
                self.met = None
                integrator.reset_cooldowns()
                settle(self.program, integrator, piece.end - integrator.time)
                continue
            break
        if self.met is None and outcome not in ("time_limit", "success"):
            raise self._failure(piece, outcome, watch)
        self.state = integrator.state.copy()
        if not np.isfinite(self.state).all():
            raise self._failure(piece, "err_nf_state", watch)
        if self.problem.past_guards is not None:
            self.problem.past_guards.refuse_missed(self.met, integrator.time, self.state)

    def begin(self, piece: SmoothInterval) -> SwitchWatch | None:
        """Set the integrator for the start of a piece; what looks after the switches, where the motion passes them."""
        integrator, self._begun = self.integrator, None
        integrator.time = piece.start
        integrator.state[:] = self.start = start_of_piece(self.problem, piece, self.state)
        # heyoka keeps no parameters behind the last one that the rows contain
        used = min(integrator.pars.size, self.parameters.size)
        if self.program.held is not None:
            inside = piece.low + SOMEWHERE * (piece.high - piece.low)
            self.program.held.start(piece.start, inside, self.start, self.parameters)
        integrator.pars[:used] = self.parameters[:used]
        integrator.reset_cooldowns() if integrator.with_events else None
        if self.problem.guards is not None:
            self._sizes = np.fmax(self.problem.guards.sizes, 1.0).tolist()
            self._sides = integrator.pars[self.program.sides]
            self._offsets = integrator.pars[self.program.offsets]
            self._guard([*enumerate(self.problem.guards.sides.tolist())], self.problem.guards.offsets.tolist())
        self.program.weigh(integrator)
        return self._watch(piece)

    def _guard(self, ends: Sequence[tuple[int, float]], offsets: Sequence[float]) -> None:
        """Watch the guards that end the phase from here on, by their numbers and sides, and no others.

        heyoka's tolerance is relative to the largest of states and events: a torque of 1e6 N m in one would cost six
        digits. So guards count in parts of their size, which their first values tell, and how far rounding moves them.
        """
        self._sides[:] = 0.0
        for number, side in ends:  # a few at each change of mode: plain floats are faster than arrays
            offset = offsets[number]
            size = max(self._sizes[number], offset / ROUNDING)
            self._sides[number], self._offsets[number] = side / size, offset / size

    def _guard_met(self, raw: Any, outcome: str, watch: SwitchWatch | None) -> int | None:
        """The guard at which the run has stopped, by its own event or at that of a switch at the very same instant.

        Without the second, scipy takes over a motor under current control: 2.5 times the steps, and an energy residual
        of 6e-9 instead of 8e-13.
        """
        if outcome == GUARD:
            met: int | None = self.program.guard_met(raw)
            return met
        if watch is None or self.problem.guards is None or not self.program.guards or watch.reason is not None:
            return None
        time, state = self.integrator.time, self.integrator.state
        beyond = self._beyond(time, state)
        most = beyond.max(initial=-np.inf)
        # a law that bends where a guard is met, as |i| does where a current ends, may hide what is met to rounding
        if -SAME < most <= 0.0 and outcome == "cb_stop":
            ahead = SAME * (self.problem.t_end - self.problem.t0)
            later = self._beyond(time + ahead, state + ahead * self.program.slopes(time, state, self.integrator.pars))
            beyond = np.where((beyond > -SAME) & (later > beyond), later, -np.inf)
        return int(np.argmax(beyond)) if beyond.max(initial=-np.inf) > 0.0 else None

    def _beyond(self, time: float, state: Array) -> Array:
        """How far the guards that are watched are beyond their limits, in parts of their sizes."""
        values = self.program.guard_values(time, state, self.integrator.pars)
        return np.where(self._sides == 0.0, -np.inf, self._sides * values - self._offsets)

    def _goes_on(self, met: int) -> bool:
        """Whether the run goes on past the guard that it has met."""
        if self.problem.past_guards is None:
            return False
        time = self.integrator.time
        reset = self.problem.past_guards(len(self.resets), met, time, self._x)
        if reset is None:
            return False
        self.resets.append((time, reset.equations))
        self._p[: reset.p.size] = reset.p
        if reset.x is not None:
            self._x[: reset.x.size] = reset.x
        self._begun = time, self._x.copy()
        self._guard(reset.ends, reset.offsets)
        self.program.weigh(self.integrator)
        return True

    def _first_step(self, piece: SmoothInterval) -> float:
        """Longest first step in s, infinite where heyoka's own choice is good.

        heyoka takes its step from the last two terms of the series. Where a motion starts as a polynomial, as that of
        J w' = 1 - w^5 from rest does, these are zero although later ones are not, and the step would have no end.
        """
        integrator, longest = self.integrator, math.inf
        start, state, parameters = integrator.time, integrator.state.copy(), integrator.pars.copy()
        for _ in range(30):
            integrator.step(max_delta_t=min(longest, piece.end - piece.start), write_tc=True)
            step = integrator.time - start
            good = not (step > 0.0 and np.isfinite(integrator.state).all()) or (
                satisfied(self.problem, self.problem.rhs, piece, integrator.tc, start, self._inside[-1] * step, 0.0)
                and (self.program.all_timed or keeps_sides(self.program, integrator, parameters, start))
            )
            integrator.time = start
            integrator.state[:], integrator.pars[:] = state, parameters
            integrator.reset_cooldowns() if integrator.with_events else None
            if good:
                break
            longest = step / 4
        return longest

    def verify(self, piece: SmoothInterval, segments: Sequence[Any]) -> None:
        """Refuse series that have passed a root or a pole of a law, and gone on otherwise than the law.

        Raises:
            SeriesError: says where.
        """
        if not segments:
            return
        # near a root of zero slope a series is poor in steps so short that it moves nothing
        sizes = np.max([np.abs(segment.tcs[:, :, 0]).max(axis=0) for segment in segments], axis=0)
        changes, rhs, past = [time for time, _ in self.resets], self.problem.rhs, 0
        for segment in segments:
            for (start, end), terms in zip(pairwise(segment.times), segment.tcs, strict=True):
                if (now := bisect_right(changes, start)) > past:
                    rhs, past = self.resets[now - 1][1](), now
                for part in self._inside:
                    if not satisfied(self.problem, rhs, piece, terms, start, part * (end - start), sizes):
                        reason = f"up to t = {end:.9g} s a law has a root or a pole that a Taylor series does not show"
                        raise SeriesError(str(series_failure(self.problem, start, terms[:, 0], reason)), reason)

    def _watch(self, piece: SmoothInterval) -> SwitchWatch | None:
        """Set the signs of the switches; what has to look after them, where the motion may change them."""
        program = self.program
        if not program.switches:
            return None
        self.integrator.pars[program.signs] = 0.0
        settle(program, self.integrator, piece.end - piece.start)
        if np.isnan(self.integrator.pars[program.signs]).any():
            raise self._failure(piece, "err_nf_state", None)
        if program.all_timed:
            return None
        integrator = self.integrator
        size = np.abs(program.switch_values(integrator.time, integrator.state, integrator.pars))
        return SwitchWatch(program, piece.start, self.problem.t_end - self.problem.t0, size)

    def _failure(self, piece: SmoothInterval, outcome: str, watch: SwitchWatch | None) -> SimulationError:
        time, state = self._last_good(piece, watch)
        error = series_failure(self.problem, time, state, self._reason(outcome, watch))
        if watch is not None and watch.reason is not None:
            return StickingError(str(error), watch.reason.partition(", because")[0], driven_back=watch.driven_back)
        obstacle = f"after t = {time:.9g} s a law, or one of its derivatives, is not finite, as a root's at zero"
        return SeriesError(str(error), obstacle) if outcome == "err_nf_state" else error

    def _last_good(self, piece: SmoothInterval, watch: SwitchWatch | None) -> tuple[float, Array]:
        """Time and state at the end of the last good step of a run that has failed in a piece."""
        integrator = self.integrator
        if watch is not None:
            return watch.last_good or (piece.start, self.start)
        if np.isfinite(integrator.time) and np.isfinite(integrator.state).all():
            return integrator.time, integrator.state.copy()
        integrator.time, integrator.state[:] = good = self._begun or (piece.start, self.start)
        while integrator.step(max_delta_t=piece.end - integrator.time)[0].name == "success":
            good = integrator.time, integrator.state.copy()
        return good

    def _reason(self, outcome: str, watch: SwitchWatch | None) -> str:
        if outcome == "step_limit":
            used = self.steps >= self.problem.max_steps
            return used_up(self.problem) if used else "its steps are shorter than the spacing of numbers at this time"
        if outcome == "err_nf_state":
            return "the state or its derivative is not finite"
        if watch is not None and watch.reason is not None:
            return watch.reason
        return f"heyoka stopped with the outcome {outcome!r}"


def series_failure(problem: Problem, t: float, x: Array, reason: str) -> SimulationError:
    """The error of a failed run, as `failure` makes it; or the law that has a value there and no series.

    Args:
        problem: what was to be solved.
        t: last time reached, s.
        x: (n,) state there.
        reason: why the run ended.
    """
    if near(problem, problem.explain, t, x) is None and (law := near(problem, problem.rough, t, x)) is not None:
        return SimulationError(
            f"The heyoka engine failed at t = {law[0]:.9g} s: {law[1]} has a value there, but not all its branches and "
            "slopes have one, and a Taylor series computes even those whose condition does not hold. Take "
            "engine='scipy', or give each a value: a root, a logarithm or a quotient of Max(1e-9, ...)."
        )
    return failure(problem, "heyoka", t, x, reason)


def satisfied(
    problem: Problem,
    rhs: Rates,
    piece: SmoothInterval,
    terms: Array,
    start: float,
    elapsed: float,
    sizes: Array | float,
) -> bool:
    """Whether a series (n, orders) from a start in s satisfies equations after some time; `sizes` are of states."""
    orders = np.arange(terms.shape[1])
    powers = elapsed**orders
    state, change = terms @ powers, terms @ (orders * powers)  # what it is, and by how much its slope would move it
    with np.errstate(all="ignore"):
        defect = np.abs(np.multiply(elapsed, rhs(piece.inside(start + elapsed), state)) - change)
    moved = np.maximum(np.abs(state), sizes) + np.abs(change)
    return bool((defect <= DEFECT * moved + problem.atol).all())
