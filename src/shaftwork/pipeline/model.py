"""A compiled network and its simulation."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.model_observer import ModelObserver
from shaftwork.codegen.start_values import initial_state
from shaftwork.codegen.undefined_laws import refuse_vanishing
from shaftwork.core.calls import BoundedCache, Callback
from shaftwork.core.errors import Diagnostic, ParameterError
from shaftwork.core.notices import PulsationWarning, muted
from shaftwork.core.parameters import in_si
from shaftwork.formulation.form import StateForm
from shaftwork.integrate import choice
from shaftwork.integrate.engines import EngineName
from shaftwork.integrate.problem import Problem, Trajectory
from shaftwork.network.netlist import Netlist
from shaftwork.pipeline.arguments import (
    Demand,
    Given,
    Names,
    OutputTimes,
    Point,
    Time,
    as_names,
    changes_structure,
    checked_parameters,
    output_times,
    refuse_unrecorded,
    relative_tolerance,
    step_limit,
    time_span,
)
from shaftwork.pipeline.exported_model import ExportedModel
from shaftwork.pipeline.implicit import IMPLICIT, PRESCRIBED, solve_loops, start_of_loops, without_states
from shaftwork.pipeline.motion_start import (
    Ending,
    Repetition,
    ending_of,
    model_again,
    refuse_motion,
    remember,
    time_of_start,
    warn_of_rest,
)
from shaftwork.pipeline.overview import overview
from shaftwork.pipeline.prepared import OperatingPoint, Prepared, in_its_size, with_accuracy
from shaftwork.pipeline.settled import SteadyState, steady_operation
from shaftwork.results.solution import Solution

if TYPE_CHECKING:
    from shaftwork.frequency.linear_model import LinearModel
    from shaftwork.stepper.simulation import Simulation


class Model(ExportedModel):
    """A network as a fast function of time, states and parameters, ready to be simulated again and again.

    Args:
        form: the state form.
        netlist: what it was made of.
        rebuild: makes the model of a changed netlist; used where a new parameter value changes the structure.
        resting: trains that nothing joins to the drive.
    """

    phased: ClassVar[bool] = False
    """Whether parts change their mode, so that each phase has equations of its own."""

    def __init__(
        self,
        form: StateForm,
        netlist: Netlist,
        rebuild: Callable[[Netlist], Model],
        resting: tuple[Diagnostic, ...] = (),
    ) -> None:
        super().__init__(form)
        self.netlist, self._rebuild, self._resting = netlist, rebuild, resting
        self._prepared = BoundedCache[bytes, Prepared](1)
        self._variants = BoundedCache[tuple[tuple[str, float], ...], Model]()
        self._choices: list[tuple[tuple[float, float, float], Array, tuple[str, str]]] = []

    def __reduce__(self) -> tuple[Any, ...]:
        return model_again, remember(self, self._rebuild)

    def __repr__(self) -> str:
        return overview(self)

    @property
    def name(self) -> str:
        """Title of the network."""
        return self.netlist.name

    def simulate(
        self,
        t_end: float,
        *,
        t_start: float | None = None,
        rtol: float = 1e-8,
        atol: float | Sequence[float] | None = None,
        t_eval: OutputTimes = None,
        engine: EngineName = "auto",
        initial: Mapping[str, float] | Solution | None = None,
        parameters: Mapping[str, float] | None = None,
        max_steps: int = 10_000_000,
        progress: Callable[[float], None] | None = None,
        angles: Sequence[str] = (),
    ) -> Solution:
        """Integrate the motion.

        Args:
            t_end: end of the motion, s.
            t_start: its start, s; by default 0, or where the motion before ended.
            rtol: relative tolerance.
            atol: absolute tolerance, one for all states or one for each; by default rtol times a small speed, and
                times the torque that belongs to it.
            t_eval: output times, or their number (by default 1001 over the run), or "steps" for the engine's own.
            engine: "auto" takes the best one and says why in `Solution.why`.
            initial: start values of speeds ("J1.omega"), twists ("shaft.phi_rel") or torques; the rest is zero. Or a
                motion of the same network: it goes on from its last output time with all that is stored (speeds of
                inertias, torques of springs, angles), the modes of its parts and the waves on their way. Parameters
                other than its own change none of these, but for what new ratios force at once, as an impact does; a
                part begins anew where they say in which mode it starts; a `Wave` must keep its impedance and delay.
            parameters: values that differ from the network's, "part.parameter" to value in SI; nothing is recompiled
                unless a value changes the structure (a damping that was exactly zero).
            max_steps: give up after this many steps.
            progress: called again and again with the time that the engine has reached, s; what it raises ends the run
                and comes out as it is.
            angles: parts whose angle is to be read; what is recorded was chosen in `Network.compile`.

        Raises:
            ParameterError: an argument is out of its range, or `initial` a motion of another network.
            SimulationError: the integration failed; says when, in which state and why.
            MissingExtraError: the engine asked for is not installed.
        """
        refuse_unrecorded(self.form, as_names(angles))
        values = self._checked_all(parameters)
        initial, t_start = self._start(initial, t_start)
        if self.changes_structure(values):
            options: dict[str, Any] = {"t_start": t_start, "rtol": rtol, "atol": atol, "t_eval": t_eval}
            options |= {"engine": engine, "initial": initial, "max_steps": max_steps, "progress": progress}
            return self.variant(values).simulate(t_end, **options)
        told, span = Callback(progress), time_span(0.0 if t_start is None else t_start, t_end)
        wanted = relative_tolerance(rtol), atol, output_times(t_eval, *span), engine, step_limit(max_steps)
        demand = Demand(span, *wanted, told if progress else None)
        if self._resting and not isinstance(initial, Ending):
            warn_of_rest(self.name, self._resting, initial or {})
        motion = with_accuracy(told.of(lambda: self._motion(values, initial, demand)), demand)
        parameters = {**self.parameters, **values}
        taken = demand.engine if motion.phases else motion.engine
        again = Repetition(self._rebuild, self.netlist, demand, taken, values, initial, self)
        return replace(motion, parameters=parameters, initial=dict(initial or {}), rtol=demand.rtol, again=again)

    def start(self, inputs: Names = None, **options: Any) -> Simulation:
        """A motion that is stepped from outside, with inputs set between the steps; options as of `Simulation`."""
        from shaftwork.stepper.simulation import Simulation

        return Simulation(self, inputs=inputs, **options)

    def _start(
        self, initial: Mapping[str, float] | Solution | None, t_start: float | None
    ) -> tuple[Given, float | None]:
        """Start values or the end of the motion before, and the time of it."""
        if isinstance(initial, Solution):
            initial = ending_of(initial, self.form.graph)
        if isinstance(initial, Ending):
            return initial, time_of_start(t_start, initial)
        return (dict(initial) if isinstance(initial, Mapping) else initial), t_start  # that of the caller may change

    def _motion(self, values: Mapping[str, float], initial: Given, demand: Demand) -> Solution:
        prepared = self.prepare(self.vector(values) if values else self.defaults)
        return in_its_size(self.form, prepared, demand, lambda sized: self.run_once(values, initial, sized))

    def run_once(self, values: Mapping[str, float], initial: Given, demand: Demand) -> Solution:
        """A motion with the tolerances of the sizes in `demand`, whatever its own size is; values are checked."""
        return self._run(self.prepare(self.vector(values) if values else self.defaults), initial, demand)

    def prepare(self, p: Array) -> Prepared:
        """Everything that depends on a parameter vector alone; the last one is kept."""
        return self._prepared(p.tobytes(), lambda: Prepared(self, p))

    def state_at_start(
        self, prepared: Prepared, initial: Mapping[str, float] | None, span: tuple[float, float]
    ) -> tuple[Array, Any]:
        """The states (n,) at the start of a run, and what else is on its way then; without waves that is nothing.

        Args:
            prepared: the equations.
            initial: start values, or where another motion ended; None for rest.
            span: start and end of the run, s.

        Raises:
            SignalError: there is no such quantity.
            ParameterError: values are not finite, contradict each other or leave something open.
        """
        if initial is None and not self.form.has_impulses:
            return np.zeros(len(self.states)), None
        after = prepared.just_after(span)
        if isinstance(initial, Ending):
            return prepared.taken_up(initial, after), None
        return initial_state(prepared.bound, initial or {}, after), None

    def _run(self, prepared: Prepared, initial: Given, demand: Demand) -> Solution:
        x0, waves = self.state_at_start(prepared, initial, demand.span)
        if (sampled := prepared.sampled(demand.span)) is not None:
            x0 = sampled(demand.span[0], x0)
        problem, bind = prepared.problem(x0, demand), lambda: prepared.bound
        if self.form.doubtful:
            refuse_vanishing(self.form, bind, lambda: np.array([problem.t0]), lambda _: x0[None])
        trajectory, name, why = self._solve(prepared, problem, demand.engine, waves)
        if self.form.doubtful:
            refuse_vanishing(self.form, bind, lambda: trajectory.dense.steps, trajectory.dense)
        return Solution(
            name=self.name,
            t=trajectory.t,
            x=trajectory.x,
            states=self.states,
            engine=name,
            why=why,
            statistics=trajectory.statistics,
            dense=trajectory.dense,
            observer=ModelObserver(self.form, bind, prepared.instants(demand.span)),
            caveat=trajectory.caveat,
        )

    def steady_state(
        self,
        t: float = math.inf,
        *,
        initial: Mapping[str, float] | None = None,
        parameters: Mapping[str, float] | None = None,
    ) -> SteadyState:
        """The steady operation that the drive runs to, as start values for `simulate` and as a point for `linearize`.

        Args:
            t: time at which the sources are read; by default after their last breakpoint, with a warning where they
                had another level before, or where what sticks can hold other torques too.
            initial: where the search starts; by default at rest.
            parameters: values that differ from the network's.

        Raises:
            SimulationError: nothing comes to rest or to a steady speed.
        """
        refuse_motion(initial, "steady_state")
        values = self._checked_all(parameters)
        time = t if isinstance(t, float) and t == math.inf else in_si("t", t, "s")
        if self.changes_structure(values):
            return self.variant(values).steady_state(time, initial=initial)
        return self._steady(values, time, initial)

    def _steady(self, values: Mapping[str, float], t: float, initial: Given) -> SteadyState:
        return steady_operation(self.prepare(self.vector(values) if values else self.defaults), t, initial or {})

    def start_equations(self, values: Mapping[str, float]) -> BoundArrays:
        """The equations of which start values tell the states."""
        if self.changes_structure(values):
            return self.variant(values).start_equations({})
        return self.bind(self.vector(values))

    def start_phase(self) -> str:
        """The phase in which a motion from rest begins; empty, as no part changes its mode."""
        return ""

    def linearize(
        self, at: Point = None, *, inputs: Names = None, outputs: Names = None, t: Time = None, parameters: Given = None
    ) -> LinearModel:
        """Small motions about a point: A, B, C, D, modes and frequency response; nonlinear laws by their slopes.

        Args:
            at: `steady_state()`, speeds, twists and torques by name, or a motion at one time; by default rest.
            inputs: what sources give, "motor.tau", "drive.omega"; by default all of it.
            outputs: any quantities; by default the states.
            t: time at which laws are read, s; by default that of the motion or of the steady state, or after their last
                breakpoint; of parts that change their mode, at rest, 0.
            parameters: values that differ from the network's.

        Raises:
            SignalError: there is no such input or output.
            SimulationError: a law has no finite slope at the point, or a shaft is a wave, which no matrix holds.
        """
        values = self._checked_all(parameters)
        if self.changes_structure(values):
            return self.variant(values).linearize(at, inputs=inputs, outputs=outputs, t=t)
        with muted(PulsationWarning):  # matrices are those of a moment
            return self.near(at, t, inputs, outputs, values)

    def near(self, at: Point, t: Time, inputs: Names, outputs: Names = None, values: Given = None) -> LinearModel:
        """The same for values of parameters that have been looked at and change no structure."""
        from shaftwork.frequency.analysis import linearized

        return linearized(self.name, self.point(values or {}, at, t), at, inputs, outputs)

    def point(self, values: Mapping[str, float], at: Point, t: Time) -> OperatingPoint:
        """The equations that hold at a point, and where it is; arguments as for `linearize`.

        Raises:
            ParameterError: the point is none.
            SignalError: there is no such quantity.
            SimulationError: a shaft is a wave.
        """
        from shaftwork.frequency.analysis import operating_point, without_swing

        p = self.vector(values)
        return OperatingPoint(self, without_swing(self, p), *operating_point(self, p, at, t, self.settled(p)))

    def choose_engine(self, t_end: float, *, t_start: float = 0.0, rtol: float = 1e-8) -> tuple[str, str]:
        """The engine that "auto" takes for a motion, and why."""
        return self._choice(Demand(time_span(t_start, t_end), relative_tolerance(rtol), None, None, "auto", 1, None))

    def _choice(self, demand: Demand) -> tuple[str, str]:
        prepared = self.prepare(self.defaults)
        x0, _ = self.state_at_start(prepared, None, demand.span)
        return self._engine(prepared, prepared.problem(x0, demand), "auto")

    def _solve(
        self,
        prepared: Prepared,
        problem: Problem,
        engine: str,
        waves: Any,  # noqa: ARG002 (here are none)
    ) -> tuple[Trajectory, str, str]:
        """The run, the engine that made it, and why that one."""
        name, why = self._engine(prepared, problem, engine)
        if not self.states:
            return without_states(problem, self.degree), name, why
        if self.form.loop_laws:
            start = start_of_loops(prepared.bound, problem)
            if name == "sundials":
                return solve_loops(prepared.bound, problem, start), name, why
        return choice.solve(problem, name, why, fallback=engine == "auto")

    def _engine(self, prepared: Prepared, problem: Problem, engine: str) -> tuple[str, str]:
        """The engine for a motion, and why."""
        choice.check(engine)
        if not self.states:
            return "exact", PRESCRIBED
        if engine != "auto":
            return engine, "asked for"
        if self.form.loop_laws:
            return choice.implicit(), IMPLICIT
        key = (problem.t0, problem.t_end, problem.rtol)
        for run, p, chosen in self._choices:
            # Parameters that differ by less than a factor of 5 suit the same engine: looking anew would cost more than
            # the run.
            if run == key and ((p / 5.0 < prepared.p) == (prepared.p < p * 5.0)).all():
                return chosen
        chosen = choice.choose(problem)
        self._choices = [*self._choices[-7:], (key, prepared.p, chosen)]  # the last eight, for later calls
        return chosen

    def changes_structure(self, values: Mapping[str, float]) -> bool:
        """Whether other equations hold for new values."""
        if not values:
            return False
        return changes_structure(self.form, values) or self.arrays.assembly.degenerates(self.vector(values))

    def _checked_all(self, parameters: Mapping[str, float] | None) -> dict[str, float]:
        if parameters is None:
            return {}
        if not isinstance(parameters, Mapping):
            raise ParameterError(f"parameters = {parameters!r} must map names to values, such as {{'shaft.c': 3e4}}.")
        return checked_parameters(self.netlist, parameters)

    def with_values(self, values: Mapping[str, Any]) -> Model:
        """The model of the same network with other values, "part.parameter", whatever they change."""
        return self._rebuild(self.netlist.with_values(values))

    def variant(self, values: Mapping[str, float]) -> Model:
        """The model of the same network with other values where these change its structure; the last few are kept."""
        return self._variants(tuple(sorted(values.items())), lambda: self.with_values(values))
