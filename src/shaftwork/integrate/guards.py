"""Guards of a phase: whether a step meets one, and when. It is then cut off there, for the phase is smooth beyond."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from shaftwork.integrate.crossings import FIRST, Dense, Look, tolerance
from shaftwork.integrate.problem import TOLERATED, Array, DaeProblem, Problem, TimedProblem
from shaftwork.numerics.polynomials import Interpolant, interpolation_times
from shaftwork.numerics.tolerances import CLEARANCE
from shaftwork.numerics.zeros import LOOKS, zero

# A run of more steps tells enough of a motion by itself.
BRIEF = 100

# A step that meets a guard is looked at in panels that are halved towards it, so many times; Gauss' nodes in each.
PANELS, (NODES, WEIGHTS) = 14, np.polynomial.legendre.leggauss(4)


class GuardWatch:
    """Finds the first guard of a problem that a step meets; the last one found is `met`.

    Args:
        problem: what is being solved.
        low: the earliest time in s at which inputs are read.
        high: the latest.
    """

    def __init__(self, problem: TimedProblem, low: float, high: float) -> None:
        guards = problem.guards
        self._columns = np.zeros(0, dtype=np.intp) if guards is None else np.flatnonzero(guards.sides)
        self._offsets = np.zeros(0) if guards is None else guards.offsets[self._columns]
        self._guards, self._low, self._high = guards, low, high
        self._problem = problem
        self.met: int | None = None

    def cut(
        self, start: float, x: Array, end: float, y: Array, dense: Dense, *, met: tuple[float, int] | None = None
    ) -> float | None:
        """The time in s at which a step meets its first guard, or None.

        Args:
            start: of the step, s.
            x: (n,) state there.
            end: of the step, s.
            y: (n,) state there.
            dense: its dense output, times (k,) to states (k, n).
            met: the time in s and the guard, where they are known.

        Raises:
            SimulationError: a guard has no value there.
        """
        if not self._columns.size:
            return None
        event = met or self._first_event(start, x, end, y, dense)
        if event is None:
            return None
        time, self.met = event
        return min(max(time, start + CLEARANCE * float(np.spacing(abs(end)))), end)

    def _first_event(self, start: float, x: Array, end: float, y: Array, dense: Dense) -> tuple[float, int] | None:
        """The time in s at which a step meets its first guard, and this guard; see `cut`."""
        first = start + FIRST * (end - start)
        times, states = np.array([start, *first, end]), np.vstack([x, dense(first), y])
        look = Look(self._values, times, states, dense, -np.ones(self._columns.size))
        if look.is_far() and (look.values[0] < 0).all():
            return None
        look.add(start + LOOKS * (end - start))
        self._refuse_none(look)
        noise = np.maximum(look.values[0], 0.0) + self._offsets
        look.values[0] = np.minimum(look.values[0], 0.0)
        look.follow(every=True)
        risen = np.flatnonzero((look.values > 0).any(axis=0)).tolist()
        rises = [(self._time(look, column, 2 * float(noise[column])), column) for column in risen]
        events = [(time, int(self._columns[column])) for time, column in rises if time is not None]
        return min(events, default=None)

    def beyond(self, t: float, x: Array) -> int | None:
        """The guard that is farthest beyond its limit at a time in s with the state (n,); None where none is."""
        if not self._columns.size:
            return None
        now = self._values(np.array([t]), x[None, :])[0]
        place = int(np.argmax(now))
        return int(self._columns[place]) if now[place] > 0 else None

    def follows(self, start: float, x: Array, end: float, dense: Dense) -> bool:
        """Whether a step obeys the equations up to the guard that it has met.

        What a law does just before a guard, as friction does that rises at low speeds, may lie between all points at
        which the step has looked at it.

        Args:
            start: of the step, s.
            x: (n,) state there.
            end: where it meets the guard, s.
            dense: its dense output, times (k,) to states (k, n).
        """
        if not isinstance(self._problem, Problem):
            return True
        edges = end - (end - start) * np.append(0.5 ** np.arange(PANELS), 0.0)
        half = np.diff(edges)[:, None] / 2
        times = (edges[:-1, None] + half * (NODES + 1)).ravel()
        states = dense(times)
        rates = self._rates(self._problem, np.clip(times, self._low, self._high), states)
        by_rates, by_step = (half * WEIGHTS).ravel() @ rates, dense(np.array([end]))[0] - x
        size = self._problem.rtol * np.abs(states).max(axis=0) + self._problem.atol
        return bool((np.abs(by_rates - by_step) <= TOLERATED * size).all())

    @staticmethod
    def _rates(problem: Problem, times: Array, states: Array) -> Array:
        """The right-hand side at times (k,) and states (k, n), all at once where it can be."""
        if problem.rates is not None:
            return problem.rates(times, states)
        return np.array([problem.rhs(t, y) for t, y in zip(times.tolist(), states, strict=True)])

    def _refuse_none(self, look: Look) -> None:
        """Refuse a guard that has no value in a step: nobody can tell whether it is met.

        Raises:
            SimulationError: names the law in it.
        """
        if np.isnan(look.values).any() and self._problem.explain is not None:
            error = self._problem.explain(look.times, look.states)
            if error is not None:
                raise error

    def _values(self, times: Array, states: Array) -> Array:
        assert self._guards is not None  # noqa: S101 (asked only then)
        values = self._guards.values(np.clip(times, self._low, self._high), states)
        return np.asarray((values * self._guards.sides - self._guards.offsets)[:, self._columns])

    def _time(self, look: Look, column: int, noise: float) -> float | None:
        """When a guard rises through zero; one that is above it from the start, by noise, has to fall first."""
        values = look.values[:, column]
        below = np.flatnonzero(values < 0)
        if not below.size:
            return float(look.times[0]) if values[-1] > values[0] else None
        if values[: below[0]].max(initial=0.0) > noise:
            return float(look.times[0])
        above = np.flatnonzero(values[below[0] :] > 0)
        if not above.size:
            return None
        row = int(below[0] + above[0])
        before = int(below[below < row][-1])
        return self._root(look, column, before, row)

    @staticmethod
    def _root(look: Look, column: int, before: int, row: int) -> float:
        """When a guard passes through zero between two rows.

        To evaluate all guards takes longer than anything else here, at one time or at a dozen. So the zero is that of a
        polynomial through their values at some times, where their values beside it agree.
        """
        low, high, ulp = float(look.times[before]), float(look.times[row]), float(np.spacing(look.times[-1]))
        times = np.minimum(interpolation_times(low, high, degree=12), high)
        course = Interpolant(low, high, look.at(times)[:, [column]])
        root = _zero(lambda t: course(t)[:, 0], low, high, ulp)
        beside = look.at(root + 8 * ulp * np.array([-1.0, 1.0]))[:, column]
        if root == high or beside[0] < 0 < beside[1]:
            return root
        return _zero(lambda t: look.at(t)[:, column], low, high, ulp)


def _zero(value: Callable[[Array], Array], low: float, high: float, ulp: float) -> float:
    """Where a function passes through zero; its end where it does not, as that is rounding away from others."""
    first, last = ends = value(np.array([low, high])).tolist()
    return high if first * last > 0 else zero(value, low, high, ends=ends, xtol=ulp)


def share_of_tolerance(problem: Problem | DaeProblem, times: Array, states: Array) -> float:
    """The part of its tolerance with which a brief run knows the courses of all guards to 1e-5; 1 where it does now.

    Args:
        problem: what was solved.
        times: (k,) ends of the steps, s.
        states: (k, n) then.
    """
    guards = problem.guards
    if guards is None or times.size > BRIEF:
        return 1.0
    moved = states[-1:] + tolerance(problem, states[-1:])
    values = guards.values(np.append(times, times[-1]), np.vstack([states, moved]))
    bands, courses = np.abs(values[-1] - values[-2]), np.abs(values[:-1]).max(axis=0)
    goes = (guards.sides != 0) & (courses > 0) & (bands > 0)
    return float(np.min(1e-5 * courses[goes] / bands[goes], initial=1.0))
