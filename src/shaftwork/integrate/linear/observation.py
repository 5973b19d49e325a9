"""What a linear network shows at some outputs of a run; errors count against the largest value of their kind."""

from __future__ import annotations

import numpy as np

from shaftwork.integrate.problem import Array, Observed, Problem, Trajectory

# So many outputs of a run are looked at, evenly and ever denser towards its start.
SAMPLES = 12
# So many outputs tell how large the values of each kind become.
OUTLOOK = 500
# A motion each of whose states is known to this part is not looked at any further.
CERTAIN = 1e-10


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
    chosen = samples(trajectory.t.size)
    times, states = trajectory.t[chosen], trajectory.x[chosen]
    observed, ends = problem.observed, np.full(1, times[-1])
    values = observed.values(times, states)
    moved = states[-1] + lost * _patterns(states.shape[1])
    changed = observed.values(np.repeat(ends, len(moved)), moved) - values[-1]
    return largest_part(observed, np.where(observed.direct, np.abs(changed).max(axis=0), 0.0), values)[0]


def difference(problem: Problem, trajectory: Trajectory, other: Trajectory) -> float:
    """The largest difference of two runs in the states and in what is across the branches, as a part of the largest."""
    if problem.observed is None or not trajectory.t.size:
        return 0.0
    chosen, observed = samples(trajectory.t.size), problem.observed
    first, second = (observed.values(run.t[chosen], run.x[chosen]) for run in (trajectory, other))
    return largest_part(observed, np.where(observed.direct, np.abs(first - second).max(axis=0), 0.0), first)[0]


def samples(count: int) -> Array:
    """Places of the outputs that are looked at."""
    evenly = np.linspace(0, count - 1, SAMPLES)
    early = np.geomspace(1, count, SAMPLES) - 1
    return np.unique(np.concatenate([evenly, early]).round().astype(int))


def _patterns(n: int) -> Array:
    """(k, n) signs in which any two states move once alike and once against each other."""
    return np.array(
        [np.ones(n), *(1.0 - 2.0 * (np.arange(n) >> bit & 1) for bit in range(max(1, (n - 1).bit_length())))]
    )


def outlook(observed: Observed, trajectory: Trajectory) -> Array:
    """(k, m) values at so many outputs that the largest of each kind is hardly missed."""
    chosen = np.unique(np.linspace(0, trajectory.t.size - 1, OUTLOOK).round().astype(int))
    return observed.values(trajectory.t[chosen], trajectory.x[chosen])


def rounding(observed: Observed, times: Array, states: Array) -> tuple[Array, Array]:
    """All values (k, m), and what one rounding of each state changes (m,)."""
    patterns = np.concatenate([np.zeros((1, states.shape[1])), _patterns(states.shape[1])])
    moved = np.concatenate([states * (1 + np.finfo(float).eps * pattern) for pattern in patterns])
    values = observed.values(np.tile(times, len(patterns)), moved).reshape(len(patterns), len(times), -1)
    changed = np.abs(values - values[0])
    first = observed.first_left
    changed[..., first:] = np.abs(values[..., first:])
    return values[0], changed.max(axis=(0, 1))


def largest_part(observed: Observed, errors: Array, values: Array) -> tuple[float, str]:
    """The largest error (m,) against the largest of the values (k, m) of its kind, and whose it is.

    What passes between parts counts against such values alone; springs and dampers in them may be far larger.
    """
    kinds = np.array(observed.kinds)
    sizes = np.abs(values).max(axis=0, initial=0.0)
    sizes[observed.first_left :] = 0.0
    largest = {
        (kind, inner): float(sizes[(kinds == kind) & (inner | ~observed.inner)].max(initial=0.0))
        for kind in dict.fromkeys(observed.kinds)
        for inner in (False, True)
    }
    largest["", False] = largest["", True] = float(sizes[observed.first_through :].max(initial=0.0))
    parts = [
        min(error / max(largest[kind, inner], 1e-300), 1e300) if error else 0.0
        for error, kind, inner in zip(errors.tolist(), observed.kinds, observed.inner.tolist(), strict=True)
    ]
    worst = int(np.argmax(parts)) if parts else 0
    return (parts[worst], observed.names[worst]) if parts else (0.0, "")
