"""A motion through phases beside travelling waves: one march of the delay engine through all sets of equations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property, partial
from typing import Any

import numpy as np

from shaftwork.codegen.arrays import BoundArrays
from shaftwork.codegen.elements import Array
from shaftwork.codegen.waves import WaveSystem
from shaftwork.integrate.lossless.lines import DelayProblem, Lines
from shaftwork.integrate.lossless.march import March, MarchEquations
from shaftwork.integrate.lossless.waveforms import Left
from shaftwork.integrate.problem import Problem, Trajectory
from shaftwork.pipeline.phases.hybrid_state import Regime
from shaftwork.pipeline.wave_motion import CarriedWaves, WaveStart, checked_lines, lines_by_shaft


class WaveRun:
    """The waves of one motion, from its start on.

    Args:
        bound: the equations in which it starts.
        start: of the lines, or what is on its way in them; None for rest.
        span: start and end of the motion, s.

    Raises:
        ParameterError: the waves are those of a line with another impedance or delay.

    Warns:
        AccuracyWarning: bearing friction is too heavy to be lumped.
        NetworkWarning: a line is so short that the run hardly ends.
    """

    def __init__(self, bound: BoundArrays, start: WaveStart | CarriedWaves | None, span: tuple[float, float]) -> None:
        self._system, self._span = WaveSystem(bound), span
        self.lines: Mapping[str, Array] = lines_by_shaft(bound, self._system)
        checked_lines(bound, self._system, start, span[1] - span[0], linear=False)
        self._start: dict[str, Any] = {}
        if isinstance(start, CarriedWaves):
            self._start = {"past": start.past}
        elif start is not None:
            self._start = {"speeds0": start.speeds, "torque0": start.torques}
        self._march: March | None = None
        self._equations: dict[Regime, MarchEquations] = {}

    def arriving(self, t: float) -> Array:
        """(2 q,) what arrives at the ends of the lines at a time in s, and its rates."""
        march = self._march or March(self._delayed(self._system, np.zeros(0), t), self._span)
        return march.arriving(t)

    def _delayed(self, system: WaveSystem, x: Array, t: float, **others: Any) -> DelayProblem:
        impedances, delays = self._system.lines
        given: dict[str, Any] = {"t_end": self._span[1], "names": (), "atol": np.zeros(x.size)}
        return DelayProblem(
            rhs=system.rhs,
            speeds=system.speeds,
            jacobian=system.jacobian,
            delays=delays,
            impedances=impedances,
            x0=x,
            t0=t,
            **given | self._start | others,
        )

    def solve(self, regime: Regime, problem: Problem) -> Trajectory:
        """One span of the motion, in the modes of a regime; states, and behind them what arrives."""
        assembly = regime.assembly
        size = len(assembly.model.states)
        delayed = self._delayed(
            WaveSystem(assembly.bound(regime.p)),
            problem.x0[:size],
            problem.t0,
            t_end=problem.t_end,
            names=problem.names,
            atol=problem.atol,
            rtol=problem.rtol,
            sides=problem.sides,
            t_eval=problem.t_eval,
            explain=problem.explain,
            max_steps=problem.max_steps,
            earlier_steps=problem.earlier_steps,
            progress=problem.progress,
            guards=problem.guards,
            timed=assembly.timed,
            linear=assembly.model.linear,
        )
        with np.errstate(all="ignore"):
            if self._march is None:
                self._march = March(delayed, self._span)
            self._equations[regime] = self._march.go_on(delayed, self._equations.get(regime))
            self._march.run()
            return self._march.last()

    def solver(self, regime: Regime) -> Callable[[Problem], Trajectory]:
        """What solves a span in the modes of a regime."""
        return partial(self.solve, regime)

    @cached_property
    def left(self) -> Left:
        """The waves that have left the ends; asked for when the motion is over."""
        assert self._march is not None  # noqa: S101 (a motion has a span)
        return Left(Lines.of(self._system.lines[1]), self._march.left())

    def held(self, times: Array) -> Array:
        """(k, lines) energy in J in each line at times (k,): the waves f and g in it hold (f^2 + g^2) / (4 Z)."""
        squares = self.left.squares(times)
        return np.asarray((squares[:, ::2] + squares[:, 1::2]) / (4 * self._system.lines[0]))

    def leaving(self, times: Array) -> Array:
        """(k, ends) the waves 2 Z v + h in N m that leave the ends at times (k,), also before the start."""
        return self.left.waves(times)

    def carried(self, t: float) -> CarriedWaves:
        """What is on its way at a time in s."""
        return CarriedWaves(self.left.past(t), self.lines)
