"""The equations of one combination of modes for many variants, with the guards that end these."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.components.branches import ACROSS
from shaftwork.core.errors import CompileError
from shaftwork.hybrid.consistency import (
    CLEAR,
    clear_of_limit,
    drift,
    moved_by_rounding,
    rounding_moves,
    side_of_limit,
    time_scales,
)
from shaftwork.hybrid.hybrid_state import slipping
from shaftwork.hybrid.modes.mode_equations import ModeEquations
from shaftwork.hybrid.modes.mode_machines import ActiveGuard
from shaftwork.sweep.ensemble_equations import EnsembleCode, EnsembleEquations, Mask, ModeNames, Motion, PhaseEntry
from shaftwork.sweep.lane_tables import Met

Course = tuple[Array, Array, Array, Array]
"""Times (k,), states (n, k), their rates, and guards (guards, k)."""


class GuardedEquations(EnsembleEquations):
    """The equations of one combination of modes, with the guards that end these.

    Args:
        code: its programs.
        equations: the equations with their guards.
        modes: the combination.
        base: the parameter vector of a variant, of which sizes are taken.
        names: of the parameters that vary.
        span: start and end of the motion, s.
    """

    def __init__(
        self,
        code: EnsembleCode,
        equations: ModeEquations,
        modes: ModeNames,
        base: Array,
        names: Sequence[str],
        span: tuple[float, float],
    ) -> None:
        super().__init__(code, base, equations.sizes(base), names)
        self.kirchhoff, self.modes, self.sides = equations, modes, equations.sides(modes)
        self._tick, self._longest = time_scales(span)
        self._moves = np.array(rounding_moves(self.sizes.tolist())).T[:, :, None]

    def entered(self, t: Array, x: Array, p: Array) -> PhaseEntry:
        """Whether every guard is on its own side, or on its limit and about to be, as `EventIteration` would find.

        Args:
            t: (k,) s.
            x: (n, k) states.
            p: (parameters, k).
        """
        if not len(self.sides):
            return super().entered(t, x, p)
        rates, now = self.code.motion(t, x, p)
        moved = moved_by_rounding(x, rates, self._moves, self._tick)
        near_rates, near = self.code.motion(t + self._tick, moved, p)
        side, bands, step = self.sides[:, None], np.abs(near - now), self.step(rates)
        excess, turns = side * now, np.zeros(now.shape, dtype=np.intp)
        here, beside = (t, x, rates, now), (t + self._tick, moved, near_rates, near)
        for _ in range(2):  # where nothing moves yet, its acceleration tells
            here, beside = self._later(step, here, p), self._later(step, beside, p)
            drifts = drift(side * (here[3] - now), side * (beside[3] - near), bands)
            turns = np.where(turns == 0, drifts, turns)
        where = side_of_limit(excess, bands)
        beyond = ((where > 0) | ((where == 0) & (turns > 0))) & (self.sides != 0)[:, None]
        count = beyond.sum(axis=0)
        met = np.where(count == 0, Met.NOTHING, np.where(count == 1, beyond.argmax(axis=0), Met.GIVEN_UP))
        return PhaseEntry(met, clear_of_limit(excess, bands))

    def alone(self, guard: int, t: Array, x: Array, p: Array, motion: Motion) -> Mask:
        """(k,) whether a guard is met alone; of several at one instant, it takes more to tell which goes first.

        Two contacts in a row that carry the same torque reach zero together: one of them opens, and the other stays.
        A drive that a brake and its friction stop at once is held by one of them. What slips at rest may hold now.
        """
        others, (near, moving) = self._beside(guard), self._near(guard, t, x, p, motion)
        return np.asarray(moving & self._within(others, motion[1], near).all(axis=0))

    def at_once(self, guard: int, t: Array, x: Array, p: Array, motion: Motion) -> list[tuple[int, Mask]]:
        """The guards that a speed ends together with one, and the lanes (k,) in which they are met, in their order."""
        watched, (near, moving) = self.kirchhoff.watched(self.modes), self._near(guard, t, x, p, motion)
        if not all(active.leave.by_speed for active in watched if active.guard == guard):
            return []
        guards = sorted({guard, *self._beside(guard)}, key=[active.guard for active in watched].index)
        return [(k, moving & ((k == guard) | ~self._within([k], motion[1], near)[0])) for k in guards]

    def _near(self, guard: int, t: Array, x: Array, p: Array, motion: Motion) -> tuple[Array, Mask]:
        """Guards (guards, k) where rounding may have moved a lane, and (k,) whether nothing that slips is at rest."""
        near = self.code.motion(t + self._tick, moved_by_rounding(x, motion[0], self._moves, self._tick), p)[1]
        slips = {k: active for k, active in self._slips.items() if active.guard != guard}
        idle = [active.guard for active in slips.values()]
        held = any(active.leave.by_speed for k, active in slips.items() if k in self.kirchhoff.resting)
        moving = ((motion[1][idle] != 0.0) | (near[idle] != 0.0)).all(axis=0)
        return near, moving & (not held)

    def _within(self, guards: Sequence[int], now: Array, near: Array) -> Mask:
        """(some, k) whether guards are clear of their limits."""
        return np.asarray(self.sides[guards, None] * now[guards] < -CLEAR * np.abs(near - now)[guards])

    @cached_property
    def _slips(self) -> dict[int, ActiveGuard]:
        """The guards that end slipping, by machine."""
        return slipping(self.kirchhoff.machines, self.modes, self.kirchhoff.watched(self.modes))

    def _beside(self, guard: int) -> list[int]:
        """The guards that change what follows another one: of impacts all, of what a torque or a speed ends those."""
        watched, others = self.kirchhoff.watched(self.modes), set[int]()
        for met in (active.leave for active in watched if active.guard == guard):
            others |= {
                active.guard
                for active in watched
                if met.rebound is not None
                or (met.by_torque and active.leave.by_torque)
                or (met.by_speed and active.leave.by_speed)
            }
        return sorted(others - {guard})

    def slip(self, machine: int, guards: Array) -> Array:
        """(k,) the speed across a machine that slips, of which it is a guard.

        Raises:
            CompileError: it is none.
        """
        for active in self.kirchhoff.watched(self.modes):
            if active.machine == machine and active.leave.by_speed:
                return np.asarray(active.side * (1.0 if active.leave.when == ACROSS else -1.0) * guards[active.guard])
        raise CompileError("The speed across what slips is no guard.")

    def taken_up(self, p: Array, stored: Array) -> Array:
        """(n, k) the states that take up all that is stored, (stores, k), with the least change.

        Raises:
            CompileError: they depend on more than on what is stored and on inertias.
        """
        stores, bound = self.kirchhoff.stores, self.kirchhoff.bound(self._base)
        ratios = bound.program.assembly.loops.places | bound.program.assembly.cutsets.places
        if not (stores.by_inertias and ratios.isdisjoint(place for place, _ in self._places)):
            raise CompileError("What is stored goes over to these states in a way of its own for each variant.")
        return stores.taken_up(bound, p[: len(self.code.model.parameters)], stored)

    def step(self, rates: Array) -> Array:
        """(k,) how far in s the further course is looked at; see `Regime.ahead`."""
        with np.errstate(divide="ignore"):
            steps = (self._moves[3] / np.abs(rates)).min(axis=0)
        return np.asarray(np.minimum(self._longest, steps))

    def _later(self, step: Array, course: Course, p: Array) -> Course:
        """A step further along a straight line."""
        t, x, rates, _ = course
        later = x + step * rates
        return t + step, later, *self.code.motion(t + step, later, p)
