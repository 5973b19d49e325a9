"""How the motion of a set of equations starts: at rest, from values by name, or where another motion ended."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from shaftwork.codegen.elements import Array
from shaftwork.codegen.start_values import initial_state, with_others
from shaftwork.codegen.state_transfer import StateTransfer
from shaftwork.core.errors import Diagnostic, NetworkWarning
from shaftwork.core.notices import warn
from shaftwork.network.checks import resting_trains
from shaftwork.network.graph import CircuitGraph
from shaftwork.pipeline.ending import Ending

if TYPE_CHECKING:
    from shaftwork.pipeline.model import Model
    from shaftwork.pipeline.prepared import Prepared
    from shaftwork.pipeline.waves import CarriedWaves, WaveStart

_RESTING: WeakKeyDictionary[CircuitGraph, tuple[Diagnostic, ...]] = WeakKeyDictionary()
"""What `resting_trains` gives: it takes as long as a short run."""


def warn_of_rest(graph: CircuitGraph, initial: Mapping[str, float]) -> None:
    """Warn of trains that nothing joins to the drive and that no start value moves.

    Args:
        graph: the network.
        initial: start values.
    """
    moved = {str(name).rpartition(".")[0] for name, value in initial.items() if value}
    if (resting := _RESTING.get(graph)) is None:
        resting = _RESTING[graph] = resting_trains(graph)
    for found in resting:
        if moved.isdisjoint((*found.parts, *found.nodes)):
            warn(f"'{graph.name}' has a train that stays at rest: {found}", NetworkWarning)


def steady_start(
    model: Model, others: Mapping[str, float], parameters: Mapping[str, float] | None = None
) -> dict[str, float]:
    """Start values: the steady state with the laws at t = 0 s, in which some stores have other values.

    Args:
        model: the compiled network.
        others: start values by name; what is stored elsewhere is that of the steady state.
        parameters: values that differ from the network's.

    Raises:
        ParameterError: a start value is none.
        SimulationError: nothing comes to rest or to a steady speed.
    """
    steady = model.steady_state(t=0.0, parameters=parameters)
    return with_others(model.start_equations(parameters or {}), steady, others, 0.0) if others else dict(steady)


def start_of(
    model: Model, prepared: Prepared, initial: Mapping[str, float] | None, span: tuple[float, float]
) -> tuple[Array, WaveStart | CarriedWaves | None]:
    """The states (n,) at the start, and the waves where they are not at rest.

    Args:
        model: the compiled equations.
        prepared: their parameters.
        initial: start values, or where another motion ended; None for rest.
        span: start and end of the run, s.

    Raises:
        SignalError: there is no such quantity.
        ParameterError: values are not finite, contradict each other or leave something open.
    """
    if initial is None and not model.form.has_impulses:
        return np.zeros(len(model.states)), None
    _, after = model.switching.timeline(prepared.p, *span).sides(span[0])
    given = dict(zip(model.parameters, prepared.p.tolist(), strict=True))
    if isinstance(initial, Ending) and (initial.waves is not None or not model.form.waves):
        return _taken_up(prepared, initial, after, changes=bool(initial.changed(given))), initial.waves
    if not model.form.waves:
        return initial_state(prepared.bound, {} if initial is None else initial, after), None
    from shaftwork.pipeline.waves import start_of_waves, warn_of_lost_waves

    if isinstance(initial, Ending):
        warn_of_lost_waves(span[0], in_leaps=True)
        initial = {name: initial[name] for name in model.states}
    elif initial and span[0] != 0:
        warn_of_lost_waves(span[0])
    return start_of_waves(prepared.bound, model.twin.bind(model.twin.vector(given)), initial or {}, after)


def _taken_up(prepared: Prepared, ending: Ending, after: float, *, changes: bool) -> Array:
    """The states (n,) that go on with what was stored, after what jumps at that instant.

    Args:
        prepared: the equations.
        ending: of the motion before.
        after: time at which inputs are read from now on, s.
        changes: whether a parameter is another one: what is rigidly joined may then have to change its speeds at once.
    """
    form, bound, stores = prepared.form, prepared.bound, StateTransfer(prepared.form)
    if changes:
        ending.refuse_lacking(stores.names)
        x = stores.states(bound, ending.read, ending)
    else:  # without the full matrices of all stores, which a large network has no room for
        ending.refuse_lacking(state.name for state in form.states)
        x = np.array([ending[state.name] for state in form.states])
    return bound.impulse(x, ending.read, after) if form.has_impulses and after != ending.read else x
