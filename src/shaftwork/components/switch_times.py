"""The times between which a part does something."""

from __future__ import annotations

from shaftwork.components.base import Component, number_of
from shaftwork.core.errors import ParameterError


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
