"""How natural frequencies and measures of a motion change with the parameters: exact, from the symbolic equations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.linalg import norm
from numpy.typing import NDArray
from scipy.linalg import eig, matrix_balance
from sympy import Symbol

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.compiled_model import CompiledModel
from shaftwork.components.law_slopes import slope
from shaftwork.components.laws import t as TIME
from shaftwork.components.noise import HeldNoise, SmoothNoise
from shaftwork.core.errors import ParameterError, SimulationError
from shaftwork.formulation.sampling_instants import refuse_sampled
from shaftwork.numerics.tolerances import EQUAL, TYPED
from shaftwork.pipeline.arguments import Given, Point, Time, by_name, relative_tolerance, time_span
from shaftwork.pipeline.model import Model
from shaftwork.pipeline.motion_start import refuse_motion
from shaftwork.pipeline.network import Network, network_of
from shaftwork.results.course import turning_points
from shaftwork.results.measures import EXTREMES, KINDS, POWERS, Measure
from shaftwork.results.observer import Complex
from shaftwork.results.solution import Solution
from shaftwork.sensitivities.differentiation import SlopeMatrix, rows_of
from shaftwork.sensitivities.legs import motion_of
from shaftwork.sensitivities.motion_slopes import DifferentiatedEquations, MotionSlopes
from shaftwork.sensitivities.sensitivity_tables import FrequencySensitivities, MotionSensitivities

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


def frequency_sensitivities(
    net: Network, at: Point = None, *, parameters: Sequence[str] | None = None, t: Time = None
) -> FrequencySensitivities:
    """Derivatives of the natural frequencies and damping ratios of a network by its parameters, exact.

    Law: d rate = y* dA x / (y* x) with the right and left eigenvectors x, y of A.

    Args:
        net: the network.
        at: the point about which it moves, as for `Network.modes`; it is held while a parameter changes.
        parameters: names, "shaft.c"; by default all in which the equations are smooth: not what is exactly zero, whole
            or the seed of a noise.
        t: time at which laws are read, s.

    Raises:
        CompileError: the network is too large for symbolic equations.
        ParameterError: there is no such parameter.
        SimulationError: two modes have the same rate.
    """
    model = network_of(net).compile()
    refuse_sampled(model.form, "it has no frequencies")
    equations, p, time, x, _ = model.point({}, at, t)
    names = smooth_parameters(model, _listed(parameters), (model, equations))
    rows = rows_of(equations)
    jacobian = SlopeMatrix(rows, rows.rates, rows.states)
    matrix = jacobian(time, x, p)
    rates, left, right = eig(matrix, left=True, right=True)
    swinging = np.flatnonzero(rates.imag > 0)
    swinging = swinging[np.argsort(np.abs(rates[swinging]), kind="stable")]
    _refuse_equal(rates, swinging, _roundings(matrix, left, right))
    changes = jacobian.differentiated(tuple(Symbol(name, real=True) for name in names), time, x, p)
    slopes = np.array([_slope(left[:, k], changes, right[:, k]) for k in swinging]).reshape(len(swinging), len(names))
    values = dict(zip(equations.parameters, p.tolist(), strict=True))
    nominal = {name: values.get(name, model.parameters[name]) for name in names}
    return FrequencySensitivities(model.name, nominal, rates[swinging], slopes)


def _slope(left: Complex, changes: Array, right: Complex) -> Complex:
    """(parameters,) derivative of one rate."""
    slope: Complex = np.einsum("i,pij,j->p", left.conj(), changes, right) / (left.conj() @ right)
    return slope


def _roundings(matrix: Array, left: Complex, right: Complex) -> Array:
    """(n,) how far rounding may have moved each rate: that of the matrix times the condition 1 / |y* x| of the rate.

    Both depend on the units of the states, which are chosen as the solver chooses them: rows as large as columns.
    """
    balanced, (scale, _) = matrix_balance(matrix, permute=False, separate=True)
    sizes = norm(left * scale[:, None], axis=0) * norm(right / scale[:, None], axis=0)
    condition = sizes / np.abs((left.conj() * right).sum(axis=0))
    # A rate may have taken 16 roundings, each as large as its condition makes it.
    return np.asarray(16 * np.finfo(float).eps * norm(balanced) * condition)


def _refuse_equal(rates: Complex, chosen: NDArray[np.intp], roundings: Array) -> None:

    for number, k in enumerate(chosen.tolist()):
        others = np.delete(rates, k)
        if others.size and np.abs(others - rates[k]).min() < EQUAL * np.abs(rates[k]) + roundings[k]:
            raise SimulationError(
                f"Mode {number + 1}, {abs(rates[k]) / (2 * np.pi):.6g} Hz, has the rate of another one: a frequency "
                "that two modes share has no derivative. Make what is alike in the network a little different."
            )


def motion_sensitivities(
    net: Network,
    measures: Mapping[str, str] | Sequence[str],
    *,
    t_end: float,
    parameters: Sequence[str] | None = None,
    initial: Given = None,
    rtol: float = 1e-9,
) -> MotionSensitivities:
    """Derivatives of measures of a motion by the parameters of the network, exact, by its sensitivity equations.

    Law: S' = (df/dx) S + df/dp for S = dx/dp within a leg, `JumpConditions` from one to the next; of an extreme,
    dq/dx S + dq/dp at its time, since q' = 0 there, and at a change along with the time of the change.

    They go through all that changes on the way: modes of parts, impacts, laws that switch with the time or the motion.

    Args:
        net: the network.
        measures: as in `sweep`; all but "damage".
        t_end: end of the motion, s.
        parameters: names, "shaft.c"; by default all in which the motion is smooth.
        initial: start values of states, which do not change with the parameters. Parameters that move other states at
            the start are left out; one that is asked for is refused.
        rtol: relative tolerance of the derivatives; the motion is computed a hundred times closer.

    Raises:
        CompileError: there are no symbolic equations for a part of the way.
        ParameterError: there is no such parameter or measure, or nothing is smooth in it.
        SignalError: there is no such quantity.
        SimulationError: there is no derivative: something is only touched, what comes together has no order, a
            prescribed speed jumps against an inertia, or two extremes are of one height.
    """
    read, names, model = _measures(measures), _listed(parameters), network_of(net).compile()
    refuse_sampled(model.form, "its derivatives by parameters are not followed from instant to instant")
    refuse_motion(initial, "motion_sensitivities")
    span, tolerance = time_span(0.0, t_end), relative_tolerance(rtol)
    states = {state.name for state in model.form.states}
    if unknown := [name for name in initial or {} if name not in states]:
        raise ParameterError(
            f"'{unknown[0]}' is no state, so it starts at another state for other parameters. Give start values of "
            f"states: {', '.join(sorted(states))}."
        )
    rows_of(model)
    smooth_parameters(model, names, (model,), span)  # what is wrong with them is said before the motion is made
    integrands = dict.fromkeys(item for measure in read.values() if (item := integrand(measure)) is not None)
    # The motion is a hundred times as close as its derivatives; no engine takes a tolerance below 1e-13.
    motion = motion_of(model, span, initial, max(1e-2 * tolerance, 1e-13), {})
    names = smooth_parameters(model, names, motion.models, span)
    names = without_start(model, names, initial, span, are_asked=parameters is not None)
    nominal = {name: model.parameters[name] for name in names}
    quantities = dict.fromkeys(measure.quantity for measure in read.values())
    if unknown := [name for name in quantities if name not in motion.solution]:
        _ = motion.solution[unknown[0]]  # raises, with what there is
    equations = DifferentiatedEquations(names, tuple(quantities), tuple(integrands))
    slopes = MotionSlopes(motion, equations, np.array(list(nominal.values())), tolerance)
    integrals = dict(zip(integrands, slopes.integrals(), strict=True))
    results = {name: measured(item, motion.solution, slopes, integrals) for name, item in read.items()}
    values = {name: value for name, (value, _) in results.items()}
    return MotionSensitivities(model.name, nominal, values, {name: by for name, (_, by) in results.items()})


def _measures(measures: Mapping[str, str] | Sequence[str]) -> dict[str, Measure]:
    """Measures by name.

    Raises:
        ParameterError: one is none, or is something else than a text.
    """
    named = by_name(measures)
    if others := [name for name, text in named.items() if not isinstance(text, str)]:
        raise ParameterError(
            f"measure '{others[0]}' = {named[others[0]]!r} must be a name, such as 'max shaft.tau': of anything else "
            "nothing here knows the derivative. Take differences of two runs."
        )
    return {name: Measure.read(text) for name, text in named.items()}


def _listed(names: Sequence[str] | None) -> Sequence[str] | None:
    return (names,) if isinstance(names, str) else names


def integrand(measure: Measure) -> tuple[str, int] | None:
    """What is integrated for a measure: quantity and power, or None.

    Raises:
        ParameterError: the measure has no derivative here.
    """
    if measure.kind not in ("end", *EXTREMES, *POWERS):
        others = ", ".join(f"'{kind}'" for kind in KINDS if kind != measure.kind)
        raise ParameterError(f"'{measure}' has no derivative here. Take {others} of a speed, a torque or a twist.")
    return (measure.quantity, POWERS[measure.kind]) if measure.kind in POWERS else None


def measured(
    measure: Measure, solution: Solution, slopes: MotionSlopes, integrals: Mapping[tuple[str, int], Array]
) -> tuple[float, Array]:
    """A measure and its derivatives (m,).

    Args:
        measure: what is asked.
        solution: the motion.
        slopes: the derivatives of the motion.
        integrals: (m,) derivatives of what is integrated for measures.

    Raises:
        SimulationError: there is no derivative.
    """
    if measure.kind in EXTREMES:
        return _extreme(measure, slopes)
    times = solution.steps
    if measure.kind == "end":
        value = slopes.values(measure.quantity, times[-1:])[0]
        return float(value), slopes.slopes(measure.quantity, float(times[-1]))
    power, value = POWERS[measure.kind], measure.of(solution)
    if power > 1 and value == 0.0:
        raise SimulationError(f"'{measure}' is zero, its least value, and has no derivative there.")
    by = integrals[measure.quantity, power] / (times[-1] - times[0])
    return value, by / (power * value ** (power - 1))


def _extreme(measure: Measure, slopes: MotionSlopes) -> tuple[float, Array]:
    turns = turning_points(lambda times: slopes.values(measure.quantity, times), slopes.steps, smallest=EQUAL)
    heights = {"max": turns.values, "min": -turns.values, "peak": np.abs(turns.values)}[measure.kind]
    level = heights.max() - TYPED * float(np.ptp(turns.values))
    highest = np.flatnonzero(heights >= level).tolist()
    signs = np.sign(turns.values) if measure.kind == "peak" else np.ones(len(turns.values))
    times = [slopes.turning(measure.quantity, float(turns.t[k])) for k in highest]
    derivatives = np.array([signs[k] * slopes.slopes(measure.quantity, t) for k, t in zip(highest, times, strict=True)])
    # Both change alike where their percents for a percent of a parameter differ by no more.
    if (np.ptp(derivatives, axis=0) * np.abs(slopes.parameters) > 1e-7 * np.abs(turns.values).max()).any():
        words = " and ".join(f"{time:.9g}" for time in times[:2])
        raise SimulationError(
            f"'{measure}' is reached at t = {words} s alike, and which of them is higher depends on the parameters: "
            "there is no derivative. Take a shorter or a longer motion."
        )
    best = int(heights.argmax())
    return float(signs[best] * turns.values[best]), np.asarray(derivatives[highest.index(best)])


def smooth_parameters(
    model: Model, names: Sequence[str] | None, used: Sequence[CompiledModel], span: tuple[float, float] | None = None
) -> tuple[str, ...]:
    """The parameters by which to differentiate.

    Args:
        model: the compiled network.
        names: of parameters; None for all in which the equations are smooth.
        used: models of all equations that hold on the way.
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
    for one in used:
        reasons |= dict.fromkeys((*one.form.graph.zeros, *one.form.tree.frozen), "decisive")
        reasons |= dict.fromkeys(_seeds(one), "seed")
        if span is not None:
            reasons |= dict.fromkeys(_at_edges(one, span), "edge")
    if names is None:
        return tuple(name for name in numbers if name not in reasons)
    for name in names:
        if name in reasons:
            raise ParameterError(f"'{name}' {NO_DERIVATIVE[reasons[name]]}")
        if name not in numbers:
            raise ParameterError(f"There is no parameter '{name}' with a number. There are: {', '.join(numbers)}.")
    return tuple(names)


