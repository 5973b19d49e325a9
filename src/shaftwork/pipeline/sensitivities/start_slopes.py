"""Parameters with which a motion starts elsewhere: from them its derivatives do not start at zero."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from shaftwork.codegen.elements import Array
from shaftwork.core.errors import ParameterError
from shaftwork.pipeline.analysis import Given
from shaftwork.pipeline.model import Model
from shaftwork.pipeline.phases.phased_model import PhasedModel
from shaftwork.pipeline.start import start_of

SHIFT = 1e-3
"""By this part a parameter is made smaller."""
STILL = 1e-9
"""States that change by less than this part of the largest have not moved: that is rounding."""


def without_start(
    model: Model, names: Sequence[str], initial: Given, span: tuple[float, float], *, are_asked: bool
) -> tuple[str, ...]:
    """The parameters that do not move the start.

    Speeds inside a shaft run straight between those of its ends, which a source or the ratio of a gear may determine.

    Args:
        model: the compiled network.
        names: parameters.
        initial: start values of states.
        span: start and end of the motion, s.
        are_asked: whether each of the names must remain.

    Raises:
        ParameterError: one that is asked for moves the start.
    """
    if not initial or not _moved(model, names, initial, span):
        return tuple(names)
    moved = {name: states for name in names if (states := _moved(model, (name,), initial, span))}
    if moved and are_asked:
        name, states = next(iter(moved.items()))
        raise ParameterError(
            f"'{name}' moves the start: {', '.join(states)} follow from it and the start values. Give them start "
            "values as well."
        )
    return tuple(name for name in names if name not in moved)


def _moved(model: Model, names: Sequence[str], initial: Given, span: tuple[float, float]) -> tuple[str, ...]:
    """The states that start elsewhere where some parameters are others."""
    values = {name: model.parameters[name] for name in names}
    states, start = _start(model, {}, initial, span)
    other = _start(model, {name: value * (1 - SHIFT) for name, value in values.items()}, initial, span)[1]
    far = np.abs(other - start) > STILL * SHIFT * np.abs(start).max(initial=0.0)
    return tuple(name for name, moves in zip(states, far.tolist(), strict=True) if moves)


def _start(
    model: Model, values: Mapping[str, float], initial: Given, span: tuple[float, float]
) -> tuple[tuple[str, ...], Array]:
    """The states by name, and where they start, in the equations in which nothing is joined."""
    if not isinstance(model, PhasedModel):
        return tuple(model.states), start_of(model, model.prepare(model.vector(values)), initial, span)[0]
    phases = model.phases
    assembly = phases.assembly(phases.first)
    p = assembly.vector(values, phases.numbers(phases.first))
    return tuple(assembly.model.states), start_of(assembly.model, assembly.prepared(p), initial, span)[0]
