"""From one combination of modes to another: all that is stored goes over to the equations of the other one."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from shaftwork.core.errors import NetworkError, ParameterError, SimulationError
from shaftwork.formulation.value_diagnosis import jamming
from shaftwork.hybrid.consistency import time_scales
from shaftwork.hybrid.equation_sets import EquationSets
from shaftwork.hybrid.hybrid_state import HybridState, Regime
from shaftwork.hybrid.modes.mode_equations import ModeEquations
from shaftwork.hybrid.modes.mode_machines import ModeNames, with_modes
from shaftwork.hybrid.modes.starts import begins_anew
from shaftwork.pipeline.motion_start import Ending


class HybridTransfer:
    """Takes all that is stored from one combination of modes to another, for one set of values of the parameters.

    It makes the regime of a combination, its equations with these values, when it is first needed, and keeps it.

    Args:
        equation_sets: the sets of equations.
        values: parameters that differ from the network's.
        span: start and end of the run, s.
        equations_of: for a combination of modes.
    """

    def __init__(
        self,
        equation_sets: EquationSets,
        values: Mapping[str, float],
        span: tuple[float, float],
        equations_of: Callable[[ModeNames], ModeEquations],
    ) -> None:
        self._equation_sets, self._values, self._equations_of = equation_sets, dict(values), equations_of
        self.first, self.machines = equation_sets.first, equation_sets.machines
        self._times = time_scales(span)
        self._regimes: dict[ModeNames, Regime] = {}

    def regime(self, modes: ModeNames) -> Regime:
        """A combination of modes.

        Raises:
            NetworkError: the equations of these modes contradict each other, or a gear jams in them.
        """
        if modes not in self._regimes:
            equations = self._equations_of(modes)
            form, p = equations.model.form, equations.vector(self._values, self._equation_sets.numbers(modes))
            if self._values and (jammed := tuple(jamming(form, {**equations.model.parameters, **self._values}))):
                raise NetworkError(f"'{form.graph.name}' cannot be assembled", jammed)
            regime = Regime(modes, equations, p, *self._times)
            self._regimes.setdefault(modes, regime)  # another thread may have been first
        return self._regimes[modes]

    def possible(self, modes: ModeNames) -> bool:
        """Whether the equations of these modes agree with each other."""
        try:
            self.regime(modes)
        except NetworkError:
            return False
        return True

    def compatible(self, modes: ModeNames, holding: Mapping[int, str]) -> Mapping[int, str]:
        """Of machines and the modes in which they hold all that agree, the first before the others.

        Beside a prescribed speed that is zero by now not all of them can.
        """
        if self.possible(with_modes(modes, holding)):
            return holding
        compatible: dict[int, str] = {}
        for k, name in holding.items():
            if self.possible(with_modes(modes, {**compatible, k: name})):
                compatible[k] = name
        return compatible

    def with_stored(self, modes: ModeNames, t: float, stored: Mapping[str, float]) -> HybridState:
        """A state in the given modes that takes up what was stored, with the inputs of a time in s.

        Raises:
            NetworkError: the equations of these modes contradict each other.
        """
        new = self.regime(modes)
        return HybridState(new, new.equations.states_from(t, stored, new.p))

    def to_modes(self, state: HybridState, t: float, modes: ModeNames) -> HybridState:
        """The same instant in other modes: all that is stored goes over.

        Raises:
            NetworkError: the equations of these modes contradict each other.
        """
        new = self.regime(modes)
        if new.equations is state.regime.equations:
            return HybridState(new, state.x)
        return self.with_stored(modes, t, state.stored(t))

    def resumed(self, ending: Ending) -> HybridState:
        """The state at which another motion ended, in its modes.

        A machine begins anew, as at a start, where a parameter has changed that says in which mode it starts.

        Raises:
            ParameterError: something is stored that it did not store, or a twist lies beyond a rigid limit.
        """
        first, t, loose = self.first, ending.read, self.regime(self.first)
        ending.refuse_lacking(loose.stores.names)
        parameters = dict(zip(loose.model.parameters, loose.p.tolist(), strict=True))
        apart = self.with_stored(first, t, ending)
        if ending.changed(parameters) - {machine.number for machine in self.machines}:
            refuse_beyond(apart, t)
        anew = [
            begins_anew(e.part.name, e.modes, ending.modes.get(e.name), t, ending.parameters, parameters)
            for e in self.machines
        ]
        fresh = loose.equations.first_modes(t, apart.x, loose.p) if any(anew) else first
        triples = zip(anew, fresh, self.machines, strict=True)
        modes = tuple(name if begins else ending.modes[e.name] for begins, name, e in triples)
        return self.with_stored(modes if self.possible(modes) else first, t, ending)


def mode_anew(state: HybridState, t: float, number: int) -> str:
    """The mode of a machine in which a motion would start, other than the one that ends."""
    regime, before = state.regime, state.regime.modes[number]
    for late in (0.0, regime.ahead(state.course(t)[2])):  # by rounding, what ends the mode may not be true yet
        to = regime.equations.start_of(number, before, t + late, state.moved(t, late).x, regime.p)
        if to:
            return to
    machine = regime.machines[number]
    raise SimulationError(
        f"'{machine.name}' is no more {machine.modes[before].words} at t = {t:.9g} s, and starts in none of its "
        "other modes. Give one of them a condition that holds there, Mode(starts=...)."
    )


def refuse_beyond(state: HybridState, t: float, tolerated: float = 1e-6) -> None:
    """Refuse a start beyond a rigid limit, where no motion leads.

    Args:
        state: in the modes in which no machine is rigid.
        t: s.
        tolerated: how far beyond in rad: errors and printed digits of another run leave so much.

    Raises:
        ParameterError: names the part, its twist and the limit.
    """
    regime = state.regime
    now = regime.guards_at(t, state.x.tolist())
    for active in regime.watched:
        machine, beyond = regime.machines[active.machine], active.side * now[active.guard]
        if active.leave.rebound is None or not beyond > tolerated:
            continue
        limit, slope = regime.twist_limit(active.machine, active.leave)
        raise ParameterError(
            f"{type(machine.part.component).__name__} '{machine.name}' would start at a twist of "
            f"{limit + beyond / slope:.9g} rad, {'above its upper' if slope > 0 else 'below its lower'} limit of "
            f"{limit:.9g} rad, and it is rigid. Give a twist inside the limits, "
            f"initial={{'{machine.name}.phi': ...}}, or a stiffness c."
        )
