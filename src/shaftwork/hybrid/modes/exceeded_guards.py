"""Which guards end modes at an instant: those beyond their limits, and those on them that are about to go beyond."""

from __future__ import annotations

from collections.abc import Sequence

from shaftwork.hybrid.hybrid_state import ROUNDINGS, Course, HybridState, Regime, clear_of_limits
from shaftwork.hybrid.modes.mode_machines import ActiveGuard

FEW = 4
"""What a look ahead gains must be more than so many rounding units."""

Excess = tuple[float, ActiveGuard]
"""How far a guard is beyond its limit, or will be."""


def exceeded(
    moment: HybridState,
    t: float,
    ended: HybridState,
    idle: Sequence[ActiveGuard] = (),
    *,
    in_order: bool = False,
    again: bool = False,
) -> tuple[HybridState, list[Excess]]:
    """The guards beyond their limits, or on them and about to go beyond, and how far; the moment with its bands.

    Args:
        moment: modes and states.
        t: s.
        ended: the moment before any change.
        idle: guards that were met here already and change nothing.
        in_order: whether the first one will be taken, and not the worst.
        again: whether modes have come back.
    """
    regime, here = moment.regime, moment.course(t)
    beside, now = regime.course(*regime.beside(here)), here[3]
    bands = regime.bands(here, beside[3])
    wide = bands
    if ended.bands and ended.regime.assembly is regime.assembly:
        wide = list(map(max, bands, ended.bands))
    beyond, on_limit = [], []
    for active in regime.watched:
        band, value = wide[active.guard], active.side * now[active.guard]
        if value < -band or active in idle:
            continue
        if value <= band or active.leave.rebound is not None:  # only what comes nearer is thrown back
            on_limit.append(active)
        elif value > 0:
            beyond.append((value, active))
    # impacts come first: torques are those of the motion after them
    hits = [excess for excess in beyond if not excess[1].leave.by_torque]
    # then what the time ends: what else gives way shows when all of that has changed
    timed = [active for active in on_limit if active.leave.by_time]
    hits = hits or (leaving(regime, here, beside, timed, again=False) if timed else [])
    if on_limit and not hits:
        soon_beyond = leaving(regime, here, beside, on_limit, again=again)
        hits = [excess for excess in soon_beyond if excess[1].leave.rebound is not None]
        beyond = beyond + soon_beyond if in_order else beyond or soon_beyond
    return HybridState(regime, moment.x, clear_of_limits(regime, now, bands)), hits or beyond


def leaving(regime: Regime, here: Course, beside: Course, on_limit: list[ActiveGuard], *, again: bool) -> list[Excess]:
    """Of guards on their limit those that are about to go beyond it, and how far, as surely as rounding tells.

    Args:
        regime: the modes.
        here: the course at the moment.
        beside: rounding away from it.
        on_limit: the guards.
        again: whether modes have come back: then what hardly moves yet stays as it is, and its motion will tell. The
            step may lie beyond an instant at which a law switches.
    """
    step = regime.ahead(here[2])
    ahead, ahead_beside, beyond = here, beside, list[Excess]()
    for _ in range(1 if again else 2):  # where nothing moves yet, its acceleration tells
        ahead, ahead_beside = (_further(regime, step, course, bends=not again) for course in (ahead, ahead_beside))
        moving = []
        for active in on_limit:
            k, side = active.guard, active.side
            gain, other = side * (ahead[3][k] - here[3][k]), side * (ahead_beside[3][k] - beside[3][k])
            units = abs(beside[3][k] - here[3][k]) / ROUNDINGS
            if abs(gain) > max(abs(gain - other), FEW * units):
                moving.append((gain, active))
        beyond = [one for one in moving if one[0] > 0]
        if beyond:
            break
        on_limit = [active for active in on_limit if all(active is not one for _, one in moving)]
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


def passes_limit(moment: HybridState, t: float) -> bool:
    """Whether the states are beyond a guard of the modes by more than rounding moves it."""
    now = moment.regime.limits(t, moment.x.tolist())
    wide = moment.bands or [0.0] * len(now)
    return any(active.side * now[active.guard] > wide[active.guard] for active in moment.regime.watched)


def resting(moment: HybridState, t: float) -> dict[int, str]:
    """Elements that slip, with no speed across them as others hold their ends, and the modes in which they hold."""
    regime, slipping = moment.regime, dict[int, ActiveGuard]()
    for active in regime.watched:
        k = active.element
        modes, name = regime.elements[k].modes, regime.modes[k]
        if active.leave.to and any(back.by_torque and back.to == name for back in modes[active.leave.to].leaves):
            slipping[k] = active
    if not slipping:
        return {}
    here = moment.course(t)
    now, near, still = here[3], regime.limits(*regime.beside(here)), regime.assembly.resting
    return {
        k: active.leave.to
        for k, active in slipping.items()
        if (k in still and active.leave.by_speed) or now[active.guard] == near[active.guard] == 0.0
    }
