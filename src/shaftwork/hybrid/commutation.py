"""Commutation: diodes and freewheels that take over a current or torque which a change of mode would cut off."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import chain, combinations, islice

from sympy import Expr

from shaftwork.components.branches import ACROSS, THROUGH
from shaftwork.core.errors import NetworkError
from shaftwork.hybrid.hybrid_state import Change, HybridState, Transition, exceeded
from shaftwork.hybrid.modes.mode_machines import NO_IMPACT, ModeMachine, ModeNames, with_modes
from shaftwork.hybrid.phases import Regimes, anew

MOST = 500
"""So many sets of diodes are tried at one instant, the smallest first: all of a circuit with eight of them."""


class Commutation:
    """Finds what diodes and freewheels do where currents and torques would be cut off.

    Args:
        regimes: combinations of modes.
    """

    def __init__(self, regimes: Regimes) -> None:
        self._regimes, self._elements = regimes, regimes.elements

    def commutated(self, moment: HybridState, t: float, modes: ModeNames) -> tuple[HybridState, dict[int, str]]:
        """The modes that are wanted, and what then takes over a torque or current that they would cut off."""
        plain = self._regimes.changed(moment, t, modes)
        names = plain.regime.stores.through
        if plain.x is not moment.x and names and not self._keeps(t, moment, plain, names):
            for other, changed in self._keeping(t, moment, modes, takeovers(self._elements, modes), names):
                if not exceeded(other, t, other)[1]:
                    return other, changed
        return plain, {}

    def switched(self, t: float, after: float, moment: HybridState, number: int, to: str) -> Transition | None:
        """A switch changes, with all others whose time it is too, and diodes so that all that is stored goes on.

        None where that is not possible: a current is cut off, or a capacitor is charged at once. Of several switches
        those that open do so before others close then.
        """
        modes, changed = moment.regime.modes, {number: to}
        now, bands = moment.regime.limits(after, moment.x.tolist()), moment.bands
        for active in moment.regime.watched:
            k = active.element
            met = active.leave.by_time and active.side * now[active.guard] >= -(bands[active.guard] if bands else 0.0)
            if k not in changed and met and self._elements[k].is_switch:
                changed[k] = active.leave.to or anew(moment, after, k)
        new_modes, names = with_modes(modes, changed), moment.regime.stores.names
        # diodes that begin to conduct, and those that no longer do
        options = [*_led(self._elements, new_modes, ACROSS), *_led(self._elements, new_modes, -THROUGH)]
        for new, led in self._keeping(after, moment, new_modes, _sets(options, 0), names):
            if not any(self._elements[active.element].is_one_way for _, active in exceeded(new, after, new)[1]):
                return new, self._changes(t, modes, changed | led)
        opens = {k: to for k, to in changed.items() if not self._elements[k].joins(to)}
        if not 0 < len(opens) < len(changed):
            return None
        with suppress(NetworkError):  # then each by itself, which says what contradicts what
            new, led = self.commutated(moment, after, with_modes(modes, opens))
            return new, self._changes(t, modes, opens | led)
        return None

    def _changes(self, t: float, modes: ModeNames, changed: Mapping[int, str]) -> list[Change]:
        return [Change(t, self._elements[k], modes[k], name) for k, name in changed.items()]

    def _keeping(
        self, t: float, moment: HybridState, modes: ModeNames, sets: Iterable[dict[int, str]], names: Sequence[str]
    ) -> Iterator[tuple[HybridState, dict[int, str]]]:
        """Of modes with other ones of diodes those in which what is stored under some names goes on."""
        for pairs in sets:
            with suppress(NetworkError):
                other = self._regimes.changed(moment, t, with_modes(modes, pairs))
                if self._keeps(t, moment, other, names):
                    yield other, pairs

    def _keeps(self, t: float, moment: HybridState, other: HybridState, names: Sequence[str]) -> bool:
        """Whether what is stored under some names, torques or speeds, is the same in other modes."""
        if other.x is moment.x:
            return True
        before, after = moment.stored(t), other.stored(t)
        through = moment.regime.stores.through
        for kind in ([name for name in names if name in through], [name for name in names if name not in through]):
            least = NO_IMPACT * sum(abs(before[name]) for name in kind)
            if sum(abs(after[name] - before[name]) for name in kind) > least:
                return False
        return True


def takeovers(elements: Sequence[ModeMachine], modes: ModeNames) -> Iterator[dict[int, str]]:
    """Diodes and freewheels that may begin to conduct at one instant, with the modes in which they do."""
    return _sets(_led(elements, modes, ACROSS), 1)


def _sets(options: Sequence[tuple[int, str]], least: int) -> Iterator[dict[int, str]]:
    sizes = range(least, len(options) + 1)
    return islice(chain.from_iterable(map(dict, combinations(options, size)) for size in sizes), MOST)


def _led(elements: Sequence[ModeMachine], modes: ModeNames, when: Expr) -> list[tuple[int, str]]:
    """Diodes and freewheels whose mode a guard ends, with the modes that follow."""
    pairs = ((k, leave) for k, name in enumerate(modes) for leave in elements[k].modes[name].leaves)
    return [(k, leave.to) for k, leave in pairs if leave.when == when and leave.to and elements[k].is_one_way]
