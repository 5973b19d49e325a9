"""Many variants of one network at once, in lanes of compiled code: the fast way of a sweep.

All variants run through the same phases side by side. Where a lane meets a guard, the mode that this guard leads to is
taken if the motion in it is beyond doubt: what is stored goes over unchanged, and every guard of the new mode is on its
own side or about to be. A variant of which anything else is true is left to `Model.simulate`, which settles it in full.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from shaftwork.codegen.elements import Array
from shaftwork.codegen.stores import Stores
from shaftwork.components.shafts import Shaft
from shaftwork.core.errors import CompileError, NetworkError
from shaftwork.integrate.lanes import Lanes, run_lanes
from shaftwork.network.graph import GraphPart
from shaftwork.pipeline.arguments import Demand
from shaftwork.pipeline.ensemble.equations import Entry, Equations
from shaftwork.pipeline.ensemble.extremes import largest
from shaftwork.pipeline.ensemble.groups import Group, Index, Mask, Pace, joined
from shaftwork.pipeline.ensemble.programs import EXTREMES, EnsembleCode
from shaftwork.pipeline.model import Model
from shaftwork.pipeline.phases.assemblies import Assembly, ModeNames
from shaftwork.pipeline.phases.model import PhasedModel
from shaftwork.pipeline.phases.regimes import with_modes
from shaftwork.pipeline.phases.run import Run
from shaftwork.pipeline.phases.starts import conditional
from shaftwork.results.measures import Measure

SAMPLES = (50, 4000)
"""Of the whole motion, at least and at most."""
FEWEST, FEWEST_SEEN = 16, 6
"""Samples of a phase, and those before the guard of a lane that has an extreme."""
STEPS, MOST_STEPS = 2.0, 2.6
"""Steps for a sample in the first variant. A lane that takes more than the second runs again with twice the samples."""
MOST_HALVINGS = 10
REFERENCE = 1e-8
"""Relative tolerance of the first variant, which counts steps: a tighter one has longer series and fewer of them."""
LONGER = 2.0
"""A phase is looked for up to so many times its length in the first variant, and then once more."""
MOST_ROUNDS = 200
"""Stretches of a motion, each up to a change of mode."""
SAME = 1e-9
"""What is stored has gone over unchanged where it differs by less than this, of the largest of its kind and of 1."""
MEASURED = ("max", "min", "peak", "mean", "rms", "end")


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
        self._first = dict(first)
        self._equations: dict[ModeNames, Equations | None] = {}
        self._codes: dict[Model, EnsembleCode] = {}
        self.pace = Pace()
        self._refuse()
        self._modes, lasting, steps = self._reference()
        self._horizons = lasting
        self._spacing = (span[1] - span[0]) / min(max(steps / STEPS, SAMPLES[0]), SAMPLES[1])
        if self._of(self._modes) is None:
            raise CompileError("The equations at the start have no program for variants side by side.")

    def _refuse(self) -> None:
        form, model = self.model.form, self.model
        if model.rows is None or form.waves or form.loop_laws or not model.states:
            raise CompileError("The network is too large, holds waves, or has a nonlinear law at a massless node.")
        times = model.switching.timeline(model.defaults, *self.span, modes=False).times
        if form.has_impulses or form.across_sources or times:
            raise CompileError("A source switches or jumps at a time of its own.")
        if not {*form.graph.zeros, *form.tree.frozen}.isdisjoint(self.names):
            raise CompileError("A parameter that varies decides which equations hold.")
        if any(isinstance(part.component, Shaft) for part in self._varied):
            raise CompileError("A parameter of a shaft varies, which may change its model.")
        if unknown := [measure for measure in self.measures if measure.kind not in MEASURED]:
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

    @property
    def phased(self) -> PhasedModel | None:
        """The model, where parts change their mode."""
        return self.model if isinstance(self.model, PhasedModel) else None

    def _reference(self) -> tuple[ModeNames, dict[ModeNames, float], int]:
        """Modes at the start, the longest phase in each combination of modes, and steps, of the first variant."""
        phased = self.phased
        if phased is None:
            solution = self.model.simulate(
                self.span[1], t_start=self.span[0], rtol=REFERENCE, t_eval=2, parameters=self._first
            )
            return (), {(): self.span[1] - self.span[0]}, solution.statistics.get("steps", 0)
        demand = Demand(self.span, REFERENCE, None, np.array(self.span), "auto", MOST_ROUNDS * 10_000, None)
        run = Run(phased.phases, self._first, demand)
        run.march(None)
        phases = [phase for span in run.spans for phase in span.phases]
        lasting: dict[ModeNames, float] = {}
        for phase, end in zip(phases, [*(phase.start for phase in phases[1:]), self.span[1]], strict=True):
            lasting[phase.modes] = max(lasting.get(phase.modes, 0.0), end - phase.start)
        return phases[0].modes, lasting, run.steps

    def _of(self, modes: ModeNames) -> Equations | None:
        """The equations of a combination of modes, or None where variants cannot run side by side in them."""
        if modes not in self._equations:
            try:
                assembly = None if self.phased is None else self.phased.phases.assembly(modes)
                code = self._code(assembly)
                self._equations[modes] = Equations(code, assembly, modes, self._first, self.names, self.span)
            except (CompileError, NetworkError):
                self._equations[modes] = None
        return self._equations[modes]

    def _code(self, assembly: Assembly | None) -> EnsembleCode:
        """The programs of a set of equations, which several combinations of modes may share."""
        model = self.model if assembly is None else assembly.model
        if model not in self._codes:
            if assembly is None:
                bound = model.prepare(model.vector(self._first)).symbolic()
                program, stores = None if bound is None else bound.program, Stores(model.form)
            else:
                program, stores = None if assembly.clocks else assembly.program, assembly.stores
            self._codes[model] = EnsembleCode(model, program, stores, self.measures)
        return self._codes[model]

    def run(self, columns: Array) -> tuple[Array, Mask]:
        """Measures of variants.

        Args:
            columns: (names, k) values of the parameters that vary.

        Returns:
            (measures, k), and (k,) whether a variant has come to its end here; of the others nothing is known.
        """
        return _Way(self, columns).go()

    @cached_property
    def decisive(self) -> bool:
        """Whether a parameter that varies decides in which mode a motion starts."""
        if self.phased is None:
            return False
        elements = self.phased.phases.elements
        symbols = {f"{made.part.name}.{symbol.name}" for made in elements for symbol in conditional(made.modes)}
        return not symbols.isdisjoint(self.names)

    def first_assembly(self) -> Assembly | None:
        """The equations in which the modes at the start are found."""
        return None if self.phased is None else self.phased.phases.assembly(self.phased.phases.first)

    def samples(self, group: Group) -> Array:
        """(m, k) times at which lanes are looked at, up to their end or for as long as the phase may last."""
        horizon = LONGER * self._horizons.get(group.modes, math.inf)
        end = np.minimum(self.span[1], group.t + horizon)
        end = np.where(self.span[1] - end < self._spacing, self.span[1], end)
        count = max(FEWEST, math.ceil(float((end - group.t).max()) / self._spacing)) * 2**group.halvings + 1
        times = group.t + np.linspace(0.0, 1.0, count)[:, None] * (end - group.t)
        times[-1] = end
        return times

    def after(self, group: Group, guard: int, p: Array) -> list[tuple[ModeNames, Mask]]:
        """The modes to which a guard leads by itself, and the lanes (k,) that go there."""
        phased = self.phased
        assert phased is not None  # noqa: S101 (only its lanes meet guards)
        assembly = phased.phases.assembly(group.modes)
        pairs = [pair for pair in assembly.watched(group.modes) if pair[1].guard == guard]
        if len(pairs) != 1 or pairs[0][1].leave.rebound is not None:
            return []
        (number, ended), count = pairs[0], group.lanes.size
        names = [ended.leave.to] * count
        if not ended.leave.to:
            before, own = group.modes[number], p[: len(assembly.model.parameters)]
            starts = zip(group.t.tolist(), group.x.T, own.T, strict=True)
            names = [assembly.start_of(number, before, *start) for start in starts]
        found = dict.fromkeys(names)
        return [(with_modes(group.modes, {number: to}), np.array([name == to for name in names])) for to in found]

    def equations(self, modes: ModeNames) -> Equations | None:
        """The equations of a combination of modes."""
        return self._of(modes)

    @property
    def start(self) -> ModeNames:
        """The modes in which the first variant starts."""
        return self._modes


class _Way:
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
        for _ in range(MOST_ROUNDS):
            if not waiting:
                break
            waiting = [made for group in joined(waiting) for made in self._stretch(group)]
        return self._results(), self.done

    def _begin(self) -> list[Group]:
        ensemble = self.ensemble
        equations = ensemble.equations(ensemble.start)
        assert equations is not None  # noqa: S101 (checked when it was made)
        lanes = np.flatnonzero(ensemble.alike(self.columns))
        if ensemble.decisive:
            lanes = lanes[[self._starts_alike(k) for k in lanes.tolist()]]
        size = len(equations.code.model.states)
        return [Group(ensemble.start, lanes, np.full(lanes.size, ensemble.span[0]), np.zeros((size, lanes.size)))]

    def _starts_alike(self, lane: int) -> bool:
        ensemble, assembly = self.ensemble, self.ensemble.first_assembly()
        assert assembly is not None and ensemble.phased is not None  # noqa: S101, PT018 (only modes are decided upon)
        phases, x = ensemble.phased.phases, np.zeros(len(assembly.model.states))
        values = dict(zip(ensemble.names, self.columns[:, lane].tolist(), strict=True))
        p = assembly.vector(values, phases.numbers(phases.first))
        return assembly.first_modes(ensemble.span[0], x, p) == ensemble.start

    def _stretch(self, group: Group) -> list[Group]:
        """Up to the next change of mode in each lane; the groups that go on from there."""
        equations = self.ensemble.equations(group.modes)
        if equations is None or not group.lanes.size:
            return []
        group = group.some(self.ensemble.pace.order(self.columns[:, group.lanes]))
        p = equations.parameters(self.columns[:, group.lanes])
        entry = equations.entered(group.t, group.x, p)
        group, p, entry = _kept(group, p, entry)
        if not group.lanes.size:
            return []
        times = self.ensemble.samples(group)
        lanes = run_lanes(equations.code.program, group.x, p, equations.sides, entry.offsets, times, self.ensemble.rtol)
        self.ensemble.pace.learn(self.columns[:, group.lanes], lanes.steps)
        jets, guards = equations.code.seen(lanes.t, lanes.x[:, : len(group.x)].swapaxes(0, 1), p)
        good = lanes.good & equations.stays(guards, entry.offsets)
        coarse = good & _coarse(lanes, jets) if group.halvings < MOST_HALVINGS else np.zeros_like(good)
        good &= ~coarse
        self._measure(_Followed(equations, lanes, p, self.ensemble.rtol), group, jets, good)
        t, x = lanes.t[-1], lanes.x[-1, : len(group.x)]
        over = good & (lanes.met < 0) & (t >= self.ensemble.span[1])
        self._end(equations, group, x, p, over)
        on = good & (lanes.met < 0) & ~over
        made = [replace(group, t=t, x=x, halvings=0).some(on), replace(group, halvings=group.halvings + 1).some(coarse)]
        for guard in np.unique(lanes.met[good & (lanes.met >= 0)]).tolist():
            here = good & (lanes.met == guard)
            made += self._changed(equations, replace(group, t=t, x=x, halvings=0).some(here), guard)
        return made

    def _changed(self, before: Equations, group: Group, guard: int) -> list[Group]:
        """Past a guard: what is stored goes over to the equations that follow, where it goes over unchanged."""
        p = before.parameters(self.columns[:, group.lanes])
        held, made = before.code.stored(group.t, group.x, p), []
        for modes, there in self.ensemble.after(group, guard, p):
            after = self.ensemble.equations(modes)
            if after is None or not after.leaves_behind(before, guard):
                continue
            t, own, x = group.t[there], held[:, there], held[after.code.state_rows][:, there]
            given = after.parameters(self.columns[:, group.lanes[there]])
            new, same = after.code.stored(t, x, given), np.ones(t.size, dtype=bool)
            for kind in after.code.kinds:
                size = np.maximum(np.abs(own[kind]).max(axis=0, initial=0.0), 1.0)
                same &= (np.abs(new[kind] - own[kind]) <= SAME * size).all(axis=0)
            made.append(Group(modes, group.lanes[there], t, x).some(same))
        return made

    def _measure(self, followed: _Followed, group: Group, jets: Mapping[int, Array], good: Mask) -> None:
        """What the stretch adds to the measures."""
        equations, lanes, size, own = followed.equations, followed.lanes, len(group.x), group.lanes
        for row, measure in enumerate(self.ensemble.measures):
            if measure.kind in ("mean", "rms"):
                added = lanes.x[-1, size + equations.code.integral_of[row]]
                self.values[row, own[good]] += added[good]
            for sign in EXTREMES.get(measure.kind, ()):
                jet = jets[row] if sign > 0 else -jets[row]
                found = largest(lanes.t, jet, self.values[row, own], partial(followed.jets, row, sign))
                self.values[row, own[good]] = found[good]

    def _end(self, equations: Equations, group: Group, x: Array, p: Array, over: Mask) -> None:
        """The variants that have come to the end of their motion."""
        self.done[group.lanes[over]] = True
        if any(measure.kind == "end" for measure in self.ensemble.measures) and over.any():
            shown = equations.code.shown(np.full(int(over.sum()), self.ensemble.span[1]), x[:, over], p[:, over])
            for row, measure in enumerate(self.ensemble.measures):
                if measure.kind == "end":
                    self.values[row, group.lanes[over]] = shown[row]

    def _results(self) -> Array:
        duration = self.ensemble.span[1] - self.ensemble.span[0]
        made = self.values.copy()
        for row, measure in enumerate(self.ensemble.measures):
            if measure.kind == "min":
                made[row] *= -1.0
            elif measure.kind in ("mean", "rms"):
                made[row] /= duration
                made[row] = np.sqrt(np.maximum(made[row], 0.0)) if measure.kind == "rms" else made[row]
        self.done &= np.isfinite(made).all(axis=0)
        return made


@dataclass(frozen=True, eq=False)
class _Followed:
    """A stretch of the motion of some variants, to go to any time in it.

    Args:
        equations: of its modes.
        lanes: the stretch.
        p: (parameters, k).
        rtol: relative tolerance.
    """

    equations: Equations
    lanes: Lanes
    p: Array
    rtol: float

    def jets(self, row: int, sign: float, at: Index, own: Index, times: Array) -> Array:
        """(3, c) what a measure reads, times a sign, and its derivatives at times (c,), from samples (c,) before.

        Args:
            row: of the measure.
            sign: of what is read.
            at: (c,) samples.
            own: (c,) lanes.
            times: (c,) s.
        """
        equations, p = self.equations, self.p[:, own]
        program = equations.code.program
        start, grid = self.lanes.x[at, : len(program.variables), own].T, np.array([self.lanes.t[at, own], times])
        unguarded, offsets = np.zeros_like(equations.sides), np.zeros((equations.sides.size, own.size))
        made = run_lanes(program, start, p, unguarded, offsets, grid, self.rtol)
        x = made.x[-1:, : len(start)].swapaxes(0, 1)
        return np.asarray(sign * equations.code.seen(grid[-1:], x, p)[0][row][:, 0])


def _coarse(lanes: Lanes, jets: Mapping[int, Array]) -> Mask:
    """(k,) lanes of which there are too few samples to know their extremes, where there are any."""
    seen = 1 + np.count_nonzero(lanes.t[1:] > lanes.t[:-1], axis=0)
    coarse = (lanes.steps > MOST_STEPS * (len(lanes.t) - 1)) & bool(jets)
    if (few := np.flatnonzero(seen < FEWEST_SEEN)).size:
        for jet in jets.values():
            slopes = jet[1][:, few]
            coarse[few] |= (slopes[:-1] * slopes[1:] < 0).any(axis=0)
    return np.asarray(coarse)


def _kept(group: Group, p: Array, entry: Entry) -> tuple[Group, Array, Entry]:
    """Those of a group whose modes are consistent with their motion."""
    if entry.good.all():
        return group, p, entry
    on = entry.good
    return group.some(on), p[:, on], Entry(on[on], entry.offsets[:, on])
