"""Networks whose shafts are travelling waves: the model as the delay engine takes it, and the run as others give it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shaftwork.codegen.arrays import BoundArrays
from shaftwork.codegen.elements import Array
from shaftwork.codegen.waves import WaveSystem
from shaftwork.core.errors import ParameterError
from shaftwork.integrate.lossless.engine import solve
from shaftwork.integrate.lossless.lines import DelayProblem, DelayTrajectory
from shaftwork.integrate.problem import Problem, Trajectory

EQUAL = 1e-9
"""Speeds of the two ends of a line are equal up to this part of the largest."""
WHY = "Shafts are travelling waves, so states and delays are solved together."


@dataclass(frozen=True)
class _StatesAndWaves:
    """Dense output of the states, with the histories behind them."""

    found: DelayTrajectory

    @property
    def steps(self) -> Array:
        return self.found.dense.steps

    def __call__(self, times: Array) -> Array:
        return np.hstack([self.found.dense(times), self.found.waves(times)[0]])


def solve_waves(
    bound: BoundArrays, problem: Problem, engine: str, *, linear: bool, steady: bool
) -> tuple[Trajectory, str, str]:
    """Solve a problem whose model has lines; the histories of their ends follow the states in the result.

    Args:
        bound: the array program.
        problem: states, times and tolerances.
        engine: "auto" or "wave".
        linear: whether the laws are linear with constant coefficients.
        steady: whether nothing depends on time between breakpoints.

    Raises:
        ParameterError: another engine was asked for.
        SimulationError: the engine failed.
    """
    if engine not in ("auto", "wave"):
        raise ParameterError(
            f"engine = {engine!r} knows no travelling waves. Take the engine 'auto', or another model of the shaft: "
            "model=Spectral(16) or Lumped(100)."
        )
    system = WaveSystem(bound)
    impedances, delays = system.lines
    turning = _turning(system, problem, impedances) if np.any(problem.x0) else np.zeros(len(impedances))
    found = solve(
        DelayProblem(
            rhs=system.rhs,
            speeds=system.speeds,
            jacobian=system.jacobian,
            delays=delays,
            impedances=impedances,
            x0=problem.x0,
            t0=problem.t0,
            t_end=problem.t_end,
            names=problem.names,
            atol=problem.atol,
            rtol=problem.rtol,
            breakpoints=problem.breakpoints,
            jump=problem.jump,
            sides=problem.sides,
            t_eval=problem.t_eval,
            max_steps=problem.max_steps,
            linear=linear,
            steady=steady,
            speed0=turning,
        )
    )
    x = np.hstack([found.x, found.h])
    return Trajectory(found.t, x, _StatesAndWaves(found), found.statistics), "wave", WHY


def _turning(system: WaveSystem, problem: Problem, impedances: Array) -> Array:
    """The speed (lines,) with which each line turns, untwisted, before the start: that of its two ends.

    Raises:
        ParameterError: the start values twist a line.
    """
    time, x = np.array([problem.t0]), problem.x0[:, None]

    def ends(speeds: Array) -> Array:
        return system.speeds(time, x, -np.repeat(impedances * speeds, 2)[:, None])[:, 0]

    rest = ends(np.zeros(len(impedances)))
    columns = np.array([ends(unit) - rest for unit in np.eye(len(impedances))]).T
    found = np.linalg.lstsq(np.repeat(np.eye(len(impedances)), 2, axis=0) - columns, rest, rcond=None)[0]
    gap = np.abs(ends(found) - np.repeat(found, 2)).max()
    if gap > EQUAL * np.abs(rest).max():
        raise ParameterError(
            "A shaft with model=Wave() starts untwisted, so both its ends must start with the same speed. "
            "Give equal start values, or take model=Spectral(16), which may start twisted."
        )
    return np.asarray(found)
