"""The frequency domain of a compiled network: the point, the slopes there, and the record of both."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import compress
from typing import Any

import numpy as np

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.array_form.inputs import is_linear
from shaftwork.codegen.compiled_model import CompiledModel
from shaftwork.codegen.start_names import inner_nodes, node_of, speed_at
from shaftwork.codegen.start_values import Start, initial_state
from shaftwork.components.branches import ACROSS, INTEGRAL
from shaftwork.components.law_slopes import jumps, slope
from shaftwork.components.laws import t as TIME
from shaftwork.core.domains import ELECTRICAL
from shaftwork.core.errors import NetworkWarning, ParameterError
from shaftwork.core.notices import PulsationWarning, hint, once, warn
from shaftwork.core.parameters import briefly, in_si
from shaftwork.formulation.form import StateForm
from shaftwork.formulation.gains import value_of
from shaftwork.formulation.source_inputs import source_inputs
from shaftwork.formulation.tree import column_of
from shaftwork.formulation.value_diagnosis import speeds_along
from shaftwork.frequency import campbell as diagram
from shaftwork.frequency.linear_model import ExactModel, LinearModel, linear_model
from shaftwork.frequency.linearization import Linearization
from shaftwork.frequency.natural_modes import NaturalModes
from shaftwork.network.graph import GROUND, CircuitGraph, Reading, readings_of
from shaftwork.network.kinds import Kind
from shaftwork.network.netlist import listed
from shaftwork.numerics.tolerances import TYPED
from shaftwork.pipeline.arguments import Names, Point, Time, as_names
from shaftwork.pipeline.prepared import OperatingPoint
from shaftwork.pipeline.settled import SteadyState
from shaftwork.results.solution import Solution

SmallMotions = Callable[[Point, Time, Names], LinearModel | ExactModel]
"""From a point, a time and names of inputs to the network near that point."""


def speeds_to_give(model: CompiledModel, reference: int | None = None) -> Mapping[str, float | None]:
    """The speeds that tell how a network turns, as multiples of one; None where that does not tell them.

    What is tied rigidly to them follows, and so do the speeds inside shafts. Springs keep their twist, and what joins
    at times, as clutches, gaps and ropes do, is taken for joined: behind a gear of ratio 3 is a third. Behind a
    planetary gear of which one shaft is free, a speed is open.

    Args:
        model: the network.
        reference: node of that one speed; by default of the first.
    """
    form = model.form
    inside = inner_nodes(form)
    nodes = dict.fromkeys(node_of(form, branch) for branch in form.across_states)
    named = [node for node in nodes if node not in inside and form.graph.domains[node] is not ELECTRICAL]
    start = reference if reference is not None or not named else named[0]
    ratios = {} if start is None else turning_speeds(form.graph, start)
    return {speed_at(form, node): ratios.get(node) for node in named}


def turning_speeds(graph: CircuitGraph, start: int) -> dict[int, float]:
    """Speeds of the nodes over that of one while no twist changes; those that no joint ties follow by their dampers.

    What hangs on a damper alone, as the ring of a viscous damper does, turns with its shaft. What the frame holds, as
    the ring of a planetary gear, stands, unless it is tied to what turns.

    Args:
        graph: the network.
        start: the node whose speed is 1.
    """
    joined = list(_joints(graph))
    speeds = speeds_along(graph, {start: 1.0}, joined)
    standing = (node for node in _held(graph, joined) if node not in speeds)
    speeds = speeds_along(graph, {**speeds, **dict.fromkeys(standing, 0.0)}, joined)
    dampers = (graph.branches[k] for part in graph.parts if part.component.role == "loss" for k in part.branches)
    hanging = (
        {branch.plus: 1.0, branch.minus: -1.0}
        for branch in dampers
        if branch.template.kind in (Kind.CONDUCTANCE, Kind.LAW) and not {branch.plus, branch.minus} <= speeds.keys()
    )
    return speeds_along(graph, speeds, [*joined, *hanging])


def _held(graph: CircuitGraph, joints: Sequence[Mapping[int, float]]) -> Iterator[int]:
    """The nodes that the frame holds: by a spring, a rigid joint or a prescribed speed of zero."""
    for branch in graph.branches:
        if branch.template.kind is Kind.ACROSS_SOURCE and branch.template.law == 0:
            yield from (node for node in (branch.plus, branch.minus) if node != GROUND)
    modal = {node for part in graph.parts if part.modes for node in part.nodes.values()}  # which may let go
    for joint in joints:
        moving = [node for node in joint if node != GROUND]
        if len(moving) == 1 and moving[0] not in modal:
            yield moving[0]


def _joints(graph: CircuitGraph) -> Iterator[Mapping[int, float]]:
    """Speeds of nodes that depend on each other while no twist changes: node to factor, in sums that are zero."""
    for part in graph.parts:
        branches = [graph.branches[k] for k in part.branches]
        kinds = {branch.template.kind for branch in branches}
        joined = bool(part.component.profiles()) or any(branch.template.is_history for branch in branches)
        if joined or (part.modes and Kind.COUPLING not in kinds):  # of a long shaft, whatever is between its ends
            yield dict(zip((part.nodes[port.name] for port in part.component.ports), (1.0, -1.0), strict=False))
        for branch in branches:
            if branch.template.kind in (Kind.THROUGH_STORE, Kind.COUPLING):
                yield {node: value_of(factor) for node, factor in column_of(graph, branch).items()}


def as_multiple(ratio: float | None) -> str:
    """A multiple of the speed n as Python and the command line read it: "n", "n/3", "2.5*n"; "..." for None."""
    if ratio is None:
        return "..."
    sign, size = "-" * (ratio < 0), abs(ratio)
    if size == 0:
        return "0"
    if abs(size - 1) < TYPED:
        return f"{sign}n"
    return f"{sign}n/{1 / size:.10g}" if size < 1 else f"{sign}{size:.10g}*n"


def warn_of_speeds_left(start: Start, form: StateForm) -> None:
    """Warn where a point gives some speeds and leaves others at rest on which something depends that is not linear.

    Args:
        start: the way from the point to the states.
        form: of the network.
    """
    graph, left = form.graph, start.nodes_left
    if not left:
        return
    parts = {
        part.name: node
        for part in graph.parts
        for node in part.nodes.values()
        if node in left and (part.modes or any(_bends(graph, k) for k in part.branches if node in _ends(graph, k)))
    }
    if not parts:
        return
    speeds = tuple(dict.fromkeys(speed_at(form, node) for node in parts.values()))
    example = hint(
        "at={..., " + ", ".join(f"'{name}': ..." for name in speeds) + "}",
        " ".join(f"--at {name}=..." for name in speeds),
    )
    warn(
        f"The point of '{graph.name}' gives some speeds and leaves {listed(speeds)} at 0, where {listed(tuple(parts))} "
        f"depends on it: what stands has other frequencies than what runs. Give {example}; 0 where it does stand.",
        NetworkWarning,
    )


def warn_of_turning_angles(bound: BoundArrays, t: float, x: Array) -> None:
    """Warn where a law is linearised at one angle of a shaft that turns: a pulsation is frozen at that angle.

    Args:
        bound: the equations of the network.
        t: time at which laws are read, s.
        x: (n,) states at the point.
    """
    form, first = bound.program.form, len(x) - len(bound.program.form.integrals)
    rates = np.abs(bound.rhs(t, x)[first:])
    turns = rates > TYPED * np.append(rates, np.abs(x[: len(form.across_states)])).max(initial=0.0)
    angles = zip(form.integrals, form.states[first:], x[first:], strict=True)
    for branch, state, value in compress(angles, turns):
        if readers := _readers(form, branch):
            warn(
                f"The point of '{form.graph.name}' is one moment of a motion: '{state.name}' does not stay, and what "
                f"{listed(readers)} gives bends with it. All is linearised at {state.name} = {value:.4g} {state.unit}; "
                "elsewhere in a turn, frequencies and damping are others. Of a torque that pulsates linearise the mean "
                "over a turn: leave the pulsation out of the law, and take it as an excitation, by the orders of a "
                "diagram or the frequencies of a response.",
                PulsationWarning,
            )


def without_swing(model: CompiledModel, p: Array) -> Array:
    """The parameter vector with which what swings with an angle has its mean alone, of which small motions are taken.

    At one angle of the shaft the swing would be a spring, which it is not over a turn: it excites.
    """
    parts = model.form.graph.parts
    swinging = {f"{part.name}.{part.component.swing}" for part in parts if part.component.swing}
    names = tuple(model.parameters)
    return np.where([name in swinging for name in names], 0.0, p) if swinging else p


def _readers(form: StateForm, integral: int) -> tuple[str, ...]:
    """The parts with a law whose slopes depend on the integral of a branch, or that jumps with it."""
    graph, names = form.graph, dict[str, None]()
    for branch in form.laws:
        template = graph.branches[branch].template
        symbols = [INTEGRAL] if branch == integral else []
        for symbol in (*symbols, *(one for one, of in readings_of(graph, branch).items() if of == _integral(integral))):
            if slope(template.law, symbol).has(ACROSS, INTEGRAL, *template.reads) or jumps(template.law, symbol):
                part = graph.part_of(branch)
                if not part.component.swing:  # which is left out
                    names[part.name] = None
    return tuple(names)


def _integral(branch: int) -> Reading:
    return Reading("integral", branch)


def _bends(graph: CircuitGraph, branch: int) -> bool:
    template = graph.branches[branch].template
    return template.kind is Kind.LAW and not is_linear(template.law, (ACROSS, *template.reads))


def _ends(graph: CircuitGraph, branch: int) -> tuple[int, int]:
    return graph.branches[branch].plus, graph.branches[branch].minus


def linearized(name: str, point: OperatingPoint, at: Point, inputs: Names, outputs: Names) -> LinearModel:
    """The network near a point.

    Args:
        name: of the network.
        point: the equations that hold there, and where it is.
        at: the point as it was given.
        inputs: names; None for all sources.
        outputs: names; None for the states.

    Raises:
        SignalError: there is no such input or output.
        SimulationError: a law has no finite slope at the point.
    """
    model, p, time, x, phase = point
    slopes = Linearization(model, p, x, time, input_names(model, inputs))
    where = about(model, at, time) if phase else near(model, at, time)
    title = titled(name, where, phase)
    return linear_model(title, slopes, None if outputs is None else as_names(outputs), x, time, phase)


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
    most = 4  # values that a title names
    shown = ", ".join(entries if len(entries) <= most else [*entries[: most - 1], "..."])
    return (f"at {shown}" if entries else "at rest") + when


def titled(name: str, point: str, phase: str = "") -> str:
    """The title of what is linearised: the network, the point, and the phase in which it is there."""
    return " ".join((name, *filter(None, (point, f"({phase})" if phase else ""))))


def input_names(model: CompiledModel, inputs: Names) -> tuple[str, ...]:
    """The inputs asked for; None asks for all sources."""
    return source_inputs(model.form.graph) if inputs is None else as_names(inputs)


def operating_point(model: CompiledModel, p: Array, at: Point, t: Time, settled: float) -> tuple[float, Array]:
    """Time and states (n,) at a point.

    Args:
        model: the compiled model.
        p: parameter vector.
        at: speeds, twists and torques at the point, what is not named at rest; or a motion at one time; None for rest.
        t: time at which the laws are read, s; None for that of the motion or steady state, or else `settled`.
        settled: a time after which no law switches any more, s.

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
        refuse_no_point(model, "A Campbell diagram")

    def modes(speed: float, f_max: float) -> tuple[NaturalModes, str]:
        near = small_motions(at(speed) if callable(at) else at, t, ())
        limit = None if isinstance(near, LinearModel) or count is not None else f_max
        return near.modes(count, limit), near.phase

    name = model.form.graph.name
    with once():
        return diagram.campbell(name, modes, speeds, orders, f_max, constant=not callable(at))


def refuse_no_point(model: CompiledModel, what: str) -> None:
    """Refuse what is computed over speed of a network that swings otherwise where it runs, and is given no point.

    Args:
        model: the network.
        what: is computed, "A Campbell diagram".

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
        f"{what} of '{graph.name}' needs a point: how it swings depends on how it runs ({parts}). Give the "
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
