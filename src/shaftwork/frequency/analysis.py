"""The frequency domain of a compiled network: the point, the slopes there, and the record of both."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.compiled_model import CompiledModel
from shaftwork.codegen.starts.start_values import Start, initial_state
from shaftwork.components.laws import t as TIME
from shaftwork.core.errors import ParameterError
from shaftwork.core.notices import hint, once
from shaftwork.core.parameters import briefly, in_si
from shaftwork.formulation.source_inputs import source_inputs
from shaftwork.frequency import campbell as diagram
from shaftwork.frequency.linear_model import ExactModel, LinearModel, linear_model
from shaftwork.frequency.linearization import Linearization
from shaftwork.frequency.natural_modes import Modes
from shaftwork.frequency.point_speeds import as_multiple, speeds_to_give, warn_of_speeds_left, warn_of_turning_angles
from shaftwork.network.kinds import Kind
from shaftwork.network.netlist import listed
from shaftwork.pipeline.arguments import as_names
from shaftwork.pipeline.settled import SteadyState
from shaftwork.results.solution import Solution

Given = Mapping[str, float] | None
Point = Given | Solution
Names = str | Sequence[str] | None
Time = float | None
SmallMotions = Callable[[Point, Time, Names], LinearModel | ExactModel]
"""From a point, a time and names of inputs to the network near that point."""
NAMED = 4
"""Values of a point that a title names."""


def linearized(
    model: CompiledModel, p: Array, at: Point, t: Time, settled: float, inputs: Names, outputs: Names
) -> LinearModel:
    """The network near a point.

    Args:
        model: the compiled model.
        p: parameter vector.
        at: speeds, twists and torques at the point, what is not named at rest; or a motion at one time; None for rest.
        t: time at which the laws are read, s; None for that of the motion or steady state, or else `settled`.
        settled: a time after which no law switches any more, s.
        inputs: names; None for all sources.
        outputs: names; None for the states.

    Raises:
        ParameterError: the point is none.
        SignalError: there is no such quantity.
        SimulationError: a law has no finite slope at the point, or a shaft is a wave.
    """
    named = input_names(model, inputs)
    point = None if model.form.waves else at  # a wave is refused below, whatever the names of the point
    time, x = operating_point(model, p, point, t, settled)
    slopes = Linearization(model, p, x, time, named)
    title = titled(model.form.graph.name, near(model, at, time))
    return linear_model(title, slopes, None if outputs is None else as_names(outputs), x, time)


def near(model: CompiledModel, at: Point, t: float) -> str:
    """What is linearised, in words, for titles: the point, and the time where laws depend on it; else nothing."""
    return "" if model.linear else about(model, at, t)


def about(model: CompiledModel, at: Point, t: float) -> str:
    """A point in words, and the time in s where laws depend on it: "at J1.omega = 8, laws at t = 2 s"."""
    graph = model.form.graph
    laws = (
        graph.in_network_symbols(branch.template.law, branch)
        for branch in graph.branches
        if branch.template.kind is Kind.LAW
    )
    when = f"{diagram.LAWS}{t:g} s" if any(TIME in law.free_symbols for law in laws) else ""
    if isinstance(at, Solution):
        return f"at t = {at.t[0]:g} s of a motion" + ("" if t == at.t[0] else when)
    entries = [f"{name} = {briefly(value)}" for name, value in (at or {}).items()]
    shown = ", ".join(entries if len(entries) <= NAMED else [*entries[: NAMED - 1], "..."])
    return (f"at {shown}" if entries else "at rest") + when


def titled(name: str, point: str, phase: str = "") -> str:
    """The title of what is linearised: the network, the point, and the phase in which it is there."""
    return " ".join((name, *filter(None, (point, f"({phase})" if phase else ""))))


def input_names(model: CompiledModel, inputs: Names) -> tuple[str, ...]:
    """The inputs asked for; None asks for all sources."""
    return source_inputs(model.form.graph) if inputs is None else as_names(inputs)


def operating_point(model: CompiledModel, p: Array, at: Point, t: Time, settled: float) -> tuple[float, Array]:
    """Time and states (n,) at a point; arguments as for `linearized`.

    Raises:
        ParameterError: the point is none.
        SignalError: there is no such quantity.
    """
    time, x = _moment(model, p, at, t, settled)
    if not model.linear:
        warn_of_turning_angles(model.bind(p), time, x)
    return time, x


def _moment(model: CompiledModel, p: Array, at: Point, t: Time, settled: float) -> tuple[float, Array]:
    if isinstance(at, Solution):
        time, x = moment_of(at, tuple(state.name for state in model.form.states))
        return time if t is None else in_si("t", t, "s"), x
    usual = at.t if isinstance(at, SteadyState) else settled
    time = usual if t is None else in_si("t", t, "s")
    bound = model.bind(p)
    if isinstance(at, SteadyState) or not isinstance(at, Mapping):
        return time, initial_state(bound, at if at is not None else {}, time)
    start = Start(bound, at, time)
    warn_of_speeds_left(start, model.form)
    return time, start.states


def campbell(
    model: CompiledModel,
    small_motions: SmallMotions,
    speeds: Any,
    orders: Any,
    f_max: float | None,
    at: Point | Callable[[float], Point],
    count: int | None,
    t: Time,
) -> diagram.Campbell:
    """The interference diagram, linearised at one point or, where `at` is a function of speed, at each.

    Args:
        model: the network.
        small_motions: from a point to the network near it.
        speeds: (k,) rad/s, ascending.
        orders: excitations per turn.
        f_max: highest frequency of interest, Hz.
        at: the point, or the point as a function of the speed.
        count: the modes wanted.
        t: time at which laws are read, s.

    Raises:
        ParameterError: speeds or orders are not what they must be, or no point is given and it matters.
    """
    if at is None:
        _refuse_no_point(model)

    def modes(speed: float, f_max: float) -> tuple[Modes, str]:
        near = small_motions(at(speed) if callable(at) else at, t, ())
        limit = None if isinstance(near, LinearModel) or count is not None else f_max
        return near.modes(count, limit), near.phase

    name = model.form.graph.name
    with once():
        return diagram.campbell(name, modes, speeds, orders, f_max, constant=not callable(at))


def _refuse_no_point(model: CompiledModel) -> None:
    """Refuse a diagram over speed of what swings otherwise where it runs, and is given no point.

    Raises:
        ParameterError: it is such a network; names the parts, and points that may be meant.
    """
    graph = model.form.graph
    modal = [part.name for part in graph.parts if part.modes]
    if model.linear and not modal:
        return
    laws = (
        part.name for part in graph.parts if any(graph.branches[k].template.kind is Kind.LAW for k in part.branches)
    )
    parts = listed(tuple(dict.fromkeys((*modal, *laws))))
    speeds = {name: as_multiple(ratio) for name, ratio in speeds_to_give(model).items()} or {"J1.omega": "n"}
    turning = ", ".join(f"'{name}': {value}" for name, value in speeds.items())
    options = " ".join(f"--at {name}={value}" for name, value in speeds.items())
    first = next(iter(speeds))
    raise ParameterError(
        f"A Campbell diagram of '{graph.name}' needs a point: how it swings depends on how it runs ({parts}). Give the "
        "speeds of all inertias where the exciting shaft turns at n rad/s (here those where it is that of "
        f"'{first}'), "
        + hint(
            f"at=lambda n: {{{turning}}}; or one point for all speeds, such as at=model.steady_state(), or at={{}} for "
            "rest.",
            f"{options}; or one point for all speeds: --steady, or --at {first}=0 for rest.",
        )
    )


def moment_of(motion: Solution, states: tuple[str, ...]) -> tuple[float, Array]:
    """Time in s and states (n,) of a motion that is a point.

    Args:
        motion: at one time.
        states: names of those that it must have.

    Raises:
        ParameterError: it has other states, or not one time.
    """
    if len(motion.t) != 1:
        raise ParameterError(
            f"at is a motion of {len(motion.t)} times; take one of them, such as at=sol.at([{motion.t[-1]:g}])."
        )
    if motion.states != states:
        raise ParameterError(
            f"at is a motion of '{motion.name}' with other states. The states here are: {', '.join(states)}."
        )
    return float(motion.t[0]), np.asarray(motion.x[0], dtype=float)
