"""Parts that are on from one time to another: motors, brakes and switches."""

from __future__ import annotations

from typing import Any

from sympy import Expr, Min, Mul, Piecewise, false
from sympy.logic.boolalg import Boolean

from shaftwork.components.base import Component, number_of
from shaftwork.components.laws import t
from shaftwork.components.modes import Leave
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import parameter


def on_time() -> Any:
    """Declares `t_on`, the time from which a motor gives torque; None for always."""
    return parameter("s", "time from which it gives torque", default=None, latex=r"t_{on}")


def off_time() -> Any:
    """Declares `t_off`, the time from which a motor gives none; None for never."""
    return parameter("s", "time from which it gives none", default=None, latex=r"t_{off}")


def while_on(law: Expr, p: Any) -> Expr:
    """A law from `p.t_on` until `p.t_off`, exactly zero before and after; the law itself where neither is given.

    The cases of a law that has some follow those of the time: equations print one list of them, not one in another.
    """
    before = [] if p.t_on is None else [(0, t < p.t_on)]
    cases = _cases(law)
    if p.t_off is None:
        return Piecewise(*before, *cases) if before else law
    if len(cases) > 1:
        return Piecewise(*before, (0, t >= p.t_off), *cases)
    return Piecewise(*before, (law, t < p.t_off), (0, True))


def _cases(law: Expr) -> tuple[tuple[Expr, Any], ...]:
    """The values and conditions of a multiple of a piecewise law; of any other law itself alone."""
    factors = Mul.make_args(law)
    pieces = [factor for factor in factors if isinstance(factor, Piecewise)]
    if len(pieces) != 1:
        return ((law, True),)
    others = Mul(*(factor for factor in factors if factor is not pieces[0]))
    return tuple((others * value, condition) for value, condition in pieces[0].args)


def onset(p: Any, on: Expr | None) -> Expr:
    """Rises above zero when a part comes on: at `p.t_on`, or with a law when that is above zero after `p.t_on`."""
    if on is None:
        return t - p.t_on
    return on if p.t_on == 0 else Min(t - p.t_on, on)


def is_past(p: Any) -> Boolean:
    """Whether a part is off for good, from `p.t_off` on."""
    return false if p.t_off is None else t >= p.t_off


def ends(p: Any, mode: str) -> tuple[Leave, ...]:
    """What leads to the mode of a part that is off for good."""
    return () if p.t_off is None else (Leave(t - p.t_off, mode),)


def refuse_no_time_on(part: Component, does: str = "gives torque") -> None:
    """Refuse times between which a part never does anything.

    Args:
        part: with `t_on` and `t_off`.
        does: what it then never does.

    Raises:
        ParameterError: `t_off` is not later than `t_on`.
    """
    start, end = number_of(part, "t_on"), number_of(part, "t_off")
    if start is not None and end is not None and end <= start:
        twice = (
            f" Where it is to be on up to {end:g} s and again from {start:g} s, give two parts: one with "
            f"t_off = {end:g} alone, one with t_on = {start:g} alone."
        )
        raise ParameterError(
            f"{type(part).__name__} '{part.name}': t_off = {end:g} s is not later than t_on = {start:g} s, so that it "
            f"never {does}. Give t_off > t_on, or leave one of them out.{twice if 0 < end < start else ''}"
        )
