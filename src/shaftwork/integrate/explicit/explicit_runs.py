"""Runs of Dormand and Prince's method of order 8(5,3): no step is longer than is stable."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from shaftwork.integrate.guards import BRIEF
from shaftwork.integrate.problem import Array, DenseOutput, Problem
from shaftwork.integrate.stepping import SteppedRun
from shaftwork.integrate.stiffness import STABLE, bound_of_decay, jacobians, rates

INSIDE = 8
"""The stage amid a step at which rates are judged."""


class MarchedRun(NamedTuple):
    """All steps, their dense output, and counts by name."""

    march: SteppedRun
    dense: DenseOutput
    counts: dict[str, int]


def least_rates(problem: Problem) -> Array:
    """(n,) the size of rates from which on they matter: it changes a state by its nominal size in the whole time."""
    return np.asarray(problem.atol / problem.rtol / (problem.t_end - problem.t0))


def stable(problem: Problem, run: Callable[[Problem, float], MarchedRun]) -> MarchedRun:
    """The run of an explicit method of order 8 that judges rates as well: no step of it is longer than is stable.

    Such a step may end right, because what is left of the fast motion is tiny at its start. Inside it dense output
    is off by a hundred times as much as its end.

    Args:
        problem: what to solve.
        run: solves it in steps of at most a length in s.
    """
    first = run(problem, np.inf)
    if not _on_edge(problem, first.march.steps):
        return first
    again = run(problem, STABLE / problem.estimates["decay"])
    return again._replace(counts={name: first.counts[name] + again.counts[name] for name in first.counts})


def _on_edge(problem: Problem, steps: Array) -> bool:
    """Whether one of the steps, by their ends (s,), is so long that it may be stability which bounds it.

    The decay is looked at once for many brief phases in the same modes, and anew for a long one.
    """
    longest, estimates = float(np.diff(steps).max()), problem.estimates
    long = steps.size - 1 > BRIEF
    if long or "decay" not in estimates:
        if long or "bound" not in estimates:
            estimates["bound"] = bound_of_decay(jacobians(problem))
        if longest * estimates["bound"] <= STABLE:
            return False
        estimates["decay"] = rates(jacobians(problem)).decay
    return bool(longest * estimates["decay"] > STABLE)
