"""What rounding and tolerances leave open in a run, and what a linear network shows of it.

The torque of a strong damper is a small difference of large parts, d * omega_1 - d * omega_2. What a tolerance or the
rounding of numbers leaves open in the speeds comes back in it, times d. Errors in what a linear network shows count
against the largest value of their kind.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from shaftwork.integrate.linear.linear_system import OWN_INTERVALS
from shaftwork.integrate.problem import Array, Observed, Problem, Trajectory
from shaftwork.integrate.stiffness import balance, full_where_small, jacobians_at, scale_by

# From this part of the largest value of its kind on rounding is worth saying, and a run in whole numbers worth making.
# It is an estimate, no bound: with it none of 1771 random networks, parameters from 1e-12 to 1e12, is off by 1e-6
# without a word.
WORTH_SAYING = 2e-7
# Where torques may be off by this part because of the rounding of speeds, a run says so. Of a linear network less is
# said already (`verification`): there every torque is read, and here only the Jacobian tells.
SPOILED = 1e-4
REMEDY = "Make such a coupling rigid: leave the damper out and wire its ends to one node."


def spoiled(problem: Problem, times: Array, states: Array) -> str | None:
    """What to say where rounding spoils the torques of dampers in a network that is not linear, or None.

    Args:
        problem: what was solved.
        times: (k,) some times of the run, s.
        states: (k, n) then.
    """
    duration, eps = problem.t_end - problem.t0, float(np.finfo(float).eps)
    most = max(float(part.sizes.sum(axis=1).max(initial=0.0)) for part in _parts(problem, times[:1], states[:1]))
    if not most * duration * eps > SPOILED:
        return None
    part = eps * _largest(problem, times, states)
    if part < SPOILED:
        return None
    return (
        f"strong damping: dampers couple speeds so strongly that the rounding of these speeds alone may change torques "
        f"by a part of {part:.1g}. {REMEDY}"
    )


@dataclass(frozen=True)
class _Part:
    """A Jacobian in the scale of `balance`, taken apart.

    Two states that push each other apart, a_ij and a_ji of opposite sign, are joined by a spring; all else damps.

    Args:
        damping: (n, n).
        sizes: (n, n) of its entries.
        scale: (n,) of the states.
    """

    damping: Any
    sizes: Any
    scale: Array


def _largest(problem: Problem, times: Array, states: Array) -> float:
    """The largest ratio of the parts of a damper's torque to this torque, or to what else acts there."""
    chosen = np.unique(np.linspace(0, times.size - 1, 12).astype(int))  # so many tell what dampers take
    sums, torques, other = (np.full(problem.x0.size, np.finfo(float).tiny) for _ in range(3))
    slowest = 1 / (problem.t_end - problem.t0)
    parts = _parts(problem, times[chosen], states[chosen])
    for part, state in zip(parts, states[chosen], strict=True):
        x = state / part.scale
        sums = np.maximum(sums, part.sizes @ np.abs(x))
        torques = np.maximum(torques, np.abs(part.damping @ x))
        other = np.maximum(other, slowest * np.abs(x))
    return float(np.max(sums / np.maximum(torques, other), initial=1.0))


def _parts(problem: Problem, times: Array, states: Array) -> list[_Part]:
    """Of the Jacobian at each time, all in one scale; of a linear system once for all runs."""
    linear = problem.linear
    if linear is not None:
        return [linear.cached("damping", lambda: _split([linear.A])[0])] * times.size
    if problem.jacobian is None:
        nothing = np.zeros((problem.x0.size, problem.x0.size))
        return [_Part(nothing, nothing, np.ones(problem.x0.size))] * times.size
    return _split(jacobians_at(problem, times, states))


def _split(matrices: list[Any]) -> list[_Part]:
    rows = [full_where_small(matrix) for matrix in matrices]
    for matrix in rows:  # without slopes at a point where the law has none
        entries = matrix if isinstance(matrix, np.ndarray) else matrix.data
        entries[~np.isfinite(entries)] = 0.0
    scale = balance(sum(abs(matrix) for matrix in rows))
    parts = []
    for matrix in rows:
        scaled = scale_by(matrix, scale)
        if isinstance(scaled, np.ndarray):
            springs = np.where(scaled * scaled.T < 0, scaled, 0.0)
        else:
            springs = scaled * (scaled.multiply(scaled.T) < 0)
        damping = scaled - springs
        parts.append(_Part(damping, abs(damping), scale))
    return parts


def doubt(problem: Problem, trajectory: Trajectory, lost: Array) -> float:
    """What rounding may change in the states of a run and in what is across the branches, as a part of the largest.

    Args:
        problem: what was solved.
        trajectory: the run.
        lost: (n,) what rounding may change in each state.
    """
    if problem.observed is None or not trajectory.t.size:
        return 0.0
    certain = 1e-10  # a motion each of whose states is known to this part is not looked at any further
    if (lost <= certain * np.abs(trajectory.x).max(axis=0)).all():
        return certain
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


def samples(count: int, each: int = 12) -> Array:
    """Places of the outputs that are looked at: so many evenly, and as many ever denser towards the start."""
    evenly = np.linspace(0, count - 1, each)
    early = np.geomspace(1, count, each) - 1
    return np.unique(np.concatenate([evenly, early]).round().astype(int))


def _patterns(n: int) -> Array:
    """(k, n) signs in which any two states move once alike and once against each other."""
    return np.array(
        [np.ones(n), *(1.0 - 2.0 * (np.arange(n) >> bit & 1) for bit in range(max(1, (n - 1).bit_length())))]
    )


def outlook(observed: Observed, trajectory: Trajectory) -> Array:
    """(k, m) values at so many outputs that the largest of each kind is hardly missed."""
    chosen = np.unique(np.linspace(0, trajectory.t.size - 1, OWN_INTERVALS).round().astype(int))
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
