"""How a motion through phases starts: the modes that conditions allow, and what a restart must name."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, lru_cache
from itertools import accumulate
from typing import Any

from sympy import Expr, Float, Integer, Piecewise, Symbol, Tuple
from sympy.core.relational import Relational

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.code import bindable, branchwise, scalar, vectorised_list
from shaftwork.codegen.undefined_laws import in_words
from shaftwork.components.branches import ACROSS, INTEGRAL, THROUGH, readings_in
from shaftwork.components.discontinuities import line
from shaftwork.components.laws import t as TIME
from shaftwork.components.modes import ANEW, Modes
from shaftwork.core.calls import BoundedCache
from shaftwork.core.errors import AccuracyWarning, ParameterError, no_value
from shaftwork.core.notices import warn
from shaftwork.formulation.observables import Observables
from shaftwork.hybrid.modes.mode_machines import ModeMachine, ModeNames
from shaftwork.network.graph import GraphPart


class MachineReadings:
    """What machines show at one instant: the speed across each, its twist, and what its start conditions read.

    All of it follows from what guards read at that instant.

    Args:
        machines: of the network.
        parts: by name.
        readings: of the equations.
        parameters: symbols of the parameter vector.
    """

    def __init__(
        self,
        machines: Sequence[ModeMachine],
        parts: Mapping[str, GraphPart],
        readings: Observables,
        parameters: tuple[Symbol, ...],
    ) -> None:
        self._machines, self._parts, self._readings, self._parameters = machines, parts, readings, parameters
        self._symbols = tuple(conditional(machine.modes) for machine in machines)
        # of each machine the place where what it shows begins
        self._firsts = tuple(accumulate((2 + len(symbols) for symbols in self._symbols), initial=0))
        self._speeds: dict[int, Callable[..., Any]] = {}
        self._bound = BoundedCache[tuple[int, bytes], Callable[..., Any]](256)

    def first_modes(self, t: float, read: Sequence[float], p: Array) -> ModeNames:
        """The mode of each machine in which a motion starts, in the equations in which nothing is joined by a mode."""
        shown = self._at(t, read, p)
        machines = enumerate(self._machines)
        return tuple(self._start(k, "", t, shown) or machine.first for k, machine in machines)

    def start_of(self, number: int, besides: str, t: float, read: Sequence[float], p: Array) -> str:
        """The mode of a machine in which a motion would start, besides one; empty where it would start in none."""
        return self._start(number, besides, t, self._at(t, read, p))

    def across(self, numbers: Sequence[int], t: float, read: Sequence[float], p: Array) -> list[float]:
        """The speeds across machines, which are asked for at every impact: in plain floats, and without the others."""
        return [float(self._speed(number, p)(t, read)[0]) for number in numbers]

    def _speed(self, number: int, p: Array) -> Callable[..., Any]:
        if number not in self._speeds:
            arguments = {"t": TIME, "read": self._readings.symbols}
            self._speeds[number] = bindable(arguments, {"p": self._parameters}, (), (self._expression(number, ACROSS),))
        return self._bound((number, p.tobytes()), lambda: self._speeds[number](p.tolist())[1])

    def _at(self, t: float, read: Sequence[float], p: Array) -> Sequence[Any]:
        return self.function(t, *read, *p.tolist())  # type: ignore[no-any-return]

    def _start(self, number: int, besides: str, t: float, shown: Sequence[Any]) -> str:
        modes = self._machines[number].modes
        first, symbols = self._firsts[number], self._symbols[number]
        conditions = starts_of(modes, symbols)(t, *shown[first : first + 2 + len(symbols)])
        if conditions is None:
            raise no_value(t, in_words(self._machines[number].part, Tuple(*(mode.starts for mode in modes.options))))
        pairs = zip(modes.options, conditions, strict=True)
        return next((mode.name for mode, is_true in pairs if is_true and mode.name != besides), "")

    @cached_property
    def function(self) -> Callable[..., Any]:
        """Of each machine the speed across it, its twist and the parameters in its conditions, one after another."""
        shown = list[Expr]()
        for number, machine in enumerate(self._machines):
            reads = any(mode.starts.has(INTEGRAL) for mode in machine.modes.options)
            twist = self._expression(number, INTEGRAL) if reads else Integer(0)
            others = (self._expression(number, symbol) for symbol in self._symbols[number])
            shown += [self._expression(number, ACROSS), twist, *others]
        return vectorised_list((TIME, *self._readings.symbols, *self._parameters), shown)

    def _expression(self, number: int, of_part: Expr) -> Expr:
        machine = self._machines[number]
        return self._readings.guard(self._parts[machine.part.name], machine.modes, of_part)


@lru_cache(maxsize=256)
def conditional(modes: Modes) -> tuple[Symbol, ...]:
    """The parameters in the conditions under which a motion starts in the modes of a machine."""
    symbols = set[Symbol]().union(*(mode.starts.free_symbols for mode in modes.options))
    return tuple(sorted(symbols - {TIME, ACROSS, INTEGRAL}, key=str))


@lru_cache(maxsize=256)
def starts_of(modes: Modes, symbols: tuple[Symbol, ...]) -> Callable[..., list[float] | None]:
    """From the time, the speed across, the twist and parameters to whether a motion may start in each mode.

    It is None where a condition compares what has no value.
    """
    conditions = [Piecewise((Integer(1), mode.starts), (Integer(0), True)) for mode in modes.options]
    relations = dict.fromkeys(relation for mode in modes.options for relation in mode.starts.atoms(Relational))
    arguments = {f"v{k}": symbol for k, symbol in enumerate((TIME, ACROSS, INTEGRAL, *symbols))}
    fast, slow = scalar(arguments, conditions), branchwise(arguments, conditions)
    differences = branchwise(arguments, [relation.lhs - relation.rhs for relation in relations])

    def starts(*values: float) -> list[float] | None:
        try:
            return fast(*values)  # type: ignore[no-any-return]
        except (ArithmeticError, ValueError):
            return None if any(map(math.isnan, differences(*values))) else slow(*values)

    return starts


def begins_anew(
    part: str, modes: Modes, mode: str | None, t: float, before: Mapping[str, float], now: Mapping[str, float]
) -> bool:
    """Whether a machine cannot go on in the mode in which another motion ended.

    Limits and start conditions say in which mode it starts: where their parameters are others it begins anew, unless
    they stand beside the time alone and tell the same at this time, as a time to switch off that is still to come.

    Args:
        part: its name.
        modes: of the machine.
        mode: in which the motion ended; None where it had none.
        t: the time, s.
        before: the parameters of that motion, "part.parameter" to value; zeros may be left out.
        now: those from now on.
    """
    if not any(each.name == mode for each in modes.options):
        return True
    limits = {
        symbol
        for each in modes.options
        for leave in each.leaves
        if leave.rebound is not None
        for symbol in leave.when.free_symbols
    }
    symbols = {*limits, *conditional(modes)}
    was, becomes = (
        {symbol: Float(values.get(f"{part}.{symbol.name}", 0.0)) for symbol in symbols} for values in (before, now)
    )
    others = {symbol for symbol in symbols if was[symbol] != becomes[symbol]}
    relations = set[Relational]().union(*(each.starts.atoms(Relational) for each in modes.options))
    return not others.isdisjoint(limits) or any(
        relation.has(ACROSS, INTEGRAL)
        or relation.xreplace({**was, TIME: Float(t)}) != relation.xreplace({**becomes, TIME: Float(t)})
        for relation in relations
        if others & relation.free_symbols
    )


def refuse_incomplete(stored: tuple[str, ...], initial: Mapping[str, float], t_start: float) -> None:
    """Refuse start values of a motion that goes on, t_start != 0, where they leave out what is stored.

    The states of one phase are not enough: that gap or that stop would open, whose twist is a state of other phases.

    Args:
        stored: the names of all that is stored in any phase.
        initial: the start values.
        t_start: start of the motion, s.

    Raises:
        ParameterError: names what is missing.
    """
    missing = [name for name in stored if name not in initial]
    if missing:
        raise ParameterError(
            f"A motion that goes on at t_start = {t_start:g} s needs all that is stored, in whatever phase it is a "
            f"state, and initial lacks {', '.join(missing)}. Take it from the motion before, "
            "initial=sol, or give 0.0 for what is at rest."
        )


def warn_of_what_may_have_begun(name: str, modes: Modes, mode: str, t_start: float) -> None:
    """Warn where a motion that goes on begins in a mode that parts leave for good, and not at a time known before.

    So a brake with `on` waits; that it came on before, and `on` is no longer true, no speed and no twist tells.

    Args:
        name: of the part.
        modes: of its machine.
        mode: in which the motion begins.
        t_start: start of the motion, s.
    """
    leads = {leave.to for other in modes.options if other.name != mode for leave in other.leaves}
    leaves = modes[mode].leaves
    if leads & {mode, ANEW} or not any(leave.to == ANEW and not _at_a_known_time(leave.when) for leave in leaves):
        return
    warn(
        f"'{name}' begins the motion that goes on at t_start = {t_start:g} s as '{modes[mode].words}'. Whether it came "
        "on before, start values do not tell. Give the motion itself, initial=sol.",
        AccuracyWarning,
    )


def _at_a_known_time(when: Expr) -> bool:
    """Whether a condition comes true at a time that follows from parameters alone."""
    straight = None if when.has(ACROSS, INTEGRAL, THROUGH) or readings_in(when) else line(when)
    return straight is not None and bool(straight[0].is_positive)
