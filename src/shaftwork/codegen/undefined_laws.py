"""Laws that have no value at a time and a state, as the root of a negative number, and inertias that vanish."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize_scalar
from sympy import Basic, Expr

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.components.branches import RATE
from shaftwork.components.law_slopes import slope
from shaftwork.components.laws import as_expression
from shaftwork.components.tables import Table
from shaftwork.core.errors import SimulationError, no_value
from shaftwork.formulation.form import StateForm
from shaftwork.network.graph import GraphPart
from shaftwork.network.netlist import title
from shaftwork.network.templates import substitution
from shaftwork.numerics.zeros import LOOKS, zero

WIDEST = 1 / np.finfo(float).eps
"""Largest ratio of an inertia along a motion: beyond it the smallest is lost in the rounding of the largest."""


def without_value(bound: BoundArrays, times: Array, states: Array) -> SimulationError | None:
    """The error of the first of times (k,) at which a law has no value with states (k, n); None where all have one.

    It is also that of an inertia that changes and is not above zero.
    """
    if (error := vanishing(bound, times, states)) is not None:
        return error
    inputs = bound.program.inputs
    # the loop of a law without value has no solution, and then none of its laws has a value
    has_loops = bound.loops is not None
    u = inputs.sources(times, states.T, bound.p) if has_loops else bound.values(times, states.T)[1]
    # what depends on the time alone comes first: it may be what others read
    order = np.argsort(~inputs.of_time, kind="stable")
    if (missing := first_missing(times, u[order].T)) is None:
        return None
    return no_value(missing[0], _law_of(bound, int(order[missing[1]])))


def refuse_vanishing(
    form: StateForm, bind: Callable[[], BoundArrays], steps: Callable[[], Array], x: Callable[[Array], Array]
) -> None:
    """Refuse a motion in which an inertia that changes is not above zero.

    Args:
        form: the equations.
        bind: makes them for their parameters.
        steps: makes (k,) times in s at which the steps of the motion end, or its start alone; not called, as the
            motion may have to be run again for it, where no inertia may vanish.
        x: from times to (k, n) states, or more.

    Raises:
        SimulationError: says when and which.
    """
    for change in form.doubtful:
        bound = bind()

        def course(times: Array, bound: BoundArrays = bound, change: int = change) -> Array:
            return _capacity(bound, change, times, x(times)[:, : len(form.states)])

        times = _with_lowest(course, steps())
        if (error := _objection(bound, change, times, course(times), course)) is not None:
            raise error


def vanishing(bound: BoundArrays, times: Array, states: Array) -> SimulationError | None:
    """The error of the first inertia that is not above zero at times (k,) and states (k, n), or that has a pole."""
    for change in bound.program.form.doubtful:
        error = _objection(bound, change, times, _capacity(bound, change, times, states))
        if error is not None:
            return error
    return None


def _capacity(bound: BoundArrays, change: int, times: Array, states: Array) -> Array:
    """(k,) an inertia at times (k,) and states (k, n), by the law of what it has beyond a constant."""
    graph = bound.program.form.graph
    with np.errstate(all="ignore"):
        beyond = bound.law_values(change, slope(graph.branches[change].template.law, RATE), times, states.T)
    return np.broadcast_to(bound.part.coefficients[graph.constant_of(change)] + beyond, times.shape)


def _with_lowest(course: Callable[[Array], Array], steps: Array) -> Array:
    """Times in every step, and those between them at which an inertia is lowest and may reach zero."""
    if steps.size < 2:
        return steps
    parts = np.append(0.0, LOOKS)
    times = np.append((steps[:-1, None] + np.diff(steps)[:, None] * parts).ravel(), steps[-1])
    values = course(times)
    before, here, after = values[:-2], values[1:-1], values[2:]
    lowest = (here <= before) & (here <= after) & (here <= np.maximum(before, after) - here)
    lowest_times = [
        minimize_scalar(lambda t: course(np.array([t]))[0], bounds=(times[k], times[k + 2]), method="bounded").x
        for k in np.flatnonzero(lowest)
    ]
    return np.union1d(times, lowest_times)


def _objection(
    bound: BoundArrays, change: int, times: Array, values: Array, course: Callable[[Array], Array] | None = None
) -> SimulationError | None:
    """The error of an inertia with values (k,) at times (k,); None where all are above zero and none is a pole."""
    graph, missing = bound.program.form.graph, first_missing(times, values[:, None])
    large, small = int(values.argmax()), int(values.argmin())
    if missing is None and values[small] > 0 and values[large] <= WIDEST * values[small]:
        return None
    name = in_words(graph.part_of(change), graph.branches[change].template.law)
    if missing is not None:
        return no_value(missing[0], name)
    if values[small] <= 0:
        place = int(np.argmax(values <= 0))
        t, says = float(times[place]), f"is {values[place]:.6g}"
        if course is not None and place > 0:
            t, says = zero(course, float(times[place - 1]), t), "falls to zero"
    else:
        t, says = times[large], f"is {values[large]:.3g}, and {values[small]:.3g} at t = {times[small]:.9g} s"
    return SimulationError(
        f"At t = {t:.9g} s {name} {says}. It must be above zero, and finite, at all times and angles of the motion."
    )


def rough(bound: BoundArrays, times: Array, states: Array) -> tuple[float, str] | None:
    """The first of times (k,) at which a law, or a branch of it that does not hold, has no value or slope; and the law.

    Only a Taylor series needs all of them. None where all have one.
    """
    inputs = bound.program.inputs
    for time, state in zip(times.tolist(), states, strict=True):
        place = inputs.first_rough(time, bound.values(time, state)[0], state, bound.p)
        if place is not None:
            return time, _law_of(bound, place)
    return None


def _law_of(bound: BoundArrays, place: int) -> str:
    """The law of an input in words."""
    branch = bound.program.form.graph.branches[int(bound.program.assembly.inputs[place])]
    return in_words(bound.program.form.graph.parts[branch.part], branch.template.law)


def first_missing(times: Array, values: Array) -> tuple[float, int] | None:
    """The first of times (k,) at which one of the values (k, m) is not finite, and its number; None where all are."""
    missing = ~np.isfinite(values)
    if not missing.any():
        return None
    row = int(np.argmax(missing.any(axis=1)))
    return float(times[row]), int(np.argmax(missing[row]))


def in_words(part: GraphPart, law: Basic) -> str:
    """What stands in a law of a part, as it was given: "tau = sqrt(1 - t) of TorqueSource 'pull'"."""
    component = part.component
    laws = {name: value for name, value in component.values.items() if isinstance(value, Expr | Table)}
    names = substitution(component)
    read = {name: as_expression(value).xreplace(names) for name, value in laws.items()}
    inside = [name for name, value in read.items() if law.has(value) or law.has(-value)]
    texts = [f"{name} = {laws[name]}" for name in inside or laws]
    shown = [text if len(text) <= 60 else f"{text[:60]}..." for text in texts]
    return f"{' or '.join(shown) or 'the law'} of {title(component)}"
