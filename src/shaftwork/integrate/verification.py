"""What a run of a linear network is worth: what rounding leaves of it, and how far it is from the exact motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shaftwork.integrate import exact
from shaftwork.integrate.observation import largest_part, rounding, samples
from shaftwork.integrate.problem import Array, Observed, Problem, Trajectory

# Rounding is worth saying from this part of the largest value of its kind. It is an estimate, no
# bound: with it none of 1771 random networks, parameters from 1e-12 to 1e12, is off by 1e-6 without a word.
WORTH_SAYING = 2e-7
# A smaller error than this is not said of an engine, whatever its tolerance: rounding adds up over its steps.
SMALLEST = 1e-9
# An engine with a tolerance may be off by this many times of it; an error of so much is said.
TOLERATED = 50.0


def objection(problem: Problem, trajectory: Trajectory, engine: str) -> str | None:
    """What must be said of a run of a linear network, or None.

    Args:
        problem: what was solved.
        trajectory: the run.
        engine: that made it.
    """
    if problem.observed is None or not trajectory.t.size:
        return None
    chosen = samples(trajectory.t.size)
    times, states = trajectory.t[chosen], trajectory.x[chosen]
    values, (part, name) = rounding(problem.observed, times, states)
    if part > WORTH_SAYING:
        return (
            f"strong damping: what couples speeds at {name!r} is so strong that the rounding of these speeds alone may "
            f"change what passes through parts by {part:.1g} of the largest. Make such a coupling rigid: leave the "
            "damper out and wire its ends to one node."
        )
    if engine == "exact":
        return _doubt(trajectory)
    return _distance(problem, problem.observed, times, values, engine)


def _distance(problem: Problem, observed: Observed, times: Array, values: Array, engine: str) -> str | None:
    """How far the run is from the exact motion, where that is worth saying."""
    run = exact.reference(replace(problem, t_eval=times))
    if run is None:
        return None
    wanted = observed.values(times, run.x)
    part, name = largest_part(observed, np.abs(values - wanted).max(axis=0, initial=0.0), wanted)
    if part <= max(TOLERATED * problem.rtol, SMALLEST) + run.doubt:
        return None
    return (
        f"the engine {engine!r} is off by {part:.1g} of the largest value of its kind at {name!r}, more than rtol = "
        f"{problem.rtol:.1g} leads one to expect: the exact motion of this linear network says so. Take engine='exact' "
        "or 'auto', or a smaller rtol."
    )


def _doubt(trajectory: Trajectory) -> str | None:
    if trajectory.doubt <= WORTH_SAYING:
        return None
    return (
        f"rates lie so far apart that the rounding of the matrix may change the motion by a part of "
        f"{trajectory.doubt:.1g}, and with more digits the run would take too long. Leave out what is stiffer or "
        "slower than matters, or make it rigid."
    )
