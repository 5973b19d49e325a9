"""What a run of a linear network is worth: what rounding leaves of it, and how far it is from the exact motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shaftwork.integrate.problem import Array, Observed, Problem, Trajectory

# So many outputs of a run are looked at, evenly and ever denser towards its start.
SAMPLES = 12
# Rounding is worth saying from this part of the largest value of its kind. It was estimated, not bounded: errors of
# 2000 random networks with parameters from 1e-12 to 1e12 are up to four times the estimate.
WORTH_SAYING = 2e-7
# A smaller error than this is not said of an engine, whatever its tolerance: rounding adds up over its steps.
SMALLEST = 1e-9
# A motion each of whose states is known to this part is not looked at any further.
CERTAIN = 1e-10
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
    chosen = _samples(trajectory.t.size)
    times, states = trajectory.t[chosen], trajectory.x[chosen]
    values, (part, name) = _rounding(problem.observed, times, states)
    if part > WORTH_SAYING:
        return (
            f"strong damping: what couples speeds at {name!r} is so strong that the rounding of these speeds alone may "
            f"change what passes through parts by {part:.1g} of the largest. Make such a coupling rigid: leave the "
            "damper out and wire its ends to one node."
        )
    if engine == "exact":
        return _doubt(trajectory)
    return _distance(problem, problem.observed, times, values, engine)


def doubt(problem: Problem, trajectory: Trajectory, lost: Array) -> float:
    """What rounding may change in the states of a run and in what is across the branches, as a part of the largest.

    Args:
        problem: what was solved.
        trajectory: the run.
        lost: (n,) what rounding may change in each state.
    """
    if problem.observed is None or not trajectory.t.size:
        return 0.0
    if (lost <= CERTAIN * np.abs(trajectory.x).max(axis=0)).all():
        return CERTAIN
    chosen = _samples(trajectory.t.size)
    times, states = trajectory.t[chosen], trajectory.x[chosen]
    observed, ends = problem.observed, np.full(1, times[-1])
    values = observed.values(times, states)
    moved = states[-1] + lost * _patterns(states.shape[1])
    changed = observed.values(np.repeat(ends, len(moved)), moved) - values[-1]
    return _largest(observed, np.where(observed.direct, np.abs(changed).max(axis=0), 0.0), values)[0]


def difference(problem: Problem, trajectory: Trajectory, other: Trajectory) -> float:
    """The largest difference of two runs in the states and in what is across the branches, as a part of the largest."""
    if problem.observed is None or not trajectory.t.size:
        return 0.0
    chosen, observed = _samples(trajectory.t.size), problem.observed
    first, second = (observed.values(run.t[chosen], run.x[chosen]) for run in (trajectory, other))
    return _largest(observed, np.where(observed.direct, np.abs(first - second).max(axis=0), 0.0), first)[0]


def _samples(count: int) -> Array:
    """Places of the outputs that are looked at."""
    evenly = np.linspace(0, count - 1, SAMPLES)
    early = np.geomspace(1, count, SAMPLES) - 1
    return np.unique(np.concatenate([evenly, early]).round().astype(int))


def _patterns(n: int) -> Array:
    """(k, n) signs in which any two states move once alike and once against each other."""
    return np.array(
        [np.ones(n), *(1.0 - 2.0 * (np.arange(n) >> bit & 1) for bit in range(max(1, (n - 1).bit_length())))]
    )


def _rounding(observed: Observed, times: Array, states: Array) -> tuple[Array, tuple[float, str]]:
    """All values (k, m); what one rounding of each state changes, as a part of the largest of its kind, and where."""
    patterns = np.concatenate([np.zeros((1, states.shape[1])), _patterns(states.shape[1])])
    moved = np.concatenate([states * (1 + np.finfo(float).eps * pattern) for pattern in patterns])
    found = observed.values(np.tile(times, len(patterns)), moved).reshape(len(patterns), len(times), -1)
    changed = np.abs(found - found[0])
    first = observed.first_left
    changed[..., first:] = np.abs(found[..., first:])
    return found[0], _largest(observed, changed.max(axis=(0, 1)), found[0])


def _largest(observed: Observed, errors: Array, values: Array) -> tuple[float, str]:
    """The largest error (m,) against the largest of the values (k, m) of its kind, and whose it is."""
    kinds = np.array(observed.kinds)
    sizes = np.abs(values).max(axis=0, initial=0.0)
    sizes[observed.first_left :] = 0.0
    largest = {kind: float(sizes[kinds == kind].max()) for kind in dict.fromkeys(observed.kinds)}
    parts = [
        min(error / max(largest[kind], 1e-300), 1e300) if error else 0.0
        for error, kind in zip(errors.tolist(), observed.kinds, strict=True)
    ]
    worst = int(np.argmax(parts)) if parts else 0
    return (parts[worst], observed.names[worst]) if parts else (0.0, "")


def _distance(problem: Problem, observed: Observed, times: Array, values: Array, engine: str) -> str | None:
    """How far the run is from the exact motion, where that is worth saying."""
    from shaftwork.integrate import exact

    run = exact.reference(replace(problem, t_eval=times))
    if run is None:
        return None
    wanted = observed.values(times, run.x)
    part, name = _largest(observed, np.abs(values - wanted).max(axis=0, initial=0.0), wanted)
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
