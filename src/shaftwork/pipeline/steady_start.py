"""Start values in which a drive runs steadily but for what differs."""

from __future__ import annotations

from collections.abc import Mapping

from shaftwork.codegen.start_values import with_others
from shaftwork.pipeline.model import Model


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
