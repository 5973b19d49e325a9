"""The same of a network whose parts change their mode: the modes that go on, and the guards that end them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.hybrid.hybrid_run import HybridRun, tightened_for
from shaftwork.hybrid.hybrid_state import HybridState
from shaftwork.pipeline.arguments import Demand, Given
from shaftwork.stepper.moments import Moment, MomentState, Observations, smooth_engine, smooth_steps

if TYPE_CHECKING:
    from shaftwork.hybrid.hybrid_model import HybridModel


def hybrid_moment(
    model: HybridModel,
    values: Mapping[str, float],
    origin: Given,
    demand: Demand,
    cached: dict[Any, Observations],
    place: MomentState | None = None,
) -> Moment:
    """The network at the start of a span, in the modes that go on; arguments as of `plain_moment`."""
    run = HybridRun(model.equation_sets, values, demand)
    if place is None:
        state = run.begin(origin)
    else:
        regime = run.event_iteration.transfer.regime(place.modes)
        state = HybridState(regime, place.snapshot.x[: len(regime.model.states)])
    regime, equations = state.regime, state.regime.equations
    t = demand.span[0] if place is None else place.snapshot.t
    if equations.readings not in cached:
        cached[equations.readings] = Observations(regime.model, equations.rows, equations.readings)

    def stored(bind: Any, at: float, x: Array) -> Mapping[str, float]:
        numbers = regime.stores.of(bind, np.array([at]), x[None, :])[0]
        return dict(zip(regime.stores.names, numbers.tolist(), strict=True))

    def bind(p: Array) -> BoundArrays:
        return equations.bound(p)

    pairs = tuple(zip(regime.machines, regime.modes, strict=True))
    problem = run.problem(t, state)
    if engine := smooth_engine(demand.engine):
        problem = tightened_for(problem, engine)
    return Moment(
        model=regime.model,
        readings=cached[equations.readings],
        demand=demand,
        t=t,
        after=run.timeline(regime).sides(t)[1],
        x=state.x[: len(regime.model.states)],
        vector=regime.values if place is None else place.vector,
        bind=bind,
        stored=stored,
        parameters={**model.parameters, **values},
        modes={machine.name: name for machine, name in pairs},
        words={machine.name: machine.modes[name].words for machine, name in pairs},
        steps=smooth_steps(regime.model, problem, demand, place),
    )
