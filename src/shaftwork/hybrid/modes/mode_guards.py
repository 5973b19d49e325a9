"""What ends the modes of a network, as expressions in one set of equations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from sympy import Expr, Integer, Symbol

from shaftwork.codegen.array_form.elements import Array
from shaftwork.components.branches import ACROSS
from shaftwork.components.modes import Mode, Modes
from shaftwork.core.errors import CompileError
from shaftwork.formulation.form import StateForm
from shaftwork.formulation.observables import Observables
from shaftwork.hybrid.modes.mode_machines import ActiveGuard, ModeMachine, ModeNames
from shaftwork.hybrid.modes.resting import holds_at_rest, rests
from shaftwork.network.graph import GraphPart


class ModeGuards:
    """The guards of all modes.

    Args:
        form: of the equations.
        elements: of the network.
        forms: of each element; None for one of which all are in these equations.
        readings: of the same.
    """

    def __init__(
        self, form: StateForm, elements: Sequence[ModeMachine], forms: Sequence[str | None], readings: Observables
    ) -> None:
        self._form, self._elements, self._readings = form, elements, readings
        self._parts = {part.name: part for part in form.graph.parts}
        self.expressions: list[Expr] = []
        """Each guard once."""
        self.resting = {k for k, e in enumerate(elements) if rests(form, self._parts[e.part.name], e.modes)}
        """Elements of which others hold both ends."""
        self._places: dict[tuple[int, Expr], int] = {}
        self._leaves: dict[tuple[int, str], tuple[ActiveGuard, ...]] = {}
        for number, element in enumerate(elements):
            part = self._parts[element.part.name]
            for mode in element.modes.options:
                if forms[number] in (None, mode.form):
                    holds = forms[number] is None and element.joins(mode.name)
                    still = {ACROSS: Integer(0)} if holds or number in self.resting else {}
                    self._leaves[number, mode.name] = tuple(self._leaving(number, part, mode, still))
        self.owners = {active.guard: active.element for guards in self._leaves.values() for active in guards}
        """The element of each guard."""
        self._sides: dict[ModeNames, Array] = {}
        self._ends: dict[ModeNames, tuple[ActiveGuard, ...]] = {}

    def _leaving(self, number: int, part: GraphPart, mode: Mode, still: Mapping[Symbol, Expr]) -> Iterator[ActiveGuard]:
        """The guards of a mode; what another mode of the element has is shared, with the other sign as well.

        Args:
            number: of the element.
            part: of the element.
            mode: of the element.
            still: its speed where that is always zero: through gears it would be so but for rounding, which would tell
                which way a friction slips.
        """
        taken: list[int] = []
        element = self._elements[number].modes
        for leave in mode.leaves:
            try:
                when = self._readings.guard(part, element, leave.when.xreplace(still))
                if still and leave.by_speed:
                    # what has given way at rest holds again before the one that holds it is pressed the other way
                    when = leave.when.xreplace({ACROSS: self._holding(part, element)})
            except ValueError as error:  # sympy's, of a minimum or maximum of what is infinite
                raise CompileError(
                    f"A law of '{self._elements[number].name}' has no finite value at zero speed, where it is "
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

    def _holding(self, part: GraphPart, element: Modes) -> Expr:
        """The torque of the one friction that holds an element at rest, with the sign that its own would have."""
        holder = holds_at_rest(self._form, part, element)
        if holder is None:
            return Integer(0)
        branch, sign = holder
        return int(sign) * self._readings.through(branch)

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
