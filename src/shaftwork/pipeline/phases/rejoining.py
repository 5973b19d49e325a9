"""At an event, what others hold at rest is joined with them again: who carries is told anew, in the network's order."""

from __future__ import annotations

from collections.abc import Iterator

from shaftwork.pipeline.phases.elements import Element
from shaftwork.pipeline.phases.moments import Change, Moment, Regime, together
from shaftwork.pipeline.phases.regimes import with_modes
from shaftwork.pipeline.phases.settling import Settling


def settled(settling: Settling, t: float, after: float, moment: Moment, met: int | None) -> tuple[Moment, list[Change]]:
    """The same as `Settling.settle`, where a law that falls at once would tell a way in which nothing moves.

    Of two frictions one has given way at rest, and now the other one does, backward: once it moves, the first one has
    less torque than it holds at rest, and it would move forward instead, which the other one does not let it.

    Args:
        settling: changes modes.
        t, after, moment, met: as there.

    Raises:
        SimulationError: as there.
    """
    regime = moment.regime
    joins = dict(_held(settling, regime))
    if not joins or (met is None and not settling.ends(Moment(regime, moment.x), after, moment.x)):
        return settling.settle(t, after, moment, met)
    new = settling.regime(with_modes(regime.modes, joins))
    joined = Moment(new, new.assembly.taking(after, settling.held(moment, after), new.p))
    outcome, changes = settling.settle(t, after, joined, None)
    if outcome.regime.modes == regime.modes:  # rounding hides what was met
        named = next(((k, watched.leave) for k, watched in regime.watched if watched.guard == met), None)
        same = next((watched.guard for k, watched in new.watched if (k, watched.leave) == named), None)
        outcome, changes = settling.settle(t, after, joined, same)
    begun = [Change(t, settling.elements[k], regime.modes[k], name) for k, name in joins.items()]
    return outcome, together([*begun, *changes])


def _held(settling: Settling, regime: Regime) -> Iterator[tuple[int, str]]:
    """Elements in their form of rest, and the modes in which they are joined."""
    forms = [choice.form for item in regime.assembly.model.netlist.placed for choice in item.choices]
    for k, (element, name, form) in enumerate(zip(settling.elements, regime.modes, forms, strict=True)):
        if form == element.modes[name].at_rest:
            yield k, _stuck(element, name)


def _stuck(element: Element, name: str) -> str:
    """The mode that gives way to another one."""
    return next(mode.name for mode in element.modes.options if name in (slips for _, slips in mode.gives_way))
