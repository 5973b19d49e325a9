"""Networks that are no plain differential equation: with algebraic loops, or with nothing that moves freely."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.core.errors import SimulationError
from shaftwork.integrate import choice
from shaftwork.integrate.problem import DaeProblem, DenseOutput, Problem, Trajectory

IMPLICIT = "Laws at massless nodes determine torque and speed together, so the implicit system is solved."
PRESCRIBED = "Nothing moves freely; all is prescribed."


@dataclass(frozen=True)
class _States:
    """The first columns of a dense output."""

    whole: DenseOutput
    count: int

    @property
    def steps(self) -> Array:
        return self.whole.steps

    def __call__(self, times: Array) -> Array:
        return self.whole(times)[:, : self.count]


@dataclass(frozen=True)
class _NoStates:
    """The dense output of a network without states."""

    steps: Array

    def __call__(self, times: Array) -> Array:
        return np.zeros((len(times), 0))


def without_states(problem: Problem, degree: int | None) -> Trajectory:
    """The run of a network without states: everything follows from the sources at every instant.

    Args:
        problem: with its output times.
        degree: of the laws of time; None where one is no polynomial, and may have no value.

    Raises:
        SimulationError: a law has no value at one of the times.
    """
    steps = np.array([problem.t0, *problem.breakpoints, problem.t_end])
    t = steps if problem.t_eval is None else problem.t_eval
    if degree is None and problem.explain is not None:
        times = np.union1d(t, steps)
        if (error := problem.explain(times, np.zeros((len(times), 0)))) is not None:
            raise error
    return Trajectory(t, np.zeros((len(t), 0)), _NoStates(steps))


def start_of_loops(bound: BoundArrays, problem: Problem) -> Array:
    """(loops,) what the laws in algebraic loops start with.

    Raises:
        SimulationError: they have no solution at the start.
    """
    assert bound.loops is not None  # noqa: S101 (the caller asks only then)
    start = bound.loops.solve(problem.sides(problem.t0)[1], problem.x0)
    if not np.isfinite(start).all():
        names = [bound.program.form.graph.part_of(branch).name for branch in bound.program.form.loop_laws]
        raise SimulationError(
            f"No torque and speed satisfy the laws of {', '.join(names)} at the start (t = {problem.t0:g} s). "
            f"Give their node an inertia, or start nearer to the operating point."
        )
    return start


def solve_loops(bound: BoundArrays, problem: Problem, start: Array) -> Trajectory:
    """Solve a problem whose model has algebraic loops with IDA, from `start_of_loops`.

    Raises:
        MissingExtraError: its library is not installed.
        SimulationError: the engine failed.
    """
    choice.load("sundials")
    assert bound.loops is not None  # noqa: S101 (the caller asks only then)
    loops, states = bound.loops, len(problem.x0)

    def residual(t: float, z: Array, rate: Array) -> Array:
        x, a = z[:states], z[states:]
        y, u, _ = loops.inputs_at(t, x, a)
        left, _ = loops.residual(t, x, a)
        return np.concatenate([rate[:states] - bound.rates(t, x, y, u), left])

    def jump(t: float, z: Array) -> Array:
        x = z[:states] if problem.jump is None else problem.jump(t, z[:states])
        return np.concatenate([x, loops.solve(problem.sides(t)[1], x)])

    from shaftwork.integrate.sundials import solve_dae

    look, explain = problem.switches, problem.explain
    size = float(np.abs(start).max()) or 1.0
    trajectory = solve_dae(
        DaeProblem(
            residual=residual,
            x0=np.concatenate([problem.x0, start]),
            derivative0=np.concatenate([bound.rhs(problem.sides(problem.t0)[1], problem.x0), np.zeros_like(start)]),
            algebraic=tuple(range(states, states + len(start))),
            t0=problem.t0,
            t_end=problem.t_end,
            names=(*problem.names, *(f"loop {k + 1}" for k in range(len(start)))),
            atol=np.concatenate([problem.atol, np.full(len(start), problem.rtol * size)]),
            rtol=problem.rtol,
            breakpoints=problem.breakpoints,
            jump=jump,
            sides=problem.sides,
            switches=None if look is None else lambda t, z: look(t, z[:, :states]),
            t_eval=problem.t_eval,
            explain=None if explain is None else lambda t, z: explain(t, z[:, :states]),
            max_steps=problem.max_steps,
            progress=problem.progress,
        )
    )
    loops.start_from(start)
    return Trajectory(trajectory.t, trajectory.x[:, :states], _States(trajectory.dense, states), trajectory.statistics)
