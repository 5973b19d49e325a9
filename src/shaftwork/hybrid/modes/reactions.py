"""Parts that hold and slip: one set of equations for all their combinations.

A network of k frictions has 2^k combinations of what is stuck. Here all have the equations in which everything slips,
and what holds adds reactions: as numbers in explicit rows where each part holds inertias of its own (`HeldRows`), so
that an engine goes on past a change of what holds; else as matrices (`joints`), which are worth it for many.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property, partial
from itertools import chain
from typing import Any

import numpy as np
from sympy import Float

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.array_form.linear_readings import ReadingMatrices
from shaftwork.codegen.array_form.matrices import LinearPart
from shaftwork.codegen.compiled_model import ScalarProgram
from shaftwork.components.discontinuities import parts
from shaftwork.components.noise import HeldNoise, SmoothNoise
from shaftwork.core.calls import BoundedCache
from shaftwork.formulation.form import StateForm
from shaftwork.hybrid.modes.joints import HeldArrays, HeldRows, HeldStores, Joints, groups, held_places
from shaftwork.hybrid.modes.mode_equations import ModeEquations
from shaftwork.hybrid.modes.mode_machines import ModeMachine, ModeNames, is_same
from shaftwork.integrate.problem import Problem
from shaftwork.network.graph import GROUND
from shaftwork.network.kinds import Kind
from shaftwork.pipeline.model import Model

MANY = 12
"""From so many machines on that hold and slip matrices are quicker than equations for each combination that is met."""


class ReactionEquations(ModeEquations):
    """One set of equations for all modes of parts that hold, with those of them that do so; at first none.

    Args:
        model: the equations in which everything slips.
        machines: of the network.
        laws: of each machine the branch of its law; None for one that is in the form that it has here.
    """

    def __init__(self, model: Model, machines: tuple[ModeMachine, ...], laws: Sequence[int | None]) -> None:
        self._entries = _entries(model, machines, laws)
        choices = chain.from_iterable(item.choices for item in model.netlist.placed)
        forms = [choice.form if law is None else None for law, choice in zip(laws, choices, strict=True)]
        super().__init__(model, machines, forms, None if self._entries is None else self._entries.rows)
        self.stores = HeldStores(model.form)
        self._laws, self._holding_laws = laws, list[int]()
        joining = (machine.number for machine, law in zip(machines, laws, strict=True) if law is not None)
        self._joining = [self._places[number] for number in joining if number in self._places]
        self._joints: tuple[LinearPart, Joints] | None = None
        self._entries_of: tuple[Joints, Array] | None = None
        _ = self._many, self.clocks  # made once for all

    def holding(self, numbers: tuple[int, ...]) -> ReactionEquations:
        """The equations in which the machines of these numbers hold."""
        other = copy(self)
        # of each combination of what holds, few: there may be many of these
        laws = [law for k in numbers if (law := self._laws[k]) is not None]
        vars(other).update(_holding_laws=laws, _joints=None, _entries_of=None, _guards_by_p=BoundedCache(2))
        return other

    def holds_by_numbers(self, number: int) -> bool:
        """Whether a machine holds and gives way by other numbers in explicit rows."""
        return self._entries is not None and self._laws[number] is not None

    def states_held(self, x: Array, p: Array) -> Array | None:
        """The states in which all comes to one speed that holds, or None where an impact leads there."""
        met = self.joints(p).met(x)
        return met if is_same(met, x) else None

    def suits(self, engine: str) -> bool:
        """Whether what holds is numbers in explicit rows, and these are quick for an engine by name.

        They contain guards of all modes. Those that change by themselves heyoka follows beside the motion; others
        evaluate them at every stage, and noise takes its time.
        """
        if self._entries is None or not self.clocks:
            return self._entries is not None
        noisy = any(isinstance(part, HeldNoise | SmoothNoise) for part in parts(self.expressions))
        return engine in ("auto", "heyoka") and not noisy and self.program is not None

    @cached_property
    def scalar(self) -> ScalarProgram | None:
        """The right-hand side in scalar code, where there are rows."""
        return None if self._entries is None else ScalarProgram(self._entries.rows)

    def values(self, p: Array) -> Array:
        """The parameters and what holds."""
        if self._entries is None:
            return p
        joints = self.joints(p)
        if self._entries_of is None or self._entries_of[0] is not joints:
            self._entries_of = joints, joints.entries(self._entries)
        return np.concatenate([p, self._entries_of[1]])

    def joints(self, p: Array) -> Joints:
        """What holds, for parameters; the last is kept."""
        part = self.prepared(p).bound.part
        if self._joints is None or self._joints[0] is not part:
            self._joints = part, Joints(self.model.form, part, self._holding_laws)
        return self._joints[1]

    def alike(self, modes: ModeNames) -> tuple[ModeEquations, ModeNames]:
        """What is the same for the choice of an engine: whether a machine holds or slips does not make it stiff."""
        return self.whole, tuple("" if law is not None else name for law, name in zip(self._laws, modes, strict=True))

    def judged(self, p: Array, problem: Problem) -> Problem:
        """The motion by which an engine is chosen: with nothing held, as stiffness may be hidden in what is."""
        slopes = self.slopes(partial(self.prepared(p).bound.with_laws, p))
        return replace(problem, jacobian=slopes, jacobians=None)

    def _reading(self, bound: HeldArrays, matrices: ReadingMatrices) -> Callable[[Array, Array], Array]:
        """What guards are made of; rounding gives no speed to what holds."""
        exact = super()._reading(bound, matrices)
        return lambda times, states: exact(times, bound.joints.as_one(states.T).T)

    def bound(self, p: Array) -> HeldArrays:
        """The equations with their parameters."""
        plain = self.prepared(p).bound
        return HeldArrays(plain.program, p, plain.part, self.joints(p))

    def _notes(self, p: Array) -> dict[str, Any]:
        """What engines find out about the right-hand side, whatever holds."""
        free = p.copy()
        free[self._joining] = 0.0
        return super()._notes(free)


def laws_that_hold(model: Model, machines: Sequence[ModeMachine]) -> list[int | None] | None:
    """Of each machine that holds the branch of the law in whose place a reaction does so; None for others.

    Args:
        model: equations in which none of them is rigid.
        machines: of the network.

    Returns:
        None where reactions would not tell the motion: where a speed is prescribed, where what holds has no inertia at
        an end, or torques depend on each other.
    """
    form = model.form
    if form.loop_laws or form.inertial or form.across_inputs or form.waves or form.dependent_through:
        return None
    laws = [_law(form, machine) if machine.holds else None for machine in machines]
    lacking = (machine.holds and law is None for law, machine in zip(laws, machines, strict=True))
    return None if any(lacking) else laws


def _entries(model: Model, machines: Sequence[ModeMachine], laws: Sequence[int | None]) -> HeldRows | None:
    """Rows in which what holds is numbers, or None where there are none."""
    pairs = [(machine, law) for machine, law in zip(machines, laws, strict=True) if law is not None]
    links = [law for _, law in pairs]
    if not all(_vanishes(model.form, *pair) for pair in pairs):
        return None
    rigid = (machine for machine, law in zip(machines, laws, strict=True) if law is None and machine.rigid_modes)
    others = [_places(model.form, machine) for machine in rigid]
    connected = groups(model.form, links, others)
    rows = None if connected is None else model.rows_of(len(others) + 1)
    if connected is None or rows is None:
        return None
    return HeldRows(rows, [(link, held_places(model.form, link)) for link in links], connected)


def _vanishes(form: StateForm, machine: ModeMachine, law: int) -> bool:
    """Whether a law is zero in all modes in which a machine holds."""
    template = form.graph.branches[law].template
    numbers = [symbol for symbol in template.symbols if symbol.name == machine.modes.symbol]
    values = (Float(machine.modes[mode].value) for mode in machine.rigid_modes)
    return all(template.law.xreplace(dict.fromkeys(numbers, value)) == 0 for value in values)


def _places(form: StateForm, machine: ModeMachine) -> set[int]:
    """Places of the states of speed that the nodes of a machine's part turn with."""
    part = next(part for part in form.graph.parts if part.name == machine.part.name)
    rows = (form.tree.potentials[node] or {} for node in part.nodes.values() if node != GROUND)
    trees = set[int]().union(*rows)
    return {place for place, tree in enumerate(form.across_states) if tree in trees}


def _law(form: StateForm, machine: ModeMachine) -> int | None:
    """The link whose law has the mode of a machine, between its ends, where inertias tell the speeds of both."""
    graph, part = form.graph, next(part for part in form.graph.parts if part.name == machine.part.name)
    ends = tuple(map(part.node_at, part.ends_of(machine.modes)))
    for index in part.branches:
        branch = graph.branches[index]
        symbols = {symbol.name for symbol in branch.template.law.free_symbols}
        if branch.template.kind not in (Kind.LAW, Kind.THROUGH_SOURCE) or machine.modes.symbol not in symbols:
            continue
        by_inertias = index in form.tree.loops and set(form.tree.loops[index]) <= {*form.across_states}
        if by_inertias and (branch.plus, branch.minus) == ends:
            return index
    return None
