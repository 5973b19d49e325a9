"""How natural frequencies and measures of a motion change with the parameters: exact, from the symbolic equations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.linalg import norm
from numpy.typing import NDArray
from scipy.linalg import eig, matrix_balance
from sympy import Symbol

from shaftwork.codegen.array_form.elements import Array
from shaftwork.core.errors import ParameterError, SimulationError
from shaftwork.formulation.sampling_instants import refuse_sampled
from shaftwork.numerics.tolerances import EQUAL, TYPED
from shaftwork.pipeline.arguments import Given, Point, Time, by_name, time_span
from shaftwork.pipeline.network import Network, network_of
from shaftwork.results.course import turning_points
from shaftwork.results.measures import EXTREMES, KINDS, POWERS, Measure
from shaftwork.results.observer import Complex
from shaftwork.results.solution import Solution
from shaftwork.sensitivities.differentiation import SlopeMatrix, rows_of
from shaftwork.sensitivities.motion_slopes import MotionSlopes
from shaftwork.sensitivities.parametric_motion import ParametricMotion
from shaftwork.sensitivities.sensitivity_tables import FrequencySensitivities, MotionSensitivities
from shaftwork.sensitivities.smooth_parameters import smooth_parameters


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
    names = smooth_parameters(model, parameters, ((model, model.defaults), (equations, p)))
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
    read = _measures(measures)
    integrands = dict.fromkeys(item for measure in read.values() if (item := integrand(measure)) is not None)
    quantities = dict.fromkeys(measure.quantity for measure in read.values())
    model, span = network_of(net).compile(), time_span(0.0, t_end)
    motion = ParametricMotion(model, tuple(quantities), tuple(integrands), parameters, span, initial, rtol)
    solution, slopes = motion.nominal.solution, motion.slopes(motion.nominal, {})
    integrals = dict(zip(integrands, slopes.integrals(), strict=True))
    results = {name: measured(item, solution, slopes, integrals) for name, item in read.items()}
    values = {name: value for name, (value, _) in results.items()}
    return MotionSensitivities(model.name, motion.parameters, values, {name: by for name, (_, by) in results.items()})


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
