"""What is said of a motion that is worth less than its tolerance promises."""

from __future__ import annotations

from dataclasses import replace

from shaftwork.core.errors import AccuracyWarning
from shaftwork.core.notices import warn
from shaftwork.integrate.engines import too_fine
from shaftwork.pipeline.arguments import Demand
from shaftwork.results.solution import Solution


def with_accuracy(motion: Solution, demand: Demand) -> Solution:
    """A motion that says with which tolerance it was made, where that is not the one that was asked for.

    Warns:
        AccuracyWarning: the motion has a caveat; or the engine that cannot keep the tolerance was asked for by name.
    """
    if motion.caveat:
        warn(motion.caveat, AccuracyWarning)
    told = too_fine(motion.engine, demand.rtol)
    if not told:
        return motion
    if demand.engine != "auto":
        warn(f"{told} Ask for no finer tolerance, or take another engine.", AccuracyWarning)
    return replace(motion, why=f"{motion.why.rstrip('.')}. {told}")
