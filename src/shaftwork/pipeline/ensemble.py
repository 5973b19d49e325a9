"""Many variants of one network at once, in lanes of compiled code: the fast way of a sweep.

All variants run through the same phases side by side. Where a lane meets a guard, the mode that this guard leads to is
taken if the motion in it is beyond doubt: what is stored goes over unchanged, and every guard of the new mode is on its
own side or about to be. A variant of which anything else is true is left to `Model.simulate`, which settles it in full.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from shaftwork.codegen.elements import Array
from shaftwork.core.errors import CompileError, NetworkError
from shaftwork.integrate.choice import available
from shaftwork.integrate.lanes import Lanes, run_lanes
from shaftwork.pipeline.arguments import Demand
from shaftwork.pipeline.assemblies import Assembly, ModeNames, conditional
from shaftwork.pipeline.ensemble_equations import Equations, Entry
from shaftwork.pipeline.ensemble_extremes import largest
from shaftwork.pipeline.model import Model
from shaftwork.pipeline.phased import PhasedModel
from shaftwork.pipeline.phases import Run
from shaftwork.pipeline.regimes import with_modes
from shaftwork.results.measures import Measure

SAMPLES = (100, 4000)
"""Of the whole motion; between them as many as the first variant has steps."""
FEWEST = 8
"""Samples of a phase."""
LONGER = 2.0
"""A phase is looked for up to so many times its length in the first variant, and then once more."""
MOST_ROUNDS = 200
"""Stretches of a motion, each up to a change of mode."""
SAME = 1e-9
"""What is stored has gone over unchanged where it differs by less than this, of the largest of its kind and of 1."""
MEASURED = ("max", "min", "peak", "mean", "rms", "end")

Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Group:
    """Variants in the same modes, ready to go on.

    Args:
        modes: of every element; empty where nothing changes its mode.
        lanes: (k,) numbers of the variants.
        t: (k,) s.
        x: (n, k) states.
    """

    modes: ModeNames
    lanes: Index
    t: Array
    x: Array


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
        self._refuse()
        self._modes, lasting, steps = self._reference()
        self._horizons = lasting
        self._spacing = (span[1] - span[0]) / min(max(steps, SAMPLES[0]), SAMPLES[1])
        if self._of(self._modes) is None:
            raise CompileError("The equations at the start have no program for variants side by side.")

    def _refuse(self) -> None:
        form, model = self.model.form, self.model
        if not available("heyoka"):
            raise CompileError("Variants run side by side with heyoka. Install it with: pip install 'shaftwork[fast]'")
        if model.rows is None or form.waves or form.loop_laws or not model.states:
            raise CompileError("The network is too large, holds waves, or has a nonlinear law at a massless node.")
        if form.has_impulses or form.across_sources or len(model.switching.timeline(model.defaults, *self.span).times):
            raise CompileError("A source switches or jumps at a time of its own.")
        if unknown := [measure for measure in self.measures if measure.kind not in MEASURED]:
            raise CompileError(f"'{unknown[0]}' is read from the motion of one variant.")

    @property
    def phased(self) -> PhasedModel | None:
        """The model, where parts change their mode."""
        return self.model if isinstance(self.model, PhasedModel) else None

    def _reference(self) -> tuple[ModeNames, dict[ModeNames, float], int]:
        """Modes at the start, the longest phase in each combination of modes, and steps, of the first variant."""
        phased = self.phased
        if phased is None:
            solution = self.model.simulate(
                self.span[1], t_start=self.span[0], rtol=self.rtol, t_eval=2, parameters=self._first
            )
            return (), {(): self.span[1] - self.span[0]}, solution.statistics.get("steps", 0)
        demand = Demand(self.span, self.rtol, None, np.array(self.span), "auto", MOST_ROUNDS * 10_000, None)
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
                self._equations[modes] = Equations(
                    self.model, assembly, modes, self._first, self.names, self.measures, self.span
                )
            except (CompileError, NetworkError):
                self._equations[modes] = None
        return self._equations[modes]

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
        count = max(FEWEST, math.ceil(float((end - group.t).max()) / self._spacing)) + 1
        times = group.t + np.linspace(0.0, 1.0, count)[:, None] * (end - group.t)
        times[-1] = end
        return times

    def after(self, modes: ModeNames, guard: int) -> ModeNames | None:
        """The modes to which a guard leads by itself, or None where more has to be known."""
        phased = self.phased
        assert phased is not None  # noqa: S101 (only its lanes meet guards)
        pairs = [pair for pair in phased.phases.assembly(modes).watched(modes) if pair[1].guard == guard]
        if len(pairs) != 1:
            return None
        number, ended = pairs[0]
        if not ended.leave.to or ended.leave.rebound is not None:
            return None
        return with_modes(modes, {number: ended.leave.to})

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
            waiting = [made for group in _joined(waiting) for made in self._stretch(group)]
        return self._results(), self.done

    def _begin(self) -> list[Group]:
        ensemble, count = self.ensemble, self.columns.shape[1]
        equations = ensemble.equations(ensemble.start)
        assert equations is not None  # noqa: S101 (checked when it was made)
        lanes = np.arange(count)
        if ensemble.decisive:
            lanes = lanes[[self._starts_alike(k) for k in range(count)]]
        size = len(equations.model.states)
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
        p = equations.parameters(self.columns[:, group.lanes])
        entry = equations.entered(group.t, group.x, p)
        group, p, entry = _kept(group, p, entry)
        if not group.lanes.size:
            return []
        times = self.ensemble.samples(group)
        lanes = run_lanes(equations.program, group.x, p, equations.sides, entry.offsets, times, self.ensemble.rtol)
        good = lanes.good & equations.stays(lanes, p, entry.offsets)
        self._measure(equations, group, lanes, p, good)
        t, x = lanes.t[-1], lanes.x[-1, : len(group.x)]
        over = good & (lanes.met < 0) & (t >= self.ensemble.span[1])
        self._end(equations, group, x, p, over)
        on = good & (lanes.met < 0) & ~over
        made = [Group(group.modes, group.lanes[on], t[on], x[:, on])]
        for guard in np.unique(lanes.met[good & (lanes.met >= 0)]).tolist():
            here = good & (lanes.met == guard)
            made += self._changed(equations, Group(group.modes, group.lanes[here], t[here], x[:, here]), guard)
        return made

    def _changed(self, before: Equations, group: Group, guard: int) -> list[Group]:
        """Past a guard: what is stored goes over to the equations that follow, where it goes over unchanged."""
        modes = self.ensemble.after(group.modes, guard)
        after = None if modes is None else self.ensemble.equations(modes)
        if modes is None or after is None:
            return []
        columns = self.columns[:, group.lanes]
        held = before.stored(group.t, group.x, before.parameters(columns))
        x = held[after.state_rows]
        new = after.stored(group.t, x, after.parameters(columns))
        same = np.ones(group.lanes.size, dtype=bool)
        for kind in (after.through_rows, after.other_rows):
            size = np.maximum(np.abs(held[kind]).max(axis=0, initial=0.0), 1.0)
            same &= (np.abs(new[kind] - held[kind]) <= SAME * size).all(axis=0)
        same &= after.beyond_doubt(group.t, x, after.parameters(columns), before, guard)
        return [Group(modes, group.lanes[same], group.t[same], x[:, same])]

    def _measure(self, equations: Equations, group: Group, lanes: Lanes, p: Array, good: Mask) -> None:
        """What the stretch adds to the measures."""
        size, own = len(group.x), group.lanes
        shown = equations.shown(lanes.t, lanes.x[:, :size].swapaxes(0, 1), p)
        for row, measure in enumerate(self.ensemble.measures):
            if measure.kind in ("mean", "rms"):
                added = lanes.x[-1, size + equations.integral_of[row]]
                self.values[row, own[good]] += added[good]
            elif measure.kind != "end":
                for sign in {"max": (1.0,), "min": (-1.0,), "peak": (1.0, -1.0)}[measure.kind]:
                    before = np.where(good, self.values[row, own], np.inf)
                    found = largest(equations, lanes, p, row, sign, shown[row], before, self.ensemble.rtol)
                    self.values[row, own] = np.where(good, np.maximum(self.values[row, own], found), -np.inf)

    def _end(self, equations: Equations, group: Group, x: Array, p: Array, over: Mask) -> None:
        """The variants that have come to the end of their motion."""
        self.done[group.lanes[over]] = True
        if any(measure.kind == "end" for measure in self.ensemble.measures) and over.any():
            shown = equations.shown(np.full(int(over.sum()), self.ensemble.span[1]), x[:, over], p[:, over])
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


def _kept(group: Group, p: Array, entry: Entry) -> tuple[Group, Array, Entry]:
    """Those of a group whose modes are consistent with their motion."""
    if entry.good.all():
        return group, p, entry
    on = entry.good
    kept = Group(group.modes, group.lanes[on], group.t[on], group.x[:, on])
    return kept, p[:, on], Entry(on[on], entry.offsets[:, on])


def _joined(groups: Sequence[Group]) -> list[Group]:
    """Groups in the same modes as one."""
    by_modes: dict[ModeNames, list[Group]] = {}
    for group in groups:
        if group.lanes.size:
            by_modes.setdefault(group.modes, []).append(group)
    return [
        Group(modes, *(np.concatenate([getattr(one, name) for one in several], axis=-1) for name in ("lanes", "t", "x")))
        for modes, several in by_modes.items()
    ]
