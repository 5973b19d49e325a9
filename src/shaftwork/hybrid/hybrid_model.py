"""The model of a network whose parts change their mode."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property, partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.compiled_model import CompiledModel
from shaftwork.codegen.operating import another_start, energy_weights, lasting, steady_state
from shaftwork.codegen.start_values import initial_state
from shaftwork.core.errors import CompileError, NetworkWarning, SimulationError
from shaftwork.core.notices import warn
from shaftwork.core.parameters import in_si
from shaftwork.equations.records import NamedPhase
from shaftwork.formulation.form import StateForm
from shaftwork.hybrid.equation_sets import EquationSets
from shaftwork.hybrid.event_iteration import EventIteration
from shaftwork.hybrid.hybrid_run import HybridRun
from shaftwork.hybrid.hybrid_solution import solution
from shaftwork.hybrid.hybrid_state import HybridState, passes_limit
from shaftwork.hybrid.named_phases import known_modes, modes_in, whole_name, words_of
from shaftwork.network.netlist import listed
from shaftwork.pipeline.arguments import Demand, Given, Point, Time
from shaftwork.pipeline.model import Model
from shaftwork.pipeline.prepared import OperatingPoint, in_its_size
from shaftwork.pipeline.settled import SteadyState, refuse_moving, warn_of_earlier_levels
from shaftwork.results.solution import Solution

if TYPE_CHECKING:
    from shaftwork.stepper.moments import Moment

MOST_CHANGES = 100
"""Changes of mode on the way to a steady operation."""


class PhaseModel(CompiledModel):
    """The equations of a network in one phase, as a function of time, states and parameters.

    They hold while every part stays in its mode, which whoever integrates them has to watch.

    Args:
        form: the state form in this phase.
        name: the mode of every part, "gap open, load stuck".
        numbers: of the modes, "part.mode", which stand among the parameters where laws of equal form differ.
    """

    def __init__(self, form: StateForm, name: str, numbers: Mapping[str, float]) -> None:
        super().__init__(form)
        self.name, self._mode_numbers = name, numbers

    def __reduce__(self) -> tuple[Any, ...]:
        return PhaseModel, (self.form, self.name, dict(self._mode_numbers))

    @cached_property
    def parameters(self) -> Mapping[str, float]:
        """Those of the network, and the numbers of the modes that stand in laws."""
        return MappingProxyType(
            {k: self._mode_numbers.get(k, value) for k, value in self.form.graph.parameters.items()}
        )

    def __repr__(self) -> str:
        return f"<PhaseModel of '{self.form.graph.name}', {self.name}: {', '.join(self.states) or 'no states'}>"


def _of_a_phase(what: str) -> Any:
    """What one phase has and a whole network has not."""

    def refuse(self: HybridModel, *_args: Any, **_options: Any) -> NoReturn:
        """There is one for each phase.

        Raises:
            CompileError: always; says how to choose the phase.
        """
        graph = self.form.graph
        raise CompileError(
            f"model.{what} of '{self.name}': parts change their mode, and each phase has equations of its own. Name "
            f"one, model.phase('{whole_name(graph)}').{what}, or a row of sol.phases. {known_modes(graph)}"
        )

    return refuse


class HybridModel(Model):
    """A network with parts that change their mode, ready to be simulated again and again.

    Each phase has equations of its own, see `phase`.
    """

    phased = True

    @cached_property
    def parameters(self) -> Mapping[str, float]:
        """Those of the network, without the numbers of modes."""
        numbers = {machine.number for machine in self.equation_sets.machines}
        return MappingProxyType({k: value for k, value in self.form.graph.parameters.items() if k not in numbers})

    @cached_property
    def states(self) -> tuple[str, ...]:
        """All that is stored in any phase, as in a solution; which of it are states depends on the phase."""
        return self.equation_sets.of(self.equation_sets.first).stores.names

    @cached_property
    def _phase_models(self) -> dict[str, PhaseModel]:
        return {}

    def phase(self, name: str | NamedPhase) -> PhaseModel:
        """The equations of one phase; see `Model.phase`."""
        graph, words = self.form.graph, words_of(name)
        whole, modes = whole_name(graph, words), tuple(mode.name for mode in modes_in(graph, words))
        if whole not in self._phase_models:
            form, numbers = self.equation_sets.of(modes).model.form, self.equation_sets.numbers(modes)
            self._phase_models[whole] = PhaseModel(form, whole, numbers)
        return self._phase_models[whole]

    rhs, jacobian, cost, source, compiled = map(_of_a_phase, ("rhs", "jacobian", "cost()", "source()", "compiled()"))
    code = property(_of_a_phase("code"))

    @cached_property
    def equation_sets(self) -> EquationSets:
        """The equations of every combination of modes that a motion has come to."""
        return EquationSets(self, self._rebuild)

    def _motion(self, values: Mapping[str, float], initial: Given, demand: Demand) -> Solution:
        first, p = self.equation_sets.first_equations(values)
        return in_its_size(
            first.model.form, first.prepared(p), demand, lambda sized: self.run_once(values, initial, sized)
        )

    def run_once(self, values: Mapping[str, float], initial: Given, demand: Demand) -> Solution:
        """See `Model.run_once`."""
        run = HybridRun(self.equation_sets, values, demand)
        run.march(initial)
        return solution(run, self.name)

    def moment(self, *arguments: Any) -> Moment:
        """The network at one instant of a stepped motion; arguments as of `hybrid_moment`."""
        from shaftwork.stepper.hybrid_moments import hybrid_moment

        return hybrid_moment(self, *arguments)

    def start_phase(self) -> str:
        """The phase in which a motion from rest begins, "gap open, brake locked".

        Raises:
            SimulationError: no modes go together there.
        """
        demand = Demand((0.0, 1.0), 1e-8, None, None, "auto", 1, None)
        return self.words(HybridRun(self.equation_sets, {}, demand).begin(None))

    def _choice(self, demand: Demand) -> tuple[str, str]:
        return HybridRun(self.equation_sets, {}, demand).choose()

    def _steady(self, values: Mapping[str, float], t: float, initial: Given) -> SteadyState:
        """Steady states of one set of equations after another, until no mode changes there."""
        first, p = self.equation_sets.first_equations(values)
        when = t if math.isfinite(t) else first.model.settled(p)
        event_iteration = EventIteration(self.equation_sets, values, (0.0, 1.0))
        state = event_iteration.started(when, initial_state(first.bound(p), initial or {}, when))
        for _ in range(MOST_CHANGES):
            bound = state.regime.bound
            if not math.isfinite(t):
                refuse_moving(bound, when, state.regime.model.switching)
            ends = partial(_ends, state, when)
            x = steady_state(bound, state.x, when, ends=ends) if state.x.size else state.x
            beyond = ends(x)
            state, transitions = event_iteration.run(when, when, state._replace(x=x), None)
            if not (transitions or beyond):
                if not math.isfinite(t):
                    warn_of_earlier_levels(bound, state.x, when, state.regime.model.switching)
                warn_of_held_torques(state, when)
                return SteadyState(state.stored(when), when)
        raise SimulationError(
            f"No steady operation was found: after {MOST_CHANGES} changes of its modes '{self.name}' still goes on, "
            f"with {self.words(state)}. {another_start(self.form)}"
        )

    def point(self, values: Mapping[str, float], at: Point, t: Time) -> OperatingPoint:
        """The equations of the phase that goes on at a point, and where it is; see `Model.point`."""
        from shaftwork.frequency.analysis import without_swing

        time, state = self.hybrid_state_at(values, at, t)
        model, p = state.regime.equations.model, state.regime.p
        return OperatingPoint(model, without_swing(model, p), time, state.x, self.words(state))

    def hybrid_state_at(self, values: Mapping[str, float], at: Point, t: Time) -> tuple[float, HybridState]:
        """Time in s at a point, and the modes that go on there with their states; see `point`."""
        from shaftwork.frequency.analysis import moment_of, operating_point

        first, p = self.equation_sets.first_equations(values)
        event_iteration = EventIteration(self.equation_sets, values, (0.0, 1.0))
        if isinstance(at, Solution):
            time, stored = moment_of(at, self.states)
            time = time if t is None else in_si("t", t, "s")
            x = first.stores.states(first.bound(p), time, dict(zip(self.states, stored.tolist(), strict=True)))
        else:
            usual = 0.0 if at is None else first.model.settled(p)  # what rests has not begun to move
            time, x = operating_point(first.model, p, at, t, usual)
        return time, event_iteration.started(time, x)

    def words(self, state: HybridState) -> str:
        """The phase of a hybrid state, "gap open, brake locked"."""
        pairs = zip(self.equation_sets.machines, state.regime.modes, strict=True)
        return ", ".join(f"{machine.name} {machine.modes[name].words}" for machine, name in pairs)

    def start_equations(self, values: Mapping[str, float]) -> BoundArrays:
        """The equations of the first phase, of which start values tell the states."""
        first, p = self.equation_sets.first_equations(values)
        return first.bound(p)


def _ends(state: HybridState, t: float, x: Array) -> bool:
    return passes_limit(state._replace(x=x), t)


def warn_of_held_torques(state: HybridState, when: float, left: float = 1e-3) -> None:
    """Warn where what sticks can hold other torques as well: a spring between two of them, or from one to the frame.

    What can hold within a range has limits on both sides: brakes, frictions and gears that are stuck. The states are
    disturbed, and of that is read what is left for ever: it tells equilibria side by side.

    Args:
        state: the steady state.
        when: time at which laws are read, s.
        left: part of what disturbs a torque that is left in it where it stays; rounding leaves some 1e-4 of it. It is
            told of each torque by itself: beside that of a stiff floor, which is disturbed most, all others are small.
    """
    regime, x = state.regime, state.x
    holding = [
        (regime.machines[active.machine].name, active.guard)
        for active in regime.watched
        if active.leave.by_torque and sum(leave.by_torque for leave in regime.mode(active.machine).leaves) > 1
    ]
    if not (holding and x.size):
        return
    bound = regime.bound
    shares = np.random.default_rng(0).uniform(1.0, 2.0, x.size)  # no state makes up for another
    disturbed = shares / energy_weights(bound)
    remaining = lasting(bound, x, disturbed, when)
    now, soon, late = (
        np.array(regime.guards_at(when, (x + change).tolist())) for change in (0 * x, disturbed, remaining)
    )
    moves = np.abs(late - now) > left * np.abs(soon - now)
    if names := tuple(dict.fromkeys(name for name, guard in holding if moves[guard])):
        network = bound.program.form.graph.name
        warn(
            f"steady_state() of '{network}': {listed(names)} can hold within a range, so the torques given are one of "
            "many that last; which of them stays depends on how the drive came to rest, and simulate(...) gives that "
            "of its own motion.",
            NetworkWarning,
        )
