"""Laws that have no value at a time and a state, such as a root of what is below zero: which, and whose."""

from __future__ import annotations

import numpy as np
from sympy import Basic, Expr

from shaftwork.codegen.arrays import BoundArrays
from shaftwork.codegen.elements import Array
from shaftwork.components.laws import as_expression
from shaftwork.components.tables import Table
from shaftwork.network.graph import GraphPart
from shaftwork.network.templates import substitution
from shaftwork.network.wording import title

LONGEST = 60
"""Characters of a law in a message."""


def without_value(bound: BoundArrays, times: Array, states: Array) -> tuple[float, str] | None:
    """The first of times (k,) at which a law has no value with states (k, n), and the law; None where all have one."""
    inputs = bound.program.inputs
    if bound.loops is None:
        u = bound.values(times, states.T)[1]
    else:  # the loop of a law without value has no solution, and then none of its laws has a value
        u = inputs.values(times, np.zeros((inputs.outputs, times.size)), states.T, bound.p)
        u[~inputs.of_time] = 0.0
    # what depends on the time alone comes first: it may be what others read
    order = np.argsort(~inputs.of_time, kind="stable")
    if (found := first_missing(times, u[order].T)) is None:
        return None
    return found[0], _law_of(bound, int(order[found[1]]))


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
    given = {name: value for name, value in component.values.items() if isinstance(value, Expr | Table)}
    names = substitution(component)
    read = {name: as_expression(value).xreplace(names) for name, value in given.items()}
    inside = [name for name, value in read.items() if law.has(value) or law.has(-value)]
    texts = [f"{name} = {given[name]}" for name in inside or given]
    shown = [text if len(text) <= LONGEST else f"{text[:LONGEST]}..." for text in texts]
    return f"{' or '.join(shown) or 'the law'} of {title(component)}"
