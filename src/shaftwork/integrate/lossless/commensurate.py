"""The delay engine for linear networks whose delays have a common measure."""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise

import numpy as np

from shaftwork.integrate.engines import WAVE
from shaftwork.integrate.lossless.collocation import STAGES
from shaftwork.integrate.lossless.lattice import ROUNDING, Lattice
from shaftwork.integrate.lossless.lines import DelayProblem, DelayTrajectory
from shaftwork.integrate.lossless.panel_maps import Matrices, panel_map

# Delays are whole multiples of a part of the shortest one, up to rounding, and no longer than so many of them.
MOST_PARTS, MOST_PERIODS = 12, 64
# More panels in a period, or unknowns in a panel, are left to the march.
MOST_PANELS, MOST_ROWS = 64, 400
# A motion of fewer panels is short.
SHORT = 2_000


def solve(problem: DelayProblem) -> DelayTrajectory | None:
    """Integrate a linear network whose delays have a common measure, or None where they have not.

    Law: every period, of the length of that measure, is divided alike, at t0 and at the breakpoints and where a layer
    needs it, so each panel is one constant map from (x, h) to (x, waves). Blocks of periods are marched side by side
    from zero and from unit vectors, then their true starts are carried from block to block, and they are marched again.

    Raises:
        SimulationError: as `shaftwork.integrate.lossless.engine.solve`.
    """
    measured = _measure(problem)
    if measured is None:
        return None
    period, multiples = measured
    pattern = _first_pattern(problem, period)
    matrices, twice = Matrices.of(problem), 2 * np.repeat(problem.impedances, 2)
    map_of = cache(lambda length: panel_map(matrices, twice, length * period))
    rtol = max(problem.rtol, WAVE.finest)
    # A beginning shows which panels are too long; a short motion shows it as fast.
    resolved = (problem.t_end - problem.t0) / period * len(pattern) < SHORT
    while True:
        lattice = Lattice(problem, map_of, period, multiples, pattern)
        if resolved:
            found, bad = _whole(lattice, rtol)
            if found is not None:
                return found
        else:
            beginning = (2 * max(multiples) + 2) * lattice.size
            bad = lattice.unresolved(lattice.run(min(lattice.count, beginning)), rtol)
        resolved = not any(bad)
        pattern = _refined(pattern, bad)
        if not resolved and len(pattern) > MOST_PANELS:
            return None


def _whole(lattice: Lattice, rtol: float) -> tuple[DelayTrajectory | None, list[bool]]:
    """The trajectory, or None and which panels of the period must be finer."""
    if lattice.count > lattice.problem.max_steps:
        raise lattice.failure(0, lattice.problem.x0, f"{lattice.problem.max_steps} steps are not enough")
    run = lattice.run(lattice.count)
    bad = lattice.unresolved(run, rtol)
    return (None if any(bad) else lattice.trajectory(run, lattice.problem.t_eval)), bad


def _measure(problem: DelayProblem) -> tuple[float, tuple[int, ...]] | None:
    """A period in s and how many of them the delay of each line lasts."""
    size = (problem.x0.size + 2 * problem.delays.size) * STAGES
    shortest = float(problem.delays.min())
    for parts in range(1, MOST_PARTS + 1):
        ratios = problem.delays * parts / shortest
        multiples = np.round(ratios)
        if (np.abs(ratios - multiples) <= ROUNDING * multiples).all() and multiples.max() <= MOST_PERIODS:
            return (shortest / parts, tuple(multiples.astype(int).tolist())) if size <= MOST_ROWS else None
    return None


def _first_pattern(problem: DelayProblem, period: float) -> tuple[float, ...]:
    marks = [*problem.breakpoints] if problem.steady else [*problem.breakpoints, problem.t_end]
    offsets = [0.0]
    near = 8 * math.ulp(max(abs(problem.t0), abs(problem.t_end))) / period + ROUNDING
    for mark in marks:
        offset = math.fmod((mark - problem.t0) / period, 1.0)
        if all(near < abs(offset - other) < 1 - near for other in offsets):
            offsets.append(offset)
    return tuple(sorted(offsets))


def _refined(pattern: tuple[float, ...], bad: list[bool]) -> tuple[float, ...]:
    """Halve the bad panels."""
    spans = zip(pairwise((*pattern, 1.0)), bad, strict=True)
    return tuple(start for (low, high), split in spans for start in ((low, (low + high) / 2) if split else (low,)))
