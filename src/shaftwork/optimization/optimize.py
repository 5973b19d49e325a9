"""Design variables for which a goal becomes least, within limits of others."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.core.errors import ParameterError
from shaftwork.core.screen import progress
from shaftwork.numerics.even_points import even_points
from shaftwork.numerics.tolerances import EQUAL
from shaftwork.optimization.descent import Descent, DescentEnd
from shaftwork.optimization.measured_motion import Goal, MeasuredMotion
from shaftwork.optimization.optimum import Attempt, Optimum
from shaftwork.pipeline.arguments import (
    checked_parameter,
    range_of,
    relative_tolerance,
    seed_number,
    start_count,
    time_span,
)
from shaftwork.pipeline.measured_units import parameter_units, units_of
from shaftwork.pipeline.motion_start import refuse_motion
from shaftwork.pipeline.network import Network, network_of, with_values
from shaftwork.results.measures import Measure
from shaftwork.sweep.sweep_result import Limits, limits_of, requirements

OBJECTIVE = "objective"
"""The name under which a function stands that is made least."""


def optimize(
    net: Network,
    variables: Mapping[str, tuple[float, float]],
    goal: Goal,
    *,
    t_end: float,
    require: Mapping[str, Limits] | None = None,
    functions: Mapping[str, Goal] | None = None,
    choices: Mapping[str, Iterable[Mapping[str, float]]] | None = None,
    maximize: bool = False,
    starts: int = 1,
    seed: int = 0,
    initial: Mapping[str, float] | None = None,
    rtol: float = 1e-6,
    steady: bool = False,
) -> Optimum:
    """Find values of design variables for which a measure of the motion becomes least, or largest.

    Law: sequential quadratic programming (scipy's SLSQP) with the gradients of `motion_sensitivities`, exact through
    all events, from the network's values and further starts that fill the ranges evenly. It finds the bottom of the
    valley in which it starts: several starts that end alike are a sign, not a proof, that there is no deeper one.

    Args:
        net: the network.
        variables: (low, high) by parameter.
        goal: a measure, "max shaft.tau", or a function of all parameters, such as a mass or a price.
        t_end: end of the motion, s.
        require: (low, high) by measure, in its SI unit or with units, or by name of `functions`; None leaves a side
            open.
        functions: of all parameters, by name, to be limited.
        choices: parts of a catalogue: by name, sets of parameters of which one is taken; every combination is tried.
        maximize: whether the goal is made largest.
        starts: how many.
        seed: of the further starts.
        initial: start values of states.
        rtol: relative tolerance of the gradients.
        steady: whether each motion starts in its own steady state at t = 0, of which `initial` changes some values. The
            gradients are differences then, of two more motions for each variable.

    Raises:
        ParameterError: an argument is out of its range, or a measure has no derivative.
        SimulationError: the network itself has no motion; a start without one is among `Optimum.attempts`.
    """
    ranges = _ranges(net, variables)
    starts, seed = start_count(starts), seed_number(seed)
    refuse_motion(initial, "optimize")
    required = requirements(require)
    name, goals = _goals(goal, functions or {}, required)
    units = units_of(net, {other: Measure.read(text) for other, text in goals.items() if isinstance(text, str)})
    limits = limits_of(required, units.get)
    _, end = time_span(0.0, t_end)
    taken = _combinations(choices, ranges)
    attempts: list[Attempt] = []
    with progress(len(taken) * starts, "starts", "compiling") as show:
        for choice, values in taken:
            chosen = with_values(net, values) if values else net
            motion = MeasuredMotion(chosen, ranges, goals, end, initial, relative_tolerance(rtol), steady=steady)
            for start in _starts(chosen, ranges, starts, seed):
                descent = Descent(motion, ranges, limits, name, -1.0 if maximize else 1.0)
                attempts.append(_attempt(motion, choice, values, start, descent))
                show(len(attempts), "optimize")
    units |= parameter_units(net, attempts[0].values)
    return Optimum(net, name, maximize, limits, tuple(attempts), units)


def _goals(goal: Any, functions: Mapping[str, Goal], require: Mapping[str, Any]) -> tuple[str, dict[str, Goal]]:
    """The name of the goal, and by name the goal and all that is limited.

    Raises:
        ParameterError: one is neither a measure nor a function, or a function has no limits or the name of the goal.
    """
    if not isinstance(goal, str) and not callable(goal):
        raise ParameterError(f"goal = {goal!r} must be a measure, or a function of all parameters.")
    for name, function in functions.items():
        if not callable(function):
            raise ParameterError(f"functions['{name}'] = {function!r} must be a function of all parameters.")
        if name == OBJECTIVE:
            raise ParameterError(f"'{OBJECTIVE}' is the name of the goal. Give the function another one.")
        if name not in require:
            raise ParameterError(f"'{name}' is a function without limits. Give require={{'{name}': (low, high)}}.")
    name = goal if isinstance(goal, str) else OBJECTIVE
    return name, {name: goal, **{other: functions.get(other, other) for other in require}}


def _ranges(net: Network, variables: Any) -> dict[str, tuple[float, float]]:
    """Low and high by variable, in SI.

    Raises:
        ParameterError: there is no such parameter, or a range is none.
    """
    if not (isinstance(variables, Mapping) and variables):
        raise ParameterError(
            "Nothing is variable. Give ranges, such as {'shaft.c': (1e4, 5e4)}. Sets of values alone are compared by "
            "studies.sweep(net, samples={...})."
        )
    netlist, ranges = network_of(net).netlist(), dict[str, tuple[float, float]]()
    zeros = net.compile().form.graph.zeros
    for name, span in variables.items():
        if name in zeros:
            raise ParameterError(
                f"'{name}' is zero in the network, so it is in no equation. Give it a value there, to start from."
            )
        low, high = range_of(name, span, partial(checked_parameter, netlist, name))
        if low is None or high is None:
            raise ParameterError(f"'{name}': {span!r} has an open side. Give (low, high).")
        ranges[name] = low, high
    return ranges


def _combinations(
    choices: Mapping[str, Iterable[Mapping[str, float]]] | None, variables: Iterable[str]
) -> list[tuple[dict[str, int], dict[str, float]]]:
    """The number taken of each catalogue, and all parameters that this sets.

    Raises:
        ParameterError: a catalogue has no sets of parameters, or one is set twice.
    """
    if single := [name for name, sets in (choices or {}).items() if not isinstance(sets, Iterable)]:
        raise ParameterError(f"choices['{single[0]}'] must be a list of sets of values, such as [{{'J1.J': 2.0}}].")
    lists = {name: list(sets) for name, sets in (choices or {}).items()}
    if empty := [name for name, sets in lists.items() if not sets]:
        raise ParameterError(f"There is nothing to choose from in '{empty[0]}'.")
    setters = dict.fromkeys(variables, "variables")
    for name, sets in lists.items():
        if wrong := [one for one in sets if not isinstance(one, Mapping)]:
            raise ParameterError(f"choices['{name}'] holds {wrong[0]!r}. Give sets of values, such as {{'J1.J': 2.0}}.")
        keys = dict.fromkeys(key for one in sets for key in one)
        for number, one in enumerate(sets):
            if lacking := [key for key in keys if key not in one]:
                raise ParameterError(
                    f"choices['{name}']: number {number} has no '{lacking[0]}', which another one has. Give all of "
                    "them the same parameters."
                )
        for key in keys:
            if setters.setdefault(key, f"choices['{name}']") != f"choices['{name}']":
                raise ParameterError(f"'{key}' is in {setters[key]} and in choices['{name}']. Leave it out of one.")
    combinations = []
    for numbers in product(*(range(len(sets)) for sets in lists.values())):
        choice = dict(zip(lists, numbers, strict=True))
        values = {key: value for name, number in choice.items() for key, value in lists[name][number].items()}
        combinations.append((choice, values))
    return combinations


def _starts(net: Network, ranges: Mapping[str, tuple[float, float]], count: int, seed: int) -> list[Array]:
    """The network's own values first, moved into their ranges."""
    low, high = np.array(list(ranges.values())).T
    parameters = net.compile().parameters
    first = np.clip([parameters[name] for name in ranges], low, high)
    return [first, *even_points(low, high, count - 1, seed)]


def _attempt(
    motion: MeasuredMotion,
    choice: Mapping[str, int],
    fixed: Mapping[str, float],
    start: Array,
    descent: Descent,
) -> Attempt:
    before = motion.motions
    end = DescentEnd(start, "", success=False) if motion.undefined(start) else descent.run(start)
    goals = {of: value for of, (value, _) in motion.at(end.variables).items()}
    message, values = motion.undefined(end.variables) or end.message, {**fixed, **motion.values(end.variables)}
    at_ends = tuple(name for name, span in descent.ranges.items() if _ends_at(values[name], span))
    return Attempt(choice, values, goals, message, end.success, motion.motions - before, descent.sizes, at_ends)


def _ends_at(value: float, span: tuple[float, float]) -> bool:
    """Whether a value is an end of its range, to a millionth of this."""
    return min(value - span[0], span[1] - value) <= EQUAL * (span[1] - span[0])
