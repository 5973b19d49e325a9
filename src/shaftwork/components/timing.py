"""Torque that is switched on and off at given times, the same way for every motor."""

from __future__ import annotations

from typing import Any

from sympy import Expr, Mul, Piecewise

from shaftwork.components.base import Component
from shaftwork.components.laws import t
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


def number_of(part: Component, name: str) -> float | None:
    """A parameter in SI, None where it is left out or is no admissible number, which the checks of a network report."""
    value, objection = part.declared[name].magnitude(getattr(part, name))
    return value if objection is None and isinstance(value, float) else None


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
