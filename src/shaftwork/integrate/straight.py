"""Inputs that are straight lines between breakpoints."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from shaftwork.core.errors import ParameterError
from shaftwork.integrate.pieces import SmoothInterval
from shaftwork.integrate.problem import Array, Problem

# A forcing may differ from a straight line by this part of its size before it is refused.
STRAIGHT = 1e-7


def straight_line(problem: Problem, forcing: Callable[[float], Array], piece: SmoothInterval) -> tuple[Array, Array]:
    """Level at the start of a piece and slope of u, from values strictly inside the piece.

    Raises:
        ParameterError: u is no straight line.
    """
    length = piece.high - piece.low
    times = [piece.low + part * length for part in (0.25, 0.5, 0.75)]
    early, middle, late = (np.asarray(forcing(time), dtype=float) for time in times)
    slope = (late - early) / (times[2] - times[0])
    bend = np.abs(middle - (early + late) / 2) - np.abs(slope) * np.spacing(piece.high)  # a short piece's times round
    if (bend > STRAIGHT * (np.abs(early) + np.abs(late)).max(initial=0.0)).any():
        name = problem.names[int(np.argmax(bend))]
        raise ParameterError(
            f"The exact engine needs an input that is a straight line between breakpoints; the one of {name!r} bends "
            f"between t = {piece.start:.6g} s and {piece.end:.6g} s. Take the engine 'auto'."
        )
    slope[np.abs(slope) * length <= 8 * np.finfo(float).eps * np.abs(early)] = 0.0
    return early - (times[0] - piece.start) * slope, slope
