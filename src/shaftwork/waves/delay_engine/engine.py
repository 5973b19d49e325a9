"""The engine for lossless lines: a network of ordinary differential equations whose lines are delays.

Very long motions of a lattice under constant inputs go from output to output by powers of the map over many panels. Of
a steel shaft of 1 m, 20 s take 1.3 s and 0.4 GiB so; panel by panel 7 s and 1 GiB, and 100 s more than a computer has.
"""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise

import numpy as np

from shaftwork.core.errors import AccuracyWarning
from shaftwork.core.notices import warn
from shaftwork.integrate.engines import ENGINES
from shaftwork.integrate.problem import Array
from shaftwork.integrate.smooth_intervals import pieces
from shaftwork.numerics.tolerances import SAME
from shaftwork.waves.delay_engine.collocation import POWERS, STAGES, STATE_POWERS, squared
from shaftwork.waves.delay_engine.lattice import Lattice, LatticeRun, Matrices, Numbers, panel_map
from shaftwork.waves.delay_engine.lines import DelayProblem, DelayTrajectory
from shaftwork.waves.delay_engine.march import March
from shaftwork.waves.delay_engine.waveforms import one_sided, trajectory

LONG, MOST_PANELS_FAR = 20_000, 64
"""A motion of more panels than the first after its last breakpoint, and of 100 for each output, is leapt through; its
period is made finer up to so many panels as the second."""


def solve(problem: DelayProblem) -> DelayTrajectory:
    """Integrate by Gauss collocation of order 16 on panels between the kinks, none longer than the shortest delay.

    Law: on such a panel all h are known, so only the states are solved for. A jump or kink of a wave, born at t0, at
    a breakpoint or in a law, ends a panel, and ends one again a delay later at the far end of its line, for as long
    as it moves a wave by more than the tolerance. Delays without a common measure so make ever more panels, in
    proportion to the square of the time for two of them; kinks nearer than a part 1e-4 rtol of a delay are one, and
    weak ones stay inside a panel, which is then halved at the kink if it does not resolve them: the error follows
    rtol, and `max_steps` is the bound. Where the panels of a line repeat with its delay the nodes coincide, h is
    taken from them, and Gauss quadrature of the exchanged power is exact: energy is kept to rounding. Elsewhere h is
    the polynomial of its panel, one-sided at the panel's ends, checked between the nodes.

    A panel is halved until the Legendre coefficients that states and waves leave out are below a tenth of the
    tolerance, so the panels are graded towards the boundary layer of a light end. A layer that is narrower than the
    hundredth part of rtol times the shortest delay is stepped over by Radau IIA, which leaves no ringing; in it the
    output is that of a straightened layer. Linear networks whose delays have a common measure are solved by one
    constant map a panel, and long ones with constant inputs and few outputs by its powers
    (`on_lattice`).

    Raises:
        SimulationError: a value is not finite, Newton's method fails, a layer cannot be resolved, or too many panels.

    Source: Bergeron, Du coup de belier en hydraulique au coup de foudre en electricite, 1949; Bellen and Zennaro,
    Numerical Methods for Delay Differential Equations, 2003; Hairer, Lubich, Wanner, Geometric Numerical Integration,
    IV.2.
    """
    with np.errstate(all="ignore"):
        if problem.linear and problem.past is None and (periodic := on_lattice(problem)) is not None:
            return periodic
        march = March(problem)
        march.run()
    return trajectory(problem, *march.panels())


