"""What a user gives to a run, checked: times, tolerances, outputs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np

from shaftwork.codegen.elements import Array
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import in_si

OUTPUTS, MOST_OUTPUTS = 1001, 10_000_000
"""Output times when the user gives none, and the most that can be asked for."""
OutputTimes = int | Sequence[float] | Array | Literal["steps"] | None


def watched_by(rhs: Callable[[float, Array], Array], progress: Callable[[float], None]) -> Callable[..., Array]:
    """A right-hand side that tells somebody the time at which it is asked."""

    def watched(t: float, x: Array) -> Array:
        progress(t)
        return rhs(t, x)

    return watched


def time_span(t_start: Any, t_end: Any) -> tuple[float, float]:
    """Start and end of a run in s.

    Raises:
        ParameterError: it cannot be; says what would be right.
    """
    start, end = in_si("t_start", t_start, "s"), in_si("t_end", t_end, "s")
    if not end > start:
        raise ParameterError(f"t_end = {t_end} must be a finite time after t_start = {t_start}.")
    return start, end


def relative_tolerance(rtol: Any) -> float:
    """The relative tolerance as a number.

    Raises:
        ParameterError: it cannot be; says what would be right.
    """
    value = in_si("rtol", rtol)
    if not 0 < value < 1:
        raise ParameterError(f"rtol = {rtol} must lie between 0 and 1; 1e-8 is a good choice.")
    return value


def absolute_tolerances(atol: Any, size: int) -> Array:
    """(states,) absolute tolerances.

    Raises:
        ParameterError: it cannot be; says what would be right.
    """
    try:
        values = np.broadcast_to(np.asarray(atol, dtype=float), (size,))
    except (TypeError, ValueError):
        raise ParameterError(f"atol = {atol!r} must be one number, or {size} numbers, one for each state.") from None
    if not (np.isfinite(values).all() and (values > 0).all()):
        raise ParameterError(f"atol = {atol!r} must be above 0; leave it out for a value that suits the states.")
    return values


def output_times(t_eval: OutputTimes, start: float, end: float) -> Array | None:
    """The output times (k,), or None for those of the engine's steps.

    Raises:
        ParameterError: it cannot be; says what would be right.
    """
    if isinstance(t_eval, str):
        if t_eval != "steps":
            raise ParameterError(f"t_eval = '{t_eval}' must be times, their number, or 'steps'.")
        return None
    if t_eval is None or isinstance(t_eval, (int, np.integer)):
        count = OUTPUTS if t_eval is None else int(t_eval)
        if not 2 <= count <= MOST_OUTPUTS:
            raise ParameterError(f"t_eval = {count} output times: give at least 2 and at most {MOST_OUTPUTS}.")
        return np.linspace(start, end, count)
    try:
        times = np.asarray(t_eval, dtype=float)
    except (TypeError, ValueError):
        raise ParameterError(f"t_eval = {t_eval!r} must be a list of times, their number, or 'steps'.") from None
    good = times.ndim == 1 and times.size > 0 and bool(np.isfinite(times).all())
    if not good or times[0] < start or times[-1] > end or (np.diff(times) <= 0).any():
        raise ParameterError(f"t_eval must hold strictly increasing times between {start:g} and {end:g} s.")
    return times
