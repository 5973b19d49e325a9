"""Derivatives of measures of a motion by parameters: of extremes, means and the value at the end."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from shaftwork.codegen.elements import Array
from shaftwork.core.errors import ParameterError, SimulationError
from shaftwork.pipeline.sensitivities.motion_slopes import MotionSlopes
from shaftwork.results.course import SMALLEST, turning_points
from shaftwork.results.measures import KINDS, Measure
from shaftwork.results.solution import Solution

POWERS: Mapping[str, int] = {"mean": 1, "rms": 2}
"""Of the quantity, in the integral that makes a measure."""
EXTREMES = ("max", "min", "peak")
LEVEL = 1e-9
"""Two extremes are as high as each other where they differ by no more than this part of the range."""
ALIKE = 1e-7
"""They change alike where their percents for a percent of a parameter differ by no more than this."""


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
    found = np.array([signs[k] * slopes.slopes(measure.quantity, t) for k, t in zip(highest, times, strict=True)])
    if (np.ptp(found, axis=0) * np.abs(slopes.parameters) > ALIKE * np.abs(turns.values).max()).any():
        words = " and ".join(f"{time:.9g}" for time in times[:2])
        raise SimulationError(
            f"'{measure}' is reached at t = {words} s alike, and which of them is higher depends on the parameters: "
            "there is no derivative. Take a shorter or a longer motion."
        )
    best = int(heights.argmax())
    return float(signs[best] * turns.values[best]), np.asarray(found[highest.index(best)])