def on_lattice(problem: DelayProblem) -> DelayTrajectory | None:
    """Integrate a linear network whose delays have a common measure, or None where they have not.

    Law: every period, of the length of that measure, is divided alike, at t0 and at the breakpoints and where a layer
    needs it, so each panel is one constant map from (x, h) to (x, waves). Blocks of periods are marched side by side
    from zero and from unit vectors, then their true starts are carried from block to block, and they are marched again.
    A long motion under constant inputs with few outputs is leapt through: the map over 256 periods is marched, squared
    again and again, and applied from output to output. What is asked for is checked as elsewhere; where modes
    have run too far out of step for 64 panels a period, a warning says how much of the waves is not resolved.

    Raises:
        SimulationError: as `solve`.
    """
    measured = _measure(problem)
    if measured is None:
        return None
    period, multiples = measured
    pattern = _first_pattern(problem, period)
    matrices, twice = Matrices.of(problem), 2 * np.repeat(problem.impedances, 2)
    map_of = cache(lambda length: panel_map(matrices, twice, length * period))
    rtol = max(problem.rtol, ENGINES["wave"].finest)
    # A beginning shows which panels are too long; a motion of 2000 panels shows it as fast.
    resolved = (problem.t_end - problem.t0) / period * len(pattern) < 2_000
    while True:
        lattice = Lattice(problem, map_of, period, multiples, pattern)
        far = _is_long(lattice)  # a long motion scrambles its modes, and the march cannot take it over
        if resolved:
            motion, bad = _far(lattice, rtol) if far else _whole(lattice, rtol)
            if motion is not None:
                return motion
        else:
            beginning = (2 * max(multiples) + 2) * lattice.size
            bad = lattice.unresolved(lattice.run(min(lattice.count, beginning)), rtol)
        resolved = not any(bad)
        pattern = _refined(pattern, bad)
        if not far and not resolved and len(pattern) > 16:  # left to the march
            return None


def _is_long(lattice: Lattice) -> bool:
    problem = lattice.problem
    if not problem.steady or problem.t_eval is None:
        return False
    return bool(lattice.count - lattice.edges[-2] > max(LONG, 100 * problem.t_eval.size))


def _whole(lattice: Lattice, rtol: float) -> tuple[DelayTrajectory | None, list[bool]]:
    """The trajectory, or None and which panels of the period must be finer."""
    if lattice.count > lattice.problem.max_steps:
        raise lattice.failure(0, lattice.problem.x0, f"{lattice.problem.max_steps} steps are not enough")
    run = lattice.run(lattice.count)
    bad = lattice.unresolved(run, rtol)
    return (None if any(bad) else lattice.trajectory(run, lattice.problem.t_eval)), bad


def _far(lattice: Lattice, rtol: float) -> tuple[DelayTrajectory | None, list[bool]]:
    """As `_whole`, for a long motion of few outputs."""
    times = np.asarray(lattice.problem.t_eval, dtype=float)
    run = lattice.run(lattice.edges[-2] + max(256 * lattice.size, lattice.reach))  # 256 periods
    leaps = PeriodicPropagation(lattice, run)
    read = np.unique(lattice.panels(times))
    late = leaps.run(np.append(read[read >= leaps.first], lattice.count - 1))
    bad = [any(both) for both in zip(lattice.unresolved(run, rtol), lattice.unresolved(late, rtol), strict=True)]
    if any(bad):
        if 2 * lattice.size <= MOST_PANELS_FAR:
            return None, bad
        warn(
            f"After {lattice.count // lattice.size:g} delays the modes have run out of step and the waves have "
            f"wrinkles finer than {lattice.size} panels in a delay: about {lattice.wrinkles(late):.1g} of the largest "
            f"wave is not resolved (asked: {rtol:.1g}). The energy is kept all the same. An input without jumps, or a "
            "little damping with model=Spectral(16), leaves fewer wrinkles.",
            AccuracyWarning,
        )
        bad = [False] * lattice.size
    far = Far(lattice.trajectory(run, np.empty(0)), leaps, lattice)
    x, h, v = far.all(times)
    statistics = {"steps": len(run.numbers) + len(read)}
    return DelayTrajectory(times, x, far, statistics, h, v, waves=far.waves, squares=far.squares, past=None), bad


