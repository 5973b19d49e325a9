"""How a motion through phases starts: what a restart must name, and the modes that the conditions of a part allow."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache

from sympy import Expr, Float, Integer, Piecewise, Symbol
from sympy.core.relational import Relational

from shaftwork.codegen.code import branchwise, scalar
from shaftwork.components.branches import ACROSS, INTEGRAL, THROUGH, readings_in
from shaftwork.components.discontinuities import line
from shaftwork.components.laws import t as TIME
from shaftwork.components.modes import ANEW, Modes
from shaftwork.core.errors import AccuracyWarning, ParameterError
from shaftwork.core.notices import warn


@lru_cache(maxsize=256)
def conditional(modes: Modes) -> tuple[Symbol, ...]:
    """The parameters in the conditions under which a motion starts in the modes of an element."""
    found = set[Symbol]().union(*(mode.starts.free_symbols for mode in modes.options))
    return tuple(sorted(found - {TIME, ACROSS, INTEGRAL}, key=str))


@lru_cache(maxsize=256)
def starts_of(modes: Modes, symbols: tuple[Symbol, ...]) -> Callable[..., list[float] | None]:
    """From the time, the speed across, the twist and parameters to whether a motion may start in each mode.

    It is None where a condition compares what has no value.
    """
    conditions = [Piecewise((Integer(1), mode.starts), (Integer(0), True)) for mode in modes.options]
    compared = dict.fromkeys(made for mode in modes.options for made in mode.starts.atoms(Relational))
    arguments = {f"v{k}": symbol for k, symbol in enumerate((TIME, ACROSS, INTEGRAL, *symbols))}
    fast, slow = scalar(arguments, conditions), branchwise(arguments, conditions)
    differences = branchwise(arguments, [made.lhs - made.rhs for made in compared])

    def starts(*values: float) -> list[float] | None:
        try:
            return fast(*values)  # type: ignore[no-any-return]
        except (ArithmeticError, ValueError):
            return None if any(map(math.isnan, differences(*values))) else slow(*values)

    return starts


def begins_anew(
    part: str, modes: Modes, mode: str | None, t: float, before: Mapping[str, float], now: Mapping[str, float]
) -> bool:
    """Whether an element cannot go on in the mode in which another motion ended.

    Limits and start conditions say in which mode it starts: where their parameters are others it begins anew, unless
    they stand beside the time alone and tell the same at this time, as a time to switch off that is still to come.

    Args:
        part: its name.
        modes: of the element.
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
    compared = {made for each in modes.options for made in each.starts.atoms(Relational) if others & made.free_symbols}
    return not others.isdisjoint(limits) or any(
        made.has(ACROSS, INTEGRAL)
        or made.xreplace({**was, TIME: Float(t)}) != made.xreplace({**becomes, TIME: Float(t)})
        for made in compared
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
        modes: of its element.
        mode: in which the motion begins.
        t_start: start of the motion, s.
    """
    ways = {leave.to for other in modes.options if other.name != mode for leave in other.leaves}
    leaves = modes[mode].leaves
    if ways & {mode, ANEW} or not any(leave.to == ANEW and not _at_a_known_time(leave.when) for leave in leaves):
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
