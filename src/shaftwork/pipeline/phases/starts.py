"""How a motion through phases starts: what a restart must name, and the modes that the conditions of a part allow."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache

from sympy import Integer, Piecewise, Symbol
from sympy.core.relational import Relational

from shaftwork.codegen.code import branchwise, scalar
from shaftwork.components.branches import ACROSS, INTEGRAL
from shaftwork.components.laws import t as TIME
from shaftwork.components.modes import Modes
from shaftwork.core.errors import ParameterError


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
            "initial={name: sol[name][-1] for name in sol.states}, or give 0.0 for what is at rest."
        )