def _measure(problem: DelayProblem) -> tuple[float, tuple[int, ...]] | None:
    """A period in s and how many of them the delay of each line lasts."""
    size = (problem.x0.size + 2 * problem.delays.size) * STAGES
    shortest = float(problem.delays.min())
    # Delays are whole multiples of a part of the shortest one, up to rounding, and no longer than 64 of them; panels of
    # more unknowns are left to the march.
    for parts in range(1, 13):
        ratios = problem.delays * parts / shortest
        multiples = np.round(ratios)
        if (np.abs(ratios - multiples) <= SAME * multiples).all() and multiples.max() <= 64:
            return (shortest / parts, tuple(multiples.astype(int).tolist())) if size <= 400 else None
    return None


def _first_pattern(problem: DelayProblem, period: float) -> tuple[float, ...]:
    marks = [*problem.breakpoints] if problem.steady else [*problem.breakpoints, problem.t_end]
    offsets = [0.0]
    near = 8 * math.ulp(max(abs(problem.t0), abs(problem.t_end))) / period + SAME
    for mark in marks:
        offset = math.fmod((mark - problem.t0) / period, 1.0)
        if all(near < abs(offset - other) < 1 - near for other in offsets):
            offsets.append(offset)
    return tuple(sorted(offsets))


def _refined(pattern: tuple[float, ...], bad: list[bool]) -> tuple[float, ...]:
    """Halve the bad panels."""
    spans = zip(pairwise((*pattern, 1.0)), bad, strict=True)
    return tuple(start for (low, high), split in spans for start in ((low, (low + high) / 2) if split else (low,)))


class PeriodicPropagation:
    """The panels after a run, at constant inputs.

    Args:
        lattice: of the panels.
        run: its first panels, past the last breakpoint by the longest delay or more.
    """

    def __init__(self, lattice: Lattice, run: LatticeRun) -> None:
        self._lattice, self.first = lattice, len(run.numbers)
        window = run.waves[-lattice.reach :]
        self._shape, self._n = window.shape, run.starts.shape[1]
        # The first leap is marched over 256 periods: each squaring doubles its roundings.
        self._length = 256 * lattice.size
        self._input = lattice.inputs(pieces(lattice.problem)[-1], self.first, self.first + 1)
        numbers = self.first + np.arange(self._length)
        self._drive = lattice.applied(np.repeat(self._input, self._length, axis=0), numbers, "drive")[:, :, None]
        power, forced = lattice.power(self.first, self._drive)
        rest = np.append(np.zeros(len(power)), 1.0)
        self._start = np.concatenate([run.ends[-1], window.ravel(), [1.0]])
        self._powers = [np.vstack([np.hstack([power, forced]), rest])]
        while 2 ** len(self._powers) * self._length <= lattice.count:
            self._powers.append(self._powers[-1] @ self._powers[-1])

    def run(self, panels: Numbers) -> LatticeRun:
        """Some panels (m,), rising, none before the first."""
        leaps, steps = np.divmod(panels - self.first, self._length)
        places, done, pasts = self._start, 0, []
        for leap in leaps.tolist():
            for power, matrix in enumerate(self._powers):
                if (leap - done) >> power & 1:
                    places = matrix @ places
            done = leap
            pasts.append(places[:-1])
        width = 64  # motions marched side by side, from the ends of their leaps to the panels to be read
        parts = [
            self._panels(np.column_stack(pasts[low : low + width]), steps[low : low + width])
            for low in range(0, len(panels), width)
        ]
        starts, waves, arrived, squares = (np.concatenate(part) for part in zip(*parts, strict=True))
        inputs = np.broadcast_to(self._input, (len(panels), self._input.shape[1]))
        states = self._lattice.inside(panels, starts, arrived, inputs)
        return LatticeRun(panels, starts, states, waves, arrived, [], squares)

    def _panels(self, pasts: Array, steps: Numbers) -> tuple[Array, Array, Array, Array]:
        """Start states, waves, history torques and squares of panels some steps (c,) after their pasts (z, c)."""
        lattice, column = self._lattice, np.arange(steps.size)
        window = pasts[self._n :].reshape(*self._shape, steps.size)
        states, waves = lattice.march(self.first, pasts[: self._n], window, self._drive[: steps.max() + 1])
        waves = np.concatenate([window, waves])
        lagging = steps[:, None] + lattice.reach - lattice.lags
        arrived = -waves[lagging, lattice.partners, :, column[:, None]]
        weights = lattice.weights(self.first + steps[:, None] - lattice.reach + np.arange(lattice.reach))
        before = waves[steps[:, None] + np.arange(lattice.reach), :, :, column[:, None]]
        within = np.arange(lattice.reach)[:, None] >= lattice.reach - lattice.lags
        squares = np.einsum("crqs,crs,rq->cq", before**2, weights, within)
        return states[steps, :, column], waves[steps + lattice.reach, :, :, column], arrived, squares


