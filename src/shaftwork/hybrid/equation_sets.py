"""The sets of equations of a network whose parts change their mode, and the engines that follow them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.components.modes import ModeChoice
from shaftwork.core.calls import BoundedCache
from shaftwork.core.errors import NetworkError, NetworkWarning, ParameterError
from shaftwork.core.notices import muted
from shaftwork.formulation.value_diagnosis import self_locks
from shaftwork.hybrid.modes.mode_equations import ModeEquations
from shaftwork.hybrid.modes.mode_machines import NO_IMPACT, ModeNames, machines_of, with_laws_of_rest, with_modes
from shaftwork.hybrid.modes.reactions import MANY, ReactionEquations, laws_that_hold
from shaftwork.integrate import choice
from shaftwork.integrate.engines import ENGINES, GENERAL
from shaftwork.integrate.problem import Problem
from shaftwork.network.netlist import Netlist
from shaftwork.pipeline.model import Model


class EquationSets:
    """All sets of equations of a network whose parts change their mode; each is made when a motion first needs it.

    Args:
        base: the model in the first mode of each machine, in which none of them is rigid.
        rebuild: makes the model of a changed netlist.
    """

    kind: ClassVar[type[ModeEquations]] = ModeEquations
    """Of the sets of equations."""
    model_kind: ClassVar[type[Model]] = Model
    """Of the models of one phase."""

    def __init__(self, base: Model, rebuild: Callable[[Netlist], Model]) -> None:
        self.netlist, self._form, self._rebuild = base.netlist, base.form, rebuild
        self.machines = machines_of(base.form.graph)
        self.first: ModeNames = tuple(machine.first for machine in self.machines)
        self._by_forms: dict[tuple[str, ...], ModeEquations | NetworkError] = {}
        self._slipping: dict[tuple[str, ...], ReactionEquations | None] = {}
        self._holding: dict[tuple[tuple[str, ...], tuple[int, ...]], ReactionEquations] = {}
        self._engines: dict[tuple[ModeEquations, ModeNames, str], tuple[str, str]] = {}
        self._easy: dict[ModeEquations, dict[tuple[int, str], tuple[str, str]]] = {}
        self.last_run = BoundedCache[Any, Any](1)
        """What the last run has learned, by its values and times: the next like it goes on with that."""

    def of(self, modes: ModeNames) -> ModeEquations:
        """The equations for a combination of modes.

        Raises:
            NetworkError: they contradict each other, as where a stuck brake is turned by a prescribed speed.
        """
        forms = tuple(machine.modes[name].form for machine, name in zip(self.machines, modes, strict=True))
        if forms not in self._by_forms:
            try:
                equations: ModeEquations | NetworkError = self.kind(self._model(forms), self.machines, forms)
            except NetworkError as error:
                equations = error
            self._by_forms.setdefault(forms, equations)  # another thread may have been first
        equations = self._by_forms[forms]
        if isinstance(equations, NetworkError):
            raise equations.with_traceback(None)  # else it would keep the frames of every time that it was raised
        return equations

    def _model(self, forms: tuple[str, ...]) -> Model:
        """The model in a combination of forms; the first one has been assembled when the network was compiled."""
        netlist = self._netlist(forms)
        is_first = forms == tuple(machine.modes[machine.first].form for machine in self.machines)
        model = self.model_kind(self._form, netlist, self._rebuild) if is_first else self._assembled(netlist)
        resting = with_laws_of_rest(netlist, model.form)
        return model if resting is netlist else self._assembled(resting)

    def _assembled(self, netlist: Netlist) -> Model:
        with muted(NetworkWarning):  # of the network as it is wired compilation has warned
            return self._rebuild(netlist)

    def first_equations(self, values: Mapping[str, float]) -> tuple[ModeEquations, Array]:
        """The equations in the first mode of each machine, and their parameters: start values are read in these.

        Args:
            values: parameters that differ from the network's.
        """
        first = self.of(self.first)
        return first, first.vector(values, self.numbers(self.first))

    def running(self, modes: ModeNames, values: Mapping[str, float], engine: str) -> ModeEquations:
        """The equations in which a motion goes on: those of `of`, or one set for all that hold.

        Args:
            modes: of every machine.
            values: parameters that differ from the network's.
            engine: name of the engine that is asked for.

        Raises:
            NetworkError: as there.
        """
        able = [k for k, machine in enumerate(self.machines) if machine.holds]
        if not able:
            return self.of(modes)
        holding = tuple(k for k in able if self.machines[k].is_rigid(modes[k]))
        free = with_modes(modes, {k: self.first[k] for k in holding})
        forms = tuple(machine.modes[name].form for machine, name in zip(self.machines, free, strict=True))
        if forms not in self._slipping:
            self._slipping[forms] = self._all_slipping(free)
        slipping = self._slipping[forms]
        if slipping is None or not (slipping.suits(engine) or (len(able) >= MANY and engine != "heyoka")):
            return self.of(modes)
        form = slipping.model.form
        if form.loses_power and self_locks(form, {**slipping.model.parameters, **values}):
            return self.of(modes)  # whether it jams depends on what is held
        if (forms, holding) not in self._holding:
            self._holding[forms, holding] = slipping.holding(holding)
        equations = self._holding[forms, holding]
        p = equations.vector(values, self.numbers(modes))
        # where parts share what they hold, the first carries as much as it can
        independent = equations.joints(p).independent and not self._rests(equations, modes, p)
        return equations if independent else self.of(modes)

    def _rests(self, equations: ReactionEquations, modes: ModeNames, p: Array) -> bool:
        """Whether what has another law at rest slips by its mode, and yet cannot turn as others hold its ends."""
        pairs = enumerate(zip(self.machines, modes, strict=True))
        slipping = [k for k, (machine, name) in pairs if machine.modes[name].at_rest is not None]
        if not slipping:
            return False
        x = np.random.default_rng(0).uniform(1.0, 2.0, len(equations.model.states))  # no two alike by chance
        speeds = equations.across(slipping, 0.0, equations.joints(p).as_one(x), p)
        return any(abs(speed) < NO_IMPACT for speed in speeds)

    def _all_slipping(self, free: ModeNames) -> ReactionEquations | None:
        """One set of equations for all that hold, from the modes in which none does; None where there is none."""
        try:
            model = self.of(free).model
        except NetworkError:  # as of a gear that jams only while a clutch behind it slips
            return None
        laws = laws_that_hold(model, self.machines)
        return None if laws is None else ReactionEquations(model, self.machines, laws)

    def _netlist(self, forms: tuple[str, ...]) -> Netlist:
        chosen: dict[str, tuple[ModeChoice, ...]] = {}
        for machine, form in zip(self.machines, forms, strict=True):
            chosen[machine.part.name] = (*chosen.get(machine.part.name, ()), ModeChoice(form))
        return self.netlist.with_choices(chosen)

    def numbers(self, modes: ModeNames) -> dict[str, float]:
        """The number of each machine's mode by the name of its parameter."""
        pairs = zip(self.machines, modes, strict=True)
        return {machine.number: machine.modes[name].value for machine, name in pairs}

    def engine(
        self, equations: ModeEquations, modes: ModeNames, problem: Callable[[], Problem], engine: str
    ) -> tuple[str, str]:
        """The engine for a phase, and why: a light wheel that runs free is no trouble, and stiff in contact.

        Args:
            equations: the equations.
            modes: in which they are solved.
            problem: makes the motion from there on, which is looked at once for these modes.
            engine: its name, or "auto".

        Raises:
            ParameterError: the one that is asked for follows no modes.
        """
        equations, modes = equations.alike(modes)
        key = equations, modes, engine
        if engine != "auto":
            choice.check(engine)
            entry = ENGINES[engine]
            if entry.following is None:
                following = sorted(name for name in GENERAL if ENGINES[name].following is not None)
                raise ParameterError(
                    f"The engine '{engine}' follows no parts that change their mode "
                    f"({', '.join(machine.name for machine in self.machines)}). Take one of: {', '.join(following)}."
                )
            if not entry.unless_stiff:
                return engine, "asked for"
            if key not in self._engines:
                other = entry.unless_stiff
                why = f"asked for; the motion is not stiff, so {ENGINES[other].method} is taken."
                self._engines[key] = (engine, "asked for") if choice.is_stiff(problem()) else (other, why)
            return self._engines[key]
        if key not in self._engines:
            easy = self._easy.setdefault(equations, {})
            if easy.keys() >= {*enumerate(modes)}:  # each of them was no trouble beside others
                return next(iter(easy.values()))
            name, why = choice.choose(problem())
            if ENGINES[name].following is None:  # that of long chains
                name = choice.implicit()
            if name == "heyoka":
                easy |= dict.fromkeys(enumerate(modes), (name, why))
            self._engines[key] = name, why
        return self._engines[key]

    def tries_heyoka(self, equations: ModeEquations) -> bool:
        """Whether heyoka has been taken for these equations in other modes: a stiff phase may be over at once."""
        return bool(self._easy.get(equations))
