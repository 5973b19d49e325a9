"""Many variants of one network at once, in lanes of compiled code: the fast way of a sweep.

All variants run through the same phases side by side. Where a lane meets a guard, the mode that this guard leads to is
taken if the motion in it is beyond doubt: what is stored goes over unchanged, and every guard of the new mode is on its
own side or about to be. A variant of which anything else is true is left to `Model.simulate`, which settles it in full.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.state_transfer import StateTransfer
from shaftwork.components.shafts import Shaft
from shaftwork.core.errors import CompileError, NetworkError
from shaftwork.network.graph import GraphPart
from shaftwork.numerics.tolerances import TYPED
from shaftwork.pipeline.model import Model
from shaftwork.results.measures import EXTREMES, POWERS, Measure
from shaftwork.sweep.ensemble_equations import (
    EnsembleCode,
    EnsembleEquations,
    Met,
    ModeNames,
    PhaseEntry,
    VariantGroup,
    joined,
)
from shaftwork.sweep.lane_steps import Index, LaneRun, Mask, Room, Steps, first_rises, largest

FADING = "A law fades to a constant, as exp and tanh do, and a long step might pass over where it changes."


class Ensemble:
    """Measures of many variants of a network.

    Args:
        model: the compiled network.
        names: of the parameters that vary.
        first: a variant, which says how long phases last and how finely a motion is to be looked at.
        measures: what is wanted.
        span: start and end, s.
        rtol: relative tolerance.

    Raises:
        CompileError: variants of this network cannot run side by side; says why.
    """

    def __init__(
        self,
        model: Model,
        names: Sequence[str],
        first: Mapping[str, float],
        measures: Sequence[Measure],
        span: tuple[float, float],
        rtol: float,
    ) -> None:
        self.model, self.names, self.measures = model, tuple(names), tuple(measures)
        self.span, self.rtol = span, rtol
        self.first = dict(first)
        self._equations: dict[ModeNames, EnsembleEquations | str] = {}
        self._codes: dict[Model, EnsembleCode] = {}
        self.room = Room()
        self._refuse()
        self.start = self._first_modes(first)
        """The modes in which the first variant starts."""
        if self.equations(self.start) is None:
            raise CompileError(self._equations[self.start])

    def _refuse(self) -> None:
        form, model = self.model.form, self.model
        if model.rows is None or form.waves or form.loop_laws or not form.states:
            raise CompileError("The network is too large, holds waves, or has a nonlinear law at a massless node.")
        times = model.switching.timeline(model.defaults, *self.span, modes=False).stops
        if form.doubtful:
            raise CompileError("Whether an inertia that changes stays above zero is seen in the motion of one variant.")
        if form.has_impulses or form.across_sources or times:
            raise CompileError("A source switches, jumps or has a pulse at a time of its own.")
        if not {*form.graph.zeros, *form.tree.frozen}.isdisjoint(self.names):
            raise CompileError("A parameter that varies decides which equations hold.")
        if any(isinstance(part.component, Shaft) for part in self._varied):
            raise CompileError("A parameter of a shaft varies, which may change its model.")
        if unknown := [measure for measure in self.measures if measure.kind not in (*EXTREMES, *POWERS, "end")]:
            raise CompileError(f"'{unknown[0]}' is read from the motion of one variant.")

    @property
    def _varied(self) -> list[GraphPart]:
        """Parts of which a parameter varies."""
        owners = {name.rpartition(".")[0] for name in self.names}
        return [part for part in self.model.form.graph.parts if part.name in owners]

    def alike(self, columns: Array) -> Mask:
        """(k,) whether the equations of the network hold for variants: none has a new zero, or ratios that meet."""
        same = (columns != 0.0).all(axis=0)
        if any(part.component.role == "coupling" for part in self._varied):
            assembly, model = self.model.arrays.assembly, self.model
            for lane, column in enumerate(columns.T.tolist()):
                same[lane] &= not assembly.degenerates(model.vector(dict(zip(self.names, column, strict=True))))
        return np.asarray(same)

    def _first_modes(self, values: Mapping[str, float]) -> ModeNames:  # noqa: ARG002
        """The modes in which a variant starts."""
        return ()

    def starts_alike(self, column: Array) -> bool:
        """Whether the values (names,) of the parameters that vary leave the modes at the start as they are."""
        return self._first_modes(dict(zip(self.names, column.tolist(), strict=True))) == self.start

    def equations(self, modes: ModeNames) -> EnsembleEquations | None:
        """The equations of a combination of modes, or None where variants cannot run side by side in them."""
        if modes not in self._equations:
            try:
                self._equations[modes] = self._equations_in(modes)
            except (CompileError, NetworkError) as error:
                self._equations[modes] = str(error)
        equations = self._equations[modes]
        return None if isinstance(equations, str) else equations

    def _equations_in(self, modes: ModeNames) -> EnsembleEquations:  # noqa: ARG002
        """The equations of a combination of modes.

        Raises:
            CompileError: variants cannot run side by side in them.
            NetworkError: they contradict each other.
        """
        model, base = self.model, self.model.vector(self.first)
        prepared = model.prepare(base)
        bound = prepared.symbolic()
        code = self.code_of(model, None if bound is None else bound.program, StateTransfer(model.form))
        return EnsembleEquations(code, base, prepared.atol.tolist(), self.names)

    def code_of(self, model: Model, program: Any, stores: StateTransfer) -> EnsembleCode:
        """The programs of a set of equations, which several combinations of modes may share.

        Raises:
            CompileError: variants cannot run side by side in them.
        """
        if model not in self._codes:
            if program is not None and program.fading:
                raise CompileError(FADING)
            self._codes[model] = EnsembleCode(model, program, stores, self.measures)
        return self._codes[model]

    def run(self, columns: Array) -> tuple[Array, Mask]:
        """Measures of variants.

        Args:
            columns: (names, k) values of the parameters that vary.

        Returns:
            (measures, k), and (k,) whether a variant has come to its end here; of the others nothing is known.
        """
        return _VariantCourse(self, columns).go()

    @property
    def decisive(self) -> bool:
        """Whether a parameter that varies decides in which mode a motion starts."""
        return False

    def after(self, group: VariantGroup, guard: int, p: Array) -> list[tuple[ModeNames, Mask]]:  # noqa: ARG002
        """The modes to which a guard leads by itself, and the lanes (k,) that go there; there is no guard."""
        return []


class _VariantCourse:
    """The way of some variants through their phases."""

    def __init__(self, ensemble: Ensemble, columns: Array) -> None:
        self.ensemble, self.columns = ensemble, columns
        count = columns.shape[1]
        kinds = [measure.kind for measure in ensemble.measures]
        starts = {"max": -np.inf, "min": -np.inf, "peak": -np.inf}
        self.values = np.array([np.full(count, starts.get(kind, 0.0)) for kind in kinds]).reshape(len(kinds), count)
        self.done = np.zeros(count, dtype=bool)

    def go(self) -> tuple[Array, Mask]:
        """Through all of it."""
        waiting = self._begin()
        with np.errstate(all="ignore"):  # a lane that runs away is left to `simulate`
            for _ in range(200):  # stretches up to a change of mode
                if not waiting:
                    break
                waiting = [following for group in joined(waiting) for following in self._stretch(group)]
        return self._results(), self.done

    def _begin(self) -> list[VariantGroup]:
        ensemble = self.ensemble
        equations = ensemble.equations(ensemble.start)
        assert equations is not None  # noqa: S101 (checked when it was made)
        lanes = np.flatnonzero(ensemble.alike(self.columns))
        if ensemble.decisive:
            lanes = lanes[[ensemble.starts_alike(column) for column in self.columns[:, lanes].T]]
        size = len(equations.code.model.states)
        return [
            VariantGroup(ensemble.start, lanes, np.full(lanes.size, ensemble.span[0]), np.zeros((size, lanes.size)))
        ]

    def _stretch(self, group: VariantGroup) -> list[VariantGroup]:
        """Up to the next change of mode in each lane; the groups that go on from there."""
        equations = self.ensemble.equations(group.modes)
        if equations is None or not group.lanes.size:
            return []
        p = equations.parameters(self.columns[:, group.lanes])
        group, p, entry = _consistent(group, p, equations.entered(group.t, group.x, p))
        if not group.lanes.size:
            return []
        ends = self._followed(equations, group, p, entry)
        over = ends.met == Met.THE_END
        self._end(equations, ends.group, p, over)
        following = []
        for guard in np.unique(ends.met[ends.met >= 0]).tolist():
            following += self._changed(equations, ends.group.some(ends.met == guard), guard)
        return following

    def _followed(self, equations: EnsembleEquations, group: VariantGroup, p: Array, entry: PhaseEntry) -> _Ends:
        """Lanes up to their guards or the end of the motion."""
        span, code, size = self.ensemble.span, equations.code, len(group.x)
        rates = code.motion(group.t, group.x, p)[0]
        limits = span[1], (span[1] - span[0]) / 50  # the longest step
        run = LaneRun(
            code.step, self.ensemble.room, group.x, rates, group.t, p, equations.sizes, limits, self.ensemble.rtol
        )
        ends = _Ends(replace(group, t=group.t.copy(), x=group.x.copy()), np.full(group.lanes.size, Met.A_LIMIT))
        while run.lanes.size:
            lanes = run.lanes
            steps, good = run.go()
            met, rows = _met(equations, entry.offsets[:, lanes], steps)
            rows = np.where(met >= 0, rows, steps.last)
            good |= met >= 0
            met[good & (met < 0) & (rows[-2] >= span[1])] = Met.THE_END
            self._measure(equations, steps, group.lanes[lanes], good, met >= 0)
            done = good & (met != Met.NOTHING)
            there = lanes[done]
            ends.met[there], ends.group.t[there], ends.group.x[:, there] = met[done], rows[-2, done], rows[:size, done]
            for row, place in code.integral_of.items():
                self.values[row, group.lanes[there]] += rows[size + place, done]
            run.keep(good & ~done, steps)
        return ends

    def _changed(self, before: EnsembleEquations, group: VariantGroup, guard: int) -> list[VariantGroup]:
        """Past a guard: what is stored goes over to the equations that follow, where it goes over unchanged."""
        p = before.parameters(self.columns[:, group.lanes])
        stored, groups = before.code.stored(group.t, group.x, p), []
        for modes, there in self.ensemble.after(group, guard, p):
            after = self.ensemble.equations(modes)
            if after is None or not after.leaves_behind(before, guard):
                continue
            t, old, x = group.t[there], stored[:, there], stored[after.code.state_rows][:, there]
            parameters = after.parameters(self.columns[:, group.lanes[there]])
            new, same = after.code.stored(t, x, parameters), np.ones(t.size, dtype=bool)
            for kind in after.code.kinds:
                size = np.maximum(np.abs(old[kind]).max(axis=0, initial=0.0), 1.0)
                same &= (np.abs(new[kind] - old[kind]) <= TYPED * size).all(axis=0)
            groups.append(VariantGroup(modes, group.lanes[there], t, x).some(same))
        return groups

    def _measure(self, equations: EnsembleEquations, steps: Steps, lanes: Index, good: Mask, ended: Mask) -> None:
        """What some steps of lanes (k,) add to the extremes: of those that go well, and those that end at a guard."""
        for row, measure in enumerate(self.ensemble.measures):
            for sign in EXTREMES.get(measure.kind, ()):
                number = equations.code.extreme(row)
                near = np.flatnonzero((steps.reach(number, sign) > self.values[row, lanes]) | ended)
                if not near.size:
                    continue
                quantity = _Quantity(steps, equations.code.step.jet(number), sign, 0.0, near)
                tops = largest(quantity.t, quantity.jets, self.values[row, lanes[near]], quantity.at)
                self.values[row, lanes[near]] = np.where(good[near], tops, self.values[row, lanes[near]])

    def _end(self, equations: EnsembleEquations, group: VariantGroup, p: Array, over: Mask) -> None:
        """The variants that have come to the end of their motion."""
        self.done[group.lanes[over]] = True
        if any(measure.kind == "end" for measure in self.ensemble.measures) and over.any():
            shown = equations.code.shown(group.t[over], group.x[:, over], p[:, over])
            for row, measure in enumerate(self.ensemble.measures):
                if measure.kind == "end":
                    self.values[row, group.lanes[over]] = shown[row]

    def _results(self) -> Array:
        duration = self.ensemble.span[1] - self.ensemble.span[0]
        values = self.values + 0.0  # without zeros of the other sign
        for row, measure in enumerate(self.ensemble.measures):
            if measure.kind == "min":
                values[row] = 0.0 - values[row]
            elif measure.kind in ("mean", "rms"):
                values[row] /= duration
                values[row] = np.sqrt(np.maximum(values[row], 0.0)) if measure.kind == "rms" else values[row]
        self.done &= np.isfinite(values).all(axis=0)
        return values


@dataclass(frozen=True, eq=False)
class _Ends:
    """Where lanes have come to.

    Args:
        group: the lanes with their times and states there.
        met: (k,) the guard that each has met, THE_END at the end of the motion, or A_LIMIT.
    """

    group: VariantGroup
    met: Index


def _met(equations: EnsembleEquations, offsets: Array, steps: Steps) -> tuple[Index, Array]:
    """(k,) the guard that each lane meets first, or NOTHING, and the rows (rows, k) there, where it then stays."""
    met, first = np.full(steps.t.shape[1], Met.NOTHING), np.full(steps.t.shape[1], np.inf)
    at, rows = np.zeros(met.size, dtype=np.intp), np.zeros_like(steps.last)
    for guard in equations.watched.tolist():
        number, side = equations.code.guard(guard), float(equations.sides[guard])
        near = np.flatnonzero(steps.reach(number, side) > offsets[guard])
        if not near.size:
            continue
        quantity = _Quantity(steps, equations.code.step.jet(number), side, offsets[guard, near], near)
        rises = first_rises(quantity.t, quantity.jets, quantity.at)
        earlier = rises.t < first[near]
        columns = near[earlier]
        met[columns], first[columns], at[columns] = guard, rises.t[earlier], rises.at[earlier]
    columns = np.flatnonzero(met >= 0)
    if columns.size:
        shown, start = np.empty((len(steps.jets), met.size)), np.full(met.size, len(steps.t))
        rows[:, columns], shown[:, columns] = steps.at(at[columns], columns, first[columns])
        start[columns] = at[columns]
        steps.cut(start, first, shown)
    return met, rows


class _Quantity:
    """What steps show at a place, times a sign and less offsets, in some lanes.

    Args:
        steps: of all lanes.
        place: of the jet.
        sign: 1 or -1.
        offsets: (k,), or one for all.
        lanes: (k,).
    """

    def __init__(self, steps: Steps, place: slice, sign: float, offsets: Array | float, lanes: Index) -> None:
        self._steps, self._place, self._sign, self._lanes = steps, place, sign, lanes
        self._offsets = np.broadcast_to(offsets, lanes.size)
        columns = lanes if lanes.size < steps.t.shape[1] else slice(None)
        self.t: Array = steps.t[:, columns]
        """(m, k) times of the samples, s."""
        self.jets: Array = sign * steps.jets[place][:, :, columns]
        """(3, m, k) values and their first two derivatives by time."""
        self.jets[0] -= self._offsets

    def at(self, start: Index, columns: Index, t: Array) -> Array:
        """(3, c) jets at times (c,) in s, from samples (c,) of the lanes (c,)."""
        jet = np.array(self._sign * self._steps.at(start, self._lanes[columns], t)[1][self._place])
        jet[0] -= self._offsets[columns]
        return jet


def _consistent(group: VariantGroup, p: Array, entry: PhaseEntry) -> tuple[VariantGroup, Array, PhaseEntry]:
    """Those of a group whose modes are consistent with their motion."""
    if entry.good.all():
        return group, p, entry
    on = entry.good
    return group.some(on), p[:, on], PhaseEntry(on[on], entry.offsets[:, on])
