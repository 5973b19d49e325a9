"""Networks whose shafts are travelling waves: the model as the delay engine takes it, and the run as others give it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.array_form.recovery import BranchHistory
from shaftwork.codegen.start_values import Start, at_rest
from shaftwork.codegen.state_transfer import StateTransfer
from shaftwork.components.base import Component
from shaftwork.components.controlled import LineSection, TransmissionLine
from shaftwork.components.shaft_models import Lumped, Wave
from shaftwork.components.shafts import Shaft
from shaftwork.core.errors import AccuracyWarning, NetworkWarning, ParameterError
from shaftwork.core.notices import warn
from shaftwork.formulation.form import StateForm
from shaftwork.integrate.problem import Problem, TimedProblem, Trajectory
from shaftwork.network.kinds import Kind
from shaftwork.network.netlist import Netlist
from shaftwork.numerics.tolerances import SAME
from shaftwork.numerics.zeros import just_after
from shaftwork.waves.delay_engine.collocation import POWERS
from shaftwork.waves.delay_engine.engine import solve
from shaftwork.waves.delay_engine.lines import DelayProblem, DelayTrajectory, Past, past_of
from shaftwork.waves.delay_engine.waveforms import Polynomials
from shaftwork.waves.wave_system import WaveSystem

WHY = "Shafts are travelling waves, so states and delays are solved together."
LIGHT = 0.1
"""Lumped bearing friction is light up to this fraction of the impedance: the torques are right to about 0.5 %."""


@dataclass(frozen=True)
class _StatesAndWaves:
    """Dense output of the states, with the histories behind them.

    Args:
        motion: as the engine found it.
        before: what left the ends before the start.
        impedances: (lines,) in N m s.
        lines: by shaft.
    """

    motion: DelayTrajectory
    before: Past
    impedances: Array
    lines: Mapping[str, Array]

    @property
    def steps(self) -> Array:
        return self.motion.dense.steps

    def __call__(self, times: Array) -> Array:
        return np.hstack([self.motion.dense(times), self.motion.waves(times)[0]])

    def held(self, times: Array) -> Array:
        """(k, lines) energy in J in each line at times (k,): the waves f and g in it hold (f^2 + g^2) / (4 Z)."""
        squares = self.motion.squares(times)
        return np.asarray((squares[:, ::2] + squares[:, 1::2]) / (4 * self.impedances))

    def leaving(self, times: Array) -> Array:
        """(k, ends) the waves 2 Z v + h in N m that leave the ends at times (k,), also before the start."""
        start, past = self.steps[0], self.before
        h, v = self.motion.waves(np.maximum(times, start))
        before = Polynomials(past.starts, past.lengths, past.waves @ POWERS, 0.0)(np.minimum(times, start))
        return np.where((times < start)[:, None], before, 2 * np.repeat(self.impedances, 2) * v + h)

    def carried(self, t: float) -> CarriedWaves | None:
        """What is on its way at a time in s; None where leaps do not know it."""
        return None if self.motion.past is None else CarriedWaves(self.motion.past(t), self.lines)


@dataclass(frozen=True)
class CarriedWaves:
    """What is on its way in lines where a motion ended.

    Args:
        past: what has left their ends.
        lines: by shaft (2, lines), impedances in N m s and delays in s.
    """

    past: Past
    lines: Mapping[str, Array]


@dataclass(frozen=True)
class WaveStart:
    """How lines start: their speed runs straight from end to end, their torque is the same all along.

    Args:
        speeds: (2 lines,) of the ends, rad/s.
        torques: (lines,) that the first end takes in, N m.
    """

    speeds: Array
    torques: Array


def twin(netlist: Netlist) -> Netlist:
    """The network with a spring or two in place of every wave, which stands and turns steadily as the waves do.

    Forms that are chosen for parts are chosen there too.
    """

    def stiff(part: Component) -> Component:
        if isinstance(part, TransmissionLine):
            return LineSection(part.name, symbol=part.symbol, **part.values)
        if not isinstance(part, Shaft) or not isinstance(part.model, Wave):
            return part
        return dataclasses.replace(part, model=Lumped(1 if part.friction == 0 else 2))

    return netlist.with_parts(stiff)


def start_of_waves(
    bound: BoundArrays, twin: BoundArrays, initial: Mapping[str, float], t0: float
) -> tuple[Array, WaveStart]:
    """States (n,) and waves from which a network starts: those of its twin, at rest its own.

    Where a source jolts inertias at the start, the twin's springs take inertia of the shaft along, and a wave does not.

    Args:
        bound: array program of the network.
        twin: that of its twin.
        initial: start values by name, also those that the twin alone knows: the torque along a shaft.
        t0: start time, s; where something jumps there, a time after it.

    Raises:
        SignalError: there is no such quantity.
        ParameterError: values are not finite or contradict each other, or the ends of a wave are given two torques.
    """
    form, graph = bound.program.form, twin.program.form.graph
    start = Start(twin, _all_along(form, initial), t0)
    times, x = np.array([just_after(t0)]), start.states[None, :]
    stores = StateTransfer(twin.program.form)
    stored = dict(zip(stores.names, stores.of(lambda: twin, times, x)[0], strict=True))
    states = np.array([stored[state.name] for state in form.states])
    inertias = [stores.branches[state.name] for state in form.states if state.kind == "across"]
    states[: len(inertias)] = start.given_speeds.of(
        lambda history: history.across[inertias], at_rest(bound, t0)[: len(inertias)]
    )
    springs = [b for b in graph.branches if b.template.kind is Kind.THROUGH_STORE and _is_wave(form, b.part)]
    through = BranchHistory(twin, times, x).through
    speeds = [speed for spring in springs for speed in start.given_speeds.at_ends(spring.plus, spring.minus)]
    return states, WaveStart(np.array(speeds), np.array([through[spring.index, 0] for spring in springs]))


def _all_along(form: StateForm, initial: Mapping[str, float]) -> dict[str, float]:
    """Start values of the twin: a torque of an end stands all along the wave."""
    values = dict(initial)
    for name in dict.fromkeys(form.graph.part_of(end).name for end in form.waves):
        ends = {end: values.pop(end) for end in (f"{name}.tau", f"{name}.tau_a", f"{name}.tau_b") if end in values}
        if len({*ends.values()}) > 1:
            listed = " and ".join(f"{end} = {value}" for end, value in ends.items())
            raise ParameterError(
                f"The wave '{name}' cannot start with {listed}: it starts with one torque all along. Give one of them, "
                "or take model=Spectral(16)."
            )
        values |= dict.fromkeys([f"{name}.tau"] * bool(ends), next(iter(ends.values()), 0.0))
    return values


def _is_wave(form: StateForm, part: int) -> bool:
    return any(form.graph.branches[end].part == part for end in form.waves)


def engine_of_waves(engine: str) -> tuple[str, str]:
    """The engine of a model with lines, and why.

    Raises:
        ParameterError: another one was asked for.
    """
    if engine not in ("auto", "wave"):
        raise ParameterError(
            f"engine = {engine!r} knows no travelling waves. Take the engine 'auto', or another model of the shaft: "
            "model=Spectral(16) or Lumped(100)."
        )
    return "wave", WHY


def solve_waves(
    bound: BoundArrays, problem: Problem, start: WaveStart | CarriedWaves | None, *, linear: bool, steady: bool
) -> Trajectory:
    """Solve a problem whose model has lines; the histories of their ends follow the states in the result.

    Args:
        bound: the array program.
        problem: states, times and tolerances.
        start: of the lines, or what is on its way in them; None for rest.
        linear: whether the laws are linear with constant coefficients.
        steady: whether nothing depends on time between breakpoints.

    Raises:
        ParameterError: the waves are those of a line with another impedance or delay.
        SimulationError: the engine failed.

    Warns:
        AccuracyWarning: bearing friction is too heavy to be lumped.
        NetworkWarning: a line is so short, and beside it something so nonlinear, that the run hardly ends.
    """
    system = WaveSystem(bound)
    checked_lines(bound, system, start, problem.t_end - problem.t0, linear=linear)
    delayed = delay_problem(system, problem, start, linear=linear, steady=steady)
    trajectory = solve(delayed)
    x = np.hstack([trajectory.x, trajectory.h])
    dense = _StatesAndWaves(trajectory, past_of(delayed), delayed.impedances, lines_by_shaft(bound, system))
    return Trajectory(trajectory.t, x, dense, trajectory.statistics)


def delay_problem(
    system: WaveSystem, problem: TimedProblem, start: WaveStart | CarriedWaves | None, **others: Any
) -> DelayProblem:
    """A problem whose model has lines, with others of its values, as the delay engine takes it."""
    impedances, delays = system.lines
    told: dict[str, Any] = {item.name: getattr(problem, item.name) for item in dataclasses.fields(TimedProblem)}
    if isinstance(start, CarriedWaves):
        told["past"] = start.past
    elif start is not None:
        told |= {"speeds0": start.speeds, "torque0": start.torques}
    told |= {"rhs": system.rhs, "speeds": system.speeds, "jacobian": system.jacobian}
    return DelayProblem(**{**told, "impedances": impedances, "delays": delays, **others})


def checked_lines(
    bound: BoundArrays, system: WaveSystem, start: WaveStart | CarriedWaves | None, span: float, *, linear: bool
) -> None:
    """Refuse or warn of lines before a run; arguments, errors and warnings as of `solve_waves`, the span in s."""
    impedances, delays = system.lines
    if isinstance(start, CarriedWaves):
        _refuse_other_lines(lines_by_shaft(bound, system), start.lines)
    _warn_of_friction(bound, impedances)
    if not linear:
        _warn_of_short_lines(bound, delays, span)


def lines_by_shaft(bound: BoundArrays, system: WaveSystem) -> dict[str, Array]:
    """Impedances and delays (2, lines) of each shaft."""
    form, lines = bound.program.form, np.array(system.lines)
    owners = [form.graph.part_of(end).name for end in form.waves[::2]]
    return {name: lines[:, [owner == name for owner in owners]] for name in dict.fromkeys(owners)}


def _refuse_other_lines(lines: Mapping[str, Array], before: Mapping[str, Array]) -> None:
    """Refuse lines by shaft that are not those in which waves are on their way.

    Raises:
        ParameterError: names the shaft.
    """
    for name, now in lines.items():
        if now.shape != before[name].shape or not np.allclose(now, before[name], rtol=SAME, atol=0.0):
            raise ParameterError(
                f"Shaft '{name}' has another impedance, delay or friction than in the motion that goes on, and waves "
                "are on their way through it. Keep them as they were, or begin with start values, "
                "initial={name: sol[name][-1] for name in sol.states} and t_start=sol.t[-1], which leave the waves out."
            )


def _warn_of_friction(bound: BoundArrays, impedances: Array) -> None:
    form = bound.program.form
    parts = [form.graph.part_of(end) for end in form.waves[::2]]
    for part, impedance in {part.name: (part, Z) for part, Z in zip(parts, impedances, strict=True)}.values():
        value = {name: float(bound.p[place]) for name, place in part.parameters.items()}
        share = value.get("friction", 0.0) * value.get("length", 0.0) / float(impedance)
        if share > LIGHT:
            warn(
                f"Shaft '{part.name}': its bearing friction d' L is {share:.2g} of its wave impedance, and Wave() "
                f"lumps it at the ends and the middle, which is right far below one only: torques along it are off by "
                f"{'more than ten' if share > 5 else 'some'} per cent. Take model=Spectral(16), which spreads it out.",
                AccuracyWarning,
            )


def _warn_of_short_lines(bound: BoundArrays, delays: Array, span: float) -> None:
    shortest = int(delays.argmin())
    panels = span / float(delays[shortest])
    if panels > 2e5:  # minutes
        name = bound.program.form.graph.part_of(bound.program.form.waves[2 * shortest]).name
        warn(
            f"A wave crosses shaft '{name}' in {delays[shortest]:.2g} s, and beside nonlinear laws no panel is longer: "
            f"the run takes at least {panels:.2g} panels. Take model=OneSpring() or Spectral(2) for a shaft so short, "
            "or a shorter run.",
            NetworkWarning,
        )
