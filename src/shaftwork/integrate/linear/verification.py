"""What a run of a linear network is worth: what rounding leaves of it, and how far it is from the exact motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shaftwork.core.errors import SimulationError
from shaftwork.integrate.linear import propagation
from shaftwork.integrate.linear.rounding_errors import REMEDY, WORTH_SAYING, largest_part, outlook, rounding, samples
from shaftwork.integrate.problem import TOLERATED, UNSURPRISING, Array, Observed, Problem, Trajectory

# A state that changes by less, as a part of what its rate is made of, stands still but for rounding.
STILL = 64 * float(np.finfo(float).eps)


def objection(problem: Problem, observed: Observed, trajectory: Trajectory, engine: str) -> str | None:
    """What must be said of a run of a linear network, or None.

    Args:
        problem: what was solved.
        observed: all quantities of the network.
        trajectory: the run, with a time at least.
        engine: that made it.
    """
    if _goes_on_as_it_is(problem, trajectory):
        return None
    chosen = samples(trajectory.t.size)
    chosen = chosen[~np.isin(trajectory.t[chosen], problem.breakpoints)]  # values there have two sides
    times, states = trajectory.t[chosen], trajectory.x[chosen]
    try:
        values, changed = rounding(observed, times, states)
    except SimulationError:  # a law has no value: what needs it is refused where it is read
        return None
    part, name = _part(observed, trajectory, changed, values, WORTH_SAYING)
    if part > WORTH_SAYING:
        return (
            f"strong damping: what couples speeds at {name!r} is so strong that the rounding of these speeds alone may "
            f"change what passes through parts by {part:.1g} of the largest. {REMEDY}"
        )
    if engine == "exact":
        return _doubt(trajectory)
    run = propagation.reference(replace(problem, t_eval=times, progress=None))
    if run is None:
        return None
    added_up = min(trajectory.statistics.get("steps", 0) * problem.rtol, UNSURPRISING)
    allowed = max(TOLERATED * problem.rtol, added_up, 1e-9)  # rounding adds up, too, whatever the tolerance
    limit = max(allowed - run.doubt, run.doubt)  # the exact motion may itself be off so far, either way
    wanted = observed.values(times, run.x)
    part, name = _part(observed, trajectory, np.abs(values - wanted).max(axis=0, initial=0.0), wanted, limit)
    if part <= limit:
        return None
    return (
        f"the engine {engine!r} is off by {part:.1g} of the largest value of its kind at {name!r}, more than rtol = "
        f"{problem.rtol:.1g} leads one to expect: the exact motion of this linear network says so. Take engine='exact' "
        "or 'auto', or a smaller rtol."
    )


def _goes_on_as_it_is(problem: Problem, trajectory: Trajectory) -> bool:
    """Whether no state moves by more than the terms of its rate round: nothing passes against which an error counts.

    So a train runs that idles at one speed, or that a prescribed speed turns as a whole.
    """
    linear = problem.linear
    moved, largest = np.ptp(trajectory.x, axis=0), np.abs(trajectory.x).max(axis=0)
    if linear is None or (moved > STILL * largest).all():
        return False
    terms = abs(linear.A) @ largest + np.abs(linear.forcing(np.array(trajectory.t))).max(axis=-1)
    return bool((moved <= STILL * np.maximum(largest, terms * (problem.t_end - problem.t0))).all())


def _part(observed: Observed, trajectory: Trajectory, errors: Array, values: Array, limit: float) -> tuple[float, str]:
    """The largest error (m,) as a part of the largest value of its kind, and whose; looked at closer to object."""
    part, name = largest_part(observed, errors, values)
    return (part, name) if part <= limit else largest_part(observed, errors, outlook(observed, trajectory))


def _doubt(trajectory: Trajectory) -> str | None:
    if trajectory.doubt <= WORTH_SAYING:
        return None
    return (
        f"rates lie so far apart that the rounding of the matrix may change the motion by a part of "
        f"{trajectory.doubt:.1g}, and with more digits the run would take too long. Leave out what is stiffer or "
        "slower than matters, or make it rigid."
    )
