"""Combinations of modes with everything that it takes to go on in them, and what goes over from one to another."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from sympy import Integer

from shaftwork.components.branches import INTEGRAL
from shaftwork.core.errors import NetworkError, ParameterError, SimulationError
from shaftwork.formulation.value_diagnosis import jamming
from shaftwork.hybrid.hybrid_state import AHEAD_OF_RUN, ROUNDINGS, HybridState, Regime
from shaftwork.hybrid.modes.mode_equations import ModeEquations
from shaftwork.hybrid.modes.mode_machines import ModeNames, with_modes
from shaftwork.hybrid.phases import Phases
from shaftwork.hybrid.starts import begins_anew
from shaftwork.pipeline.motion_start import Ending

BEYOND = 1e-6
"""How far in rad a motion may start beyond a rigid limit: errors and printed digits of another run leave so much."""


class Regimes:
    """The combinations of modes of a network for one set of values; each is made when it is first needed.

    Args:
        phases: the sets of equations.
        values: parameters that differ from the network's.
        span: start and end of the run, s.
        equations: for a combination of modes.
    """

    def __init__(
        self,
        phases: Phases,
        values: Mapping[str, float],
        span: tuple[float, float],
        equations: Callable[[ModeNames], ModeEquations],
    ) -> None:
        self._phases, self._values, self._equations = phases, dict(values), equations
        self.first, self.elements = phases.first, phases.elements
        self._times = ROUNDINGS * math.ulp(max(map(abs, span))), AHEAD_OF_RUN * (span[1] - span[0])
        self._regimes: dict[ModeNames, Regime] = {}

    def regime(self, modes: ModeNames) -> Regime:
        """A combination of modes.

        Raises:
            NetworkError: the equations of these modes contradict each other, or a gear jams in them.
        """
        if modes not in self._regimes:
            assembly = self._equations(modes)
            form, p = assembly.model.form, assembly.vector(self._values, self._phases.numbers(modes))
            if self._values and (jammed := tuple(jamming(form, {**assembly.model.parameters, **self._values}))):
                raise NetworkError(f"'{form.graph.name}' cannot be assembled", jammed)
            sides, sizes, watched = assembly.sides(modes), assembly.sizes(p), assembly.watched(modes)
            regime = Regime(modes, assembly, p, *assembly.motion(p), sides, sizes, watched, *self._times)
            self._regimes.setdefault(modes, regime)  # another thread may have been first
        return self._regimes[modes]

    def possible(self, modes: ModeNames) -> bool:
        """Whether the equations of these modes agree with each other."""
        try:
            self.regime(modes)
        except NetworkError:
            return False
        return True

    def joinable(self, modes: ModeNames, joins: Mapping[int, str]) -> Mapping[int, str]:
        """Of elements and the modes in which they hold all that agree, the first before the others.

        Beside a prescribed speed that is zero by now not all of them can.
        """
        if self.possible(with_modes(modes, joins)):
            return joins
        joined: dict[int, str] = {}
        for k, name in joins.items():
            if self.possible(with_modes(modes, {**joined, k: name})):
                joined[k] = name
        return joined

    def stored(self, moment: HybridState, t: float) -> dict[str, float]:
        """All that is stored, and what arrives by waves, by name."""
        assembly, p = moment.regime.assembly, moment.regime.p
        values = assembly.stores.of(lambda: assembly.bound(p), np.array([t]), moment.x[None, :])[0]
        return dict(zip(assembly.stores.names, values.tolist(), strict=True)) | assembly.arriving(moment.x)

    def differ(self, t: float, one: HybridState, other: HybridState, least: float) -> bool:
        """Whether what is stored at two moments of one time differs by more than so much."""
        stored, others = self.stored(one, t), self.stored(other, t)
        return any(abs(others[name] - value) > least for name, value in stored.items())

    def taking(self, modes: ModeNames, t: float, stored: Mapping[str, float]) -> HybridState:
        """A moment in the given modes that takes up what was stored, with the inputs of a time in s.

        Raises:
            NetworkError: the equations of these modes contradict each other.
        """
        new = self.regime(modes)
        return HybridState(new, new.assembly.taking(t, stored, new.p))

    def changed(self, moment: HybridState, t: float, modes: ModeNames) -> HybridState:
        """The same instant in other modes: all that is stored goes over.

        Raises:
            NetworkError: the equations of these modes contradict each other.
        """
        new = self.regime(modes)
        if new.assembly is moment.regime.assembly:
            return HybridState(new, moment.x)
        return self.taking(modes, t, self.stored(moment, t))

    def resumed(self, ending: Ending) -> HybridState:
        """The moment at which another motion ended, in its modes.

        An element begins anew, as at a start, where a parameter has changed that says in which mode it starts.

        Raises:
            ParameterError: something is stored that it did not store, or a twist lies beyond a rigid limit.
        """
        first, t, loose = self.first, ending.read, self.regime(self.first)
        ending.refuse_lacking(loose.assembly.stores.names)
        parameters = dict(zip(loose.assembly.model.parameters, loose.p.tolist(), strict=True))
        apart = self.taking(first, t, ending)
        if ending.changed(parameters) - {element.number for element in self.elements}:
            refuse_beyond(apart, t)
        anew = [
            begins_anew(e.part.name, e.modes, ending.modes.get(e.name), t, ending.parameters, parameters)
            for e in self.elements
        ]
        fresh = loose.assembly.first_modes(t, apart.x, loose.p) if any(anew) else first
        triples = zip(anew, fresh, self.elements, strict=True)
        modes = tuple(name if begins else ending.modes[e.name] for begins, name, e in triples)
        return self.taking(modes if self.possible(modes) else first, t, ending)


def anew(moment: HybridState, t: float, number: int) -> str:
    """The mode of an element in which a motion would start, other than the one that ends."""
    regime, before = moment.regime, moment.regime.modes[number]
    for late in (0.0, regime.ahead(moment.course(t)[2])):  # by rounding, what ends the mode may not be true yet
        to = regime.assembly.start_of(number, before, t + late, moment.moved(t, late).x, regime.p)
        if to:
            return to
    element = regime.elements[number]
    raise SimulationError(
        f"'{element.name}' is no more {element.modes[before].words} at t = {t:.9g} s, and starts in none of its "
        "other modes. Give one of them a condition that holds there, Mode(starts=...)."
    )


def refuse_beyond(moment: HybridState, t: float) -> None:
    """Refuse a start beyond a rigid limit, where no motion leads.

    Args:
        moment: in the modes in which nothing is joined.
        t: s.

    Raises:
        ParameterError: names the part, its twist and the limit.
    """
    regime = moment.regime
    now = regime.limits(t, moment.x.tolist())
    for active in regime.watched:
        element, when, beyond = regime.elements[active.element], active.leave.when, active.side * now[active.guard]
        if active.leave.rebound is None or not beyond > BEYOND:
            continue
        slope = float(when.diff(INTEGRAL))
        limit = -slope * regime.constant(active.element, when.xreplace({INTEGRAL: Integer(0)}))
        raise ParameterError(
            f"{type(element.part.component).__name__} '{element.name}' would start at a twist of "
            f"{limit + slope * beyond:.9g} rad, {'above its upper' if slope > 0 else 'below its lower'} limit of "
            f"{limit:.9g} rad, and it is rigid. Give a twist inside the limits, "
            f"initial={{'{element.name}.phi': ...}}, or a stiffness c."
        )