def _seeds(model: CompiledModel) -> Iterator[str]:
    graph = model.form.graph
    for branch in graph.branches:
        law = graph.in_network_symbols(branch.template.law, branch)
        for noise in law.atoms(HeldNoise, SmoothNoise):
            yield from (symbol.name for symbol in noise.args[1].free_symbols)


def _at_edges(model: CompiledModel, span: tuple[float, float]) -> Iterator[str]:
    """Parameters that move a switch of a law of time, or of a mode, which is at the start or at the end of a motion."""
    switching, p = model.switching, model.defaults
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
    states, start = _start(model, {}, initial, span)
    shift = 1e-3  # by which part each parameter is made smaller
    other = _start(model, {name: value * (1 - shift) for name, value in values.items()}, initial, span)[1]
    far = np.abs(other - start) > TYPED * shift * np.abs(start).max(initial=0.0)
    return tuple(name for name, moves in zip(states, far.tolist(), strict=True) if moves)


def _start(
    model: Model, values: Mapping[str, float], initial: Given, span: tuple[float, float]
) -> tuple[tuple[str, ...], Array]:
    """The states by name, and where they start, in the equations in which nothing is joined."""
    if not model.phased:
        return tuple(model.states), model.state_at_start(model.prepare(model.vector(values)), initial, span)[0]
    first, p = cast("HybridModel", model).equation_sets.first_equations(values)
    return tuple(first.model.states), first.model.state_at_start(first.prepared(p), initial, span)[0]
