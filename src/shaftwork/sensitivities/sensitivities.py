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
from shaftwork.frequency.analysis import Given, Point, Time, operating_point
from shaftwork.hybrid.phased_model import PhasedModel
from shaftwork.pipeline.arguments import relative_tolerance, time_span
from shaftwork.pipeline.model import Model
from shaftwork.pipeline.motion_start import refuse_motion
from shaftwork.results.course import SMALLEST, turning_points
from shaftwork.results.measures import KINDS, Measure
from shaftwork.results.observer import Complex
from shaftwork.results.solution import Solution
from shaftwork.sensitivities.differentiable import rows_of, smooth_parameters, without_start
from shaftwork.sensitivities.differentiation import Derivatives
from shaftwork.sensitivities.legs import motion_of
from shaftwork.sensitivities.motion_slopes import MotionSlopes
from shaftwork.sensitivities.sensitivity_tables import FrequencySensitivities, MotionSensitivities

APART = 1e-6
"""Rates that differ by less than this part of themselves are one rate, which has no derivative of its own."""
ROUNDINGS = 16
"""Roundings that the rate of a mode may have taken, each as large as its condition makes it."""
TIGHTER, TIGHTEST = 1e-2, 1e-13
"""Of the tolerance of derivatives is that of the motion, and no engine takes a smaller one."""
POWERS: Mapping[str, int] = {"mean": 1, "rms": 2}
"""Of the quantity, in the integral that makes a measure."""
EXTREMES = ("max", "min", "peak")
LEVEL = 1e-9
"""Two extremes are as high as each other where they differ by no more than this part of the range."""
ALIKE = 1e-7
"""They change alike where their percents for a percent of a parameter differ by no more than this."""


def frequency_sensitivities(
    model: Model, at: Point = None, *, parameters: Sequence[str] | None = None, t: Time = None
) -> FrequencySensitivities:
    """Derivatives of natural frequencies and damping ratios by parameters, the point held.

    Law: d rate = y* dA x / (y* x) with the right and left eigenvectors x, y of A.

    Args:
        model: the compiled network.
        at: the point, as for `Model.linearize`.
        parameters: names; by default all.
        t: time at which laws are read, s; by default as for `Model.linearize`.

    Raises:
        CompileError: the network is too large for symbolic equations.
        ParameterError: there is no such parameter.
        SimulationError: two modes that swing have the same rate.
    """
    equations, p, x, time = _near(model, at, t)
    names = smooth_parameters(model, parameters, (model, equations))
    derivatives = Derivatives(rows_of(equations), tuple(Symbol(name, real=True) for name in names))
    matrix = derivatives.by_states(time, x, p)
    rates, left, right = eig(matrix, left=True, right=True)
    swinging = np.flatnonzero(rates.imag > 0)
    swinging = swinging[np.argsort(np.abs(rates[swinging]), kind="stable")]
    _refuse_equal(rates, swinging, _roundings(matrix, left, right))
    changes = derivatives.jacobian_slopes(time, x, p)
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
    return np.asarray(ROUNDINGS * np.finfo(float).eps * norm(balanced) * condition)


def _refuse_equal(rates: Complex, chosen: NDArray[np.intp], roundings: Array) -> None:
    for number, k in enumerate(chosen.tolist()):
        others = np.delete(rates, k)
        if others.size and np.abs(others - rates[k]).min() < APART * np.abs(rates[k]) + roundings[k]:
            raise SimulationError(
                f"Mode {number + 1}, {abs(rates[k]) / (2 * np.pi):.6g} Hz, has the rate of another one: a frequency "
                "that two modes share has no derivative. Make what is alike in the network a little different."
            )


