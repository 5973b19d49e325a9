"""Many variants of one network at once, in lanes of compiled code: the fast way of a sweep.

Each variant has its own times and modes; those in the same modes are followed together. Where one meets a guard, the
mode that this guard leads to is taken if the motion in it is beyond doubt: what is stored goes over unchanged, or a
rigid contact is hit alone, and every guard of the new mode is on its own side or about to be. Of anything else the
event iteration of a single run tells what follows, for this lane alone. A variant that is stiff, or that comes to no
end, is left to `Model.simulate`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from sympy import Expr

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.state_transfer import StateTransfer
from shaftwork.components.shafts import Shaft
from shaftwork.core.errors import CompileError, NetworkError, as_reason
from shaftwork.network.graph import GraphPart
from shaftwork.numerics.tolerances import TYPED
from shaftwork.pipeline.model import Model
from shaftwork.results.measures import EXTREMES, POWERS, Measure
from shaftwork.sweep.ensemble_equations import (
    EnsembleCode,
    EnsembleEquations,
    Mask,
    ModeNames,
    PhaseEntry,
    Texts,
    VariantGroup,
    joined,
)
from shaftwork.sweep.lane_program import LaneProgram, lane_program
from shaftwork.sweep.lane_tables import LaneCourse, LaneEnd, Met

STIFF = "it is stiff or swings very often, or its peaks are too many to be told apart"
NO_END = "a law drives it back to its jump, or its modes change without end"
OTHER_START = "it starts at or beyond a rigid limit, or in other modes than the first one"
ZERO = "it has a zero where others have none, or ratios that meet"
NO_MODES = "what follows an instant is told by its own run"
INFINITE = "a measure of it is no finite number"
MOST_STRETCHES, MOST_SWITCHES = 2000, 200
"""Changes of mode and switches of laws of one variant; where there are more, a run of its own says what is wrong."""


class Ensemble:
    """Measures of many variants of a network.

    Args:
        model: the compiled network.
        names: of the parameters that vary.
        first: a variant, which gives the nominal sizes of the states and the modes in which all start.
        measures: what is wanted.
        span: start and end, s.
        rtol: relative tolerance.
        program: makes the programs, on which device; arguments as for `LaneProgram`.

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
        program: Callable[..., LaneProgram] = lane_program,
    ) -> None:
        self._program = program
        self.model, self.names, self.measures = model, tuple(names), tuple(measures)
        self.span, self.rtol = span, rtol
        self.first = dict(first)
        self._equations: dict[ModeNames, EnsembleEquations | str] = {}
        self._codes: dict[Model, EnsembleCode] = {}
        self._refuse()
        self.start = self._settled(first)
        """The modes in which the first variant starts."""
        if self.equations(self.start) is None:
            raise CompileError(self._equations[self.start])

    def _refuse(self) -> None:
        form, model = self.model.form, self.model
        if model.rows is None or form.waves or form.loop_laws or not form.states:
            raise CompileError("The network is too large, holds waves, or has a nonlinear law at a massless node.")
        if form.doubtful:
            raise CompileError("Whether an inertia that changes stays above zero is seen in the motion of one variant.")
        if form.has_impulses or form.across_sources:
            raise CompileError("A speed is prescribed, or a source has impulses.")
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
        """The modes in which a variant is before anything has moved."""
        return ()

    def _settled(self, values: Mapping[str, float]) -> ModeNames:
        """The modes that go on where a variant starts."""
        return self._first_modes(values)

    def starts_alike(self, column: Array) -> bool:
        """Whether the values (names,) of the parameters that vary leave the modes at the start as they are."""
        return self._first_modes(dict(zip(self.names, column.tolist(), strict=True))) == self._first_modes(self.first)

    def equations(self, modes: ModeNames) -> EnsembleEquations | None:
        """The equations of a combination of modes, or None where variants cannot run side by side in them."""
        if modes not in self._equations:
            try:
                self._equations[modes] = self._equations_in(modes)
            except (CompileError, NetworkError) as error:
                self._equations[modes] = str(error)
        equations = self._equations[modes]
        return None if isinstance(equations, str) else equations

    def objection(self, modes: ModeNames) -> str:
        """Why variants cannot run side by side in a combination of modes; empty where they can."""
        equations = self._equations[modes]
        return as_reason(equations) if isinstance(equations, str) else ""

    def _equations_in(self, modes: ModeNames) -> EnsembleEquations:  # noqa: ARG002
        """The equations of a combination of modes.

        Raises:
            CompileError: variants cannot run side by side in them.
            NetworkError: they contradict each other.
        """
        model, base = self.model, self.model.vector(self.first)
        code = self.code_of(model, (), StateTransfer(model.form))
        return EnsembleEquations(code, base, model.prepare(base).atol.tolist(), self.names)

    def code_of(self, model: Model, guards: Sequence[Expr], stores: StateTransfer) -> EnsembleCode:
        """The program of a set of equations, which several combinations of modes may share.

        Raises:
            CompileError: variants cannot run side by side in them.
        """
        if model not in self._codes:
            self._codes[model] = EnsembleCode(model, guards, stores, self.measures, self._program)
        return self._codes[model]

    def run(self, columns: Array) -> tuple[Array, Texts]:
        """Measures of variants.

        Args:
            columns: (names, k) values of the parameters that vary.

        Returns:
            (measures, k), and (k,) texts: why a variant has not come to its end here, empty where it has.
        """
        return _VariantCourse(self, columns).go()

    def apart(self, columns: Array) -> Mask:
        """(k,) whether variants start beyond a rigid limit, or not at one where the first does: they run alone."""
        return np.zeros(columns.shape[1], dtype=bool)

    @property
    def decisive(self) -> bool:
        """Whether a parameter that varies decides in which mode a motion starts."""
        return False

    def struck(self, group: VariantGroup, guard: int, columns: Array) -> list[VariantGroup]:  # noqa: ARG002
        """Past a guard that is that of a rigid contact: the lanes in which what follows is beyond doubt."""
        return []

    def settled(self, one: VariantGroup, values: Array, after: float, entry: PhaseEntry) -> VariantGroup | None:  # noqa: ARG002
        """A lane past what it has met, or None where it is better off alone.

        Args:
            one: a group of this lane alone.
            values: (names,) of the parameters that vary.
            after: a time just behind the instant, s.
            entry: what it has met, as of this lane.
        """
        return None

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
        self._extreme = np.array([kind in EXTREMES for kind in kinds], dtype=bool)
        self._left = np.full(count, NO_END, dtype=object)
        """Why each of them is left to a run of its own."""
        self._switched = np.zeros(count, dtype=np.intp)

    def go(self) -> tuple[Array, Texts]:
        """Through all of it."""
        waiting = self._begin()
        with np.errstate(all="ignore"):  # a lane that runs away is left to `simulate`
            for _ in range(MOST_STRETCHES):
                if not waiting:
                    break
                waiting = [following for group in joined(waiting) for following in self._stretch(group)]
        return self._results(), self._left

    def _begin(self) -> list[VariantGroup]:
        ensemble = self.ensemble
        equations = ensemble.equations(ensemble.start)
        assert equations is not None  # noqa: S101 (checked when it was made)
        alike, apart = ensemble.alike(self.columns), ensemble.apart(self.columns)
        self._left[apart], self._left[~alike] = OTHER_START, ZERO
        lanes = np.flatnonzero(alike & ~apart)
        if ensemble.decisive:
            same = np.array([ensemble.starts_alike(column) for column in self.columns[:, lanes].T], dtype=bool)
            self._left[lanes[~same]], lanes = OTHER_START, lanes[same]
        size = len(equations.code.model.states)
        return [
            VariantGroup(
                ensemble.start,
                lanes,
                np.full(lanes.size, ensemble.span[0]),
                np.zeros((size, lanes.size)),
                np.zeros(lanes.size),
                np.zeros(lanes.size, dtype=bool),
            )
        ]

    def _stretch(self, group: VariantGroup) -> list[VariantGroup]:
        """Up to the next change of mode, or instant at which a law jumps; the groups that go on from there."""
        equations = self.ensemble.equations(group.modes)
        if equations is None or not group.lanes.size:
            self._left[group.lanes] = self.ensemble.objection(group.modes)
            return []
        p, program = equations.parameters(self.columns[:, group.lanes]), equations.code.program
        begin, ends, highs = equations.pieces(group.t, p, self.ensemble.span)
        entry = equations.entered(begin, group.x, p).but(group.settled)
        nothing = np.zeros_like(entry.offsets)  # what contradicts modes at once is beyond its limit, whatever that is
        following = self._past_guards(equations, group, begin, PhaseEntry(entry.met, nothing))
        on = entry.met == Met.NOTHING
        group, p = group.some(on), p[:, on]
        course = self._course(equations, group, p, entry.some(on), (begin[on], ends[on], highs[on]))
        end = program.follow(course, equations.sizes, self.ensemble.rtol, self.ensemble.span)
        return [*following, *self._after(equations, group, course, entry.some(on), end)]

    def _after(
        self, equations: EnsembleEquations, group: VariantGroup, course: LaneCourse, entry: PhaseEntry, end: LaneEnd
    ) -> list[VariantGroup]:
        """Take what a stretch tells into the measures; the groups that go on."""
        program = equations.code.program
        for row, place in enumerate(program.integrated):
            self.values[place, group.lanes] += end.integrals[row]
        self.values[:, group.lanes] = np.where(self._extreme[:, None], end.best, self.values[:, group.lanes])
        there, met = replace(group.going_on(group.modes, end.t, end.x), steps=end.steps), end.met
        over = (met == Met.THE_END) & (end.t >= self.ensemble.span[1])
        self._left[group.lanes] = np.where(met == Met.GIVEN_UP, STIFF, NO_END)
        self._end(equations, there, course, over)
        self._switched[group.lanes[met >= program.guards]] += 1
        switched = (met >= program.guards) & (self._switched[group.lanes] < MOST_SWITCHES)
        onward = (met == Met.THE_END) & ~over | switched  # in the same modes
        ended = np.where((met >= 0) & (met < program.guards), met, Met.NOTHING)
        past = self._past_guards(equations, there, end.t, PhaseEntry(ended, entry.offsets))
        return [there.some(onward), *past]

    def _past_guards(
        self, equations: EnsembleEquations, group: VariantGroup, after: Array, entry: PhaseEntry
    ) -> list[VariantGroup]:
        """Past the guards that lanes have met, where they have met one: one by one where that takes more to tell."""
        groups = [
            new
            for guard in np.unique(entry.met[entry.met >= 0]).tolist()
            for new in self._past(equations, group.some(entry.met == guard), guard)
        ]
        changed = np.isin(group.lanes, [lane for new in groups for lane in new.lanes])
        for k in np.flatnonzero((entry.met != Met.NOTHING) & ~changed):
            one, values = np.array([k]), self.columns[:, group.lanes[k]]
            new = self.ensemble.settled(group.some(one), values, after[k], entry.some(one))
            self._left[group.lanes[one]] = NO_MODES if new is None else NO_END
            groups += [] if new is None else [new]
        return groups

    def _course(
        self, equations: EnsembleEquations, group: VariantGroup, p: Array, entry: PhaseEntry, pieces: Sequence[Array]
    ) -> LaneCourse:
        """The lanes as they begin."""
        program, count = equations.code.program, group.lanes.size
        sides, offsets = np.zeros((2, program.guards + program.switches, count))
        if len(equations.sides):
            sides[: program.guards], offsets[: program.guards] = equations.sides[:, None], entry.offsets
        begin, ends, highs = pieces
        best = self.values[:, group.lanes]
        return LaneCourse(begin, group.x, p, ends, highs, sides, offsets, best, group.steps)

    def _past(self, equations: EnsembleEquations, group: VariantGroup, guard: int) -> list[VariantGroup]:
        """Past a guard, the lanes in which what follows is beyond doubt."""
        p = equations.parameters(self.columns[:, group.lanes])
        here = equations.code.program.points(group.t, group.x, p)
        instant = group.t, group.x, p, (here["rates"], here["guards"])
        alone, stored = equations.alone(guard, *instant), here["stored"]
        groups, left = list[VariantGroup](), ~alone
        if alone.any():
            some = group.some(alone)
            groups = self.ensemble.struck(some, guard, self.columns[:, some.lanes])
            groups = groups or self._changed(equations, some, guard, (p[:, alone], stored[:, alone]))
        for first, there in equations.at_once(guard, *instant) if left.any() else ():
            on = left & there
            for new in self._changed(equations, group.some(on), first, (p[:, on], stored[:, on])):
                groups.append(new.some(self._consistent(new)))
                left &= ~np.isin(group.lanes, groups[-1].lanes)
        return groups

    def _consistent(self, group: VariantGroup) -> Mask:
        """(k,) whether nothing more is met at this instant."""
        equations = self.ensemble.equations(group.modes)
        assert equations is not None  # noqa: S101 (a group has come there)
        p = equations.parameters(self.columns[:, group.lanes])
        begin, *_ = equations.pieces(group.t, p, self.ensemble.span)
        return np.asarray(equations.entered(begin, group.x, p).met == Met.NOTHING)

    def _changed(
        self, before: EnsembleEquations, group: VariantGroup, guard: int, of_lanes: tuple[Array, Array]
    ) -> list[VariantGroup]:
        """Past a guard: what is stored goes over to the equations that follow, where it goes over unchanged."""
        (p, stored), groups = of_lanes, list[VariantGroup]()
        for modes, there in self.ensemble.after(group, guard, p):
            after = self.ensemble.equations(modes)
            if after is None or not after.leaves_behind(before, guard):
                continue
            t, old, x = group.t[there], stored[:, there], stored[after.code.state_rows][:, there]
            parameters = after.parameters(self.columns[:, group.lanes[there]])
            new, same = after.code.program.points(t, x, parameters)["stored"], np.ones(t.size, dtype=bool)
            for kind, ordinary in after.kinds:
                size = np.maximum(np.abs(old[kind]).max(axis=0, initial=0.0), ordinary)
                same &= (np.abs(new[kind] - old[kind]) <= TYPED * size).all(axis=0)
            groups.append(group.some(there).going_on(modes, t, x).some(same))
        return groups

    def _end(self, equations: EnsembleEquations, group: VariantGroup, course: LaneCourse, over: Mask) -> None:
        """The variants that have come to the end of their motion: just before it, where a law jumps there."""
        self._left[group.lanes[over]] = ""
        if any(measure.kind == "end" for measure in self.ensemble.measures) and over.any():
            before = np.minimum(group.t, course.highs)[over]
            shown = equations.code.program.points(before, group.x[:, over], course.p[:, over])["shown"]
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
        self._left[(self._left == "") & ~np.isfinite(values).all(axis=0)] = INFINITE
        return values
