"""In which of its modes a part may start, by the conditions that the modes state."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

from sympy import Integer, Piecewise, Symbol
from sympy.core.relational import Relational

from shaftwork.codegen.code import branchwise, scalar
from shaftwork.components.branches import ACROSS, INTEGRAL
from shaftwork.components.laws import t as TIME
from shaftwork.components.modes import Modes


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
