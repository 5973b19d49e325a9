"""Commutation: diodes and freewheels that take over a current or torque which a transition would cut off."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import chain, combinations, islice

from sympy import Expr

from shaftwork.components.branches import ACROSS, THROUGH
from shaftwork.core.errors import NetworkError
from shaftwork.hybrid.hybrid_state import EventOutcome, HybridState, Transition, exceeded
from shaftwork.hybrid.hybrid_transfer import HybridTransfer, mode_anew
from shaftwork.hybrid.modes.mode_machines import NO_IMPACT, ModeMachine, ModeNames, with_modes


class Commutation:
    """Finds what diodes and freewheels do where currents and torques would be cut off.

    Args:
        transfer: from one combination of modes to another.
    """

    def __init__(self, transfer: HybridTransfer) -> None:
        self._transfer, self._machines = transfer, transfer.machines

    def commutated(self, t: float, after: float, state: HybridState, changed: dict[int, str]) -> EventOutcome:
        """Machines pass to other modes, and diodes and freewheels to those in which they take over what is cut off."""
        modes = with_modes(state.regime.modes, changed)
        plain = self._transfer.to_modes(state, after, modes)
        names = plain.regime.stores.through
        if plain.x is state.x or not names or self._keeps(after, state, plain, names):
            return plain, self._transitions(t, state, changed)
        if goes_on := self._keeping(after, state, modes, takeovers(self._machines, modes), names):
            return goes_on[0], self._transitions(t, state, changed | goes_on[1])
        return plain, self._transitions(t, state, changed)

    def switched(self, t: float, after: float, state: HybridState, number: int, to: str) -> EventOutcome | None:
        """A switch changes, with all others whose time it is too, and diodes so that all that is stored goes on.

        None where that is not possible: a current is cut off, or a capacitor is charged at once. Of several switches
        those that open do so before others close then.
        """
        modes, changed = state.regime.modes, {number: to}
        now, bands = state.regime.guards_at(after, state.x.tolist()), state.bands
        for active in state.regime.watched:
            k = active.machine
            met = active.leave.by_time and active.side * now[active.guard] >= -(bands[active.guard] if bands else 0.0)
            if k not in changed and met and self._machines[k].is_switch:
                changed[k] = active.leave.to or mode_anew(state, after, k)
        new_modes, names = with_modes(modes, changed), state.regime.stores.names
        # diodes that begin to conduct, and those that no longer do
        options = [*_led(self._machines, new_modes, ACROSS), *_led(self._machines, new_modes, -THROUGH)]
        if goes_on := self._keeping(after, state, new_modes, _sets(options, 0), names):
            return goes_on[0], self._transitions(t, state, changed | goes_on[1])
        opens = {k: to for k, to in changed.items() if not self._machines[k].is_rigid(to)}
        if not 0 < len(opens) < len(changed):
            return None
        with suppress(NetworkError):  # then each by itself, which says what contradicts what
            return self.commutated(t, after, state, opens)
        return None

    def _transitions(self, t: float, state: HybridState, changed: Mapping[int, str]) -> list[Transition]:
        return [Transition(t, self._machines[k], state.regime.modes[k], name) for k, name in changed.items()]

    def _keeping(
        self, t: float, state: HybridState, modes: ModeNames, sets: Iterable[dict[int, str]], names: Sequence[str]
    ) -> tuple[HybridState, dict[int, str]] | None:
        """The first of sets of diodes with which what is stored under some names goes on, and the state in their modes.

        No diode is about to change again; a switch may be, whose transition follows.
        """
        for pairs in sets:
            with suppress(NetworkError):
                other = self._transfer.to_modes(state, t, with_modes(modes, pairs))
                if not self._keeps(t, state, other, names):
                    continue
                if not any(self._machines[active.machine].is_one_way for _, active in exceeded(other, t, other)[1]):
                    return other, pairs
        return None

    def _keeps(self, t: float, state: HybridState, other: HybridState, names: Sequence[str]) -> bool:
        """Whether what is stored under some names, torques or speeds, is the same in other modes."""
        if other.x is state.x:
            return True
        before, after = state.stored(t), other.stored(t)
        through = state.regime.stores.through
        for kind in ([name for name in names if name in through], [name for name in names if name not in through]):
            least = NO_IMPACT * sum(abs(before[name]) for name in kind)
            if sum(abs(after[name] - before[name]) for name in kind) > least:
                return False
        return True


def takeovers(machines: Sequence[ModeMachine], modes: ModeNames) -> Iterator[dict[int, str]]:
    """Diodes and freewheels that may begin to conduct at one instant, with the modes in which they do."""
    return _sets(_led(machines, modes, ACROSS), 1)


def _sets(options: Sequence[tuple[int, str]], least: int, most: int = 500) -> Iterator[dict[int, str]]:
    """Sets of at least so many options, the smallest first, and at most so many of them: all of eight diodes."""
    sizes = range(least, len(options) + 1)
    return islice(chain.from_iterable(map(dict, combinations(options, size)) for size in sizes), most)


def _led(machines: Sequence[ModeMachine], modes: ModeNames, when: Expr) -> list[tuple[int, str]]:
    """Diodes and freewheels whose mode a guard ends, with the modes that follow."""
    pairs = ((k, leave) for k, name in enumerate(modes) for leave in machines[k].modes[name].leaves)
    return [(k, leave.to) for k, leave in pairs if leave.when == when and leave.to and machines[k].is_one_way]
