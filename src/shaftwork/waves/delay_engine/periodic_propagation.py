"""Very long motions of a lattice under constant inputs: from output to output by powers of the map over many panels."""

from __future__ import annotations

import numpy as np

from shaftwork.integrate.problem import Array
from shaftwork.integrate.smooth_intervals import pieces
from shaftwork.waves.delay_engine.collocation import POWERS, STAGES, STATE_POWERS, squared
from shaftwork.waves.delay_engine.lattice import Lattice, LatticeRun, Numbers
from shaftwork.waves.delay_engine.lines import DelayTrajectory
from shaftwork.waves.delay_engine.waveforms import one_sided

# Periods of the first leap. It is marched, since every rounding of it is doubled with every power.
LEAP = 256
# Motions that are marched side by side, from their leaps' ends to the panels to be read.
SIDE_BY_SIDE = 64


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
        self._length = LEAP * lattice.size
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
        parts = [
            self._panels(np.column_stack(pasts[low : low + SIDE_BY_SIDE]), steps[low : low + SIDE_BY_SIDE])
            for low in range(0, len(panels), SIDE_BY_SIDE)
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
