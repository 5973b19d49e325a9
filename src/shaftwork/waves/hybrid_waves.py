"""Motions through phases beside travelling waves: what arrives follows the states.

Between two events what arrives at the ends of the lines is known. So a hybrid state has it behind its states, with its
rates: x = (states, h, dh/dt), and everything that is read at an instant is read as without waves. One march of the
delay engine goes through all sets of equations.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.hybrid.hybrid_state import Regime
from shaftwork.hybrid.modes.mode_equations import ModeEquations
from shaftwork.integrate.problem import Problem, TimedProblem, Trajectory, changed
from shaftwork.pipeline.arguments import NOMINAL
from shaftwork.waves.delay_engine.lines import Lines
from shaftwork.waves.delay_engine.march import March, MarchEquations
from shaftwork.waves.delay_engine.waveforms import Left
from shaftwork.waves.wave_motion import CarriedWaves, WaveStart, checked_lines, delay_problem, lines_by_shaft
from shaftwork.waves.wave_system import WaveSystem

RATE = "rate of "


class WaveModeEquations(ModeEquations):
    """One set of equations with ends of waves, and its guards."""

    @property
    def clocks(self) -> tuple[int, ...]:
        """None: panels resolve what changes with time alone by themselves."""
        return ()

    @property
    def ends(self) -> tuple[str, ...]:
        """A name for what arrives at each end of a line, the same in all combinations of modes."""
        graph = self.model.form.graph
        owners = ((graph.part_of(k).name, graph.branches[k].template.label) for k in self.model.form.waves)
        return tuple(f"{name}.{label} arriving" for name, label in owners)

    def arriving(self, x: Array) -> dict[str, float]:
        """What arrives, behind the states, and its rates, by name."""
        names = (*self.ends, *(RATE + name for name in self.ends))
        return dict(zip(names, x[len(self.model.states) :].tolist(), strict=True))

    def states_from(self, t: float, stored: Mapping[str, float], p: Array) -> Array:
        """The states with which the equations take up what was stored, and what arrives; zero of what is not told."""
        names = (*self.ends, *(RATE + name for name in self.ends))
        return np.concatenate([super().states_from(t, stored, p), [stored.get(name, 0.0) for name in names]])

    def sizes(self, p: Array) -> list[float]:
        """The nominal size of each state; of what arrives that of a wave with a nominal speed."""
        impedances, _ = WaveSystem(self.bound(p)).lines
        return [*super().sizes(p), *(2 * NOMINAL * np.repeat(impedances, 2)).tolist(), *np.zeros(2 * impedances.size)]

    def arriving_rates(self, x: list[float]) -> list[float]:
        """The rates of what arrives stand in the states; theirs are none."""
        count = len(self.ends)
        return [*x[-count:], *[0.0] * count]


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
        self._start = start
        self._march: March | None = None
        self._equations: dict[Regime, MarchEquations] = {}

    def arriving(self, t: float) -> Array:
        """(2 q,) what arrives at the ends of the lines at a time in s, and its rates."""
        if self._march is not None:
            return self._march.arriving(t)
        nothing = np.zeros(0)
        before = TimedProblem(x0=nothing, t0=t, t_end=self._span[1], names=(), atol=nothing)
        return March(delay_problem(self._system, before, self._start), self._span).arriving(t)

    def solve(self, regime: Regime, problem: Problem) -> Trajectory:
        """One segment of the motion, in the modes of a regime; states, and behind them what arrives."""
        equations = regime.equations
        system, x = WaveSystem(equations.bound(regime.p)), problem.x0[: len(equations.model.states)]
        delayed = delay_problem(
            system, changed(problem, x0=x), self._start, timed=equations.timed, linear=equations.model.linear
        )
        with np.errstate(all="ignore"):
            if self._march is None:
                self._march = March(delayed, self._span)
            self._equations[regime] = self._march.go_on(delayed, self._equations.get(regime))
            self._march.run()
            return self._march.last()

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
