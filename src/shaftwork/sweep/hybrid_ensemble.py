"""Many variants side by side of a network whose parts change their mode: the guards, and where they lead."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import cast

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.hybrid.consistency import (
    clear_of_limit,
    drift,
    moved_by_rounding,
    rounding_moves,
    side_of_limit,
    time_scales,
)
from shaftwork.hybrid.equation_sets import EquationSets
from shaftwork.hybrid.event_iteration import EventIteration
from shaftwork.hybrid.hybrid_model import HybridModel
from shaftwork.hybrid.modes.mode_equations import ModeEquations
from shaftwork.hybrid.modes.mode_machines import with_modes
from shaftwork.hybrid.modes.starts import conditional
from shaftwork.sweep.ensemble import Ensemble
from shaftwork.sweep.ensemble_equations import (
    EnsembleCode,
    EnsembleEquations,
    Mask,
    ModeNames,
    PhaseEntry,
    VariantGroup,
)
from shaftwork.sweep.lane_tables import Met

Course = tuple[Array, Array, Array, Array]
"""Times (k,), states (n, k), their rates, and guards (guards, k)."""


class HybridEnsemble(Ensemble):
    """Measures of many variants of a network whose parts change their mode; see `Ensemble`."""

    @property
    def _equation_sets(self) -> EquationSets:
        return cast("HybridModel", self.model).equation_sets

    def _first_modes(self, values: Mapping[str, float]) -> ModeNames:
        equations, p = self._equation_sets.first_equations(values)
        return equations.first_modes(self.span[0], np.zeros(len(equations.model.states)), p)

    def _settled(self, values: Mapping[str, float]) -> ModeNames:
        equations, _ = self._equation_sets.first_equations(values)
        events = EventIteration(self._equation_sets, values, self.span)
        return events.started(self.span[0], np.zeros(len(equations.model.states))).regime.modes

    def _equations_in(self, modes: ModeNames) -> EnsembleEquations:
        equations = self._equation_sets.of(modes)
        code = self.code_of(equations.model, equations.expressions, equations.stores)
        base = equations.vector(self.first, self._equation_sets.numbers(modes))
        return GuardedEquations(code, equations, modes, base, self.names, self.span)

    @cached_property
    def decisive(self) -> bool:
        """Whether a parameter that varies decides in which mode a motion starts."""
        symbols = {
            f"{machine.part.name}.{symbol.name}"
            for machine in self._equation_sets.machines
            for symbol in conditional(machine.modes)
        }
        return not symbols.isdisjoint(self.names)

    def after(self, group: VariantGroup, guard: int, p: Array) -> list[tuple[ModeNames, Mask]]:
        """The modes to which a guard leads by itself, and the lanes (k,) that go there."""
        equations = self._equation_sets.of(group.modes)
        met = [active for active in equations.watched(group.modes) if active.guard == guard]
        if len(met) != 1 or met[0].leave.rebound is not None:
            return []
        crossed, number, count = met[0], met[0].machine, group.lanes.size
        names = [crossed.leave.to] * count
        if not crossed.leave.to:
            before, parameters = group.modes[number], p[: len(equations.model.parameters)]
            starts = zip(group.t.tolist(), group.x.T, parameters.T, strict=True)
            names = [equations.start_of(number, before, *start) for start in starts]
        targets = dict.fromkeys(names)
        return [(with_modes(group.modes, {number: to}), np.array([name == to for name in names])) for to in targets]


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
        self.sides = equations.sides(modes)
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
        side, bands, step = self.sides[:, None], np.abs(near - now), self._step(rates)
        excess, turns = side * now, np.zeros(now.shape, dtype=np.intp)
        here, beside = (t, x, rates, now), (t + self._tick, moved, near_rates, near)
        for _ in range(2):  # where nothing moves yet, its acceleration tells
            here, beside = self._later(step, here, p), self._later(step, beside, p)
            drifts = drift(side * (here[3] - now), side * (beside[3] - near), bands)
            turns = np.where(turns == 0, drifts, turns)
        where = side_of_limit(excess, bands)
        beyond = ((where > 0) | ((where == 0) & (turns > 0))) & (self.sides != 0)[:, None]
        count = beyond.sum(axis=0)
        met = np.where(count == 0, Met.NOTHING, np.where(count == 1, beyond.argmax(axis=0), Met.A_LIMIT))
        return PhaseEntry(met, clear_of_limit(excess, bands))

    def _step(self, rates: Array) -> Array:
        """(k,) how far in s the further course is looked at; see `Regime.ahead`."""
        with np.errstate(divide="ignore"):
            steps = (self._moves[3] / np.abs(rates)).min(axis=0)
        return np.asarray(np.minimum(self._longest, steps))

    def _later(self, step: Array, course: Course, p: Array) -> Course:
        """A step further along a straight line."""
        t, x, rates, _ = course
        later = x + step * rates
        return t + step, later, *self.code.motion(t + step, later, p)
