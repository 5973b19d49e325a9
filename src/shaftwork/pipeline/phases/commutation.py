"""Commutation: diodes and freewheels that take over a current or torque which a change of mode would cut off."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import chain, combinations, islice

from sympy import Expr

from shaftwork.components.branches import ACROSS, INTEGRAL, THROUGH
from shaftwork.components.laws import t as TIME
from shaftwork.components.modes import Leave, Modes
from shaftwork.core.errors import NetworkError
from shaftwork.pipeline.phases.contacts import one_side
from shaftwork.pipeline.phases.courses import Way
from shaftwork.pipeline.phases.hybrid_state import Change, HybridState, Transition
from shaftwork.pipeline.phases.mode_machines import NO_IMPACT, ModeMachine, ModeNames
from shaftwork.pipeline.phases.regimes import Regimes, anew, with_modes

MOST = 500
"""So many sets of diodes are tried at one instant, the smallest first: all of a circuit with eight of them."""


class Commutation:
    """Finds what diodes and freewheels do where currents and torques would be cut off.

    Args:
        regimes: combinations of modes.
        elements: of the network.
        beyond: what ends modes at once, of a moment and a time in s.
    """

    def __init__(
        self, regimes: Regimes, elements: Sequence[ModeMachine], beyond: Callable[[HybridState, float], list[Way]]
    ) -> None:
        self._regimes, self._elements, self._beyond = regimes, elements, beyond

    def commutated(self, moment: HybridState, t: float, modes: ModeNames) -> tuple[HybridState, dict[int, str]]:
        """The modes that are wanted, and what then takes over a torque or current that they would cut off."""
        plain = self._regimes.changed(moment, t, modes)
        names = plain.regime.assembly.stores.through
        if plain.x is not moment.x and names and not self._keeps(t, moment, plain, names):
            for other, changed in self._keeping(t, moment, modes, takeovers(self._elements, modes), names):
                if not self._beyond(other, t):
                    return other, changed
        return plain, {}

    def switched(self, t: float, after: float, moment: HybridState, number: int, to: str) -> Transition | None:
        """A switch changes, with all others whose time it is too, and diodes so that all that is stored goes on.

        None where that is not possible: a current is cut off, or a capacitor is charged at once. Of several switches
        those that open do so before others close then.
        """
        modes, changed = moment.regime.modes, {number: to}
        now, bands = moment.regime.limits(after, moment.x.tolist()), moment.bands
        for k, made in moment.regime.watched:
            met = by_time(made.leave) and made.side * now[made.guard] >= -(bands[made.guard] if bands else 0.0)
            if k not in changed and met and is_switch(self._elements[k].modes):
                changed[k] = made.leave.to or anew(self._elements, moment, after, k)
        new_modes, names = with_modes(modes, changed), moment.regime.assembly.stores.names
        ways = [*_begins(self._elements, new_modes), *_ends(self._elements, new_modes)]
        for new, led in self._keeping(after, moment, new_modes, _sets(ways, 0), names):
            if not any(is_one_way(self._elements[k].modes) for k, _ in self._beyond(new, after)):
                return new, self._changes(t, modes, changed | led)
        opens = {k: to for k, to in changed.items() if not self._joins(k, to)}
        if not 0 < len(opens) < len(changed):
            return None
        with suppress(NetworkError):  # then each by itself, which says what contradicts what
            new, led = self.commutated(moment, after, with_modes(modes, opens))
            return new, self._changes(t, modes, opens | led)
        return None

    def _joins(self, number: int, name: str) -> bool:
        modes = self._elements[number].modes
        return modes[name].form != modes.options[0].form

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
        before, after, through = (
            self._regimes.held(moment, t),
            self._regimes.held(other, t),
            moment.regime.assembly.stores.through,
        )
        for kind in ([name for name in names if name in through], [name for name in names if name not in through]):
            least = NO_IMPACT * sum(abs(before[name]) for name in kind)
            if sum(abs(after[name] - before[name]) for name in kind) > least:
                return False
        return True


def takeovers(elements: Sequence[ModeMachine], modes: ModeNames) -> Iterator[dict[int, str]]:
    """Diodes and freewheels that may begin to conduct at one instant, with the modes in which they do."""
    return _sets(_begins(elements, modes), 1)


def _sets(ways: Sequence[tuple[int, str]], least: int) -> Iterator[dict[int, str]]:
    sizes = range(least, len(ways) + 1)
    return islice(chain.from_iterable(map(dict, combinations(ways, size)) for size in sizes), MOST)


def _begins(elements: Sequence[ModeMachine], modes: ModeNames) -> list[tuple[int, str]]:
    """Diodes and freewheels that do not conduct, with the modes in which they do."""
    return _led(elements, modes, ACROSS)


def _ends(elements: Sequence[ModeMachine], modes: ModeNames) -> list[tuple[int, str]]:
    """Those that conduct, with the modes in which they do not."""
    return _led(elements, modes, -THROUGH)


def _led(elements: Sequence[ModeMachine], modes: ModeNames, when: Expr) -> list[tuple[int, str]]:
    pairs = ((k, leave) for k, name in enumerate(modes) for leave in elements[k].modes[name].leaves)
    return [(k, leave.to) for k, leave in pairs if leave.when == when and leave.to and is_one_way(elements[k].modes)]


def is_one_way(modes: Modes) -> bool:
    """Whether an element is a diode or a freewheel: it joins by a torque of one sign, as soon as speeds let it."""
    rebounds = any(leave.rebound is not None for mode in modes.options for leave in mode.leaves)
    return not rebounds and any(one_side(modes, mode.name) is not None for mode in modes.options)


def is_switch(modes: Modes) -> bool:
    """Whether an element joins its ends whatever passes: a time or a law says when it does."""
    first, *others = modes.options
    joined = [mode for mode in others if mode.form != first.form]
    return bool(joined) and not modes.passes_on and not any(mode.gives_way for mode in joined)


def by_time(leave: Leave) -> bool:
    """Whether the time alone ends a mode."""
    return leave.by_twist and not leave.when.has(INTEGRAL) and leave.when.has(TIME)
