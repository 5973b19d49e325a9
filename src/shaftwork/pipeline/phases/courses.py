"""The course of a motion near an instant: what is about to go beyond its limit."""

from __future__ import annotations

from shaftwork.core.errors import NetworkError, SimulationError
from shaftwork.pipeline.phases.hybrid_state import ROUNDINGS, Change, Course, Regime
from shaftwork.pipeline.phases.mode_machines import ActiveGuard

# What a look ahead gains must be more than so many rounding units.
FEW = 4

Way = tuple[int, ActiveGuard]
"""An element and a guard that may end its mode."""


def leaving(
    regime: Regime, here: Course, beside: Course, on_limit: list[Way], *, again: bool
) -> list[tuple[float, Way]]:
    """Of guards on their limit those that are about to go beyond it, and how far, as surely as rounding tells.

    Args:
        regime: the modes.
        here: the course at the moment.
        beside: rounding away from it.
        on_limit: elements and guards.
        again: whether modes have come back: then what hardly moves yet stays as it is, and its motion will tell. The
            step may lie beyond an instant at which a law switches.
    """
    step = regime.ahead(here[2])
    ways, beyond = (here, beside), list[tuple[float, Way]]()
    for _ in range(1 if again else 2):  # where nothing moves yet, its acceleration tells
        ways = _further(regime, step, ways[0], bends=not again), _further(regime, step, ways[1], bends=not again)
        moving = []
        for pair in on_limit:
            watched, k = pair[1], pair[1].guard
            gain, other = watched.side * (ways[0][3][k] - here[3][k]), watched.side * (ways[1][3][k] - beside[3][k])
            units = abs(beside[3][k] - here[3][k]) / ROUNDINGS
            if abs(gain) > max(abs(gain - other), FEW * units):
                moving.append((gain, pair))
        beyond = [one for one in moving if one[0] > 0]
        if beyond:
            break
        on_limit = [pair for pair in on_limit if all(pair is not one for _, one in moving)]
    return beyond


def _further(regime: Regime, step: float, here: Course, *, bends: bool) -> Course:
    """A step further along a straight line; where a prescribed speed bends along a parabola, as all do then (Heun)."""
    ends = regime.course(*regime.later(here, step))
    if not (bends and regime.bends):
        return ends
    t, x, rates, _ = here
    return regime.course(
        t + step, [v + step * (rate + end) / 2 for v, rate, end in zip(x, rates, ends[2], strict=True)]
    )


def chosen(found: list[tuple[float, Way]], *, in_order: bool) -> Way | None:
    """Of elements and guards the first one, or else the one that is farthest beyond."""
    if not found:
        return None
    return (min(found, key=lambda one: one[1][0]) if in_order else max(found, key=lambda one: one[0]))[1]


def endless(t: float, changes: list[Change], blocked: NetworkError | None) -> SimulationError:
    """The error of changes within one instant that come to no end, or of what contradicts what among them."""
    last = changes[-1]
    others = dict.fromkeys(change.element.name for change in changes)
    before, after = (last.element.modes[name].words for name in (last.before, last.after))
    if blocked is not None:
        advice = str(blocked.problems[0])
    elif last.rebound:
        after, advice = "rebound", "Take a restitution below 1, a larger omega_rest, or a gap between its limits."
    else:
        advice = "Give the node between them an inertia or damping."
    return SimulationError(
        f"At t = {t:.9g} s no modes of {', '.join(others)} are consistent: '{last.element.name}' changes for ever "
        f"between {before} and {after}. {advice}"
    )
