"""The motion of a network as legs that are smooth: what its derivatives go along."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from shaftwork.codegen.elements import Array
from shaftwork.codegen.timeline import Timeline
from shaftwork.core.errors import SimulationError
from shaftwork.pipeline.analysis import Given
from shaftwork.pipeline.arguments import Demand
from shaftwork.pipeline.model import Model
from shaftwork.pipeline.phases.hybrid_run import HybridRun, Span
from shaftwork.pipeline.phases.hybrid_solution import solution
from shaftwork.pipeline.phases.hybrid_state import Change
from shaftwork.pipeline.phases.phased_model import PhasedModel
from shaftwork.pipeline.phases.phases import Phases
from shaftwork.pipeline.sensitivities.legs import Leg
from shaftwork.pipeline.start import start_of
from shaftwork.results.solution import Solution

MOST_STEPS = 10_000_000


@dataclass(frozen=True, eq=False)
class DifferentiatedMotion:
    """A motion to be differentiated.

    Args:
        solution: the motion, to be read.
        legs: its smooth spans.
        changes: of modes, in their order.
        start: what it starts from, in the equations in which nothing is joined; None where no part changes its mode.
        phases: the sets of equations, likewise.
    """

    solution: Solution
    legs: tuple[Leg, ...]
    changes: tuple[Change, ...] = ()
    start: Leg | None = None
    phases: Phases | None = None

    @property
    def models(self) -> tuple[Model, ...]:
        """All equations that hold on the way."""
        legs = self.legs if self.start is None else (self.start, *self.legs)
        return tuple(dict.fromkeys(leg.model for leg in legs))


def motion_of(model: Model, span: tuple[float, float], initial: Given, rtol: float) -> DifferentiatedMotion:
    """The motion of a network.

    Raises:
        SimulationError: it could not be found, or a prescribed speed jumps.
    """
    if isinstance(model, PhasedModel):
        run = HybridRun(model.phases, {}, Demand(span, rtol, None, None, "auto", MOST_STEPS, None), by_combination=True)
        run.march(initial)
        legs, changes = tuple(_legs_of_run(run)), tuple(run.changes)
        made = DifferentiatedMotion(solution(run, model.name), legs, changes, _start(run, initial), model.phases)
    else:
        found = model.simulate(span[1], t_start=span[0], initial=initial, rtol=rtol, t_eval="steps")
        made = DifferentiatedMotion(found, tuple(_legs_of_model(model, found)))
    _refuse_impulses(made)
    return made


def _start(run: HybridRun, initial: Given) -> Leg:
    phases, span = run.phases, run.demand.span
    assembly = phases.assembly(phases.first)
    p = assembly.vector({}, phases.numbers(phases.first))
    x, _ = start_of(assembly.model, assembly.prepared(p), initial, span)
    after = run.timeline(assembly, p).sides(span[0])[1]
    return Leg(
        start=span[0],
        end=span[0],
        low=after,
        high=after,
        model=assembly.model,
        p=p,
        dense=lambda times: np.tile(x, (len(times), 1)),
        steps=np.array([span[0]]),
        assembly=assembly,
        modes=phases.first,
    )


def _refuse_impulses(motion: DifferentiatedMotion) -> None:
    """Refuse sources that jump where inertias are joined to them rigidly, also at the start."""
    first = motion.legs[0]
    pairs = [(None, first.low, first), *((old.high, new.low, new) for old, new in pairwise(motion.legs))]
    for before, after, leg in pairs:
        x = np.zeros(len(leg.model.states))
        if leg.model.form.has_impulses and leg.model.bind(leg.p).impulse(x, before, after).any():
            raise SimulationError(
                f"At t = {leg.start:.9g} s a source jumps that is joined rigidly to what stores energy, and how the "
                "impulse depends on the parameters is not known here. Give the source a ramp, or take the difference "
                "of two variants, studies.sweep(...)."
            )


def _legs_of_run(run: HybridRun) -> Iterator[Leg]:
    """The legs of a motion through phases."""
    for span, end in zip(
        run.spans, [*(span.phases[0].start for span in run.spans[1:]), run.demand.span[1]], strict=True
    ):
        starts = [phase.start for phase in span.phases]
        for phase, (start, stop) in zip(span.phases, pairwise([*starts, end]), strict=True):
            if stop > start:
                assembly, p = phase.assembly, phase.p
                instants = run.timeline(assembly, p)
                leg = _leg(assembly.model, p, _states(span), span.trajectory.steps, (start, stop), instants)
                yield replace(leg, assembly=assembly, modes=phase.modes)


def _states(span: Span) -> Callable[[Array], Array]:
    """Those of the equations, without their clocks."""
    size, dense = len(span.phases[0].assembly.model.states), span.trajectory.dense
    return lambda times: dense(times)[:, :size]


def _legs_of_model(model: Model, solution: Solution) -> Iterator[Leg]:
    """The legs of the motion of a network in which no part changes its mode."""
    first, last = float(solution.steps[0]), float(solution.steps[-1])
    instants = model.switching.timeline(model.defaults, first, last)
    inner = (time for time in instants.times if first < time < last)
    for start, end in pairwise((first, *inner, last)):
        yield _leg(model, model.defaults, solution.dense, solution.steps, (start, end), instants)


def _leg(
    model: Model,
    p: Array,
    dense: Callable[[Array], Array],
    steps: Array,
    span: tuple[float, float],
    instants: Timeline,
) -> Leg:
    inside = steps[(steps > span[0]) & (steps < span[1])]
    low, high = instants.sides(span[0])[1], instants.sides(span[1])[0]
    return Leg(*span, low, high, model, p, dense, np.array([span[0], *inside, span[1]]))
