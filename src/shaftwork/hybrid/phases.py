"""The sets of equations of a network whose parts change their mode, and the engines that follow them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.components.modes import ModeChoice
from shaftwork.core.calls import BoundedCache
from shaftwork.core.errors import NetworkError, NetworkWarning, ParameterError, SimulationError
from shaftwork.core.notices import muted
from shaftwork.formulation.value_diagnosis import jamming, self_locks
from shaftwork.hybrid.hybrid_state import AHEAD_OF_RUN, ROUNDINGS, HybridState, Regime
from shaftwork.hybrid.modes.mode_equations import ModeEquations
from shaftwork.hybrid.modes.mode_machines import NO_IMPACT, ModeNames, at_rest, elements_of, with_modes
from shaftwork.hybrid.modes.reactions import MANY, ReactionEquations, laws_that_hold
from shaftwork.hybrid.starts import begins_anew
from shaftwork.integrate import choice
from shaftwork.integrate.engines import ADAMS, ENGINES, INNER, WAVE, available
from shaftwork.integrate.problem import Problem
from shaftwork.network.netlist import Netlist
from shaftwork.pipeline.model import Model
from shaftwork.pipeline.motion_start import Ending

FOLLOWING = {
    name: entry.following
    for name, entry in (*ENGINES.items(), *INNER.items(), ("wave", WAVE))
    if entry.following is not None
}
"""Engines that follow guards: the part of the tolerance that they run with, and the loosest one."""
_ENGINES = ", ".join(sorted(name for name in FOLLOWING if name not in (ADAMS, "wave")))


class Phases:
    """All sets of equations of a network whose parts change their mode; each is made when a motion first needs it.

    Args:
        base: the model in the first mode of each element, in which no mode joins anything rigidly.
        rebuild: makes the model of a changed netlist.
    """

    kind: ClassVar[type[ModeEquations]] = ModeEquations
    """Of the sets of equations."""

    def __init__(self, base: Model, rebuild: Callable[[Netlist], Model]) -> None:
        self.netlist, self._rebuild = base.netlist, rebuild
        self.elements = elements_of(base.form.graph)
        self.first: ModeNames = tuple(element.first for element in self.elements)
        self._assemblies: dict[tuple[str, ...], ModeEquations | NetworkError] = {}
        self._slipping: dict[tuple[str, ...], ReactionEquations | None] = {}
        self._holding: dict[tuple[tuple[str, ...], tuple[int, ...]], ReactionEquations] = {}
        self._engines: dict[tuple[ModeEquations, ModeNames, str], tuple[str, str]] = {}
        self._easy: dict[ModeEquations, dict[tuple[int, str], tuple[str, str]]] = {}
        self.last_run = BoundedCache[Any, Any](1)
        """What the last run has learned, by its values and times: the next like it goes on with that."""

    def assembly(self, modes: ModeNames) -> ModeEquations:
        """The equations for a combination of modes.

        Raises:
            NetworkError: they contradict each other, as where a stuck brake is turned by a prescribed speed.
        """
        forms = tuple(element.modes[name].form for element, name in zip(self.elements, modes, strict=True))
        if forms not in self._assemblies:
            try:
                with muted(NetworkWarning):  # of the network as it is wired compilation has warned
                    netlist = self._netlist(forms)
                    model = self._rebuild(netlist)
                    if (resting := at_rest(netlist, model.form)) is not netlist:
                        model = self._rebuild(resting)
                assembly: ModeEquations | NetworkError = self.kind(model, self.elements, forms)
            except NetworkError as error:
                assembly = error
            self._assemblies.setdefault(forms, assembly)  # another thread may have been first
        assembly = self._assemblies[forms]
        if isinstance(assembly, NetworkError):
            raise assembly.with_traceback(None)  # else it would keep the frames of every time that it was raised
        return assembly

    def first_equations(self, values: Mapping[str, float]) -> tuple[ModeEquations, Array]:
        """The equations in the first mode of each element, and their parameters: start values are read in these.

        Args:
            values: parameters that differ from the network's.
        """
        first = self.assembly(self.first)
        return first, first.vector(values, self.numbers(self.first))

    def running(self, modes: ModeNames, values: Mapping[str, float], engine: str) -> ModeEquations:
        """The equations in which a motion goes on: those of `assembly`, or one set for all that hold.

        Args:
            modes: of every element.
            values: parameters that differ from the network's.
            engine: name of the engine that is asked for.

        Raises:
            NetworkError: as there.
        """
        able = [k for k, element in enumerate(self.elements) if element.holds]
        if not able:
            return self.assembly(modes)
        holding = tuple(k for k in able if self.elements[k].joins(modes[k]))
        free = with_modes(modes, {k: self.first[k] for k in holding})
        forms = tuple(element.modes[name].form for element, name in zip(self.elements, free, strict=True))
        if forms not in self._slipping:
            self._slipping[forms] = self._all_slipping(free)
        slipping = self._slipping[forms]
        if slipping is None or not (slipping.suits(engine) or (len(able) >= MANY and engine != "heyoka")):
            return self.assembly(modes)
        if self_locks(slipping.model.form, {**slipping.model.parameters, **values}):
            return self.assembly(modes)  # whether it jams depends on what is held
        if (forms, holding) not in self._holding:
            self._holding[forms, holding] = slipping.holding(holding)
        assembly = self._holding[forms, holding]
        p = assembly.vector(values, self.numbers(modes))
        # where parts share what they hold, the first carries as much as it can
        independent = assembly.joints(p).independent and not self._rests(assembly, modes, p)
        return assembly if independent else self.assembly(modes)

    def _rests(self, assembly: ReactionEquations, modes: ModeNames, p: Array) -> bool:
        """Whether what has another law at rest slips by its mode, and yet cannot turn as others hold its ends."""
        pairs = enumerate(zip(self.elements, modes, strict=True))
        slipping = [k for k, (element, name) in pairs if element.modes[name].at_rest is not None]
        if not slipping:
            return False
        x = np.random.default_rng(0).uniform(1.0, 2.0, len(assembly.model.states))  # no two alike by chance
        speeds = assembly.across(slipping, 0.0, assembly.joints(p).alike(x), p)
        return any(abs(speed) < NO_IMPACT for speed in speeds)

    def _all_slipping(self, free: ModeNames) -> ReactionEquations | None:
        """One set of equations for all that hold, from the modes in which none does; None where there is none."""
        try:
            model = self.assembly(free).model
        except NetworkError:  # as of a gear that jams only while a clutch behind it slips
            return None
        laws = laws_that_hold(model, self.elements)
        return None if laws is None else ReactionEquations(model, self.elements, laws)

    def _netlist(self, forms: tuple[str, ...]) -> Netlist:
        chosen: dict[str, tuple[ModeChoice, ...]] = {}
        for element, form in zip(self.elements, forms, strict=True):
            chosen[element.part.name] = (*chosen.get(element.part.name, ()), ModeChoice(form))
        return self.netlist.with_choices(chosen)

    def numbers(self, modes: ModeNames) -> dict[str, float]:
        """The number of each element's mode by the name of its parameter."""
        pairs = zip(self.elements, modes, strict=True)
        return {element.number: element.modes[name].value for element, name in pairs}

    def engine(
        self, assembly: ModeEquations, modes: ModeNames, problem: Callable[[], Problem], engine: str
    ) -> tuple[str, str]:
        """The engine for a phase, and why: a light wheel that runs free is no trouble, and stiff in contact.

        Args:
            assembly: the equations.
            modes: in which they are solved.
            problem: makes the motion from there on, which is looked at once for these modes.
            engine: its name, or "auto".

        Raises:
            ParameterError: the one that is asked for follows no modes.
        """
        assembly, modes = assembly.alike(modes)
        key = assembly, modes, engine
        if engine != "auto":
            choice.check(engine)
            if engine not in FOLLOWING or engine == "wave":
                raise ParameterError(
                    f"The engine '{engine}' follows no parts that change their mode "
                    f"({', '.join(element.name for element in self.elements)}). Take one of: {_ENGINES}."
                )
            if engine != "sundials":
                return engine, "asked for"
            if key not in self._engines:
                adams = ADAMS, "asked for; the motion is not stiff, so Adams' formulas are taken."
                self._engines[key] = (engine, "asked for") if choice.is_stiff(problem()) else adams
            return self._engines[key]
        if key not in self._engines:
            easy = self._easy.setdefault(assembly, {})
            if easy.keys() >= {*enumerate(modes)}:  # each of them was no trouble beside others
                return next(iter(easy.values()))
            name, why = choice.choose(problem())
            if name not in FOLLOWING:  # that of long chains
                name = "sundials" if available("sundials") else "scipy-radau"
            if name == "heyoka":
                easy |= dict.fromkeys(enumerate(modes), (name, why))
            self._engines[key] = name, why
        return self._engines[key]

    def tries_heyoka(self, assembly: ModeEquations) -> bool:
        """Whether heyoka has been taken for these equations in other modes: a stiff phase may be over at once."""
        return bool(self._easy.get(assembly))


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
            regime = Regime(modes, assembly, p, *self._times)
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
        return self.taking(modes, t, moment.stored(t))

    def resumed(self, ending: Ending) -> HybridState:
        """The moment at which another motion ended, in its modes.

        An element begins anew, as at a start, where a parameter has changed that says in which mode it starts.

        Raises:
            ParameterError: something is stored that it did not store, or a twist lies beyond a rigid limit.
        """
        first, t, loose = self.first, ending.read, self.regime(self.first)
        ending.refuse_lacking(loose.stores.names)
        parameters = dict(zip(loose.model.parameters, loose.p.tolist(), strict=True))
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
        element, beyond = regime.elements[active.element], active.side * now[active.guard]
        if active.leave.rebound is None or not beyond > BEYOND:
            continue
        limit, slope = regime.twist_limit(active.element, active.leave)
        raise ParameterError(
            f"{type(element.part.component).__name__} '{element.name}' would start at a twist of "
            f"{limit + beyond / slope:.9g} rad, {'above its upper' if slope > 0 else 'below its lower'} limit of "
            f"{limit:.9g} rad, and it is rigid. Give a twist inside the limits, "
            f"initial={{'{element.name}.phi': ...}}, or a stiffness c."
        )
