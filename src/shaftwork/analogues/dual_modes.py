"""Parts that change their mode, as elements of a dual: pairs of laws for what rubs, one law for what touches."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

from sympy import Add, Expr, Float, Integer, Or, Piecewise, Symbol, false
from sympy.logic.boolalg import Boolean

from shaftwork.components.branches import ACROSS, INTEGRAL, THROUGH, readings_in
from shaftwork.components.laws import t as TIME
from shaftwork.components.modes import ANEW, Mode, ModeChoice, Modes
from shaftwork.network.graph import GraphPart, resolve
from shaftwork.network.kinds import Kind
from shaftwork.network.templates import BranchTemplate, make_template
from shaftwork.numerics.tolerances import TYPED


@dataclass(frozen=True)
class DualModes:
    """The modes of a part as a dual has them.

    What rubs holds up to a torque. In the dual that is a contact, open up to a voltage: two diodes, one for each side,
    each with a source of the voltage at which it conducts. What holds one way is a diode, and flanks that spring back
    have one law.

    Args:
        part: a part with modes.
    """

    part: GraphPart

    @cached_property
    def _modes(self) -> Modes:
        return self.part.modes[0]

    @cached_property
    def _joined(self) -> tuple[Mode, ...]:
        return tuple(mode for mode in self._modes.options if mode.form != self._modes.options[0].form)

    @cached_property
    def is_one_way(self) -> bool:
        """Whether it is a diode or a freewheel."""
        options = self._modes.options
        opens = [tuple(leave.when for leave in mode.leaves) for mode in options]
        return len(self._joined) == 1 and opens == [(ACROSS,), (-THROUGH,)]

    @cached_property
    def _slipping(self) -> tuple[str, ...]:
        """The modes of what rubs in which it slips forward and backward."""
        sides = sorted(self._joined[0].gives_way, reverse=True) if len(self._joined) == 1 else []
        return tuple(to for _, to in sides) if [side for side, _ in sides] == [1.0, -1.0] else ()

    @cached_property
    def _off(self) -> tuple[Mode, ...]:
        """The modes of what rubs in which it does not: before and after its time."""
        names = (*self._slipping, *(mode.name for mode in self._joined))
        return tuple(mode for mode in self._modes.options if mode.name not in names)

    @cached_property
    def rubs(self) -> bool:
        """Whether it is a friction or a brake."""
        return bool(self._slipping)

    @cached_property
    def problem(self) -> str:
        """Why it has no dual, the rest of a sentence that begins with "it"; empty where it has one."""
        if len(self.part.modes) > 1:
            return "changes its modes in several places"
        if self._modes.law is not None:
            return ""
        if self.is_one_way:
            return "has laws beside what holds one way" if self.part.branches else ""
        if not self.rubs:
            return "changes its mode by other rules than frictions, freewheels and gaps with springs do"
        if any(mode.at_rest is not None for mode in self._modes.options):
            return "holds more than it rubs with at any speed"
        if any(not _by_time(mode) for mode in self._off):
            return "comes on by a law, and not at a time that is known before"
        if any(law.has(INTEGRAL) or readings_in(law) for laws in self.pairs for law in laws):
            return "rubs by its angle"
        return "" if self._holds_as_it_rubs else "holds up to another torque than it rubs with as it begins to slip"

    @property
    def holds(self) -> bool:
        """Whether it holds rigidly in one of its modes."""
        return bool(self._joined)

    @property
    def holding(self) -> ModeChoice:
        """The form in which it holds."""
        return ModeChoice(self._joined[0].form, self._joined[0].value)

    @property
    def choice(self) -> ModeChoice:
        """The form in which it has a branch, which stands for it in the graph, and the number in its laws there."""
        if self._modes.law is not None or self.is_one_way:
            mode = next(mode for mode in self._modes.options if mode.value)
        else:
            mode = self._modes[self._slipping[0]]
        return ModeChoice(mode.form, mode.value)

    @cached_property
    def pairs(self) -> tuple[tuple[Expr, Expr], ...]:
        """For each branch of what rubs its laws forward and backward, which are zero while it does not rub."""
        off = Or(*(mode.starts for mode in self._off))

        def timed(law: Expr) -> Expr:
            return law if off == false else Piecewise((Integer(0), off), (law, True))

        ahead, back = self._slips
        return tuple((timed(first.law), timed(second.law)) for first, second in zip(ahead, back, strict=True))

    @cached_property
    def _slips(self) -> tuple[tuple[BranchTemplate, ...], ...]:
        """The branches while it slips forward, and those while it slips backward."""
        values = resolve(self.part.component)[0]
        choices = ((ModeChoice(self._modes[name].form, self._modes[name].value),) for name in self._slipping)
        return tuple(make_template(self.part.component, values, choice).branches for choice in choices)

    @property
    def _holds_as_it_rubs(self) -> bool:
        """Whether it gives way at the torque of its laws at no speed, as diodes with sources do."""
        values = resolve(self.part.component)[0].items()
        numbers = {Symbol(name, real=True): Float(value) for name, value in values if isinstance(value, float)}
        for sign, branches in zip((1, -1), self._slips, strict=True):
            rubs = Add(*(one.law for one in branches if one.kind in (Kind.LAW, Kind.THROUGH_SOURCE)))
            (limit,) = (leave.when for leave in self._joined[0].leaves if leave.when.diff(THROUGH) == sign)
            apart = limit.xreplace({THROUGH: Integer(0)}) + sign * rubs.subs(ACROSS, 0)
            for time in (0.37, 1.9, 27.3):  # s, that no law singles out
                at = {**numbers, TIME: Float(time)}
                if abs(apart.subs(at).evalf()) > TYPED * abs(rubs.subs(ACROSS, 0).subs(at).evalf()):
                    return False
        return True


def _by_time(mode: Mode) -> bool:
    """Whether a mode begins and ends at times that are known before, and nothing passes in it."""
    conditions: Iterator[Expr | Boolean] = (mode.starts, *(leave.when for leave in mode.leaves))  # type: ignore[assignment]
    moves = any(one.has(ACROSS, INTEGRAL, THROUGH) or readings_in(one) for one in conditions)
    straight = all(leave.when.diff(TIME).is_number for leave in mode.leaves if leave.to == ANEW)
    return not moves and straight and mode.value == 0
