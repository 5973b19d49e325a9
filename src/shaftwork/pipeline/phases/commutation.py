"""Commutation: diodes and freewheels that take over a current or torque which a change of mode would cut off."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain, combinations

from shaftwork.components.branches import ACROSS
from shaftwork.pipeline.phases.collisions import NO_IMPACT
from shaftwork.pipeline.phases.elements import Element, ModeNames
from shaftwork.pipeline.phases.moments import Moment
from shaftwork.pipeline.phases.regimes import Regimes, with_modes

AT_ONCE = 2
"""So many diodes may begin to conduct at one instant: those of a bridge."""


def commutations(
    regimes: Regimes, elements: Sequence[Element], t: float, moment: Moment, plain: Moment
) -> Iterator[tuple[Moment, dict[int, str]]]:
    """Modes in which all torques of springs and currents of inductors go on, with the elements that let them.

    Args:
        regimes: combinations of modes.
        elements: of the network.
        t: time in s at which inputs are read.
        moment: what was before.
        plain: the modes that are wanted, in which some of that may be cut off.
    """
    names = plain.regime.assembly.stores.through
    if plain.x is moment.x or not names:
        return
    held, modes = regimes.held(moment, t), plain.regime.modes
    least = NO_IMPACT * sum(abs(held[name]) for name in names)

    def cuts_off(other: Moment) -> bool:
        stored = regimes.held(other, t)
        return sum(abs(stored[name] - held[name]) for name in names) > least

    if not cuts_off(plain):
        return
    for pairs in takeovers(elements, modes):
        if regimes.possible(changed := with_modes(modes, pairs)):
            other = regimes.changed(moment, t, changed)
            if not cuts_off(other):
                yield other, pairs


def takeovers(elements: Sequence[Element], modes: ModeNames) -> Iterator[dict[int, str]]:
    """Diodes and freewheels that may begin to conduct at one instant, with the modes in which they do."""
    ways = [
        (k, leave.to)
        for k, name in enumerate(modes)
        for leave in elements[k].modes[name].leaves
        if leave.when == ACROSS and leave.to
    ]
    return chain.from_iterable(map(dict, combinations(ways, count)) for count in range(1, AT_ONCE + 1))