class Far:
    """Dense output of a motion that begins with a run and goes on in leaps.

    Args:
        near: trajectory of the run.
        leaps: what follows.
        lattice: of the panels.
    """

    def __init__(self, near: DelayTrajectory, leaps: PeriodicPropagation, lattice: Lattice) -> None:
        self._near, self._leaps, self._lattice = near, leaps, lattice

    @property
    def steps(self) -> Array:
        """Every time (s,) at which a panel ended, t0 first."""
        lattice = self._lattice
        return np.append(lattice.times(np.arange(lattice.count)), lattice.problem.t_end)

    def __call__(self, times: Array) -> Array:
        return self.all(times)[0]

    def waves(self, times: Array) -> tuple[Array, Array]:
        """History torques and speeds (k, q) of the ends."""
        return self.all(times)[1:]

    def squares(self, times: Array) -> Array:
        """Integrals (k, q) over the last delay of the squared wave that leaves each end, up to times (k,)."""
        panels = self._lattice.panels(times)
        late = panels >= self._leaps.first
        squares = np.empty((times.size, self._lattice.partners.size))
        squares[~late] = self._near.squares(times[~late])
        if late.any():
            run, index, place = self._panels_at(times[late], panels[late])
            lengths = self._lattice.lengths[run.numbers[index] % self._lattice.size]
            left, came = (squared((rows @ POWERS)[index], place) for rows in (run.waves, run.arrived))
            # What arrives at an end is what left its partner a delay before.
            squares[late] = run.squares[index] + (left - came[:, self._lattice.partners]) * lengths[:, None] / 2
        return squares

    def all(self, times: Array) -> tuple[Array, Array, Array]:
        """States (k, n), history torques (k, q) and speeds (k, q) at times (k,)."""
        times = np.atleast_1d(np.asarray(times, dtype=float))
        panels = self._lattice.panels(times)
        near = panels < self._leaps.first
        early = times[near]
        x, (h, v) = self._near.dense(early), self._near.waves(early)
        x_all, h_all, v_all = (np.empty((times.size, part.shape[1])) for part in (x, h, v))
        x_all[near], h_all[near], v_all[near] = x, h, v
        if not near.all():
            x_all[~near], h_all[~near], v_all[~near] = self._late(times[~near], panels[~near])
        return x_all, h_all, v_all

    def _late(self, times: Array, panels: Numbers) -> tuple[Array, Array, Array]:
        problem = self._lattice.problem
        run, index, place = self._panels_at(times, panels)
        powers = np.vander(place, STAGES + 1, increasing=True)
        states = np.concatenate([run.starts[:, :, None], run.states], axis=2) @ STATE_POWERS
        x = np.einsum("knp,kp->kn", states[index], powers)
        h = np.einsum("kqp,kp->kq", (run.arrived @ POWERS)[index], powers[:, :-1])
        return x, h, np.asarray(problem.speeds(one_sided(problem, times), x.T, h.T)).T

    def _panels_at(self, times: Array, panels: Numbers) -> tuple[LatticeRun, Numbers, Array]:
        """The panels in which times (k,) lie, solved once each; for each time its panel among them, and its place."""
        numbers, index = np.unique(panels, return_inverse=True)
        lattice = self._lattice
        place = 2 * (times - lattice.times(panels)) / lattice.lengths[panels % lattice.size] - 1
        return self._leaps.run(numbers), index, place
