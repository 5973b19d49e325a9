"""What changes its mode in a network: mode machines, their modes, and the guards that end these.

What slips by its mode may not move at all, as others hold both of its ends: of two frictions on one shaft one rests.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain

import numpy as np
from sympy import Expr, Integer, Symbol

from shaftwork.codegen.array_form.elements import Array
from shaftwork.components.branches import ACROSS, End
from shaftwork.components.modes import Leave, Mode, ModeChoice, Modes
from shaftwork.core.errors import CompileError
from shaftwork.formulation.form import StateForm
from shaftwork.formulation.gains import Number, add, value_of
from shaftwork.formulation.observables import Observables
from shaftwork.network.graph import GROUND, CircuitGraph, GraphPart
from shaftwork.network.kinds import Kind
from shaftwork.network.netlist import Netlist

NO_IMPACT = 1e-8
"""A speed across what is rigid, as part of the largest one or of one, up to which it is an error of the run."""

ModeNames = tuple[str, ...]
"""The mode of every mode machine of a network, in their order."""

GivesWay = tuple[tuple[float, str], ...]
"""The sides on which a torque is limited, and the modes that follow there."""


def is_same(after: Array, before: Array) -> bool:
    """Whether states (n,) after an instant are those before it, but for errors of the run."""
    return bool(np.abs(after - before).max(initial=0.0) <= NO_IMPACT * np.abs(before).max(initial=1.0))


@dataclass(frozen=True, eq=False)
class ModeMachine:
    """A part, or a piece of one, that changes its mode, with its modes.

    Args:
        part: of which it is.
        modes: its modes.
        number: "part.mode", the parameter in laws.
    """

    part: GraphPart
    modes: Modes
    number: str

    @property
    def name(self) -> str:
        """How messages and tables call it."""
        return f"{self.part.name}.{self.modes.label}" if self.modes.label else self.part.name

    @property
    def first(self) -> str:
        """Its first mode, in which it is not rigid."""
        return self.modes.options[0].name

    def is_rigid(self, mode: str) -> bool:
        """Whether it joins its ends in a mode, so that they move as one."""
        return self.modes[mode].form != self.modes.options[0].form

    @cached_property
    def rigid_modes(self) -> tuple[str, ...]:
        """The modes in which it joins its ends."""
        return tuple(mode.name for mode in self.modes.options if self.is_rigid(mode.name))

    @cached_property
    def equivalent(self) -> Mapping[str, str]:
        """By mode the first one with the same law: "open" of one that has parted."""
        first: dict[tuple[str, float], str] = {}
        return {mode.name: first.setdefault((mode.form, mode.value), mode.name) for mode in self.modes.options}

    def opening_side(self, mode: str) -> float | None:
        """The side of the speed across at which a mode opens that joins by a torque of one sign; None of others."""
        sides = [side for side, _ in self.modes[mode].gives_way]
        return sides[0] if len(sides) == 1 and self.is_rigid(mode) else None

    @cached_property
    def is_one_way(self) -> bool:
        """Whether it is a diode or a freewheel: it joins by a torque of one sign, as soon as speeds let it."""
        return not self._rebounds and any(self.opening_side(mode) is not None for mode in self.rigid_modes)

    @cached_property
    def is_switch(self) -> bool:
        """Whether it joins its ends whatever passes: a time or a law says when it does."""
        limited = any(self.modes[mode].gives_way for mode in self.rigid_modes)
        return bool(self.rigid_modes) and not self.modes.passes_on and not limited

    @cached_property
    def holds(self) -> bool:
        """Whether it joins its ends in some modes, by a torque that ends these, as friction and contacts do.

        Freewheels and diodes have no branch while they are open, in whose place a reaction could act.
        """
        options = self.modes.options
        limited = all(self.modes[mode].gives_way for mode in self.rigid_modes)
        one_law = all(mode.at_rest is None for mode in options)
        reacts = self._rebounds or len(options) > 2
        return bool(self.rigid_modes) and limited and one_law and reacts and not self.modes.passes_on

    @property
    def _rebounds(self) -> bool:
        return any(leave.rebound is not None for mode in self.modes.options for leave in mode.leaves)


def machines_of(graph: CircuitGraph) -> tuple[ModeMachine, ...]:
    """Every mode machine of a network, in the order of its parts."""
    return tuple(
        ModeMachine(part, modes, f"{part.name}.{modes.symbol}") for part in graph.parts for modes in part.modes
    )


def limited(machines: Sequence[ModeMachine], modes: ModeNames) -> dict[int, GivesWay]:
    """Machines that join by a torque that is limited, with the sides on which it is and the modes there."""
    pairs = enumerate(zip(machines, modes, strict=True))
    sides = {k: machine.modes[name].gives_way for k, (machine, name) in pairs}
    return {k: gives_way for k, gives_way in sides.items() if gives_way}


def with_modes(modes: ModeNames, changed: Mapping[int, str]) -> ModeNames:
    """A combination of modes with some of them changed."""
    return tuple(changed.get(k, name) for k, name in enumerate(modes))


@dataclass(frozen=True, eq=False)
class ActiveGuard:
    """What may end a mode in a set of equations.

    Args:
        machine: of the mode, by its number.
        guard: its place among those of the equations.
        side: on which it is met.
        leave: what follows.
    """

    machine: int
    guard: int
    side: float
    leave: Leave


def with_laws_of_rest(netlist: Netlist, form: StateForm) -> Netlist:
    """The network with the laws of rest for what cannot move; the same one where there are none.

    Args:
        netlist: of the network, with a form chosen for each mode machine.
        form: of the same network.
    """
    parts = {part.name: part for part in form.graph.parts}
    resting: dict[str, tuple[ModeChoice, ...]] = {}
    for item in netlist.placed:
        part = parts[item.part.name]
        pairs = zip(part.modes, item.choices, strict=False)  # nothing is chosen for what has no modes
        choices = tuple(_choice_at_rest(form, part, modes, choice) for modes, choice in pairs)
        if choices != item.choices:
            resting[part.name] = choices
    return netlist.with_choices(resting) if resting else netlist


def _choice_at_rest(form: StateForm, part: GraphPart, modes: Modes, choice: ModeChoice) -> ModeChoice:
    """What is chosen for a machine, in the form of rest where it has one and is at rest."""
    forms = (mode.at_rest for mode in modes.options if mode.form == choice.form and mode.at_rest is not None)
    other = next(forms, None)
    return replace(choice, form=other) if other is not None and rests(form, part, modes) else choice


def rests(form: StateForm, part: GraphPart, modes: Modes) -> bool:
    """Whether no branch of the tree but rigid joints is on the way from one end of a machine to the other."""
    return joints_across(form, part, modes) is not None


def joints_across(form: StateForm, part: GraphPart, modes: Modes) -> Mapping[int, float] | None:
    """The rigid joints on the way from one end of a machine to the other, by branch, with the speed across the machine
    for one across each of them; None where other branches of the tree are on it.
    """
    first, second = (_potential(form, part, end) for end in part.ends_of(modes))
    if first is None or second is None:
        return None
    path = {tree: add(first.get(tree, 0), -second.get(tree, 0), []) for tree in dict.fromkeys(chain(first, second))}
    joints = {tree: value_of(share) for tree, share in path.items() if share != 0}
    rigid = all(form.graph.branches[tree].template.kind is Kind.COUPLING for tree in joints)
    return joints if rigid else None


def holds_at_rest(form: StateForm, part: GraphPart, modes: Modes) -> tuple[int, float] | None:
    """The branch of the friction that alone holds a machine at rest, and the sign of its speed for the machine's.

    None where nothing does, or another part that has modes, or several.
    """
    joints = joints_across(form, part, modes) or {}
    holders = {branch: share for branch, share in joints.items() if form.graph.part_of(branch).modes}
    if len(holders) != 1:
        return None
    ((branch, share),) = holders.items()
    rubs = any(len(mode.gives_way) > 1 for other in form.graph.part_of(branch).modes for mode in other.options)
    return (branch, math.copysign(1.0, share)) if rubs else None


def _potential(form: StateForm, part: GraphPart, end: End) -> Mapping[int, Number] | None:
    node = part.node_at(end)
    return {} if node == GROUND else form.tree.potentials[node]


class ModeGuards:
    """The guards of all modes.

    Args:
        form: of the equations.
        machines: of the network.
        forms: of each machine; None for one of which all are in these equations.
        readings: of the same.
    """

    def __init__(
        self, form: StateForm, machines: Sequence[ModeMachine], forms: Sequence[str | None], readings: Observables
    ) -> None:
        self._form, self._machines, self._readings = form, machines, readings
        self._parts = {part.name: part for part in form.graph.parts}
        self.expressions: list[Expr] = []
        """Each guard once."""
        self.resting = {k for k, e in enumerate(machines) if rests(form, self._parts[e.part.name], e.modes)}
        """Machines of which others hold both ends."""
        self._places: dict[tuple[int, Expr], int] = {}
        self._leaves: dict[tuple[int, str], tuple[ActiveGuard, ...]] = {}
        for number, machine in enumerate(machines):
            part = self._parts[machine.part.name]
            for mode in machine.modes.options:
                if forms[number] in (None, mode.form):
                    holds = forms[number] is None and machine.is_rigid(mode.name)
                    still = {ACROSS: Integer(0)} if holds or number in self.resting else {}
                    self._leaves[number, mode.name] = tuple(self._leaving(number, part, mode, still))
        self.owners = {active.guard: active.machine for guards in self._leaves.values() for active in guards}
        """The machine of each guard."""
        self._sides: dict[ModeNames, Array] = {}
        self._ends: dict[ModeNames, tuple[ActiveGuard, ...]] = {}

    def _leaving(self, number: int, part: GraphPart, mode: Mode, still: Mapping[Symbol, Expr]) -> Iterator[ActiveGuard]:
        """The guards of a mode; what another mode of the machine has is shared, with the other sign as well.

        Args:
            number: of the machine.
            part: of the machine.
            mode: of the machine.
            still: its speed where that is always zero: through gears it would be so but for rounding, which would tell
                which way a friction slips.
        """
        taken: list[int] = []
        modes = self._machines[number].modes
        for leave in mode.leaves:
            try:
                when = self._readings.guard(part, modes, leave.when.xreplace(still))
                if still and leave.by_speed:
                    # what has given way at rest holds again before the one that holds it is pressed the other way
                    when = leave.when.xreplace({ACROSS: self._holding(part, modes)})
            except ValueError as error:  # sympy's, of a minimum or maximum of what is infinite
                raise CompileError(
                    f"A law of '{self._machines[number].name}' has no finite value at zero speed, where it is "
                    f"{mode.words}. Take one that has, as 1 / (0.1 + omega**2) has for 1 / omega**2."
                ) from error
            for side, expression in ((1.0, when), (-1.0, -when)):
                place = self._places.get((number, expression))
                if place is not None and place not in taken:
                    active = ActiveGuard(number, place, side, leave)
                    break
            else:
                self.expressions.append(when)
                active = ActiveGuard(number, len(self.expressions) - 1, 1.0, leave)
                self._places.setdefault((number, when), active.guard)
            taken.append(active.guard)
            yield active

    def _holding(self, part: GraphPart, modes: Modes) -> Expr:
        """The torque of the one friction that holds a machine at rest, with the sign that its own would have."""
        holder = holds_at_rest(self._form, part, modes)
        if holder is None:
            return Integer(0)
        branch, sign = holder
        return int(sign) * self._readings.through(branch)

    def of(self, machine: int, mode: str) -> tuple[ActiveGuard, ...]:
        """The guards of one mode of a machine; none of a mode in another form."""
        return self._leaves.get((machine, mode), ())

    def watched(self, modes: ModeNames) -> tuple[ActiveGuard, ...]:
        """Everything that may end one of the modes."""
        if modes not in self._ends:
            self._ends[modes] = tuple(active for pair in enumerate(modes) for active in self._leaves[pair])
        return self._ends[modes]

    def sides(self, modes: ModeNames) -> Array:
        """(guards,) the side of each guard that ends one of the modes."""
        if modes not in self._sides:
            sides = np.zeros(len(self.expressions))
            for active in self.watched(modes):
                sides[active.guard] = active.side
            self._sides[modes] = sides
        return self._sides[modes]
