"""Many variants side by side of a network whose parts change their mode: the guards, and where they lead."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import cast

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.core.errors import CompileError, ShaftworkError
from shaftwork.hybrid.equation_sets import EquationSets
from shaftwork.hybrid.event_iteration import EventIteration
from shaftwork.hybrid.hybrid_model import HybridModel
from shaftwork.hybrid.hybrid_state import HybridState
from shaftwork.hybrid.modes.mode_machines import with_modes
from shaftwork.hybrid.modes.starts import conditional
from shaftwork.sweep.ensemble import Ensemble
from shaftwork.sweep.ensemble_equations import (
    EnsembleEquations,
    Mask,
    ModeNames,
    PhaseEntry,
    VariantGroup,
)
from shaftwork.sweep.switching.guarded_equations import GuardedEquations
from shaftwork.sweep.switching.impact_lanes import LaneImpact, hits_alone


class HybridEnsemble(Ensemble):
    """Measures of many variants of a network whose parts change their mode; see `Ensemble`."""

    @cached_property
    def _impacts(self) -> dict[tuple[ModeNames, int], LaneImpact | None]:
        """By modes and guard what is hit there, if it can be followed side by side."""
        return {}

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

    def apart(self, columns: Array) -> Mask:
        sets, count = self._equation_sets, columns.shape[1]
        rigid = [
            active.machine for active in sets.of(sets.first).watched(sets.first) if active.leave.rebound is not None
        ]
        if not rigid:
            return super().apart(columns)
        loose = with_modes(self.start, {number: sets.first[number] for number in rigid})
        if not isinstance(equations := self.equations(loose), GuardedEquations):
            return np.ones(count, dtype=bool)
        values = {**self.model.parameters, **self.first}
        p = equations.parameters(np.column_stack([columns, [values[name] for name in self.names]]))
        x = np.zeros((len(equations.code.model.states), count + 1))
        _, guards = equations.code.motion(np.full(count + 1, self.span[0]), x, p)
        limits = [active for active in equations.kirchhoff.watched(loose) if active.leave.rebound is not None]
        excess = np.array([active.side * guards[active.guard] for active in limits])
        lanes, first = excess[:, :-1], excess[:, -1:]
        return np.asarray(np.where(first < 0.0, lanes > 0.0, lanes != first).any(axis=0))

    @cached_property
    def decisive(self) -> bool:
        """Whether a parameter that varies decides in which mode a motion starts."""
        symbols = {
            f"{machine.part.name}.{symbol.name}"
            for machine in self._equation_sets.machines
            for symbol in conditional(machine.modes)
        }
        return not symbols.isdisjoint(self.names)

    def struck(self, group: VariantGroup, guard: int, columns: Array) -> list[VariantGroup]:
        """Past a guard that is that of a rigid contact: the lanes in which what follows is beyond doubt."""
        key = group.modes, guard
        if key not in self._impacts:
            self._impacts[key] = self._impact(*key)
        impact = self._impacts[key]
        try:
            return [] if impact is None else impact.follow(group, columns)
        except CompileError:
            self._impacts[key] = None
            return []

    def _impact(self, modes: ModeNames, guard: int) -> LaneImpact | None:
        equations = self._guarded(modes)
        met = [active for active in equations.kirchhoff.watched(modes) if active.guard == guard]
        alone = len(met) == 1 and hits_alone(equations, met[0])
        return LaneImpact(equations, met[0], self._guarded) if alone else None

    def _guarded(self, modes: ModeNames) -> GuardedEquations:
        """The equations of a combination of modes in which variants are followed.

        Raises:
            CompileError: they cannot run side by side in them.
        """
        equations = self.equations(modes)
        if not isinstance(equations, GuardedEquations):
            raise CompileError(str(self._equations[modes]))
        return equations

    def settled(self, one: VariantGroup, values: Array, after: float, entry: PhaseEntry) -> VariantGroup | None:
        """A lane past what it has met, as the event iteration of a single run has it."""
        named = dict(zip(self.names, values.tolist(), strict=True))
        events, met = EventIteration(self._equation_sets, named, self.span), int(entry.met[0])
        before = HybridState(events.transfer.regime(one.modes), one.x[:, 0], entry.offsets[:, 0].tolist())
        try:
            state, _ = events.run(float(one.t[0]), float(after), before, None if met < 0 else met)
        except ShaftworkError:  # which the run of this variant will tell
            return None
        return one.going_on(state.regime.modes, one.t, state.x[:, None], settled=True)

    def after(self, group: VariantGroup, guard: int, p: Array) -> list[tuple[ModeNames, Mask]]:
        """The modes to which a guard leads by itself, and the lanes (k,) that go there."""
        equations = self._equation_sets.of(group.modes)
        met = [active for active in equations.watched(group.modes) if active.guard == guard]
        if len(met) != 1 or met[0].leave.rebound is not None:
            return []
        crossed, number = met[0], met[0].machine
        names = [crossed.leave.to] * group.lanes.size if crossed.leave.to else self._anew(group, number, p)
        targets = dict.fromkeys(name for name in names if name)
        return [(with_modes(group.modes, {number: to}), np.array([name == to for name in names])) for to in targets]

    def _anew(self, group: VariantGroup, number: int, p: Array) -> list[str]:
        """The mode of a machine in which each lane would start now, empty for none; see `mode_anew`."""
        equations, before = self._equation_sets.of(group.modes), group.modes[number]
        guarded, parameters = self._guarded(group.modes), p[: len(equations.model.parameters)].T
        rates, _ = guarded.code.motion(group.t, group.x, p)
        late = guarded.step(rates)
        now, later = zip(group.t, group.x.T, strict=True), zip(group.t + late, (group.x + late * rates).T, strict=True)
        return [
            next((name for t, x in points if (name := equations.start_of(number, before, float(t), x, values))), "")
            for points, values in zip(zip(now, later, strict=True), parameters, strict=True)
        ]
