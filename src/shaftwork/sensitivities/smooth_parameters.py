"""Parameters by which a motion has derivatives, and why others have none."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, cast

import numpy as np
from sympy import Symbol

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.compiled_model import CompiledModel
from shaftwork.components.law_slopes import slope
from shaftwork.components.laws import t as TIME
from shaftwork.components.noise import HeldNoise, SmoothNoise
from shaftwork.core.errors import ParameterError
from shaftwork.numerics.tolerances import TYPED
from shaftwork.pipeline.arguments import Given, as_names
from shaftwork.pipeline.model import Model

if TYPE_CHECKING:
    from shaftwork.hybrid.hybrid_model import HybridModel

NO_DERIVATIVE = {
    "decisive": "decides which equations hold, so nothing is smooth in it. Give it a value that is not exactly zero, "
    "and ratios that are not alike.",
    "whole": "is a whole number, so nothing is smooth in it. Take the difference of two variants, studies.sweep(...).",
    "seed": "is the seed of a noise: another number is another noise. Leave it out.",
    "edge": "moves a switch that is exactly at the start or at the end of the motion, where it comes in or goes out. "
    "Take another t_end, or leave it out.",
}


def smooth_parameters(
    model: Model,
    names: str | Sequence[str] | None,
    used: Iterable[tuple[CompiledModel, Array]],
    span: tuple[float, float] | None = None,
) -> tuple[str, ...]:
    """The parameters by which to differentiate.

    Args:
        model: the compiled network.
        names: of parameters; None for all in which the equations are smooth.
        used: models of all equations that hold on the way, with their parameters (p,).
        span: start and end of the motion, s; None where there is none.

    Raises:
        ParameterError: there is no such parameter, or nothing is smooth in it.
    """
    declared = {
        f"{placed.part.name}.{name}": parameter
        for placed in model.netlist.placed
        for name, parameter in placed.part.declared.items()
    }
    numbers = [name for name in model.parameters if name in declared]
    reasons = {name: "whole" for name in numbers if declared[name].whole}
    for one, p in used:
        reasons |= dict.fromkeys((*one.form.graph.zeros, *one.form.tree.frozen), "decisive")
        reasons |= dict.fromkeys(_seeds(one), "seed")
        if span is not None:
            reasons |= dict.fromkeys(_at_edges(one, p, span), "edge")
    if names is None:
        return tuple(name for name in numbers if name not in reasons)
    asked = tuple(dict.fromkeys(as_names(names)))
    for name in asked:
        if name in reasons:
            raise ParameterError(f"'{name}' {NO_DERIVATIVE[reasons[name]]}")
        if name not in numbers:
            raise ParameterError(f"There is no parameter '{name}' with a number. There are: {', '.join(numbers)}.")
    return asked


def _seeds(model: CompiledModel) -> Iterator[str]:
    graph = model.form.graph
    for branch in graph.branches:
        law = graph.in_network_symbols(branch.template.law, branch)
        for noise in law.atoms(HeldNoise, SmoothNoise):
            yield from (symbol.name for symbol in noise.args[1].free_symbols)


def _at_edges(model: CompiledModel, p: Array, span: tuple[float, float]) -> Iterator[str]:
    """Parameters that move a switch of a law of time, or of a mode, which is at the start or at the end of a motion."""
    switching = model.switching
    instants = switching.timeline(p, *span)
    after, before = instants.sides(span[0])[1], instants.sides(span[1])[0]
    values = dict(zip((Symbol(name, real=True) for name in model.form.graph.parameters), p.tolist(), strict=True))
    for time, aside in ((span[0], after - span[0]), (span[1], span[1] - before)):
        for argument in switching.passed(p, time - aside, time + aside, modes=True) if aside else ():
            here = {**values, TIME: time}
            yield from (s.name for s in argument.free_symbols - {TIME} if slope(argument, s).xreplace(here) != 0)


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
    states, start = start_states(model, {}, initial, span)
    shift = 1e-3  # by which part each parameter is made smaller
    other = start_states(model, {name: value * (1 - shift) for name, value in values.items()}, initial, span)[1]
    far = np.abs(other - start) > TYPED * shift * np.abs(start).max(initial=0.0)
    return tuple(name for name, moves in zip(states, far.tolist(), strict=True) if moves)


def start_states(
    model: Model, values: Mapping[str, float], initial: Given, span: tuple[float, float]
) -> tuple[tuple[str, ...], Array]:
    """The states by name, and where they start, in the equations in which nothing is joined."""
    if not model.phased:
        return tuple(model.states), model.state_at_start(model.prepare(model.vector(values)), initial, span)[0]
    first, p = cast("HybridModel", model).equation_sets.first_equations(values)
    return tuple(first.model.states), first.model.state_at_start(first.prepared(p), initial, span)[0]