def motion_sensitivities(
    model: Model,
    measures: Mapping[str, Measure],
    t_end: float,
    *,
    parameters: Sequence[str] | None = None,
    initial: Given = None,
    rtol: float = 1e-9,
) -> MotionSensitivities:
    """Derivatives of measures of a motion by parameters, from the sensitivity equations along the motion.

    Law: S' = (df/dx) S + df/dp for S = dx/dp within a leg, `JumpConditions` from one to the next; of an extreme,
    dq/dx S + dq/dp at its time, since q' = 0 there, and at a change along with the time of the change.

    Args:
        model: the compiled network.
        measures: by name; all kinds but "damage".
        t_end: end of the motion, s.
        parameters: names; by default all in which the motion is smooth.
        initial: start values of states, which do not change with the parameters. Parameters that move other states at
            the start are left out; one that is asked for is refused.
        rtol: relative tolerance; that of the motion is tighter.

    Raises:
        CompileError: some equations on the way are too large to be symbolic.
        ParameterError: there is no such parameter, or a measure or start value is none that has a derivative here.
        SignalError: there is no such quantity.
        SimulationError: there is no derivative; says what comes together or is only touched, and when.
    """
    refuse_motion(initial, "motion_sensitivities")
    span, tolerance = time_span(0.0, t_end), relative_tolerance(rtol)
    states = {state.name for state in model.form.states}
    if unknown := [name for name in initial or {} if name not in states]:
        raise ParameterError(
            f"'{unknown[0]}' is no state, so it starts at another state for other parameters. Give start values of "
            f"states: {', '.join(sorted(states))}."
        )
    rows_of(model)
    smooth_parameters(model, parameters, (model,), span)  # what is wrong with them is said before the motion is made
    integrands = dict.fromkeys(item for measure in measures.values() if (item := integrand(measure)) is not None)
    motion = motion_of(model, span, initial, max(TIGHTER * tolerance, TIGHTEST))
    names = smooth_parameters(model, parameters, motion.models, span)
    names = without_start(model, names, initial, span, are_asked=parameters is not None)
    nominal = {name: model.parameters[name] for name in names}
    quantities = dict.fromkeys(measure.quantity for measure in measures.values())
    if unknown := [name for name in quantities if name not in motion.solution]:
        _ = motion.solution[unknown[0]]  # raises, with what there is
    slopes = MotionSlopes(motion, nominal, tuple(quantities), tuple(integrands), tolerance)
    integrals = dict(zip(integrands, slopes.integrals(), strict=True))
    results = {name: measured(item, motion.solution, slopes, integrals) for name, item in measures.items()}
    values = {name: value for name, (value, _) in results.items()}
    return MotionSensitivities(model.name, nominal, values, {name: by for name, (_, by) in results.items()})


def _near(model: Model, at: Point, t: Time) -> tuple[Model, Array, Array, float]:
    """The equations that hold at a point, their parameters, the states and the time."""
    if not isinstance(model, PhasedModel):
        p = model.defaults
        time, x = operating_point(model, p, at, t, model.settled(p))
        return model, p, x, time
    time, moment = model.point({}, at, t)
    return moment.regime.assembly.model, moment.regime.p, moment.x, time


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
    turns = turning_points(lambda times: slopes.values(measure.quantity, times), slopes.steps, smallest=SMALLEST)
    heights = {"max": turns.values, "min": -turns.values, "peak": np.abs(turns.values)}[measure.kind]
    level = heights.max() - LEVEL * float(np.ptp(turns.values))
    highest = np.flatnonzero(heights >= level).tolist()
    signs = np.sign(turns.values) if measure.kind == "peak" else np.ones(len(turns.values))
    times = [slopes.turning(measure.quantity, float(turns.t[k])) for k in highest]
    derivatives = np.array([signs[k] * slopes.slopes(measure.quantity, t) for k, t in zip(highest, times, strict=True)])
    if (np.ptp(derivatives, axis=0) * np.abs(slopes.parameters) > ALIKE * np.abs(turns.values).max()).any():
        words = " and ".join(f"{time:.9g}" for time in times[:2])
        raise SimulationError(
            f"'{measure}' is reached at t = {words} s alike, and which of them is higher depends on the parameters: "
            "there is no derivative. Take a shorter or a longer motion."
        )
    best = int(heights.argmax())
    return float(signs[best] * turns.values[best]), np.asarray(derivatives[highest.index(best)])
