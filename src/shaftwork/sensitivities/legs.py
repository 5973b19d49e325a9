"""A motion in legs: spans of time in which one set of equations holds, no mode changes and no law switches."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, cast

import numpy as np
from sympy import Expr

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.timeline import Timeline
from shaftwork.core.errors import SimulationError
from shaftwork.integrate.problem import Problem
from shaftwork.numerics.tolerances import ROUNDINGS, SAME
from shaftwork.numerics.zeros import LOOKS, zero
from shaftwork.pipeline.arguments import Demand, Given
from shaftwork.pipeline.model import Model
from shaftwork.results.solution import Solution
from shaftwork.sensitivities.differentiation import Differentiated

if TYPE_CHECKING:
    from shaftwork.hybrid.equation_sets import EquationSets
    from shaftwork.hybrid.hybrid_model import HybridModel
    from shaftwork.hybrid.hybrid_run import HybridRun, Segment
    from shaftwork.hybrid.hybrid_state import Transition
    from shaftwork.hybrid.modes.mode_equations import ModeEquations
    from shaftwork.hybrid.modes.mode_machines import ModeNames

LATE = 1e-5
"""The run meets limits late by what rounding moves them, which is much for what hardly moves any more: by up to this
part of the run, with states that are off by up to this part of their size."""


@dataclass(frozen=True, eq=False)
class Leg:
    """A span of time in which everything is smooth.

    Args:
        start: s.
        end: s.
        low: the earliest time in s at which it is read, after whatever jumps at the start.
        high: the latest, before whatever jumps at the end.
        model: the equations.
        p: their parameters, numbers of modes among them.
        dense: from times (k,) to states (k, n).
        steps: (s,) ends of the steps of the run, from start to end, s.
        equations: the same equations with their guards; None where no part changes its mode.
        modes: of every machine.
        turned: what a law has changed its sides by at the start, because of the motion.
    """

    start: float
    end: float
    low: float
    high: float
    model: Model
    p: Array
    dense: Callable[[Array], Array]
    steps: Array
    equations: ModeEquations | None = None
    modes: ModeNames = ()
    turned: tuple[Expr, ...] = ()

    def read(self, times: Array) -> tuple[Array, Array]:
        """The times (k,), moved inside the leg, and the states (k, n) there."""
        inside = np.clip(times, self.low, self.high)
        return inside, self.dense(inside)

    def at(self, t: float) -> tuple[float, Array]:
        """The same for one time."""
        times, states = self.read(np.array([t]))
        return float(times[0]), states[0]


def parted(leg: Leg, equations: Differentiated) -> Iterator[Leg]:
    """A leg parted where the motion makes a law jump or bend."""
    grain = ROUNDINGS * float(np.spacing(max(abs(leg.start), abs(leg.end))))
    met: dict[float, list[int]] = {}
    for time, number in sorted(_turned(leg, equations)):
        last = next(reversed(met), -np.inf)
        met.setdefault(last if time - last <= grain else time, []).append(number)
    rest = leg
    for time, numbers in met.items():
        low, high = _beside(rest, equations, time, numbers, grain)
        steps, turned = rest.steps, tuple(equations.turns[number] for number in numbers)
        yield replace(rest, end=time, high=low, steps=np.append(steps[steps < time], time))
        rest = replace(rest, start=time, low=high, steps=np.append(time, steps[steps > time]), turned=turned)
    yield rest


def _turned(leg: Leg, equations: Differentiated) -> Iterator[tuple[float, int]]:
    """Time and number of every switch of a law because of the motion."""
    if not equations.turns:
        return
    times = np.append((leg.steps[:-1, None] + np.diff(leg.steps)[:, None] * np.append(0.0, LOOKS)).ravel(), leg.end)
    values = equations.turning(*leg.read(times), leg.p)
    for number, column in enumerate(values.T):
        sided = np.flatnonzero(np.abs(column) > SAME * np.abs(column).max(initial=0.0))
        for k in np.flatnonzero(np.diff(np.sign(column[sided]))).tolist():

            def course(t: Array, number: int = number) -> Array:
                return np.asarray(equations.turning(*leg.read(t), leg.p)[:, number])

            yield zero(course, *times[sided[k : k + 2]].tolist()), number


def _beside(
    leg: Leg, equations: Differentiated, time: float, numbers: Sequence[int], grain: float
) -> tuple[float, float]:
    """Times in s just before and after a switch, at which laws are on their sides for sure."""
    aside = grain
    while True:
        low, high = max(time - aside, leg.low), min(time + aside, leg.high)
        before, after = equations.turning(*leg.read(np.array([low, high])), leg.p)[:, list(numbers)]
        if (before * after < 0).all() or low == leg.low or high == leg.high:
            return low, high
        aside *= 4  # too near


@dataclass(frozen=True, eq=False)
class DifferentiatedMotion:
    """A motion to be differentiated.

    Args:
        solution: the motion, to be read.
        legs: its smooth spans.
        transitions: in their order.
        start: what it starts from, in the equations in which nothing is joined; None where no part changes its mode.
        equation_sets: the sets of equations, likewise.
        values: parameters that differ from the network's.
    """

    solution: Solution
    legs: tuple[Leg, ...]
    transitions: tuple[Transition, ...] = ()
    start: Leg | None = None
    equation_sets: EquationSets | None = None
    values: Mapping[str, float] = field(default_factory=dict)

    @property
    def used(self) -> dict[Model, Array]:
        """All equations that hold on the way, with their parameters (p,)."""
        legs = self.legs if self.start is None else (self.start, *self.legs)
        return {leg.model: leg.p for leg in legs}


def motion_of(
    model: Model, span: tuple[float, float], initial: Given, rtol: float, values: Mapping[str, float]
) -> DifferentiatedMotion:
    """The motion of a network.

    Args:
        model: the compiled network.
        span: start and end, s.
        initial: start values.
        rtol: relative tolerance.
        values: parameters that differ from the network's, and change no structure.

    Raises:
        SimulationError: it could not be found, or a prescribed speed jumps.
    """
    if model.phased:
        differentiated = _through_phases(cast("HybridModel", model), span, initial, rtol, values)
    else:
        motion = model.simulate(span[1], t_start=span[0], initial=initial, rtol=rtol, t_eval="steps", parameters=values)
        differentiated = DifferentiatedMotion(
            motion, tuple(_legs_of_model(model, motion, model.vector(values))), values=values
        )
    _refuse_impulses(differentiated)
    return differentiated


def _through_phases(
    model: HybridModel, span: tuple[float, float], initial: Given, rtol: float, values: Mapping[str, float]
) -> DifferentiatedMotion:
    """The motion of a network whose parts change their mode."""
    from shaftwork.hybrid.hybrid_run import HybridRun
    from shaftwork.hybrid.hybrid_solution import solution

    run = HybridRun(
        model.equation_sets,
        values,
        Demand(span, rtol, None, None, "auto", Problem.max_steps, None),
        by_combination=True,
    )
    run.march(initial)
    legs, transitions = tuple(_legs_of_run(run)), tuple(run.transitions)
    return DifferentiatedMotion(
        solution(run, model.name), legs, transitions, _start(run, initial), model.equation_sets, values
    )


def _start(run: HybridRun, initial: Given) -> Leg:
    regime, span = run.event_iteration.transfer.regime(run.equation_sets.first), run.demand.span
    equations, p = regime.equations, regime.p
    x, _ = equations.model.state_at_start(equations.prepared(p), initial, span)
    after = run.timeline(regime).sides(span[0])[1]
    return Leg(
        start=span[0],
        end=span[0],
        low=after,
        high=after,
        model=equations.model,
        p=p,
        dense=lambda times: np.tile(x, (len(times), 1)),
        steps=np.array([span[0]]),
        equations=equations,
        modes=regime.modes,
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
    ends = [*(segment.phases[0].start for segment in run.segments[1:]), run.demand.span[1]]
    for segment, end in zip(run.segments, ends, strict=True):
        starts = [phase.start for phase in segment.phases]
        for phase, (start, stop) in zip(segment.phases, pairwise([*starts, end]), strict=True):
            if stop > start:
                equations, p = phase.regime.equations, phase.regime.p
                instants = run.timeline(phase.regime)
                leg = _leg(equations.model, p, _states(segment), segment.trajectory.steps, (start, stop), instants)
                yield replace(leg, equations=equations, modes=phase.regime.modes)


def _states(segment: Segment) -> Callable[[Array], Array]:
    """Those of the equations, without their clocks."""
    size, dense = len(segment.phases[0].regime.model.states), segment.trajectory.dense
    return lambda times: dense(times)[:, :size]


def _legs_of_model(model: Model, solution: Solution, p: Array) -> Iterator[Leg]:
    """The legs of the motion of a network in which no part changes its mode."""
    first, last = float(solution.steps[0]), float(solution.steps[-1])
    instants = model.switching.timeline(p, first, last)
    inner = (time for time in instants.times if first < time < last)
    for start, end in pairwise((first, *inner, last)):
        yield _leg(model, p, solution.dense, solution.steps, (start, end), instants)


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
