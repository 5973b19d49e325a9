"""Runs of explicit methods: where stability bounds their steps, the torques of strong dampers take another run."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from shaftwork.integrate.engines import ENGINES
from shaftwork.integrate.guards import BRIEF
from shaftwork.integrate.linear.rounding_errors import cancellation
from shaftwork.integrate.problem import Array, DenseOutput, Problem, tightened
from shaftwork.integrate.stepping import SteppedRun
from shaftwork.integrate.stiffness import STABLE, bound_of_decay, jacobians, rates

# A run is made again where the torques of dampers may be off by more than this factor times the tolerance.
BEARABLE = 2.0


class MarchedRun(NamedTuple):
    """All steps, their dense output, and counts by name."""

    march: SteppedRun
    dense: DenseOutput
    counts: dict[str, int]


def solid(problem: Problem, run: Callable[[Problem, float], MarchedRun]) -> MarchedRun:
    """The run of an explicit method of order 8, in which the torques of dampers are as right as the speeds.

    Where dampers carry small differences of large parts it is made again, with a tolerance that is smaller by what
    cancels (`cancellation`): its steps are bound by stability and hardly become shorter.

    Args:
        problem: what to solve.
        run: solves it in steps of at most a length in s.
    """
    first = run(problem, np.inf)
    if problem.guards is not None and not _on_edge(problem, first.march.steps):
        return first
    # On the edge of its stability it leaves errors of the tolerance in what an implicit method damps.
    times, states = _starts(first.march)
    few = slice(None) if problem.guards is None else [0, -1]  # of many short runs, each tells a little
    factor = cancellation(problem, times[few], states[few])
    if not BEARABLE < factor < 1 / np.finfo(float).eps:  # it is beyond all bounds where nothing has moved yet
        return first
    # On the edge of stability errors are some 50 times as large as the tolerance that is asked for.
    share = max(1 / (50 * factor), ENGINES["scipy"].finest / problem.rtol)
    decay = rates(jacobians(problem)).decay
    # A longer step than is stable may well end right, because what is left of the fast motion is tiny at its
    # start, and yet be off inside by much more than the torque of a damper bears.
    again = run(tightened(problem, share), STABLE / decay if decay > 0 else np.inf)
    return again._replace(counts={name: first.counts[name] + again.counts[name] for name in first.counts})


def stable(problem: Problem, run: Callable[[Problem, float], MarchedRun]) -> MarchedRun:
    """The run of an explicit method of order 8 that judges rates as well: no step of it is longer than is stable.

    Such a step may end right, because what is left of the fast motion is tiny at its start. Inside it dense output
    is off by a hundred times as much as its end.

    Args:
        problem, run: as for `solid`.
    """
    first = run(problem, np.inf)
    if not _on_edge(problem, first.march.steps, STABLE):
        return first
    again = run(problem, STABLE / problem.estimates["decay"])
    return again._replace(counts={name: first.counts[name] + again.counts[name] for name in first.counts})


def _on_edge(problem: Problem, steps: Array, edge: float = 1.0) -> bool:
    """Whether one of the steps, by their ends (s,), is so long that it may be stability which bounds it.

    With a product of length and decay rate below 1 it is far from that, and every fast motion has steps of its own. The
    decay is looked at once for many brief phases in the same modes, and anew for a long one.
    """
    longest, estimates = float(np.diff(steps).max()), problem.estimates
    long = steps.size - 1 > BRIEF
    if long or "decay" not in estimates:
        if long or "bound" not in estimates:
            estimates["bound"] = bound_of_decay(jacobians(problem))
        if longest * estimates["bound"] <= edge:
            return False
        estimates["decay"] = rates(jacobians(problem)).decay
    return bool(longest * estimates["decay"] > edge)


def _starts(whole: SteppedRun) -> tuple[Array, Array]:
    """Times and states at the starts of all steps: there no input is in the midst of a jump."""
    times = [time for piece in whole.pieces for time in piece.times[:-1]]
    return np.array(times), np.array([state for piece in whole.pieces for state in piece.states[:-1]])
